"""Regions of constant depth (RCDs): neighbouring headings at which a scan has the same range.

A wall, corner or edge returns the same range over the whole beam. The middle of a region is therefore the bearing of
the target, which a single reading does not give (Leonard and Durrant-Whyte, Directed Sonar Sensing for Mobile Robot
Navigation, 1992, ch. 3).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import BoolArray, FloatArray, Reading

# m, largest difference of ranges in one region; slightly over 2 cm, for boards that report whole centimetres
TOLERANCE = 0.02 + 1e-9
LEAST_WIDTH = math.radians(10)  # narrower regions may be chance
_TURNED = 1e-6  # rad, smallest difference of two headings
LEAST = LEAST_WIDTH - _TURNED  # a width of exactly 10° is often rounded down
_SAME_HEADING = math.radians(5)  # readings within it count as one
_GAP = 1.5  # of the usual step between headings; a larger step ends a region


@dataclass(frozen=True)
class Region:
    """Neighbouring readings with the same range."""

    rows: tuple[int, ...]  # of the readings, counter-clockwise
    range: float  # m, the median
    bearing: float  # rad, the middle of its headings
    width: float  # rad, from its first heading to its last

    def __len__(self) -> int:
        return len(self.rows)


def angles_and_ranges(readings: Sequence[Reading]) -> tuple[FloatArray, FloatArray]:
    """Return turntable angles, rad, and ranges, m, NaN for no echo, of readings, (n,) float each."""
    angles = np.array([reading.angle for reading in readings], dtype=np.float64)
    ranges = [math.nan if reading.range is None else reading.range for reading in readings]
    return angles, np.array(ranges, dtype=np.float64)


def regions_of(
    headings: FloatArray,
    ranges: FloatArray,
    tolerance: float = TOLERANCE,
    least_width: float = LEAST,
    mirrors: Sequence[object] | None = None,
) -> tuple[Region, ...]:
    """Return the regions among readings at `headings` (n,) rad with `ranges` (n,) m, NaN for no echo.

    Ranges of one region differ by at most `tolerance` (m), and its `mirrors` (n,), the reflector of each reading if
    known, are the same. Regions narrower than `least_width` (rad) are omitted. Sorted by bearing from 0.
    """
    regions = (_region(rows, headings, ranges) for rows in _runs(headings, ranges, tolerance, mirrors))
    return tuple(sorted((region for region in regions if region.width >= least_width), key=lambda one: one.bearing))


def mean_run(headings: FloatArray, ranges: FloatArray, tolerance: float = TOLERANCE) -> float:
    """Return the number of readings per independent reading, 1 or more: neighbours with the same range count as one.

    No echo counts as a range of its own.
    """
    silent = math.inf
    runs = list(_runs(headings, np.where(np.isnan(ranges), silent, ranges), tolerance))
    return len(ranges) / max(1, len(runs))


def shares_of_readings(headings: FloatArray, ranges: FloatArray, alike: float) -> FloatArray:
    """Return the share of an independent reading that each reading counts as, (n,).

    The errors of neighbours with the same range, or without an echo, have the correlation `alike`; those within 5°
    count as one reading.
    """
    shares = np.ones(len(ranges))
    for run in _runs(headings, np.where(np.isnan(ranges), math.inf, ranges), TOLERANCE):
        steps = np.abs(np.diff(np.unwrap(headings[run])))
        groups = 1 + np.minimum(steps / _SAME_HEADING, 1.0).sum()
        shares[run] = groups / (1 + (groups - 1) * alike) / len(run)
    return shares


def _runs(
    headings: FloatArray, ranges: FloatArray, tolerance: float, mirrors: Sequence[object] | None = None
) -> Iterator[list[int]]:
    """Yield runs of neighbouring rows with the same range and mirror; rows without a range are omitted."""
    order, separated = _detections(headings, ranges)
    if not len(order):
        return
    values = ranges[order].tolist()
    sources = [None if mirrors is None else mirrors[row] for row in order]
    # start after a jump, so that a region across heading 0 is not split
    pairs = zip(separated, values, values[1:] + values[:1], sources, sources[1:] + sources[:1], strict=True)
    start = next((k + 1 for k, pair in enumerate(pairs) if pair[0] or _jumps(*pair[1:], tolerance)), 0)
    run: list[int] = []
    low = high = math.nan
    source: object = None
    for place in np.roll(np.arange(len(order)), -start).tolist():
        value = values[place]
        same = source is None or sources[place] in (None, source)
        near = value == high or max(high, value) - min(low, value) <= tolerance
        if run and not (near and same and not separated[place - 1]):
            yield run
            run, source = [], None
        low, high = (min(low, value), max(high, value)) if run else (value, value)
        source = sources[place] if sources[place] is not None else source
        run.append(int(order[place]))
    yield run


def _detections(headings: FloatArray, ranges: FloatArray) -> tuple[NDArray[np.intp], BoolArray]:
    """Return rows with a range, counter-clockwise, (h,) int, and whether there is a gap behind each, (h,) bool."""
    turns = np.remainder(headings, math.tau)
    order = np.argsort(turns, kind="stable")
    steps = np.diff(np.append(turns[order], turns[order][:1] + math.tau))
    # several pings at one heading have a step of 0
    turned = steps[steps > _TURNED]
    unscanned = steps > _GAP * float(np.median(turned)) if len(turned) else np.zeros(len(steps), dtype=np.bool_)
    detected = np.flatnonzero(~np.isnan(ranges[order]))
    upto = np.append(detected[1:], detected[:1] + len(order))
    # two turns, for the step from the last to the first
    passed = np.concatenate(([0], np.cumsum(np.tile(unscanned, 2))))
    travelled = np.concatenate(([0.0], np.cumsum(np.tile(steps, 2))))
    silent = (upto - detected > 1) & (travelled[upto] - travelled[detected] > LEAST_WIDTH)
    return order[detected], (passed[upto] > passed[detected]) | silent


def _jumps(value: float, after: float, source: object, source_after: object, tolerance: float) -> bool:
    other = value != after and not abs(after - value) <= tolerance
    return other or (None not in (source, source_after) and source != source_after)


def _region(rows: list[int], headings: FloatArray, ranges: FloatArray) -> Region:
    turned = np.unwrap(headings[rows])
    bearing = float((turned[0] + turned[-1]) / 2 % math.tau)
    return Region(tuple(rows), float(np.median(ranges[rows])), bearing, float(abs(turned[-1] - turned[0])))
