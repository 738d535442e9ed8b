"""Damaged bytes of a bad line, and bytes of a device that is not a scanner.

The same seed damages the same bytes.
"""

import math
import random

from sonarhw.device.faults.fault_schedule import Faults
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Accepted, Info, ReadingMessage

_LINES = (b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n", b"ok\r\n", b"T:21.3 /0.0 @:0\r\n")
_UNUSED_TYPE = 0xE5  # no message has this type


class LineNoise:
    """Damages a stream of bytes: it drops bytes, flips bits and inserts bytes, each at its rate."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self._chance = random.Random(seed)
        self._rates = (faults.drop, faults.flip, faults.insert)
        self._rate = min(1.0, sum(self._rates))
        self._intact = self._until_next()  # bytes before the next damaged one

    def damage(self, data: bytes) -> bytes:
        """Return the bytes as they arrive."""
        if self._intact >= len(data):
            self._intact -= len(data)
            return data
        arriving, at = bytearray(), 0
        while self._intact < len(data) - at:
            victim = at + int(self._intact)
            arriving += data[at:victim] + self._damaged(data[victim])
            at = victim + 1
            self._intact = self._until_next()
        self._intact -= len(data) - at
        return bytes(arriving + data[at:])

    def _damaged(self, byte: int) -> bytes:
        (what,) = self._chance.choices(("drop", "flip", "insert"), self._rates)
        if what == "drop":
            return b""
        if what == "flip":
            return bytes([byte ^ (1 << self._chance.randrange(8))])
        return bytes([byte, self._chance.randrange(256)])

    def _until_next(self) -> float:
        # the gaps between independently damaged bytes have a geometric distribution
        if self._rate in (0.0, 1.0):
            return math.inf if self._rate == 0 else 0
        return math.floor(math.log(1 - self._chance.random()) / math.log(1 - self._rate))


def nonsense(chance: random.Random) -> bytes:
    """Return random bytes that no scanner sends: text, noise or meaningless frames."""
    stray = Accepted(chance.randrange(0x10000)).pack()
    return chance.choice(
        [
            chance.choice(_LINES),
            chance.randbytes(chance.randrange(1, 600)),
            bytes(chance.randrange(1, 20)),
            _frame(chance, _UNUSED_TYPE, chance.randbytes(20)),
            _frame(chance, Info.TYPE, chance.randbytes(5)),
            _frame(chance, ReadingMessage.TYPE, chance.randbytes(10)),
            _frame(chance, Accepted.TYPE, stray),
        ]
    )


def _frame(chance: random.Random, kind: int, payload: bytes) -> bytes:
    return encode_frame(Frame(kind, chance.randrange(0x10000), chance.randrange(2**40), payload))
