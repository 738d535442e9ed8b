"""Amplitudes of paths for a board, relative to a perfect wall straight ahead, and which paths to keep.

The beam itself is in `sonarhw_sim.board.weighing`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.gain import uncompensated_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.weighing import BoolArray, amplitudes_at, beam_table, loudest_by_separation
from sonarhw_sim.choices import Receiver
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Room

# dB. Paths farther below the threshold are dropped. Several that arrive together change a sum close to the threshold:
# with 24 dB, those dropped change 4 of 100 000 readings of the paper's receiver in random rooms, with 36 dB none
# (`python -m benchmarks.brute_force`). Whole signals with so many paths would take twice as long.
KEPT_BELOW_THRESHOLD = {Receiver.FIRST_ECHO: 36.0, Receiver.BOARD: 24.0}


def path_amplitudes(
    room: Room,
    board: Board,
    heading: float,
    paths: Paths,
    without_beam: FloatArray,
    sender_headings: FloatArray | None = None,
) -> FloatArray:
    """Return the signed amplitude of every path at a heading (rad), (p,) float; 1 is a perfect wall straight ahead.

    It includes reflectances, edges and curvature, the beam at departure and arrival, and absorption beyond the ideal
    gain, but no other path. `without_beam` (p,) are the `strengths` of the paths, which are the same at every heading.
    `sender_headings` (p,) rad are the headings of the senders; None: that of the receiver.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    # as if the sender had pointed along `heading`
    leaving = paths.leaving if sender_headings is None else turned(paths.leaving, heading - sender_headings)
    return np.asarray(amplitudes_at(heading, leaving, paths.arriving, without_beam, ka, beam_table(ka)))


def turned(vectors: FloatArray, angles: FloatArray) -> FloatArray:
    """Return vectors (p, 2) turned counter-clockwise by `angles` (p,) rad, same shape."""
    (x, y), cosines, sines = vectors.T, np.cos(angles), np.sin(angles)
    return np.column_stack((x * cosines - y * sines, x * sines + y * cosines))


def is_blanked(lengths: FloatArray, board: Board, room: Room) -> BoolArray:
    """Return which paths of these lengths (m) arrive within blanking, same shape."""
    return np.asarray(lengths / 2 < board.blanked_range(room.air))


def strengths(room: Room, board: Board, paths: Paths) -> FloatArray:
    """Return the amplitude of every path without the beam, (p,) float."""
    return np.asarray(paths.gains * 10 ** (-uncompensated_db(paths.lengths, board, room.air) / 20))


def faintest_kept(board: Board, below: float) -> float:
    """Return the amplitude `below` dB below the threshold."""
    return float(10 ** ((board.threshold_db - below) / 20))


def loud_enough(room: Room, board: Board, paths: Paths, below: float) -> NDArray[np.intp]:
    """Return the rows of the paths that are at most `below` dB below the threshold at their best heading, (k,) int.

    Patches of rough surfaces are always among them, because many faint ones are loud together.
    """
    loudest = loudest_by_separation(board.wavenumber(room.air) * board.aperture_radius)
    cosines = np.cos(paths.departures - paths.arrivals) * np.cos(paths.elevations).prod(axis=1)
    # the next smaller separation, so that the bound is never too low
    rows = (np.arccos(cosines) / math.pi * (len(loudest) - 1)).astype(np.intp)
    loud = strengths(room, board, paths) * loudest[rows] >= faintest_kept(board, below)
    return np.flatnonzero(loud | paths.scattered)
