"""How far it is worth looking at first: some way beyond the farthest first echo, not to the end of what was recorded.

Takes what is shown; hands on a range.
"""

import numpy as np

from sonarhw_gui.shown.shown import Shown

_BEYOND = 1.5  # times the farthest first echo


def initial_range(shown: Shown) -> float | None:
    """The range up to which to show traces at first, m; None where no echo is known yet."""
    measured = [reading.range for reading in shown.readings if reading.range is not None]
    predicted = [] if shown.outline is None else shown.outline.ranges[~np.isnan(shown.outline.ranges)].tolist()
    return _BEYOND * max((*measured, *predicted), default=0.0) or None
