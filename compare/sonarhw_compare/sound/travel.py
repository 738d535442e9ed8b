"""Where sound is on a path at a given time: pure functions on points and lengths.

A path is (k, 2) float, m: source, reflections, receiver. `travelled` is a length along it, m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray

_ARC_POINTS = 25


def position_at(points: FloatArray, travelled: float) -> FloatArray:
    """Return the point of a path after a length, (2,) float, m; before its begin and after its end, that end."""
    reached = _reached(points)
    return np.array([np.interp(travelled, reached, points[:, axis]) for axis in (0, 1)])


def stretch_between(points: FloatArray, begin: float, end: float) -> FloatArray:
    """Return the part of a path between two lengths with its corners, (m, 2) float, m; empty if there is none."""
    reached = _reached(points)
    begin, end = max(begin, 0.0), min(end, float(reached[-1]))
    if begin >= end:
        return np.empty((0, 2))
    corners = points[(reached > begin) & (reached < end)]
    return np.vstack((position_at(points, begin), corners, position_at(points, end)))


def front_at(points: FloatArray, travelled: float, half_angle: float, bend: int | None = None) -> FloatArray:
    """Return the wavefront about a path after a length, (m, 2) float, m: an arc, empty before begin and after end.

    Its centre is the image of the source in the walls so far, or from the corner `bend` on, which is a diffracting
    edge, that of the edge. `half_angle`, rad, is that of the part shown; curved surfaces are treated as flat.
    """
    reached = _reached(points)
    if not 0 < travelled <= reached[-1]:
        return np.empty((0, 2))
    leg = min(int(np.searchsorted(reached, travelled)), len(points) - 1)  # the leg that ends at this corner
    start, stop = points[leg - 1], points[leg]
    direction = math.atan2(stop[1] - start[1], stop[0] - start[0])
    radius = travelled - (float(reached[bend]) if bend is not None and leg > bend else 0.0)
    head = position_at(points, travelled)
    centre = head - radius * np.array([math.cos(direction), math.sin(direction)])
    angles = direction + np.linspace(-half_angle, half_angle, _ARC_POINTS)
    return np.asarray(centre + radius * np.column_stack((np.cos(angles), np.sin(angles))))


def _reached(points: FloatArray) -> NDArray[np.float64]:
    """Return the length from the begin of a path to each of its points, (k,) float, m."""
    legs = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate(([0.0], np.cumsum(legs)))
