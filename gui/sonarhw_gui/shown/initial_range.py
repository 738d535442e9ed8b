"""The range that traces show initially: beyond the farthest first echo, but not the whole recording."""

import numpy as np

from sonarhw_gui.shown.shown import Shown

_BEYOND = 1.5  # times the farthest first echo


def initial_range(shown: Shown) -> float | None:
    """Return the range up to which traces are shown initially, m; None while no echo is known."""
    measured = [reading.range for reading in shown.readings if reading.range is not None]
    predicted = [] if shown.outline is None else shown.outline.ranges[~np.isnan(shown.outline.ranges)].tolist()
    return _BEYOND * max((*measured, *predicted), default=0.0) or None
