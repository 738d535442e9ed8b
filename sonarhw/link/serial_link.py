"""The way to the scanner: any URL that pyserial opens, with errors a person can act on.

Takes bytes to write; hands on the bytes that have come. One thread may read while another writes, or wakes it.
"""

import errno
import os
import re
import select
import socket
import time
from contextlib import suppress
from typing import cast
from urllib.parse import urlsplit

import serial
from serial.serialutil import SerialException

from sonarhw.errors import InputError, LinkBusy, LinkError, LinkForbidden, LinkLost
from sonarhw.link.ports import holders
from sonarhw.link.rfc2217_port import Rfc2217Port
from sonarhw.wire.limits import FIRST_BAUD

BOOTLOADER = 2.0  # s in which a board that opening the port has reset listens for a new program
WRITE_WITHIN = 2.0  # s
READ_PATIENCE = 0.05  # s; how long a read waits for the first byte
MOST = 4096  # bytes a read returns
_WITH_HOST = ("socket", "rfc2217")  # what pyserial opens by host and port
_KNOWN = ("alt", "cp2110", "hwgrep", "loop", "spy")
_POLL = 0.005  # s, where the system cannot tell that bytes have come


class Link:
    """An open link. A context manager; closing it twice does no harm."""

    def __init__(self, url: str) -> None:
        """Open `url`. Raises InputError for one that says nothing, LinkBusy, LinkError where it cannot be opened."""
        _check_url(url)
        self.url = url
        try:
            self._port = _closed_port(url)
            # a rising DTR resets many boards
            self._port.dtr = False
            if os.name == "posix" and "://" not in url:
                self._port.exclusive = True
            self._port.open()
        except (SerialException, OSError, ValueError) as error:
            raise _why_not_open(url, error) from error
        self._selectable = os.name == "posix" and _has_descriptor(self._port)
        self._woken, self._waker = socket.socketpair()
        self._waker.setblocking(False)
        self._baud = FIRST_BAUD
        if "://" not in url:
            _keep_dtr_when_closed(self._port)

    def __enter__(self) -> "Link":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def bauds(self) -> bool:
        """Whether its speed can be set: that of a port of this machine, or of one behind an RFC 2217 server."""
        return "://" not in self.url or self.url.startswith("rfc2217://")

    @property
    def quiet(self) -> float:
        """How long to say nothing after opening, s: where there is a DTR, opening may have reset the board."""
        return BOOTLOADER if self.bauds and _has_modem_lines(self._port) else 0.0

    def set_baud(self, baud: int) -> None:
        """Change the speed, once all that was written has gone. Raises LinkLost where the link has gone away."""
        if baud == self._baud or not self.bauds:
            return
        try:
            self._port.flush()
            self._port.baudrate = baud
        except (SerialException, OSError, ValueError, TypeError) as error:
            raise self._gone(error) from error
        self._baud = baud

    def read(self) -> bytes:
        """The bytes that have come, waiting up to READ_PATIENCE for the first; empty where none came.

        Raises LinkLost where the link has gone away.
        """
        try:
            self._wait()
            return self._port.read(MOST)
        except (SerialException, OSError, ValueError, TypeError) as error:
            # a port closed meanwhile has no descriptor: pyserial then hands None to the system
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Write all bytes. Raises LinkLost where the link has gone away or takes nothing for WRITE_WITHIN."""
        try:
            self._port.write(data)
        except serial.SerialTimeoutException as error:
            raise LinkLost(f"{self.url}: takes no bytes for {WRITE_WITHIN:g} s; is the scanner alive?") from error
        except (SerialException, OSError, ValueError, TypeError) as error:
            raise self._gone(error) from error

    def _gone(self, error: Exception) -> LinkLost:
        return LinkLost(f"{self.url}: the link went away: {_reason(error)}; plug it in again")

    def wake(self) -> None:
        """End the wait of a read in another thread: there is something to write."""
        with suppress(OSError):
            self._waker.send(b"x")

    def close(self) -> None:
        """Close the link. Never raises."""
        # pyserial leaves the socket open where the peer has gone first
        peer = getattr(self._port, "_socket", None)
        with suppress(SerialException, OSError):
            self._port.close()
        for end in (peer, self._woken, self._waker):
            if end is not None:
                with suppress(OSError):
                    end.close()

    def _wait(self) -> None:
        if self._selectable:
            ready, _, _ = select.select([self._port.fileno(), self._woken.fileno()], [], [], READ_PATIENCE)
            if self._woken.fileno() in ready:
                self._woken.recv(MOST)
            return
        waited = 0.0
        while not self._port.in_waiting and waited < READ_PATIENCE:
            time.sleep(_POLL)
            waited += _POLL


def _closed_port(url: str) -> serial.Serial:
    if url.startswith("rfc2217://"):
        port = cast(serial.Serial, Rfc2217Port(None, baudrate=FIRST_BAUD, timeout=0))  # it knows no timeout of writing
        port.port = url
        return port
    return serial.serial_for_url(url, do_not_open=True, baudrate=FIRST_BAUD, timeout=0, write_timeout=WRITE_WITHIN)


def _check_url(url: str) -> None:
    """Raise InputError where `url` cannot lead anywhere, whatever is plugged in."""
    scheme, separator, _ = url.partition("://")
    if not url.strip():
        raise InputError("no URL: expected a serial port such as /dev/ttyUSB0, or socket://HOST:PORT")
    if not separator:
        return
    if scheme in _WITH_HOST:
        try:
            parts = urlsplit(url)
            complete = bool(parts.hostname) and bool(parts.port)
        except ValueError:  # a port that is no number, or over 65535
            complete = False
        if not complete:
            raise InputError(f"{url}: expected {scheme}://HOST:PORT, with a port from 1 to 65535")
    elif scheme not in _KNOWN:
        known = ", ".join(f"{name}://" for name in sorted((*_WITH_HOST, *_KNOWN)))
        raise InputError(f"{url}: {scheme}:// is not known; known: {known}, or the name of a serial port")


def _has_modem_lines(port: serial.SerialBase) -> bool:
    try:
        return getattr(port, "cts", None) is not None
    except (SerialException, OSError, ValueError):  # a pseudo-terminal
        return False


def _keep_dtr_when_closed(port: serial.SerialBase) -> None:
    """Leave DTR as it is at the end, so that opening the port again is no reset."""
    if os.name != "posix":
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
        return LinkBusy(f"{url}: {', '.join(who)} {held} the port; close what is not the scanner itself and try again")
    if code == errno.EACCES or "Permission denied" in text or "PermissionError" in text:
        return LinkForbidden(f"{url}: you may not open this port; {_how_to_be_allowed(url)}")
    if code == errno.ENOENT or "FileNotFoundError" in text:
        meant = f"; did you mean socket://{url}?" if re.fullmatch(r"[\w.-]+:\d+", url) else ""
        return LinkError(f"{url}: there is no such port; `sonarhw ports` lists those there are{meant}")
    if code == errno.EISDIR or "Inappropriate ioctl" in text:
        return LinkError(f"{url}: is no serial port; `sonarhw ports` lists those there are")
    if "Name or service not known" in text or "getaddrinfo" in text or "nodename nor servname" in text:
        return LinkError(f"{url}: there is no host of that name; check it")
    if "refused" in text:
        return LinkError(f"{url}: nobody listens there; start the scanner or check host and port")
    return LinkError(f"{url}: cannot be opened: {text}")


def _how_to_be_allowed(url: str) -> str:
    if os.name != "posix":
        return "another program may hold it: close that one"
    import grp

    try:
        group = grp.getgrgid(os.stat(url).st_gid).gr_name
    except (OSError, KeyError):
        return "ask whoever runs this machine"
    return f"join the group {group} (sudo usermod -aG {group} $USER), then log in again"
