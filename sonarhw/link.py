"""Links to a scanner: serial ports, sockets and RFC 2217, with counters of their traffic."""

import errno
import os
import re
import select
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, cast
from urllib.parse import parse_qs, urlsplit

import serial
from serial.rfc2217 import Serial
from serial.serialutil import SerialException
from serial.tools.list_ports import comports

from sonarhw.errors import InputError, LinkBusy, LinkError, LinkForbidden, LinkLost
from sonarhw.wire.limits import FIRST_BAUD

_SMOOTHED = 0.2  # weight of the newest round trip in the average


@dataclass(frozen=True)
class LinkStatistics:
    """Counters of the traffic over one connection or several."""

    frames_received: int = 0
    frames_sent: int = 0
    bytes_received: int = 0
    bytes_sent: int = 0
    rejected_blocks: int = 0  # blocks between delimiters that are not a valid frame
    rejected_messages: int = 0  # undamaged frames with a payload that does not match the message type
    missing_frames: int = 0  # gaps in the device's sequence numbers
    repeated_commands: int = 0
    resends: int = 0  # Resend commands
    lost_readings: int = 0  # readings that the device no longer kept for a Resend; they are measured again
    losses: int = 0  # times the device was lost: unplugged, silent or reset
    reopened: int = 0  # times the port was opened again
    resets: int = 0  # times the device restarted
    round_trip: float | None = None  # s from a command to its answer, smoothed

    def more(self, **counts: int) -> "LinkStatistics":
        """Return a copy with `counts` added."""
        return replace(self, **{name: getattr(self, name) + count for name, count in counts.items()})

    def __add__(self, later: "LinkStatistics") -> "LinkStatistics":
        """Return the sum of both. The round trip is that of `later`, if it has one."""
        counts = {
            item.name: getattr(self, item.name) + getattr(later, item.name)
            for item in fields(self)
            if item.name != "round_trip"
        }
        return LinkStatistics(**counts, round_trip=self.round_trip if later.round_trip is None else later.round_trip)


def smoothed(average: float | None, newest: float) -> float:
    """Return the smoothed round trip, s, after one more measurement."""
    return newest if average is None else average + _SMOOTHED * (newest - average)


# the serial ports of this machine, their USB devices and users; no port is opened


# by vendor and product: USB adapters and boards that scanners use
KNOWN_USB_IDS = {
    (0x2341, 0x0010): "Arduino Mega 2560",
    (0x2341, 0x0042): "Arduino Mega 2560",
    (0x2341, 0x0242): "Arduino Mega 2560",
    (0x2A03, 0x0010): "Arduino Mega 2560",
    (0x2A03, 0x0042): "Arduino Mega 2560",
    (0x2341, 0x0001): "Arduino Uno",
    (0x2341, 0x0043): "Arduino Uno",
    (0x2341, 0x0243): "Arduino Uno",
    (0x2A03, 0x0043): "Arduino Uno",
    (0x1A86, 0x7523): "WCH CH340",
    (0x1A86, 0x55D4): "WCH CH9102",
    (0x0403, 0x6001): "FTDI FT232R",
    (0x0403, 0x6015): "FTDI FT231X",
    (0x10C4, 0xEA60): "Silicon Labs CP210x",
    (0x16C0, 0x0483): "PJRC Teensy",
    (0x2E8A, 0x000A): "Raspberry Pi Pico",
}
_PROCESSES = Path("/proc")
_TERMINALS = "/dev/pts/"


@dataclass(frozen=True)
class Usb:
    """The identity of a USB serial device, independent of the name of its port."""

    vendor: int
    product: int
    serial_number: str | None
    location: str | None  # USB socket


@dataclass(frozen=True)
class Port:
    """A serial port."""

    device: str
    description: str
    usb: Usb | None = None  # None: not a USB device

    @property
    def known(self) -> str | None:
        """Name of the USB adapter or board, if scanners use this type; otherwise None."""
        return KNOWN_USB_IDS.get((self.usb.vendor, self.usb.product)) if self.usb else None


def serial_ports() -> list[Port]:
    """Return all serial ports, sorted by name."""
    return [
        Port(
            port.device,
            port.description,
            None if port.vid is None else Usb(port.vid, port.pid, port.serial_number, port.location),
        )
        for port in sorted(comports())
    ]


