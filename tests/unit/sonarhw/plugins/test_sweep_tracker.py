"""Sweeps are recognised where the angle turns back, whatever the device does at its ends."""

import math
import random
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.plugins.device_plugin import Measurement
from sonarhw.plugins.sweep_tracker import Placed, SweepTracker

UP, DOWN = [*range(15, 166)], [*range(165, 14, -1)]


def at(degrees: float, restarted: bool = False) -> Measurement:
    return Measurement(math.radians(degrees), (1.0,), restarted=restarted)


def followed(items: Iterable[Measurement], sweeps: int) -> tuple[SweepTracker, list[Placed]]:
    """Return a tracker that was given items until so many sweeps were whole, and what it has placed."""
    tracker = SweepTracker()
    tracker.want(sweeps)
    return tracker, [one for item in items if not tracker.done for one in tracker.add(item)]


def tracked(angles: list[float], sweeps: int = 100) -> list[tuple[int, int]]:
    """Return sweep and angle of the readings of so many whole sweeps."""
    _, placed = followed(map(at, angles), sweeps)
    return [(one.sweep, round(math.degrees(one.measurement.angle))) for one in placed]


def of(sweep: int, placed: list[tuple[int, int]]) -> list[int]:
    return [angle for number, angle in placed if number == sweep]


def test_a_sector_through_zero_is_one_sweep() -> None:
    there = [*range(300, 360, 2), *range(0, 61, 2)]
    placed = tracked(3 * (there + there[::-1]), sweeps=2)
    assert of(0, placed) == there[::-1]
    assert of(1, placed) == there


def test_a_measured_angle_may_shake() -> None:
    rng = random.Random(2)
    angles = [angle + rng.uniform(-0.8, 0.8) for angle in 3 * (UP + DOWN)]
    placed = tracked(angles, sweeps=2)
    assert [len(of(sweep, placed)) for sweep in (0, 1)] == pytest.approx([151, 151], abs=3)


def test_several_pings_at_an_angle_are_numbered() -> None:
    up = [angle for angle in range(0, 50, 5) for _ in range(3)]
    _, placed = followed(map(at, 3 * (up + up[::-1])), 1)
    assert [one.ping for one in placed if round(math.degrees(one.measurement.angle)) == 20][:3] == [0, 1, 2]


def test_an_angle_with_a_lost_digit_is_dropped() -> None:
    rng = random.Random(1)
    wrong = {rng.randrange(160, 440): 9.0 for _ in range(5)}
    tracker, placed = followed((at(wrong.get(k, angle)) for k, angle in enumerate(3 * (UP + DOWN))), 2)
    assert tracker.dropped == len(wrong)
    assert all(math.degrees(one.measurement.angle) > 14 for one in placed)


def test_a_single_angle_between_two_sectors_is_kept() -> None:
    tracker = SweepTracker(begins_whole=True)
    angles = [*range(0, 61, 5), 180, *range(100, 161, 5)]
    placed = [one for angle in angles for one in tracker.add(at(angle))]
    assert [round(math.degrees(one.measurement.angle)) for one in [*placed, *tracker.flush()]] == angles
    assert tracker.dropped == 0


def test_a_restart_ends_a_sweep_that_is_not_whole() -> None:
    before, after = map(at, UP + DOWN + UP[:60]), map(at, UP[1:] + DOWN + UP)
    tracker, placed = followed([*before, at(UP[0], restarted=True), *after], 2)
    assert tracker.restarts == 1
    numbers = [one.sweep for one in placed]
    assert [numbers.count(sweep) for sweep in range(3)] == [151, 60, 151]


def test_a_loss_ends_a_sweep_that_is_not_whole() -> None:
    tracker, placed = followed(map(at, UP + DOWN + UP[:60]), 2)
    tracker.gap()
    placed += [one for angle in DOWN + UP + DOWN[:9] if not tracker.done for one in tracker.add(at(angle))]
    numbers = [one.sweep for one in placed]
    assert tracker.done
    # the newest angle before the loss is not confirmed
    assert [numbers.count(sweep) for sweep in range(4)] == [151, 59, 151, 151]


def test_a_line_of_text_after_each_sweep_is_no_restart() -> None:
    once = [*range(0, 181, 4)]
    tracker, placed = followed(8 * [at(once[0], restarted=True), *map(at, once[1:])], 3)
    assert tracker.done
    assert len(placed) <= 6 * len(once)


def test_a_line_of_text_within_a_sweep_ends_nothing() -> None:
    tracker, placed = followed((at(angle, restarted=k % 302 == 200) for k, angle in enumerate(4 * (UP + DOWN))), 2)
    assert tracker.restarts == 0
    assert [[one.sweep for one in placed].count(sweep) for sweep in (0, 1)] == [151, 151]


def test_a_device_that_stops_before_its_angle_turns_back_gives_what_it_has() -> None:
    tracker = SweepTracker()
    tracker.want(1)
    assert [tracker.add(at(angle)) for angle in UP[:20]] == 20 * [[]]
    assert [round(math.degrees(one.measurement.angle)) for one in tracker.flush()] == UP[:20]


@given(st.lists(st.tuples(st.integers(-720, 720), st.booleans())), st.integers(1, 3))
def test_any_angles_are_placed_once_and_in_order(angles: list[tuple[int, bool]], sweeps: int) -> None:
    items = [at(angle, restarted) for angle, restarted in angles]
    tracker, placed = followed(items, sweeps)
    placed += tracker.flush()
    order = [next(k for k, item in enumerate(items) if item is one.measurement) for one in placed]
    assert order == sorted(set(order))
    numbers = [one.sweep for one in placed]
    assert numbers == sorted(numbers)
