"""Log score and calibration of predicted probabilities: closed forms, and readings drawn from the prediction."""

import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from sonarhw_compare.match import Comparison, compare_readings, match_readings
from sonarhw_compare.score import calibration, score_comparison
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes
from sonarhw_sim.room.room import Place, parse_room

from sonarhw.readings import Origin, Ping, Reading

PHI = NormalDist().cdf
HERE = Place("here", (0.0, 0.0))
WALL = parse_room(
    'name = "wall"\n[materials.hard]\nreflectance = 0.9\n'
    '[[walls]]\nname = "w"\npoints = [[1.5, -1.0], [1.5, 1.0]]\nmaterial = "hard"\n',
    "wall",
)
LEVEL = 20 * math.log10(0.9)  # dB, of the wall straight ahead


def board(**values: float) -> Board:
    return replace(load_board("paper"), **values)


def reading(distance: float | None, number: int = 0, angle: float = 0.0) -> Reading:
    times = () if distance is None else (2 * distance / WALL.air.speed_of_sound,)
    return Reading(number, 0, 0, angle, float(number), times, WALL.air.speed_of_sound, None, origin=Origin.SIMULATED)


def compared(which: Board, *ranges: float | None) -> Comparison:
    return compare_readings([reading(one, k) for k, one in enumerate(ranges)], WALL, HERE, which)


def test_log_score_of_one_wall_and_a_normal_threshold() -> None:
    which, heard = board(threshold_db=LEVEL + 1.0, threshold_sd_db=2.0, range_sd=0.004), PHI(-0.5)
    spread = math.hypot(0.004, 0.005)
    at = 0.99 * heard * (PHI(0.008 / spread) - PHI(-0.002 / spread)) + 0.01 * 0.01 / (2 * which.max_range)
    silent = 0.99 * (1 - heard) + 0.005
    for measured, probability in ((1.503, at), (None, silent), (0.7, 0.01 * 0.01 / (2 * which.max_range))):
        score = score_comparison(compared(which, measured))
        assert score.log_score == pytest.approx(math.log(probability), abs=2e-3)
    score = score_comparison(compared(which, None, 1.503, None))
    assert score.log_score == pytest.approx((2 * math.log(silent) + math.log(at)) / 3, abs=2e-3)


def test_no_readings_have_no_score() -> None:
    assert score_comparison(compared(board())).log_score is None


def test_the_most_probable_reading_is_silence_or_a_range_within_5_cm() -> None:
    faint, loud = (board(threshold_db=LEVEL + by, threshold_sd_db=2.0) for by in (1.0, -1.0))
    (silent,) = score_comparison(compared(faint, None, 1.5, None, None)).calibration
    assert (silent.n, silent.observed) == (4, 0.75)
    assert silent.stated == pytest.approx(PHI(0.5), abs=1e-3)
    (heard,) = score_comparison(compared(loud, 1.54, 1.56, None, 1.5)).calibration
    assert (heard.n, heard.observed) == (4, 0.5)
    assert heard.stated == pytest.approx(PHI(0.5), abs=1e-3)


def test_bins_of_calibration() -> None:
    found = calibration([(0.31, True), (0.39, False), (1.0, True), (0.95, True), (0.9, False)])
    assert [(one.n, one.observed) for one in found] == [(2, 0.5), (3, pytest.approx(2 / 3))]
    assert found[0].stated == pytest.approx(0.35)


def test_readings_with_the_stated_spread_are_calibrated_and_score_best() -> None:
    """Draw from the fake with a spread of 3 dB; too small and too large a spread score worse."""
    headings = np.radians(np.linspace(-9, 9, 37))
    true = board(threshold_db=-9.0, threshold_sd_db=3.0, range_sd=0.004)
    fake = RoomEchoes(WALL, HERE, true, 5, EXACT)
    readings = [
        Reading(
            number,
            0,
            0,
            float(heading),
            float(number),
            fake.receive(Ping(float(heading), sweep, 0, 0.03, trace=False)).echo_times,
            WALL.air.speed_of_sound,
            None,
            origin=Origin.FAKE,
        )
        for number, (sweep, heading) in enumerate((sweep, heading) for sweep in range(40) for heading in headings)
    ]
    scores = {}
    for spread in (0.5, 3.0, 12.0):
        which = replace(true, threshold_sd_db=spread)
        score = score_comparison(compare_readings(readings, WALL, HERE, which), room_tolerance=0.0)
        scores[spread] = score.log_score or 0.0
        if spread == 3.0:
            for one in score.calibration:
                assert one.observed == pytest.approx(one.stated, abs=3.5 * 0.5 / math.sqrt(one.n))
    assert scores[3.0] > max(scores[0.5], scores[12.0]) + 0.02


def test_simpler_models_are_scored_without_a_spread_of_the_threshold() -> None:
    which = board(threshold_sd_db=3.0)
    comparison = match_readings([reading(1.5)], predict_with(Model.NEAREST, WALL, HERE, which, np.zeros(1)))
    score = score_comparison(comparison, PredictionOptions(), model=Model.NEAREST)
    assert [(one.stated, one.observed) for one in score.calibration] == [(pytest.approx(1.0), 1.0)]
