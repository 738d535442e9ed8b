import random
import signal
import subprocess
import sys
from functools import lru_cache
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from sonarhw.errors import NotALog
from sonarhw.log import LogWriter, copy_log, read_log
from sonarhw.readings import Reading
from tests.fixtures.example_logs import METADATA, assert_readings_close, write_example

COUNT = 12


@pytest.fixture(scope="module", params=[False, True], ids=["echoes", "traces"])
def whole(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "scan.mcap"
    write_example(path, COUNT, trace=request.param)
    readings_of(path)  # which keep it open
    return path


@lru_cache
def readings_of(whole: Path) -> tuple[Reading, ...]:
    """Return the readings of an undamaged log by number."""
    return read_log(whole).readings


@lru_cache
def chunk_spans(path: Path) -> list[tuple[int, int, bool]]:
    """Return begin and end of each chunk and whether it contains a reading."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    channels = {channel.topic: number for number, channel in summary.channels.items()}
    return [
        (c.chunk_start_offset, c.chunk_start_offset + c.chunk_length, channels["/readings"] in c.message_index_offsets)
        for c in summary.chunk_indexes
    ]


def chunk_ends(path: Path) -> list[tuple[int, int]]:
    """Return the end of each chunk and the number of readings up to there."""
    spans = chunk_spans(path)
    return [(end, count) for (_, end, _), count in zip(spans, accumulate(one for *_, one in spans), strict=True)]


def first_record_end(data: bytes) -> int:
    """Return the position after the magic bytes and the header, which names the program."""
    return 8 + 9 + int.from_bytes(data[9:17], "little")


def assert_cut_keeps_whole_readings(whole: Path, torn: Path, at: int) -> None:
    torn.write_bytes(whole.read_bytes()[:at])
    kept = max((readings for end, readings in chunk_ends(whole) if end <= at), default=0)
    log = read_log(torn)
    assert log.torn is not None
    assert f"at byte {at}" in log.torn
    assert len(log.readings) == kept
    for got, wanted in zip(log.readings, readings_of(whole), strict=False):
        assert_readings_close(got, wanted)


def test_a_log_cut_anywhere_keeps_every_whole_reading(whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    begin = first_record_end(data)
    boundaries = [at for end, _ in chunk_ends(whole) for at in (end - 1, end, end + 1)]
    for at in [begin, *boundaries, *random.Random(3).sample(range(begin, len(data)), 40), len(data) - 1]:
        assert_cut_keeps_whole_readings(whole, tmp_path / "torn.mcap", at)


def test_a_log_cut_before_its_header_ends_gives_an_error_of_one_line(whole: Path, tmp_path: Path) -> None:
    data = whole.read_bytes()
    for at in range(1, first_record_end(data)):
        (tmp_path / "torn.mcap").write_bytes(data[:at])
        with pytest.raises(NotALog, match=r"torn\.mcap: ") as raised:
            read_log(tmp_path / "torn.mcap")
        assert "\n" not in str(raised.value)


def test_zeros_at_the_end_after_a_power_cut_count_as_torn(whole: Path, tmp_path: Path) -> None:
    end, readings = chunk_ends(whole)[5]
    (tmp_path / "torn.mcap").write_bytes(whole.read_bytes()[:end] + bytes(4096))
    log = read_log(tmp_path / "torn.mcap")
    assert f"in the record that begins at byte {end}" in str(log.torn)
    assert len(log.readings) == readings


def test_a_damaged_length_inside_a_chunk_loses_its_own_reading_only(whole: Path, tmp_path: Path) -> None:
    data = bytearray(whole.read_bytes())
    with whole.open("rb") as file:
        summary = make_reader(file).get_summary()
    chunk = summary.chunk_indexes[6]
    length = chunk.chunk_start_offset + chunk.chunk_length - chunk.compressed_size - 8
    data[length : length + 8] = b"\xff" * 8
    (tmp_path / "damaged.mcap").write_bytes(data)
    log = read_log(tmp_path / "damaged.mcap")
    assert str(log.torn).startswith(f"the record that begins at byte {chunk.chunk_start_offset} is left out: ")
    assert len(log.readings) == COUNT - 1


def test_any_amount_of_damage_is_reported_in_a_short_line(whole: Path, tmp_path: Path) -> None:
    ends = [end for end, _ in chunk_ends(whole)][2:]
    # one undamaged chunk between two damaged ones, and none at the end
    for damaged, others in ((ends[:3:2], "(and 1 more place)"), (ends, f"(and {len(ends) - 1} more places)")):
        data = bytearray(whole.read_bytes())
        for end in damaged:
            data[end - 5] ^= 0x40
        (tmp_path / "damaged.mcap").write_bytes(data)
        torn = str(read_log(tmp_path / "damaged.mcap").torn)
        assert "CRC-32 does not match" in torn
        assert torn.endswith(f" {others}")
        assert len(torn) < 120


@st.composite
def damaged_spans(draw: st.DrawFn) -> tuple[float, int, bytes]:
    """Return the relative position of lost bytes, their number, and the bytes that replace them."""
    return draw(st.floats(0, 1)), draw(st.integers(1, 3000)), draw(st.binary(max_size=3000))


@settings(max_examples=40, deadline=None)
@given(damage=damaged_spans())
@example(damage=(0.5, 2000, bytes(2000)))
@example(damage=(0.5, 1, b""))
@example(damage=(0.5, 9, b"\xff" * 9))
@example(damage=(0.0, 700, bytes(700)))
def test_damage_in_the_middle_loses_only_the_readings_it_touches(
    whole: Path, tmp_path_factory: pytest.TempPathFactory, damage: tuple[float, int, bytes]
) -> None:
    content, spans = whole.read_bytes(), chunk_spans(whole)
    first = spans[0][0]
    begin = first + round(damage[0] * (spans[-1][1] - 1 - first))
    end = min(begin + damage[1], len(content))
    path = tmp_path_factory.mktemp("damage") / "scan.mcap"
    path.write_bytes(content[:begin] + damage[2] + content[end:])
    touched = [reading for start, stop, reading in spans if start < end and begin < stop]
    log = read_log(path)
    assert len(log.readings) >= COUNT - sum(touched)
    originals = readings_of(whole)
    for reading in log.readings:
        assert_readings_close(reading, originals[reading.number])
    assert log.torn is not None or path.read_bytes() == content


def test_skipped_bytes_are_reported_with_their_position(whole: Path, tmp_path: Path) -> None:
    content, spans = whole.read_bytes(), chunk_spans(whole)
    begin, end = spans[6][0] + 20, spans[7][0] + 20
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content[:begin] + b"\xff" * (end - begin) + content[end:])
    assert read_log(path).torn == f"the record that begins at byte {spans[6][0]} is left out: it is damaged"
    path.write_bytes(content[: spans[6][0]] + bytes(50) + content[spans[7][0] + 9 :])
    again = spans[6][0] + 50 + spans[8][0] - spans[7][0] - 9
    assert read_log(path).torn == f"bytes {spans[6][0]} to {again} are damaged and left out"


def test_a_damaged_length_between_chunks_skips_no_chunk(whole: Path, tmp_path: Path) -> None:
    content, spans = bytearray(whole.read_bytes()), chunk_spans(whole)
    at, inside = spans[5][1], spans[8][0] + 30  # a message index, and the middle of a later chunk
    content[at + 1 : at + 9] = (inside - at - 9).to_bytes(8, "little")
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    log = read_log(path)
    assert log.torn == f"bytes {at} to {spans[6][0]} are damaged and left out"
    assert len(log.readings) == COUNT


def test_a_log_without_its_first_chunk_keeps_its_channels(whole: Path, tmp_path: Path) -> None:
    content, (first, *_) = whole.read_bytes(), chunk_spans(whole)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content[: first[0]] + bytes(first[1] - first[0]) + content[first[1] :])
    log = read_log(path)
    assert len(log.readings) == COUNT
    assert log.metadata == METADATA


@pytest.mark.parametrize("lost", [8, 40, "up to the first chunk", "up to the first reading"])
def test_a_log_without_its_beginning_keeps_its_readings(whole: Path, tmp_path: Path, lost: int | str) -> None:
    content, spans = whole.read_bytes(), chunk_spans(whole)
    first = next(start for start, _, reading in spans if reading)
    size = lost if isinstance(lost, int) else spans[0][0] if lost == "up to the first chunk" else first
    path = tmp_path / "damaged.mcap"
    path.write_bytes(bytes(size) + content[size:])
    log = read_log(path)
    assert log.torn is not None
    assert [reading.range for reading in log.readings] == pytest.approx(
        [reading.range for reading in read_log(whole).readings]
    )
    assert log.metadata.made_by in ("unknown", METADATA.made_by)


def test_the_first_undamaged_chunk_of_a_log_is_near_its_start(whole: Path, tmp_path: Path) -> None:
    """So that a large file of another kind is not searched as a whole."""
    path, content = tmp_path / "damaged.mcap", whole.read_bytes()
    path.write_bytes(bytes(1 << 19) + content)
    assert len(read_log(path).readings) == COUNT
    path.write_bytes(bytes(5 << 19) + content)
    with pytest.raises(NotALog, match="is not an MCAP file"):
        read_log(path)


def test_ranges_are_kept_when_the_settings_frames_are_lost(whole: Path, tmp_path: Path) -> None:
    # Info, Settings and Started have their own chunks before the readings
    content, spans = whole.read_bytes(), chunk_spans(whole)
    begin, end = spans[0][0], next(start for start, _, reading in spans if reading)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content[:begin] + content[end:])
    log = read_log(path)
    assert log.settings is None
    assert [reading.range for reading in log.readings] == pytest.approx(
        [reading.range for reading in read_log(whole).readings]
    )


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_damage_raises_not_a_log(whole: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    content = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("damaged") / "scan.mcap"
    path.write_bytes(content)
    message = ""
    try:
        assert len(read_log(path).readings) <= COUNT
    except NotALog as error:
        message = str(error)
    assert "\n" not in message


def test_a_log_with_other_channel_numbers_gives_the_same_frames_and_readings(whole: Path, tmp_path: Path) -> None:
    """Other programs that repair or merge MCAP files number the channels again."""
    path = tmp_path / "other.mcap"
    with whole.open("rb") as source, path.open("wb") as target:
        reader, writer = make_reader(source), Writer(target, compression=CompressionType.NONE)
        header, summary = reader.get_header(), reader.get_summary()
        writer.start(header.profile, header.library)
        numbers = {}
        for one in sorted(summary.channels.values(), key=lambda channel: (channel.id == 1, channel.id)):
            numbers[one.id] = writer.register_channel(one.topic, one.message_encoding, 0, one.metadata)
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for _, channel, message in reader.iter_messages(log_time_order=False):
            writer.add_message(numbers[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()
    assert all(number != channel for channel, number in numbers.items())
    other, log = read_log(path), read_log(whole)
    assert [frame.wire for frame in other.frames] == [frame.wire for frame in log.frames] != []
    for read, written in zip(other.readings, log.readings, strict=True):
        assert_readings_close(read, written)


def test_a_recovered_log_is_complete_and_contains_every_readable_reading(whole: Path, tmp_path: Path) -> None:
    end, readings = chunk_ends(whole)[7]
    (tmp_path / "torn.mcap").write_bytes(whole.read_bytes()[: end + 30])
    copy_log(read_log(tmp_path / "torn.mcap"), tmp_path / "repaired.mcap")
    repaired = read_log(tmp_path / "repaired.mcap")
    assert repaired.torn is None
    assert len(repaired.readings) == readings
    assert repaired.metadata == METADATA


# faults while a log is written

KILLED_WRITER = """
import sys
from pathlib import Path
from sonarhw.log import LogWriter
from tests.fixtures.example_logs import METADATA
from tests.fixtures.example_frames import scan_frames

log = LogWriter(Path(sys.argv[1]), METADATA)
for frames, reading in scan_frames():
    for wire in frames:
        log.frame(True, METADATA.started, wire)
    if reading is not None:
        log.reading(reading)
        print(reading.number, flush=True)
"""


def test_a_killed_writer_leaves_every_accepted_reading(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    child = subprocess.Popen([sys.executable, "-c", KILLED_WRITER, str(path)], stdout=subprocess.PIPE, text=True)
    with child.stdout as lines:
        for _ in range(25):
            lines.readline()
        child.send_signal(signal.SIGKILL)
        count = 25 + len(lines.readlines())
    assert child.wait() == -signal.SIGKILL
    log = read_log(path)
    assert log.torn is not None
    assert count <= len(log.readings) <= count + 1
    assert [reading.number for reading in log.readings] == [*range(len(log.readings))]


def test_frames_outside_a_scan_are_on_disk_at_once(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    with LogWriter(path, METADATA) as log:
        for count in range(1, 4):
            log.frame(count % 2 == 1, METADATA.started, b"\x01\x00")
            assert len(read_log(path).frames) == count
