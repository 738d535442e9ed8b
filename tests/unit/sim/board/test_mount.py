"""Mounts: a face that reflects, a face off the axis, and a body behind the face."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.air import Unit
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import BODY_REFLECTANCE, Board, Mount, load_board, parse_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import polygon_room

ROOM = load_room("rooms/simple.toml")
PAPER = load_board("paper")
PLATE = polygon_room([(0.15, -3.0), (0.15, 3.0)], closed=False)  # 15 cm in front of the origin, reflectance 0.9
HERE = Place("here", (0.0, 0.0))


def predict(place: Place, *degrees: float, unit: Unit, room: Room = ROOM, board: Board = PAPER) -> PredictedScan:
    return predict_scan(room, place, board, np.radians(degrees), PredictionOptions(unit=unit))


def via(scan: PredictedScan, index: int) -> tuple[str, ...]:
    return scan.paths.via(int(scan.winners[index]), scan.room)


def mirrored(point: FloatArray, through: FloatArray, direction: float) -> FloatArray:
    along = np.array([math.cos(direction), math.sin(direction)])
    offset = point - through
    return through + 2 * (offset @ along) * along - offset


@pytest.mark.parametrize(
    ("place", "heading", "wall", "away", "trips"),
    # 94 mm is within blanking (0.409 m) until the fifth round trip, 154 mm until the third, 85 mm until the fifth
    [("figure7", 0, "right", 0.094, 5), ("figure9", 0, "right", 0.154, 3), ("figure9", 270, "bottom", 0.085, 5)],
)
def test_sound_repeats_between_near_wall_and_face_until_blanking_ends(
    place: str, heading: float, wall: str, away: float, trips: int
) -> None:
    scan = predict(ROOM.places[place], heading, unit=Unit.REFLECT)
    assert scan.ranges[0] == pytest.approx(trips * away, abs=1e-9)
    assert via(scan, 0) == (wall, *("unit", wall) * (trips - 1))
    assert [echo.range for echo in scan.ping(0).blanked_echoes][: trips - 1] == pytest.approx(
        np.arange(1, trips) * away
    )


def test_parallel_plate_returns_many_echoes_each_weaker_by_wall_and_face() -> None:
    scan = predict(HERE, 0.0, unit=Unit.REFLECT, room=PLATE)
    detected = [*scan.ping(0).blanked_echoes, *scan.ping(0).echoes]
    ringing = [echo for echo in detected if scan.paths.edges[echo.path] < 0]
    levels = [20 * math.log10(0.9**n * BODY_REFLECTANCE ** (n - 1)) for n in range(1, len(ringing) + 1)]
    assert [echo.range for echo in ringing] == pytest.approx(0.15 * np.arange(1, len(ringing) + 1))
    assert [echo.level_db for echo in ringing] == pytest.approx(levels)
    assert len(ringing) > 20


def test_a_blocking_face_absorbs_the_echo_of_a_parallel_plate() -> None:
    scan = predict(HERE, 0.0, unit=Unit.BLOCK, room=PLATE)
    assert [echo.range for echo in scan.ping(0).blanked_echoes if scan.paths.edges[echo.path] < 0] == pytest.approx(
        [0.15]
    )
    assert not [echo for echo in scan.ping(0).echoes if scan.paths.edges[echo.path] < 0]


def test_tilted_face_reflects_the_second_round_trip_like_two_mirrors() -> None:
    tilt = 2.0
    scan = predict(HERE, tilt, unit=Unit.REFLECT, room=PLATE)
    second = next(k for k in range(len(scan.paths)) if scan.paths.via(k, scan.room) == ("w[0]", "unit", "w[0]"))
    # the image of the place in wall, face and wall again, mirrored last to first
    wall, face = np.array([0.15, 0.0]), np.zeros(2)
    image = mirrored(np.zeros(2), wall, math.pi / 2)
    image = mirrored(image, face, math.radians(tilt) + math.pi / 2)
    image = mirrored(image, wall, math.pi / 2)
    assert scan.paths.lengths[second] == pytest.approx(np.hypot(*image), abs=1e-9)
    assert scan.paths.departures[second] == pytest.approx(math.atan2(image[1], image[0]), abs=1e-9)


def test_paths_off_a_reflecting_face_are_those_that_a_blocking_one_passes() -> None:
    degrees = range(0, 360, 15)
    near = replace(PAPER, max_range=4.0)  # with longer paths, windows narrower than the ray spacing are found by chance
    reflecting, blocking = (
        predict(ROOM.places["figure9"], *degrees, unit=unit, board=near) for unit in (Unit.REFLECT, Unit.BLOCK)
    )
    for k in range(len(degrees)):
        past = [e for e in reflecting.ping(k).echoes if "unit" not in reflecting.paths.via(e.path, reflecting.room)]
        assert [e.range for e in past] == pytest.approx([e.range for e in blocking.ping(k).echoes], abs=1e-9)
        assert [e.level_db for e in past] == pytest.approx([e.level_db for e in blocking.ping(k).echoes], abs=1e-6)


def test_sound_from_behind_is_reflected_by_the_back_of_the_face() -> None:
    # two parallel plates; sound from the rear one meets the back of the face and does not reach its front
    corridor = polygon_room([(0.5, -3.0), (0.5, 3.0), (-0.7, 3.0), (-0.7, -3.0)])
    passing, reflecting = (predict(HERE, 0.0, unit=u, room=corridor) for u in (Unit.PASS, Unit.REFLECT))
    past_the_unit = 0.5 + 0.7 + 0.5  # front, rear, front: m one way
    assert any(echo.range == pytest.approx(past_the_unit) for echo in passing.ping(0).echoes)
    assert not any(echo.range == pytest.approx(past_the_unit) for echo in reflecting.ping(0).echoes)


MOUNTS = [Mount(ahead=0.03), Mount(ahead=-0.02), Mount(aside=0.04), Mount(ahead=0.05, aside=-0.02)]


@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("unit", [Unit.PASS, Unit.REFLECT])
def test_face_off_the_axis_has_the_readings_of_an_axis_there(mount: Mount, unit: Unit) -> None:
    place, near = ROOM.places["figure9"], replace(PAPER, max_range=4.0)
    degrees = [0.0, 75.0, 140.0, 270.0]
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


def test_wall_ahead_is_nearer_by_the_distance_of_face_and_axis() -> None:
    board = replace(PAPER, mount=Mount(ahead=0.08))
    scan = predict(ROOM.places["figure9"], 90.0, 180.0, unit=Unit.PASS, board=board)
    assert scan.ranges == pytest.approx([0.657 - 0.08, 0.774 - 0.08])


def test_path_between_separate_sender_and_receiver_is_two_sides_of_a_triangle() -> None:
    board = replace(PAPER, mount=Mount(separation=0.1))
    wall = polygon_room([(0.5, -3.0), (0.5, 3.0)], closed=False)
    scan = predict(HERE, 0.0, unit=Unit.PASS, room=wall, board=board)
    assert scan.ranges[0] == pytest.approx(math.hypot(0.5, 0.05))
    aside = math.atan2(0.05, 0.5)
    one_way = beam_gain(np.array(aside), PAPER.wavenumber(wall.air) * PAPER.aperture_radius)
    assert scan.ping(0).levels[scan.winners[0]] == pytest.approx(20 * math.log10(0.9 * float(one_way) ** 2), abs=1e-6)


B12 = replace(load_board("paper-b12"), max_range=2.0)


def test_sound_repeats_between_body_and_near_wall_which_hides_the_far_one() -> None:
    # figure 9 with a B12 robot (text): 85 mm from the bottom wall
    place = Place("b12", (0.45, 0.085 + 0.152))
    scan = predict(place, 270.0, unit=Unit.PASS, board=B12)
    rattling = ("bottom", *("body", "bottom") * 4)
    assert scan.ranges[0] == pytest.approx(5 * 0.085, abs=1e-4)
    assert via(scan, 0) == rattling
    false_wall = 0.085 + ROOM.walls[:, 3].max()
    without = predict(replace(place, position=(0.45, 0.085)), 270.0, unit=Unit.PASS)
    assert any(echo.range == pytest.approx(false_wall) for echo in without.ping(0).echoes)
    assert not any(echo.range == pytest.approx(false_wall, abs=1e-3) for echo in scan.ping(0).echoes)


def test_round_body_spreads_reflected_sound() -> None:
    board = replace(PAPER, mount=Mount(ahead=0.2, body_radius=0.2))
    room = polygon_room([(0.5, -3.0), (0.5, 3.0)], closed=False)
    scan = predict(HERE, 0.0, unit=Unit.PASS, room=room, board=board)
    second = next(k for k in range(len(scan.paths)) if scan.paths.via(k, scan.room) == ("w[0]", "body", "w[0]"))
    # the tube is 2z wide at the body, opens 1 + 2 (2z) / R times as fast from there, and ends 4z (1 + 2z / R) wide
    z, radius = 0.3, 0.2
    expected = 0.9 * BODY_REFLECTANCE * 0.9 / math.sqrt(1 + 2 * z / radius)
    assert scan.paths.gains[second] == pytest.approx(expected, rel=1e-4)


BOARD = """
name = "mine"
aperture_radius = 0.0192
frequency = 49400.0
transmit_cycles = 16
blanking = 0.00238
max_range = 5.0
threshold_db = -35.0
"""


def test_profile_contains_the_mount() -> None:
    board = parse_board(BOARD + "[mount]\nahead = 0.02\naside = -0.01\n", "mine.toml")
    assert board.mounting == Mount(ahead=0.02, aside=-0.01)
    assert parse_board(BOARD, "mine.toml").mounting.turns_about_face


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("[mount]\nforward = 0.1\n", "mount.forward: unknown key"),
        ("[mount]\nbody_radius = 0.1\n", "the face would lie inside the body"),
        ("[mount]\nseparation = -0.1\n", "mount.separation"),
        ("[mount]\nahead = 0.1\n[ring]\nsensors = 4\nradius = 0.1\n", "[mount] and [ring]"),
        ("[ring]\nsensors = 4\n", "ring.radius: missing"),
        ("[ring]\nsensors = 3\nradius = 0.1\norder = [0, 1, 1]\n", "each sensor from 0 to 2 once"),
    ],
)
def test_impossible_mounts_are_rejected_by_key(lines: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_board(BOARD + lines, "mine.toml")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
