"""Poses are found in the whole room, with equal probabilities where two poses give the same echoes."""

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_cli.options import with_options
from sonarhw_compare.fit import FitOptions, PlacedScan, fit_scans, free_parameters
from sonarhw_compare.locate import Located, Pose, PoseSpread, _heading_doubts, known_heading, locate_scan
from sonarhw_compare.rooms.evidence import FOLLOWED
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

import sonarhw
from benchmarks.real.judged_scans import DEFAULT_FOLDER, load_scans
from benchmarks.real.real_places import locate_real, true_place
from sonarhw import open_scanner, sector
from sonarhw.readings import Reading
from tests.conftest import Count
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("lego-nxt")
RECTANGLE = polygon_room([(0.0, 0.0), (1.7, 0.0), (1.7, 1.1), (0.0, 1.1)])


def scan_from(room: Room, position: tuple[float, float], heading: float, count: int = 60) -> list[Reading]:
    """Return the predicted readings at a pose, with turntable step 0 along `heading`."""
    angles = np.arange(count) * (math.tau / count)
    ranges = predict_scan(room, Place("", position), BOARD, heading + angles).ranges
    speed = room.air.speed_of_sound
    return [
        Reading(k, 0, 0, float(angle), 0.1 * k, () if math.isnan(distance) else (2 * distance / speed,), speed)
        for k, (angle, distance) in enumerate(zip(angles, ranges.tolist(), strict=True))
    ]


@pytest.fixture(scope="module")
def arena() -> Room:
    return load_room("rooms/arena.toml")


def test_few_readings_give_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "few.mcap"
    # this board hears only loud echoes, so a search is quick
    options = ["--place", "figure9", "--board", "hc-sr04", "--from", "0", "--to", "360", "--step", "90"]
    assert run(["simulate", "simple", *options, "--out", str(log)]) == 0
    capsys.readouterr()
    warning = f"{log}: only 4 independent readings, expected at least 7: a wrong pose may be stated as certain"
    assert run(["locate", str(log)]) == 0
    assert f"sonarhw: warning: {warning}" in capsys.readouterr().err
    with pytest.warns(UserWarning, match=re.escape(warning)) as warned:
        sonarhw.locate(log)
    assert [one.filename for one in warned] == [__file__]


def test_a_pose_is_found_in_the_whole_room(arena: Room) -> None:
    located = locate_scan(scan_from(arena, (0.47, 1.13), math.radians(217)), arena, BOARD)
    best = located.poses[0]
    assert best.probability > 0.9
    assert math.dist(best.position, (0.47, 1.13)) < 0.01
    assert abs(math.remainder(best.heading - math.radians(217), math.tau)) < math.radians(1.5)
    assert located.scores.positions[located.lattice.argmax()] == pytest.approx((0.47, 1.13), abs=0.08)


def test_a_room_without_the_walls_of_a_place_keeps_its_pose_as_an_improbable_peak(arena: Room) -> None:
    # p4 is in an arm of which these walls lack both sides, so another arm explains more of its scan
    corners = [(0.0, 1.0), (0.0, 0.0), (2.1, 0.0), (2.1, 0.84), (1.68, 0.84)]
    north = '[[walls]]\nname = "north"\npoints = [[1.3, 2.1], [1.68, 2.1]]\nmaterial = "hard"'
    part = polygon_room(corners, closed=False, extra=north)
    scan = scan_from(arena, arena.places["p4"].position, 0.0)
    heading = PoseSpread(math.inf, math.radians(5))
    located = locate_scan(scan, part, BOARD, prediction=FOLLOWED, expected=Place("", (0.0, 0.0)), spread=heading)
    true = arena.places["p4"].position
    assert min(math.dist(pose.position, true) for pose in located.poses) > 1.0
    assert min(math.dist(peak[:2], true) for peak in located.peaks) < 0.12


@pytest.fixture(scope="module")
def in_rectangle() -> list[Reading]:
    return scan_from(RECTANGLE, (0.5, 0.4), 0.3)


