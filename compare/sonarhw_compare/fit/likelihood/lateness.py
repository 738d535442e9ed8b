"""Late detection and gain of single echoes in the model of the board's own receiver (`board.receiver`).

A faint echo is detected later than a loud one. Tables for single echoes save a fit from simulating whole pings.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import echo_times
from sonarhw_sim.board.signal import RATE, burst_of, path_loss_db, stepped_gain_db

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import LATENESS_STEP

_MOST_OVER = 40.0  # dB over the threshold; louder echoes are not detected earlier


@lru_cache(maxsize=16)
def lateness_by_level(board: Board, speed_of_sound: float) -> FloatArray:
    """Return the error in range of late detection at 0, 0.5, 1, ... dB over the threshold, (l,) m."""
    burst = burst_of(board, speed_of_sound)
    lone = np.abs(burst.samples)
    listening = replace(board, blanking=0.0, blanking_inhibit=None, max_range=speed_of_sound * len(lone) / RATE)
    levels = np.arange(0.0, _MOST_OVER + LATENESS_STEP, LATENESS_STEP)
    # slightly over, so that an echo at the threshold is detected
    times = [
        _found(lone * 10 ** ((board.threshold_db + over + 1e-6) / 20), listening, speed_of_sound) for over in levels
    ]
    return np.asarray((np.array(times) - burst.lead / RATE) * speed_of_sound / 2)


def _found(samples: FloatArray, board: Board, speed_of_sound: float) -> float:
    times = echo_times(samples.astype(np.complex128), board, speed_of_sound)
    return float(times[0]) if len(times) else math.nan


def level_offset_db(lengths: FloatArray, board: Board, speed_of_sound: float) -> FloatArray:
    """Return the gain of the board relative to the ideal gain for paths of these lengths (m), dB, same shape."""
    if not board.gain_steps:
        return np.zeros(len(lengths))
    return stepped_gain_db(lengths / speed_of_sound, board) - path_loss_db(np.maximum(lengths, 1e-3), board)
