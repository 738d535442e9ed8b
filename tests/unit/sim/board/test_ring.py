"""A ring of sensors on a body: each receives the others, timed from its own ping."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Mount, Ring, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from tests.fixtures.rooms_for_tests import polygon_room

# 24 mm wide, so that sensors 15° apart still receive each other over a wall half a metre away
PAPER = replace(load_board("paper"), aperture_radius=0.012, threshold_db=-50.0, max_range=3.0)
WALL = polygon_room([(0.6, -3.0), (0.6, 3.0)], closed=False)
HERE = Place("here", (0.0, 0.0))
SPEED = WALL.air.speed_of_sound


def scan_of(ring: Ring, *listeners: int) -> PredictedScan:
    """Return what these sensors of the ring receive from all; its rows are in their order."""
    return predict_scan(WALL, HERE, replace(PAPER, ring=ring), ring.headings(HERE)[[*listeners]])


def face(ring: Ring, sensor: int) -> tuple[float, float]:
    heading = sensor * math.tau / ring.sensors
    return ring.radius * math.cos(heading), ring.radius * math.sin(heading)


def by_wall(ring: Ring, sender: int, listener: int) -> float:
    """Return the length of the path from a sensor over the wall to another: the distance to its mirror image."""
    (x0, y0), (x1, y1) = face(ring, sender), face(ring, listener)
    return math.hypot(1.2 - x1 - x0, y1 - y0)


def path_from(scan: PredictedScan, listener: int, sender: int) -> int:
    """Return the row of the path from a sender over the wall straight to a receiver, both as rows of the scan."""
    assert scan.only_at is not None
    assert scan.sender_headings is not None
    return next(
        k
        for k in range(len(scan.paths))
        if scan.only_at[k] == listener
        and math.isclose(scan.sender_headings[k], scan.headings[sender])
        and scan.paths.via(k, scan.room) == ("w[0]",)
    )


def test_ring_of_one_is_a_head_on_a_body() -> None:
    one = predict_scan(WALL, HERE, replace(PAPER, ring=Ring(sensors=1, radius=0.1)), np.zeros(1))
    head = predict_scan(WALL, HERE, replace(PAPER, mount=Mount(ahead=0.1, body_radius=0.1)), np.zeros(1))
    assert [e.range for e in one.ping(0).echoes] == pytest.approx([e.range for e in head.ping(0).echoes], abs=1e-12)
    assert one.ranges[0] == pytest.approx(0.5)


def test_neighbour_is_received_at_the_distance_of_its_mirror_image() -> None:
    ring = Ring(sensors=24, radius=0.1)
    scan = scan_of(ring, 0, 1)
    path = path_from(scan, listener=0, sender=1)
    (x0, y0), (x1, y1) = face(ring, 1), face(ring, 0)
    leaving = math.atan2(y1 - y0, 1.2 - x1 - x0)
    coming = math.atan2(y0 - y1, 1.2 - x1 - x0)
    ka = PAPER.wavenumber(WALL.air) * PAPER.aperture_radius
    out, back = beam_gain(np.array([leaving - math.tau / 24, coming]), ka)
    assert scan.paths.lengths[path] == pytest.approx(by_wall(ring, 1, 0), abs=1e-9)
    assert scan.ping(0).levels[path] == pytest.approx(20 * math.log10(0.9 * out * back), abs=1e-3)


def test_crosstalk_is_timed_from_the_receivers_own_ping() -> None:
    interval = 0.0004
    ring = Ring(sensors=24, radius=0.1, interval=interval)
    scan = scan_of(ring, 0, 1)
    # 0 fires before 1, so its sound reaches 1 an interval early, and that of 1 reaches 0 an interval late
    for listener, sender, later in ((1, 0, -interval), (0, 1, interval)):
        path = path_from(scan, listener, sender)
        expected = by_wall(ring, sender, listener) + later * SPEED
        assert scan.apparent_lengths[path] == pytest.approx(expected, abs=1e-9)
        assert any(echo.range == pytest.approx(expected / 2, abs=1e-9) for echo in scan.ping(listener).echoes)
    assert scan.ranges[0] == pytest.approx(0.5)
    assert scan.ranges[1] == pytest.approx((by_wall(ring, 0, 1) - interval * SPEED) / 2)


def test_ping_within_the_receivers_blanking_is_not_detected() -> None:
    ring = Ring(sensors=24, radius=0.1, interval=0.0015)
    scan = scan_of(ring, 0, 1)
    early = path_from(scan, listener=1, sender=0)
    assert scan.apparent_lengths[early] / 2 < PAPER.blanked_range(WALL.air)
    assert early in [echo.path for echo in scan.ping(1).blanked_echoes]
    assert early not in [echo.path for echo in scan.ping(1).echoes]


def test_sensors_fire_in_the_given_order() -> None:
    ring = Ring(sensors=4, radius=0.1, interval=0.02, order=(0, 2, 1, 3))
    assert ring.firing_times == (0.0, 0.04, 0.02, 0.06)


def test_crosstalk_of_two_sensors_is_symmetric() -> None:
    scan = scan_of(Ring(sensors=24, radius=0.1), 2, 23)
    one, other = path_from(scan, 0, 1), path_from(scan, 1, 0)
    assert scan.paths.lengths[one] == pytest.approx(scan.paths.lengths[other], abs=1e-9)
    assert scan.ping(0).levels[one] == pytest.approx(scan.ping(1).levels[other], abs=1e-6)


def test_sensors_with_long_intervals_receive_no_crosstalk() -> None:
    far_apart = scan_of(Ring(sensors=24, radius=0.1, interval=0.1), 0, 1, 23)
    assert far_apart.sender_headings is not None
    for sensor in range(3):
        own = [
            e for e in far_apart.ping(sensor).echoes if far_apart.sender_headings[e.path] == far_apart.headings[sensor]
        ]
        assert own == list(far_apart.ping(sensor).echoes)


def test_heading_between_two_sensors_is_rejected() -> None:
    ring = Ring(sensors=12, radius=0.1)
    assert ring.sensor_at(HERE, math.radians(330)) == 11
    assert ring.sensor_at(replace(HERE, heading=math.radians(15)), math.radians(-15)) == 11
    with pytest.raises(InputError, match="no sensor of the ring points to 40°"):
        predict_scan(WALL, HERE, replace(PAPER, ring=ring), np.radians([0.0, 40.0]))
