"""Logs as they are written: their content, what other tools read, and the disk: full, removed, or with an older log."""

import errno
import json
import math
import os
import queue
import struct
import sys
import threading
import zlib
from dataclasses import replace
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foxglove_schemas_protobuf import LaserScan_pb2
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import MCAP0_MAGIC
from mcap_protobuf.decoder import DecoderFactory

import sonarhw.files
import sonarhw.log.writer
from sonarhw.errors import LogError, SonarError
from sonarhw.files import DiskSpaceMonitor, log_size
from sonarhw.log import LogWriter, copy_log, read_log
from sonarhw.log.mcap_records import OpenFile, Record, read_records
from sonarhw.log.writer import OpenSweeps, laser_scan, write_scan
from sonarhw.readings import Reading, Trace
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Message
from sonarhw.wire.readings_of_frames import reading_message
from tests.fixtures.example_logs import METADATA, SPEED, STARTED, assert_readings_close, example_reading, write_example
from tests.hang_guard import HANG
from tests.oracles.mcap_doctor import complaints


def frame_of(message: Message, sequence: int = 0, time: float = 0.0) -> bytes:
    return encode_frame(Frame(message.TYPE, sequence, round(time * 1e6), message.pack()))


def reading_frame(number: int, began: float = 0.0) -> bytes:
    reading = example_reading(number)
    reading = replace(reading, time=began + reading.time)
    return frame_of(reading_message(reading, round(SPEED * 1000)), time=reading.time + 0.06)


@st.composite
def scans(draw: st.DrawFn) -> list[Reading]:
    thermometer = draw(st.booleans())
    gaps = draw(st.lists(st.floats(0, 100), min_size=1, max_size=8))
    readings = []
    for number, _ in enumerate(gaps):
        echoes = sorted(draw(st.lists(st.floats(0, 0.5), max_size=5)))
        reading = Reading(
            number=number,
            sweep=draw(st.integers(0, 65535)),
            ping=draw(st.integers(0, 255)),
            angle=draw(st.floats(-37, 37)),
            time=sum(gaps[1 : number + 1]),
            echo_times=tuple(echoes),
            speed_of_sound=draw(st.floats(300, 360)),
            temperature_c=draw(st.floats(-40, 80)) if thermometer else None,
        )
        readings.append(reading)
    return readings


@settings(max_examples=60, deadline=None)
@given(written=scans())
def test_a_log_returns_its_scan(tmp_path_factory: pytest.TempPathFactory, written: list[Reading]) -> None:
    path = tmp_path_factory.mktemp("logs") / "scan.mcap"
    write_scan(path, METADATA, written)
    log = read_log(path)
    assert log.torn is None
    assert len(log.readings) == len(written)
    fired = -1e-6
    for got, wanted in zip(log.readings, written, strict=True):
        fired = max(wanted.time, fired + 1e-6)
        assert_readings_close(got, replace(wanted, time=fired))


