"""Playback of a log: speed, steps, loops and seeking, on the recorded schedule."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonarhw.device.replayed_log import Playback
from sonarhw.log import Log, read_log
from sonarhw.log.writer import write_scan
from tests.fixtures.example_logs import METADATA, example_reading

COUNT = 12  # readings, three sweeps of four, at 0, 0.1, ... 1.1 s


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Return a log of two scans with the same readings."""
    path = tmp_path_factory.mktemp("playback") / "scan.mcap"
    write_scan(path, METADATA, [example_reading(number, sweep=number // 4) for number in range(COUNT)])
    log = read_log(path)
    return replace(log, scans=(*log.scans, *log.scans))


def playing(log: Log, speed: float = 1.0) -> Playback:
    playback = Playback(log)
    playback.speed = speed
    playback.play()
    return playback


@pytest.mark.parametrize("speed", [0.1, 1.0, 3.0, 1000.0])
def test_readings_appear_at_their_recorded_times_divided_by_the_speed(log: Log, speed: float) -> None:
    for passed in (0.05, 0.15, 0.95, 1.15, 2.05, 2.15):
        playback = playing(log, speed)
        playback.advance(passed / speed)
        times = [*(0.1 * n for n in range(COUNT)), *(2.1 + 0.1 * n for n in range(COUNT))]
        assert playback.count == sum(time < passed for time in times)


@settings(max_examples=50)
@given(ticks=st.lists(st.floats(1e-4, 0.05), min_size=1, max_size=60))
def test_playback_does_not_drift_at_irregular_clock_reads(log: Log, ticks: list[float]) -> None:
    playback = playing(log, 0.7)
    for tick in ticks:
        playback.advance(tick)
    assert playback.position == pytest.approx(min(0.7 * math.fsum(ticks), playback.duration), abs=1e-12)


def test_an_infinite_speed_is_accepted_and_zero_is_refused(log: Log) -> None:
    playback = playing(log, math.inf)
    playback.advance(1e-3)
    assert (playback.count, playback.playing) == (2 * COUNT, False)
    for speed in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="above 0"):
            playback.speed = speed


def test_playback_stops_when_paused_and_at_the_end(log: Log) -> None:
    playback = playing(log)
    playback.advance(0.25)
    assert playback.advance(0.0)
    playback.pause()
    assert not playback.advance(10.0)
    assert playback.position == pytest.approx(0.25)
    playback.play()
    playback.advance(100.0)
    assert (playback.position, playback.playing) == (playback.duration, False)
    playback.play()
    assert playback.position == 0.0


def test_a_loop_starts_over_and_never_ends(log: Log) -> None:
    playback = playing(log)
    playback.loop = True
    lap = playback.duration * (1 + 1 / (2 * COUNT - 1))
    playback.advance(5 * lap + 0.35)
    assert playback.playing
    assert playback.position == pytest.approx(0.35)
    assert playback.count == 4


def test_playback_seeks_to_a_reading_a_scan_and_a_sweep(log: Log) -> None:
    playback = Playback(log)
    for index in (0, 7, 2 * COUNT - 1, 3):
        playback.seek_reading(index)
        assert playback.count == index + 1
    playback.seek_scan(1)
    assert playback.count == COUNT + 1
    playback.seek_sweep(1, 2)
    assert playback.count == COUNT + 8 + 1
    playback.seek_sweep(0, 1)
    assert playback.count == 4 + 1
    for missing in (lambda: playback.seek_reading(2 * COUNT), lambda: playback.seek_scan(2)):
        with pytest.raises(IndexError):
            missing()


def test_playback_steps_reading_by_reading(log: Log) -> None:
    playback = playing(log)
    playback.advance(0.55)
    playback.step(1)
    assert (playback.count, playback.playing) == (7, False)
    playback.step(-3)
    assert playback.count == 4
    playback.step(-10)
    assert playback.count == 1
    playback.loop = True
    playback.step(-1)
    assert playback.count == 2 * COUNT
    playback.step(1)
    assert playback.count == 1


def with_pause(log: Log, scan: int, number: int, pause: float) -> Log:
    """Return a log of one scan with a pause before one of its readings."""
    readings = log.scans[0].readings
    late = tuple(replace(reading, time=reading.time + pause * (reading.number >= number)) for reading in readings)
    return replace(log, scans=(replace(log.scans[scan], readings=late),))


def test_gaps_are_skipped_and_other_intervals_are_kept(log: Log) -> None:
    playback = Playback(with_pause(log, 0, 6, 60.0))
    assert playback.duration == pytest.approx(1.1 + 60.0)
    playback.seek_reading(8)
    playback.skip_gaps = True
    assert (playback.count, playback.duration) == (9, pytest.approx(1.1))
    assert playback.position == pytest.approx(0.8)
    playback.skip_gaps = False
    assert (playback.count, playback.position) == (9, pytest.approx(60.8))
