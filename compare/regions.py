"""Regions of constant depth: neighbouring headings at which a scan reads one range.

Takes headings and ranges; hands on the regions (RCDs). A mirror of sound, wall, corner or edge, is heard at one range
all over the beam, so a region is the one thing in a scan that says where something stands, and not only how far
(Leonard and Durrant-Whyte, Directed Sonar Sensing for Mobile Robot Navigation, 1992, ch. 3).
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

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
    turns = np.remainder(headings, math.tau)
    order = np.argsort(turns, kind="stable")
    steps = np.diff(np.append(turns[order], turns[order][:1] + math.tau))
    # several pings at one heading are no step
    turned = steps[steps > _TURNED]
    apart = steps > _GAP * float(np.median(turned)) if len(turned) else np.zeros(len(steps), dtype=np.bool_)
    values = ranges[order]
    # begin behind a jump, so that no region is cut in two where the circle closes
    with np.errstate(invalid="ignore"):
        jumps = ~(np.abs(np.roll(values, -1) - values) <= tolerance) & ~(
            np.isinf(values) & np.isinf(np.roll(values, -1))
        )
    sources = [None if mirrors is None else mirrors[row] for row in order]
    changed = [one != other for one, other in zip(sources, sources[1:] + sources[:1], strict=True)]
    breaks = np.flatnonzero(apart | jumps | changed)
    start = int(breaks[0]) + 1 if len(breaks) else 0
    run: list[int] = []
    low = high = math.nan
    source: object = None
    for at in np.roll(np.arange(len(order)), -start).tolist():
        value = float(values[at])
        same = source is None or sources[at] in (None, source)
        near = value == high or max(value, high) - min(value, low) <= tolerance  # never near silence, NaN
        if run and not (near and same and not apart[at - 1]):
            yield run
            run, source = [], None
        if not math.isnan(value):
            low, high = (min(low, value), max(high, value)) if run else (value, value)
            source = sources[at] if sources[at] is not None else source
            run.append(int(order[at]))
    if run:
        yield run


def _region(rows: list[int], headings: FloatArray, ranges: FloatArray) -> Region:
    turned = np.unwrap(headings[rows])
    bearing = float((turned[0] + turned[-1]) / 2 % math.tau)
    return Region(tuple(rows), float(np.median(ranges[rows])), bearing, float(abs(turned[-1] - turned[0])))
