"""How well a robot is tracked: seeded trajectories in a model that is as wrong as real ones are, by several models.

    python -m benchmarks.tracking                           the short version: two trajectories of 5 m in each room
    python -m benchmarks.tracking --whole                   thirty trajectories of 20 m
    python -m benchmarks.tracking --rooms arena --drives 4 --way 20 --sensors 8
    python -m benchmarks.tracking --everywhere              the start is unknown

The odometry has an error of 5 % of the way and 3° per metre. The robot is in a room with corners off by 5 mm, a post
that the tracker does not have, a threshold off by 2 dB, and 5 % stray readings.
"""

import argparse
import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from sonarhw_compare.free_space import FreeSpace, find_free_space
from sonarhw_compare.track import Tracker
from sonarhw_sim.air import Model
from sonarhw_sim.room.room import with_post
from sonarhw_sim.room.room_writing import with_corners

import sonarhw
from sonarhw.readings import FloatArray

ROOMS = ("arena", "laboratory", "kuc_siegel")
MODELS = (Model.RAY_FOLLOWING, Model.CONE, Model.NEAREST)
STEP = 0.1  # m between updates
CLEARANCE = 0.2  # m, from the robot to walls
DRIFT = (0.05, math.radians(3))
CORNERS, THRESHOLD, STRAYS = 0.005, 2.0, 0.05  # m, dB, share
POST = 0.03  # m, radius
NEAR, LOST = 0.15, 0.5  # m
FOUND_WITHIN = 5.0  # m of way


@dataclass(frozen=True)
class Drive:
    """A trajectory with what the robot measures along it."""

    poses: FloatArray  # (n, 3)
    odometry: FloatArray  # (n, 3), from the pose before
    headings: FloatArray  # (m,)
    ranges: FloatArray  # (n, m)


def drive(room: sonarhw.Room, board: sonarhw.Board, way: float, sensors: int, seed: int) -> Drive:
    """Return a drive of `way` m in a room that differs a little."""
    random = np.random.default_rng(seed)
    space = find_free_space(room)
    corners = {(x, y): (x + dx, y + dy) for (x, y), (dx, dy) in _moved(room, random)}
    post = (*space.draw(random, 2 * CLEARANCE), POST)
    actual = with_post(with_corners(room, corners), post, "unknown post", 0.95)
    poses = _trajectory(space, way, post, random)
    headings = np.arange(sensors) * math.tau / sensors
    other = replace(board, threshold_db=board.threshold_db + random.choice([-THRESHOLD, THRESHOLD]))
    ranges = np.asarray(sonarhw.predict_ranges(actual, poses, headings, other))
    strays = random.random(ranges.shape) < STRAYS
    ranges = np.where(strays, random.uniform(0.1, board.max_range, ranges.shape), ranges)
    return Drive(poses, _odometry(poses, random), headings, ranges)


def _moved(room: sonarhw.Room, random: np.random.Generator) -> list[tuple[tuple[float, float], FloatArray]]:
    corners = np.unique(room.walls.reshape(-1, 2), axis=0)
    return [((x, y), CORNERS * random.standard_normal(2)) for x, y in corners.tolist()]


def _trajectory(
    space: FreeSpace, way: float, post: tuple[float, float, float], random: np.random.Generator
) -> FloatArray:
    """Return poses every STEP along straight lines between random points, without meeting anything."""
    point = _free_point(space, post, random)
    poses: list[tuple[float, float, float]] = []
    while len(poses) < way / STEP:
        goal = _free_point(space, post, random)
        length, heading = math.dist(point, goal), math.atan2(goal[1] - point[1], goal[0] - point[0])
        count = int(length / STEP)
        line = [
            (point[0] + k * STEP * math.cos(heading), point[1] + k * STEP * math.sin(heading), heading)
            for k in range(1, count + 1)
        ]
        if line and all(_is_clear(space, pose[:2], post) for pose in line):
            poses += line
            point = line[-1][:2]
    return np.array(poses[: int(way / STEP)])


def _free_point(space: FreeSpace, post: tuple[float, float, float], random: np.random.Generator) -> tuple[float, float]:
    while True:
        point = space.draw(random, CLEARANCE)
        if _is_clear(space, point, post):
            return point


def _is_clear(space: FreeSpace, point: tuple[float, float], post: tuple[float, float, float]) -> bool:
    return math.dist(point, post[:2]) > CLEARANCE and space.holds(np.array(point), CLEARANCE / 2)


