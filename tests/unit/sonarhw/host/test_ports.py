"""Ports with known USB ids, and a device that returns under another name."""

from pathlib import Path

import pytest
from serial.tools.list_ports_common import ListPortInfo

from sonarhw.link import KNOWN_USB_IDS, Port, PortFinder, Usb, find_port, serial_ports

MEGA = (0x2341, 0x0042)


def port(device: str, vendor: int | None, product: int | None, serial: str | None, location: str) -> ListPortInfo:
    """Return a port as pyserial describes it."""
    found = ListPortInfo(device)
    found.vid, found.pid, found.serial_number, found.location = vendor, product, serial, location
    return found


@pytest.fixture
def plugged(monkeypatch: pytest.MonkeyPatch) -> list[ListPortInfo]:
    """Return the list of connected ports."""
    ports: list[ListPortInfo] = []
    monkeypatch.setattr("sonarhw.link.comports", lambda: ports)
    return ports


def test_only_known_usb_adapters_are_taken_for_scanners(plugged: list[ListPortInfo]) -> None:
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


@pytest.mark.parametrize("linked", [False, True], ids=["by its name", "by a link to it"])
def test_a_device_is_found_by_its_serial_number(plugged: list[ListPortInfo], tmp_path: Path, linked: bool) -> None:
    first, second, link = tmp_path / "ttyUSB0", tmp_path / "ttyUSB1", tmp_path / "sonar"
    first.touch()
    link.symlink_to(first)
    plugged.append(port(str(first), *MEGA, "74932", "1-1"))
    name = str(link if linked else first)
    find = PortFinder(name)
    assert find() == name
    first.unlink()
    plugged[:] = [port("/dev/other", *MEGA, "11111", "1-1")]
    assert find() == name  # the device has not returned yet
    plugged.append(port(str(second), *MEGA, "74932", "1-2"))
    assert find() == str(second)


def test_identical_adapters_are_distinguished_by_their_usb_socket_only() -> None:
    usb = Usb(*MEGA, None, "1-1")
    here, there = Port("/dev/a", "", Usb(*MEGA, None, "1-1")), Port("/dev/b", "", Usb(*MEGA, None, "1-2"))
    assert find_port(usb, [here, there]) == "/dev/a"
    assert find_port(Usb(*MEGA, None, "1-9"), [here, there]) is None
    assert find_port(Usb(*MEGA, None, "1-9"), [there]) == "/dev/b"
    assert find_port(Usb(1, 2, None, "1-1"), [here, there]) is None


def test_an_address_that_is_not_a_local_port_stays_unchanged() -> None:
    assert PortFinder("socket://somewhere:7000")() == "socket://somewhere:7000"
