"""Poses are found in the whole room, with equal probabilities where two poses give the same echoes."""

import json
import math
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_compare.fit import FitOptions, PlacedScan, fit_scans, free_parameters
from sonarhw_compare.locate import Located, PoseSpread, locate_scan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, Room, load_room

import sonarhw
from benchmarks.real.judged_scans import DEFAULT_FOLDER, load_scans
from benchmarks.real.real_places import locate_real, true_place
from sonarhw.readings import Reading
from tests.conftest import Count
from tests.fixtures.predicted_readings import predicted_readings
from tests.fixtures.rooms_for_tests import polygon_room

BOARD, QUICK = load_board("lego-nxt"), load_board("hc-sr04")  # the second hears only loud echoes, so searches are quick
RECTANGLE = polygon_room([(0.0, 0.0), (1.7, 0.0), (1.7, 1.1), (0.0, 1.1)])


def scan_from(room: Room, position: tuple[float, float], heading: float) -> list[Reading]:
    return predicted_readings(room, Place("", position, heading), BOARD, 6.0)


def test_few_readings_give_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "few.mcap"
    options = ["--place", "figure9", "--board", "hc-sr04", "--from", "0", "--to", "360", "--step", "90"]
    assert run(["simulate", "simple", *options, "--out", str(log)]) == 0
    capsys.readouterr()
    warning = f"{log}: only 4 independent readings, expected at least 7: a wrong pose may be stated as certain"
    assert run(["locate", str(log), "--heading", "0", "--heading-sd", "1"]) == 0  # a known heading makes it quick
    assert f"sonarhw: warning: {warning}" in capsys.readouterr().err
    with pytest.warns(UserWarning, match=re.escape(warning)) as warned:
        sonarhw.locate(log, heading=0.0, heading_deviation=0.02)
    assert [one.filename for one in warned] == [__file__]


@pytest.fixture(scope="module")
def in_rectangle() -> list[Reading]:
    return scan_from(RECTANGLE, (0.5, 0.4), 0.3)


@pytest.fixture(scope="module")
def located(in_rectangle: list[Reading]) -> Located:
    return locate_scan(in_rectangle, RECTANGLE, BOARD, rightly=True)


def test_a_rectangle_has_two_equally_probable_poses(in_rectangle: list[Reading], located: Located) -> None:
    one, other = located.poses[:2]
    assert one.probability + other.probability > 0.99
    assert one.probability == pytest.approx(0.5, abs=0.1)
    assert np.add(one.position, other.position) == pytest.approx((1.7, 1.1), abs=0.02)
    assert abs(math.remainder(one.heading - other.heading, math.tau)) == pytest.approx(math.pi, abs=0.03)
    assert located.places() == {}
    thrice = locate_scan([reading for reading in in_rectangle for _ in range(3)], RECTANGLE, BOARD, rightly=True)
    assert thrice.redundancy == pytest.approx(3 * located.redundancy)
    assert thrice.poses[0].probability == pytest.approx(one.probability, abs=0.2)  # the curvature is rough


@pytest.mark.parametrize("spread", [PoseSpread(heading=math.pi / 2, xy=math.inf), PoseSpread(0.3808, math.inf)])
def test_a_rough_heading_or_position_decides_between_two_poses(in_rectangle: list[Reading], spread: PoseSpread) -> None:
    # the other pose is half a turn and 0.7616 m away: two deviations
    expected = Place("", (0.5, 0.4), 0.3 - math.tau)
    best = locate_scan(in_rectangle, RECTANGLE, BOARD, expected=expected, spread=spread, rightly=True).poses[0]
    assert best.probability == pytest.approx(1 / (1 + math.exp(-2.0)), abs=0.1)
    assert math.dist(best.position, expected.position) < 0.01


def test_an_exact_heading_is_kept(in_rectangle: list[Reading]) -> None:
    there = Place("", (1.2, 0.7), 0.3 + math.pi)
    (pose,) = locate_scan(in_rectangle, RECTANGLE, BOARD, expected=there, spread=PoseSpread(math.inf, 0.0)).poses
    assert math.dist(pose.position, there.position) < 0.02
    assert abs(math.remainder(pose.heading - there.heading, math.tau)) < math.radians(0.3)
    assert pose.deviations[2] < math.radians(0.16)