class PortFinder:
    """Finds the current port of a USB device, also after the name of its port has changed."""

    def __init__(self, url: str) -> None:
        """Remember the device at `url`. A URL with a scheme, such as `socket://`, never changes."""
        self._url = url
        self._usb: Usb | None = None
        self._created: int | None = None  # ns since the epoch, of a pseudo-terminal

    def __call__(self) -> str:
        """Return the present URL of the device. Raises LinkError if another program now has the pseudo-terminal."""
        if "://" in self._url:
            return self._url
        self._check_same_terminal()
        ports = serial_ports()
        here = _usb_of(self._url, ports)
        if here or os.path.exists(self._url) or not self._usb:
            self._usb = here or self._usb
            return self._url
        return find_port(self._usb, ports) or self._url

    def _check_same_terminal(self) -> None:
        """The system gives the number of a closed pseudo-terminal to the next program that opens one."""
        if not self._url.startswith(_TERMINALS):
            return
        try:
            created = os.stat(self._url).st_ctime_ns
        except FileNotFoundError:
            return
        if self._created not in (None, created):
            raise LinkError(f"{self._url}: the pseudo-terminal is gone, and another program has its number now")
        self._created = created


def _usb_of(device: str, ports: list[Port]) -> Usb | None:
    """Return the USB device behind the name of a port or a symbolic link to it. None if there is none."""
    real = os.path.realpath(device)
    return next((port.usb for port in ports if os.path.realpath(port.device) == real), None)


def find_port(usb: Usb, ports: list[Port]) -> str | None:
    """Return the current port of a USB device, or None.

    A device without a serial number is identified by vendor, product and USB socket.
    """
    alike = [port for port in ports if port.usb and (port.usb.vendor, port.usb.product) == (usb.vendor, usb.product)]
    if usb.serial_number:
        alike = [port for port in alike if port.usb and port.usb.serial_number == usb.serial_number]
    else:
        alike = [port for port in alike if port.usb and port.usb.location == usb.location] or alike
    # None for several candidates, because one of them may be another scanner
    return alike[0].device if len(alike) == 1 else None


def holders(device: str) -> list[str]:
    """Return name and number of each process that has a port open, if the system shows them.

    If this process is the only one, the list contains "this program".
    """
    real = os.path.realpath(device)
    processes = {process for process, path in _open_files() if path == real}
    others = sorted(_named(process) for process in processes if int(process.name) != os.getpid())
    return others or ["this program"] * bool(processes)


def _open_files() -> Iterator[tuple[Path, str]]:
    if not _PROCESSES.is_dir():
        return
    for process in _PROCESSES.iterdir():
        if process.name.isdecimal():
            yield from ((process, path) for path in _opened_by(process))


def _opened_by(process: Path) -> list[str]:
    paths = []
    try:
        for descriptor in (process / "fd").iterdir():
            paths.append(os.readlink(descriptor))  # noqa: PERF401 - paths read before an error are kept
    except OSError:  # the process has ended, or belongs to another user
        pass
    return paths


def _named(process: Path) -> str:
    try:
        name = (process / "comm").read_text().strip()
    except OSError:
        name = "a process"
    return f"{name} ({process.name})"


class Rfc2217Port(Serial):
    """A serial port behind a server such as ser2net, with faster reads than pyserial.

    pyserial would leave a socket open after the server has closed the connection, and its thread print a traceback.
    """

    def read(self, size: int = 1) -> bytes:
        """Return the received bytes, at most `size`. Raises SerialException if the server has closed the connection."""
        # with a timeout of 0, pyserial returns one byte per call, which is too slow for traces
        data = bytearray()
        while len(data) < size and (piece := super().read(1)):
            data += piece
        return bytes(data)

    def close(self) -> None:
        """Close the port."""
        # pyserial leaves the socket open if the peer has closed first
        socket: Any = getattr(self, "_socket", None)
        super().close()
        if socket is not None:
            socket.close()

    def _internal_raw_write(self, data: bytes) -> None:
        try:
            super()._internal_raw_write(data)  # type: ignore[misc]  # missing in the type stubs
        except OSError:
            # no caller catches errors of pyserial's reader thread; its next read fails in any case
            if threading.current_thread() is not getattr(self, "_thread", None):
                raise


