"""Gain of the receiver, and transmission loss of a path, in dB.

The ideal gain compensates `path_loss_db` exactly, so amplitudes do not include it. The gain of the 6500 rises in steps
that approximate it. A fixed gain compensates nothing, so far echoes are faint.
"""

from functools import lru_cache

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.air import Air, absorption
from sonarhw_sim.board.profile import Board

_INSTANTS = 1000  # at which the two gains are compared
NEAREST = 0.01  # m: only echoes to a place on a wall have a shorter path


def path_loss_db(lengths: FloatArray, board: Board) -> FloatArray:
    """Return the loss over `lengths` (m, over 0) relative to 1 m, in the air that the ideal gain expects, dB.

    20 lg of the length (CIM-92-9 §4: the gain cancels it), and ISO 9613-1 at 20 °C and 50 % unless the board has no
    absorption.
    """
    per_metre = absorption(board.frequency, Air()) if board.absorption else 0.0
    return np.asarray(20 * np.log10(lengths) + per_metre * lengths)


def uncompensated_db(lengths: FloatArray, board: Board, air: Air) -> FloatArray:
    """Return the loss over `lengths` (m) that the gain does not compensate, dB, same shape.

    With the ideal gain, this is the absorption beyond the one that it expects. A fixed gain compensates nothing. The
    loss is then spreading and all absorption, relative to a path of 1 m, so a perfect wall 0.5 m straight ahead has 0
    dB.
    """
    excess = board.excess_absorption(air) * lengths
    if not board.fixed_gain:
        return np.asarray(excess)
    return np.asarray(path_loss_db(np.maximum(lengths, NEAREST), board) - _loss_at_1_m_db(board) + excess)


def largest_gain(board: Board, air: Air, max_length: float) -> float:
    """Return the largest amplification of an echo with a path of at most `max_length` (m), amplitude, 1 or more."""
    ends = np.array([2 * board.blanked_range(air), max_length])
    return max(1.0, float(10 ** (-uncompensated_db(ends, board, air).min() / 20)))


def _loss_at_1_m_db(board: Board) -> float:
    return float(path_loss_db(np.ones(1), board)[0])


def stepped_gain_db(times: FloatArray, board: Board) -> FloatArray:
    """Return the gain of the 6500 at `times` (s by the board's clock), dB, same shape.

    A resistor sets the level of the first step (TL852 data sheet, Texas Instruments SLSS003), so it differs between
    boards. It is chosen so that the mean difference to the ideal gain between the first and the last step is zero.
    """
    steps = np.searchsorted(np.array(board.gain_steps), times, side="right")
    return np.asarray(_first_gain_db(board) + board.gain_step_db * steps)


@lru_cache(maxsize=16)
def _first_gain_db(board: Board) -> float:
    begin, end = board.gain_steps[0], board.gain_steps[-1]
    times = begin + (end - begin) * (np.arange(_INSTANTS) + 0.5) / _INSTANTS
    steps = np.searchsorted(np.array(board.gain_steps), times, side="right")
    ideal = path_loss_db(times * Air().speed_of_sound, board)
    return float((ideal - board.gain_step_db * steps).mean())
