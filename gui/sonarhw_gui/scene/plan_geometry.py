"""Lines of the plan as (n, 2) arrays of points in metres: walls, outline and beam. NaN marks a gap."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.pictures import points_at
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray

_JUMP = 0.1  # m between neighbouring headings; beyond it another path is received, and a line would look like a wall
_BEAM_POINTS = 17
_SAME_BOUNCE = 0.005  # m
_NEAR = 2.0  # times the size of the room
_CIRCLE = np.linspace(0.0, 2 * np.pi, 49)


def wall_lines(room: Room) -> FloatArray:
    """Return both ends of every wall, (2n, 2) float, m; each pair of rows is one line."""
    return room.walls.reshape(-1, 2)


def surface_outlines(walls: FloatArray, posts: FloatArray) -> FloatArray:
    """Return walls (n, 4) and posts (m, 3), m, as one line, (k, 2) float; NaN separates the surfaces."""
    circle = np.column_stack((np.cos(_CIRCLE), np.sin(_CIRCLE)))
    lines = [*(wall.reshape(2, 2) for wall in walls), *(post[:2] + post[2] * circle for post in posts)]
    gap = np.full((1, 2), np.nan)
    return np.vstack([part for line in lines for part in (line, gap)]) if lines else np.empty((0, 2))


def plan_bounds(room: Room, others: FloatArray) -> FloatArray:
    """Return the lower and upper corner of the plan, (2, 2) float, m.

    It contains walls, posts, and those of the points `others` (n, 2) that are less than two room sizes away.
    """
    posts, radii = room.posts[:, :2], room.posts[:, 2:]
    points = np.vstack((wall_lines(room), posts - radii, posts + radii))
    low, high = points.min(axis=0), points.max(axis=0)
    reach = _NEAR * (high - low).max()
    near = ((others > low - reach) & (others < high + reach)).all(axis=1)
    points = np.vstack((points, others[near]))
    return np.array([points.min(axis=0), points.max(axis=0)])


def outline_ranges(outline: PredictedScan) -> FloatArray:
    """Return headings and ranges of the outline, (n, 2) float, rad and m; NaN also separates the lines."""
    both = np.column_stack((outline.headings, outline.ranges))
    return np.insert(both, _breaks(outline), np.nan, axis=0)


def outline_points(outline: PredictedScan) -> FloatArray:
    """Return the outline in the plan, (n, 2) float, m; NaN at headings without echo and where the path changes."""
    points = points_at(outline.standpoints, outline.headings, outline.ranges)
    return np.insert(points, _breaks(outline), np.nan, axis=0)


def _breaks(outline: PredictedScan) -> NDArray[np.intp]:
    return np.flatnonzero(np.abs(np.diff(outline.ranges)) > _JUMP) + 1


def half_power_angle(board: Board, room: Room) -> float:
    """Return the angle off the axis at which the transducer emits half the power, rad."""
    return _half_power_angle(board.wavenumber(room.air) * board.aperture_radius)


@lru_cache(maxsize=4)
def _half_power_angle(ka: float) -> float:
    angles = np.linspace(0, math.pi / 2, 3601)
    return float(angles[np.argmax(beam_gain(angles, ka) < math.sqrt(0.5))])


def beam_wedge(place: Place, heading: float, half_angle: float, length: float) -> FloatArray:
    """Return the corners of the beam in the plan, (n, 2) float, m; the first and the last are the place."""
    headings = np.linspace(heading - half_angle, heading + half_angle, _BEAM_POINTS)
    rim = points_at(place.position, headings, np.full(_BEAM_POINTS, length))
    return np.vstack((place.position, rim, place.position))


def bounce_losses(prediction: PredictedScan, path: int) -> list[tuple[int, float]]:
    """Return the losses along a path: number of the corner, and loss in dB.

    The loss at a wall follows from its reflectance. Of posts, edges and materials with a table, only the sum of the
    losses is known. It is returned for the last of them.
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
        return [(1, rest)]  # the path's own loss: a rough wall scatters less sound straight back than it reflects
    for corner, surface in enumerate(events, start=1):
        if surface is None or flat <= surface < room.levels.start or room.materials[surface] in room.tables:
            bent = corner
        else:
            losses.append((corner, _decibels(float(room.reflectances[surface]))))
            rest -= losses[-1][1]
    return sorted([*losses, (bent, rest)] if bent else losses)


def _decibels(amplitude: float) -> float:
    return 20 * math.log10(amplitude) if amplitude > 0 else -math.inf


def decibels_text(level: float) -> str:
    """Format a level with a minus sign (U+2212). A level of 0.0 has no sign."""
    return f"{level:.1f} dB".replace("-0.0 ", "0.0 ").replace("-", "−")


def bounce_labels(corners: FloatArray) -> list[tuple[str, FloatArray]]:
    """Return the numbers of a path's bounces with their positions, (2,) m; `corners` (n, 2) m are the whole path.

    A path that returns on itself has several bounces at one point; their numbers are joined.
    """
    labels: list[tuple[list[str], FloatArray]] = []
    for number, at in enumerate(corners[1:-1], start=1):
        same = next((texts for texts, there in labels if math.dist(at, there) < _SAME_BOUNCE), None)
        if same is None:
            labels.append(([str(number)], at))
        else:
            same.append(str(number))
    return [(", ".join(texts), at) for texts, at in labels]
