"""Serve a device on a pseudo-terminal or a TCP port, in real time, faster, or as fast as possible.

    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        Scanner.open(endpoint.url)

One thread serves one client after another. While a client does not read, the clock of the device stops, so that only
a few unsent bytes accumulate.
"""

import math
import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal, Protocol

from sonarhw import arguments
from sonarhw.device.protocol import Device
from sonarhw.errors import InputError, LinkError
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Refusal, Refused

# the ports at which a device is served, with one client at a time


_MOST = 4096  # most bytes of one read
_CLIENTS_WAITING = 4
_BUSY = encode_frame(
    Frame(Refused.TYPE, 0, 0, Refused(0, Refusal.BUSY, "another program is connected; close it first").pack())
)
_SEND_BUFFER = 16_384  # bytes; small, so that a slow client delays the device early


class ServerPort(Protocol):
    """A port that serves one client at a time."""

    url: str

    def readers(self) -> list[int]:
        """Return the descriptors that become readable when there is something to do."""

    def writer(self) -> int | None:
        """Return the descriptor of the client to write to; None without a client."""

    def read(self) -> bytes | None:
        """Return the bytes from the client; None if it has just disconnected."""

    def write(self, data: bytes) -> int | None:
        """Write as much as possible now. Return the number of bytes; None if the client has just disconnected."""

    def pull(self) -> None:
        """Unplug the cable: disconnect the client and accept no other."""

    def plug_in(self, socket_number: int) -> None:
        """Plug the cable in again: socket 0 has the first URL, every other socket a new one. Raises LinkError."""

    def close(self) -> None:
        """Close the port."""


