"""A byte link to a scanner at any URL that pyserial opens, with errors that say what to do.

One thread may read while another thread writes or calls `wake`.
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

BOOTLOADER = 2.0  # s for which the bootloader runs after a reset by the opening of the port
WRITE_WITHIN = 2.0  # s
READ_PATIENCE = 0.05  # s for which a read waits for the first byte
MOST = 4096  # most bytes of one read
_WITH_HOST = ("socket", "rfc2217")  # URL schemes with host and port
_KNOWN = ("alt", "cp2110", "hwgrep", "loop", "spy")
# ImportError: a scheme needs a library that is not installed; the others: parts of a URL that pyserial does not check
_OPENING_ERRORS = (SerialException, OSError, ValueError, ImportError, LookupError, TypeError, AttributeError)
_POLL = 0.005  # s between checks for bytes, for ports without a file descriptor


class Link:
    """An open link; a context manager. A second `close` does nothing."""

    def __init__(self, url: str) -> None:
        """Open `url`. Raises InputError for an invalid URL, LinkBusy, LinkForbidden, or LinkError if it fails."""
        _check_url(url)
        self.url = url
        try:
            self._port = _closed_port(url)
            # a rising DTR resets many boards
            self._port.dtr = False
            if os.name == "posix" and "://" not in url:
                self._port.exclusive = True
            self._port.open()
        except _OPENING_ERRORS as error:
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
        """Whether the baud rate can be set, as for a local port or one behind an RFC 2217 server."""
        return "://" not in self.url or self.url.startswith("rfc2217://")

    @property
    def quiet(self) -> float:
        """Time after opening in which nothing may be sent, s: on a port with DTR, opening may have reset the board."""
        return BOOTLOADER if self.bauds and _has_modem_lines(self._port) else 0.0

    def set_baud(self, baud: int) -> None:
        """Change the baud rate after all written bytes have been sent. Raises LinkLost if the link is lost."""
        if baud == self._baud or not self.bauds:
            return
        try:
            self._port.flush()
            self._port.baudrate = baud
        except (SerialException, OSError, ValueError, TypeError) as error:
            raise self._gone(error) from error
        self._baud = baud

    def read(self) -> bytes:
        """Return the received bytes. Waits up to READ_PATIENCE for the first byte. Empty if none arrives.

        Raises LinkLost if the link is lost.
        """
        try:
            self._wait()
            return self._port.read(MOST)
        except (SerialException, OSError, ValueError, TypeError) as error:
            # TypeError: the port was closed during the read, and pyserial used its missing descriptor
            raise self._gone(error) from error

    def write(self, data: bytes) -> None:
        """Write all bytes. Raises LinkLost if the link is lost or accepts no bytes for WRITE_WITHIN."""
        try:
            self._port.write(data)
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
        port = cast(serial.Serial, Rfc2217Port(None, baudrate=FIRST_BAUD, timeout=0))  # has no write timeout
        port.port = url
        return port
    return serial.serial_for_url(url, do_not_open=True, baudrate=FIRST_BAUD, timeout=0, write_timeout=WRITE_WITHIN)


def _check_url(url: str) -> None:
    """Raise InputError if `url` is invalid. The port itself is not checked."""
    scheme, separator, _ = url.partition("://")
    if not url.strip():
        raise InputError("no URL: expected a serial port such as /dev/ttyUSB0, or socket://HOST:PORT")
    if not separator:
        return
    if scheme in _WITH_HOST:
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
    elif scheme not in _KNOWN:
        known = ", ".join(f"{name}://" for name in sorted((*_WITH_HOST, *_KNOWN)))
        raise InputError(f"{url}: unknown scheme {scheme}://; expected {known}, or the name of a serial port")


def _check_pattern(url: str) -> None:
    pattern = url.partition("://")[2].partition("&")[0]
    try:
        re.compile(pattern)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(f"{url}: invalid regular expression: {error}; write \\ before a bracket") from error


def _has_modem_lines(port: serial.SerialBase) -> bool:
    try:
        return getattr(port, "cts", None) is not None
    except (SerialException, OSError, ValueError):  # a pseudo-terminal has none
        return False


def _keep_dtr_when_closed(port: serial.SerialBase) -> None:
    """Keep DTR unchanged at the end, so that opening the port again does not reset the board."""
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
        return LinkBusy(f"{url}: {', '.join(who)} {held} the port; close the other program that uses it and try again")
    if code == errno.EACCES or "Permission denied" in text or "PermissionError" in text:
        return LinkForbidden(f"{url}: no permission to open this port; {_how_to_get_permission(url)}")
    if code == errno.ENOENT or "FileNotFoundError" in text:
        meant = f"; did you mean socket://{url}?" if re.fullmatch(r"[\w.-]+:\d+", url) else ""
        return LinkError(f"{url}: there is no such port; `sonarhw ports` lists the existing ones{meant}")
    if code == errno.EISDIR or "Inappropriate ioctl" in text:
        return LinkError(f"{url}: is not a serial port; `sonarhw ports` lists the existing ones")
    if "Name or service not known" in text or "getaddrinfo" in text or "nodename nor servname" in text:
        return LinkError(f"{url}: unknown host name; check its spelling")
    if "refused" in text:
        return LinkError(f"{url}: connection refused; start the scanner or check host and port")
    return LinkError(f"{url}: cannot be opened: {text}")


def _how_to_get_permission(url: str) -> str:
    if os.name != "posix":
        return "if another program uses it, close that program"
    import grp

    try:
        group = grp.getgrgid(os.stat(url).st_gid).gr_name
    except (OSError, KeyError):
        return "ask the administrator of this machine"
    return f"join the group {group} (sudo usermod -aG {group} $USER), then log in again"
