"""`lego-nxt` explains the nine real scans of a known room better than simpler models do. It was tuned on them."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, load_board

from benchmarks.real import judged_scans
from benchmarks.real.tune_lego_nxt import PROFILE, fingerprint_of, judge_all, known_paths

BOARD = load_board("lego-nxt")


here = pytest.mark.skipif(not Path(judged_scans.DEFAULT_FOLDER).is_dir(), reason="the real scans are not here")


@pytest.fixture(scope="module")
def scans() -> list[judged_scans.RealScan]:
    return judged_scans.load_scans(judged_scans.DEFAULT_FOLDER)


def figures(
    scans: Sequence[judged_scans.RealScan], model: Model, free: frozenset[str], board: Board = BOARD
) -> judged_scans.Figures:
    return judged_scans.figures_of(
        [judged_scans.judged_of(judged_scans.judge(scan, model, board, free)) for scan in scans]
    )


@here
def test_one_profile_explains_echoes_and_silence(scans: list[judged_scans.RealScan]) -> None:
    found = figures(scans, Model.RAY_FOLLOWING, judged_scans.NEARBY)
    assert len(scans) == 9
    assert found.share >= 0.85
    assert found.roc_area >= 0.90
    assert found.agreement >= 0.65


@here
def test_ray_following_explains_more_than_walls_and_cones(scans: list[judged_scans.RealScan]) -> None:
    nearest, cone, followed = (
        figures(scans, model, judged_scans.ON_THE_SPOT).share
        for model in (Model.NEAREST, Model.CONE, Model.RAY_FOLLOWING)
    )
    assert 0.63 < nearest < 0.70
    assert 0.66 < cone < 0.72
    assert followed > cone + 0.13


@here
def test_a_constant_gain_explains_silence(scans: list[judged_scans.RealScan]) -> None:
    ideal = replace(BOARD, fixed_gain=False)
    assert figures(scans, Model.RAY_FOLLOWING, judged_scans.ON_THE_SPOT, ideal).roc_area < 0.80
    assert figures(scans, Model.RAY_FOLLOWING, judged_scans.ON_THE_SPOT).roc_area > 0.85


@here
def test_the_profile_states_its_accuracy(scans: list[judged_scans.RealScan]) -> None:
    found = judge_all(scans, BOARD, known_paths(scans, BOARD))
    pooled = judged_scans.figures_of([found[scan.name] for scan in scans])
    figures_line = next(line for line in PROFILE.read_text().splitlines() if line.startswith("# all scans"))
    assert [float(word) for word in figures_line.split()[3:]] == pytest.approx(
        [pooled.share, pooled.roc_area, pooled.agreement], abs=0.006
    )
    assert fingerprint_of(judged_scans.DEFAULT_FOLDER) in PROFILE.read_text()