def test_locate_finds_the_pose_that_a_fit_finds() -> None:
    # rough refinement alone ends 1.8 deviations away
    arena = load_room("arena")
    with sonarhw.open_scanner("fake:arena?place=p3&board=hc-sr04&seed=1&pace=max") as scanner:
        readings = list(scanner.scan(sonarhw.sector(0, 360, 8)))
    best = locate_scan(readings, arena, QUICK).poses[0]
    assert best.probability > 0.9
    free = free_parameters(("position", "heading", "offset"), [""], arena, QUICK)
    options = FitOptions(samples=0, global_search=False, exact=True)
    found = fit_scans([PlacedScan(readings, arena.places["p3"])], arena, QUICK, free, options=options).estimates
    for name, value in (("x", best.position[0]), ("y", best.position[1]), ("heading", best.heading)):
        assert abs(value - found[name].value) < 0.7 * found[name].deviation


@pytest.mark.skipif(not Path(DEFAULT_FOLDER).is_dir(), reason="the real scans are not here")
def test_real_scans_are_located_in_a_nearly_symmetric_arena(count: Count) -> None:
    scans = load_scans(DEFAULT_FOLDER)[count(1, 0) :: count(9, 1)]
    right = 0
    for scan in scans:
        found = locate_real(scan)
        shares = found.places()
        right += max(shares, key=shares.__getitem__) == true_place(scan)
        # the true position is always among the poses
        assert any(math.dist(pose.position, (scan.x, scan.y)) < 0.05 for pose in found.poses)
    assert right >= len(scans) - count(0, 1)


def test_the_command_writes_poses_and_names_compare(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # the turntable's zero of this sensor is at −10.2°
    log, picture = tmp_path / "scan of today.mcap", tmp_path / "located.png"
    scan = ["simulate", "arena", "--place", "0.47,1.13,70", "--board", "examples/lego_nxt_m.toml", "--step", "6"]
    assert run([*scan, "--out", str(log)]) == 0
    assert run(["locate", str(log), "--out", str(picture), "--json"]) == 0
    printed = capsys.readouterr()
    figures, (command,) = json.loads(printed.out), re.findall(r"^next: sonarhw (compare .*)$", printed.err, re.M)
    best = figures["poses"][0]
    assert (figures["fits_room"], best["place"], best["probability"] > 0.9) == (True, None, True)
    assert math.dist((best["x_m"], best["y_m"]), (0.47, 1.13)) < 0.02
    explanations = [*figures["poses"], *figures["other_readings"]]
    assert sum(one["probability"] for one in explanations) + figures["none"] == pytest.approx(1, abs=0.01)
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert run([*shlex.split(command), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["within_5cm"] > 0.95
    assert run(["locate", str(log), "--out", str(picture)]) == 2
    assert "--force" in capsys.readouterr().err


def test_the_named_command_fits_a_range_offset(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    board, log = tmp_path / "late.toml", tmp_path / "scan.mcap"
    board.write_text("range_offset = 0.02\n" + load_board("lego-nxt").text)
    scan = ["simulate", "arena", "--place", "1.2,0.6,265", "--board", str(board), "--step", "6"]
    assert run([*scan, "--out", str(log)]) == 0
    capsys.readouterr()
    assert run(["locate", str(log), "--board", "lego-nxt"]) == 0
    printed = capsys.readouterr()
    assert re.search(r"turntable step 0 at -9\d\.", printed.out)
    (command,) = re.findall(r"^next: sonarhw (compare .*)$", printed.err, re.M)
    assert command.endswith(" --fit offset")
    assert run(shlex.split(command)) == 0
    assert re.search(r"turntable step 0 at -9\d\.\d°, range offset -20 mm", capsys.readouterr().out)


def test_a_scan_of_another_room_gives_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "scan.mcap"
    scan = ["simulate", "rooms/arena.toml", "--place", "p3", "--board", "lego-nxt", "--step", "12", "--out", str(log)]
    assert run(scan) == 0
    capsys.readouterr()
    assert run(["locate", str(log), "--room", "rooms/simple.toml", "--json"]) == 0
    printed = capsys.readouterr()
    assert not json.loads(printed.out)["fits_room"]
    few = rf"^sonarhw: warning: {log}: only \d+% of \d+ echoes .*; check the room and the board$"
    assert re.search(few, printed.err)
    assert run(["locate", str(log)]) == 0
    printed = capsys.readouterr()
    assert "warning" not in printed.err
    assert "; p3\n" in printed.out
    assert printed.out.splitlines()[-1].startswith("assuming one of the room's places: p3 ")
