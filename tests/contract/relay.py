"""A bad line in front of any scanner: a device that hands on what another one says, damaged on the way."""

import threading
from collections import deque

from sonarhw.device.fault_schedule import Faults
from sonarhw.device.line_noise import LineNoise
from sonarhw.link.serial_link import Link

_LOOK = 0.005  # s from one look at what has come to the next


class Relay:
    """A `Device` whose bytes come and go over an open link."""

    busy = False
    speedup = 1.0
    plug = 0

    def __init__(self, link: Link, faults: Faults, seed: int = 0) -> None:
        self._link = link
        self._up, self._down = LineNoise(faults, seed), LineNoise(faults, seed + 1)
        self._now = 0.0
        self._come: deque[bytes] = deque()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen, name=f"relay {link.url}", daemon=True)
        self._thread.start()

    def receive(self, data: bytes, now: float) -> None:
        """Hand on what the host says."""
        self._link.write(self._down.damage(data))

    def next_event(self) -> float:
        """Soon."""
        return self._now + _LOOK

    def advance(self, now: float) -> bytes:
        """What the scanner has said since the last call."""
        self._now, data = now, b""
        while self._come:
            data += self._come.popleft()
        return self._up.damage(data)

    def hang_up(self) -> None:
        """The line does not show it."""

    def end(self) -> None:
        """Listen no longer."""
        self._ended.set()
        self._thread.join()

    def _listen(self) -> None:
        while not self._ended.is_set():
            if data := self._link.read():
                self._come.append(data)