# byte links, with errors that say what to do


BOOTLOADER = 2.0  # s for which the bootloader runs after a reset by the opening of the port
WRITE_WITHIN = 2.0  # s
READ_PATIENCE = 0.05  # s for which a read waits for the first byte
MOST = 4096  # most bytes of one read
WITH_HOST = ("socket", "rfc2217")  # URL schemes with host and port
_EXPECTED = (
    "a serial port such as /dev/ttyUSB0, socket://HOST:PORT, 'fake:ROOM?place=NAME', or 'lines:PORT?preset=NAME' for a "
    "device that prints text"
)
KNOWN_SCHEMES = ("alt", "cp2110", "hwgrep", "loop", "spy")
# ImportError: a scheme needs a library that is not installed; the others: parts of a URL that pyserial does not check
_OPENING_ERRORS = (SerialException, OSError, ValueError, ImportError, LookupError, TypeError, AttributeError)
_POLL = 0.005  # s between checks for bytes, for ports without a file descriptor


class Link:
    """An open link; a context manager. A second `close` does nothing."""

    def __init__(self, url: str) -> None:
        """Open `url`. Raises InputError for an invalid URL, LinkBusy, LinkForbidden, or LinkError if it fails."""
        _check_url(url)
        self.url = url
        exact = _matching_url(url) if url.startswith("hwgrep://") else url
        try:
            self.port = _closed_port(exact)
            # a rising DTR resets many boards
            self.port.dtr = False
            if sys.platform != "win32" and "://" not in url:
                self.port.exclusive = True
            self.port.open()
        except _OPENING_ERRORS as error:
            raise _why_not_open(url, error) from error
        self._selectable = sys.platform != "win32" and _has_descriptor(self.port)
        self._woken, self._waker = socket.socketpair()
        self._waker.setblocking(False)
        self._baud = FIRST_BAUD
        if "://" not in url:
            _keep_dtr_when_closed(self.port)

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def bauds(self) -> bool:
        """Whether the baud rate can be set, as for a local port or one behind an RFC 2217 server."""
        return "://" not in self.url or self.url.startswith("rfc2217://")

    @property
    def quiet(self) -> float:
        """Time after opening in which nothing may be sent, s: on a port with DTR, opening may have reset the board."""
        return BOOTLOADER if self.bauds and _has_modem_lines(self.port) else 0.0

    def set_baud(self, baud: int) -> None:
        """Change the baud rate after all written bytes have been sent. Raises LinkLost if the link is lost."""
        if baud == self._baud or not self.bauds:
            return
        try:
            self.port.flush()
            self.port.baudrate = baud
        except (SerialException, OSError, ValueError, TypeError) as error:
            raise self._gone(error) from error
        self._baud = baud

    def read(self) -> bytes:
        """Return the received bytes. Waits up to READ_PATIENCE for the first byte. Empty if none arrives.

        Raises LinkLost if the link is lost.
        """
        try:
            self._wait()
            return self.port.read(MOST)
        except (SerialException, OSError, ValueError, TypeError) as error:
            # TypeError: the port was closed during the read, and pyserial used its missing descriptor
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Write all bytes. Raises LinkLost if the link is lost or accepts no bytes for WRITE_WITHIN."""
        try:
            self.port.write(data)
        except serial.SerialTimeoutException as error:
            text = f"{self.url}: accepted no bytes for {WRITE_WITHIN:g} s; check that the scanner is running"
            raise LinkLost(text) from error
        except (SerialException, OSError, ValueError, TypeError) as error:
            raise self._gone(error) from error

    def _gone(self, error: Exception) -> LinkLost:
        return LinkLost(f"{self.url}: the link was lost: {_reason(error)}; plug the scanner in again")

    def wake(self) -> None:
        """End the wait of a read in another thread, because there is something to write."""
        with suppress(OSError):
            self._waker.send(b"x")

    def close(self) -> None:
        """Close the link. Never raises."""
        # pyserial leaves the socket open if the peer has closed first
        peer = getattr(self.port, "_socket", None)
        with suppress(SerialException, OSError):
            self.port.close()
        for end in (peer, self._woken, self._waker):
            if end is not None:
                with suppress(OSError):
                    end.close()

    def _wait(self) -> None:
        if self._selectable:
            ready, _, _ = select.select([self.port.fileno(), self._woken.fileno()], [], [], READ_PATIENCE)
            if self._woken.fileno() in ready:
                self._woken.recv(MOST)
            return
        waited = 0.0
        while not self.port.in_waiting and waited < READ_PATIENCE:
            time.sleep(_POLL)
            waited += _POLL


def _closed_port(url: str) -> serial.Serial:
    if url.startswith("rfc2217://"):
        port = cast(serial.Serial, Rfc2217Port(None, baudrate=FIRST_BAUD, timeout=0))  # has no write timeout
        port.port = url
        return port
    return serial.serial_for_url(url, do_not_open=True, baudrate=FIRST_BAUD, timeout=0, write_timeout=WRITE_WITHIN)


def _check_url(url: str) -> None:
    """Raise InputError if `url` is invalid. The port itself is not checked."""
    scheme, separator, _ = url.partition("://")
    if not url.strip():
        raise InputError(f"no URL: expected {_EXPECTED}")
    if not separator:
        if (word := re.match(r"([a-z]{2,}[\da-z]*):(?!\d+$)", url)) and not os.path.exists(url):
            raise InputError(f"{url}: unknown scheme {word[1]}:; expected {_EXPECTED}")
        return
    if scheme in WITH_HOST:
        try:
            parts = urlsplit(url)
            complete = bool(parts.hostname) and bool(parts.port)
            (parts.hostname or "").encode("idna")
        except UnicodeError as error:
            raise InputError(f"{url}: invalid host name; expected 1 to 63 characters between two dots") from error
        except ValueError:  # the port is not a number, or above 65535
            complete = False
        if not complete:
            raise InputError(f"{url}: expected {scheme}://HOST:PORT, with a port from 1 to 65535")
    elif scheme == "hwgrep":
        _check_pattern(url)
    elif scheme == "spy":
        _check_copies(url)
    elif scheme not in KNOWN_SCHEMES:
        schemes = ", ".join(f"{name}://" for name in sorted((*WITH_HOST, *KNOWN_SCHEMES)))
        address = url.partition("://")[2]
        likely = re.fullmatch(r"([\w.-]+)(?::(\d+))?/?", address)
        meant = f"did you mean socket://{likely[1]}:{likely[2] or 'PORT'}? " if likely else ""
        raise InputError(f"{url}: unknown scheme {scheme}://; {meant}expected {schemes}, or the name of a serial port")


def _check_copies(url: str) -> None:
    """Raise InputError for a named pipe that nothing reads as the `file=` of a URL: it would be opened without end."""
    for copy in parse_qs(urlsplit(url).query).get("file", ()):
        try:
            os.close(os.open(copy, os.O_WRONLY | getattr(os, "O_NONBLOCK", 0)))  # missing on Windows, as named pipes
        except (OSError, ValueError) as error:
            if getattr(error, "errno", None) == errno.ENXIO:
                raise InputError(f"{url}: no program reads the pipe {copy}; start it first") from error


def _check_pattern(url: str) -> None:
    pattern = url.partition("://")[2].partition("&")[0]
    try:
        re.compile(pattern)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(f"{url}: invalid regular expression: {error}; write \\ before a bracket") from error


def _matching_url(url: str) -> str:
    """Return a URL for exactly the ports that match now. Raises LinkError without one, InputError for a slow pattern.

    A match of pyserial has no limit of time, and nothing else of this program runs meanwhile.
    """
    from sonarhw.text.patterns import MatchingProcess  # few URLs need it

    pattern, *options = url.removeprefix("hwgrep://").split("&")
    matching = MatchingProcess(pattern, re.IGNORECASE, "search")
    try:
        texts = {port.device: (port.device, port.description, port.hwid) for port in comports()}
        devices = [device for device in texts if any(matching.groups(text) is not None for text in texts[device])]
    except TimeoutError as error:
        raise InputError(
            f"{url}: matching this pattern takes more than a second; write it without a repetition within a repetition"
        ) from error
    finally:
        matching.close()
    if not devices:
        raise LinkError(f"{url}: no port matches this pattern; `sonarhw ports` lists the existing ones")
    return "&".join((f"hwgrep://^(?:{'|'.join(map(re.escape, devices))})$", *options))


def _has_modem_lines(port: serial.SerialBase) -> bool:
    try:
        return getattr(port, "cts", None) is not None
    except (SerialException, OSError, ValueError):  # a pseudo-terminal has none
        return False


def _keep_dtr_when_closed(port: serial.SerialBase) -> None:
    """Keep DTR unchanged at the end, so that opening the port again does not reset the board."""
    if sys.platform == "win32":
        return
    import termios

    with suppress(termios.error, OSError):
        attributes = termios.tcgetattr(port.fileno())
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, attributes)


def _has_descriptor(port: serial.SerialBase) -> bool:
    try:
        return int(port.fileno()) >= 0
    except (OSError, ValueError, AttributeError):
        return False


def _reason(error: Exception) -> str:
    return str(error) or type(error).__name__


def _why_not_open(url: str, error: Exception) -> LinkError:
    code = error.errno if isinstance(error, OSError) else None
    text = str(error)
    if code in (errno.EAGAIN, errno.EBUSY) or "exclusively lock" in text:
        who = holders(url) or ["another program"]
        held = "holds" if len(who) == 1 else "hold"
        return LinkBusy(f"{url}: {', '.join(who)} {held} the port; close the other program that uses it and try again")
    if code == errno.EACCES or "Permission denied" in text or "PermissionError" in text:
        return LinkForbidden(f"{url}: no permission to open this port; {_how_to_get_permission(url)}")
    if code in (errno.ENOENT, errno.ENOTDIR) or "FileNotFoundError" in text:
        meant = port_meant(url)
        return LinkError(
            f"{url}: there is no such port; `sonarhw ports` lists the existing ones{'; ' if meant else ''}{meant}"
        )
    if code == errno.EISDIR or "Inappropriate ioctl" in text:
        return LinkError(f"{url}: is not a serial port; `sonarhw ports` lists the existing ones")
    if "Name or service not known" in text or "getaddrinfo" in text or "nodename nor servname" in text:
        return LinkError(f"{url}: unknown host name; check its spelling")
    if "refused" in text:
        return LinkError(f"{url}: connection refused; start the scanner or check host and port")
    return LinkError(f"{url}: cannot be opened: {text}")


_ADDRESS = re.compile(r"[\w.-]+:\d+|\d+(?:\.\d+){3}")
_WITH_RATE = re.compile(r"(/dev/[^:,;@? ]+|COM\d+)[:,;@? ](?:baud\w*=)?(\d+)(?:&.*)?")
_LINUX_PORT = re.compile(r"(?i)/?(?:dev/)?(?:tty/?)?(USB|ACM|AMA)[ _-]?(\d+)")  # in any spelling


def port_meant(url: str) -> str:
    """Return what the name of a missing port probably means, as a part of an error; empty: unknown."""
    if sys.platform != "win32" and (port := re.search(r"(?i)COM ?\d+$", url)):
        return f"{port[0]} is a name on Windows; here, ports have names such as /dev/ttyUSB0"
    if rate := _WITH_RATE.fullmatch(url):
        return f"did you mean {rate[1]}, or lines:{rate[1]}?baud={rate[2]}&preset=NAME for a device that prints text?"
    likely = f"/dev/{url}"
    if _ADDRESS.fullmatch(url):
        likely = f"socket://{url}{'' if ':' in url else ':PORT'}"
    elif port := _LINUX_PORT.fullmatch(url):
        likely = f"/dev/tty{port[1].upper()}{port[2]}"
    elif not url.startswith(("tty", "cu.")) and not os.path.exists(likely):
        return ""
    return f"did you mean {likely}?" if likely != url else ""


def _how_to_get_permission(url: str) -> str:
    if sys.platform == "win32":
        return "if another program uses it, close that program"
    import grp

    try:
        group = grp.getgrgid(os.stat(url).st_gid).gr_name
    except (OSError, KeyError):
        return "ask the administrator of this machine"
    return f"join the group {group} (sudo usermod -aG {group} $USER), then log in again"
