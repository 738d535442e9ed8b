"""`predict_ranges` returns what `predict` returns at each pose, but for readings at the border between two echoes."""

from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim import Ring

import sonarhw
from sonarhw import Board, InputError, Room
from sonarhw.readings import FloatArray

HEADINGS = np.arange(12) * np.radians(30)


def poses_in(room: Room, count: int, seed: int) -> FloatArray:
    random, ends = np.random.default_rng(seed), room.walls.reshape(-1, 2)
    points = random.uniform(ends.min(axis=0) + 0.1, ends.max(axis=0) - 0.1, (20 * count, 2))
    free = [point for point in points.tolist() if not (room.is_outside(point) or room.posts_at(point))]
    return np.column_stack((free[:count], random.uniform(-4, 4, count)))


def one_by_one(room: Room, board: Board, poses: FloatArray, height: float | None = None) -> FloatArray:
    ranges = []
    for x, y, heading in poses.tolist():
        place = board.faced(sonarhw.Place("", (x, y), heading, height))
        ranges.append(sonarhw.predict(room, place, board, place.heading + board.turned(HEADINGS)).ranges)
    return np.array(ranges)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("name", "board", "height", "count"),
    [
        ("arena", "hc-sr04", None, 25),
        ("laboratory", "hc-sr04", None, 15),  # a post, and edges of a panel
        ("laboratory", "polaroid-6500", None, 2),  # the board's own receiver
        ("doorstep", "hc-sr04", 0.3, 2),  # floor, and walls of limited height
    ],
)
def test_ranges_are_those_of_single_predictions(name: str, board: str, height: float | None, count: int) -> None:
    room, profile = sonarhw.load_room(name), replace(sonarhw.load_board(board), home_angle_deg=3.0, axis_x=0.02)
    poses = poses_in(room, count, seed=3)
    expected = one_by_one(room, profile, poses, height)
    ranges = sonarhw.predict_ranges(room, poses, HEADINGS, profile, height=height)
    assert ranges.shape == (count, 12)
    other = (np.isnan(ranges) != np.isnan(expected)) | (np.abs(ranges - expected) > 0.001)
    assert np.isfinite(expected).sum() > 2 * count
    assert other.sum() <= 1


def test_a_ring_has_its_own_headings_and_levels_are_over_the_threshold() -> None:
    room, board = sonarhw.load_room("arena"), sonarhw.load_board("hc-sr04")
    ring = replace(board, ring=Ring(sensors=6, radius=0.1, interval=0.05))
    poses = poses_in(room, 2, seed=5)
    ranges, levels = sonarhw.predict_ranges(room, poses, board=ring, levels=True)
    assert ranges.shape == levels.shape == (2, 6)
    x, y, heading = poses[0].tolist()
    single = sonarhw.predict(room, (x, y, heading), ring)
    assert np.allclose(ranges[0], single.ranges, equal_nan=True, atol=0.001)
    assert ((levels >= 0) == np.isfinite(ranges)).mean() > 0.98


def test_poses_beyond_the_walls_are_warned_of() -> None:
    room = sonarhw.load_room("arena")
    with pytest.warns(UserWarning, match="poses: 2 of 2 are beyond the walls, .* if they are centimetres, divide them"):
        assert sonarhw.predict_ranges(room, [[140, 60, 0], [150, 60, 0]], [0.0]).shape == (2, 1)


def test_degrees_are_converted_and_shapes_checked() -> None:
    room = sonarhw.load_room("arena")
    pose = poses_in(room, 1, seed=1)
    degrees = pose * [1, 1, 180 / np.pi]
    ranges = sonarhw.predict_ranges(room, degrees, np.degrees(HEADINGS), degrees=True)
    assert np.allclose(ranges, sonarhw.predict_ranges(room, pose, HEADINGS), equal_nan=True)
    assert sonarhw.predict_ranges(room, np.empty((0, 3)), HEADINGS).shape == (0, 12)
    assert np.allclose(
        sonarhw.predict_ranges(room, pose[0, :2], HEADINGS + pose[0, 2]), ranges, equal_nan=True, atol=1e-9
    )
    for wrong in (np.zeros((2, 4)), [[1, np.nan, 0]], "poses"):
        with pytest.raises(InputError, match="poses: expected"):
            sonarhw.predict_ranges(room, wrong, HEADINGS)
