"""Readings of a robot that moves. Its four sensors face the walls of a rectangle, so that each range is a distance."""

import json
import math
import re
import warnings
from io import StringIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.air import Model

import sonarhw
from sonarhw import InputError, Room
from sonarhw.export import write_csv
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
    with pytest.raises(InputError, match=r"the sensor moves by 0.56 m and turns by 0°; expected readings from one"):
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


def test_the_arrays_of_a_ring_are_refused_with_the_call_that_takes_them() -> None:
    call = "6 scans of 4 headings are `scan_from_arrays(np.tile(headings, 6), ranges.ravel(), pose=np.repeat(poses, 4"
    for headings in (HEADINGS, np.tile(HEADINGS, 6)):
        with pytest.raises(InputError, match=re.escape(call)):
            sonarhw.scan_from_arrays(headings, np.ones((6, 4)), pose=POSES)
    with pytest.raises(InputError, match=re.escape("for 4 headings at each, `np.repeat(pose, 4, axis=0)`")):
        sonarhw.scan_from_arrays(np.tile(HEADINGS, 6), np.ones(24), pose=POSES)


@pytest.mark.parametrize(
    ("step", "ranges", "doubt"),
    [
        ((300.0, 0, 0), 1.0, "odometry: .* beyond the walls"),
        ((0, 0, 20.0), 1.0, "odometry: a turn of 20, taken as radians"),
        ((0, 0, 0), 90.0, "ranges: half of them over 30 m"),
    ],
)
def test_other_units_are_doubted_once(room: Room, step: tuple[float, float, float], ranges: float, doubt: str) -> None:
    tracker = sonarhw.Tracker(room, "paper", tuple(POSES[0]), particles=20, model=Model.NEAREST)
    with pytest.warns(UserWarning, match=doubt):
        tracker.update(step, HEADINGS, np.full(4, ranges))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tracker.update(step, HEADINGS, np.full(4, ranges))


def test_poses_may_have_degrees() -> None:
    scan = sonarhw.scan_from_arrays([0, 90], [1, 1], pose=[[0, 0, 90], [0, 0, 180]], degrees=True)
    assert [reading.pose for reading in scan.readings] == [(0, 0, pytest.approx(math.pi / 2)), (0, 0, math.pi)]


# turns by at most 6°: the nearest point of each wall, where a mirror reflects the sound back, stays within the beam
ROUND = np.array([[0.8 + 0.06 * k, 0.9 + 0.15 * math.sin(0.3 * k), 0.1 * math.sin(0.2 * k)] for k in range(14)])


def odometry(poses: FloatArray, scale: float = 1.05, drift: float = math.radians(3)) -> FloatArray:
    """Return the poses that odometry states, which begins anywhere and is wrong by a scale and a turn per metre."""
    stated = [(4.0, -7.0, 1.0)]
    for before, after in pairwise(map(tuple, poses.tolist())):
        ahead, left, turn = step_between(before, after)
        stated.append(moved_by(stated[-1], (scale * ahead, scale * left, turn + drift * math.hypot(ahead, left))))
    return np.array(stated)


def recorded(poses: FloatArray, stated: FloatArray) -> sonarhw.GivenScan:
    """Return what a robot with four sensors measures at poses, and what its odometry states."""
    noise = 0.003 * np.random.default_rng(3).standard_normal((len(poses), 4))
    return driven(stated, distances(poses) + noise)


@pytest.mark.parametrize("model", [Model.RAY_FOLLOWING, Model.CONE])
def test_a_robot_is_tracked_where_its_odometry_drifts(room: Room, model: Model) -> None:
    scan = recorded(ROUND, odometry(ROUND))
    start = tuple(ROUND[0])
    tracked = sonarhw.track(scan, room, "paper", start, model=model, particles=300, seed=2)
    errors = np.hypot(*(tracked.poses - ROUND)[:, :2].T)
    alone = np.hypot(*(tracked.odometry - ROUND)[:, :2].T)
    assert np.median(errors[3:]) < 0.015
    assert errors[-1] < alone[-1] / 3
    assert tracked.located.all()
    assert (np.abs(tracked.poses - ROUND) <= 3 * tracked.deviations)[3:, :2].mean() > 0.9
    again = sonarhw.track(scan, room, "paper", start, model=model, particles=300, seed=2)
    assert np.array_equal(tracked.poses, again.poses)
    table = np.genfromtxt(StringIO(tracked.csv()), delimiter=",", names=True)
    np.testing.assert_allclose(np.column_stack((table["x_m"], table["y_m"])), tracked.poses[:, :2], atol=1e-6)
    assert [row["located"] for row in json.loads(json.dumps(tracked.figures()))["trajectory"]] == [1] * 14


