"""A link and its port: DTR, speed, patterns of names, and the errors of ports that fail or cannot be opened."""

import errno
import itertools
import os
import termios
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from serial.serialutil import SerialException
from serial.tools.list_ports_common import ListPortInfo

from sonarhw.device.served import TcpServerPort, host_and_port
from sonarhw.errors import InputError, LinkBusy, LinkError, LinkForbidden, LinkLost, SonarError
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


def test_only_modem_lines_are_waited_for(spied: SpiedPort, terminal: str, monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_a_pattern_is_limited(url: str, error: type[SonarError], message: str, monkeypatch: pytest.MonkeyPatch) -> None:
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


# errors, from what pyserial reports on Linux, macOS and Windows


PORT = "/dev/ttyUSB0"
LOCKED = f"Could not exclusively lock port {PORT}: [Errno 11] Resource temporarily unavailable"
NO_ACCESS = "could not open port 'COM3': PermissionError(13, 'Access is denied.', None, 5)"
NO_FILE = "could not open port 'COM9': FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)"
TCP = "socket://scanner:7000"


class Failing(serial.SerialBase):  # type: ignore[misc]
    """A port that cannot be opened, or fails after that."""

    def __init__(self, at_open: Exception | None, later: Exception | None = None) -> None:
        self.at_open, self.later = at_open, later

    def __setattr__(self, name: str, value: Any) -> None:
        object.__setattr__(self, name if name not in ("dtr", "exclusive", "baudrate") else "_ignored", value)

    def open(self) -> None:
        if self.at_open:
            raise self.at_open

    def fileno(self) -> int:
        raise OSError

    @property
    def in_waiting(self) -> int:
        return 1

    def read(self, size: int = 1) -> bytes:
        assert self.later is not None
        raise self.later

    write = read

    def close(self) -> None:
        """Do nothing."""


def opened(monkeypatch: pytest.MonkeyPatch, port: Failing, url: str = PORT) -> Link:
    """Open a link to this port."""
    monkeypatch.setattr("sonarhw.link.serial.serial_for_url", lambda *_, **__: port)
    return Link(url)


@pytest.mark.parametrize(
    ("error", "url", "kind", "message"),
    [
        (SerialException(errno.EAGAIN, LOCKED), PORT, LinkBusy, "another program holds the port; close the other"),
        (SerialException(errno.EBUSY, "Device or resource busy"), PORT, LinkBusy, "holds the port"),
        (SerialException(LOCKED), PORT, LinkBusy, "holds the port"),
        (SerialException(errno.EACCES, "could not open port"), PORT, LinkForbidden, "no permission to open this port"),
        (SerialException(NO_ACCESS), "COM3", LinkForbidden, "no permission to open this port"),
        (SerialException(errno.ENOENT, "could not open port"), PORT, LinkError, "no such port; `sonarhw ports`"),
        (SerialException(NO_FILE), "COM9", LinkError, "there is no such port"),
        (SerialException(errno.ENOENT, ""), "my-pc.lan:7000", LinkError, r"did you mean socket://my-pc.lan:7000\?$"),
        (SerialException(errno.ENOENT, ""), "my-pc.lan:", LinkError, "lists the existing ones$"),
        (SerialException(errno.EISDIR, "Is a directory"), "/tmp", LinkError, "is not a serial port"),
        (SerialException("(25, 'Inappropriate ioctl for device')"), "/dev/null", LinkError, "is not a serial port"),
        (SerialException("[Errno -2] Name or service not known"), TCP, LinkError, "unknown host name"),
        (SerialException("[Errno 8] nodename nor servname provided"), TCP, LinkError, "unknown host name"),
        (SerialException("[Errno 11001] getaddrinfo failed"), TCP, LinkError, "unknown host name"),
        (SerialException("[Errno 111] Connection refused"), TCP, LinkError, "connection refused; start the scanner"),
        (ImportError("No module named 'hid'"), "cp2110://x", LinkError, "cannot be opened: No module named 'hid'"),
    ],
)
def test_the_error_states_the_cause_and_what_to_do(
    monkeypatch: pytest.MonkeyPatch, error: Exception, url: str, kind: type[LinkError], message: str
) -> None:
    monkeypatch.setattr("sonarhw.link.holders", lambda _: [])
    with pytest.raises(LinkError, match=message) as raised:
        opened(monkeypatch, Failing(error), url)
    assert type(raised.value) is kind
    assert str(raised.value).startswith(f"{url}: ")


@pytest.mark.parametrize(
    ("programs", "message"),
    [
        (["minicom (4711)"], r"minicom \(4711\) holds the port"),
        (["cat (1)", "tio (2)"], r"cat \(1\), tio \(2\) hold the"),
    ],
)
def test_programs_at_a_port_are_named(monkeypatch: pytest.MonkeyPatch, programs: list[str], message: str) -> None:
    monkeypatch.setattr("sonarhw.link.holders", lambda _: programs)
    with pytest.raises(LinkBusy, match=message):
        opened(monkeypatch, Failing(SerialException(errno.EBUSY, "busy")))


def test_the_group_that_may_open_a_port_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    grp = pytest.importorskip("grp")
    port = tmp_path / "ttyUSB0"
    port.touch()
    group = grp.getgrgid(port.stat().st_gid).gr_name
    with pytest.raises(LinkForbidden, match=rf"join the group {group} \(sudo usermod -aG {group} \$USER\)"):
        opened(monkeypatch, Failing(SerialException(errno.EACCES, "")), str(port))
    with pytest.raises(LinkForbidden, match="ask the administrator"):
        opened(monkeypatch, Failing(SerialException(errno.EACCES, "")), str(tmp_path / "missing"))


@pytest.mark.parametrize(
    ("error", "reason"), [(OSError(errno.EIO, "Input/output error"), "Input/output error"), (TypeError(), "TypeError")]
)
def test_a_lost_link_states_the_reason(monkeypatch: pytest.MonkeyPatch, error: Exception, reason: str) -> None:
    link = opened(monkeypatch, Failing(None, error))
    for action in (link.read, lambda: link.write(b"x")):
        with pytest.raises(LinkLost, match=f"^{PORT}: the link was lost: .*{reason}; plug the scanner in again"):
            action()
    link.close()
    link.close()


@pytest.mark.parametrize(
    ("url", "message"),
    [
        *(
            (url, "expected")
            for url in ("", "  ", "socket://host", "socket://:7000", "rfc2217://host:0", "http://host:80")
        ),
        (f"socket://{64 * 'a'}:1", "invalid host name; expected 1 to 63 characters between two dots"),
        ("socket://..:1", "invalid host name"),
        ("rfc2217://a..b:1", "invalid host name"),
        ("socket://\udcff:1", "invalid host name"),
        ("socket://127.0.0.1:99999", "with a port from 1 to 65535"),
        ("hwgrep://(", r"invalid regular expression: .*write \\ before a bracket"),
        ("hwgrep://*", "invalid regular expression"),
        ("hwgrep://[&n=1", "invalid regular expression"),
        ("spy://loop://?file=pipe", "no program reads the pipe"),
    ],
)
def test_an_invalid_url_is_refused(url: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    with pytest.raises(InputError, match=message):
        Link(url)


@pytest.mark.parametrize("url", ["alt://x", "alt:///dev/null?class=None", "spy://missing", "cp2110://x", "/"])
def test_what_pyserial_cannot_open_gives_a_link_error_of_one_line(url: str) -> None:
    with pytest.raises(LinkError) as raised:
        Link(url)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("address", ["x:٣", f"x:{5000 * '9'}", "x:99999", "x:-1", "127.0.0.1", ""])
def test_an_invalid_port_to_listen_on_is_refused(address: str) -> None:
    with pytest.raises(InputError, match="expected HOST:PORT"):
        host_and_port(address)


@pytest.mark.parametrize("host", [64 * "a", "..", "a\0b", "\udcff"])
def test_an_invalid_host_to_listen_on_is_refused(host: str) -> None:
    with pytest.raises(SonarError):
        TcpServerPort(f"{host}:0")


def test_a_port_without_a_descriptor_is_polled_until_bytes_arrive(monkeypatch: pytest.MonkeyPatch) -> None:
    class Slow(Failing):
        polls = 0

        @property
        def in_waiting(self) -> int:
            self.polls += 1
            return 5 if self.polls > 3 else 0

        def read(self, size: int = 1) -> bytes:
            return b"bytes"[: self.in_waiting]

    slept: list[float] = []
    monkeypatch.setattr("sonarhw.link.time.sleep", slept.append)
    with opened(monkeypatch, Slow(None)) as link:
        assert link.read() == b"bytes"
    assert len(slept) == 3
