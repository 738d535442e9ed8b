"""The signal of a plate against the closed form of the beam, and against the prediction of a room with a wall."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_compare.calibration.plate_readings import plate_envelopes, plate_levels
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place

from tests.unit.compare.plate.plate_scans import start_board, wall_room

SPEED = Air().speed_of_sound


def test_a_plate_has_the_level_of_a_perfect_wall_times_the_beam_there_and_back() -> None:
    board = load_board("paper")
    levels = plate_levels(board, SPEED, 1.3)
    angles = np.radians([0.5, 3.0, 7.5, 10.0, 18.0])
    x = board.wavenumber(Air()) * board.aperture_radius * np.sin(angles)
    expected = 40 * np.log10(np.abs(2 * j1(x) / x) * np.cos(angles))
    assert levels.detected_at(angles) == pytest.approx(expected, abs=0.01)
    assert levels.detected_at(-angles) == pytest.approx(expected, abs=0.01)
    # a burst contains other frequencies than its carrier, which matter little in the main lobe
    assert levels.peaks_at(angles[:3]) == pytest.approx(expected[:3], abs=0.1)


@pytest.mark.parametrize("name", ["polaroid-6500", "polaroid-56", "hc-sr04", "lego-nxt"])
@pytest.mark.parametrize("distance", [0.6, 2.2])
def test_a_plate_is_heard_at_the_headings_of_the_prediction(name: str, distance: float) -> None:
    board = load_board(name)
    angles = np.radians(np.arange(-44.0, 44.0, 0.5))
    place = Place("here", (-distance - board.mount.ahead, 0.0))
    predicted = ~np.isnan(predict_scan(wall_room(), place, board, angles).ranges)
    over = plate_levels(board, SPEED, distance).detected_at(angles) - board.threshold_db
    assert predicted.any()
    certain = np.abs(over) > 0.2
    assert certain.mean() > 0.8
    assert (predicted[certain] == (over[certain] > 0)).all()


def ahead(board: Board, ahead: float) -> Board:
    return replace(board, mount=board.mount.model_copy(update={"ahead": ahead}))


def test_a_face_ahead_of_the_axis_is_farther_away_at_an_angle() -> None:
    board = ahead(start_board(), 0.1)
    times = [
        plate_envelopes(board, SPEED, 1.0, np.array([angle])).samples.argmax() for angle in (0.0, math.radians(20.0))
    ]
    later = (times[1] - times[0]) / 200_000.0 * SPEED / 2
    assert later == pytest.approx(0.1 * (1 - math.cos(math.radians(20.0))), abs=0.006)


def test_the_gain_of_the_board_rises_in_steps() -> None:
    """Between two steps, the level falls with the loss of sound; a step raises it by the height of a step."""
    board = start_board()
    near, far = (plate_levels(board, SPEED, time * SPEED / 2).peaks_at(np.zeros(1))[0] for time in (0.0054, 0.0070))
    ideal = replace(board, receiver=Receiver.FIRST_ECHO)
    assert plate_levels(ideal, SPEED, 0.0054 * SPEED / 2).peaks_at(np.zeros(1))[0] == pytest.approx(0.0, abs=0.01)
    loss = 20 * math.log10(70 / 54) + 1.4 * (0.0070 - 0.0054) * SPEED
    assert near - far == pytest.approx(loss, abs=0.2)


@pytest.mark.parametrize("aside", [0.0, 0.04])
def test_levels_to_the_left_are_those_of_the_envelopes_there(aside: float) -> None:
    """Only a face beside the turning axis has other levels to the left than to the right."""
    start = load_board("hc-sr04")
    board = replace(start, mount=start.mount.model_copy(update={"aside": aside}))
    levels = plate_levels(board, SPEED, 0.5)
    left = levels.angles[levels.angles < 0]
    peaks = 20 * np.log10(plate_envelopes(board, SPEED, 0.5, left).samples.max(axis=1))
    assert levels.peaks_at(left) == pytest.approx(np.maximum(peaks, -80.0), abs=1e-9)
    assert (levels.peaks_at(left) == pytest.approx(levels.peaks_at(-left), abs=1e-9)) == (aside == 0)
