"""The gain: what a receiver gives back of what the way takes from an echo.

Takes lengths or times; hands on decibels. The ideal gain undoes `way_loss_db` exactly, so that amplitudes need not
carry it; the 6500's rises in steps that only follow it.
"""

from functools import lru_cache

import numpy as np

from sim.air import Air, absorption
from sim.board import Board
from sonarhw.readings import FloatArray

_INSTANTS = 1000  # at which the two gains are held beside each other


def way_loss_db(lengths: FloatArray, board: Board) -> FloatArray:
    """What spreading and the air that the ideal gain expects take on `lengths` (m, over 0) relative to 1 m, dB.

    20 lg of the length (CIM-92-9 §4: the gain cancels it), and ISO 9613-1 at 20 °C and 50 % unless the board has no
    absorption.
    """
    per_metre = absorption(board.frequency, Air()) if board.absorption else 0.0
    return np.asarray(20 * np.log10(lengths) + per_metre * lengths)


def stepped_gain_db(times: FloatArray, board: Board) -> FloatArray:
    """The 6500's gain at `times` (s by the board's clock): so many steps of so many dB, same shape.

    How loud the first is no data sheet says: it lies where, between first and last step, the gain is neither louder
    nor fainter than the ideal one on average over time.
    """
    steps = np.searchsorted(np.array(board.gain_steps), times, side="right")
    return np.asarray(_first_gain_db(board) + board.gain_step_db * steps)


@lru_cache(maxsize=16)
def _first_gain_db(board: Board) -> float:
    begin, end = board.gain_steps[0], board.gain_steps[-1]
    times = begin + (end - begin) * (np.arange(_INSTANTS) + 0.5) / _INSTANTS
    steps = np.searchsorted(np.array(board.gain_steps), times, side="right")
    ideal = way_loss_db(times * Air().speed_of_sound, board)
    return float((ideal - board.gain_step_db * steps).mean())
