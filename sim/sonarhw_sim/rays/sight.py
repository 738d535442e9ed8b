"""Distances to the first surface along many lines."""

import math

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.kernel import first_hit
from sonarhw_sim.room.grid import Surfaces


@compiled
def distances_ahead(points: FloatArray, headings: FloatArray, surfaces: Surfaces) -> FloatArray:
    """Return the distance from `points` (n, 2) along `headings` (n,) rad to the first surface, or inf, (n,) m."""
    distances = np.empty(headings.shape[0])
    for k in range(headings.shape[0]):
        x, y = math.cos(headings[k]), math.sin(headings[k])
        distances[k] = first_hit(points[k, 0], points[k, 1], x, y, -1, surfaces)[0]
    return distances
