"""A turntable whose zero, scale and axis are not nominal: the same for prediction, comparison, fit and map."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.arcs import headings_and_ranges
from sonarhw_compare.fit.objective import make_problem
from sonarhw_compare.fit.parameters import free_parameters
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.fit.starting import fit_scan
from sonarhw_compare.match import compare_readings
from sonarhw_sim.board.profile import Board, Mount, load_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Ping, Reading

ROOM = load_room("rooms/arena.toml")
PLACE = Place("", (0.42, 0.42), math.radians(30.0))
CROOKED = replace(
    load_board("lego-nxt").certain,
    rounding=0.0,
    home_angle_deg=-12.0,
    turntable_scale=1.05,
    axis_x=0.03,
    axis_y=-0.02,
    clock_error=0.02,
    range_offset=-0.02,
)
AHEAD = replace(CROOKED, mount=Mount(ahead=0.03))


def readings_of(board: Board) -> list[Reading]:
    """Return what the fake scanner measures with this board, at turntable angles from 0° to 340°."""
    source, speed = RoomEchoes(ROOM, PLACE, board, disturbance=EXACT), ROOM.air.speed_of_sound
    angles = np.radians(np.arange(0.0, 343.0, 3.0)).tolist()
    times = [source.receive(Ping(angle, 0, 0, 0.02, trace=False)).echo_times for angle in angles]
    return [Reading(k, 0, 0, angles[k], 0.1 * k, times[k][:1], speed) for k in range(len(angles))]


@pytest.mark.parametrize("board", [CROOKED, AHEAD])
def test_the_prediction_of_a_board_explains_what_this_board_measures(board: Board) -> None:
    readings = readings_of(board)
    comparison = compare_readings(readings, ROOM, board.faced(PLACE), board)
    residuals = [row.residual for row in comparison.rows if row.measured is not None or row.predicted is not None]
    assert len(residuals) > 80
    assert residuals == pytest.approx([0.0] * len(residuals), abs=1e-9)
    straight = replace(board, turntable_scale=1.0, axis_x=0.0, axis_y=0.0, clock_error=0.0)
    other = compare_readings(readings, ROOM, board.faced(PLACE), straight)
    assert other.summary().within_5cm is not None
    assert other.summary().within_5cm < 0.9


def test_plain_fit_finds_the_actual_heading_of_the_zero_and_the_place() -> None:
    found = fit_scan(readings_of(CROOKED), ROOM, PLACE, CROOKED, frozenset({"heading", "position"}))
    assert math.degrees(found.heading) == pytest.approx(18.0, abs=0.6)
    assert found.place.position == pytest.approx(PLACE.position, abs=0.011)


@pytest.mark.parametrize("board", [CROOKED, AHEAD])
def test_the_likelihood_of_a_fit_is_highest_with_the_actual_turntable(board: Board) -> None:
    scan = PlacedScan(readings_of(board), PLACE)
    free = free_parameters(("heading",), ("scan",), ROOM, board)

    def likelihood(other: Board) -> float:
        problem = make_problem([scan], ROOM, other, free, PredictionOptions(), all_echoes=False)
        values = problem.start()
        return problem.near(values)(values)

    best = likelihood(board)
    for key, change in (("turntable_scale", 0.02), ("axis_x", 0.015), ("axis_y", 0.015), ("clock_error", 0.02)):
        assert likelihood(replace(board, **{key: getattr(board, key) + change})) < best - 5, key
        assert likelihood(replace(board, **{key: getattr(board, key) - change})) < best - 5, key


def test_a_map_is_drawn_with_the_actual_headings_and_ranges() -> None:
    readings = readings_of(CROOKED)
    headings, ranges = headings_and_ranges(PlacedScan(readings, PLACE), CROOKED)
    assert headings[1] - headings[0] == pytest.approx(1.05 * math.radians(3.0))
    assert math.degrees(headings[0]) == pytest.approx(18.0)
    row = next(k for k, reading in enumerate(readings) if reading.range is not None)
    assert ranges[row] == pytest.approx(((readings[row].range or 0.0) + 0.02) / 1.02)
