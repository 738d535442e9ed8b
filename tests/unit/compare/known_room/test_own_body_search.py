"""The carrier's own body in scans from several places, found among the echoes that the room does not explain."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import sonarhw_compare.calibration.room as calibration
from sonarhw_compare.arcs import place_numbers
from sonarhw_compare.calibration.outcome import Measured
from sonarhw_compare.calibration.room import RoomCalibration, TurntableFit, find_own_body
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.match import TOLERANCE
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading

ROOM, NXT = load_room("rooms/arena.toml"), load_board("lego-nxt")
PLACES = [(0.84, 0.30), (1.80, 0.30), (1.80, 0.54), (1.38, 0.54), (1.38, 1.68)]
SPEED = ROOM.air.speed_of_sound


def scan_at(
    position: tuple[float, float],
    body: Sequence[int] = (),
    step: int = 3,
    zero: float = 0.0,
    others: np.random.Generator | None = None,
    whole: bool = False,
) -> PlacedScan:
    """Return what the room does not explain: echoes at 20 to 22 cm at the turntable angles `body`, and silence.

    With `others`, one angle in seven has an echo from 0.1 to 2.5 m that is not in the room. With `whole`, return all
    readings, with ranges that are 4 cm too short, so that the walls beside three places are 26 cm away.
    """
    angles = np.arange(0, 360, step)
    predicted = predict_scan(ROOM, Place("", position), NXT, np.radians(angles + zero)).ranges
    ranges = predicted - 0.04 * whole
    if others is not None:
        strange = others.random(len(angles)) < 1 / 7
        ranges[strange] = others.uniform(0.1, 2.5, strange.sum())
    ranges[np.isin(angles, body)] = 0.20 + 0.02 * whole + 0.02 * (angles[np.isin(angles, body)] % 2)
    times = [() if math.isnan(one) else (2 * one / SPEED,) for one in ranges.tolist()]
    return PlacedScan(
        [
            Reading(k, 0, 0, math.radians(float(angles[k])), 0.1 * k, times[k], SPEED)
            for k in np.flatnonzero(whole | ~(np.abs(ranges - predicted) <= TOLERANCE)).tolist()
        ],
        Place("", position),
    )


def test_echoes_at_one_angle_and_range_at_all_places_are_the_own_body() -> None:
    body = range(60, 91)
    (part,) = find_own_body([scan_at(position, body) for position in PLACES])
    assert part.from_deg == pytest.approx(58.5)
    assert part.to_deg == pytest.approx(91.5)
    assert (part.nearest, part.farthest) == pytest.approx((0.175, 0.245))


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


@pytest.mark.parametrize(("beside", "ends_at"), [(range(93, 97), 97.5), (range(96, 100), 91.5)])
def test_an_end_that_one_place_alone_shows_belongs_to_the_body(beside: range, ends_at: float) -> None:
    scans = [scan_at(position, range(60, 91)) for position in PLACES[:4]]
    (part,) = find_own_body([*scans, scan_at(PLACES[4], [*range(60, 91), *beside])])
    assert (part.from_deg, part.to_deg) == (pytest.approx(58.5), pytest.approx(ends_at))


def test_an_echo_beside_the_body_at_another_range_is_not_its_end() -> None:
    first, *others = (scan_at(position, range(60, 91)) for position in PLACES)
    beside = Reading(1000, 0, 0, math.radians(93.0), 0.0, (2 * 0.3 / SPEED,), SPEED)
    (part,) = find_own_body([replace(first, readings=[*first.readings, beside]), *others])
    assert (part.to_deg, part.farthest) == pytest.approx((91.5, 0.245))


@pytest.mark.parametrize("gap", [75, 0])
def test_parts_that_meet_where_one_place_shows_the_body_are_one(gap: int) -> None:
    sides = [(gap + k) % 360 for k in (*range(-15, 0, 3), *range(3, 18, 3))]
    scans = [scan_at(position, sides) for position in PLACES[:4]]
    (part,) = find_own_body([*scans, scan_at(PLACES[4], [*sides, gap])])
    assert part.spans(math.radians(gap))
    assert part.to_deg - part.from_deg == pytest.approx(33.0)


def test_two_parts_are_found_although_turned_scans_bring_them_together() -> None:
    body = [*range(84, 103), *range(201, 229)]
    parts = find_own_body([scan_at(position, body) for position in PLACES])
    assert [part.spans(math.radians(degrees)) for part in parts for degrees in (93, 215)] == [True, False, False, True]


def test_a_wall_in_front_of_three_of_four_places_does_not_hide_the_body() -> None:
    body = [*range(84, 97), *range(204, 226)]
    scans = [
        PlacedScan(scan_at(at, body, whole=True).readings, Place(str(k), at), str(k)) for k, at in enumerate(PLACES[1:])
    ]
    places = tuple(scan.place for scan in scans)
    first = TurntableFit({"turntable_scale": Measured(1.0, 0.01)}, places)
    result = RoomCalibration(NXT, NXT, scans=scans, given=ROOM, room=ROOM)
    calibration._find_own_body(result, first)
    assert [(part.from_deg, part.to_deg) for part in result.own_body] == [
        (pytest.approx(82.5, abs=3.1), pytest.approx(97.5, abs=3.1)),
        (pytest.approx(202.5, abs=3.1), pytest.approx(226.5, abs=3.1)),
    ]


@pytest.mark.parametrize("seed", range(3))
def test_echoes_that_are_alike_by_chance_are_no_own_body(seed: int) -> None:
    others = np.random.default_rng(seed)
    scans = [scan_at(position, zero=40.0 * k, others=others) for k, position in enumerate(PLACES)]
    assert find_own_body(scans) == ()
    body = find_own_body([scan_at(position, range(60, 91), others=others) for position in PLACES])
    assert [part.spans(math.radians(75.0)) for part in body] == [True]


def test_scans_from_one_place_show_no_own_body() -> None:
    assert find_own_body([scan_at(PLACES[0], range(60, 91))] * 3) == ()
    assert find_own_body([scan_at(PLACES[0], range(60, 91))]) == ()


def test_positions_within_5_cm_are_one_place() -> None:
    assert place_numbers([(0.0, 0.0), (0.04, 0.0), (1.0, 0.0), (0.0, 0.01)]).tolist() == [0, 0, 1, 0]
