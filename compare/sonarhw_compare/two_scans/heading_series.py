"""The readings of a scan as ranges over headings, for a comparison by heading."""

import math
from collections.abc import Sequence

import numpy as np
from sonarhw_sim.board.profile import Board

from sonarhw.readings import Reading
from sonarhw_compare.two_scans.scan_difference import HeadingSeries


def heading_series(readings: Sequence[Reading], board: Board, heading: float) -> HeadingSeries:
    """Return the first echoes of readings from a place with this `heading` (rad; 0 gives turntable angles)."""
    zero = board.heading_at(0.0, heading)
    return HeadingSeries(
        np.array([zero + board.turned(reading.angle) for reading in readings], dtype=np.float64),
        np.array([math.nan if reading.range is None else reading.range for reading in readings], dtype=np.float64),
        board.rounding,
    )
