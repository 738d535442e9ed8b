"""Speed of decoding bytes to frames: `python -m benchmarks.wire`.

Prints, for frames of 200 bytes on the wire, the speed of this project's decoder, of a plain parser that processes every
byte in Python, and of the whole driver up to readings, in the same run on one core. A line at 1 000 000 baud transfers
0.1 MB/s.
"""

import random
import struct
import time
from collections.abc import Callable, Iterable, Iterator

from sonarhw.host.driver import Driver
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import TraceChunk

WIRE = 200  # bytes of a frame
FRAMES = 20_000
READ = 4096  # bytes per read
ROUNDS = 5
_POLYNOMIAL = 0xEDB88320


def crc_table() -> list[int]:
    """Return the CRC-32 of each byte."""
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = (byte >> 1) ^ (_POLYNOMIAL if byte & 1 else 0)
        table.append(byte)
    return table


class ByteByByte:
    """A typical parser of a driver: removes the stuffing and updates the CRC byte by byte."""

    def __init__(self) -> None:
        self._table = crc_table()
        self._start()

    def _start(self) -> None:
        self._body = bytearray()
        self._left = 0  # bytes until the next code
        self._zero = False  # whether a zero precedes it
        self._crc = 0xFFFFFFFF
        self._last: list[int] = []  # four bytes that may be the checksum

    def feed(self, data: bytes) -> Iterator[Frame]:
        """Yield the frames that the bytes complete."""
        for byte in data:
            if byte == 0:
                if len(self._last) == 4 and self._crc ^ 0xFFFFFFFF == int.from_bytes(bytes(self._last), "little"):
                    kind, sequence, time_us = struct.unpack_from("<BHQ", self._body)
                    yield Frame(kind, sequence, time_us, bytes(self._body[11:]))
                self._start()
            elif self._left == 0:
                if self._zero:
                    self._take(0)
                self._left, self._zero = byte - 1, byte < 0xFF
            else:
                self._take(byte)
                self._left -= 1

    def _take(self, byte: int) -> None:
        self._last.append(byte)
        if len(self._last) > 4:
            data = self._last.pop(0)
            self._body.append(data)
            self._crc = (self._crc >> 8) ^ self._table[(self._crc ^ data) & 0xFF]


def stream() -> bytes:
    """Return chunks of traces with as many samples as fit 200 bytes on the wire."""
    chance = random.Random(1)
    empty = len(encode_frame(Frame(TraceChunk.TYPE, 0xFFFF, 2**63, TraceChunk(1, 0, 1, 1, 0, b"").pack())))
    wires = []
    for sequence in range(FRAMES):
        samples = chance.randbytes(WIRE - empty)
        chunk = TraceChunk(sequence // 16, 0, len(samples), 13_000, 0, samples)
        wires.append(encode_frame(Frame(TraceChunk.TYPE, sequence, 10**18 + 1600 * sequence, chunk.pack())))
    return b"".join(wires)


def seconds(feed: Callable[[], Callable[[bytes], Iterable[object]]], data: bytes) -> float:
    """Return the shortest processor time of a few runs over the whole stream, s."""
    taken = []
    for _ in range(ROUNDS):
        take = feed()
        began = time.process_time()
        for at in range(0, len(data), READ):
            for _item in take(data[at : at + READ]):
                pass
        taken.append(time.process_time() - began)
    return min(taken)


def driving() -> Callable[[bytes], Iterable[object]]:
    """Return a function that does all work of a live scan with its bytes: frames, messages, checks, readings."""
    driver = Driver()

    def take(data: bytes) -> Iterable[object]:
        driver.receive(data, 0.0)
        return driver.readings()

    return take


def main() -> None:
    """Print the table."""
    data = stream()
    assert [*FrameDecoder().feed(data)] == [*ByteByByte().feed(data)]
    takes = {
        "byte by byte in Python": seconds(lambda: ByteByByte().feed, data),
        "sonarhw, bytes to frames": seconds(lambda: FrameDecoder().feed, data),
        "sonarhw, bytes to readings": seconds(driving, data),
    }
    slowest = takes["byte by byte in Python"]
    print(f"{FRAMES} frames of {len(data) / FRAMES:.0f} bytes, read {READ} bytes at a time, one core\n")
    print(f"{'decoder':<38} {'MB/s':>7} {'times as fast':>14} {'of 1 000 000 baud':>18}")
    for name, taken in takes.items():
        rate = len(data) / taken
        print(f"{name:<38} {rate / 1e6:>7.2f} {slowest / taken:>14.1f} {rate / 1e5:>17.0f}x")


if __name__ == "__main__":
    main()
