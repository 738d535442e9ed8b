import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from sonarhw.errors import LogError, SonarError
from sonarhw.log import LogWriter, copy_log, read_log
from sonarhw.log.writer import OpenSweeps, write_scan
from sonarhw.readings import Reading, Trace
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Message
from sonarhw.wire.readings_of_frames import reading_message
from tests.fixtures.example_logs import METADATA, SPEED, STARTED, assert_readings_close, example_reading, write_example


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
def test_a_log_returns_the_scan_that_was_written(
    tmp_path_factory: pytest.TempPathFactory, written: list[Reading]
) -> None:
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
def test_a_reading_that_no_frame_can_hold_is_refused_and_leaves_no_file(
    tmp_path: Path, change: dict[str, float], message: str
) -> None:
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
    readings = [
        example_reading(n, sweep=n // 4, angle=math.radians(10 * [0, 1, 2, 3, 3, 2, 1, 0][n])) for n in range(8)
    ]
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
