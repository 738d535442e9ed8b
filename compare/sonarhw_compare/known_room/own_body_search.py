"""Echoes of the carrier of a sensor: the same turntable angle and range at every place, and not those of the room.

Echoes that the room explains say nothing about the carrier, so they are not given. A run of neighbouring angles counts
if nearly all places have the same range there, and if the other echoes, turned against each other at random, hardly
ever have a run as long. At its ends an echo is as faint as the threshold, so it is detected at some places only.

The room file may lack a wall that is equally far from two places. Its echoes look like those of the carrier, so scans
from two places are not enough.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import OwnBodyPart

from sonarhw.readings import BoolArray, FloatArray, Reading
from sonarhw_compare.matching.regions import angles_and_ranges

SAME_RANGE = 0.025  # m, largest difference of ranges that count as the same
SAME_PLACE = 0.05  # m, between positions that count as one place
_AGREEING = 0.7  # share of the places
_NEXT = 0.03  # m, largest difference of ranges of neighbouring angles
_TURNS = 300  # random turns of the scans against each other
_APART = 12  # directions from which turns are drawn, or one for each place if there are more
_AS_FAR = 0.05  # m, between ranges of one body, and of runs that are compared
_SHORTEST = 2  # angles
_CHANCE = 0.01  # of these, that have a run as long
_FINEST = math.radians(1.0)

IntArray = NDArray[np.intp]


@dataclass(frozen=True)
class ScanAtPlace:
    """The readings of a scan that the room does not explain, silence included, and where it was made."""

    readings: Sequence[Reading]
    position: tuple[float, float]  # m


def find_own_body(scans: Sequence[ScanAtPlace]) -> tuple[OwnBodyPart, ...]:
    """Return the parts of the carrier's body that the scans show, by turntable angle; none from fewer than 2 places."""
    places = place_numbers([scan.position for scan in scans])
    if len(set(places.tolist())) < 2:
        return ()
    step = max(_FINEST, *(_step(scan.readings) for scan in scans))
    count = round(math.tau / step)
    ranges, covered = (np.array(both) for both in zip(*(_on_grid(scan.readings, count) for scan in scans), strict=True))
    runs = _certain_runs(ranges, covered, places, np.random.default_rng(0))
    return tuple(sorted((_part(run, ranges, count) for run in runs), key=lambda part: part.from_deg))


def _certain_runs(
    ranges: FloatArray, covered: BoolArray, places: IntArray, random: np.random.Generator
) -> list[IntArray]:
    """Return the runs that are not by chance, with their ends."""
    values, enough = _consensus(ranges, covered, places)
    found = [(run, float(np.median(values[run]))) for run in _runs(values, enough) if len(run) >= _SHORTEST]
    by_chance = _runs_by_chance(*_without(found, ranges, covered), places, random)
    found = [(run, middle) for run, middle in found if not _is_by_chance(run, middle, by_chance)]
    return _joined([_longer(run, middle, ranges) for run, middle in found])


