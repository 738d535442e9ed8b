"""Regions of constant depth: neighbouring headings at which a scan reads one range.

Takes headings and ranges; hands on the regions (RCDs). A mirror of sound, wall, corner or edge, is heard at one range
all over the beam, so a region is the one thing in a scan that says where something stands, and not only how far
(Leonard and Durrant-Whyte, Directed Sonar Sensing for Mobile Robot Navigation, 1992, ch. 3).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, Reading

# m: by how much ranges of one region may differ in all; a hair over 2 cm, for boards that report whole centimetres
TOLERANCE = 0.02 + 1e-9
LEAST_WIDTH = math.radians(10)  # what is narrower may be chance
_TURNED = 1e-6  # rad
_GAP = 1.5  # of the usual step between headings: what is farther apart is no neighbour


@dataclass(frozen=True)
class Region:
    """Neighbouring readings of one range."""

    rows: tuple[int, ...]  # of the readings, counter-clockwise
    range: float  # m, the median
    bearing: float  # rad: the middle of its headings
    width: float  # rad, from its first heading to its last

    def __len__(self) -> int:
        return len(self.rows)


def regions_of_readings(
    readings: Sequence[Reading],
    zero: float = 0.0,
    offset: float = 0.0,
    tolerance: float = TOLERANCE,
    least_width: float = LEAST_WIDTH,
) -> tuple[Region, ...]:
    """The regions of a scan whose turntable's step 0 points along `zero` (rad); `offset` (m) is added to its ranges."""
    headings = np.array([zero + reading.angle for reading in readings], dtype=np.float64)
    ranges = np.array([math.nan if reading.range is None else reading.range + offset for reading in readings])
    return regions_of(headings, ranges, tolerance, least_width)


def regions_of(
    headings: FloatArray,
    ranges: FloatArray,
    tolerance: float = TOLERANCE,
    least_width: float = LEAST_WIDTH,
    mirrors: Sequence[object] | None = None,
) -> tuple[Region, ...]:
    """The regions among readings at `headings` (n,) rad with `ranges` (n,) m, NaN where there is no echo.

    Neighbours belong to one as long as its ranges differ by no more than `tolerance` (m) in all, and none of its
    `mirrors` (n), what each was heard from where that is known, is another. Only those at least `least_width` (rad)
    wide are handed on, counter-clockwise from heading 0.
    """
    found = (_region(rows, headings, ranges) for rows in _runs(headings, ranges, tolerance, mirrors))
    return tuple(sorted((region for region in found if region.width >= least_width), key=lambda one: one.bearing))


def mean_run(headings: FloatArray, ranges: FloatArray, tolerance: float = TOLERANCE) -> float:
    """How many readings there are to one that says something new, 1 or more: neighbours of one range say the same.

    Silence counts as a range of its own.
    """
    silent = math.inf
    runs = list(_runs(headings, np.where(np.isnan(ranges), silent, ranges), tolerance))
    return len(ranges) / max(1, len(runs))


def _runs(
    headings: FloatArray, ranges: FloatArray, tolerance: float, mirrors: Sequence[object] | None = None
) -> Iterator[list[int]]:
    """Rows of neighbouring readings of one range and mirror, run by run; those without a range are in none."""
    order, apart = _heard_in_turn(headings, ranges)
    if not len(order):
        return
    values = ranges[order].tolist()
    sources = [None if mirrors is None else mirrors[row] for row in order]
    # begin behind a jump, so that no region is cut in two where the circle closes
    pairs = zip(apart, values, values[1:] + values[:1], sources, sources[1:] + sources[:1], strict=True)
    start = next((k + 1 for k, pair in enumerate(pairs) if pair[0] or _jumps(*pair[1:], tolerance)), 0)
    run: list[int] = []
    low = high = math.nan
    source: object = None
    for at in np.roll(np.arange(len(order)), -start).tolist():
        value = values[at]
        same = source is None or sources[at] in (None, source)
        near = value == high or max(high, value) - min(low, value) <= tolerance
        if run and not (near and same and not apart[at - 1]):
            yield run
            run, source = [], None
        low, high = (min(low, value), max(high, value)) if run else (value, value)
        source = sources[at] if sources[at] is not None else source
        run.append(int(order[at]))
    yield run


def _heard_in_turn(headings: FloatArray, ranges: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Rows with a range, counter-clockwise, (h,) int, and whether the next is no neighbour of each, (h,) bool."""
    turns = np.remainder(headings, math.tau)
    order = np.argsort(turns, kind="stable")
    steps = np.diff(np.append(turns[order], turns[order][:1] + math.tau))
    # several pings at one heading are no step
    turned = steps[steps > _TURNED]
    unscanned = steps > _GAP * float(np.median(turned)) if len(turned) else np.zeros(len(steps), dtype=np.bool_)
    heard = np.flatnonzero(~np.isnan(ranges[order]))
    upto = np.append(heard[1:], heard[:1] + len(order))
    # twice round, for the way from the last to the first
    passed = np.concatenate(([0], np.cumsum(np.tile(unscanned, 2))))
    way = np.concatenate(([0.0], np.cumsum(np.tile(steps, 2))))
    silent = (upto - heard > 1) & (way[upto] - way[heard] > LEAST_WIDTH)
    return order[heard], (passed[upto] > passed[heard]) | silent


def _jumps(value: float, after: float, source: object, source_after: object, tolerance: float) -> bool:
    other = value != after and not abs(after - value) <= tolerance
    return other or (None not in (source, source_after) and source != source_after)


def _region(rows: list[int], headings: FloatArray, ranges: FloatArray) -> Region:
    turned = np.unwrap(headings[rows])
    bearing = float((turned[0] + turned[-1]) / 2 % math.tau)
    return Region(tuple(rows), float(np.median(ranges[rows])), bearing, float(abs(turned[-1] - turned[0])))
