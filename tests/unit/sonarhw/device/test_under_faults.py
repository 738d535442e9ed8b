"""A session under every kind of fault: it recovers or ends with an error, and delivers no wrong reading."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.errors import DeviceError, Incompatible, LinkLost, NoAnswer, SonarError
from sonarhw.host.scripts import homing, scanning, turning
from sonarhw.log import LogWriter, read_log
from sonarhw.readings import Reading
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import Heartbeat, Hello, Outcome, StartScan, Turn
from tests.fixtures.example_logs import METADATA
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import echo_time
from tests.fixtures.plugged import Plugged

SECTOR = StartScan(start=10_000_000, step=2_500_000, headings=40, sweeps=2, pings=1)
RECOVERABLE = [
    "",
    "drop=1/2000",
    "flip=1/2000",
    "insert=1/2000",
    "drop=1/3000,flip=1/3000,insert=1/3000",
    "drift=200",
    "drift=-5000",
    "protocol=1.0",
    "protocol=1.9",
    "stall=0.4@r20",
    "stall=0.7@~2",
    "stall=2@r20",
    "stall=6@~15",
    "deaf=0.3@r20",
    "deaf@~3",
    "deaf=4@r20",
    "mute=0.3@r20",
    "mute@~5",
    "mute=4@r20",
    "reset=0.01@r20",
    "reset@r1",
    "reset@r20",
    "reset=2@~8",
    "reset@r20,drop=1/3000",
    "nonsense=0.3@r20",
    "nonsense=3@r20",
    "unplug=0.2@r20",
    "unplug@r20",
    "unplug=8@r60",
    "unplug@~5",
    "unplug@r20,reset=1.5@r20",
    "move@r20",
    "move@~6,reset@~11",
    "stall=0.5@~9,reset@~17,unplug@~13,drop=1/5000,flip=1/5000,drift=300",
]
UNRECOVERABLE = {
    "wedge": (DeviceError, "zero mark was not found"),
    "wedge@r20": (DeviceError, "zero mark"),
    "slip=3@r20": (DeviceError, "3 microsteps from its place"),
    "protocol=0.9": (Incompatible, r"0\.9"),
    "protocol=2.0": (Incompatible, r"2\.0"),
    "nonsense": (NoAnswer, "no scanner answered"),
    "nonsense@r20": (SonarError, "did not come back within 30 s"),
    "unplug=1000@r20": (LinkLost, "did not come back within 30 s"),
    "drop=1": (NoAnswer, "no scanner answered"),
}


def assert_correct(readings: Sequence[Reading]) -> None:
    """Assert angle and echoes of each reading, and the samples of its trace that arrived."""
    for reading in readings:
        sweep, index = divmod(reading.number, 40)
        angle = math.radians(10 + 2.5 * (39 - index if sweep else index))
        assert (reading.sweep, reading.ping) == (sweep, 0)
        assert reading.angle == pytest.approx(angle, abs=1e-8)
        assert reading.echo_times == pytest.approx((echo_time(angle), 2 * echo_time(angle)), abs=2e-9)
        samples = reading.trace.samples if reading.trace else np.full(3125, math.nan)
        arrived = ~np.isnan(samples)
        np.testing.assert_allclose(samples[arrived], np.linspace(0, 1, 3125)[arrived], atol=0.5 / 255 + 1e-12)


@pytest.mark.parametrize("faults", RECOVERABLE, ids=lambda faults: faults or "none")
def test_recoverable_faults_lose_and_repeat_no_reading_if_the_port_stays(faults: str) -> None:
    plugged = Plugged(faulty(faults), vanishes=False)
    readings = plugged.scan(SECTOR)
    assert sorted(reading.number for reading in readings) == list(range(80))
    assert_correct(readings)


@pytest.mark.parametrize("faults", RECOVERABLE, ids=lambda faults: faults or "none")
def test_they_lose_and_repeat_none_with_traces_if_it_vanishes_and_the_log_contains_all(
    faults: str, tmp_path: Path
) -> None:
    path, plugged = tmp_path / "scan.mcap", Plugged(faulty(faults))
    with LogWriter(path, METADATA) as log:
        plugged.session.recording.use(log)
        delivered = plugged.scan(SECTOR, trace=True)
    assert sorted(reading.number for reading in delivered) == list(range(80))
    assert_correct(delivered)
    recorded = read_log(path)
    assert recorded.torn is None
    kept = {reading.number: reading for reading in recorded.readings}
    assert len(kept) == len(recorded.readings) == len(delivered) == 80
    for reading in delivered:
        assert (kept[reading.number].angle, kept[reading.number].echo_times) == (reading.angle, reading.echo_times)
        # after a reset, the time is continued from the received frames; a log contains only some of them
        assert kept[reading.number].time == pytest.approx(reading.time, abs=0.01)


@pytest.mark.parametrize("faults", ["deaf=4@1.7", "stall=4@1.7", "mute=4@1.7", "reset@1.7", "unplug@1.7"])
def test_an_interrupted_turn_is_completed(faults: str) -> None:
    plugged = Plugged(faulty(faults))
    plugged.do(homing())
    for angle in (700_000_000, 10_000_000):  # each takes 4 s
        assert plugged.do(turning(Turn(angle))).result is Outcome.DONE
    readings = plugged.scan(SECTOR)
    assert len(readings) == 80
    assert_correct(readings)


@pytest.mark.parametrize(("faults", "expected"), UNRECOVERABLE.items(), ids=UNRECOVERABLE.keys())
def test_unrecoverable_faults_give_an_error_of_one_line(faults: str, expected: tuple[type[SonarError], str]) -> None:
    plugged = Plugged(faulty(faults))
    order = StartScan(-10_000_000, 2_500_000, 10, 40, 1)
    job = scanning(order)
    with pytest.raises(expected[0], match=expected[1]) as error:
        plugged.do(job, within=120)
    assert "\n" not in str(error.value)


def test_each_reset_is_counted_as_one_start_of_the_board() -> None:
    plugged = Plugged(faulty("reset@r20,reset@r40"))
    plugged.scan(SECTOR)
    info = plugged.session.device.info
    assert info is not None
    assert info.boot == 3


def test_a_board_with_faults_sends_no_frame_early() -> None:
    """However often its line is read."""
    device, decoder = faulty(""), FrameDecoder()
    device.receive(encode_frame(Frame(Hello.TYPE, 1, 0, Hello(1, 1).pack())), 0.0)
    heartbeats = 0
    for now in np.arange(0.0, 1.02, 0.01):
        for frame in decoder.feed(device.advance(float(now))):
            assert isinstance(frame, Frame)
            assert now - 0.011 < frame.time_us * 1e-6 <= now + 1e-6
            heartbeats += frame.type == Heartbeat.TYPE
    assert heartbeats in (3, 4)  # one every quarter of a second


def occurrences(spec: str, method: str, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the times at which a fault reaches the board within 1000 s."""
    times: list[float] = []
    device = faulty(spec)
    monkeypatch.setattr(FakeBoard, method, lambda _board, _size: times.append(now))
    for now in np.arange(0.0, 1000.0, 0.05):
        device.advance(float(now))
    return times


def test_a_repeated_fault_occurs_again_only_after_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    times = occurrences("wedge=5@~5", "wedge", monkeypatch)
    apart = np.diff(times)
    assert apart.min() >= 4.9
    assert apart.mean() == pytest.approx(10.0, rel=0.25)


def test_the_size_of_a_slip_is_not_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    times = occurrences("slip=500@~5", "slip", monkeypatch)
    assert np.diff(times).mean() == pytest.approx(5.0, rel=0.25)
