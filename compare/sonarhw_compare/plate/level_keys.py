"""Keys of a profile that the levels of a plate's echo determine."""

import math
from collections.abc import Mapping
from enum import StrEnum

from sonarhw_sim.board.profile import Board


class LevelKey(StrEnum):
    """Keys of a profile that levels determine."""

    APERTURE = "aperture_radius"
    GAIN_STEP = "gain_step_db"
    THRESHOLD = "threshold_db"


def changed_board(board: Board, changes: Mapping[LevelKey, float]) -> Board:
    """Return the board with these changes. That of the aperture is the logarithm of a ratio."""
    values = {}
    for key, change in changes.items():
        before = float(getattr(board, key))
        values[str(key)] = before * math.exp(change) if key is LevelKey.APERTURE else before + change
    return board.with_numbers(values)
