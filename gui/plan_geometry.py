"""Lines of the plan, as arrays: walls, the outline with its gaps, the beam.

Takes rooms, predictions and directions; hands on (n, 2) points in metres, NaN where a line is broken.
"""

import math

import numpy as np
from numpy.typing import NDArray

from compare.picture import points_at
from sim.board import Board
from sim.predicted_scan import PredictedScan
from sim.room import Place, Room
from sim.transducer import beam_gain
from sonarhw.readings import FloatArray

_JUMP = 0.1  # m between neighbouring headings: another path wins, and a line between them would be a wall nobody has
_BEAM_POINTS = 17
_SAME_BOUNCE = 0.005  # m


def wall_lines(room: Room) -> FloatArray:
    """Both ends of every wall one after another, (2n, 2): to be connected in pairs."""
    return room.walls.reshape(-1, 2)


def outline_ranges(outline: PredictedScan) -> FloatArray:
    """The outline's ranges, NaN also between runs: (n, 2) heading rad and range m."""
    both = np.column_stack((outline.headings, outline.ranges))
    return np.insert(both, _breaks(outline), np.nan, axis=0)


def outline_points(outline: PredictedScan) -> FloatArray:
    """The outline in the plan, broken at silent headings and where another path takes over."""
    points = points_at(outline.standpoints, outline.headings, outline.ranges)
    return np.insert(points, _breaks(outline), np.nan, axis=0)


def _breaks(outline: PredictedScan) -> NDArray[np.intp]:
    return np.flatnonzero(np.abs(np.diff(outline.ranges)) > _JUMP) + 1


def half_power_angle(board: Board, room: Room) -> float:
    """How far off its axis the transducer sends half the power, rad."""
    angles = np.linspace(0, math.pi / 2, 3601)
    gains = beam_gain(angles, board.wavenumber(room.air) * board.aperture_radius)
    return float(angles[np.argmax(gains < math.sqrt(0.5))])


def beam_wedge(place: Place, heading: float, half_angle: float, length: float) -> FloatArray:
    """The corners of the beam in the plan, from the place round and back to it."""
    headings = np.linspace(heading - half_angle, heading + half_angle, _BEAM_POINTS)
    rim = points_at(place.position, headings, np.full(_BEAM_POINTS, length))
    return np.vstack((place.position, rim, place.position))


def bounce_labels(corners: FloatArray) -> list[tuple[str, FloatArray]]:
    """The numbers of a path's bounces and where they are; one that comes back its own way has two at a point."""
    labels: list[tuple[list[int], FloatArray]] = []
    for number, at in enumerate(corners[1:-1], start=1):
        same = next((numbers for numbers, there in labels if math.dist(at, there) < _SAME_BOUNCE), None)
        if same is None:
            labels.append(([number], at))
        else:
            same.append(number)
    return [(" ".join(map(str, numbers)), at) for numbers, at in labels]
