"""The rough search for a pose: its lattice, its likelihood in closed form, and the maxima that it passes on."""

import math

import numpy as np
import pytest
from sonarhw_compare.fit.likelihood import ScanArrays
from sonarhw_compare.fit.starting import HEADINGS, Scores, _chosen, best_apart, lattice, local_maxima, score_positions
from sonarhw_sim.board.profile import load_board

from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("lego-nxt")
ROOM = polygon_room([(0.0, 0.0), (1.7, 0.0), (1.7, 1.1), (0.0, 1.1)])
HERE = np.array([[0.5, 0.4]])
BIN = math.tau / HEADINGS


def scores(bearings: list[float], ranges: list[float], spacing: float = 0.06) -> FloatArray:
    """Return the log-likelihoods of readings at HERE by heading."""
    first = np.array(ranges)[:, None]
    counts = np.isfinite(first[:, 0]).astype(np.int64)
    scan = ScanArrays(np.array(bearings), first, counts, counts == 1)
    return score_positions(scan, ROOM, BOARD, HERE, spacing).scores[0]


@pytest.mark.parametrize(("width", "height"), [(6.0, 4.0), (4.0, 6.0), (30.0, 0.5)])
def test_the_lattice_fills_its_rectangle_with_about_six_hundred_positions(width: float, height: float) -> None:
    positions, spacing = lattice((1.0, -2.0), (1.0 + width, -2.0 + height))
    assert 550 < len(positions) < 800
    xs, ys = (np.unique(positions[:, k]) for k in range(2))
    for values, low, side in ((xs, 1.0, width), (ys, -2.0, height)):
        # the middles of equal parts of each side, at most a spacing wide
        part = side / len(values)
        assert part <= spacing * (1 + 1e-9)
        np.testing.assert_allclose(values, low + part * (np.arange(len(values)) + 0.5))
    assert len(positions) == len(xs) * len(ys)


def test_the_lattice_is_not_finer_than_six_centimetres_and_may_be_a_point_or_a_line() -> None:
    assert lattice((0.0, 0.0), (0.6, 0.3))[1] == 0.06
    assert len(lattice((0.0, 0.0), (0.6, 0.3))[0]) == 50
    assert lattice((1.0, 2.0), (1.0, 2.0))[0].tolist() == [[1.0, 2.0]]
    assert 500 < len(lattice((0.0, 2.0), (60.0, 2.0))[0]) < 700


def test_a_matching_range_is_certain_and_a_wrong_one_is_improbable_but_possible() -> None:
    towards_wall = round(math.pi / BIN)  # at heading π, the wall x = 0 is 0.5 m ahead
    assert scores([0.0], [0.5])[towards_wall] == pytest.approx(math.log(1.05), abs=0.01)
    assert scores([0.0], [1.4])[towards_wall] == pytest.approx(math.log(0.05), abs=0.1)
    # no echo at all where one is certain, after the wrong range that sets the limit of the search
    assert scores([0.0, 0.0], [1.4, math.nan])[towards_wall] == pytest.approx(2 * math.log(0.05), abs=0.2)
    # half of the likelihood at an error of 0.7 spacings
    assert scores([0.0], [0.5 + 0.7 * 0.2], spacing=0.2)[towards_wall] == pytest.approx(math.log(0.55), abs=0.02)


def test_readings_add_up_and_a_turned_scan_shifts_along_the_headings() -> None:
    far = ([0.0], [1.4])  # sets the limit of the search
    both = scores([0.0, 0.0, 25 * BIN], [1.4, 0.5, 0.7])
    apart = scores([0.0, 0.0], [1.4, 0.5]) + scores([0.0, 25 * BIN], [1.4, 0.7]) - scores(*far)
    np.testing.assert_allclose(both, apart)
    np.testing.assert_allclose(scores([10 * BIN, 10 * BIN, 35 * BIN], [1.4, 0.5, 0.7]), np.roll(both, -10))


def test_a_position_without_any_path_is_impossible() -> None:
    scan = ScanArrays(np.zeros(1), np.full((1, 1), 0.5), np.ones(1, np.int64), np.ones(1, bool))
    ticks: list[None] = []
    positions = np.array([[900.0, 900.0], [0.5, 0.4]])
    far, near = score_positions(scan, ROOM, BOARD, positions, 0.06, tick=lambda: ticks.append(None)).scores
    assert (far == -math.inf).all()
    assert np.isfinite(near).all()
    assert len(ticks) == 2


def test_chosen_poses_are_the_best_poses_that_differ_in_position_or_heading() -> None:
    positions = np.array([[0.0, 0.0], [0.2, 0.0], [0.3, 0.0]])
    headings = np.radians([0.0, 14.0, 16.0, 350.0])
    table = np.full((3, 4), -math.inf)
    table[0] = [0.0, -1.0, -2.0, -3.0]  # 14° and -10° are too near to the best
    table[1, 0] = -4.0  # 2 spacings away
    table[2, 0] = -5.0  # 3 spacings away
    found = best_apart(Scores(positions, headings, table, 0.1), 5)
    assert found == [(0.0, 0.0, 0.0), (0.0, 0.0, headings[2]), (0.3, 0.0, 0.0)]
    assert best_apart(Scores(positions, headings, table, 0.1), 2) == found[:2]


def test_local_maxima_are_not_beside_better_poses_and_not_hopeless() -> None:
    positions = np.array([[0.0, 0.0], [0.2, 0.0], [0.4, 0.0], [1.0, 0.0]])
    headings = np.radians(np.arange(0.0, 360.0, 10.0))
    table = np.full((4, 36), -90.0)
    table[0, 35] = 0.0
    table[0, 3] = -1.0  # 40° from the best
    table[0, 4] = -3.0  # 50° from the best, but 10° from a better one
    table[0, 20] = -2.0
    table[1, 1] = -4.0  # 2 spacings and 20° from the best
    table[2, 2] = -7.0  # 4 spacings from the best, 2 from a better one
    table[3, 0], table[3, 10] = -5.0, -61.0
    scores = Scores(positions, headings, table, 0.1)
    found = local_maxima(scores, 5, 60.0)
    assert found == [(0.0, 0.0, headings[35]), (0.0, 0.0, headings[20]), (1.0, 0.0, 0.0)]
    assert local_maxima(scores, 2, 60.0) == found[:2]
    assert len(local_maxima(scores, 5, 62.0)) == 4


@pytest.mark.parametrize("seed", range(5))
def test_which_of_equal_poses_come_first_does_not_depend_on_rounding(seed: int) -> None:
    """Four poses of a symmetric room have the same score, but for its last digits."""
    positions = np.array([(x, y) for x in range(4) for y in range(4)], dtype=np.float64)
    equal = np.zeros((16, HEADINGS))
    equal[[5, 6, 9, 10], [0, 45, 90, 135]] = 3.0
    headings = np.arange(HEADINGS) * (math.tau / HEADINGS)
    noise = 1e-12 * np.random.default_rng(seed).uniform(-1, 1, equal.shape)
    exact, noisy = (Scores(positions, headings, scores, 0.3) for scores in (equal, equal + noise))
    assert best_apart(noisy, 6) == best_apart(exact, 6)
    assert local_maxima(noisy, 4, 1.0) == local_maxima(exact, 4, 1.0)
    counts, means = np.full((2, 3, 1), 7.0), np.full((2, 3, 1), 0.01)
    by = 1e-15 * np.random.default_rng(seed).uniform(-1, 1, means.shape)
    assert _chosen(counts, means + by, np.zeros(1), 10) == (0, 0, 0)