class TcpServerPort:
    """A listening TCP socket. While a client is connected, others get a refusal."""

    def __init__(self, address: str) -> None:
        """Listen on HOST:PORT; port 0 selects a free one.

        Raises InputError for an invalid address or an address of another machine, and LinkError if the port is in use.
        """
        host, port = host_and_port(address)
        try:
            # create_server alone would report an unknown host name as a refused connection
            socket.getaddrinfo(host, port, socket.AF_INET)
            self._listener = socket.create_server((host, port), backlog=_CLIENTS_WAITING)
        except socket.gaierror as error:
            raise InputError(f"{address}: {host} is not a local address; try 127.0.0.1:{port}") from error
        except (OSError, ValueError) as error:  # ValueError: a name that cannot be a host name
            code = error.errno if isinstance(error, OSError) else None
            reason = os.strerror(code) if code else str(error)
            raise LinkError(f"{address}: cannot listen there: {reason}; try 127.0.0.1:0") from error
        self._client: socket.socket | None = None
        self._refused: list[socket.socket] = []  # connected, too; each gets a refusal as its answer
        self._host, self._port = host, self._listener.getsockname()[1]
        self.url = f"socket://{host}:{self._port}"

    def readers(self) -> list[int]:
        """Return the descriptors that become readable when there is something to do."""
        ends = (self._listener, self._client, *self._refused) if self._client else (self._listener,)
        return [end.fileno() for end in ends if end.fileno() >= 0]

    def writer(self) -> int | None:
        """Return the descriptor of the client; None without a client."""
        return self._client.fileno() if self._client else None

    def read(self) -> bytes | None:
        """Return the bytes from the client; None if it has just disconnected. Accept a client if there is none."""
        if self._client is None:
            self._client, _ = self._listener.accept()
            self._client.setblocking(False)
            self._client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._client.recv(_MOST)
        except BlockingIOError:
            self._refuse_others()
            return b""
        except OSError:
            data = b""
        if data:
            return data
        self._lose()
        return None

    def write(self, data: bytes) -> int | None:
        """Write as much as possible now. Return the number of bytes; None if the client has just disconnected."""
        if self._client is None:
            return None
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._lose()
            return None

    def _refuse_others(self) -> None:
        """Accept and refuse others. The connected client is still there: it has sent nothing, not even an end."""
        for other in select.select([self._listener, *self._refused], [], [], 0)[0]:
            if other is self._listener:
                self._refused.append(self._listener.accept()[0])
            elif not _refuse(other):
                self._refused.remove(other)
                other.close()

    def pull(self) -> None:
        """Close clients and listener."""
        self._lose()
        while self._refused:
            self._refused.pop().close()
        self._listener.close()

    def plug_in(self, socket_number: int) -> None:
        """Listen again, on the first port or on a free one. Raises LinkError if the port is in use."""
        try:
            self._listener = socket.create_server(
                (self._host, self._port if socket_number == 0 else 0), backlog=_CLIENTS_WAITING
            )
        except OSError as error:
            raise LinkError(f"{self.url}: cannot listen there again: {error.strerror or error}") from error
        self.url = f"socket://{self._host}:{self._listener.getsockname()[1]}"

    def close(self) -> None:
        """Close client and listener."""
        self.pull()

    def _lose(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


class PtyServerPort:
    """A pseudo-terminal behind a symbolic link. Its slave stays open, so that clients may reconnect."""

    url: str
    _master: int
    _descriptors: tuple[int, ...]
    _path: str
    _link: Path | None

    def __init__(self, link: Path | None) -> None:
        """Open a pseudo-terminal. `link` points to it until `close`. Raises InputError if `link` cannot be created."""
        self._first_link = link
        self._open(link)

    def readers(self) -> list[int]:
        """Return the descriptors that become readable when there is something to do."""
        return [self._master] if self._descriptors else []

    def writer(self) -> int | None:
        """Return the descriptor to write to."""
        return self._master if self._descriptors else None

    def read(self) -> bytes | None:
        """Return the bytes from the client."""
        try:
            return os.read(self._master, _MOST)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Write as much as possible now, and return the number of bytes."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def pull(self) -> None:
        """Remove the terminal and its link."""
        self.close()

    def plug_in(self, socket_number: int) -> None:
        """Open a new terminal, behind the first link or behind another one, LINK-1 and so on. Raises InputError."""
        link = self._first_link
        self._open(link.with_name(f"{link.name}-{socket_number}") if link and socket_number else link)

    def close(self) -> None:
        """Remove the link if it still points to this terminal, and close. A second call does nothing."""
        if self._link:
            with suppress(OSError):
                if os.readlink(self._link) == self._path:
                    self._link.unlink()
        self._close_descriptors()

    def _open(self, link: Path | None) -> None:
        if sys.platform == "win32":
            raise InputError("this operating system has no pseudo-terminals; use TCP, 127.0.0.1:0")
        import tty

        self._master, slave = os.openpty()
        self._descriptors = (self._master, slave)
        tty.setraw(slave)
        os.set_blocking(self._master, False)
        self._path = os.ttyname(slave)
        self._link = link
        try:
            if link:
                _make_link(link, self._path)
        except InputError:
            self._close_descriptors()
            raise
        self.url = str(link) if link else self._path

    def _close_descriptors(self) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)
        self._descriptors = ()


def _refuse(client: socket.socket) -> bool:
    """Answer what a client has sent with a refusal. Return whether it is still connected."""
    try:
        if not client.recv(_MOST):
            return False
        client.sendall(_BUSY)
    except OSError:
        return False
    return True


@contextmanager
def open_server_port(pty: Path | None = None, tcp: str | None = None) -> Iterator[ServerPort]:
    """Open a TCP port (`tcp` is HOST:PORT) or a pseudo-terminal (behind the link `pty`), and close it after the block.

    Clients may connect in the block. Raises InputError for an invalid address or link, LinkError if the port is in use.
    """
    port: ServerPort = TcpServerPort(tcp) if tcp is not None else PtyServerPort(pty)
    try:
        yield port
    finally:
        port.close()


