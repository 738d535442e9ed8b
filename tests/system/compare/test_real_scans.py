"""`lego-nxt` explains the nine real scans of a known room better than simpler models do. It was tuned on them."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sonarhw_compare.calibration.room as calibration
from sonarhw_compare.calibration.outcome import Measured
from sonarhw_compare.calibration.room import RoomCalibration, TurntableFit
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.fit.starting import fit_scan
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place

from benchmarks.real.judged_scans import (
    DEFAULT_FOLDER,
    NEARBY,
    ON_THE_SPOT,
    ROOM,
    Figures,
    RealScan,
    echoes_of_the_robot,
    figures_of,
    judge,
    judged_of,
    load_scans,
    repeated,
)
from benchmarks.real.tune_lego_nxt import PROFILE, fingerprint_of, judge_all, known_paths
from sonarhw.readings import FloatArray, Reading

BOARD = load_board("lego-nxt")
here = pytest.mark.skipif(not Path(DEFAULT_FOLDER).is_dir(), reason="the real scans are not here")


@pytest.fixture(scope="module")
def scans() -> list[RealScan]:
    return load_scans(DEFAULT_FOLDER)


def figures(scans: Sequence[RealScan], model: Model, free: frozenset[str], board: Board = BOARD) -> Figures:
    return figures_of([judged_of(judge(scan, model, board, free)) for scan in scans])


def test_reading_scans_prints_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scans.csv").write_text("scan,x_m,y_m,turn,n\nA,0.5,0.25,cw,2\n")
    (tmp_path / "A.csv").write_text("turret_deg,range_cm\n0,50\n3,255\n")
    (scan,) = load_scans(tmp_path)
    assert [reading.range is None for reading in scan.readings] == [False, True]
    assert capsys.readouterr() == ("", "")


@here
def test_one_profile_explains_echoes_and_silence(scans: list[RealScan]) -> None:
    found = figures(scans, Model.RAY_FOLLOWING, NEARBY)
    assert len(scans) == 9
    assert found.share >= 0.85
    assert found.roc_area >= 0.90
    assert found.agreement >= 0.65


@here
def test_ray_following_explains_more_than_walls_and_cones(scans: list[RealScan]) -> None:
    nearest, cone, followed = (
        figures(scans, model, ON_THE_SPOT).share for model in (Model.NEAREST, Model.CONE, Model.RAY_FOLLOWING)
    )
    assert 0.63 < nearest < 0.70
    assert 0.66 < cone < 0.72
    assert followed > cone + 0.13


@here
def test_a_constant_gain_explains_silence(scans: list[RealScan]) -> None:
    ideal = replace(BOARD, fixed_gain=False)
    assert figures(scans, Model.RAY_FOLLOWING, ON_THE_SPOT, ideal).roc_area < 0.80
    assert figures(scans, Model.RAY_FOLLOWING, ON_THE_SPOT).roc_area > 0.85


@here
def test_the_profile_states_its_accuracy(scans: list[RealScan]) -> None:
    found = judge_all(scans, BOARD, known_paths(scans, BOARD))
    pooled = figures_of([found[scan.name] for scan in scans])
    figures_line = next(line for line in PROFILE.read_text().splitlines() if line.startswith("# all scans"))
    assert [float(word) for word in figures_line.split()[3:]] == pytest.approx(
        [pooled.share, pooled.roc_area, pooled.agreement], abs=0.006
    )
    assert fingerprint_of(DEFAULT_FOLDER) in PROFILE.read_text()


def recorded(name: str, x: float, ranges: FloatArray) -> RealScan:
    readings = (Reading(i, 0, 0, 0.1 * i, float(i), (2 * r / 340.0,), 340.0) for i, r in enumerate(ranges.tolist()))
    return RealScan(name, x, 0.0, tuple(readings))


def test_echoes_of_the_robot_appear_at_every_place() -> None:
    scans = []
    for k in range(5):
        ranges = 0.5 + 0.2 * k + 0.01 * np.arange(20.0)
        ranges[10:13] = 0.22 + 0.01 * k / 5
        scans.append(recorded(f"s{k}", float(k), ranges))
    assert echoes_of_the_robot(scans) == {(f"s{k}", row) for k in range(5) for row in (10, 11, 12)}


def test_recordings_of_one_place_are_compared_rotated_and_shifted() -> None:
    ranges = 1.0 + 0.2 * (np.arange(20.0) ** 2 % 7)
    turned = np.roll(ranges, 5) + 0.03
    turned[:2] = 9.0
    elsewhere = np.full(20, 5.0)
    spots = ((0.0, ranges), (1.0, elsewhere), (0.0, turned))
    scans = [recorded(f"s{k}", x, ranges_of_spot) for k, (x, ranges_of_spot) in enumerate(spots)]
    assert repeated(scans) == (0.9, 0.9)


@here
@pytest.mark.parametrize("left_out", [(0.84, 0.30), (1.80, 0.54)])
def test_the_carrier_is_found_without_any_one_place(scans: list[RealScan], left_out: tuple[float, float]) -> None:
    # three of four places are 30 cm from a wall, and the carrier's echoes are 22 cm away
    kept = [scan for scan in scans if scan.sensor == "A" and (scan.x, scan.y) != left_out]
    fits = [fit_scan(scan.readings, ROOM, ROOM.place(scan.spot), BOARD, NEARBY) for scan in kept]
    placed = [PlacedScan(scan.readings, Place(scan.name, (scan.x, scan.y)), scan.name) for scan in kept]
    places = tuple(fit.place for fit in fits)
    result = RoomCalibration(BOARD, BOARD, scans=placed, given=ROOM, room=ROOM)
    calibration._find_own_body(result, TurntableFit({"turntable_scale": Measured(1.0, 0.01)}, places))
    assert [part.spans(math.radians(degrees)) for part in result.own_body for degrees in (93, 216)] == [
        True,
        False,
        False,
        True,
    ]
