"""A closed log gives the same data by its index and by its frames; hostile content is left out and needs no memory."""

import json
import math
import struct
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import fields, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Attachment
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

import sonarhw.log.reader
from sonarhw.errors import NotALog
from sonarhw.log import Log, LogWriter, copy_log, read_log
from sonarhw.log.reader import unpack_index
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading, Trace
from sonarhw.wire.messages import Finished, Hello, Info, Settings, Started, StartScan
from sonarhw.wire.readings_of_frames import reading_message, trace_chunks
from tests.fixtures.example_logs import METADATA, SPEED, STARTED, assert_readings_close, example_reading, write_example
from tests.oracles.mcap_doctor import complaints
from tests.unit.sonarhw.log.test_writer import frame_of, reading_frame

Conversation = list[tuple[bool, bytes]]
SOUND = round(SPEED * 1000)
REQUEST = StartScan(0, 5_000_000, 4, 1, 1)
SETTINGS = (True, frame_of(Settings(1, 60_000, 0, 1, SOUND), time=0.1))


def reading_frames(number: int, began: float = 0.0, *, leave_out: tuple[int, ...] = ()) -> Conversation:
    reading = example_reading(number, trace=True)
    reading = replace(reading, time=began + reading.time)
    assert reading.trace is not None
    chunks = [chunk for index, chunk in enumerate(trace_chunks(number, reading.trace)) if index not in leave_out]
    messages = [reading_message(reading, SOUND), *chunks]
    return [(True, frame_of(message, time=reading.time + 0.06)) for message in messages]


def conversation(*, request: StartScan = REQUEST, command: int = 7, began: float = 1.0) -> Conversation:
    """Return the frames of a scan of four readings."""
    readings = [frame for number in range(4) for frame in reading_frames(number, began)]
    end = (True, frame_of(Finished(command, 0, 4, ""), time=began + 1))
    return [(False, frame_of(request, command)), (True, frame_of(Started(command, 4), time=began)), *readings, end]


def resent() -> Conversation:
    """Return a scan in which reading 1 is lost, but not its trace, and is resent after reading 2."""
    first, *_ = [*reading_frames(1, 1.0)]
    whole = conversation()
    at = whole.index(first)
    without = whole[:at] + whole[at + 1 :]
    later = without.index(reading_frames(3, 1.0)[0])
    return [SETTINGS, *without[:later], first, *without[later:]]


def continued() -> Conversation:
    """Return a scan that continues after a reset of the board after two readings; the clock of the board restarts."""
    whole = conversation(began=5.0)
    third = whole.index(reading_frames(2, 5.0)[0])
    rest = replace(REQUEST, first=2)
    again = [
        (False, frame_of(Hello(1, 1), 20)),
        (True, frame_of(Info(20, 1, 1, "fake", "", "", 2000, 50_000, 3200, boot=2), time=0.5)),
        SETTINGS,
        (False, frame_of(rest, 22)),
        (True, frame_of(Started(22, 2, 2), time=1.0)),
        *(frame for number in (2, 3) for frame in reading_frames(number, 1.0)),
        (True, frame_of(Finished(22, 0, 4, ""), time=3.0)),
    ]
    return [SETTINGS, *whole[:third], *again]


def repeated() -> Conversation:
    """Return a scan whose Started and first reading arrive again, with its second reading after its third."""
    request, started, *frames, end = conversation()
    first, second, *others = (frames[at : at + 4] for at in range(0, len(frames), 4))
    return [SETTINGS, request, started, *first, started, *others[0], *second, *others[1], *first, end, started]


def delayed() -> Conversation:
    """Return a scan whose Started arrives after its first reading, for the repeated request."""
    request, started, *frames = conversation()
    return [SETTINGS, request, *frames[:4], request, started, *frames[4:]]


