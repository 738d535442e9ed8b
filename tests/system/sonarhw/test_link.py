"""The effects of a link on its port: DTR, speed, and the error when the port fails."""

import itertools
import os
import termios
from collections.abc import Iterator
from typing import Any

import pytest
import serial
from serial.tools.list_ports_common import ListPortInfo

from sonarhw.errors import InputError, LinkError, SonarError
from sonarhw.link import BOOTLOADER, Link, PortFinder
from sonarhw.wire.limits import FIRST_BAUD
from tests.hang_guard import wait_until

Ends = tuple[int, int]  # of a pseudo-terminal


class SpiedPort(serial.SerialBase):  # type: ignore[misc]
    """A port with modem lines that records the calls to it in order."""

    def __init__(self, **_: Any) -> None:
        self.calls: list[tuple[str, Any]] = []
        self.cts = True

    def __setattr__(self, name: str, value: Any) -> None:
        if name in ("dtr", "exclusive", "baudrate"):
            self.calls.append((name, value))
        else:
            object.__setattr__(self, name, value)

    def open(self) -> None:
        self.calls.append(("open", None))

    def flush(self) -> None:
        self.calls.append(("flush", None))

    def fileno(self) -> int:
        raise OSError

    def close(self) -> None:
        """Do nothing."""


@pytest.fixture
def spied(monkeypatch: pytest.MonkeyPatch) -> SpiedPort:
    """Replace the port that the next link opens, and return it."""
    port = SpiedPort()
    monkeypatch.setattr("sonarhw.link.serial.serial_for_url", lambda *_, **__: port)
    return port


@pytest.fixture
def terminal() -> Iterator[str]:
    """Return the name of a pseudo-terminal."""
    master, slave = os.openpty()
    yield os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_dtr_is_low_and_access_is_exclusive_before_the_port_is_opened(spied: SpiedPort) -> None:
    Link("/dev/ttyUSB0").close()
    names = [name for name, _ in spied.calls]
    assert ("dtr", False) in spied.calls
    assert names.index("dtr") < names.index("open")
    if os.name == "posix":
        assert names.index("exclusive") < names.index("open")


def test_only_a_port_with_modem_lines_waits_for_a_bootloader(
    spied: SpiedPort, terminal: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Link("/dev/ttyUSB0") as link:
        assert link.quiet == BOOTLOADER
    monkeypatch.undo()
    with Link(terminal) as link:
        assert link.quiet == 0.0


def test_the_speed_changes_after_all_written_bytes_are_sent(spied: SpiedPort) -> None:
    with Link("/dev/ttyUSB0") as link:
        spied.calls.clear()
        link.set_baud(FIRST_BAUD)
        assert spied.calls == []
        link.set_baud(1_000_000)
        assert spied.calls == [("flush", None), ("baudrate", 1_000_000)]


def test_the_speed_reaches_the_terminal(terminal: str) -> None:
    with Link(terminal) as link:
        assert link.bauds
        link.set_baud(500_000)
        descriptor = os.open(terminal, os.O_RDONLY | os.O_NOCTTY)
        try:
            assert termios.tcgetattr(descriptor)[4] == termios.B500000
        finally:
            os.close(descriptor)


def test_closing_a_port_leaves_dtr_unchanged(terminal: str) -> None:
    descriptor = os.open(terminal, os.O_RDONLY | os.O_NOCTTY)
    try:
        attributes = termios.tcgetattr(descriptor)
        attributes[2] |= termios.HUPCL
        termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
        with Link(terminal):
            assert not termios.tcgetattr(descriptor)[2] & termios.HUPCL
    finally:
        os.close(descriptor)


def test_a_terminal_that_another_program_has_now_is_not_opened_again() -> None:
    ends = os.openpty()
    url = os.ttyname(ends[1])
    find = PortFinder(url)
    assert [find(), find()] == [url, url]
    created = os.stat(url).st_ctime_ns
    close([ends])
    opened: list[Ends] = []
    wait_until(lambda: opened.extend(open_again(url, created)) or opened)
    try:
        with pytest.raises(LinkError, match="another program has its number now"):
            find()
        assert PortFinder(url)() == url
    finally:
        close(opened)


def open_again(url: str, created: int) -> list[Ends]:
    """Open terminals until one has this name; return them. None if that is another program's, or its time is the same.

    The system gives the lowest free number, and counts times of creation in steps of some ms.
    """
    opened = [os.openpty()]
    while number(os.ttyname(opened[-1][1])) < number(url):
        opened.append(os.openpty())
    if os.ttyname(opened[-1][1]) == url and os.stat(url).st_ctime_ns != created:
        return opened
    close(opened)
    return []


def number(terminal: str) -> int:
    return int(terminal.rpartition("/")[2])


def close(terminals: list[Ends]) -> None:
    for end in itertools.chain.from_iterable(terminals):
        os.close(end)


@pytest.mark.parametrize(
    ("url", "error", "message"),
    [
        ("hwgrep://(a+)+x", InputError, "takes more than a second; write it without a repetition"),
        ("hwgrep://sonar-[a-c]", LinkError, "no port matches this pattern"),
    ],
)
def test_a_pattern_of_port_names_is_matched_within_a_limit(
    url: str, error: type[SonarError], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sonarhw.link.comports", lambda: [ListPortInfo("/dev/" + 40 * "a")])
    with pytest.raises(error, match=message):
        Link(url)


@pytest.mark.parametrize("options", ["", "&skip_busy"])
def test_a_pattern_opens_the_port_whose_name_it_matches(options: str, monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = os.openpty()
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda _: [ListPortInfo(os.ttyname(slave))])
    monkeypatch.setattr("sonarhw.link.comports", lambda: [ListPortInfo(os.ttyname(slave))])
    with Link(f"hwgrep://PTS/[0-9]+{options}") as link:
        os.write(master, b"reading")
        assert link.read() == b"reading"
    os.close(master)
    os.close(slave)
