"""Rejection: which readings came by several reflections, by following sound round a room.

Takes scans from known places and a room, that of a file or one put together of walls that were found; hands on which
readings to keep. A reading is given up where the path that accounts for it was turned back in more than one place.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Room, parse_room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.arcs import Arc, direction
from sonarhw_compare.map.certainty import BoolArray
from sonarhw_compare.map.features import Features, Wall
from sonarhw_compare.matching.match import compare_readings

_REFLECTANCE = 0.9  # of walls that were found; how loud they are decides little
_MEET = 1.0  # m: found walls are made longer by no more, to meet one another
_BEYOND = 0.1  # m: a leg that passes another wall by more passes through it
_ONE_PLACE = 1e-3  # m


def direct_readings(
    scans: Sequence[PlacedScan], room: Room, board: Board, tick: Callable[[], None] = lambda: None
) -> tuple[BoolArray, ...]:
    """Which readings of each scan came from one place straight back, or by no path of the room, (n,) bool for each.

    `tick` is called before each scan.
    """
    kept = []
    for scan in scans:
        tick()
        kept.append(_direct(scan, room, board))
    return tuple(kept)


def _direct(scan: PlacedScan, room: Room, board: Board) -> BoolArray:
    heading = board.heading_at(0.0, scan.place.heading)
    options = PredictionOptions(receiver=board.receiver)
    comparison = compare_readings(scan.readings, room, scan.place, board, heading=heading, options=options)
    stops = _stops(comparison.prediction.paths)
    return np.array([row.path is None or stops[row.path] <= 1 for row in comparison.rows], dtype=np.bool_)


def _stops(paths: Paths) -> NDArray[np.intp]:
    """At how many places each path was turned back, (n,): an inner corner touches two walls in one place."""
    between = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), 2, 0))
    # the last leg ends at the sensor, those behind it are NaN
    return np.asarray((between > _ONE_PLACE).sum(axis=1) - 1)


def room_of(features: Features) -> Room | None:
    """A room of the walls that were found and that sound can reach, made longer to meet; None where there is none."""
    walls = reachable_walls(features)
    if not walls:
        return None
    lines = [_longer(wall, walls) for wall in walls]
    text = ['name = "found"', "[materials.found]", f"reflectance = {_REFLECTANCE}"]
    for number, (start, end) in enumerate(lines):
        text += ["[[walls]]", f'name = "wall {number}"', 'material = "found"']
        text.append(f"points = [[{start[0]:.6f}, {start[1]:.6f}], [{end[0]:.6f}, {end[1]:.6f}]]")
    return parse_room("\n".join(text), "the walls that were found")


def reachable_walls(features: Features) -> tuple[Wall, ...]:
    """The walls that no nearer one hides from most of the places that heard them: images lie behind what makes them."""
    arcs = features.arcs
    near_first = sorted(features.walls, key=lambda wall: float(np.mean([arcs[k].range for k in wall.arcs])))
    kept: list[Wall] = []
    for wall in near_first:
        hidden = [any(_passes(arcs[k], wall, other) for other in kept) for k in wall.arcs]
        if np.mean(hidden) <= 0.5:
            kept.append(wall)
    return tuple(kept)


def _passes(arc: Arc, wall: Wall, other: Wall) -> bool:
    """Whether the way from an arc's place straight to the wall it touches goes through another wall."""
    start = np.array(arc.centre)
    return _crosses(start, start + arc.range * direction(wall.normal), np.array(other.start), np.array(other.end))


def _crosses(start: FloatArray, end: FloatArray, first: FloatArray, last: FloatArray) -> bool:
    """Whether a leg passes a wall that is a little longer than it was found to be, and goes on behind it."""
    along = (last - first) / np.hypot(*(last - first))
    normal = np.array([-along[1], along[0]])
    before, behind = (start - first) @ normal, (end - first) @ normal
    if before * behind >= 0 or abs(behind) < _BEYOND:
        return False
    meeting = (start + (end - start) * before / (before - behind) - first) @ along
    return bool(-_BEYOND <= meeting <= np.hypot(*(last - first)) + _BEYOND)


def _longer(wall: Wall, walls: Sequence[Wall]) -> tuple[FloatArray, FloatArray]:
    """A wall's ends moved out to where it meets others, by a metre at most."""
    start, end = np.array(wall.start), np.array(wall.end)
    along = (end - start) / np.hypot(*(end - start))
    low, high = 0.0, float(np.hypot(*(end - start)))
    meetings = [at for other in walls if other is not wall for at in _meeting(start, along, other)]
    before = [at for at in meetings if low - _MEET <= at <= low]
    behind = [at for at in meetings if high <= at <= high + _MEET]
    return start + min(before, default=low) * along, start + max(behind, default=high) * along


def _meeting(start: FloatArray, along: FloatArray, other: Wall) -> list[float]:
    """How far along a line another wall's line crosses it, where that is on it or near its ends, m; none or one."""
    normal = direction(other.normal)
    slope = float(along @ normal)
    if abs(slope) < math.sin(math.radians(10)):
        return []
    at = float((np.array(other.start) - start) @ normal) / slope
    point, first, last = start + at * along, np.array(other.start), np.array(other.end)
    share = float((point - first) @ (last - first)) / float((last - first) @ (last - first))
    reach = _MEET / float(np.hypot(*(last - first)))
    return [at] if -reach <= share <= 1 + reach else []