# the conversation, and the numbers of the readings of each scan in it
CONVERSATIONS: dict[str, tuple[Callable[[], Conversation], list[list[int]]]] = {
    "one scan": (lambda: [SETTINGS, *conversation()], [[0, 1, 2, 3]]),
    "two scans": (lambda: [SETTINGS, *conversation(), *conversation(command=8, began=3.0)], [[0, 1, 2, 3]] * 2),
    "no settings": (conversation, [[0, 1, 2, 3]]),
    "no host": (lambda: [SETTINGS, *conversation()[1:]], [[0, 1, 2, 3]]),
    "repeated answers": (repeated, [[0, 1, 2, 3]]),
    "a delayed answer": (delayed, [[0, 1, 2, 3]]),
    "the same command number after a greeting": (
        lambda: [SETTINGS, *conversation(), (False, frame_of(Hello(1, 0), 6)), *conversation(began=3.0)],
        [[0, 1, 2, 3]] * 2,
    ),
    "a resent reading": (resent, [[0, 1, 2, 3]]),
    "a scan continued after a reset": (continued, [[0, 1, 2, 3]]),
    "nothing at all": (list, []),
    "a request without an answer": (lambda: [SETTINGS, (False, frame_of(REQUEST, 7))], []),
}


def record(path: Path, frames: Conversation) -> None:
    """Record the frames, and some readings, as a driver does."""
    with LogWriter(path, METADATA) as log:
        for number, (received, wire) in enumerate(frames):
            log.frame(received, STARTED + 0.01 * number, wire)
            if received and frames[number + 1 : number + 2] != [] and number % 4 == 3:
                log.reading(example_reading(number))


def read_by_frames(path: Path, monkeypatch: pytest.MonkeyPatch) -> Log:
    with monkeypatch.context() as without:
        without.setattr(sonarhw.log.reader, "stored_index", lambda *_: None)
        return read_log(path)


def assert_equal(one: Log, other: Log) -> None:
    assert (one.metadata, one.info, one.settings) == (other.metadata, other.info, other.settings)
    assert len(one.frames) == len(other.frames) == len([*one.frames])
    assert len(one.scans) == len(other.scans)
    for mine, theirs in zip(one.scans, other.scans, strict=True):
        assert (mine.began, mine.expected, mine.settings, mine.finished) == (
            (theirs.began, theirs.expected, theirs.settings, theirs.finished)
        )
        for a, b in zip(mine.readings, theirs.readings, strict=True):
            assert repr(replace(a, trace=None)) == repr(replace(b, trace=None))  # repr, because NaN does not equal NaN
            assert (a.trace is None) == (b.trace is None)
            if a.trace and b.trace:
                assert np.array_equal(a.trace.samples, b.trace.samples, equal_nan=True)


