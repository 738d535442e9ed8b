"""The rule that chooses threshold and aperture: the pair with which a scan was predicted, and ties."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.calibration.room import APERTURES, THRESHOLDS, choose_detection, nearest_good_pair
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading

ROOM, NXT = load_room("rooms/arena.toml"), load_board("lego-nxt")
SPEED = ROOM.air.speed_of_sound
PLACES = [Place("", at) for at in ((0.84, 0.30), (1.80, 0.54), (1.38, 1.68))]


def scans_of(board: Board, places: list[Place] = PLACES) -> list[PlacedScan]:
    headings = np.radians(np.arange(0.0, 360.0, 4.0))
    scans = []
    for place in places:
        ranges = predict_scan(ROOM, place, board, headings).ranges.tolist()
        times = [() if math.isnan(one) else (2 * one / SPEED,) for one in ranges]
        readings = [Reading(k, 0, 0, float(headings[k]), 0.1 * k, times[k], SPEED) for k in range(len(headings))]
        scans.append(PlacedScan(readings, place))
    return scans


@pytest.mark.parametrize(("louder", "wider"), [(4.0, 1.0), (-2.0, 1.1**2), (7.0, 1.1**-2)])
def test_the_rule_finds_the_pair_with_which_scans_were_predicted(louder: float, wider: float) -> None:
    true = replace(NXT, threshold_db=NXT.threshold_db + louder, aperture_radius=NXT.aperture_radius * wider)
    threshold, aperture = choose_detection(scans_of(true), ROOM, NXT, PLACES, 3.0)
    assert threshold is not None
    value, low, high = threshold
    assert value == pytest.approx(true.threshold_db, abs=1.1)
    assert aperture[0] == pytest.approx(true.aperture_radius, rel=0.11)
    assert low <= true.threshold_db <= high


def test_scans_without_silence_do_not_determine_a_threshold() -> None:
    loud = replace(NXT, threshold_db=-40.0)
    threshold, _ = choose_detection(scans_of(loud), ROOM, replace(NXT, threshold_db=-30.0), PLACES, 3.0)
    assert threshold is None


@pytest.mark.parametrize(("error", "expected"), [(0.004, (8, 14)), (0.008, (5, 8)), (0.03, (5, 8))])
def test_the_given_pair_stays_unless_another_is_better_by_more_than_chance(
    error: float, expected: tuple[int, int]
) -> None:
    """A far pair is better by 0.01. The difference from the given one has a standard error of `error`."""
    given = int(np.argmin(np.abs(APERTURES - 1))), int(np.argmin(np.abs(THRESHOLDS)))
    scores = np.full((len(APERTURES), len(THRESHOLDS)), 0.5)
    scores[given], scores[8, 14] = 0.8, 0.81
    drawn = np.repeat(scores[None], 1000, axis=0)
    drawn[:, given[0], given[1]] += np.random.default_rng(0).normal(0.0, error, 1000)
    assert nearest_good_pair(scores, drawn) == expected
    # an error that all pairs share is no reason to stay
    shared = scores + np.random.default_rng(1).normal(0.0, 0.03, (1000, 1, 1))
    assert nearest_good_pair(scores, shared) == (8, 14)
