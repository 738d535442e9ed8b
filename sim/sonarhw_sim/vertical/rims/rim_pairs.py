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
    starts = np.searchsorted(back.rims, out.rims)
    most = path_table.MOST_POINTS // _FEWEST_POINTS
    count = path_table.ROOM_FOR_PAIRS
    while True:
        rows, at = np.empty((count, 2), np.intp), np.empty(count)
        count = _pair(out, back, starts, wedges, limits, strength, most, rows, at)
        path_table.check_size(count, _FEWEST_POINTS)
        if count <= len(rows):
            return rows[:count, 0], rows[:count, 1], at[:count]


@compiled
def _pair(
    out: Halves,
    back: Halves,
    starts: NDArray[np.intp],
    wedges: FloatArray,
    limits: tuple[float, float, float, int],
    strength: int,
    most: int,
    rows: NDArray[np.intp],
    at: FloatArray,
) -> int:
    """Return how many pairs there are, more than `most` not all counted; fill in the first `rows` (m, 2) and `at`."""
    wavelength, max_length, faintest, max_bounces = limits
    found = 0
    for i in range(out.rims.shape[0]):
        rim = out.rims[i]
        for j in range(starts[i], back.rims.shape[0]):
            radial = out.radial[i] + back.radial[j]
            if back.rims[j] != rim or radial > max_length:
                break
            axial = back.axial[j] - out.axial[i]
            point = out.axial[i] + axial * out.radial[i] / max(radial, 1e-300)
            if not max(out.lows[i], back.lows[j]) <= point < min(out.highs[i], back.highs[j]):
                continue
            if out.bounces[i] + back.bounces[j] > max_bounces:
                continue
            most_heard = out.gains[i] * back.gains[j] * out.beams[i] * back.beams[j]
            length = math.hypot(axial, radial)
            if most_heard < faintest or length > max_length:
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
        if found > most:
            break
    return found
