"""Walls that a scan contradicts: seen at right angles, a wall sends its echo back, so nothing behind it is detected.

The certainty grid does not show this. Its cones of multipath echoes reach through true walls, too.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from sonarhw_sim.board.profile import Board

from sonarhw.readings import BoolArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.map.certainty import headings_and_ranges
from sonarhw_compare.map.features import Features, Wall

_BEAM = math.radians(5)  # to each side of the perpendicular; wider, other objects are detected
_BEHIND = 0.1  # m, least distance of the echoes behind the wall
_FROM_END = 0.05  # m, from the perpendicular to the ends of the wall, whose exact position is unknown


def with_possible_walls(
    features: Features, scans: Sequence[PlacedScan], board: Board, kept: Sequence[BoolArray]
) -> Features:
    """Return the features; walls through which a scan detects something behind them are marked as possible."""
    walls = tuple(
        replace(
            wall,
            possible=any(_sees_through(scan, wall, board, wanted) for scan, wanted in zip(scans, kept, strict=True)),
        )
        for wall in features.walls
    )
    return replace(features, walls=walls)


def _sees_through(scan: PlacedScan, wall: Wall, board: Board, kept: BoolArray) -> bool:
    """Report whether most echoes of a scan near the perpendicular to a wall come from behind the wall."""
    start, end = np.array(wall.start), np.array(wall.end)
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    to_start = start - np.array(scan.place.position)
    foot = to_start - (to_start @ along) * along
    if not _FROM_END <= -float(to_start @ along) <= length - _FROM_END:
        return False
    headings, ranges = headings_and_ranges(scan, board)
    apart = np.remainder(headings - math.atan2(foot[1], foot[0]) + math.pi, math.tau) - math.pi
    facing = ranges[kept & (np.abs(apart) <= _BEAM) & ~np.isnan(ranges)]
    return bool(len(facing) and np.median(facing) > np.hypot(*foot) + _BEHIND)
