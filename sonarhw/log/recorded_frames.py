"""The frames and traces of a log. They are read from the file on access."""

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from itertools import groupby

from sonarhw.errors import NotALog
from sonarhw.log.contents import BYTES, FRAMES_RECEIVED, FRAMES_SENT, TOPICS, RecordedFrame
from sonarhw.log.mcap_records import Damage, McapMessage, OpenFile, Record, read_records
from sonarhw.log.reading_columns import Span
from sonarhw.readings import FloatArray, Reading, Trace
from sonarhw.wire.assembly import ReadingAssembler
from sonarhw.wire.frames import Frame, decode_block
from sonarhw.wire.messages import MessageError, Settings, unpack_message

_CACHED_TRACES = 64
_UNKNOWN_SETTINGS = Settings(0, 0, 0, 1, 0)


class LogFrames:
    """The frames in a log file, as `RecordedFrames`."""

    def __init__(self, file: OpenFile, count: int, topics: dict[int, str]) -> None:
        self._file = file
        self._count = count
        self._topics = topics

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[RecordedFrame]:
        for _, frame in _frames(self._file, self._topics):
            yield frame

    def pieces(self) -> Iterator[list[RecordedFrame]]:
        """Yield the frames of each chunk."""
        for _, together in groupby(_frames(self._file, self._topics), key=lambda placed: placed[0]):
            yield [frame for _, frame in together]

    def received_bytes(self) -> Iterator[tuple[float, bytes]]:
        """Yield the bytes of a device that sends no frames, as received, and their time, s since the epoch."""
        for item in _records(self._file):
            if isinstance(item, McapMessage) and self._topics.get(item.channel) == BYTES:
                yield item.time * 1e-9, item.data


def recorded_frame(message: McapMessage, topics: dict[int, str]) -> RecordedFrame | None:
    """Return the frame in a message of the file; None if it contains none."""
    topic = topics.get(message.channel)
    if topic not in (FRAMES_RECEIVED, FRAMES_SENT):
        return None
    return RecordedFrame(message.time * 1e-9, topic == FRAMES_RECEIVED, message.data)


def known_topics() -> dict[int, str]:
    """Return the topics by channel number, as `LogWriter` registers them."""
    return dict(enumerate(TOPICS, start=1))


def _frames(file: OpenFile, topics: dict[int, str], span: Span | None = None) -> Iterator[tuple[int, RecordedFrame]]:
    for item in _records(file, *(span or ())[:1]):
        if span is not None and not isinstance(item, Damage) and item.at > span[1]:
            return
        if isinstance(item, McapMessage) and (frame := recorded_frame(item, topics)):
            yield item.at, frame


def _records(file: OpenFile, *start: int) -> Iterator[Record | McapMessage | Damage]:
    try:
        yield from read_records(file, *start)
    except OSError as error:
        raise NotALog(f"{file.path}: can no longer be read: {error.strerror}") from error


class StoredTraces:
    """The traces of one scan, with a cache of the last few."""

    def __init__(self, file: OpenFile, settings: Settings | None, topics: dict[int, str]) -> None:
        self._file = file
        self._topics = topics
        self._settings = replace(settings or _UNKNOWN_SETTINGS, trace=1)
        self.load = lru_cache(maxsize=_CACHED_TRACES)(self._load)

    def trace(self, number: int, span: Span) -> Trace:
        """Return the trace of the reading in the chunks `span`. It is read on first access."""
        return StoredTrace(self, number, span)

    def _load(self, number: int, span: Span) -> Trace:
        found = [reading.trace for reading in self._assembled(span) if reading.number == number and reading.trace]
        if not found:
            raise NotALog(f"{self._file.path}: the trace of reading {number} cannot be read; `log recover` may help")
        return found[-1]

    def _assembled(self, span: Span) -> list[Reading]:
        # only the chunks of this reading are decoded
        assembler = ReadingAssembler()
        assembler.feed(self._settings)
        readings: list[Reading] = []
        for _, recorded in _frames(self._file, self._topics, span):
            frame = decode_block(recorded.wire[:-1])
            if not recorded.received or not isinstance(frame, Frame):
                continue
            try:
                message = unpack_message(frame.type, frame.payload)
            except MessageError:
                continue
            if message is not None:
                readings += assembler.feed(message)
        return readings + assembler.flush()


class StoredTrace(Trace):
    """A trace that is read from its log on access, through the cache of `StoredTraces`.

    Access raises NotALog if the log can no longer be read.
    """

    def __init__(self, traces: StoredTraces, number: int, span: Span) -> None:
        self._traces = traces
        self._number = number
        self._span = span

    def __repr__(self) -> str:
        return f"StoredTrace({self._number}, {self._span})"

    @property
    def samples(self) -> FloatArray:
        """See `Trace`."""
        return self._loaded.samples

    @property
    def rate(self) -> float:
        """See `Trace`."""
        return self._loaded.rate

    @property
    def start(self) -> float:
        """See `Trace`."""
        return self._loaded.start

    @property
    def carrier(self) -> bool:
        """See `Trace`."""
        return self._loaded.carrier

    @property
    def _loaded(self) -> Trace:
        return self._traces.load(self._number, self._span)
