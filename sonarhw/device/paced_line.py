"""The sending half of a serial line: what a device says leaves no sooner than a line could carry it.

Takes messages with the time they were made; hands on the bytes that have left by a time.
"""

from collections import deque

from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.limits import PROTOCOL_MINOR
from sonarhw.wire.messages import Message
from sonarhw.wire.units import microseconds_of

BITS = 10  # of a byte on the line: eight, start and stop
BYTE_TIME = BITS / 1_000_000  # s


class Line:
    """Frames leave one after another, each when its last byte could have.

    A line with `bauds` starts at the lowest of them, one without has a speed that nobody sets.
    """

    def __init__(self, byte_time: float = BYTE_TIME, bauds: tuple[int, ...] = ()) -> None:
        self.bauds = bauds
        self.first_baud = self.baud = self._ahead = min(bauds, default=0)
        self.minor = PROTOCOL_MINOR  # version of the protocol that is sent
        self._byte_time = byte_time  # s, of a line without bauds
        self._queue: deque[tuple[float, bytes]] = deque()
        self._sequence = 0
        self.free = 0.0  # when the last frame sent has left, s
        self.waiting = 0  # bytes

    def send(self, message: Message, now: float) -> None:
        """Queue a message; its frame carries the time it was made."""
        wire = encode_frame(Frame(message.TYPE, self._sequence, microseconds_of(now), message.pack(self.minor)))
        self._sequence = (self._sequence + 1) % 0x10000
        self.free = max(now, self.free) + len(wire) * (BITS / self._ahead if self._ahead else self._byte_time)
        self._queue.append((self.free, wire))
        self.waiting += len(wire)

    def change(self, baud: int) -> None:
        """Change the speed when all that was queued has gone."""
        self._ahead = baud
        if not self._queue:
            self.baud = baud

    def departure(self) -> float | None:
        """When the next frame has left, s."""
        return self._queue[0][0] if self._queue else None

    def depart(self, now: float) -> bytes:
        """The frames that have left by `now`."""
        left = bytearray()
        while self._queue and self._queue[0][0] <= now:
            left += self._queue.popleft()[1]
        if not self._queue:
            self.baud = self._ahead
        self.waiting -= len(left)
        return bytes(left)

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._queue.clear()
        self.free, self.waiting = 0.0, 0
        self.baud = self._ahead
