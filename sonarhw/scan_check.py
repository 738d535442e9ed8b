"""What is probably wrong in the readings of a scan, without a room: units, angles, silence, false and mean ranges.

`check_scan` is the one check of every scan: of scanners, files and arrays, in the commands, the window and Python.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sonarhw.arguments import are_degrees
from sonarhw.errors import counted
from sonarhw.mean_ranges import are_means, likely_pings, unit_of
from sonarhw.readings import BoolArray, FloatArray, Origin, Reading

IntArray: TypeAlias = NDArray[np.int64]

DoubtKind = Literal[
    "no echo",
    "beyond reach",
    "too near",
    "one range",
    "scattered",
    "largest range",
    "means",
    "angles",
    "still",
    "jumping",
    "sweeps",
]


@dataclass(frozen=True)
class Doubt:
    """One reason to doubt a scan, and the correction."""

    kind: DoubtKind
    problem: str
    correction: str
    spoils: bool = False  # whether the scan is of no use, so that `scan` ends with an error
    silent: float | None = None  # m, the range that stands for no echo

    def __str__(self) -> str:
        return f"{self.problem}; {self.correction}"


@dataclass(frozen=True)
class Reach:
    """The ranges that a board can report, m."""

    board: str  # its name
    nearest: float
    farthest: float


ANY_BOARD = Reach("", 0.0, 30.0)  # no ultrasonic board in air hears farther

_SLACK = 1.02  # of the reach: the speed of sound is not exactly known
_FEWEST = 6  # readings that show anything
_UNITS = {"centimetres": 0.01, "millimetres": 0.001, "inches": 0.0254, "feet": 0.3048}  # m
_LARGER_UNITS = {"metres, read as centimetres": 100.0, "metres, read as millimetres": 1000.0} | {
    "centimetres, read as millimetres": 10.0
}


def check_scan(readings: Sequence[Reading], reach: Reach = ANY_BOARD, silent: float = math.nan) -> tuple[Doubt, ...]:
    """Return what is probably wrong in a scan. Fewer than 6 readings show only ranges that are too large or too small.

    `reach` is that of the board. `silent` (m) takes the place of no echo in ranges that may be means of pings, if the
    program that recorded them averaged it like a range.
    """
    angles = np.array([reading.angle for reading in readings], np.float64)
    ranges = np.array([math.nan if reading.range is None else reading.range for reading in readings], np.float64)
    known = np.isfinite(angles)
    angles, ranges = angles[known], ranges[known]
    heard = np.isfinite(ranges)
    if not heard.any():
        return (_no_echo(len(ranges), reach),) if len(ranges) >= _FEWEST else ()
    units = _units(ranges[heard], reach)
    if len(ranges) < _FEWEST:
        return () if units is None else (units,)
    sweeps = np.array([reading.sweep for reading in readings])[known]
    order = np.lexsort((angles, sweeps))
    checks = (
        units,
        check_motion(angles, ranges) if len(np.unique(angles)) > 1 else None,
        _false_echo(angles[order], ranges[order], len(np.unique(sweeps))),
        _clamped(angles[order], ranges[order], reach, len(np.unique(sweeps))),
        _degrees_or_radians(angles),
        _opposed(angles, ranges, sweeps),
        _means(ranges, silent) if readings[0].origin in (None, Origin.IMPORTED) else None,
    )
    doubts = tuple(doubt for doubt in checks if doubt)
    if not {doubt.kind for doubt in doubts} & {"one range", "largest range"} and (noise := _scattered(angles, ranges)):
        doubts = (*doubts, noise)
    # a spoilt scan explains the rest, and ranges in another unit look alike
    spoilt = tuple(doubt for doubt in doubts if doubt.spoils or doubt is units)
    return spoilt[:1] or doubts


def _no_echo(count: int, reach: Reach) -> Doubt:
    board = f"the board {reach.board}" if reach.board else "the board"
    correction = (
        "check that the sensor is connected and that something stands in its reach; of a file, check which range means "
        f"no echo; {board} hears from {reach.nearest:.2g} to {reach.farthest:.3g} m"
    )
    return Doubt("no echo", f"none of {counted(count, 'reading')} has an echo", correction)


# Ranges that the board cannot have reported: another unit, or another board.


_MOST_BEYOND = 0.1  # of the echoes
_MOST_NEAR = 0.5


def _units(heard: FloatArray, reach: Reach) -> Doubt | None:
    beyond, near = heard > reach.farthest * _SLACK, heard < reach.nearest / _SLACK
    whose = f"the board {reach.board!r} hears" if reach.board else "such boards hear"
    check = f"check the board{'' if reach.board else ' and the unit'}"
    if beyond.sum() >= max(3, _MOST_BEYOND * len(heard)):
        problem = f"{beyond.sum()} of {len(heard)} ranges are over {reach.farthest:g} m, and {whose} no farther"
        return Doubt("beyond reach", problem, _with_units(heard, reach, _UNITS) or check)
    if near.sum() >= max(_FEWEST, _MOST_NEAR * len(heard)):
        problem = f"{near.sum()} of {len(heard)} ranges are under {reach.nearest:.2g} m, and {whose} no nearer"
        return Doubt("too near", problem, _with_units(heard, reach, _LARGER_UNITS) or check)
    return None


def _with_units(heard: FloatArray, reach: Reach, units: dict[str, float]) -> str:
    """Return the corrections after which the board can have made the readings; empty without one."""
    largest, middle = float(heard.max()), float(np.median(heard))
    fitting = {
        name: scale
        for name, scale in units.items()
        if largest * scale <= reach.farthest * _SLACK and middle * scale >= max(reach.nearest, 0.1)
    }
    named = " or ".join(f"{name}, times {scale:g}" for name, scale in fitting.items())
    return f"if they are {named}: `sonarhw import LOG --scale NUMBER --out NEW.mcap` corrects a log" if named else ""


# One range at many headings: noise on INIT, an echo of the own body, the largest range in place of no echo.


_ONE_RANGE = 0.001  # m, width of one range
_BESIDE = 0.05  # m; ranges so near to it are of the same wall
_LEAST_SHARE, _LEAST_RUNS = 0.12, 5
_SCATTERED = 0.3  # runs of one range per reading with it; in real scans up to 0.25
_EVERYWHERE, _WIDE, _SPAN = 0.9, 0.015, math.radians(90)
_LEAST_SILENT, _SILENT_RUNS = 0.1, 3
_EXACT = 1e-5  # m
_LIKE_WALL = 0.25  # of the readings with the longest range; so many others are just below it, if it is a wall
_FEW_HOLES = 2


def most_common_range(ranges: FloatArray, width: float = _ONE_RANGE) -> tuple[float, int]:
    """Return the least of the ranges (n,) in the fullest interval of this width, m, and how many are in it."""
    ordered = np.sort(ranges)
    counts = np.searchsorted(ordered, ordered + width, "right") - np.arange(len(ordered))
    fullest = int(counts.argmax())
    return float(ordered[fullest]), int(counts[fullest])


def _runs(marked: BoolArray) -> int:
    """Return the number of runs of neighbours that are marked."""
    return int(marked[:1].sum()) + int((np.diff(marked.astype(np.int8)) == 1).sum())


def _false_echo(angles: FloatArray, ranges: FloatArray, sweeps: int) -> Doubt | None:
    """Return a doubt if one range occurs here and there among others of a sweep.

    Readings (n,) are in the order of sweeps, then of angles.
    """
    heard = np.isfinite(ranges)
    of_echoes = ranges[heard]
    lowest, count = most_common_range(of_echoes)
    top = lowest + _ONE_RANGE
    is_limit = of_echoes.max() <= top or lowest < _EXACT  # which may stand for no echo
    if is_limit or count < max(_FEWEST, _LEAST_SHARE * len(of_echoes)):
        return None
    apart = (of_echoes < lowest - _BESIDE) | (of_echoes > top + _BESIDE)
    same = (of_echoes >= lowest) & (of_echoes <= top)
    runs = _runs(same[apart | same])
    if runs < max(_LEAST_RUNS * sweeps, _SCATTERED * count):
        return None
    degrees = np.degrees(np.ptp(angles[heard][same]))
    problem = (
        f"{count} of {len(of_echoes)} echoes are at {lowest:.3f} m, at headings over {degrees:.0f}° between others"
    )
    return Doubt(
        "one range",
        problem,
        "this is noise on INIT or on the supply, or an echo of the carrier, not a wall: keep INIT away from the wires "
        f"of the motor, and measure again; `sonarhw import LOG --no-echo {lowest:.3f} --out NEW.mcap` corrects a log",
    )


_ALONE, _LIKE = 0.1, 0.05  # m, from a range to the longer ones beside it, and between these
_FINE_STEP = math.radians(6)
# of the headings; in 59 real scans at most 0.034 are between, in 217 predicted ones of 6 rooms at most 0.11 alone
_LEAST_ALONE, _LEAST_BETWEEN = 0.15, 0.06


def _scattered(angles: FloatArray, ranges: FloatArray) -> Doubt | None:
    """Return a doubt if many ranges are shorter than those beside them: noise ends a measurement, and walls are wide.

    Single longer ranges are usual: echoes of several reflections.
    """
    heard = np.isfinite(ranges)
    headings, places = np.unique(np.round(angles[heard], 6), return_inverse=True)
    if len(headings) < ENOUGH_MOTION or np.median(np.diff(headings)) > _FINE_STEP:
        return None
    middle = np.array([np.median(ranges[heard][places == k]) for k in range(len(headings))])
    before, after = np.roll(middle, 1), np.roll(middle, -1)
    alone = middle < np.minimum(before, after) - _ALONE
    between = alone & (np.abs(before - after) < _LIKE)
    if alone.mean() < _LEAST_ALONE or between.mean() < _LEAST_BETWEEN or between.sum() < _FEWEST:
        return None
    return Doubt(
        "scattered",
        f"the ranges of {alone.sum()} of {len(middle)} headings are shorter than those beside them",
        "this is noise on INIT or on the supply, not walls: keep INIT away from the wires of the motor, and measure "
        "again",
    )


def _clamped(angles: FloatArray, ranges: FloatArray, reach: Reach, sweeps: int) -> Doubt | None:
    """Return a doubt if a range of 0, or the longest, occurs so often that it stands for no echo.

    The longest does if it occurs here and there, or is the reach of the board; not if ranges beside it are of the same
    wall.
    """
    known = np.isfinite(ranges)
    heard = ranges[known]
    least, longest = max(3, _LEAST_SILENT * len(heard)), float(heard.max())
    zero, same = heard < _EXACT, heard >= longest - _EXACT
    if zero.sum() >= least and not zero.all():
        return _stands_for_silence(zero, "of 0", 0.0)
    limit = abs(longest - reach.farthest) < 0.01 * longest
    if same.all() or same.sum() < least or len(np.unique(angles[known][same])) < _SILENT_RUNS:
        return None
    of_a_wall = int(((heard > longest - _BESIDE) & ~same).sum()) > _LIKE_WALL * same.sum()
    if of_a_wall and not limit:
        return None
    # where silence has a sign of its own, the longest range is one only if it is scattered
    needed = _SILENT_RUNS * sweeps
    needed = needed if len(heard) == len(ranges) else max(needed, _SCATTERED * same.sum())
    if _runs(same) < needed and _holes(same, heard) < _FEW_HOLES and not (limit and len(heard) == len(ranges)):
        return None
    return _stands_for_silence(same, f"of exactly {longest:.4g} m, the longest", longest)


def _holes(same: BoolArray, heard: FloatArray) -> int:
    """Return how often a reading that is the `same` as others stands alone between two of one surface."""
    before, after = heard[:-2], heard[2:]
    alone = same[1:-1] & ~same[:-2] & ~same[2:]
    return int((alone & (np.abs(before - after) < _BESIDE)).sum())


def _stands_for_silence(readings: BoolArray, which: str, silent: float) -> Doubt:
    problem = f"{readings.sum()} of {len(readings)} readings have a range {which}"
    correction = f"if this means no echo, `sonarhw import FILE --no-echo {silent:.6g}` reads it so"
    return Doubt("largest range", problem, correction, silent=silent)


# The angles: a table that stands still, a wrong column or baud rate, radians, sweeps that contradict each other.


_JUDGED = 1000  # angles that show whether they are in order
ENOUGH_MOTION = 24  # readings that show how a device turns
_REVERSALS = 0.4  # of the steps; of random angles two thirds
_LARGE_STEP = math.radians(5)
_MOST_SENSORS = 8  # on a turntable
_ROUNDED = 0.015  # of a turn, from the span of a sweep in rounded radians
_TURN, _TURN_IN_GRADIANS = 361.0, 401.0
_AGREES = 0.05  # m
_OPPOSED, _MORE = 0.6, 0.3  # of the echoes of a sweep


def check_motion(angles: FloatArray, ranges: FloatArray) -> Doubt | None:
    """Return a doubt if a device does not turn or turns at random. Angles (n,) rad, ranges (n,) m; NaN for no echo.

    The readings are in the order of time. At least 24 are needed.
    """
    if len(angles) < ENOUGH_MOTION:
        return None
    if np.ptp(angles) < 1e-9:
        degrees = math.degrees(float(angles[0]))
        return Doubt(
            "still",
            f"the angle was {degrees:g}° in {len(angles)} readings",
            "check that the servo turns, and which number is the angle",
            spoils=True,
        )
    if jumps(angles):
        return Doubt(
            "jumping",
            f"the angles jump at random from {math.degrees(angles.min()):.4g}° to {math.degrees(angles.max()):.4g}°",
            "the baud rate, or the column of the angle, is probably wrong: `sonarhw ports --guess` proposes both",
            spoils=True,
        )
    heard = np.isfinite(ranges)
    if heard.sum() < max(ENOUGH_MOTION, len(ranges) / 2):
        return None
    lowest, count = most_common_range(ranges[heard], _WIDE)
    same = heard & (ranges >= lowest) & (ranges <= lowest + _WIDE)
    span = float(np.ptp(angles[same]))
    if count < _EVERYWHERE * heard.sum() or span < _SPAN:
        return None
    return Doubt(
        "one range",
        f"{count} of {heard.sum()} echoes over {math.degrees(span):.0f}° are at {np.median(ranges[same]):.3f} m",
        "check that the table turns: a sketch may print the angle that it orders; if it turns, this is noise on INIT, "
        "or an echo of the carrier",
        spoils=True,
    )


def jumps(angles: FloatArray) -> bool:
    """Return whether angles are in no order: neither sweeps, of one or several sensors, nor a ring in a fixed order.

    Of fewer than 24 readings, this is a suspicion only.
    """
    angles = angles[:_JUDGED]
    half = len(angles) // 2
    if _is_swept(angles) or any(np.allclose(angles[period:], angles[:-period]) for period in range(2, half + 1)):
        return False
    most = min(_MOST_SENSORS, len(angles) // _FEWEST)
    return not any(all(_is_swept(angles[k::sensors]) for k in range(sensors)) for sensors in range(2, most + 1))


def _is_swept(angles: FloatArray) -> bool:
    """Return whether angles mostly go on in one direction, or in small steps."""
    steps = np.diff(angles)
    steps = steps[steps != 0]
    if len(steps) < 3 or np.median(np.abs(steps)) < _LARGE_STEP:
        return True
    return bool((np.sign(steps[1:]) != np.sign(steps[:-1])).mean() < _REVERSALS)


def _degrees_or_radians(angles: FloatArray) -> Doubt | None:
    """Return a doubt if a scan of half a turn or a turn was read with degrees for radians, or the reverse.

    A turn in gradians that was read as degrees is more than a turn.
    """
    if are_degrees(angles):
        problem = f"the angles reach {np.abs(angles).max():g} radians"
        return Doubt("angles", problem, "if they are degrees: np.radians in Python, angle=deg in a `lines:` URL")
    numbers = np.degrees(np.unique(np.round(angles, 9)))  # as they were before they became radians
    if len(numbers) >= ENOUGH_MOTION and _TURN < np.ptp(numbers) <= _TURN_IN_GRADIANS:
        correction = (
            "if they are gradians: angle=gon in a `lines:` URL; "
            "`sonarhw import LOG --angle gon --out NEW.mcap` corrects a log"
        )
        return Doubt("angles", f"the angles span {np.ptp(numbers):.3f}°, more than a turn", correction)
    if len(numbers) < ENOUGH_MOTION / 2 or np.allclose(10 * numbers, np.round(10 * numbers)):
        return None
    span, step = float(np.ptp(numbers)), float(np.median(np.diff(numbers)))
    if any(abs(turn - span - part * step) <= _ROUNDED * turn for turn in (math.pi, math.tau) for part in (0, 1)):
        correction = (
            "if they are radians: angle=rad in a `lines:` URL; "
            "`sonarhw import LOG --angle rad --out NEW.mcap` corrects a log"
        )
        return Doubt("angles", f"the angles span only {span:.3f}°", correction)
    return None


def _opposed(angles: FloatArray, ranges: FloatArray, sweeps: IntArray) -> Doubt | None:
    """Return a doubt if each sweep is like the one before with its angles reversed."""
    scans = [_by_angle(angles[sweeps == sweep], ranges[sweeps == sweep]) for sweep in np.unique(sweeps)]
    same = opposed = total = 0
    for before, after in pairwise(scans):
        both = sorted(before.keys() & after.keys())
        total += len(both)
        same += sum(abs(before[angle] - after[angle]) <= _AGREES for angle in both)
        opposed += sum(
            abs(before[angle] - after[other]) <= _AGREES for angle, other in zip(both, both[::-1], strict=True)
        )
    if total < ENOUGH_MOTION / 2 or opposed < _OPPOSED * total or opposed - same < _MORE * total:
        return None
    return Doubt(
        "sweeps",
        f"{opposed / total:.0%} of the echoes are those of the sweep before at reversed angles, {same / total:.0%} at "
        "the same angles",
        "the device counts its angle on while the table turns back: print the angle of the servo; keep one sweep of "
        "this scan",
    )


def _by_angle(angles: FloatArray, ranges: FloatArray) -> dict[int, float]:
    """Return the range at each angle in 0.01°, of the readings with an echo."""
    degrees = np.round(100 * np.degrees(angles)).astype(np.int64).tolist()
    return {degree: distance for degree, distance in zip(degrees, ranges.tolist(), strict=True) if distance == distance}


def _means(ranges: FloatArray, silent: float) -> Doubt | None:
    filled = np.where(np.isfinite(ranges), ranges, silent)
    filled = filled[np.isfinite(filled)]
    unit = unit_of(filled, 1.0)
    pings = likely_pings([filled], unit)
    if pings is None:
        return None
    count = int(are_means(filled, unit, pings).sum())
    problem = f"{count} ranges are likely means of {pings} pings with different ranges, so nothing is there"
    return Doubt("means", problem, f"`sonarhw import FILE --mean-of {pings}` leaves them out")
