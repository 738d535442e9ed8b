"""Differences of two scans by heading: medians, readings that changed by more than their noise, and what fell silent.

No room is needed. The noise of a ping is estimated from the scans themselves, see `noise_of`.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board

from sonarhw.errors import InputError, counted, heading_text, in_degrees
from sonarhw.readings import FloatArray, Reading, angle_difference

CSV_HEADER = (
    "heading_deg,first_m,second_m,difference_m,limit_m,change,first_pings,first_echoes,second_pings,second_echoes"
)

CHANGED = 4.0  # standard deviations; by chance, 1 heading in 16 000 differs more
LEAST_NOISE = 0.002  # m, of a ping; less is not credible, because air moves
_TO_DEVIATION = 1.4826  # standard deviation of a normal distribution by its median absolute deviation
_SAME_HEADING = 1e-4  # rad
_FEWEST = 8  # headings, for an estimate of noise
_NO_ESTIMATE = 0.01  # m, the noise of a ping where nothing shows it, assumed


class ScanChange(StrEnum):
    """What happened to the reading at a heading from the first scan to the second."""

    SAME = "same"  # a difference that noise explains
    NEARER = "nearer"
    FARTHER = "farther"
    FELL_SILENT = "fell silent"  # an echo in the first scan only
    APPEARED = "appeared"  # an echo in the second scan only
    BOTH_SILENT = "both silent"


@dataclass(frozen=True)
class HeadingSeries:
    """The first echoes of a scan, in order of their pings; m, NaN without an echo."""

    headings: FloatArray  # (n,) rad
    ranges: FloatArray  # (n,) m
    rounding: float = 0.0  # m, of the board


@dataclass(frozen=True)
class AtHeading:
    """The pings of one scan at one heading."""

    heading: float  # rad, 0 to 2π
    ranges: FloatArray  # (n,) m, NaN without an echo

    @property
    def pings(self) -> int:
        """The number of pings."""
        return len(self.ranges)

    @property
    def heard(self) -> int:
        """The number of pings with an echo."""
        return int(np.isfinite(self.ranges).sum())

    @property
    def median(self) -> float | None:
        """The median range, m; None if most pings are without an echo."""
        return float(np.nanmedian(self.ranges)) if self.heard and 2 * self.heard >= self.pings else None


@dataclass(frozen=True)
class HeadingDifference:
    """The readings of two scans at one heading."""

    first: AtHeading
    second: AtHeading
    limit: float  # m, largest difference that noise and rounding explain

    @property
    def heading(self) -> float:
        """Heading in the first scan, rad."""
        return self.first.heading

    @property
    def cells(self) -> list[float | int | str | None]:
        """The columns of CSV_HEADER."""
        first, second = self.first, self.second
        values = [in_degrees(self.heading), first.median, second.median, self.difference, self.limit, self.change.value]
        return [*values, first.pings, first.heard, second.pings, second.heard]

    @property
    def difference(self) -> float | None:
        """Median of the second scan minus that of the first, m; None unless both have an echo."""
        first, second = self.first.median, self.second.median
        return None if first is None or second is None else second - first

    @property
    def change(self) -> ScanChange:
        """The class of the difference."""
        difference = self.difference
        if difference is not None:
            if abs(difference) <= self.limit:
                return ScanChange.SAME
            return ScanChange.NEARER if difference < 0 else ScanChange.FARTHER
        if self.first.median is not None:
            return ScanChange.FELL_SILENT
        return ScanChange.BOTH_SILENT if self.second.median is None else ScanChange.APPEARED


@dataclass(frozen=True)
class ScanDifference:
    """Two scans by heading, counter-clockwise from 0."""

    rows: tuple[HeadingDifference, ...]
    noises: tuple[float, float]  # m, standard deviation of a ping of each scan
    unpaired: tuple[int, int]  # headings of each scan without one of the other
    names: tuple[str, str] = ("first", "second")

    @property
    def changes(self) -> dict[ScanChange, int]:
        """The number of headings by change."""
        counts = Counter(row.change for row in self.rows)
        return {change: counts[change] for change in ScanChange}

    @property
    def median(self) -> float | None:
        """Median of the differences, m; None without one."""
        return _median_of(self.rows)

    @property
    def stretches(self) -> tuple[tuple[HeadingDifference, ...], ...]:
        """Neighbouring headings with the same change, without those that are the same or silent in both."""
        runs = [list(run) for _, run in groupby(self.rows, lambda row: row.change)]
        if len(runs) > 1 and runs[0][0].change == runs[-1][0].change and self._is_whole_turn:
            runs[0] = runs.pop() + runs[0]
        unchanged = (ScanChange.SAME, ScanChange.BOTH_SILENT)
        return tuple(tuple(run) for run in runs if run[0].change not in unchanged)

    def lines(self) -> list[str]:
        """Return the result as lines of text: what changed, the noise, and each stretch."""
        counts = ", ".join(f"{count} {change.value}" for change, count in self.changes.items() if count)
        lines = [
            f"first: {self.names[0]}; second: {self.names[1]}",
            f"{counted(len(self.rows), 'heading')} in both: {counts}",
        ]
        if self.median is not None:
            first, second = (f"{noise * 1000:.1f}" for noise in self.noises)
            lines.append(
                f"second minus first: {self.median * 1000:+z.1f} mm (median); "
                f"noise of a ping: {first} and {second} mm (standard deviation)"
            )
        for which, lonely in zip(("first", "second"), self.unpaired, strict=True):
            if lonely:
                lines.append(f"{counted(lonely, 'heading')} of the {which} scan not compared: the other has none near")
        return [*lines, *map(_stretch_line, self.stretches)]

    def figures(self) -> dict[str, Any]:
        """Return the result under the keys of `compare --with --json`; headings in degrees."""
        return {
            "headings": len(self.rows),
            "unpaired": list(self.unpaired),
            "median_difference_m": self.median,
            "noise_m": list(self.noises),
            "changes": {change.name.lower(): count for change, count in self.changes.items()},
            "stretches": [
                {
                    "change": run[0].change.name.lower(),
                    "from_deg": in_degrees(run[0].heading),
                    "to_deg": in_degrees(run[-1].heading),
                    "headings": len(run),
                    "median_difference_m": _median_of(run),
                }
                for run in self.stretches
            ],
        }

    @property
    def _is_whole_turn(self) -> bool:
        """Whether the last heading is a neighbour of the first."""
        headings = np.array([row.heading for row in self.rows])
        steps = np.diff(headings)
        return len(steps) > 0 and bool(headings[0] + math.tau - headings[-1] < 1.5 * np.median(steps))


def _median_of(run: Sequence[HeadingDifference]) -> float | None:
    differences = [row.difference for row in run if row.difference is not None]
    return float(np.median(differences)) if differences else None


def _stretch_line(run: Sequence[HeadingDifference]) -> str:
    where = heading_text(run[0].heading)
    if len(run) > 1:
        where += f" to {heading_text(run[-1].heading)}"
    by = _median_of(run)
    amount = "" if by is None else f" by {abs(by) * 100:.1f} cm{' (median)' if len(run) > 1 else ''}"
    medians = {
        name: [side.median for side in sides if side.median is not None]
        for name, sides in (("first", [row.first for row in run]), ("second", [row.second for row in run]))
    }
    scans = ", ".join(f"{name} {_span(ranges)}" for name, ranges in medians.items() if ranges)
    return f"  {where}: {counted(len(run), 'heading')} {run[0].change.value}{amount}: {scans}"


def _span(ranges: list[float]) -> str:
    """Return the smallest and the largest range of a scan, or both as one if they are equal."""
    least, most = f"{min(ranges):.3f}", f"{max(ranges):.3f}"
    return f"{least} m" if least == most else f"{least} to {most} m"


def scan_difference(first: HeadingSeries, second: HeadingSeries) -> ScanDifference:
    """Return the differences of two scans at the headings of the one with fewer headings.

    A heading is paired with the nearest one of the other scan, at most half of its step away. Raises InputError if a
    scan has no reading, or no heading is in both.
    """
    scans = at_headings(first), at_headings(second)
    for scan, number in zip(scans, ("first", "second"), strict=True):
        if not scan:
            raise InputError(f"the {number} scan has no reading; a difference needs readings of both")
    pairs = _pairs(*(np.array([median.heading for median in scan]) for scan in scans))
    if not len(pairs):
        raise InputError("the scans have no heading in common; give scans of the same sector")
    between = _noise_between([(scans[0][a], scans[1][b]) for a, b in pairs])
    noises = tuple(
        max(noise_of(scan, between), series.rounding / math.sqrt(12), LEAST_NOISE)
        for series, scan in zip((first, second), scans, strict=True)
    )
    rounding = max(first.rounding, second.rounding)
    rows = []
    for one, other in ((scans[0][a], scans[1][b]) for a, b in pairs):
        noise = math.hypot(noises[0] * _of_median(one.heard), noises[1] * _of_median(other.heard))
        rows.append(HeadingDifference(one, other, CHANGED * max(noise, LEAST_NOISE) + rounding))
    lonely = tuple(len(scan) - len({pair[k] for pair in pairs}) for k, scan in enumerate(scans))
    rows.sort(key=lambda row: row.heading)
    return ScanDifference(tuple(rows), (noises[0], noises[1]), (lonely[0], lonely[1]))


def at_headings(series: HeadingSeries) -> tuple[AtHeading, ...]:
    """Return the pings of a scan by heading, counter-clockwise from 0."""
    turned = np.remainder(series.headings, math.tau)
    turned[turned > math.tau - _SAME_HEADING] = 0.0
    order = np.argsort(turned, kind="stable")
    starts = np.flatnonzero(np.diff(turned[order], prepend=-math.inf) > _SAME_HEADING)
    return tuple(AtHeading(float(turned[rows[0]]), series.ranges[rows]) for rows in np.split(order, starts)[1:])


def noise_of(scan: Sequence[AtHeading], between: float) -> float:
    """Return the standard deviation of a ping, m.

    Several pings at a heading show it. Else it is the smaller of two estimates, which real changes can only enlarge:
    differences of neighbouring headings, most of which meet the same target, and `between`, differences of the scans.
    """
    repeated = [np.diff(pings.ranges[np.isfinite(pings.ranges)]) for pings in scan]
    steps = np.concatenate(repeated) if repeated else np.empty(0)
    if len(steps) >= _FEWEST:
        return _spread(steps) / math.sqrt(2)
    neighbours = np.diff([math.nan if pings.median is None else pings.median for pings in scan])
    neighbours = neighbours[np.isfinite(neighbours)]
    estimates = [between] + ([_spread(neighbours) / math.sqrt(2)] if len(neighbours) >= _FEWEST else [])
    return min(estimates)


def _noise_between(pairs: Sequence[tuple[AtHeading, AtHeading]]) -> float:
    """Return the standard deviation of a ping from the differences of two scans, m."""
    medians = [(one.median, other.median) for one, other in pairs]
    differences = np.array([b - a for a, b in medians if a is not None and b is not None])
    return _spread(differences - np.median(differences)) / math.sqrt(2) if len(differences) >= _FEWEST else _NO_ESTIMATE


def _spread(values: FloatArray) -> float:
    """Return the standard deviation of values about 0, from their median absolute value."""
    return _TO_DEVIATION * float(np.median(np.abs(values)))


def _of_median(pings: int) -> float:
    """Return the standard deviation of the median of pings by that of one."""
    return math.sqrt((math.pi / 2 if pings > 2 else 1.0) / max(pings, 1))


def _pairs(first: FloatArray, second: FloatArray) -> list[tuple[int, int]]:
    """Return pairs of nearest headings (rows of both), at most half a step of the finer scan apart."""
    swapped = len(first) > len(second)
    few, many = (second, first) if swapped else (first, second)
    turns = np.abs(angle_difference(few[:, None], many))
    nearest = turns.argmin(axis=1)
    near = np.flatnonzero(turns[np.arange(len(few)), nearest] <= _step(many) / 2 + _SAME_HEADING)
    pairs = list(zip(near.tolist(), nearest[near].tolist(), strict=True))
    return [(b, a) for a, b in pairs] if swapped else pairs


def _step(headings: FloatArray) -> float:
    """Return the usual step between headings, rad; 0 with one heading."""
    steps: NDArray[np.float64] = np.diff(headings)
    return float(np.median(steps)) if len(steps) else 0.0


def heading_series(readings: Sequence[Reading], board: Board, heading: float) -> HeadingSeries:
    """Return the first echoes of readings from a place with this `heading` (rad; 0 gives turntable angles)."""
    zero = board.heading_at(0.0, heading)
    return HeadingSeries(
        np.array([zero + board.turned(reading.angle) for reading in readings], dtype=np.float64),
        np.array([math.nan if reading.range is None else reading.range for reading in readings], dtype=np.float64),
        board.rounding,
    )