def _without(
    found: Sequence[tuple[IntArray, float]], ranges: FloatArray, covered: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return ranges and coverage without the echoes of runs: two parts of a body meet when scans are turned."""
    ranges, covered = ranges.copy(), covered.copy()
    for run, middle in found:
        own = np.abs(ranges[:, run] - middle) <= _AS_FAR
        covered[:, run] &= ~own
        ranges[:, run] = np.where(own, np.nan, ranges[:, run])
    return ranges, covered


def place_numbers(positions: Sequence[tuple[float, float]]) -> IntArray:
    """Return the number of the place of each position, (n,); positions within 5 cm are one place."""
    numbers: list[int] = []
    for k, position in enumerate(positions):
        near = (numbers[j] for j in range(k) if math.dist(position, positions[j]) <= SAME_PLACE)
        numbers.append(next(near, max(numbers, default=-1) + 1))
    return np.array(numbers, dtype=np.intp)


def _step(readings: Sequence[Reading]) -> float:
    """Return the usual step between the angles of a scan, rad."""
    angles = np.unique(np.round(np.remainder([one.angle for one in readings], math.tau), 6))
    return float(np.median(np.diff(angles))) if len(angles) > 1 else math.tau


def _on_grid(readings: Sequence[Reading], count: int) -> tuple[FloatArray, BoolArray]:
    """Return the range at each of `count` turntable angles, m, NaN for silence, and which angles have a reading."""
    angles, ranges = angles_and_ranges(readings)
    grid = np.arange(count) * (math.tau / count)
    away = np.abs(np.remainder(angles - grid[:, None] + math.pi, math.tau) - math.pi)
    nearest = away.argmin(axis=1)
    covered = away[np.arange(count), nearest] <= 0.75 * math.tau / count
    return np.where(covered, ranges[nearest], np.nan), covered


def _consensus(ranges: FloatArray, covered: BoolArray, places: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return the range that most places have at each angle, (n,) m, and whether enough places have it, (n,)."""
    numbers = np.unique(places)
    same = np.abs(ranges[:, None] - ranges) <= SAME_RANGE  # (scan, other scan, angle)
    agreeing = sum(same[:, places == number].any(axis=1).astype(np.intp) for number in numbers)
    present = sum(covered[places == number].any(axis=0).astype(np.intp) for number in numbers)
    agreeing = np.asarray(agreeing)
    best = agreeing.argmax(axis=0)
    columns = np.arange(ranges.shape[1])
    enough = agreeing[best, columns] >= np.maximum(2, np.ceil(_AGREEING * present))
    return ranges[best, columns], enough


def _runs(values: FloatArray, enough: BoolArray) -> list[IntArray]:
    """Return the runs of neighbouring angles, also across angle 0, with enough places and nearly equal ranges."""
    count = len(values)
    joined = enough & np.roll(enough, 1) & (np.abs(values - np.roll(values, 1)) <= _NEXT)
    if joined.all():
        return [np.arange(count)]
    runs: list[list[int]] = []
    # begin behind a gap
    first = int(np.flatnonzero(~joined)[0])
    for k in (np.arange(count) + first) % count:
        if enough[k]:
            if joined[k] and runs and runs[-1][-1] == (k - 1) % count:
                runs[-1].append(int(k))
            else:
                runs.append([int(k)])
    return [np.array(run, dtype=np.intp) for run in runs]


def _runs_by_chance(
    ranges: FloatArray, covered: BoolArray, places: IntArray, random: np.random.Generator
) -> list[list[tuple[int, float]]]:
    """Return the length and the range, m, of each run of the scans, turned against each other at random many times."""
    count = ranges.shape[1]
    apart = max(1, count // max(_APART, places.max() + 1))
    found = []
    for _ in range(_TURNS):
        # scans of one place stay together; no two places are turned alike
        turns = random.permutation(np.arange(0, count, apart))[: places.max() + 1] + random.integers(0, apart)
        rows = (np.arange(count) - turns[places][:, None]) % count
        values, enough = _consensus(
            np.take_along_axis(ranges, rows, axis=1), np.take_along_axis(covered, rows, axis=1), places
        )
        found.append([(len(run), float(np.median(values[run]))) for run in _runs(values, enough)])
    return found


def _is_by_chance(run: IntArray, middle: float, by_chance: list[list[tuple[int, float]]]) -> bool:
    """Return whether a run at a range (m) may be by chance: turned scans have one as long, and as far, too often."""
    alike = sum(any(length >= len(run) and abs(at - middle) <= _AS_FAR for length, at in runs) for runs in by_chance)
    return alike > _CHANCE * len(by_chance)


def _longer(run: IntArray, middle: float, ranges: FloatArray) -> IntArray:
    """Return a run with its neighbours at which a place has an echo as far away as the run, `middle` m."""
    alike: BoolArray = np.any(np.abs(ranges - middle) <= _AS_FAR, axis=0)
    count = len(alike)
    begin, end = int(run[0]), int(run[0]) + len(run) - 1
    while alike[(begin - 1) % count] and end - begin + 1 < count:
        begin -= 1
    while alike[(end + 1) % count] and end - begin + 1 < count:
        end += 1
    return np.arange(begin, end + 1) % count


def _joined(runs: Sequence[IntArray]) -> list[IntArray]:
    """Return runs, with those that have met as one."""
    joined: list[IntArray] = []
    for run in runs:
        met = [other for other in joined if np.isin(other, run).any()]
        angles = np.unique(np.concatenate((run, *met)))
        gaps = np.flatnonzero(np.diff(angles) > 1)
        # a run across angle 0 begins behind its only gap
        angles = np.roll(angles, -int(gaps[0]) - 1) if len(gaps) else angles
        joined = [*(other for other in joined if not np.isin(other, run).any()), angles]
    return joined


def _part(run: IntArray, ranges: FloatArray, count: int) -> OwnBodyPart:
    """Return a run as a part of the body; the outer half steps belong to it, and all ranges that count as the same."""
    step, echoes = 360.0 / count, ranges[:, run]
    away = np.abs(echoes - np.nanmedian(echoes))
    middles = np.take_along_axis(echoes, np.nanargmin(away, axis=0)[None], axis=0)
    own = echoes[np.abs(echoes - middles) <= SAME_RANGE]
    begin = (float(run[0]) - 0.5) * step
    return OwnBodyPart(
        from_deg=round(begin, 2),
        to_deg=round(begin + len(run) * step, 2),
        nearest=round(max(float(own.min()) - SAME_RANGE, 0.0), 4),
        farthest=round(float(own.max()) + SAME_RANGE, 4),
    )
