"""Serve a device on a pseudo-terminal or a TCP port, in real time, faster, or as fast as possible.

    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        Scanner.open(endpoint.url)

One thread serves one client after another. While a client does not read, the clock of the device stops, so that only
a few unsent bytes accumulate.
"""

import math
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

from sonarhw.device.device import Device
from sonarhw.device.server_ports import ServerPort, open_server_port
from sonarhw.errors import InputError

__all__ = ["Clock", "Endpoint", "Pace", "check_pace", "open_server_port", "read_pace", "serve"]

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
        return check_pace(float(text))
    except ValueError:
        return check_pace(text)  # type: ignore[arg-type]  # check_pace accepts the two words only


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


@contextmanager
def serve(device: Device, pty: Path | None = None, tcp: str | None = None, pace: Pace = "real") -> Iterator[Endpoint]:
    """Serve `device` in a separate thread, which ends with the block. Raises what `open_server_port` raises.

    An error in the device is raised at the end of the block.
    """
    failures: list[BaseException] = []

    def run() -> None:
        try:
            endpoint.run()
        except BaseException as failure:  # noqa: BLE001 - raised again in the thread that called `serve`
            failures.append(failure)
            port.close()  # so that clients notice the error

    with open_server_port(pty, tcp) as port:
        endpoint = Endpoint(device, port, pace)
        thread = threading.Thread(target=run, name=f"serve {port.url}", daemon=True)
        thread.start()
        try:
            yield endpoint
        finally:
            endpoint.stop()
            thread.join()
    if failures:
        raise failures[0]