def host_and_port(address: str) -> tuple[str, int]:
    """Return host and port of HOST:PORT; the default host is 127.0.0.1. Raises InputError."""
    host, colon, port = address.rpartition(":")
    if not colon or not (port.isascii() and port.isdecimal() and len(port) <= 5) or int(port) > 0xFFFF:
        free = f"127.0.0.1:{address}" if address.isascii() and address.isdecimal() else "127.0.0.1:0"
        raise InputError(f"{address}: expected HOST:PORT, such as {free} (port 0 selects a free port)")
    return host or "127.0.0.1", int(port)


_TERMINALS = ("/dev/pts/", "/dev/ttys")  # pseudo-terminals on Linux and macOS


def _is_stale(link: Path) -> bool:
    """Whether a killed process has left the link behind. Another process may use a terminal of the same name now."""
    if not link.is_symlink() or not os.readlink(link).startswith(_TERMINALS):
        return False
    return not link.exists() or link.stat().st_ctime > link.lstat().st_ctime


def free_link(link: Path) -> None:
    """Remove the link that a killed process left behind. Raises InputError if anything else has its name."""
    if _is_stale(link):
        link.unlink()
    if os.path.lexists(link):
        raise InputError(f"{link}: exists already; choose another name for the pseudo-terminal")


def _make_link(link: Path, target: str) -> None:
    free_link(link)
    try:
        link.symlink_to(target)
    except OSError as error:
        raise InputError(f"{link}: cannot create the link: {error.strerror or error}") from error


Pace = float | Literal["real", "max"]
_LONGEST_WAIT = 0.1  # s
# s of real time that are counted at once: if this process was suspended, the clock of the device does not jump. The
# limit is above the longest wait, because the clock of an idle device would run slow otherwise.
_LONGEST_STEP = 3 * _LONGEST_WAIT


class Clock:
    """The time of the device: real time × `pace`. It stops while the client does not read.

    It stops at each event, until the bytes of the event are sent: a device that computes for long is not silent.
    """

    def __init__(self, pace: Pace) -> None:
        self.now = 0.0
        self._due = 0.0  # the time of the device if it had needed no time for its events
        self.free = pace == "max"
        self.speed = pace if isinstance(pace, float | int) else 1.0
        self._last = time.monotonic()

    def tick(self, held: bool) -> None:
        """Count the real time since the last call. If `held`, the time of the device does not change."""
        real = time.monotonic()
        if not held:
            self._due += min(real - self._last, _LONGEST_STEP) * self.speed
            self._due = min(self._due, self.now + _LONGEST_STEP * self.speed)
        self._last = real

    def step(self, event: float | None) -> float:
        """Advance the time, at most to the next event, and return it."""
        self.now = self._due if event is None else max(self.now, min(self._due, event))
        return self.now

    def skip_to(self, event: float) -> None:
        """Make `event` due at once."""
        self._due = max(self._due, event)

    def real_until(self, event: float) -> float:
        """Return the real time until `event`, s."""
        return max(0.0, event - self._due) / self.speed


def check_pace(pace: Pace) -> Pace:
    """Return `pace` if it is valid. Raises InputError otherwise."""
    if pace not in ("real", "max") and not (isinstance(pace, float | int) and 0 < pace < math.inf):
        raise InputError(f"pace {pace}: expected real, max, or a factor above 0 such as 10")
    return pace


def read_pace(text: str) -> Pace:
    """Return the pace for `real`, `max` or a factor above 0. Raises InputError for anything else."""
    try:
        factor = float(text)
    except ValueError:
        return check_pace(text)  # type: ignore[arg-type]  # check_pace accepts the two words only
    return check_pace(factor)


