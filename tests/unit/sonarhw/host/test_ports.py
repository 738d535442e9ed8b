"""Ports with known USB ids, and a device that returns under another name."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from sonarhw.link import KNOWN_USB_IDS, Port, PortFinder, Usb, find_port, serial_ports

MEGA = (0x2341, 0x0042)


def port(device: str, vendor: int | None, product: int | None, serial: str | None, location: str) -> SimpleNamespace:
    """Return a port as pyserial describes it."""
    return SimpleNamespace(
        device=device, description="serial", vid=vendor, pid=product, serial_number=serial, location=location
    )


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> list[SimpleNamespace]:
    """Return the list of connected ports."""
    ports: list[SimpleNamespace] = []
    monkeypatch.setattr("sonarhw.link.comports", lambda: _Sortable.all(ports))
    return ports


class _Sortable(SimpleNamespace):
    @classmethod
    def all(cls, ports: list[SimpleNamespace]) -> "list[_Sortable]":
        return [cls(**vars(port)) for port in ports]

    def __lt__(self, other: "_Sortable") -> bool:
        return bool(self.device < other.device)


def test_only_known_usb_adapters_are_taken_for_scanners(plugged: list[SimpleNamespace]) -> None:
    plugged += [
        port("/dev/b", *MEGA, "1", "1-1"),
        port("/dev/a", None, None, None, ""),
        port("/dev/c", 1, 2, "3", "1-2"),
    ]
    assert [(found.device, found.known) for found in serial_ports()] == [
        ("/dev/a", None),
        ("/dev/b", KNOWN_USB_IDS[MEGA]),
        ("/dev/c", None),
    ]


def test_a_device_is_found_at_any_port_by_its_serial_number(plugged: list[SimpleNamespace], tmp_path: Path) -> None:
    first, second = tmp_path / "ttyUSB0", tmp_path / "ttyUSB1"
    first.touch()
    plugged.append(port(str(first), *MEGA, "74932", "1-1"))
    find = PortFinder(str(first))
    assert find() == str(first)
    first.unlink()
    plugged[:] = [port("/dev/other", *MEGA, "11111", "1-1")]
    assert find() == str(first)  # the device has not returned yet
    plugged.append(port(str(second), *MEGA, "74932", "1-2"))
    assert find() == str(second)


def test_a_link_to_a_port_is_identified_by_its_target(plugged: list[SimpleNamespace], tmp_path: Path) -> None:
    real, link, moved = tmp_path / "ttyACM0", tmp_path / "sonar", tmp_path / "ttyACM1"
    real.touch()
    os.symlink(real, link)
    plugged.append(port(str(real), *MEGA, "74932", "1-1"))
    find = PortFinder(str(link))
    assert find() == str(link)
    real.unlink()
    plugged[:] = [port(str(moved), *MEGA, "74932", "1-1")]
    assert find() == str(moved)


def test_identical_adapters_are_distinguished_by_their_usb_socket_only() -> None:
    usb = Usb(*MEGA, None, "1-1")
    here, there = Port("/dev/a", "", Usb(*MEGA, None, "1-1")), Port("/dev/b", "", Usb(*MEGA, None, "1-2"))
    assert find_port(usb, [here, there]) == "/dev/a"
    assert find_port(Usb(*MEGA, None, "1-9"), [here, there]) is None
    assert find_port(Usb(*MEGA, None, "1-9"), [there]) == "/dev/b"
    assert find_port(Usb(1, 2, None, "1-1"), [here, there]) is None


def test_an_address_that_is_not_a_local_port_stays_unchanged() -> None:
    assert PortFinder("socket://somewhere:7000")() == "socket://somewhere:7000"
