"""Poses: probabilities of places, doubts, and what is wrong with a table of poses; and a robot that is tracked."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.options import with_options
from sonarhw_compare import locate
from sonarhw_compare.corrections import MIRRORED
from sonarhw_compare.fit.starting import Scores
from sonarhw_compare.track import Tracker, log_likelihood
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Ring, load_board
from sonarhw_sim.room.room import Place, load_room

import sonarhw
from sonarhw import InputError
from sonarhw.readings import FloatArray
from tests.fixtures.predicted_readings import readings_of

ROOM, BOARD = load_room("arena"), load_board("lego-nxt")
SCORES = Scores(np.array([[0.0, 0.0], [1.0, 0.0]]), np.arange(2.0), np.array([[0.0, -1.0], [-2.0, -math.inf]]), 1.0)


def located(*poses: tuple[tuple[float, float], float], readings: int = 0, **more: object) -> locate.Located:
    """Return poses with these positions and probabilities."""
    found = tuple(locate.Pose(position, 0.0, 0.0, share, (0.01, 0.01, 0.01)) for position, share in poses)
    scan = tuple(readings_of(np.zeros(readings), np.full(readings, 0.5)))
    return locate.Located(ROOM, BOARD, scan, found, SCORES, 2.0, 1.0, **more)  # type: ignore[arg-type]


def test_a_place_has_the_share_of_the_poses_within_ten_centimetres() -> None:
    (one, (x, y)), (other, (a, b)) = [(name, place.position) for name, place in ROOM.places.items()][:2]
    found = located(((x + 0.09, y), 0.5), ((x, y - 0.05), 0.1), ((a, b), 0.2), ((x + 0.11, y), 0.2))
    shares = found.places()
    assert (shares[one], shares[other], set(shares)) == (pytest.approx(0.75), pytest.approx(0.25), set(ROOM.places))
    assert [found.place_near(pose) for pose in found.poses] == [one, one, other, None]
    assert set(located(((x + 0.5, y), 1.0)).places().values()) == {0.0}
    # the log-posterior of the lattice sums headings
    second = -2.0 - math.log(1 + math.exp(-1.0))
    assert located().lattice == pytest.approx([0.0, second])


def test_of_poses_that_the_scan_cannot_distinguish_that_at_a_known_place_is_chosen() -> None:
    x, y = ROOM.place("p3").position
    elsewhere = (x + 0.3, y)
    for second, chosen in ((0.4, 1), (0.1, 0)):
        by_room = located((elsewhere, 0.6), ((x, y + 0.05), second), readings=20)
        assert by_room.chosen == by_room.poses[chosen]
    for roughly, chosen in ((0.0, 1), (0.2, 1), (0.6, 0)):  # m from the place that the log states
        stated = Place("place", (elsewhere[0] + roughly, y))
        by_log = located(((0.2, 0.2), 0.5), (elsewhere, 0.4), readings=20, stated=stated)
        assert by_log.chosen == by_log.poses[chosen]


def test_a_scan_that_only_clockwise_angles_put_at_a_known_place_is_doubtful() -> None:
    x, y = ROOM.place("p3").position
    mirrored, twin = (locate.Pose(at, 0.0, 0.0, 0.05, (0.01, 0.01, 0.01)) for at in ((0.2, 0.2), (x, y + 0.02)))
    other = locate.OtherReading(MIRRORED, mirrored, 0.9, (mirrored, twin))
    (doubt,) = located(((x + 0.3, y), 0.9), readings=20, others=(other,)).doubts
    assert f"no pose is within 10 cm of p3 ({x:g}, {y:g} m), but one is with clockwise angles; " in doubt
    assert "add turn=cw" in doubt
    assert located(((x + 0.05, y), 0.9), readings=20, others=(other,)).doubts == ()


@pytest.mark.parametrize(("readings", "doubtful"), [(4, True), (12, True), (14, False)])
def test_a_scan_with_few_independent_readings_is_doubtful(readings: int, doubtful: bool) -> None:
    found = located(readings=readings)
    assert [f"only {readings // 2} independent readings" in doubt for doubt in found.doubts] == [True] * doubtful


@pytest.mark.parametrize(("stated", "turn"), [(175.0, None), (142.0, 40)])
def test_a_heading_that_contradicts_the_stated_one_is_doubtful(stated: float, turn: int | None) -> None:
    pose = locate.Pose((1.0, 1.0), math.radians(-178), 0.0, 1.0, (0.01, 0.01, math.radians(1)))
    place, spread = locate.known_heading(math.radians(stated), math.radians(5))
    scan = tuple(readings_of(np.zeros(20), np.full(20, 0.5)))
    found = locate.Located(ROOM, BOARD, scan, (pose,), SCORES, 1.0, 1.0, "scan", place, spread)
    unlikely = "from --heading, which is unlikely with this --heading-sd; check both"
    expected = [] if turn is None else [f"scan: step 0 of the first pose is {turn}° {unlikely}"]
    assert [with_options(doubt) for doubt in found.doubts] == expected


@pytest.mark.parametrize(
    ("turn", "scale", "named"),
    [(1.0, 1.0, None), (-1.0, 1.0, "with clockwise angles"), (1.0, 0.5, "with 2 times the ranges")],
)
def test_a_scan_that_was_read_wrongly_is_found(turn: float, scale: float, named: str | None) -> None:
    place, angles = ROOM.place("p3"), np.radians(np.arange(0.0, 360.0, 12.0))
    ranges = sonarhw.predict(ROOM, place, BOARD, place.heading + angles).ranges
    found = locate.locate_scan(readings_of(turn * angles, scale * ranges), ROOM, BOARD)
    shares = [pose.probability for pose in (*found.poses, *(other.pose for other in found.others))]
    assert sum(shares) + found.nothing == pytest.approx(1.0, abs=0.01)
    best = found.better_read
    pose = found.poses[0] if best is None else best.pose
    assert math.dist(pose.position, place.position) < 0.02
    assert (None if best is None else best.correction.name) == named
    assert found.fits_room == (named is None)
    assert any("probably read wrongly" in doubt for doubt in found.doubts) == (named is not None)
    assert found.figures()["none"] == round(found.nothing, 6) > 0


def test_fewer_explained_echoes_make_none_of_the_poses_more_probable_and_are_compared_with_usual_ones() -> None:
    shares = [locate.learned().chance_of_nothing(explained) for explained in (1.0, 0.8, 0.6, 0.3)]
    assert shares == sorted(shares)
    assert shares[0] < 0.05 < shares[-1] < 1
    lines = list(replace(located(((1.0, 1.0), 0.7), readings=20), explained=0.5, nothing=0.3).lines())
    assert " 30.0%  none of these" in lines
    assert any("50% of the echoes" in line and "real sensors" in line for line in lines)


# Tables of poses.


LOGS = [Path("folder/a.mcap"), Path("b.mcap")]
FIRST = "a.mcap,1,2,0,,"


def table(folder: Path, *lines: str) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize(
    ("row", "place", "spread"),
    [
        ("b.mcap,3,4,90,0.03,2", Place("b", (3.0, 4.0), math.pi / 2), locate.PoseSpread(0.03, math.radians(2))),
        ("b.mcap,3,4,90,,", Place("b", (3.0, 4.0), math.pi / 2), locate.PoseSpread(0.0, 0.0)),
        ("b.mcap,,,,,", Place("b", (0.0, 0.0)), locate.UNKNOWN),
        ("b.mcap,,,180,,", Place("b", (0.0, 0.0), math.pi), locate.PoseSpread(math.inf, 0.0)),
        ("b.mcap,,,180,,90", Place("b", (0.0, 0.0), math.pi), locate.PoseSpread(math.inf, math.pi / 2)),
        ("b.mcap,1,2,,0.03,", Place("b", (1.0, 2.0)), locate.PoseSpread(0.03, math.inf)),
    ],
)
def test_poses_have_the_order_of_the_logs(tmp_path: Path, row: str, place: Place, spread: locate.PoseSpread) -> None:
    rows = table(tmp_path, locate.HEADER, row, FIRST)
    assert locate.read_poses(rows, LOGS) == [(Place("a", (1.0, 2.0)), locate.PoseSpread(0.0, 0.0)), (place, spread)]
    if math.isinf(max(spread.xy, spread.heading)):
        with pytest.raises(InputError, match=r"b\.mcap: expected position and heading of the first log"):
            locate.read_poses(rows, LOGS[::-1])


def test_three_written_positions_need_no_heading(tmp_path: Path) -> None:
    rows = table(tmp_path, locate.HEADER, *(f"{name}.mcap,{x},2,,0.03," for x, name in enumerate("abc")))
    assert [one.is_whole for _, one in locate.read_poses(rows, [Path(f"{name}.mcap") for name in "abc"])] == [False] * 3


# A robot that is tracked.


LABORATORY, QUICK = sonarhw.load_room("laboratory"), sonarhw.load_board("hc-sr04")
HEADINGS, POSE = np.arange(16) * math.tau / 16, np.array([1.72, 1.23, 0.4])


def measured(poses: FloatArray) -> FloatArray:
    return np.asarray(sonarhw.predict_ranges(LABORATORY, poses, HEADINGS, QUICK))


def likelihood(poses: FloatArray, ranges: FloatArray, headings: FloatArray = HEADINGS, **more: object) -> FloatArray:
    return log_likelihood(LABORATORY, poses, headings, ranges, QUICK, **more)  # type: ignore[arg-type]


def test_the_likelihood_is_highest_at_the_pose_of_the_readings() -> None:
    ranges, sides = measured(POSE[None])[0], (-0.05, 0, 0.05)
    poses = POSE + np.array([[dx, dy, turn] for dx in sides for dy in sides for turn in (-0.1, 0, 0.1)])
    exact, moved = likelihood(poses, ranges), likelihood(poses, ranges, cell=0.02)
    assert exact.argmax() == moved.argmax() == len(poses) // 2
    assert np.median(np.abs(moved - exact)) < 0.2
    turned = likelihood(poses * [1, 1, 180 / math.pi], ranges, np.degrees(HEADINGS), degrees=True)
    assert np.allclose(turned, exact)
    # silence counts, and readings in any order are equal
    assert likelihood(POSE, np.full(16, np.nan))[0] < -16
    order = np.random.default_rng(1).permutation(16)
    assert likelihood(POSE, ranges[order], HEADINGS[order])[0] == pytest.approx(exact[len(poses) // 2])
    assert likelihood(POSE, np.where(np.isnan(ranges), np.inf, ranges))[0] == pytest.approx(exact[len(poses) // 2])


def test_poses_are_as_likely_together_as_alone() -> None:
    poses, ranges = POSE + np.random.default_rng(2).normal(size=(12, 3)) * (0.2, 0.2, 0.1), measured(POSE[None])[0]
    for cell, readings in ((0.1, ranges), (0.0, ranges), (0.0, np.where(ranges > 1.0, np.nan, ranges))):
        alone = [likelihood(pose[None], readings, cell=cell)[0] for pose in poses]
        assert np.allclose(likelihood(poses, readings, cell=cell), alone)


def test_the_nearest_wall_along_the_axis_is_the_mean_of_the_baseline() -> None:
    room = sonarhw.room_from_arrays([[0, 0], [4, 0], [4, 3], [0, 3]])
    tracker = Tracker(room, QUICK, (2.6, 1.5, 0.0), spread=(0.2, 0.01), model=Model.NEAREST, particles=2000, seed=1)
    for _ in range(20):
        found = tracker.update((0.0, 0.0, 0.0), [0.0], [1.2])
    assert found.position[0] == pytest.approx(2.8, abs=0.02)


@pytest.fixture(scope="module")
def box_table() -> sonarhw.RangeTable:
    return sonarhw.range_table(BOX, QUICK, spacing=0.1, step=math.radians(2))


BOX = sonarhw.room_from_arrays([[0, 0], [2, 0], [2, 1.5], [0, 1.5]])


def test_a_table_has_the_distances_of_walls_and_corners(box_table: sonarhw.RangeTable) -> None:
    poses = np.array([[0.83, 0.61, 0.02], [1.27, 0.88, 0.02], [1.02, 0.42, math.pi / 2 + 0.02]])
    ahead = [2 - 0.83, 2 - 1.27, 1.5 - 0.42]
    assert box_table.ranges(poses, [0.0])[:, 0] == pytest.approx(ahead, abs=0.002)
    corner = math.atan2(1.5 - 0.61, 2 - 0.83)
    assert box_table.ranges(poses[:1, :2], [corner])[0, 0] == pytest.approx(math.hypot(2 - 0.83, 1.5 - 0.61), abs=0.002)
    assert box_table.within_5mm > 0.9
    assert np.isnan(box_table.ranges([[5.0, 5.0]], [0.0])).all()


def test_a_table_serves_a_ring_and_an_offset_of_the_board() -> None:
    ring = replace(QUICK, ring=Ring(sensors=2, radius=0.1, interval=0.05), range_offset=0.02)
    table, poses = sonarhw.range_table(BOX, ring, spacing=0.2), np.array([[0.83, 0.61, 0.0], [1.27, 0.88, math.pi]])
    ahead, behind = np.array([2 - 0.83, 1.27]), np.array([0.83, 2 - 1.27])  # of the middle of the ring
    expected = np.column_stack((ahead, behind)) - 0.1 + 0.02
    assert table.ranges(poses) == pytest.approx(expected, abs=0.002)


def test_a_saved_table_is_read_for_its_room_and_board_only(box_table: sonarhw.RangeTable, tmp_path: Path) -> None:
    file = tmp_path / "box.npz"
    box_table.save(file)
    poses, headings = np.random.default_rng(1).uniform(0.1, 1.4, (50, 3)), np.linspace(0, 6, 9)
    again = sonarhw.load_range_table(file, BOX, QUICK)
    assert np.array_equal(again.ranges(poses, headings), box_table.ranges(poses, headings), equal_nan=True)
    with pytest.raises(InputError, match="another room or board"):
        sonarhw.load_range_table(file, BOX, "lego-nxt")
    file.write_bytes(file.read_bytes()[:500])
    with pytest.raises(InputError, match="expected a table"):
        sonarhw.load_range_table(file, BOX, QUICK)
    with pytest.raises(InputError, match="table: expected one of room"):
        Tracker("arena", QUICK, table=box_table)


def test_a_tracker_follows_by_a_table(box_table: sonarhw.RangeTable) -> None:
    tracker = Tracker(BOX, QUICK, (0.5, 0.5, 0.0), particles=300, table=box_table, seed=2)
    for k in range(12):
        pose = np.array([[0.5 + 0.05 * k, 0.5, 0.0]])
        ranges = np.asarray(sonarhw.predict_ranges(BOX, pose, HEADINGS, QUICK))[0]
        found = tracker.update((0.06 if k else 0.0, 0.0, 0.0), HEADINGS, ranges)  # the odometry measures 20 % too much
    assert math.dist(found.position, pose[0, :2]) < 0.03


def test_a_tracker_follows_a_drive_and_repeats_with_its_seed() -> None:
    """The drive is an arc, and the odometry measures 4 % too much."""
    turns = 0.4 + 0.05 * np.arange(10)
    steps = 0.04 * np.column_stack((np.cos(turns), np.sin(turns)))
    poses = np.column_stack((POSE[:2] - (0.3, 0.2) + np.cumsum(steps, axis=0), turns))
    odometry = np.tile([0.04 * 1.04, 0.0, 0.05 * 1.04], (10, 1))
    odometry[0] = 0
    ranges = measured(poses)
    ranges[::3, 5] = 0.3  # stray
    trackers = [Tracker(LABORATORY, QUICK, poses[0], particles=200, seed=4) for _ in range(2)]
    results = [[t.update(step, HEADINGS, row) for step, row in zip(odometry, ranges, strict=True)] for t in trackers]
    assert results[0] == results[1]
    assert max(math.dist(one.position, pose[:2]) for one, pose in zip(results[0], poses, strict=True)) < 0.05
    last = results[0][-1]
    assert abs(math.remainder(last.heading - poses[-1, 2], math.tau)) < math.radians(2)
    assert (any(one.lost for one in results[0]), all(0 < one < 0.1 for one in last.deviations)) == (False, True)
    assert (trackers[0].particles.shape, trackers[0].weights.sum()) == ((200, 3), pytest.approx(1))


def test_a_robot_that_was_carried_away_is_lost_and_wrong_updates_are_refused() -> None:
    tracker = Tracker(LABORATORY, QUICK, POSE, particles=100, cell=0.2)
    elsewhere = measured(np.array([[0.9, 0.5, 2.0]]))[0]
    assert [tracker.update([0, 0, 0], HEADINGS, elsewhere) for _ in range(4)][-1].lost
    for step, headings, ranges, refused in (
        ([0, 0], HEADINGS, np.ones(16), "odometry"),
        ("left", HEADINGS, np.ones(16), "odometry"),
        ([0, 0, 0], "all", np.ones(16), "headings"),
        ([0, 0, 0], HEADINGS, np.ones(3), "ranges"),
    ):
        with pytest.raises(InputError, match=refused):
            tracker.update(step, headings, ranges)
