"""What the board's own receiver does to a lone echo: finds it late, the fainter the later, after a gain in steps.

Takes a board; hands on a table of how late and how much louder than with the ideal gain. `board.receiver` is the model;
here it is asked about one echo at a time, so that a fit need not listen to whole pings.
"""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from sonarhw_sim.board.burst import RATE, burst_of
from sonarhw_sim.board.gain import path_loss_db, stepped_gain_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import echo_times

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import LATENESS_STEP

_MOST_OVER = 40.0  # dB over the threshold, from where an echo is found as soon as it may be


@lru_cache(maxsize=16)
def lateness_by_level(board: Board, speed_of_sound: float) -> FloatArray:
    """By how much an echo is found late, in range, at 0, 0.5, 1, ... dB over the threshold, (l,) m."""
    burst = burst_of(board, speed_of_sound)
    lone = np.abs(burst.samples)
    listening = replace(board, blanking=0.0, blanking_inhibit=None, max_range=speed_of_sound * len(lone) / RATE)
    levels = np.arange(0.0, _MOST_OVER + LATENESS_STEP, LATENESS_STEP)
    # a hair over, so that an echo at the threshold is found
    times = [
        _found(lone * 10 ** ((board.threshold_db + over + 1e-6) / 20), listening, speed_of_sound) for over in levels
    ]
    return np.asarray((np.array(times) - burst.lead / RATE) * speed_of_sound / 2)


def _found(samples: FloatArray, board: Board, speed_of_sound: float) -> float:
    times = echo_times(samples.astype(np.complex128), board, speed_of_sound)
    return float(times[0]) if len(times) else math.nan


def level_offset_db(lengths: FloatArray, board: Board, speed_of_sound: float) -> FloatArray:
    """What the board's gain gives paths of those lengths (m) beyond the ideal one, dB, same shape."""
    if not board.gain_steps:
        return np.zeros(len(lengths))
    return stepped_gain_db(lengths / speed_of_sound, board) - path_loss_db(np.maximum(lengths, 1e-3), board)
