"""Serves a device where clients can open it: on a pseudo-terminal or a TCP port, in real time, faster, or at once.

    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        Scanner.open(endpoint.url)

Takes a `Device`; hands its bytes to one client after another. One thread; it never sleeps past a wake-up.
Nothing piles up: bytes a client does not read hold back the device's time, and with it everything it does.
"""

import math
import os
import select
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal, Protocol

from sonarhw.device import Device
from sonarhw.errors import InputError, LinkError

Pace = float | Literal["real", "max"]
_MOST = 4096  # bytes of one read
_LONGEST_STEP = 0.1  # s of real time passed on at once: a stalled machine slows the device, it does not make it jump
_LONGEST_WAIT = 0.25  # s
_FEWEST_CLIENTS_WAITING = 4
_SEND_BUFFER = 16_384  # bytes; a small one lets a slow client hold the device back early


class Clock:
    """The device's time: real time × `pace`, standing still while the client does not read."""

    def __init__(self, pace: Pace) -> None:
        self.now = 0.0
        self.free = pace == "max"
        self._speed = pace if isinstance(pace, float | int) else 1.0
        self._last = time.monotonic()

    def tick(self, held: bool) -> None:
        """Let real time pass; `held`: it does not count."""
        real = time.monotonic()
        if not held:
            self.now += min(real - self._last, _LONGEST_STEP) * self._speed
        self._last = real

    def skip_to(self, event: float) -> None:
        """Let time pass up to `event` at once."""
        self.now = max(self.now, event)

    def real_until(self, event: float) -> float:
        """Real time until `event`, s."""
        return max(0.0, event - self.now) / self._speed


class Door(Protocol):
    """Where clients come in: one at a time."""

    url: str

    def readers(self) -> list[int]:
        """Descriptors that become readable when there is something to do."""

    def writer(self) -> int | None:
        """Descriptor of the client to write to; None without one."""

    def read(self) -> bytes | None:
        """What the client sent; None where it has just gone."""

    def write(self, data: bytes) -> int | None:
        """Write what fits now; how many bytes that was, None where the client has just gone."""

    def close(self) -> None:
        """Shut the door."""


class TcpDoor:
    """A listening socket; the next client is let in when the one before has gone."""

    def __init__(self, address: str) -> None:
        """Listen on HOST:PORT; port 0 picks one. Raises InputError for a bad address, LinkError where taken."""
        host, port = _host_and_port(address)
        try:
            self._listener = socket.create_server((host, port), backlog=_FEWEST_CLIENTS_WAITING)
        except OSError as error:
            raise LinkError(f"{address}: cannot listen there: {error.strerror or error}; try port 0") from error
        self._client: socket.socket | None = None
        self.url = f"socket://{host}:{self._listener.getsockname()[1]}"

    def readers(self) -> list[int]:
        """Descriptors that become readable when there is something to do."""
        return [(self._client or self._listener).fileno()]

    def writer(self) -> int | None:
        """Descriptor of the client; None without one."""
        return self._client.fileno() if self._client else None

    def read(self) -> bytes | None:
        """What the client sent; lets a client in where there is none."""
        if self._client is None:
            self._client, _ = self._listener.accept()
            self._client.setblocking(False)
            self._client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            return b""
        try:
            data = self._client.recv(_MOST)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if data:
            return data
        self._lose()
        return None

    def write(self, data: bytes) -> int | None:
        """Write what fits now; how many bytes that was, None where the client has just gone."""
        if self._client is None:
            return None
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._lose()
            return None

    def close(self) -> None:
        """Shut client and listener."""
        self._lose()
        self._listener.close()

    def _lose(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None


class PtyDoor:
    """A pseudo-terminal behind a symbolic link. The slave stays open, so that clients may come and go."""

    def __init__(self, link: Path | None) -> None:
        """Open one; `link` leads to it until the door is shut. Raises InputError where `link` cannot be made."""
        if os.name != "posix":
            raise InputError("this system has no pseudo-terminals; use --tcp 127.0.0.1:0")
        import tty

        self._master, slave = os.openpty()
        self._descriptors: tuple[int, ...] = (self._master, slave)
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

    def readers(self) -> list[int]:
        """Descriptors that become readable when there is something to do."""
        return [self._master]

    def writer(self) -> int | None:
        """Descriptor to write to."""
        return self._master

    def read(self) -> bytes | None:
        """What the client sent."""
        try:
            return os.read(self._master, _MOST)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Write what fits now; how many bytes that was."""
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Remove the link, where it is still ours, and close. Twice does no harm."""
        if self._link:
            with suppress(OSError):
                if os.readlink(self._link) == self._path:
                    self._link.unlink()
        self._close_descriptors()

    def _close_descriptors(self) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)
        self._descriptors = ()


