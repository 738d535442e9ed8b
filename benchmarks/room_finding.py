"""Rooms found from scans of random rooms, beside the true ones: `python -m benchmarks.room_finding [FIRST LAST]`."""

import math
import sys
import time

import numpy as np
from sonarhw_compare.matching.match import compare_readings
from sonarhw_compare.room_finding.room_search import FoundRoom, find_room
from sonarhw_sim.board.profile import Board, load_board

from benchmarks.cases.random_rooms import RandomRoom, random_room
from sonarhw.readings import FloatArray

ROOMS = 30
_NEAR, _TURNED = 0.01, math.radians(1)  # m, rad, of a found wall
_INVENTED = 0.05  # m: a part of a found wall that is farther than this from every true surface
_LEAST = 3  # echoes that touched a wall
_STEP = 0.01  # m along walls


def seen_parts(case: RandomRoom, board: Board) -> list[tuple[int, float, float]]:
    """Return wall, first and last touch (m from its start) of each true wall that three recorded echoes touched."""
    room, touched = case.room, [[] for _ in case.room.walls]  # type: ignore[var-annotated]
    for scan in case.scans:
        comparison = compare_readings(scan.readings, room, scan.place, board)
        for row in comparison.rows:
            if row.path is None:
                continue
            for point in comparison.prediction.paths.outline(row.path)[1:-1]:
                for wall, (x, y, x2, y2) in enumerate(room.walls.tolist()):
                    length = math.hypot(x2 - x, y2 - y)
                    along = np.array([x2 - x, y2 - y]) / length
                    away = point - (x, y)
                    at = float(away @ along)
                    if abs(float(away[0] * along[1] - away[1] * along[0])) < 1e-6 and -1e-6 <= at <= length + 1e-6:
                        touched[wall].append(at)
    return [(wall, min(at), max(at)) for wall, at in enumerate(touched) if len(at) >= _LEAST]


def share_found(case: RandomRoom, found: FoundRoom, board: Board) -> tuple[float, float]:
    """Return the length of the parts seen, and of what is found of them, m."""
    seen = correct = 0.0
    for wall, first, last in seen_parts(case, board):
        x, y, x2, y2 = case.room.walls[wall].tolist()
        angle = math.atan2(y2 - y, x2 - x)
        at = np.arange(first, last, _STEP) + _STEP / 2
        points = np.array([x, y]) + at[:, None] * [math.cos(angle), math.sin(angle)]
        hit = np.zeros(len(at), np.bool_)
        for key, other in found.draft.walls.items():
            if abs(math.remainder(other.angle - angle, math.pi)) <= _TURNED:
                hit |= _distances(points, found.draft.segment(key)) <= _NEAR
        seen, correct = seen + len(at) * _STEP, correct + float(hit.sum()) * _STEP
    return seen, correct


def share_invented(case: RandomRoom, found: FoundRoom) -> tuple[float, float]:
    """Return the length of the found walls, and of the parts where nothing is, m."""
    whole = invented = 0.0
    for x, y, x2, y2 in found.draft.segments.tolist():
        length = math.hypot(x2 - x, y2 - y)
        at = np.arange(0, length, _STEP)
        points = np.array([x, y]) + at[:, None] / length * [x2 - x, y2 - y]
        away = np.min([_distances(points, wall) for wall in case.room.walls], axis=0)
        for x3, y3, radius in case.room.posts.tolist():
            away = np.minimum(away, np.abs(np.hypot(*(points - (x3, y3)).T) - radius))
        whole, invented = whole + length, invented + float((away > _INVENTED).sum()) * _STEP
    return whole, invented


def _distances(points: FloatArray, wall: FloatArray) -> FloatArray:
    start, along = wall[:2], wall[2:] - wall[:2]
    share = np.clip((points - start) @ along / (along @ along), 0, 1)
    return np.asarray(np.hypot(*(start + share[:, None] * along - points).T))


def main() -> None:
    """Print a row for each room, and the totals."""
    first, last = map(int, sys.argv[1:3]) if len(sys.argv) > 2 else (0, ROOMS)
    board = load_board("polaroid-6500")
    print("room  walls posts scans   found: walls posts   seen m  found  invented   s")
    totals = np.zeros(4)
    for seed in range(first, last):
        case = random_room(seed, board)
        began = time.process_time()
        found = find_room(case.scans, board, case.room.air)
        took = time.process_time() - began
        seen, correct = share_found(case, found, board)
        whole, invented = share_invented(case, found)
        totals += seen, correct, whole, invented
        print(
            f"{seed:4} {len(case.room.walls):6} {len(case.room.posts):5} {len(case.scans):5} "
            f"{len(found.draft.walls):13} {len(found.draft.posts):5} {seen:8.2f} {correct / seen:6.1%} "
            f"{invented / whole:9.1%} {took:5.1f}",
            flush=True,
        )
    print(f"all: {totals[1] / totals[0]:.1%} found, {totals[3] / totals[2]:.1%} invented")


if __name__ == "__main__":
    main()
