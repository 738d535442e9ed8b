"""Readings of a robot that moves. Its four sensors face the walls of a rectangle, so that each range is a distance."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.air import Model

import sonarhw
from sonarhw import InputError, Room
from sonarhw.log import read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import FloatArray, moved_by, step_between

WIDTH, DEPTH = 4.0, 3.0  # m
HEADINGS = np.array([0.0, 0.5, 1.0, 1.5]) * math.pi  # to the right, upper, left and lower wall
POSES = np.array([[1.0 + 0.1 * k, 1.2 + 0.05 * k, 0.0] for k in range(6)])


@pytest.fixture(scope="module")
def room() -> Room:
    return sonarhw.room_from_arrays([[0, 0], [WIDTH, 0], [WIDTH, DEPTH], [0, DEPTH]], places={"start": (1.0, 1.2)})


def distances(poses: FloatArray) -> FloatArray:
    """Return the distance to the wall that each sensor faces, (n, 4) m."""
    x, y = poses[:, 0], poses[:, 1]
    return np.column_stack((WIDTH - x, DEPTH - y, x, y))


def driven(poses: FloatArray = POSES, ranges: FloatArray | None = None) -> sonarhw.GivenScan:
    measured = distances(POSES) if ranges is None else ranges
    return sonarhw.scan_from_arrays(np.tile(HEADINGS, len(poses)), measured.ravel(), pose=np.repeat(poses, 4, axis=0))


@pytest.mark.parametrize("model", [Model.RAY_FOLLOWING, Model.NEAREST, Model.CONE])
def test_each_reading_is_predicted_from_its_own_pose(room: Room, model: Model) -> None:
    comparison = sonarhw.compare(driven(), room, board="paper", model=model)
    predicted = [row.predicted for row in comparison.rows]
    np.testing.assert_allclose(predicted, distances(POSES).ravel(), atol=0.002)
    assert comparison.summary().within_5cm == 1.0


def test_odometry_from_anywhere_begins_at_the_place_that_is_given(room: Room) -> None:
    """The odometry begins at another point and heading: the same trajectory, turned by 90° and moved."""
    there = np.array([moved_by((7.0, -3.0, math.pi / 2), step_between(tuple(POSES[0]), tuple(p))) for p in POSES])
    comparison = sonarhw.compare(driven(there, distances(POSES)), room, "start", "paper")
    assert comparison.prediction.poses is not None
    np.testing.assert_allclose(comparison.prediction.poses[::4], POSES, atol=1e-9)
    assert comparison.summary().within_5cm == 1.0
    with pytest.warns(UserWarning, match="is outside room|are beyond the walls|only 0% of 24 echoes"):
        assert sonarhw.compare(driven(there, distances(POSES)), room, board="paper").summary().within_5cm == 0.0


def test_explanations_and_figures_are_those_of_the_pose(room: Room) -> None:
    comparison = sonarhw.compare(driven(), room, board="paper")
    last = len(comparison.rows) - 2  # to the left, from the last pose
    assert sonarhw.explain_reading(comparison, last).startswith("1.500 m at 180.0°: one reflection, wall[3]")
    figures = comparison.figures(explained=True)["readings"][last]
    assert (figures["x_m"], figures["y_m"], figures["yaw_deg"]) == (1.5, 1.45, 0.0)
    assert any("the last of 6 poses: 1.5000, 1.4500 m, 0.0°" in line for line in comparison.lines())
    json.dumps(comparison.figures(explained=True))


def test_a_log_keeps_the_poses_for_comparison_and_report(room: Room, tmp_path: Path) -> None:
    metadata = sonarhw.LogMetadata("import", 1e9, "room.toml", room.text, board="paper")
    write_scan(tmp_path / "drive.mcap", metadata, driven().readings)
    comparison = sonarhw.compare(read_log(tmp_path / "drive.mcap"))
    assert comparison.summary().within_5cm == 1.0
    sonarhw.write_report(tmp_path / "drive.mcap", tmp_path / "drive.html")
    page = (tmp_path / "drive.html").read_text()
    assert "6 poses" in page
    assert re.search(r"last position</td><td>x 1.5 m, y 1.45 m", page)


def test_the_picture_has_the_trajectory_and_the_points_where_they_were_measured(room: Room) -> None:
    axes = sonarhw.draw_comparison(sonarhw.compare(driven(), room, board="paper")).axes[0]
    lines = {line.get_label(): line.get_xydata() for line in axes.lines}
    np.testing.assert_allclose(np.unique(lines["sensor"], axis=0), POSES[:, :2])
    x, y = POSES[:, 0], POSES[:, 1]
    walls = np.stack(([[WIDTH] * 6, y], [x, [DEPTH] * 6], [[0] * 6, y], [x, [0] * 6]), axis=0)  # (4, 2, 6)
    np.testing.assert_allclose(lines["imported"], walls.transpose(2, 0, 1).reshape(-1, 2), atol=1e-6)


@pytest.mark.parametrize(
    "task",
    [sonarhw.fit, sonarhw.locate, sonarhw.map_room, lambda scan, room: sonarhw.compare(scan, room, fit="offset")],
)
def test_tasks_for_one_place_refuse_a_sensor_that_moves(room: Room, task: object) -> None:
    with pytest.raises(
        InputError, match=r"the sensor moves by 0.56 m and turns by 0°; expected readings from one place"
    ):
        task(driven(), room)  # type: ignore[operator]


def test_a_robot_that_stands_still_has_one_place(room: Room) -> None:
    still = np.repeat(POSES[:1], 6, axis=0) + 1e-5 * np.arange(6)[:, None]
    scan = driven(still, distances(still))
    assert sonarhw.compare(scan, room, board="paper").prediction.poses is None
    fitted = sonarhw.fit(scan, room, board="paper", free="position", samples=0)
    assert fitted.estimates["x"].value == pytest.approx(1.0, abs=0.01)


def test_poses_must_be_as_many_as_headings() -> None:
    with pytest.raises(InputError, match="pose: expected one, or one for each of 4 headings, got 6"):
        sonarhw.scan_from_arrays(HEADINGS, np.ones(4), pose=POSES)


def test_poses_may_have_degrees() -> None:
    scan = sonarhw.scan_from_arrays([0, 90], [1, 1], pose=[[0, 0, 90], [0, 0, 180]], degrees=True)
    assert [reading.pose for reading in scan.readings] == [(0, 0, pytest.approx(math.pi / 2)), (0, 0, math.pi)]