class Endpoint:
    """A device on a port. `run` serves it in the caller's thread until `stop`."""

    def __init__(
        self, device: Device, port: ServerPort, pace: Pace = "real", moved: Callable[[str], None] = lambda url: None
    ) -> None:
        """`moved` is called with the new URL if the device reappears under another name."""
        self._device = device
        self._port = port
        self._moved = moved
        self._plug = device.plug
        self._clock = Clock(check_pace(pace))
        device.speedup = math.inf if self._clock.free else max(1.0, self._clock.speed)
        self._pending = b""
        self._stopping = False
        self._waker, self._wake = socket.socketpair()
        self._wake.setblocking(False)

    @property
    def url(self) -> str:
        """URL at which clients reach the device, or reached it last."""
        return self._port.url

    def stop(self) -> None:
        """Stop serving. Any thread and any signal handler may call this."""
        self._stopping = True
        with suppress(OSError):
            self._wake.send(b"x")

    def run(self) -> None:
        """Serve until stopped."""
        try:
            while not self._stopping:
                self._clock.tick(held=bool(self._pending))
                if not self._pending:
                    self._pending = self._device.advance(self._clock.step(self._device.next_event()))
                self._follow_cable()
                self._converse(self._wait_for())
        finally:
            self._waker.close()
            self._wake.close()

    def _follow_cable(self) -> None:
        before, self._plug = self._plug, self._device.plug
        if self._plug == before:
            return
        if before is not None:
            self._port.pull()
            self._pending = b""
        if self._plug is not None:
            url = self._port.url
            self._port.plug_in(self._plug)
            if self._port.url != url:
                self._moved(self._port.url)

    def _wait_for(self) -> float:
        """Return the time until something is due, s of real time."""
        if self._pending:
            return _LONGEST_WAIT
        event = self._device.next_event()
        if event is None:
            return _LONGEST_WAIT
        if self._clock.free and self._device.busy:
            self._clock.skip_to(event)
        return min(_LONGEST_WAIT, self._clock.real_until(event))

    def _converse(self, wait: float) -> None:
        if self._pending:
            self._send(wait)
            wait = 0.0
        # no commands are read from a client that does not read, because their answers would accumulate in the device
        if not self._pending:
            self._receive(wait)

    def _send(self, wait: float) -> None:
        writer = self._port.writer()
        if writer is not None and writer not in select.select([self._waker.fileno()], [writer], [], wait)[1]:
            return
        self._sent(self._port.write(self._pending))

    def _receive(self, wait: float) -> None:
        readers = self._port.readers()
        if set(select.select([self._waker.fileno(), *readers], [], [], wait)[0]) & set(readers):
            self._received(self._port.read())

    def _sent(self, count: int | None) -> None:
        if count is None:
            self._lose_client()
        else:
            self._pending = self._pending[count:]

    def _received(self, data: bytes | None) -> None:
        if data is None:
            self._lose_client()
        elif data:
            self._device.receive(data, self._clock.now)

    def _lose_client(self) -> None:
        self._device.hang_up()
        self._pending = b""


@arguments.checked(pty=arguments.file_name, tcp=arguments.text)
@contextmanager
def serve(device: Device, pty: Path | None = None, tcp: str | None = None, pace: Pace = "real") -> Iterator[Endpoint]:
    """Serve `device` in a separate thread, which ends with the block. Raises what `open_server_port` raises.

    An error in the device is raised at the end of the block.
    """
    with open_server_port(pty, tcp) as port:
        endpoint = Endpoint(device, port, pace)
        # clients notice an error by the closed port
        with in_thread(f"serve {port.url}", endpoint.run, endpoint.stop, port.close):
            yield endpoint


@contextmanager
def in_thread(
    name: str,
    work: Callable[[], None],
    end: Callable[[], None],
    failed: Callable[[], None],
    within: float = 2.0,
) -> Iterator[None]:
    """Call `work` in a thread. At the end of the block, `end` it, wait `within` s for it, and raise its error.

    `failed` is called in the thread after an error.
    """
    failures: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as failure:  # noqa: BLE001 - raised again at the end of the block
            failures.append(failure)
            failed()

    thread = threading.Thread(target=run, name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        end()
        thread.join(within)
    if failures:
        raise failures[0]
