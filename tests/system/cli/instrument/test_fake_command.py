"""`sonarhw fake`, `info`, `home`, `turn`, `stop`, `monitor` and `ports` with a fake scanner."""

import json
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.faults import KNOWN
from sonarhw.device.served import serve
from sonarhw.log import read_log
from tests.fixtures.plain_echoes import PlainEchoes
from tests.reference_pages import keys_in_reference
from tests.system.cli.instrument.test_scan_command import SIMPLE_ROOM, end, lines, sonarhw, started


@pytest.fixture
def url() -> Iterator[str]:
    """A fake scanner in this process."""
    with serve(FakeBoard(PlainEchoes(), seed=2), tcp="127.0.0.1:0", pace="max") as endpoint:
        yield endpoint.url


def test_a_fake_on_a_pseudo_terminal_is_scanned_and_removes_its_link(tmp_path: Path) -> None:
    link, log = tmp_path / "scanner", tmp_path / "scan.mcap"
    with started("fake", SIMPLE_ROOM, "--place", "figure9", "--pty", link, "--pace", "max") as fake:
        assert lines(fake, 1) == [f"{link}\n"]
        done = sonarhw("scan", link, "--out", log, "--step", "30")
        assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
        fake.send_signal(signal.SIGTERM)
        assert end(fake) == (0, "")
    assert not link.is_symlink()
    recorded = read_log(log)
    assert len(recorded.readings) == 12
    assert recorded.info is not None
    assert (recorded.info.serial, recorded.info.board) == ("FAKE-0000", "polaroid-6500")


