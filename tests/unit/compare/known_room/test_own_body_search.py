"""The carrier's own body in scans from several places, found without a model."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from sonarhw_compare.known_room.own_body_search import ScanAtPlace, find_own_body, place_numbers
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import Place, load_room

from sonarhw.readings import Reading

ROOM, NXT = load_room("rooms/arena.toml"), load_board("lego-nxt")
PLACES = [(0.84, 0.30), (1.80, 0.30), (1.80, 0.54), (1.38, 0.54), (1.38, 1.68)]
SPEED = ROOM.air.speed_of_sound


def scan_at(position: tuple[float, float], body: Sequence[int] = (), step: int = 3, zero: float = 0.0) -> ScanAtPlace:
    """Return the predicted scan, with echoes at 20 to 22 cm at the turntable angles `body`, degrees."""
    angles = np.arange(0, 360, step)
    ranges = predict_scan(ROOM, Place("", position), NXT, np.radians(angles + zero)).ranges
    ranges[np.isin(angles, body)] = 0.20 + 0.02 * (angles[np.isin(angles, body)] % 2)
    times = [() if math.isnan(one) else (2 * one / SPEED,) for one in ranges.tolist()]
    return ScanAtPlace(
        [Reading(k, 0, 0, math.radians(float(angles[k])), 0.1 * k, times[k], SPEED) for k in range(len(angles))],
        position,
    )


def test_echoes_at_one_angle_and_range_at_all_places_are_the_own_body() -> None:
    body = range(60, 91)
    (part,) = find_own_body([scan_at(position, body) for position in PLACES])
    assert part.from_deg == pytest.approx(58.5)
    assert part.to_deg == pytest.approx(91.5)
    assert (part.nearest, part.farthest) == pytest.approx((0.19, 0.23))


def test_a_body_across_angle_0_is_one_part() -> None:
    body = [*range(340, 360), *range(0, 25)]
    (part,) = find_own_body([scan_at(position, body) for position in PLACES])
    assert part.to_deg - part.from_deg == pytest.approx(45.0, abs=3.1)
    assert part.spans(0.0)
    assert not part.spans(math.pi)


def test_a_body_that_one_of_five_scans_misses_is_found() -> None:
    scans = [scan_at(position, range(60, 91)) for position in PLACES[:4]]
    (part,) = find_own_body([*scans, scan_at(PLACES[4])])
    assert part.spans(math.radians(75.0))


def test_walls_alone_are_no_own_body() -> None:
    assert find_own_body([scan_at(position) for position in PLACES]) == ()
    turned = [scan_at(position, zero=40.0 * k) for k, position in enumerate(PLACES)]
    assert find_own_body(turned) == ()


def test_scans_from_one_place_show_no_own_body() -> None:
    assert find_own_body([scan_at(PLACES[0], range(60, 91))] * 3) == ()
    assert find_own_body([scan_at(PLACES[0], range(60, 91))]) == ()


def test_positions_within_5_cm_are_one_place() -> None:
    assert place_numbers([(0.0, 0.0), (0.04, 0.0), (1.0, 0.0), (0.0, 0.01)]).tolist() == [0, 0, 1, 0]
