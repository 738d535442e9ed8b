"""A relay that damages the bytes between a host and any scanner."""

import threading
from collections import deque

from sonarhw.device.faults import Faults, LineNoise
from sonarhw.link import Link

_POLL_PERIOD = 0.005  # s


class Relay:
    """A `Device` that passes its bytes over an open link to another scanner."""

    busy = False
    speedup = 1.0
    plug = 0

    def __init__(self, link: Link, faults: Faults, seed: int = 0) -> None:
        self._link = link
        self._up, self._down = LineNoise(faults, seed), LineNoise(faults, seed + 1)
        self._now = 0.0
        self._arrived: deque[bytes] = deque()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._listen, name=f"relay {link.url}", daemon=True)
        self._thread.start()

    def receive(self, data: bytes, now: float) -> None:
        """Damage bytes of the host and send them to the scanner."""
        self._link.write(self._down.damage(data))

    def next_event(self) -> float:
        """Return the time of the next poll."""
        return self._now + _POLL_PERIOD

    def advance(self, now: float) -> bytes:
        """Return the bytes received from the scanner since the last call, damaged."""
        self._now, data = now, b""
        while self._arrived:
            data += self._arrived.popleft()
        return self._up.damage(data)

    def hang_up(self) -> None:
        """Do nothing: the scanner does not see the disconnect."""

    def end(self) -> None:
        """Stop the receiving thread."""
        self._ended.set()
        self._thread.join()

    def _listen(self) -> None:
        while not self._ended.is_set():
            if data := self._link.read():
                self._arrived.append(data)
