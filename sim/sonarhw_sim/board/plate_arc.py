"""The arc over which a board detects a flat plate."""

import math

import numpy as np

from sonarhw_sim.air import Air
from sonarhw_sim.board.gain import uncompensated_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.transducer import beam_gain

_ANGLES = np.linspace(0.0, math.pi / 2, 9001)  # rad from the axis, 0.01° apart


def plate_arc(board: Board, air: Air, distance: float, stronger_db: float = 0.0) -> float:
    """Return the width (rad) of the arc over which the main lobe detects a large plate at `distance` m; 0 for none.

    `stronger_db` is the level of the echo above that of a perfect plate.
    """
    level = stronger_db - float(uncompensated_db(np.array([2 * distance]), board, air)[0])
    levels = level + 40 * np.log10(np.maximum(beam_gain(_ANGLES, board.wavenumber(air) * board.aperture_radius), 1e-9))
    missed = np.flatnonzero(levels < board.threshold_db)
    return 2 * float(_ANGLES[missed[0]]) if len(missed) else math.pi
