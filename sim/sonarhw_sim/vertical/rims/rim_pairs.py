"""Pairs of a way to a rim and a way back from it that join at a point of the rim. Compiled by numba."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays import path_table
from sonarhw_sim.rays.diffraction import most_of_edge
from sonarhw_sim.room.grid import IntArray

_FEWEST_POINTS = 3  # of a path


class Halves(NamedTuple):
    """Ways from a place to rims, in order of rim and of distance; one row each.

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

    def by_parts(self) -> tuple["Halves", NDArray[np.intp]]:
        """Return the same in order of rim and of the begin of the part, and the row here of each."""
        order = np.lexsort((self.lows, self.rims))
        return Halves._make(column[order] for column in self), order


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
    # two parts that do not overlap have no point in common
    same = back is out
    out, rows_out = out.by_parts()
    back, rows_back = (out, rows_out) if same else back.by_parts()
    starts = np.searchsorted(back.rims, out.rims)
    most = path_table.MOST_POINTS // _FEWEST_POINTS
    count = path_table.ROOM_FOR_PAIRS
    while True:
        rows, at = np.empty((count, 2), np.intp), np.empty(count)
        count = _pair(out, back, same, starts, wedges, limits, strength, most, rows, at)
        path_table.check_size(count, _FEWEST_POINTS)
        if count <= len(rows):
            first, second = rows_out[rows[:count, 0]], rows_back[rows[:count, 1]]
            order = np.lexsort((second, first))
            return first[order], second[order], at[order]


@compiled
def _pair(
    out: Halves,
    back: Halves,
    same: bool,
    starts: NDArray[np.intp],
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
    most: int,
    rows: NDArray[np.intp],
    at: FloatArray,
) -> int:
    """Return how many pairs there are, more than `most` not all counted; fill in the first `rows` (m, 2) and `at`.

    With `same`, `back` is `out`, and each pair is tested once for both of its orders.
    """
    wavelength, max_length, faintest, max_bounces = limits
    found, heard = 0, back.gains * back.beams
    for i in range(out.rims.shape[0]):
        rim, loud = out.rims[i], out.gains[i] * out.beams[i]
        low, high, start, near = out.lows[i], out.highs[i], out.axial[i], out.radial[i]
        for j in range(i if same else starts[i], back.rims.shape[0]):
            # parts that begin behind this one do not overlap it
            if back.rims[j] != rim or back.lows[j] >= high:
                break
            radial = near + back.radial[j]
            if back.highs[j] <= low or radial > max_length or loud * heard[j] < faintest:
                continue
            axial = back.axial[j] - start
            point = start + axial * near / max(radial, 1e-300)
            if not max(low, back.lows[j]) <= point < min(high, back.highs[j]):
                continue
            if out.bounces[i] + back.bounces[j] > max_bounces:
                continue
            most_heard, length = loud * heard[j], math.hypot(axial, radial)
            if length > max_length:
                continue
            # Keller's cone: seen along the rim, the wave is longer
            longer = wavelength * length / max(radial, 1e-300)
            edge = most_of_edge(
                out.angles[i], back.angles[j], wedges[rim], out.radial[i], back.radial[j], longer, strength
            )
            if most_heard * edge < faintest:
                continue
            if found < rows.shape[0]:
                rows[found, 0], rows[found, 1], at[found] = i, j, point
            found += 1
            if same and j > i:
                if found < rows.shape[0]:
                    rows[found, 0], rows[found, 1] = j, i
                    at[found] = back.axial[j] - axial * back.radial[j] / max(radial, 1e-300)
                found += 1
        if found > most:
            break
    return found
