"""Levels: how loud the paths of a place are to a board.

Takes a room, a board and its `Paths`; hands on amplitudes relative to a perfect wall straight ahead, at a heading or
before the beam, which paths are worth keeping, and which come while the board cannot hear. The beam itself is in
`sonarhw_sim.board.weighing`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.gain import uncompensated_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.weighing import BoolArray, all_meeting_face, amplitudes_at, beam_table, loudest_by_separation
from sonarhw_sim.choices import Unit
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Place, Room

# Fainter than this under the threshold, a path is not noticed: of those a room has, nine in ten never are. dB
_KEPT_BELOW_THRESHOLD = 20.0


def path_amplitudes(
    room: Room, place: Place, board: Board, heading: float, paths: Paths, unit: Unit = Unit.PASS
) -> FloatArray:
    """Amplitude of every path at a heading (rad) relative to a perfect wall straight ahead, (p,) float.

    Reflectances, edges and curvature, the beam on departure and arrival, and what air takes beyond the ideal gain.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    before_beam = strengths(room, board, paths)
    amplitudes = amplitudes_at(heading, paths.leaving, paths.arriving, before_beam, ka, beam_table(ka))
    if unit is Unit.BLOCK:
        amplitudes[all_meeting_face(paths.points - np.array(place.position), heading, board.aperture_radius)] = 0.0
    return np.asarray(amplitudes)


def leg_amplitudes(
    room: Room, board: Board, heading: float, paths: Paths, sender_headings: FloatArray | None = None
) -> FloatArray:
    """Amplitude of every path as `path_amplitudes` has it, (p,) float, heard at a heading (rad) by one transducer.

    `sender_headings` (p,) rad is where the one that sent each points; None: where the listener does.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    # as if the sender had pointed along `heading`
    leaving = paths.leaving if sender_headings is None else turned(paths.leaving, heading - sender_headings)
    return np.asarray(
        amplitudes_at(heading, leaving, paths.arriving, strengths(room, board, paths), ka, beam_table(ka))
    )


def turned(vectors: FloatArray, angles: FloatArray) -> FloatArray:
    """Vectors (p, 2) turned counter-clockwise by `angles` (p,) rad, same shape."""
    (x, y), cosines, sines = vectors.T, np.cos(angles), np.sin(angles)
    return np.column_stack((x * cosines - y * sines, x * sines + y * cosines))


def is_blanked(lengths: FloatArray, board: Board, room: Room) -> BoolArray:
    """Which paths of those lengths (m) arrive while the board cannot hear, same shape."""
    return np.asarray(lengths / 2 < board.blanked_range(room.air))


def strengths(room: Room, board: Board, paths: Paths) -> FloatArray:
    """Amplitude of every path before the beam, (p,) float."""
    return np.asarray(paths.gains * 10 ** (-uncompensated_db(paths.lengths, board, room.air) / 20))


def faintest_kept(board: Board) -> float:
    """Amplitude under which a path is not noticed."""
    return float(10 ** ((board.threshold_db - _KEPT_BELOW_THRESHOLD) / 20))


def loud_enough(room: Room, board: Board, paths: Paths) -> NDArray[np.intp]:
    """Rows of the paths that at their best heading come within 20 dB of the threshold, (k,) int."""
    loudest = loudest_by_separation(board.wavenumber(room.air) * board.aperture_radius)
    together = np.clip((paths.leaving * paths.arriving).sum(axis=1), -1, 1)
    # the next smaller separation: never too strict
    apart = (np.arccos(together) / math.pi * (len(loudest) - 1)).astype(np.intp)
    return np.flatnonzero(strengths(room, board, paths) * loudest[apart] >= faintest_kept(board))
