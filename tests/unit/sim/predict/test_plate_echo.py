"""The predicted echo of a plate equals that of a simulated scan in front of a wall."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.beam import BoolArray
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import plate_echo
from sonarhw_sim.room.room import parse_room

DISTANCE = 1.3
ROOM = f"""
name = "One wall"
[materials.perfect]
reflectance = 1.0
[[walls]]
name = "wall"
points = [[{DISTANCE}, -20.0], [{DISTANCE}, 20.0]]
material = "perfect"
[places.here]
position = [0.0, 0.0]
"""
STEP = math.radians(0.1)


@pytest.mark.parametrize("name", ["polaroid-6500", "hc-sr04", "lego-nxt", "paper"])
def test_the_arc_is_that_of_a_predicted_scan(name: str) -> None:
    room, board = parse_room(ROOM, "one wall"), load_board(name)
    headings = np.arange(-900, 900) * STEP
    ranges = predict_scan(room, room.place("here"), board, headings).ranges
    echo = plate_echo(board, room.air, DISTANCE)
    assert echo.arc == pytest.approx(lobe(~np.isnan(ranges)), abs=2 * STEP)
    assert echo.early_arc == pytest.approx(lobe(ranges <= DISTANCE + echo.delay + 0.004), abs=2 * STEP)
    # at a quarter of the arc to each side, half of the middle is later
    assert ranges[900 + round(echo.arc / 8 / STEP)] == pytest.approx(DISTANCE + echo.delay, abs=1e-4)


def lobe(detected: BoolArray) -> float:
    """Return the width of the main lobe, rad, from detections at each heading, (1800,)."""
    right, left = np.flatnonzero(~detected[900:])[0], np.flatnonzero(~detected[:901][::-1])[0]
    return float((right + left) * STEP)


def test_only_the_own_receiver_of_a_board_delays_an_echo_and_faint_ones_more() -> None:
    own = load_board("polaroid-6500")
    assert plate_echo(replace(own, receiver=Receiver.FIRST_ECHO), Air(), DISTANCE).delay == 0
    delays = [plate_echo(own, Air(), DISTANCE, level).delay for level in (6, 0, -6)]
    assert 0.001 < delays[0] < delays[1] < delays[2] < 0.01


def test_a_stronger_plate_has_a_wider_arc_and_one_below_the_threshold_none() -> None:
    board = load_board("polaroid-6500")
    arcs = [plate_echo(board, Air(), DISTANCE, level).arc for level in (-50, -20, -6, 0, 6)]
    assert arcs[0] == 0
    assert arcs == sorted(arcs)
    assert len(set(arcs)) == 5
