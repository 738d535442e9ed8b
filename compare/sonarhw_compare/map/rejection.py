"""Rejection of readings from several reflections, by following sound in a room.

The room is that of a file, or consists of the walls found in the scans. A reading is rejected if the path that explains
it is reflected at more than one point.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Room, parse_room

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.arcs import Arc, direction
from sonarhw_compare.map.features import Features, Wall
from sonarhw_compare.matching.match import compare_readings

_REFLECTANCE = 0.9  # of found walls; their level matters little
_MEET = 1.0  # m, by which found walls are extended at most, to meet one another
_BEYOND = 0.1  # m behind a wall; a leg that ends farther behind it crosses the wall
_ONE_POINT = 1e-3  # m between reflections that count as one point


@dataclass(frozen=True)
class JudgedReadings:
    """What following sound in a room shows about the readings, (n,) bool for each scan."""

    direct: tuple[BoolArray, ...]  # reflected at one point, or without a path: kept
    explained: tuple[BoolArray, ...]  # with a path


def judged_readings(
    scans: Sequence[PlacedScan], room: Room, board: Board, tick: Callable[[], None] = lambda: None
) -> JudgedReadings:
    """Return which readings are direct and which have a path in a room. `tick` is called before each scan."""
    direct, explained = [], []
    for scan in scans:
        tick()
        points = _points_of_readings(scan, room, board)
        direct.append(points <= 1)
        explained.append(points > 0)
    return JudgedReadings(tuple(direct), tuple(explained))


def _points_of_readings(scan: PlacedScan, room: Room, board: Board) -> NDArray[np.intp]:
    """Return the number of points at which the path of each reading is reflected, (n,); 0 without a path."""
    comparison = compare_readings(scan.readings, room, board.faced(scan.place), board)
    points = _reflection_points(comparison.prediction.paths)
    return np.array([0 if row.path is None else max(1, points[row.path]) for row in comparison.rows], dtype=np.intp)


def _reflection_points(paths: Paths) -> NDArray[np.intp]:
    """Return the number of points at which each path is reflected, (n,); an inner corner counts once."""
    between = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), 2, 0))
    # the last leg ends at the sensor; later entries are NaN
    return np.asarray((between > _ONE_POINT).sum(axis=1) - 1)


def room_of(features: Features) -> Room | None:
    """Return a room of the confirmed walls that sound can reach, extended until they meet; None without walls."""
    walls = tuple(wall for wall in reachable_walls(features) if not wall.possible)
    if not walls:
        return None
    lines = [_longer(wall, walls) for wall in walls]
    text = ['name = "found"', "[materials.found]", f"reflectance = {_REFLECTANCE}"]
    for number, (start, end) in enumerate(lines):
        text += ["[[walls]]", f'name = "wall {number}"', 'material = "found"']
        text.append(f"points = [[{start[0]:.6f}, {start[1]:.6f}], [{end[0]:.6f}, {end[1]:.6f}]]")
    return parse_room("\n".join(text), "the walls that were found")


def reachable_walls(features: Features) -> tuple[Wall, ...]:
    """Return the walls without a nearer wall in front, seen from most of their places; the others are images."""
    arcs = features.arcs
    near_first = sorted(features.walls, key=lambda wall: float(np.mean([arcs[k].range for k in wall.arcs])))
    kept: list[Wall] = []
    for wall in near_first:
        hidden = [any(_passes(arcs[k], wall, other) for other in kept) for k in wall.arcs]
        if np.mean(hidden) <= 0.5:
            kept.append(wall)
    return tuple(kept)


def _passes(arc: Arc, wall: Wall, other: Wall) -> bool:
    """Report whether the straight line from the place of an arc to its wall crosses another wall."""
    start = np.array(arc.centre)
    return _crosses(start, start + arc.range * direction(wall.normal), np.array(other.start), np.array(other.end))


def _crosses(start: FloatArray, end: FloatArray, first: FloatArray, last: FloatArray) -> bool:
    """Report whether a leg crosses a slightly extended wall and ends well behind it."""
    along = (last - first) / np.hypot(*(last - first))
    normal = np.array([-along[1], along[0]])
    before, behind = (start - first) @ normal, (end - first) @ normal
    if before * behind >= 0 or abs(behind) < _BEYOND:
        return False
    meeting = (start + (end - start) * before / (before - behind) - first) @ along
    return bool(-_BEYOND <= meeting <= np.hypot(*(last - first)) + _BEYOND)


def _longer(wall: Wall, walls: Sequence[Wall]) -> tuple[FloatArray, FloatArray]:
    """Return the ends of a wall, extended by at most 1 m to where it meets others."""
    start, end = np.array(wall.start), np.array(wall.end)
    along = (end - start) / np.hypot(*(end - start))
    low, high = 0.0, float(np.hypot(*(end - start)))
    meetings = [at for other in walls if other is not wall for at in _meeting(start, along, other)]
    before = [at for at in meetings if low - _MEET <= at <= low]
    behind = [at for at in meetings if high <= at <= high + _MEET]
    return start + min(before, default=low) * along, start + max(behind, default=high) * along


def _meeting(start: FloatArray, along: FloatArray, other: Wall) -> list[float]:
    """Return where a line crosses another wall or its extension, m along the line; an empty list if it does not."""
    normal = direction(other.normal)
    slope = float(along @ normal)
    if abs(slope) < math.sin(math.radians(10)):
        return []
    at = float((np.array(other.start) - start) @ normal) / slope
    point, first, last = start + at * along, np.array(other.start), np.array(other.end)
    share = float((point - first) @ (last - first)) / float((last - first) @ (last - first))
    reach = _MEET / float(np.hypot(*(last - first)))
    return [at] if -reach <= share <= 1 + reach else []