@pytest.mark.parametrize("name", CONVERSATIONS)
def test_index_and_frames_give_the_same_scans(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, (frames, numbers) = tmp_path / "scan.mcap", CONVERSATIONS[name]
    record(path, frames())
    log = read_log(path)
    assert_equal(log, read_by_frames(path, monkeypatch))
    assert [[reading.number for reading in scan.readings] for scan in log.scans] == numbers
    assert complaints(path) == [] or name == "nothing at all"  # which has no chunks
    for reading in log.readings:
        wanted = example_reading(reading.number, trace=True).trace
        assert np.abs(reading.trace.samples - wanted.samples).max() <= 0.5 / 255 + 1e-12
        assert (reading.trace.rate, reading.trace.start) == pytest.approx((wanted.rate, wanted.start))


def test_a_late_reading_of_the_previous_scan_is_left_out_of_the_next_scan(tmp_path: Path) -> None:
    first = [(False, frame_of(REQUEST, 7)), (True, frame_of(Started(7, 2), time=1.0)), (True, reading_frame(0, 1.0))]
    finished = (True, frame_of(Finished(7, 1, 1, ""), time=1.5))
    again = [(False, frame_of(REQUEST, 8)), (True, frame_of(Started(8, 2), time=2.0))]
    late = (True, reading_frame(1, 1.0))
    record(tmp_path / "scan.mcap", [*first, finished, *again, late, (True, reading_frame(1, 2.0))])
    scans = read_log(tmp_path / "scan.mcap").scans
    assert [[round(r.time, 3) for r in scan.readings] for scan in scans] == [[1.0], [2.1]]


def test_a_lost_part_of_a_trace_is_a_gap(tmp_path: Path) -> None:
    frames = [SETTINGS, (True, frame_of(Started(7, 2))), *reading_frames(0, leave_out=(1,)), *reading_frames(1)]
    record(tmp_path / "scan.mcap", frames)
    gappy, whole = (reading.trace for reading in read_log(tmp_path / "scan.mcap").readings)
    assert [*np.flatnonzero(np.isnan(gappy.samples))] == [*range(256, 512)]
    assert not np.isnan(whole.samples).any()


def test_a_trace_is_read_on_first_use(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonarhw.log.mcap_records.WINDOW", 1)
    path = tmp_path / "scan.mcap"
    write_example(path, 4, trace=True)
    reading = read_log(path).readings[2]
    assert isinstance(reading.trace, Trace)
    content = path.read_bytes()
    path.write_bytes(bytes(len(content)))  # the same file with other content
    with pytest.raises(NotALog, match="the trace of reading 2 cannot be read"):
        _ = reading.trace.samples


def test_an_open_log_is_unaffected_by_a_file_that_replaces_it(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    write_example(path, 4, trace=True)
    log = read_log(path)
    write_scan(path, METADATA, [], overwrite=True)
    assert not np.isnan(log.readings[3].trace.samples).any()
    copy_log(log, tmp_path / "copy.mcap")
    assert len(read_log(tmp_path / "copy.mcap").readings) == 4


def test_an_index_of_another_file_is_ignored(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap", 4, trace=True)
    with (tmp_path / "scan.mcap").open("rb") as file:
        (index,) = (record for record in StreamReader(file).records if isinstance(record, Attachment))
    original = read_log(tmp_path / "scan.mcap")
    moved = tmp_path / "moved.mcap"
    writer = Writer(str(moved), compression=CompressionType.NONE, enable_data_crcs=True)
    writer.start("sonarhw")
    writer.add_metadata("of another tool", {"it": "shifts everything"})
    writer.add_metadata("sonarhw", sonarhw.log.writer.metadata_record(METADATA))
    channel = writer.register_channel("/frames/rx", "application/x-sonarhw-frame", 0)
    for frame in original.frames:
        time = round(frame.time * 1e9)
        writer.add_message(channel, time, frame.wire, time)
    writer.add_attachment(0, 0, index.name, index.media_type, index.data)
    writer.finish()
    for got, wanted in zip(read_log(moved).readings, original.readings, strict=True):
        assert_readings_close(got, wanted)


def test_any_bit_error_in_a_closed_log_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    write_example(path, 4, trace=True)
    content = path.read_bytes()
    room = content.index(b"Simple")
    index = content.index(b"sonarhw.index.npz")
    for at in (room, index, index + 100, len(content) - 100, len(content) - 30):
        path.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
        log = read_log(path)
        assert log.torn, at
        assert len(log.readings) == 4


@pytest.mark.usefixtures("only_by_index")
def test_the_index_contains_every_field_of_a_reading(tmp_path: Path) -> None:
    reading = replace(example_reading(1, trace=True, sweep=3), ping=2, number=0, time=0.0, pose=(1.0, 2.0, 3.0))
    write_scan(tmp_path / "scan.mcap", METADATA, [reading])
    (read,) = read_log(tmp_path / "scan.mcap").readings
    defaults = Reading(0, 0, 0, 0.0, 0.0, (), 0.0)
    same = [field.name for field in fields(Reading) if getattr(read, field.name) == getattr(defaults, field.name)]
    assert same == ["number", "time"]
    assert read.host_time == pytest.approx(STARTED, abs=0.1)


@pytest.fixture
def only_by_index(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(sonarhw.log.reader, "decoded_frames", refuse)


# nonsense behind correct checksums: all that is readable is read, and no declared size is believed


COUNT = 6
Arrays = dict[str, Any]


def log_with_index(
    path: Path, patch: pytest.MonkeyPatch, change: Callable[[Arrays, Arrays], None], compressed: bool = False
) -> None:
    """Write a log whose index is changed before it gets its checksum. `change` gets its columns and its head."""
    pack = sonarhw.log.reader.pack_index

    def changed(*arguments: Any) -> bytes:
        columns = dict(np.load(BytesIO(pack(*arguments))))
        head = json.loads(columns.pop("head").tobytes())
        change(columns, head)
        packed = BytesIO()
        save = np.savez_compressed if compressed else np.savez
        save(packed, head=np.frombuffer(json.dumps(head).encode(), np.uint8), **columns)
        return packed.getvalue()

    patch.setattr(sonarhw.log.reader, "pack_index", changed)
    write_example(path, COUNT, trace=True)


def at(column: str, value: float) -> Callable[[Arrays, Arrays], None]:
    """Return a change of one value in a column."""

    def change(columns: Arrays, _head: Arrays) -> None:
        columns[f"0/{column}"][2] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        at("angle", np.nan),
        at("angle", 1e9),
        at("time", np.inf),
        at("echo_times", -1.0),
        at("echo_times", np.nan),
        at("echoes", 10**12),
        at("echoes", -1),
        at("number", -1),
        at("first_chunk", 10**15),
        at("last_chunk", 10**15),
        lambda columns, _: columns.pop("0/angle"),
        lambda columns, _: columns.update({"0/angle": columns["0/angle"][:3]}),
        lambda columns, _: columns.update({"0/angle": columns["0/angle"].reshape(-1, 1)}),
        lambda columns, _: columns.update({"0/angle": columns["0/angle"].astype(str)}),
        lambda columns, _: columns.update({"7/angle": columns["0/angle"]}),
        lambda columns, _: columns.update({"x": columns["0/angle"]}),
        lambda _, head: head.update(scans=None),
        lambda _, head: head.update(info="zz"),
        lambda _, head: head.update(settings="00"),
        lambda _, head: head.update(frames=-1),
        lambda _, head: head.update(frames="many"),
        lambda _, head: head["scans"][0].update(began=None),
        lambda _, head: head["scans"][0].update(began=math.nan),
        lambda _, head: head["scans"][0].update(homed=3),
        lambda _, head: head["scans"][0].update(homed=[math.inf]),
        lambda _, head: head["scans"][0].update(expected="six"),
        lambda _, head: head.pop("version"),
    ],
)
def test_an_invalid_index_is_replaced_by_the_frames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: Callable[[Arrays, Arrays], None]
) -> None:
    write_example(tmp_path / "whole.mcap", COUNT, trace=True)
    whole = read_log(tmp_path / "whole.mcap")
    log_with_index(tmp_path / "scan.mcap", monkeypatch, change)
    log = read_log(tmp_path / "scan.mcap")
    assert [(reading.angle, reading.range) for reading in log.readings] == [
        (reading.angle, reading.range) for reading in whole.readings
    ]
    assert len(log.frames) == len(whole.frames)
    assert len(log.readings[4].trace.samples) == 600


def peak(action: Callable[[], object]) -> int:
    """Return how many bytes an action allocates at most."""
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_compressed_index_is_not_decompressed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def large(columns: Arrays, _head: Arrays) -> None:
        columns["0/angle"] = np.zeros(4_000_000)

    path = tmp_path / "scan.mcap"
    log_with_index(path, monkeypatch, large, compressed=True)
    assert path.stat().st_size < 1e6
    assert peak(lambda: read_log(path)) < 20e6
    assert len(read_log(path).readings) == COUNT


def test_the_declared_shape_of_an_index_is_not_believed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    header = BytesIO()
    declared = {"descr": "<f8", "fortran_order": False, "shape": (10**15,)}
    np.lib.format.write_array_header_1_0(header, declared)
    pack = sonarhw.log.reader.pack_index

    def declaring(*arguments: Any) -> bytes:
        packed = BytesIO()
        with zipfile.ZipFile(BytesIO(pack(*arguments))) as before, zipfile.ZipFile(packed, "w") as after:
            for name in before.namelist():
                after.writestr(name, header.getvalue() if name == "0/angle.npy" else before.read(name))
        return packed.getvalue()

    monkeypatch.setattr(sonarhw.log.reader, "pack_index", declaring)
    write_example(tmp_path / "scan.mcap", COUNT)
    assert len(read_log(tmp_path / "scan.mcap").readings) == COUNT


@pytest.mark.parametrize("header", ["'''", "(" * 60, "{\n  1\n 2", "{'descr': ((", "[" * 9000])
def test_the_header_of_a_column_is_not_evaluated(header: str) -> None:
    columns = [BytesIO(), BytesIO()]
    np.lib.format.write_array(columns[0], np.zeros(3))
    text = header.encode().ljust(118)
    columns[1].write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text)
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for number, column in enumerate(columns):
            archive.writestr(f"{number}/angle.npy", column.getvalue())
    assert unpack_index(packed.getvalue(), 0) is None


def test_an_index_that_lists_the_same_bytes_many_times_is_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    packed = BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("head.npy", bytes(100_000))
        archive.filelist *= 1000
    read: list[str] = []
    monkeypatch.setattr(zipfile.ZipFile, "read", lambda _, member: read.append(member.filename) or b"")
    assert unpack_index(packed.getvalue(), 0) is None
    assert read == []


@pytest.mark.parametrize("length", [2**29, 10**15, 2**64 - 1])
def test_a_declared_length_of_a_record_is_not_allocated(tmp_path: Path, length: int) -> None:
    path = tmp_path / "scan.mcap"
    write_example(path, COUNT)
    content = path.read_bytes()
    record = content.index(b"\x06", 2000)
    damaged = content[: record + 1] + struct.pack("<Q", length) + content[record + 9 :]
    path.write_bytes(damaged)
    assert peak(lambda: read_log(path)) < 20e6
    log = read_log(path)
    assert log.damaged
    assert len(log.readings) >= COUNT - 2


def test_a_huge_record_in_a_sparse_file_is_left_out_with_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    write_example(path, COUNT)
    content = path.read_bytes()
    with path.open("wb") as file:
        file.write(content[:-1])
        file.write(struct.pack("<BQ", 0x09, 1 << 30))
        file.truncate((1 << 30) + len(content) + 100)
    found: list[Any] = []
    assert peak(lambda: found.append(read_log(path))) < 600e6
    assert len(found[0].readings) == COUNT


def test_a_chunk_of_many_short_records_needs_little_memory(tmp_path: Path) -> None:
    import zlib

    path = tmp_path / "scan.mcap"
    write_example(path, COUNT)
    content = path.read_bytes()
    data = struct.pack("<BQ", 0x0F, 0) * 60_000
    head = struct.pack("<QQQIIQ", 0, 0, len(data), zlib.crc32(data), 0, len(data))
    chunk = struct.pack("<BQ", 0x06, len(head) + len(data)) + head + data
    path.write_bytes(content[:8] + chunk + content[8:])
    assert peak(lambda: read_log(path)) < 5 * len(chunk)
    assert len(read_log(path).readings) == COUNT


@pytest.mark.parametrize(
    ("field", "text", "warned"),
    [
        ("started", "yesterday", "the start time in its sonarhw metadata is invalid: 'yesterday'"),
        ("started", "0001-01-01T00:00:00+23:59", "the start time in its sonarhw metadata is invalid"),
        ("started", "9999-12-31T00:00:00+00:00", "the start time in its sonarhw metadata is invalid"),
        ("format_version", "one", "the format in its sonarhw metadata is invalid"),
        ("format_version", 5000 * "9", "the format in its sonarhw metadata is invalid"),
        ("place", None, "its sonarhw metadata has no field 'place'"),
    ],
)
def test_damaged_metadata_is_reported_and_the_readings_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, field: str, text: str | None, warned: str
) -> None:
    record = sonarhw.log.writer.metadata_record

    def damaged(metadata: Any) -> dict[str, str]:
        fields = record(metadata)
        del fields[field]
        return fields if text is None else fields | {field: text}

    monkeypatch.setattr(sonarhw.log.writer, "metadata_record", damaged)
    write_example(tmp_path / "scan.mcap", COUNT)
    log = read_log(tmp_path / "scan.mcap")
    assert warned in str(log.torn)
    assert log.damaged
    assert len(log.readings) == COUNT
    assert log.metadata.room_file == METADATA.room_file
    monkeypatch.undo()
    copy_log(log, tmp_path / "recovered.mcap")
    recovered = read_log(tmp_path / "recovered.mcap")
    assert recovered.torn is None
    assert len(recovered.readings) == COUNT


def test_a_newer_format_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record = sonarhw.log.writer.metadata_record
    monkeypatch.setattr(sonarhw.log.writer, "metadata_record", lambda made: record(made) | {"format_version": "99"})
    write_example(tmp_path / "scan.mcap", COUNT)
    with pytest.raises(NotALog, match="has format 99; this version reads up to 1: update sonarhw"):
        read_log(tmp_path / "scan.mcap")
