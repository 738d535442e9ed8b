"""An endless scan as it comes over the line, for tests that end its recorder the hard way."""

from collections.abc import Iterator
from itertools import count

from sonarhw.frames import Frame, encode_frame
from sonarhw.messages import Message, Settings, Started
from sonarhw.reading_messages import reading_message
from sonarhw.readings import Reading
from tests.sonarhw.example_logs import SPEED, example_reading

SOUND = round(SPEED * 1000)


def scan_frames() -> Iterator[tuple[list[bytes], Reading | None]]:
    """The frames of settings and start, then those of each reading with it."""
    yield [_frame(Settings(1, 60_000, 0, 0, SOUND)), _frame(Started(2, 1_000_000))], None
    for number in count():
        reading = example_reading(number, angle=0.0)
        yield [_frame(reading_message(reading, SOUND))], reading


def _frame(message: Message) -> bytes:
    return encode_frame(Frame(message.TYPE, 0, 0, message.pack()))