def test_the_help_of_the_fake_names_every_fault(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fake", "--help"]) == 0
    printed = capsys.readouterr().out
    assert [name for name in KNOWN if name not in printed] == []


def test_a_fake_prints_its_new_url_after_a_move(tmp_path: Path) -> None:
    link = tmp_path / "scanner"
    faults = ("--faults", "move=1@20,move=1@30", "--pace", "100")
    with started("fake", SIMPLE_ROOM, "--place", "figure9", "--pty", link, *faults) as fake:
        assert lines(fake, 3) == [f"{link}\n", f"{link}-1\n", f"{link}-2\n"]
        assert sonarhw("info", f"{link}-2").returncode == 0


def test_a_scan_of_a_fake_with_faults_is_complete_and_reports_the_losses(tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    faults = "drop=1/3000,reset=0.1@r3,move=0.5@r8"
    url = f"fake:{SIMPLE_ROOM}?place=figure9&pace=2&faults={faults}"
    done = sonarhw("scan", url, "--out", log, "--step", "30")
    assert done.returncode == 0
    assert re.search(r"the connection was lost \d+ times? and restored", done.stderr)
    assert [reading.number for reading in read_log(log).readings] == list(range(12))


def test_a_fake_url_is_a_scanner_in_the_same_process(tmp_path: Path) -> None:
    again = []
    for name in ("first", "second"):
        log = tmp_path / f"{name}.mcap"
        done = sonarhw("scan", f"fake:{SIMPLE_ROOM}?place=figure9&seed=3&pace=max", "--out", log, "--step", "45")
        assert (done.returncode, len(done.stderr.splitlines())) == (0, 1)
        again.append([reading.echo_times for reading in read_log(log).readings])
    assert again[0] == again[1]  # the noise depends on the seed only


@pytest.mark.parametrize(
    "query",
    ["?place=nowhere", "?pace=quick", "?seed=-1", "?colour=red", "?faults=drop=2", "?place=figure9&board=nonesuch"],
)
def test_an_invalid_fake_url_is_bad_usage(query: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["scan", f"fake:{SIMPLE_ROOM}{query}", "--out", str(tmp_path / "scan.mcap")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    "wrong",
    [
        ["--place", "nowhere"],
        ["--board", "nonesuch"],
        ["--pace", "0"],
        ["--tcp", "7000"],
        ["--seed", "-1"],
        ["--faults", "rust=1"],
    ],
    ids=" ".join,
)
def test_a_fake_with_wrong_options_prints_no_url(wrong: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    place = [] if "--place" in wrong else ["--place", "figure9"]
    assert run(["fake", str(SIMPLE_ROOM), *place, *wrong]) == 2
    printed = capsys.readouterr()
    assert (printed.out, len(printed.err.splitlines())) == ("", 1)


def test_info_prints_identity_and_link_statistics(url: str) -> None:
    done = sonarhw("info", url)
    assert (done.returncode, done.stderr) == (0, "")
    facts = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    assert facts["serial"] == "FAKE-0002"
    assert facts["protocol"] == "1.2"
    assert facts["temperature"] == "21.3 °C"
    assert facts["started"] == "1 time"
    assert {"home mark", "thermometer", "envelope"} <= set(facts["capabilities"].split(", "))
    assert facts["turns"].startswith("-720 to 720 degrees")
    frames = re.fullmatch(
        r"(\d+) frames, 0 missing, 0 rejected, \d+ commands repeated, lost 0 times, round trip \d+\.\d ms"
        r"; the scanner: (\d+) frames, 0 rejected, 0 bytes overrun",
        facts["link"],
    )
    assert frames
    assert int(frames[1]) >= 22
    assert int(frames[2]) >= 22


def test_info_as_json_has_the_documented_keys(url: str) -> None:
    done = sonarhw("info", url, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert {key: found[key] for key in ("url", "origin", "serial", "protocol", "temperature_c", "starts")} == {
        "url": url,
        "origin": "fake",
        "serial": "FAKE-0002",
        "protocol": "1.2",
        "temperature_c": 21.3,
        "starts": 1,
    }
    assert found["capabilities"]["lowest_angle_deg"] == -720.0
    assert found["link"]["frames_received"] >= 22
    assert set(found) == keys_in_reference("### `sonarhw info")


def test_info_of_a_log_prints_the_recorded_scanner(url: str, tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    assert sonarhw("scan", url, "--out", log, "--step", "90").returncode == 0
    done = sonarhw("info", log)
    assert (done.returncode, done.stderr) == (0, "")
    assert "FAKE-0002" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["home"], "the turntable is at its zero"),
        (["turn", "90"], "turned to 90.0°"),
        (["turn", "-90"], "turned to -90.0°"),
        (["stop"], "stopped"),
    ],
    ids=" ".join,
)
def test_home_turn_and_stop_report_what_they_did(url: str, arguments: list[str], line: str) -> None:
    command, *angle = arguments
    done = sonarhw(command, url, *angle)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", f"{url}: {line}\n")


def test_a_turn_too_far_is_refused(url: str) -> None:
    refused = sonarhw("turn", url, "1000")
    assert refused.returncode == 1
    message = r"sonarhw: .*refused Turn: 1000 degrees; the cable winds from -720 to 720 degrees\n"
    assert re.fullmatch(message, refused.stderr)
    impossible = sonarhw("turn", url, "3000")
    assert (impossible.returncode, len(impossible.stderr.splitlines())) == (2, 1)
    assert "degrees" in impossible.stderr


def test_info_watch_prints_link_statistics_until_it_is_interrupted(url: str) -> None:
    with started("info", url, "--watch") as info:
        shown = lines(info, 15)
        info.send_signal(signal.SIGINT)
        assert end(info) == (130, "")
    assert re.match(r"ready +\d+ frames, 0 missing, .*; clock drift [+-]\d+ ppm", shown[-1])


def test_monitor_shows_frames_until_it_is_interrupted(url: str) -> None:
    with started("monitor", url) as monitor:
        shown = ""
        while "Heartbeat(state=0" not in shown:
            (line,) = lines(monitor, 1)
            assert line
            shown += line
        monitor.send_signal(signal.SIGINT)
        status, closing = end(monitor)
    assert "Info(command=0" in shown
    assert status == 130
    counted = re.fullmatch(rf"{re.escape(url)}: (\d+) frames and 0 rejected blocks in \d+\.\d s\n", closing)
    assert counted
    assert int(counted[1]) >= len(shown.splitlines())


def test_ports_succeeds_on_this_computer() -> None:
    assert sonarhw("ports").returncode == 0


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("", "no URL: expected a serial port"),
        ("socket://", "expected socket://HOST:PORT"),
        ("socket://127.0.0.1", "expected socket://HOST:PORT"),
        ("socket://127.0.0.1:99999", "expected socket://HOST:PORT"),
        ("rfc2217://", "expected rfc2217://HOST:PORT"),
        ("bogus://x", "unknown scheme bogus://; expected "),
        ("fake:", "room missing; expected 'fake:NAME?place=NAME' or 'fake:FILE.toml?place=NAME'"),
        (f"fake:{SIMPLE_ROOM.parent / 'laboratory.toml'}", "add ?place=NAME, one of bench, door"),
    ],
)
def test_an_invalid_url_gives_an_error_of_one_line(url: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["info", url]) == 2
    printed = capsys.readouterr()
    assert (printed.out, len(printed.err.splitlines())) == ("", 1)
    assert message in printed.err


@pytest.mark.parametrize("address", ["foo", "127.0.0.1:99999"])
def test_a_fake_checks_its_address_before_its_place(address: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fake", str(SIMPLE_ROOM.parent / "laboratory.toml"), "--tcp", address]) == 2
    assert capsys.readouterr().err.startswith(f"sonarhw: {address}: expected HOST:PORT")


def test_errors_of_a_scan_contain_the_given_url(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"fake:{SIMPLE_ROOM}?place=figure9&pace=max&faults=protocol=2.0"
    assert run(["scan", url, "--out", str(tmp_path / "scan.mcap")]) == 1
    assert capsys.readouterr().err.startswith(f"sonarhw: {url}: ")


def test_a_fake_at_an_address_that_is_not_local_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["fake", str(SIMPLE_ROOM), "--place", "figure9", "--tcp", "256.1.1.1:0"]) == 2
    message = "sonarhw: 256.1.1.1:0: 256.1.1.1 is not a local address; try 127.0.0.1:0\n"
    assert capsys.readouterr().err == message
