"""Points of readings in the plan, for pictures and the window."""

import numpy as np

from sonarhw.readings import FloatArray


def points_at(sensors: FloatArray | tuple[float, float], headings: FloatArray, ranges: FloatArray) -> FloatArray:
    """Return the points of readings, (n, 2) m, from `sensors`, (n, 2) m or one for all; NaN where the range is NaN."""
    return np.asarray(np.asarray(sensors) + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings))))
