"""The predicted arc of a plate equals that of a simulated scan in front of a wall."""

import math

import numpy as np
import pytest
from sonarhw_sim.air import Air
from sonarhw_sim.board.plate_arc import plate_arc
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import parse_room

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
    heard = ~np.isnan(predict_scan(room, room.place("here"), board, headings).ranges)
    # the main lobe only
    right, left = np.flatnonzero(~heard[900:])[0], np.flatnonzero(~heard[:901][::-1])[0]
    assert plate_arc(board, room.air, DISTANCE) == pytest.approx((right + left) * STEP, abs=2 * STEP)


def test_a_stronger_plate_has_a_wider_arc_and_one_below_the_threshold_none() -> None:
    board = load_board("polaroid-6500")
    arcs = [plate_arc(board, Air(), DISTANCE, level) for level in (-50, -20, -6, 0, 6)]
    assert arcs[0] == 0
    assert arcs == sorted(arcs)
    assert len(set(arcs)) == 5