@pytest.mark.parametrize("whole", [True, False])
def test_how_a_source_was_read_may_be_known_late(whole: bool, tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    with LogWriter(path, METADATA) as log:
        log.reading(example_reading(0))
        log.state_how_read("range in feet: 'ft' in the text")
        log.reading(example_reading(1))
    if not whole:
        path.write_bytes(path.read_bytes()[:-300])
    assert read_log(path).metadata == replace(METADATA, read_as="range in feet: 'ft' in the text")


@pytest.mark.parametrize("time", [-1.0, 2**64 / 1e6, math.nan])
def test_a_reading_with_an_absurd_time_does_not_end_a_recording(time: float, tmp_path: Path) -> None:
    with LogWriter(tmp_path / "scan.mcap", METADATA) as log:
        log.frame(True, STARTED, reading_frame(0))
        log.reading(replace(example_reading(0), host_time=time))
    assert read_log(tmp_path / "scan.mcap").torn is None


def test_each_trace_is_a_decoded_message_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    samples = np.array([0.0, 1.0, np.nan, 0.5, np.nan])
    carrier = Trace(np.array([np.nan, -1.0, 1.0]), 80_000.0, 0.0, carrier=True)
    with LogWriter(path, METADATA) as log:
        log.reading(replace(example_reading(0), trace=Trace(samples, 50_000.0, 0.001)))
        log.reading(replace(example_reading(1), trace=None))
        log.reading(replace(example_reading(2), trace=carrier))
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        first, second = (trace for _, _, _, trace in reader.iter_decoded_messages(topics=["/traces"]))
    assert (first.reading, first.rate_hz, first.start_s, first.carrier) == (0, 50_000.0, 0.001, False)
    assert [*first.level] == [0, 255, 255, 128, 128]
    assert [*first.lost] == [2, 4]
    assert (second.reading, second.carrier, [*second.level], [*second.lost]) == (2, True, [0, -255, 255], [0])
    assert math.radians(second.angle_deg) == pytest.approx(example_reading(2).angle)


def travelled(count: int = 6) -> list[Reading]:
    """Readings of a sensor that moves; the third has no pose."""
    poses = [None if k == 2 else (0.1 * k, -1.5 + k / 3, 0.2 * k - 7.0) for k in range(count)]
    return [replace(example_reading(k), pose=pose) for k, pose in enumerate(poses)]


@pytest.mark.parametrize("whole", [True, False], ids=["with its index", "torn"])
def test_a_log_returns_the_pose_of_each_reading(whole: bool, tmp_path: Path) -> None:
    path, copy = tmp_path / "scan.mcap", tmp_path / "copy.mcap"
    write_scan(path, METADATA, travelled())
    if not whole:  # without the last chunk and the index
        path.write_bytes(path.read_bytes()[: path.read_bytes().rindex(b'"number": 5')])
    log = read_log(path)
    poses = [reading.pose for reading in travelled()]
    assert (log.torn is None) is whole
    assert [reading.pose for reading in log.readings] == poses[: len(log.readings)]
    assert len(log.readings) >= 5
    copy_log(log, copy)
    assert [reading.pose for reading in read_log(copy).readings] == [reading.pose for reading in log.readings]


def test_a_viewer_finds_the_sensor_of_a_sweep_at_its_pose(tmp_path: Path) -> None:
    """By the published schema: x' = x cos θ - y sin θ + tx, with θ from the quaternion."""
    path = tmp_path / "scan.mcap"
    write_scan(path, METADATA, travelled())
    with path.open("rb") as file:
        messages = [*make_reader(file).iter_messages(topics=["/poses"])]
    assert {schema.name for schema, _, _ in messages if schema} == {"foxglove.FrameTransform"}
    for (_, _, message), reading in zip(messages, [r for r in travelled() if r.pose], strict=True):
        record = json.loads(message.data)
        assert (record["parent_frame_id"], record["child_frame_id"]) == ("room", "turntable")
        turn = 2 * math.atan2(record["rotation"]["z"], record["rotation"]["w"])
        assert (record["translation"]["x"], record["translation"]["y"]) == reading.pose[:2]
        assert math.remainder(turn - reading.pose[2], math.tau) == pytest.approx(0, abs=1e-12)
        assert record["timestamp"]["sec"] == message.log_time // 10**9


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"angle": 1e3}, "i32"),
        *(
            ({"speed_of_sound": s}, f"a speed of sound of {s} m/s; expected at least 1 m/s")
            for s in (math.nan, 0.0, 0.9)
        ),
    ],
)
def test_a_reading_beyond_a_frame_is_refused(tmp_path: Path, change: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        write_scan(tmp_path / "scan.mcap", METADATA, [replace(example_reading(0), **change)])
    assert not (tmp_path / "scan.mcap").exists()


def test_an_existing_file_is_kept_without_overwrite(tmp_path: Path) -> None:
    path, original = tmp_path / "scan.mcap", tmp_path / "original.mcap"
    write_example(original)
    path.write_text("mine")
    with pytest.raises(LogError, match="exists already"):
        LogWriter(path, METADATA)
    with pytest.raises(SonarError, match="exists"):
        copy_log(read_log(original), path)
    assert path.read_text() == "mine"
    LogWriter(path, METADATA, overwrite=True).close()
    assert read_log(path).metadata == METADATA
    copy_log(read_log(original), path, overwrite=True)
    assert len(read_log(path).readings) == 12


def test_nothing_can_be_added_to_a_closed_log(tmp_path: Path) -> None:
    log = LogWriter(tmp_path / "scan.mcap", METADATA)
    log.close()
    log.close()
    with pytest.raises(LogError, match="closed"):
        log.reading(example_reading(0))


# other tools


def test_other_tools_read_frames_readings_and_one_laser_scan_per_sweep(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    readings = [example_reading(n, sweep=n // 4, angle=math.radians(10 * min(n, 7 - n))) for n in range(8)]
    write_scan(path, METADATA, readings)
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        decoded = [json.loads(message.data) for _, _, message in reader.iter_messages(topics=["/readings"])]
        sweeps = [scan for _, _, _, scan in reader.iter_decoded_messages(topics=["/scan"])]
    assert summary.statistics.message_count == 4 + 8 + 8 + 2
    assert [one["angle_deg"] for one in decoded] == pytest.approx([0, 10, 20, 30, 30, 20, 10, 0])
    assert decoded[2] | {"time": 0} == {
        "time": 0,
        "sweep": 0,
        "ping": 0,
        "number": 2,
        "angle_deg": pytest.approx(20),
        "range_m": None,
        "echo_times_s": [],
        "speed_of_sound": SPEED,
        "temperature_c": 21.37,
    }
    assert len(sweeps) == 2
    for scan, four in zip(sweeps, (readings[:4], readings[:3:-1]), strict=True):
        assert (scan.start_angle, scan.end_angle) == pytest.approx((0.0, math.radians(30)))
        assert [*scan.ranges] == pytest.approx([math.inf if r.range is None else r.range for r in four])


def test_the_writer_counts_the_readings_that_the_log_will_have(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    with LogWriter(path, METADATA) as writer:
        for number in range(3):
            # a scan delivers them one by one, later than their frames
            writer.frame(True, STARTED, reading_frame(number))
        writer.reading(example_reading(0))
        assert writer.count == 3
    assert len(read_log(path).readings) == 3


def test_a_sweep_of_unknown_length_is_over_when_no_reading_of_it_can_be_sent_again() -> None:
    sweeps = OpenSweeps()
    over = [sweeps.add(replace(example_reading(k), sweep=int(k > 9)), None) for k in range(100)]
    assert [k for k, ready in enumerate(over) if ready] == [9 + 64]  # readings that a device keeps
    assert [[one.number for one in sweep] for sweep in over[73]] == [[*range(10)]]


# the standard


def test_logs_with_many_sweeps_copies_and_repaired_logs_are_healthy(tmp_path: Path) -> None:
    readings = [example_reading(n, trace=True, sweep=n // 20, angle=math.radians(n % 20)) for n in range(200)]
    write_scan(tmp_path / "scan.mcap", METADATA, readings)
    (tmp_path / "torn.mcap").write_bytes((tmp_path / "scan.mcap").read_bytes()[:-20_000])
    copy_log(read_log(tmp_path / "scan.mcap"), tmp_path / "copy.mcap")
    copy_log(read_log(tmp_path / "torn.mcap"), tmp_path / "repaired.mcap")
    for name in ("scan", "copy", "repaired"):
        assert complaints(tmp_path / f"{name}.mcap") == [], name


def test_sweeps_have_the_published_schema(tmp_path: Path) -> None:
    write_example(tmp_path / "scan.mcap")
    with (tmp_path / "scan.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    (channel,) = (channel for channel in summary.channels.values() if channel.topic == "/scan")
    schema = summary.schemas[channel.schema_id]
    assert (schema.name, schema.encoding, channel.message_encoding) == ("foxglove.LaserScan", "protobuf", "protobuf")
    carried = {file.name: file for file in FileDescriptorSet.FromString(schema.data).file}
    published = LaserScan_pb2.DESCRIPTOR
    for file_descriptor in (published, *published.dependencies):
        assert carried[file_descriptor.name].SerializeToString() == file_descriptor.serialized_pb
    assert [(field.name, field.number) for field in carried[published.name].message_type[0].field] == [
        ("timestamp", 1),
        ("frame_id", 2),
        ("pose", 3),
        ("start_angle", 4),
        ("end_angle", 5),
        ("ranges", 6),
        ("intensities", 7),
    ]


def test_a_chunk_may_end_with_an_empty_record_of_another_program(tmp_path: Path) -> None:
    """Operation codes from 0x80 on are free for any use, and a record may have no content."""
    records = b"\x80" + struct.pack("<Q", 3) + b"abc" + b"\x81" + struct.pack("<Q", 0)
    head = struct.pack("<QQQII", 0, 0, len(records), zlib.crc32(records), 0) + struct.pack("<Q", len(records))
    path = tmp_path / "other.mcap"
    path.write_bytes(MCAP0_MAGIC + b"\x06" + struct.pack("<Q", len(head + records)) + head + records)
    found = [record for record in read_records(OpenFile(path)) if isinstance(record, Record)]
    assert [(record.opcode, record.content) for record in found] == [(0x80, b"abc"), (0x81, b"")]


# sweeps


def readings(*rows: tuple[float, float]) -> list[Reading]:
    """Return readings of headings (degrees) and ranges (m; inf: no echo), in order of time."""
    return [
        Reading(k, 0, 0, math.radians(degrees), 0.1 * k, () if math.isinf(far) else (2 * far / SPEED,), SPEED)
        for k, (degrees, far) in enumerate(rows)
    ]


@pytest.mark.parametrize(
    ("rows", "ends", "ranges"),
    [
        ([(30, 2.0)], (30, 30), [2.0]),
        # of two pings at a heading, the smaller range is the median that was measured; the largest is no echo
        ([(0, 1.0), (0, 9.0), (0, 2.0), (5, 3.0), (5, math.inf), (10, math.inf)], (0, 10), [2.0, 3.0, math.inf]),
        # in the order of headings; without a reading: not a number
        ([(2, 1.0), (1, math.inf), (5, 4.0), (-1, 3.0)], (-1, 5), [3, math.nan, math.inf, 1, math.nan, math.nan, 4]),
        ([(0.1 * k, 1.0 + k) for k in range(3600)], (0, 359.9), [1.0 + k for k in range(3600)]),
    ],
    ids=["one", "several pings", "gaps", "fine"],
)
def test_a_sweep_has_ranges(rows: list[tuple[float, float]], ends: tuple[float, float], ranges: list[float]) -> None:
    """The pose of the frame is the identity, a unit quaternion: headings are about the axis of the turntable."""
    scan = laser_scan(readings(*rows), 12.5)
    assert [*scan.ranges] == pytest.approx(ranges, nan_ok=True)
    assert np.degrees([scan.start_angle, scan.end_angle]) == pytest.approx(ends)
    assert (scan.timestamp.seconds, scan.timestamp.nanos) == (12, 500_000_000)
    assert (scan.pose.orientation.w, scan.pose.orientation.z, scan.pose.position.x) == (1, 0, 0)


def test_headings_that_nearly_coincide_do_not_make_the_grid_huge() -> None:
    assert len(laser_scan(readings((0, 1.0), (0.0001, 2.0), (360, 3.0)), 0.0).ranges) == 36_001


# the disk


class Disk:
    """A disk with a given number of free bytes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, free: float) -> None:
        self.free = free
        self.checks = 0
        monkeypatch.setattr(sonarhw.files, "free_bytes", self._free_bytes)

    def _free_bytes(self, _: Path) -> int:
        self.checks += 1
        return round(self.free)


def test_warnings_come_ten_minutes_and_one_minute_before_the_disk_is_full(monkeypatch: pytest.MonkeyPatch) -> None:
    pace, lines = 1e6, []  # bytes a second
    disk = Disk(monkeypatch, 3600 * pace)
    monitor = DiskSpaceMonitor(Path("scan.mcap"), lines.append)
    seconds = []
    for second in range(3600):
        monitor.written(round(second * pace), STARTED + second)
        disk.free -= pace
        if len(lines) > len(seconds):
            seconds.append(second)
    assert seconds == pytest.approx([3000, 3540], abs=10)
    assert lines[0].startswith("scan.mcap: its disk is nearly full: 599.0 MB are free, enough for about 10 minutes of ")
    assert " s of this scan; delete other files" in lines[1]


@pytest.mark.parametrize("trace", [False, True])
def test_the_predicted_size_of_a_log_is_within_a_third(tmp_path: Path, trace: bool) -> None:
    write_example(tmp_path / "scan.mcap", 200, trace=trace)
    assert log_size(200, 600 if trace else 0) == pytest.approx((tmp_path / "scan.mcap").stat().st_size, rel=0.35)


class Drive:
    """A drive that can be removed; after that, fsync of its file fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
        self.removed = False
        self._path = path
        self._synchronised = queue.Queue[int]()
        self._fsync = os.fsync
        self._file: int | None = None  # inode of the file on the drive, which is the first one
        monkeypatch.setattr(os, "fsync", self._synchronise)

    def _synchronise(self, descriptor: int) -> None:
        status = os.fstat(descriptor)
        self._file = status.st_ino if self._file is None else self._file
        if self.removed and status.st_ino == self._file:
            self._synchronised.put(sys.maxsize)
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        size = status.st_size
        self._fsync(descriptor)
        self._synchronised.put(size)

    def wait(self) -> int:
        """Wait until everything written is synchronised, or an attempt on a removed drive fails; return the size."""
        least = sys.maxsize if self.removed else self._path.stat().st_size
        while (done := self._synchronised.get(timeout=HANG)) < least:
            pass
        return done


def test_each_reading_of_a_live_log_is_synchronised_to_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Drive(monkeypatch, tmp_path / "scan.mcap")
    with LogWriter(tmp_path / "scan.mcap", METADATA) as log:
        drive.wait()
        for number in range(3):
            log.reading(example_reading(number))
            assert drive.wait() == (tmp_path / "scan.mcap").stat().st_size


def record_one(log: LogWriter, number: int) -> None:
    log.frame(True, STARTED, reading_frame(number))
    log.reading(example_reading(number))


@pytest.mark.parametrize(
    ("fault", "copied"), [("full", True), ("full", False), ("deleted", True), ("removed", True), ("removed", False)]
)
def test_a_log_goes_on_elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str, copied: bool) -> None:
    if not copied:
        monkeypatch.setattr(sonarhw.log.writer, "MOST_COPIED", 0)
    first, warnings = tmp_path / "drive" / "scan.mcap", list[str]()
    first.parent.mkdir()
    drive = Drive(monkeypatch, first) if fault == "removed" else None
    full = [False]

    class Disk(FileIO):
        def write(self, data: Any) -> int:
            if full[0] and Path(str(self.name)).parent == first.parent:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return super().write(data)

    monkeypatch.setattr(sonarhw.log.writer, "FileIO", Disk)
    with LogWriter(first, METADATA, warn=warnings.append, fallback=tmp_path / "kept") as log:
        for number in range(3):
            record_one(log, number)
            if drive:
                drive.wait()
        if fault == "deleted":
            first.unlink()
        elif drive:
            drive.removed = True
            record_one(log, 3)
            drive.wait()
            drive.removed = False
        else:
            full[0] = True
        for number in range(4 if drive else 3, 6):
            record_one(log, number)
    whole = read_log(log.path)
    assert log.path == tmp_path / "kept" / "scan.mcap"
    assert [reading.number for reading in whole.readings] == [*range(6)]
    assert whole.torn is None
    (warning,) = warnings
    assert f"the recording continues in {log.path}, with all readings so far" in warning


# logs that are written as a whole


def test_a_disk_that_never_answers_holds_no_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    answers = threading.Event()
    monkeypatch.setattr(os, "fsync", lambda _: answers.wait(HANG))
    monkeypatch.setattr("sonarhw.log.writer.SYNCED_WITHIN", 0.1)
    log = LogWriter(tmp_path / "scan.mcap", METADATA)
    with pytest.raises(LogError, match=r"its disk has not answered for 0\.1 s; nothing is recorded"):
        log.close()
    answers.set()


# replacing an old log


def old_log(path: Path) -> bytes:
    write_example(path, 5)
    return path.read_bytes()


def test_an_old_log_is_kept_until_the_new_one_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    before = old_log(path)
    path.chmod(0o640)
    with LogWriter(path, METADATA, overwrite=True) as log:
        log.frame(True, STARTED, b"\x01\x00")
        assert path.read_bytes() == before
        log.frame(True, STARTED, reading_frame(0))
        log.reading(example_reading(0))
        assert path.read_bytes() == before
        (unfinished,) = {*path.parent.iterdir()} - {path}  # a killed program leaves this
        assert len(read_log(unfinished).readings) == 1
    assert len(read_log(path).readings) == 1
    assert [*path.parent.iterdir()] == [path]
    assert read_log(path).torn is None
    assert path.stat().st_mode & 0o777 == 0o640
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize("how", ["dropped", "failed"])
def test_a_new_log_without_readings_keeps_the_old_one(tmp_path: Path, how: str) -> None:
    path = tmp_path / "scan.mcap"
    before = old_log(path)
    log = LogWriter(path, METADATA, overwrite=True)
    log.frame(True, STARTED, b"\x01\x00")
    if how == "dropped":
        log.drop()
    else:
        with pytest.raises(KeyError), log:
            raise KeyError
    assert path.read_bytes() == before
    assert [*tmp_path.iterdir()] == [path]


def test_a_dropped_log_is_deleted_but_a_device_is_kept(tmp_path: Path) -> None:
    for deleted in (False, True):
        log = LogWriter(tmp_path / "scan.mcap", METADATA)
        if deleted:
            (tmp_path / "scan.mcap").unlink()
        log.drop()
        assert [*tmp_path.iterdir()] == []
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        LogWriter(pipe, METADATA).drop()
    finally:
        os.close(reader)
    assert pipe.exists()


def test_a_log_that_cannot_be_started_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class FullDisk(FileIO):
        def write(self, _: object) -> int:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sonarhw.log.writer, "FileIO", FullDisk)
    with pytest.raises(LogError, match="No space left on device; nothing is recorded"):
        LogWriter(tmp_path / "scan.mcap", METADATA)
    assert [*tmp_path.iterdir()] == []