@pytest.fixture(scope="module")
def located(in_rectangle: list[Reading]) -> Located:
    return locate_scan(in_rectangle, RECTANGLE, BOARD)


def test_a_rectangle_has_two_equally_probable_poses(located: Located) -> None:
    one, other = located.poses[:2]
    assert one.probability + other.probability > 0.99
    assert one.probability == pytest.approx(0.5, abs=0.1)
    assert np.add(one.position, other.position) == pytest.approx((1.7, 1.1), abs=0.02)
    assert abs(math.remainder(one.heading - other.heading, math.tau)) == pytest.approx(math.pi, abs=0.03)
    assert located.places() == {}


@pytest.mark.parametrize("spread", [PoseSpread(heading=math.pi / 2, xy=math.inf), PoseSpread(0.3808, math.inf)])
def test_a_rough_heading_or_position_decides_between_two_poses_by_its_own_likelihood(
    in_rectangle: list[Reading], spread: PoseSpread
) -> None:
    # the other pose is half a turn and 0.7616 m away: two deviations
    expected = Place("", (0.5, 0.4), 0.3 - math.tau)
    best = locate_scan(in_rectangle, RECTANGLE, BOARD, expected=expected, spread=spread).poses[0]
    assert best.probability == pytest.approx(1 / (1 + math.exp(-2.0)), abs=0.06)
    assert math.dist(best.position, expected.position) < 0.01


def test_an_exact_heading_is_kept(in_rectangle: list[Reading]) -> None:
    there = Place("", (1.2, 0.7), 0.3 + math.pi)
    (pose,) = locate_scan(in_rectangle, RECTANGLE, BOARD, expected=there, spread=PoseSpread(math.inf, 0.0)).poses
    assert math.dist(pose.position, there.position) < 0.02
    assert abs(math.remainder(pose.heading - there.heading, math.tau)) < math.radians(0.3)
    assert pose.deviations[2] < math.radians(0.16)


def test_locate_and_fit_find_the_same_pose(arena: Room) -> None:
    # rough refinement alone ends 1.8 deviations away
    board = load_board("hc-sr04")
    with open_scanner("fake:arena?place=p3&board=hc-sr04&seed=1&pace=max") as scanner:
        readings = list(scanner.scan(sector(0, 360, 5)))
    best = locate_scan(readings, arena, board).poses[0]
    free = free_parameters(("position", "heading", "offset"), [""], arena, board)
    here = PlacedScan(readings, arena.places["p3"])
    options = FitOptions(samples=0, global_search=False, exact=True)
    found = fit_scans([here], arena, board, free, options=options).estimates
    for name, value in (("x", best.position[0]), ("y", best.position[1]), ("heading", best.heading)):
        assert abs(value - found[name].value) < 0.7 * found[name].deviation


def test_repeated_readings_add_no_evidence(in_rectangle: list[Reading], located: Located) -> None:
    thrice = locate_scan([one for one in in_rectangle for _ in range(3)], RECTANGLE, BOARD)
    assert located.poses[1].probability > 0.1
    assert thrice.redundancy == pytest.approx(3 * located.redundancy)
    assert thrice.poses[0].probability == pytest.approx(located.poses[0].probability, abs=0.1)


@pytest.mark.skipif(not Path(DEFAULT_FOLDER).is_dir(), reason="the real scans are not here")
def test_real_scans_are_located_in_a_nearly_symmetric_arena(count: Count) -> None:
    scans = load_scans(DEFAULT_FOLDER)[count(1, 0) :: count(9, 1)]
    right = 0
    for scan in scans:
        located = locate_real(scan)
        shares = located.places()
        right += max(shares, key=shares.__getitem__) == true_place(scan)
        # the true position is always among the poses
        assert any(math.dist(pose.position, (scan.x, scan.y)) < 0.05 for pose in located.poses)
    assert right >= len(scans) - count(0, 1)


