"""The mask of a profile for echoes of the carrier's own body."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.board.profile import is_own_body, load_board, own_range, parse_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import InputError

NXT = load_board("lego-nxt")
PART = "\n[[own_body]]\nfrom_deg = -10.0\nto_deg = 20.0\nnearest = 0.2\nfarthest = 0.24\n"
BOARD = parse_board(NXT.text + PART, "mine.toml")


@pytest.mark.parametrize(
    ("degrees", "distance", "own"),
    [(-10, 0.2, True), (20, 0.24, True), (365, 0.22, True), (21, 0.22, False), (0, 0.25, False), (0, None, False)],
)
def test_a_reading_is_of_the_own_body_within_its_angles_and_ranges(
    degrees: float, distance: float | None, own: bool
) -> None:
    assert is_own_body(BOARD.own_body, math.radians(degrees), distance) == own


def test_the_range_of_the_own_body_is_the_middle_of_its_nearest_part() -> None:
    nearer = parse_board(BOARD.text + PART.replace("0.2\n", "0.1\n").replace("0.24", "0.12"), "mine.toml")
    assert own_range(BOARD.own_body, 0.0) == pytest.approx(0.22)
    assert own_range(nearer.own_body, 0.0) == pytest.approx(0.11)
    assert own_range(BOARD.own_body, math.pi) is None


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("to_deg = 20.0", "to_deg = -11.0"),
        ("farthest = 0.24", "farthest = 0.1"),
    ],
)
def test_angles_and_ranges_in_the_wrong_order_are_refused(wrong: str, message: str) -> None:
    with pytest.raises(InputError, match=message.split(" ")[0]):
        parse_board(BOARD.text.replace(wrong, message), "mine.toml")


def test_the_own_body_is_predicted_on_request_where_it_is_the_nearest() -> None:
    room, headings = load_room("rooms/arena.toml"), np.radians(np.arange(0.0, 360.0, 10.0))
    here, near = Place("", (0.42, 0.42), math.radians(90.0)), Place("", (0.42, 0.1), math.radians(270.0))
    usual = predict_scan(room, here, BOARD, headings)
    own = predict_scan(room, here, BOARD, headings, PredictionOptions(own_body=True))
    facing = np.abs(np.degrees(headings) - 95.0) <= 15.0
    assert own.of_own_body is not None
    assert own.of_own_body.tolist() == facing.tolist()
    assert own.ranges[facing] == pytest.approx(0.22)
    assert own.ranges[~facing] == pytest.approx(usual.ranges[~facing], nan_ok=True)
    # a wall at 10 cm is nearer than the body
    closer = predict_scan(room, near, BOARD, np.radians([275.0]), PredictionOptions(own_body=True))
    assert closer.ranges[0] == pytest.approx(0.1, abs=0.011)


def test_a_board_without_own_body_predicts_as_before() -> None:
    room, here = load_room("rooms/arena.toml"), Place("", (0.42, 0.42))
    headings = np.radians(np.arange(0.0, 360.0, 30.0))
    without = replace(BOARD, own_body=())
    asked = predict_scan(room, here, without, headings, PredictionOptions(own_body=True))
    assert asked.ranges == pytest.approx(predict_scan(room, here, NXT, headings).ranges, nan_ok=True)
