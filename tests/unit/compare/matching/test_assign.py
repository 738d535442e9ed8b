"""Echoes are assigned one to one with minimal residuals, compared with all possible assignments."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest
from scipy.stats import norm
from sonarhw_compare.match import TOLERANCE, compare_readings
from sonarhw_compare.score import assigned, assigned_echoes, echo_statistics
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Reading

ROOM, BOARD = load_room("rooms/simple.toml"), load_board("polaroid-6500")
PLACE = ROOM.places["figure9"]
SPEED = 340.0


def test_assignment_has_the_least_cost() -> None:
    random = np.random.default_rng(2)
    for _ in range(50):
        measured, predicted = np.sort(random.uniform(0, 0.5, 4)), np.sort(random.uniform(0, 0.5, 5))
        costs = [
            sum(min(abs(m - predicted[k]), 2 * TOLERANCE) for m, k in zip(measured, order, strict=False))
            for order in permutations(range(5), 4)
        ]
        chosen = assigned(measured, predicted)
        taken = [k for k in chosen if k is not None]
        cost = sum(2 * TOLERANCE if k is None else abs(m - predicted[k]) for m, k in zip(measured, chosen, strict=True))
        assert len(set(taken)) == len(taken)
        # pairs between one and two gates are not assigned and cost two gates
        assert cost == pytest.approx(min(costs), abs=TOLERANCE * (len(chosen) - len(taken)) + 1e-12)


def test_empty_scans_have_no_assignments() -> None:
    assert assigned(np.empty(0), np.array([1.0])) == []
    assert assigned(np.array([1.0]), np.empty(0)) == [None]
    assert assigned(np.array([1.0, 1.02]), np.array([1.01])).count(None) == 1


def test_every_echo_of_a_reading_gets_its_predicted_echo() -> None:
    heading = np.array([1.0])
    predicted_echoes = predict_scan(ROOM, PLACE, BOARD, heading).ping(0).echoes[:3]
    stray = predicted_echoes[0].range - 0.3
    times = tuple(2 * distance / SPEED for distance in (stray, *(echo.range + 0.004 for echo in predicted_echoes)))
    reading = Reading(0, 0, 0, 0.0, 0.0, times, SPEED)
    comparison = compare_readings([reading], ROOM, replace(PLACE, heading=1.0), BOARD)
    echoes = assigned_echoes(comparison, 0)
    assert [echo and echo.path for _, echo in echoes] == [None, *(echo.path for echo in predicted_echoes)]
    statistics = echo_statistics(comparison)
    assert (statistics.echoes, statistics.explained) == (4, 0.75)
    assert statistics.bias_m == pytest.approx(0.004, abs=1e-9)
    assert statistics.spread_m == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(("bias", "deviation"), [(0.0, 0.002), (0.005, 0.004)])
def test_bias_and_spread_of_normal_residuals_are_their_mean_and_standard_deviation(
    bias: float, deviation: float
) -> None:
    predicted_range = predict_scan(ROOM, PLACE, BOARD, np.array([1.0])).ping(0).echoes[0].range
    residuals = bias + deviation * norm.ppf((np.arange(200) + 0.5) / 200)
    readings = [
        Reading(k, 0, k, 0.0, 0.1 * k, (2 * (predicted_range + residual) / SPEED,), SPEED)
        for k, residual in enumerate(residuals.tolist())
    ]
    # one residual that is far off hardly changes either
    readings.append(Reading(200, 0, 200, 0.0, 20.0, (2 * (predicted_range + 0.04) / SPEED,), SPEED))
    statistics = echo_statistics(compare_readings(readings, ROOM, replace(PLACE, heading=1.0), BOARD))
    assert statistics.bias_m == pytest.approx(bias, abs=1e-4)
    assert statistics.spread_m == pytest.approx(deviation, rel=0.02)