def check_pace(pace: Pace) -> Pace:
    """`pace`, where it is one. Raises InputError otherwise."""
    if pace not in ("real", "max") and not (isinstance(pace, float | int) and 0 < pace < math.inf):
        raise InputError(f"pace {pace}: expected real, max, or a factor above 0 such as 10")
    return pace


class Endpoint:
    """A device behind a door: `run` serves it in the caller's thread until `stop`."""

    def __init__(self, device: Device, door: Door, pace: Pace = "real") -> None:
        self.url = door.url
        self._device = device
        self._door = door
        self._clock = Clock(check_pace(pace))
        self._pending = b""
        self._stopping = False
        self._waker, self._wake = socket.socketpair()
        self._wake.setblocking(False)

    def stop(self) -> None:
        """End serving; callable from any thread and from a signal handler."""
        self._stopping = True
        with suppress(OSError):
            self._wake.send(b"x")

    def run(self) -> None:
        """Serve until stopped."""
        try:
            while not self._stopping:
                self._clock.tick(held=bool(self._pending))
                if not self._pending:
                    self._pending = self._device.advance(self._clock.now)
                self._converse(self._wait_for())
        finally:
            self._waker.close()
            self._wake.close()

    def _wait_for(self) -> float:
        """How long nothing needs to be done, s of real time."""
        if self._pending:
            return _LONGEST_WAIT
        event = self._device.next_event()
        if event is None:
            return _LONGEST_WAIT
        if self._clock.free and self._device.busy:
            self._clock.skip_to(event)
        return min(_LONGEST_WAIT, self._clock.real_until(event))

    def _converse(self, wait: float) -> None:
        writer = self._door.writer()
        writers = [writer] if writer is not None and self._pending else []
        # a client that does not read is not listened to either, lest its answers pile up in the device
        readers = [] if writers else self._door.readers()
        readable, writable, _ = select.select([self._waker.fileno(), *readers], writers, [], wait)
        if writable or (self._pending and writer is None):
            self._sent(self._door.write(self._pending))
        if set(readable) & set(readers):
            self._received(self._door.read())

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


@contextmanager
def open_door(pty: Path | None = None, tcp: str | None = None) -> Iterator[Door]:
    """A door on TCP (`tcp` is HOST:PORT) or, without it, on a pseudo-terminal (behind the link `pty`), then shut.

    Clients may knock from now on. Raises InputError for an address or link that cannot be, LinkError where the port
    is taken.
    """
    door: Door = TcpDoor(tcp) if tcp is not None else PtyDoor(pty)
    try:
        yield door
    finally:
        door.close()


@contextmanager
def serve(device: Device, pty: Path | None = None, tcp: str | None = None, pace: Pace = "real") -> Iterator[Endpoint]:
    """Serve `device` in a thread of its own, which has ended when the block has. Raises what `open_door` does.

    What went wrong in the device is raised at the end of the block.
    """
    failures: list[BaseException] = []

    def run() -> None:
        try:
            endpoint.run()
        except BaseException as failure:  # noqa: BLE001 - raised again in the thread that asked for the endpoint
            failures.append(failure)
            door.close()  # clients see it go

    with open_door(pty, tcp) as door:
        endpoint = Endpoint(device, door, pace)
        thread = threading.Thread(target=run, name=f"serve {door.url}", daemon=True)
        thread.start()
        try:
            yield endpoint
        finally:
            endpoint.stop()
            thread.join()
    if failures:
        raise failures[0]


def _host_and_port(address: str) -> tuple[str, int]:
    host, colon, port = address.rpartition(":")
    if not colon or not port.isdecimal() or int(port) > 0xFFFF:
        raise InputError(f"{address}: expected HOST:PORT, such as 127.0.0.1:0 (port 0 picks one)")
    return host or "127.0.0.1", int(port)


def _make_link(link: Path, target: str) -> None:
    if link.is_symlink() and not link.exists():
        link.unlink()  # left behind by one that was killed
    try:
        link.symlink_to(target)
    except FileExistsError:
        raise InputError(f"{link}: exists already; choose another name for the pseudo-terminal") from None
    except OSError as error:
        raise InputError(f"{link}: cannot make the link: {error.strerror or error}") from error