def _odometry(poses: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return the motion from pose to pose in the robot's frame, with drift."""
    before = np.vstack((poses[:1], poses[:-1]))
    moves, turns = poses[:, :2] - before[:, :2], poses[:, 2] - before[:, 2]
    cosines, sines = np.cos(before[:, 2]), np.sin(before[:, 2])
    steps = np.column_stack(
        (cosines * moves[:, 0] + sines * moves[:, 1], -sines * moves[:, 0] + cosines * moves[:, 1], turns)
    )
    way = np.hypot(*moves.T)
    steps[:, :2] *= 1 + DRIFT[0] * random.standard_normal()
    steps[:, 2] += way * DRIFT[1] * random.choice([-1, 1])
    return steps


@dataclass(frozen=True)
class Figures:
    """Errors of the updates of a drive."""

    errors: FloatArray  # (n,), m
    within: FloatArray  # (n,), whether two deviations hold the truth, in x and in y
    seconds: float  # of processor time for each update

    @property
    def found_after(self) -> float:
        """The way after which the error stays below 15 cm for ten updates, m; inf: never."""
        near = self.errors <= NEAR
        begins = [k for k in range(len(near) - 9) if near[k : k + 10].all()]
        return STEP * begins[0] if begins else math.inf

    @property
    def is_lost(self) -> bool:
        """Whether the last ten errors are large."""
        return bool(self.errors[-10:].min() > LOST)


def tracked(
    room: sonarhw.Room,
    board: sonarhw.Board,
    driven: Drive,
    model: Model | sonarhw.RangeTable,
    seed: int,
    everywhere: bool,
) -> Figures:
    """Return the errors of a tracker that starts at the true pose, or anywhere."""
    start = None if everywhere else driven.poses[0]
    by: dict[str, Any] = {"model": model} if isinstance(model, Model) else {"table": model}
    tracker = Tracker(room, board, start, drift=DRIFT, seed=seed, **by)
    errors, within, begun = [], [], time.process_time()
    for pose, step, ranges in zip(driven.poses, driven.odometry, driven.ranges, strict=True):
        found = tracker.update(step, driven.headings, ranges)
        away = np.array(found.position) - pose[:2]
        errors.append(float(np.hypot(*away)))
        within.append(float((np.abs(away) <= 2 * np.array(found.deviations[:2])).mean()))
    seconds = (time.process_time() - begun) / len(errors)
    return Figures(np.array(errors), np.array(within), seconds)


def dead_reckoning(driven: Drive) -> Figures:
    """Return the errors of the odometry alone."""
    x, y, heading = driven.poses[0]
    errors = []
    for pose, (ahead, left, turn) in zip(driven.poses, driven.odometry, strict=True):
        x += math.cos(heading) * ahead - math.sin(heading) * left
        y += math.sin(heading) * ahead + math.cos(heading) * left
        heading += turn
        errors.append(math.hypot(x - pose[0], y - pose[1]))
    return Figures(np.array(errors), np.zeros(len(errors)), 0.0)


def main() -> None:
    """Print the figures of each model."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--whole", action="store_true", help="thirty trajectories of 20 m")
    parser.add_argument("--rooms", nargs="+", default=ROOMS)
    parser.add_argument("--drives", type=int, help="trajectories in each room")
    parser.add_argument("--way", type=float, help="m of each trajectory")
    parser.add_argument("--sensors", type=int, default=16)
    parser.add_argument("--board", default="hc-sr04")
    parser.add_argument("--models", nargs="+", default=[model.value for model in MODELS] + ["table"])
    parser.add_argument("--everywhere", action="store_true", help="the start is unknown")
    given = parser.parse_args()
    way = given.way or (20.0 if given.whole else 5.0)
    count = given.drives or (10 if given.whole else 2)
    board = sonarhw.load_board(given.board)
    figures: dict[str, list[Figures]] = {}
    for name in given.rooms:
        room = sonarhw.load_room(name)
        models = {
            title: sonarhw.range_table(room, board) if title == "table" else Model(title) for title in given.models
        }
        for seed in range(count):
            driven = drive(room, board, way, given.sensors, seed)
            for title, model in models.items():
                figures.setdefault(title, []).append(tracked(room, board, driven, model, seed, given.everywhere))
            figures.setdefault("odometry alone", []).append(dead_reckoning(driven))
    drives = len(given.rooms) * count
    start = "unknown start" if given.everywhere else "known start"
    print(f"{drives} drives of {way:g} m in {', '.join(given.rooms)}, {given.sensors} sensors, {board.name}, {start}")
    print("model            median    95 %  within 15 cm  lost  found in 5 m  in 2 deviations  s per update")
    for name, of_model in figures.items():
        _print(name, of_model)


def _print(name: str, drives: list[Figures]) -> None:
    errors, within = (np.concatenate([getattr(one, key) for one in drives]) for key in ("errors", "within"))
    found = sum(one.found_after <= FOUND_WITHIN for one in drives)
    print(
        f"{name:15}  {np.median(errors):.3f} m  {np.quantile(errors, 0.95):.3f} m  {(errors <= NEAR).mean():11.1%}"
        f"  {sum(one.is_lost for one in drives):4d}  {found:7d} of {len(drives):<2d}  {within.mean():14.1%}"
        f"  {np.mean([one.seconds for one in drives]):.3f}"
    )


if __name__ == "__main__":
    main()