def test_the_command_writes_poses_as_json_and_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, picture = tmp_path / "scan.mcap", tmp_path / "located.png"
    command = ["simulate", "rooms/arena.toml", "--place", "p3", "--board", "lego-nxt", "--out", str(log)]
    assert run(command) == 0
    known = ["--heading", "0", "--heading-sd", "0.1"]
    assert run(["locate", str(log), *known, "--out", str(picture), "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["poses"][0]["heading_deviation_deg"] < 0.16
    assert printed["place"] == "p3"
    assert printed["fits_room"]
    assert printed["explained"] > 0.95
    best = printed["poses"][0]
    assert math.dist((best["x_m"], best["y_m"]), (1.38, 0.54)) < 0.02
    assert best["place"] == "p3"
    assert sum(pose["probability"] for pose in printed["poses"]) == pytest.approx(1, abs=0.02)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert run(["locate", str(log), "--out", str(picture)]) == 2
    assert "--force" in capsys.readouterr().err


def test_the_printed_command_compares_at_the_pose_of_a_turned_mount(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # the turntable's zero of this sensor is at −10.2°
    log, board = str(tmp_path / "scan of today.mcap"), "examples/lego_nxt_m.toml"
    assert run(["simulate", "arena", "--place", "0.5,1.4,70", "--board", board, "--step", "6", "--out", log]) == 0
    assert run(["locate", log]) == 0
    (command,) = re.findall(r"^next: sonarhw (compare .*)$", capsys.readouterr().err, re.M)
    assert run([*shlex.split(command), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["within_5cm"] > 0.95


def test_a_scan_of_another_room_gives_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "scan.mcap"
    scan = ["simulate", "rooms/arena.toml", "--place", "p3", "--board", "lego-nxt", "--step", "12", "--out", str(log)]
    assert run(scan) == 0
    capsys.readouterr()
    assert run(["locate", str(log), "--room", "rooms/simple.toml", "--json"]) == 0
    printed = capsys.readouterr()
    assert not json.loads(printed.out)["fits_room"]
    assert re.search(
        rf"^sonarhw: warning: {log}: only \d+% of \d+ echoes .*; check the room and the board$", printed.err
    )
    assert run(["locate", str(log)]) == 0
    printed, warned = capsys.readouterr()
    assert "warning" not in warned
    assert "; p3\n" in printed
    assert printed.splitlines()[-1].startswith("assuming one of the room's places: p3 ")


def test_a_heading_that_contradicts_the_stated_one_gives_a_warning() -> None:
    pose = Pose((1.0, 1.0), math.radians(-178), 0.0, 1.0, (0.01, 0.01, math.radians(1)))
    assert _heading_doubts(pose, *known_heading(math.radians(175), math.radians(5))) == ()
    (doubt,) = _heading_doubts(pose, *known_heading(math.radians(142), math.radians(5)))
    assert with_options(doubt) == (
        "step 0 of the first pose is 40° from --heading, which is unlikely with this --heading-sd; check both"
    )


def test_an_undetermined_heading_has_no_deviation() -> None:
    figures = Pose((1.0, 1.0), 0.5, 0.0, 1.0, (0.01, 0.01, math.radians(400))).figures(None)
    assert figures["heading_deviation_deg"] is None
    assert json.loads(json.dumps(figures))["heading_deg"] == pytest.approx(math.degrees(0.5), abs=1e-5)


def test_a_located_pose_has_a_heading_near_that_of_its_place_and_no_negative_zero() -> None:
    pose = Pose((-1e-9, -1e-9), math.radians(-0.1), -1e-9, 1.0, (0.01, 0.01, 0.01))
    for heading, expected in ((0.0, -0.1), (math.radians(270), 359.9)):
        figures = pose.figures(Place("p", (0.0, 0.0), heading))
        assert figures["heading_deg"] == pytest.approx(expected)
        assert "-0.0," not in json.dumps(figures)
