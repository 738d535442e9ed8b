"""Mounts: a face that reflects, a face off the axis, a body behind it, its echoes, and a ring of sensors."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.air import Unit
from sonarhw_sim.board import profile
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import polygon_room

ROOM = load_room("rooms/simple.toml")


PAPER = profile.load_board("paper")


PLATE = polygon_room([(0.15, -3.0), (0.15, 3.0)], closed=False)  # 15 cm in front of the origin, reflectance 0.9


HERE = Place("here", (0.0, 0.0))


def predict(
    place: Place, *degrees: float, unit: Unit, room: Room = ROOM, board: profile.Board = PAPER
) -> PredictedScan:
    return predict_scan(room, place, board, np.radians(degrees), PredictionOptions(unit=unit))


def via(scan: PredictedScan, index: int) -> tuple[str, ...]:
    return scan.paths.via(int(scan.winners[index]), scan.room)


@pytest.mark.parametrize(
    ("place", "heading", "wall", "away", "trips"),
    # 94 mm is within blanking (0.409 m) until the fifth round trip, 154 mm until the third, 85 mm until the fifth
    [("figure7", 0, "right", 0.094, 5), ("figure9", 0, "right", 0.154, 3), ("figure9", 270, "bottom", 0.085, 5)],
)
def test_sound_repeats_before_a_near_wall(place: str, heading: float, wall: str, away: float, trips: int) -> None:
    scan = predict(ROOM.places[place], heading, unit=Unit.REFLECT)
    assert scan.ranges[0] == pytest.approx(trips * away, abs=1e-9)
    assert via(scan, 0) == (wall, *("unit", wall) * (trips - 1))
    assert [echo.range for echo in scan.ping(0).blanked_echoes][: trips - 1] == pytest.approx(
        np.arange(1, trips) * away
    )


def test_a_blocking_face_absorbs_the_echo_of_a_parallel_plate() -> None:
    scan = predict(HERE, 0.0, unit=Unit.BLOCK, room=PLATE)
    assert [echo.range for echo in scan.ping(0).blanked_echoes if scan.paths.edges[echo.path] < 0] == pytest.approx(
        [0.15]
    )
    assert not [echo for echo in scan.ping(0).echoes if scan.paths.edges[echo.path] < 0]


MOUNTS = [profile.Mount(ahead=-0.02), profile.Mount(ahead=0.05, aside=-0.02)]


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("unit", [Unit.PASS, Unit.REFLECT])
def test_face_off_the_axis_has_the_readings_of_an_axis_there(mount: profile.Mount, unit: Unit) -> None:
    place, near = ROOM.places["figure9"], replace(PAPER, max_range=4.0)
    degrees = [75.0, 270.0]
    mounted = predict(place, *degrees, unit=unit, board=replace(near, mount=mount))
    for k, heading in enumerate(np.radians(degrees)):
        ahead = np.array([math.cos(heading), math.sin(heading)])
        x, y = np.array(place.position) + mount.ahead * ahead + mount.aside * np.array([-ahead[1], ahead[0]])
        alone = predict(replace(place, position=(float(x), float(y))), degrees[k], unit=unit, board=near)
        assert mounted.ranges[k] == pytest.approx(alone.ranges[0], nan_ok=True, abs=1e-9)
        assert [e.range for e in mounted.ping(k).echoes] == pytest.approx(
            [e.range for e in alone.ping(0).echoes], abs=1e-9
        )
        assert mounted.standpoints[k] == pytest.approx((x, y))


def test_path_between_separate_sender_and_receiver_is_two_sides_of_a_triangle() -> None:
    board = replace(PAPER, mount=profile.Mount(separation=0.1))
    wall = polygon_room([(0.5, -3.0), (0.5, 3.0)], closed=False)
    scan = predict(HERE, 0.0, unit=Unit.PASS, room=wall, board=board)
    assert scan.ranges[0] == pytest.approx(math.hypot(0.5, 0.05))
    aside = math.atan2(0.05, 0.5)
    one_way = beam_gain(np.array(aside), PAPER.wavenumber(wall.air) * PAPER.aperture_radius)
    assert scan.ping(0).levels[scan.winners[0]] == pytest.approx(20 * math.log10(0.9 * float(one_way) ** 2), abs=1e-6)


# A ring: each sensor receives the others, timed from its own ping.


# 24 mm wide, so that sensors 15° apart still receive each other over a wall half a metre away
OF_RING = replace(profile.load_board("paper"), aperture_radius=0.012, threshold_db=-50.0, max_range=3.0)


WALL_AHEAD = polygon_room([(0.6, -3.0), (0.6, 3.0)], closed=False)


SPEED = WALL_AHEAD.air.speed_of_sound


def scan_of(ring: profile.Ring, *listeners: int) -> PredictedScan:
    """Return what these sensors of the ring receive from all; its rows are in their order."""
    return predict_scan(WALL_AHEAD, HERE, replace(OF_RING, ring=ring), ring.headings(HERE)[[*listeners]])


def face(ring: profile.Ring, sensor: int) -> tuple[float, float]:
    heading = sensor * math.tau / ring.sensors
    return ring.radius * math.cos(heading), ring.radius * math.sin(heading)


def by_wall(ring: profile.Ring, sender: int, listener: int) -> float:
    """Return the length of the path from a sensor over the wall to another: the distance to its mirror image."""
    (x0, y0), (x1, y1) = face(ring, sender), face(ring, listener)
    return math.hypot(1.2 - x1 - x0, y1 - y0)


def path_from(scan: PredictedScan, listener: int, sender: int) -> int:
    """Return the row of the path from a sender over the wall straight to a receiver, both as rows of the scan."""
    return next(
        k
        for k in range(len(scan.paths))
        if scan.only_at[k] == listener
        and math.isclose(scan.sender_headings[k], scan.headings[sender])
        and scan.paths.via(k, scan.room) == ("w[0]",)
    )


def test_neighbour_is_received_at_the_distance_of_its_mirror_image() -> None:
    ring = profile.Ring(sensors=24, radius=0.1)
    scan = scan_of(ring, 0, 1)
    path = path_from(scan, listener=0, sender=1)
    (x0, y0), (x1, y1) = face(ring, 1), face(ring, 0)
    leaving = math.atan2(y1 - y0, 1.2 - x1 - x0)
    coming = math.atan2(y0 - y1, 1.2 - x1 - x0)
    ka = OF_RING.wavenumber(WALL_AHEAD.air) * OF_RING.aperture_radius
    out, back = beam_gain(np.array([leaving - math.tau / 24, coming]), ka)
    assert scan.paths.lengths[path] == pytest.approx(by_wall(ring, 1, 0), abs=1e-9)
    assert scan.ping(0).levels[path] == pytest.approx(20 * math.log10(0.9 * out * back), abs=1e-3)


def test_crosstalk_is_timed_from_the_receivers_own_ping() -> None:
    interval = 0.0004
    ring = profile.Ring(sensors=24, radius=0.1, interval=interval)
    scan = scan_of(ring, 0, 1)
    # 0 fires before 1, so its sound reaches 1 an interval early, and that of 1 reaches 0 an interval late
    for listener, sender, later in ((1, 0, -interval), (0, 1, interval)):
        path = path_from(scan, listener, sender)
        expected = by_wall(ring, sender, listener) + later * SPEED
        assert scan.apparent_lengths[path] == pytest.approx(expected, abs=1e-9)
        assert any(echo.range == pytest.approx(expected / 2, abs=1e-9) for echo in scan.ping(listener).echoes)
    assert scan.ranges[0] == pytest.approx(0.5)
    assert scan.ranges[1] == pytest.approx((by_wall(ring, 0, 1) - interval * SPEED) / 2)


def test_heading_between_two_sensors_is_rejected() -> None:
    ring = profile.Ring(sensors=12, radius=0.1)
    assert ring.sensor_at(HERE, math.radians(330)) == 11
    assert ring.sensor_at(replace(HERE, heading=math.radians(15)), math.radians(-15)) == 11
    with pytest.raises(InputError, match="no sensor of the ring points to 40°"):
        predict_scan(WALL_AHEAD, HERE, replace(OF_RING, ring=ring), np.radians([0.0, 40.0]))


# The own body.


NXT = profile.load_board("lego-nxt")


PART = "\n[[own_body]]\nfrom_deg = -10.0\nto_deg = 20.0\nnearest = 0.2\nfarthest = 0.24\n"


WITH_BODY = profile.parse_board(NXT.text + PART, "mine.toml")


def test_the_own_body_is_predicted_on_request_where_it_is_the_nearest() -> None:
    room, headings = load_room("rooms/arena.toml"), np.radians(np.arange(0.0, 360.0, 10.0))
    here, near = Place("", (0.42, 0.42), math.radians(90.0)), Place("", (0.42, 0.1), math.radians(270.0))
    usual = predict_scan(room, here, WITH_BODY, headings)
    own = predict_scan(room, here, WITH_BODY, headings, PredictionOptions(own_body=True))
    facing = np.abs(np.degrees(headings) - 95.0) <= 15.0
    assert own.of_own_body.tolist() == facing.tolist()
    assert own.ranges[facing] == pytest.approx(0.22)
    assert own.ranges[~facing] == pytest.approx(usual.ranges[~facing], nan_ok=True)
    # a wall at 10 cm is nearer than the body
    closer = predict_scan(room, near, WITH_BODY, np.radians([275.0]), PredictionOptions(own_body=True))
    assert closer.ranges[0] == pytest.approx(0.1, abs=0.011)
