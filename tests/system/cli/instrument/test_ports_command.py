"""`sonarhw ports` checks ports that may have a scanner, and all ports with --ask."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.link import Port, Usb
from tests.fixtures.plain_echoes import PlainEchoes
from tests.reference_pages import keys_in_reference


def test_ports_with_known_usb_ids_are_checked_and_others_only_with_ask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    known, unknown = tmp_path / "ttyACM0", tmp_path / "ttyS0"
    with (
        serve(FakeBoard(PlainEchoes(), seed=3), pty=known) as first,
        serve(FakeBoard(PlainEchoes(), seed=4), pty=unknown) as second,
    ):
        ports = [Port(first.url, "USB serial", Usb(0x2341, 0x0042, "1", "1-1")), Port(second.url, "16550")]
        monkeypatch.setattr("sonarhw.link.serial_ports", lambda: ports)
        assert run(["ports"]) == 0
        checked, unchecked = capsys.readouterr().out.splitlines()
        assert checked == f"{known}  Arduino Mega 2560  scanner FAKE-0003, sonarhw-fake 0.1.0"
        assert unchecked == f"{unknown}  16550  not checked; --ask checks all"
        assert run(["ports", "--ask"]) == 0
        assert "scanner FAKE-0004" in capsys.readouterr().out
        assert run(["ports", "--json"]) == 0
        first_port, second_port = json.loads(capsys.readouterr().out)["ports"]
    assert first_port == {
        "url": first.url,
        "description": "USB serial",
        "known_as": "Arduino Mega 2560",
        "usb_id": "2341:0042",
        "usb_serial": "1",
        "scanner": True,
        "answer": "scanner FAKE-0003, sonarhw-fake 0.1.0",
    }
    assert (second_port["url"], second_port["scanner"], second_port["answer"]) == (second.url, None, None)
    assert set(first_port) == keys_in_reference("### `sonarhw ports")


def test_a_port_without_a_scanner_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = str(tmp_path / "ttyUSB0")
    monkeypatch.setattr("sonarhw.link.serial_ports", lambda: [Port(gone, "USB serial", Usb(0x1A86, 0x7523, None, ""))])
    assert run(["ports"]) == 0
    assert "WCH CH340  no scanner: there is no such port" in capsys.readouterr().out
