"""The sending side of a serial line, which takes time for each byte."""

from collections import deque

from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.limits import PROTOCOL_MINOR
from sonarhw.wire.messages import Message
from sonarhw.wire.units import microseconds_of

BITS = 10  # per byte on the line: eight data bits, start and stop bit
BYTE_TIME = BITS / 1_000_000  # s


class Line:
    """A line that transmits frames one after another. A frame leaves when its last byte has been transmitted.

    A line with `bauds` starts at the lowest of them. A line without `bauds` has a fixed speed.
    """

    def __init__(self, byte_time: float = BYTE_TIME, bauds: tuple[int, ...] = ()) -> None:
        self.bauds = bauds
        self.first_baud = self.baud = self._next_baud = min(bauds, default=0)
        self.minor = PROTOCOL_MINOR  # minor protocol version of the messages
        self._byte_time = byte_time  # s, for a line without bauds
        self._queue: deque[tuple[float, bytes]] = deque()
        self._sequence = 0
        self.idle_from = 0.0  # time when the last queued frame leaves, s
        self.waiting = 0  # bytes in the queue

    def send(self, message: Message, now: float) -> None:
        """Queue a message. Its frame contains `now`, s."""
        wire = encode_frame(Frame(message.TYPE, self._sequence, microseconds_of(now), message.pack(self.minor)))
        self._sequence = (self._sequence + 1) % 0x10000
        self.idle_from = max(now, self.idle_from) + len(wire) * (
            BITS / self._next_baud if self._next_baud else self._byte_time
        )
        self._queue.append((self.idle_from, wire))
        self.waiting += len(wire)

    def change(self, baud: int) -> None:
        """Change the baud rate after all queued frames have left."""
        self._next_baud = baud
        if not self._queue:
            self.baud = baud

    def departure(self) -> float | None:
        """Return the time when the next frame leaves, s; None if the queue is empty."""
        return self._queue[0][0] if self._queue else None

    def depart(self, now: float) -> bytes:
        """Remove and return the frames that have left by `now`."""
        left = bytearray()
        while self._queue and self._queue[0][0] <= now:
            left += self._queue.popleft()[1]
        if not self._queue:
            self.baud = self._next_baud
        self.waiting -= len(left)
        return bytes(left)

    def clear(self) -> None:
        """Drop the frames that have not left yet."""
        self._queue.clear()
        self.idle_from, self.waiting = 0.0, 0
        self.baud = self._next_baud
