"""Lines of the plan as (n, 2) arrays of points in metres: walls, outline and beam. NaN marks a gap."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.pictures.points import points_at
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.transducer import beam_gain
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.room.model import Place, Room

from sonarhw.readings import FloatArray

_JUMP = 0.1  # m between neighbouring headings: another path wins, and a line between them would be a wall nobody has
_BEAM_POINTS = 17
_SAME_BOUNCE = 0.005  # m
_NEAR = 2.0  # times the size of the room


def wall_lines(room: Room) -> FloatArray:
    """Both ends of every wall one after another, (2n, 2): to be connected in pairs."""
    return room.walls.reshape(-1, 2)


def plan_bounds(room: Room, besides: FloatArray) -> FloatArray:
    """Lower and upper corner (2, 2) of what the plan is about: walls, posts, and those of the points `besides` (n, 2)
    that are not far off."""
    posts, radii = room.posts[:, :2], room.posts[:, 2:]
    points = np.vstack((wall_lines(room), posts - radii, posts + radii))
    low, high = points.min(axis=0), points.max(axis=0)
    reach = _NEAR * (high - low).max()
    near = ((besides > low - reach) & (besides < high + reach)).all(axis=1)
    points = np.vstack((points, besides[near]))
    return np.array([points.min(axis=0), points.max(axis=0)])


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
    return _half_power_angle(board.wavenumber(room.air) * board.aperture_radius)


@lru_cache(maxsize=4)
def _half_power_angle(ka: float) -> float:
    angles = np.linspace(0, math.pi / 2, 3601)
    return float(angles[np.argmax(beam_gain(angles, ka) < math.sqrt(0.5))])


def beam_wedge(place: Place, heading: float, half_angle: float, length: float) -> FloatArray:
    """The corners of the beam in the plan, from the place round and back to it."""
    headings = np.linspace(heading - half_angle, heading + half_angle, _BEAM_POINTS)
    rim = points_at(place.position, headings, np.full(_BEAM_POINTS, length))
    return np.vstack((place.position, rim, place.position))


def bounce_losses(prediction: PredictedScan, path: int) -> list[tuple[int, float]]:
    """What each thing a path touched took of its amplitude: which corner of the path, and dB.

    A wall takes what its reflectance says; what roundness and edges take is known of all of them together, and told at
    the last.
    """
    paths, room = prediction.paths, prediction.room
    surfaces = [int(surface) for surface in paths.surfaces[path] if surface >= 0]
    bend = int(paths.bends[path]) if paths.edges[path] >= 0 else None
    flat = len(room.walls)
    events: list[int | None] = [*surfaces]
    if bend is not None:
        events.insert(bend, None)
    losses, bent, rest = [], 0, _decibels(float(paths.gains[path]))
    if len(events) == 1:
        return [(1, rest)]  # a rough wall scatters straight back with less than it mirrors
    for corner, surface in enumerate(events, start=1):
        if surface is None or flat <= surface < room.levels.start:
            bent = corner
        else:
            losses.append((corner, _decibels(float(room.reflectances[surface]))))
            rest -= losses[-1][1]
    return sorted([*losses, (bent, rest)] if bent else losses)


def _decibels(amplitude: float) -> float:
    return 20 * math.log10(amplitude) if amplitude > 0 else -math.inf


def decibels_text(level: float) -> str:
    """A level as people read it, with a real minus and none at nothing."""
    return f"{level:.1f} dB".replace("-0.0 ", "0.0 ").replace("-", "−")


def bounce_labels(corners: FloatArray, losses: list[tuple[int, float]]) -> list[tuple[str, FloatArray]]:
    """What is written at a path's corners and where: number and loss; one that comes back its own way has two at a
    point."""
    told = dict(losses)
    labels: list[tuple[list[str], FloatArray]] = []
    for number, at in enumerate(corners[1:-1], start=1):
        text = f"{number}  {decibels_text(told[number])}" if number in told else f"{number}"
        same = next((texts for texts, there in labels if math.dist(at, there) < _SAME_BOUNCE), None)
        if same is None:
            labels.append(([text], at))
        else:
            same.append(text)
    return [("\n".join(texts), at) for texts, at in labels]
