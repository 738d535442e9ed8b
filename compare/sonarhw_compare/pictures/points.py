"""Where readings lie in the plan, for every picture and every window; loads nothing that draws.

Takes headings and ranges; hands on points.
"""

import numpy as np

from sonarhw.readings import FloatArray


def points_at(stands: FloatArray | tuple[float, float], headings: FloatArray, ranges: FloatArray) -> FloatArray:
    """Where readings taken from `stands`, (n, 2) m or one for all, lie in the plan, (n, 2) m; NaN as the range is."""
    return np.asarray(np.asarray(stands) + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings))))
