"""Pairs of a way to a rim and a way back from it that join at a point of the rim. Compiled by numba."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.diffraction import most_of_edge
from sonarhw_sim.room.grid import IntArray

_FEWEST_POINTS = 3  # of a path


class Halves(NamedTuple):
    """Ways from a place to rims, in order of rim, of reflections and of the begin of the part; one row each.

    The place, mirrored in all that the way touches, is a point in space, here in coordinates about the rim.
    """

    rims: IntArray  # (h,)
    axial: FloatArray  # (h,), m along the rim
    lows: FloatArray  # (h,), m along the rim: where the part begins to which the way leads
    highs: FloatArray  # (h,), m
    radial: FloatArray  # (h,), m from the line of the rim
    angles: FloatArray  # (h,), rad from the first face of the wedge
    gains: FloatArray  # (h,): reflectances
    beams: FloatArray  # (h,): the most that the beam leaves at any heading
    bounces: IntArray  # (h,)
    approaches: IntArray  # (h,): row
    sequences: IntArray  # (h,): row


def pairs_of(
    out: Halves,
    back: Halves,
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]:
    """Return the rows of `out` and `back` (m,) that may form a path, and where on their rim it bends, (m,) m.

    `wedges` (r,) are the openings of the rims over π; `limits` are the wavelength, the longest
    path, the faintest amplitude and the most reflections. Raises InputError if these are too many for the memory.
    """
    # most halves have many reflections, and few fit to those
    kinds = np.arange(len(wedges) * (limits[3] + 1) + 1)
    starts = np.searchsorted(back.rims * (limits[3] + 1) + back.bounces, kinds)
    widest = float((back.highs - back.lows).max(initial=0.0))
    most = path_table.MOST_POINTS // _FEWEST_POINTS
    count = path_table.ROOM_FOR_PAIRS
    while True:
        rows, at = np.empty((count, 2), np.intp), np.empty(count)
        count = _pair(out, back, back is out, starts, widest, wedges, limits, strength, most, rows, at)
        path_table.check_size(count, _FEWEST_POINTS)
        if count <= len(rows):
            first, second = rows[:count].T
            # nearest first
            ends = (back, second), (out, first)
            keys = [key[rows] for half, rows in ends for key in (half.sequences, half.approaches, half.radial)]
            order = np.lexsort((*keys, out.rims[first]))
            return first[order], second[order], at[order]


@compiled
def _pair(
    out: Halves,
    back: Halves,
    same: bool,
    starts: NDArray[np.intp],
    widest: float,
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
    most: int,
    rows: NDArray[np.intp],
    at: FloatArray,
) -> int:
    """Return how many pairs there are, more than `most` not all counted; fill in the first `rows` (m, 2) and `at`.

    `starts` are the first rows of `back` for each rim and number of reflections, `widest` (m) is its longest part. With
    `same`, `back` is `out`, and each pair is tested once for both of its orders.
    """
    max_bounces, found, heard = limits[3], 0, back.gains * back.beams
    for i in range(out.rims.shape[0]):
        kind = out.rims[i] * (max_bounces + 1)
        for bounces in range(out.bounces[i] if same else 0, max_bounces - out.bounces[i] + 1):
            first, last = starts[kind + bounces], starts[kind + bounces + 1]
            if same and bounces == out.bounces[i]:
                first = i
            # two parts that do not overlap have no point in common
            for j in range(_first_from(back.lows, first, last, out.lows[i] - widest), last):
                if back.lows[j] >= out.highs[i]:
                    break
                if back.highs[j] <= out.lows[i] or out.gains[i] * out.beams[i] * heard[j] < limits[2]:
                    continue
                point = _joined_at(out, back, i, j, wedges, limits, strength)
                if math.isnan(point):
                    continue
                if found < rows.shape[0]:
                    rows[found, 0], rows[found, 1], at[found] = i, j, point
                found += 1
                if same and j > i:
                    if found < rows.shape[0]:
                        rows[found, 0], rows[found, 1], at[found] = j, i, _bend(back, out, j, i)
                    found += 1
        if found > most:
            break
    return found


@compiled_part
def _first_from(lows: FloatArray, first: int, last: int, low: float) -> int:
    """Return the first row from `first` on, `last` if there is none, that begins at `low` or behind."""
    while first < last:
        middle = (first + last) // 2
        if lows[middle] < low:
            first = middle + 1
        else:
            last = middle
    return first


@inlined
def _bend(out: Halves, back: Halves, i: int, j: int) -> float:
    """Return where on the rim two halves join, m."""
    both = max(out.radial[i] + back.radial[j], 1e-300)
    point: float = out.axial[i] + (back.axial[j] - out.axial[i]) * out.radial[i] / both
    return point


@compiled_part
def _joined_at(
    out: Halves,
    back: Halves,
    i: int,
    j: int,
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
) -> float:
    """Return where on their rim two halves join, m; NaN if they do not, or if the path is too long or too faint."""
    wavelength, max_length, faintest, _ = limits
    radial, axial = out.radial[i] + back.radial[j], back.axial[j] - out.axial[i]
    point = _bend(out, back, i, j)
    if radial > max_length or not max(out.lows[i], back.lows[j]) <= point < min(out.highs[i], back.highs[j]):
        return np.nan
    length = math.hypot(axial, radial)
    if length > max_length:
        return np.nan
    # Keller's cone: seen along the rim, the wave is longer
    longer = wavelength * length / max(radial, 1e-300)
    near, far, opening = out.radial[i], back.radial[j], wedges[out.rims[i]]
    edge = most_of_edge(out.angles[i], back.angles[j], opening, near, far, longer, strength)
    heard = out.gains[i] * out.beams[i] * back.gains[j] * back.beams[j]
    return point if heard * edge >= faintest else np.nan