def test_readings_on_the_way_are_one_update_for_each_2_cm_and_each_round(room: Room) -> None:
    """Eight sensors fire one after another while the robot moves by 5 mm from one to the next and turns by 1°."""
    count = 16
    poses = np.column_stack((1 + 0.0049 * np.arange(count), np.ones(count), np.radians(np.arange(count))))
    headings = np.tile(np.arange(8) * math.pi / 4, 2)
    scan = sonarhw.scan_from_arrays(headings, np.linspace(0.9, 1.4, count), pose=poses)
    tracked = sonarhw.track(scan, room, "paper", particles=10, warn=lambda _doubt: None)
    assert [len(angles) for angles, _ in tracked.readings] == [5, 5, 5, 1]
    assert tracked.readings[1][0] == pytest.approx(headings[5:10] + np.radians(np.arange(5)))
    still = sonarhw.scan_from_arrays(headings, np.linspace(0.9, 1.4, count), pose=np.ones((count, 3)))
    tracked = sonarhw.track(still, room, "paper", particles=10, warn=lambda _doubt: None)
    assert [len(angles) for angles, _ in tracked.readings] == [8, 8]


def test_a_robot_that_was_carried_away_is_lost_and_found_again() -> None:
    """The corner is cut, so that no two places are alike. The robot is carried by 0.9 m without its odometry."""
    outline = [[0, 0], [2.2, 0], [2.2, 0.9], [1.2, 0.9], [1.2, 1.7], [0, 1.7]]
    cut = sonarhw.room_from_arrays(outline, places={"start": (0.5, 0.4)})
    way = np.column_stack((np.linspace(0.35, 0.55, 6), np.full(6, 0.4), np.zeros(6)))
    poses = np.vstack(
        (way, way + np.array([1.1, 0.0, 0.0]), way[::-1] + np.array([1.1, 0.05, 0.0]), way + np.array([1.1, 0.05, 0.0]))
    )
    steps = [step_between(a, b) for a, b in pairwise(map(tuple, poses.tolist()))]
    steps[5] = (0.0, 0.0, 0.0)
    stated = [(0.0, 0.0, 0.0)]
    for step in steps:
        stated.append(moved_by(stated[-1], step))
    headings = np.arange(8) * math.pi / 4
    ranges = np.asarray(sonarhw.predict_ranges(cut, poses, headings, "lego-nxt"))
    scan = sonarhw.scan_from_arrays(np.tile(headings, 24), ranges.ravel(), pose=np.repeat(np.array(stated), 8, axis=0))
    tracked = sonarhw.track(scan, cut, "lego-nxt", (0.35, 0.4, 0.0), particles=800, seed=1)
    errors = np.hypot(*(tracked.poses - poses)[:, :2].T)
    assert tracked.located[:6].all()
    assert not tracked.located[10]  # soon after it was carried
    assert tracked.located[-1]
    assert errors[10:][tracked.located[10:]].max() < 0.05
    text = "\n".join(tracked.lines())
    assert re.search(r"lost at .*\nlocated at ", text)


def test_a_scan_without_poses_is_not_tracked(room: Room) -> None:
    with pytest.raises(InputError, match=r"4 readings are without a pose; expected the odometry of a robot"):
        sonarhw.track(sonarhw.scan_from_arrays(HEADINGS, np.ones(4)), room, "paper", (1, 1))


ROWS = "12,90,150,0.5,-1.25,30\n13,270,,0.75,-1,90\n14,0,30,,,\n"
PLACED = [(0.5, -1.25, math.radians(30)), (0.75, -1.0, math.radians(90)), None]


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("t_s,heading_deg,range_cm,x_m,y_m,yaw_deg\n" + ROWS, {}),
        ("t,a,b,u,v,w\n" + ROWS, {"heading": "a", "range": "b", "unit": "cm", "x": "u", "y": "v", "yaw": "w"}),
    ],
    ids=["header", "named columns"],
)
def test_text_states_the_pose_of_each_reading(text: str, options: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "drive.txt").write_text(text)
    readings = sonarhw.import_scan(tmp_path / "drive.txt", sonarhw.ImportOptions(**options)).readings
    assert [reading.pose for reading in readings] == [pose and pytest.approx(pose) for pose in PLACED]
    assert [reading.range for reading in readings] == [pytest.approx(1.5), None, pytest.approx(0.3)]


def test_units_of_a_pose_are_those_of_its_columns(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("deg,range_m,x_cm,y_mm,yaw_rad\n0,1,50,-1250,0.5\n90,1,50,-1250,0.5\n")
    readings = sonarhw.import_scan(tmp_path / "drive.csv").readings
    assert [reading.pose for reading in readings] == [pytest.approx((0.5, -1.25, 0.5))] * 2


def test_an_exported_drive_is_imported_with_its_poses(tmp_path: Path) -> None:
    scan = driven()
    sonarhw.save_scan(scan, tmp_path / "drive.mcap")
    with (tmp_path / "drive.csv").open("wb") as file:
        write_csv(read_log(tmp_path / "drive.mcap"), file, {})
    readings = sonarhw.import_scan(tmp_path / "drive.csv").readings
    assert [reading.pose for reading in readings] == [pytest.approx(one.pose, abs=1e-6) for one in scan.readings]


def test_a_pose_needs_three_columns(tmp_path: Path) -> None:
    (tmp_path / "drive.csv").write_text("deg,m,px\n0,1,2\n")
    with pytest.raises(InputError, match="x=px: expected the columns of x, y and yaw"):
        sonarhw.import_scan(tmp_path / "drive.csv", sonarhw.ImportOptions(heading="deg", range="m", x="px"))
