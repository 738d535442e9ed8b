"""Readings, models and the fake scanner in rooms with heights, against exact images and closed forms."""

import itertools
import math
from dataclasses import replace
from operator import itemgetter

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_sim.air import Air, Model, Receiver, Unit
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, predict_with
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes, with_furniture
from sonarhw_sim.room.room import Place, load_room
from sonarhw_sim.space.sections import cut, spanning_at

from sonarhw.readings import FloatArray, Ping
from tests.oracles.rooms_with_heights import BOX, HERE, image_at, image_gain, room_of


def test_reading_of_a_place_with_height_is_the_first_of_all_sections() -> None:
    room = load_room("rooms/doorstep.toml")
    board = load_board("polaroid-6500")
    place = room.places["robot"]
    scan = predict_scan(room, place, board, np.array([math.pi / 2]))
    flat = predict_scan(room, replace(place, height=None), board, np.array([math.pi / 2]))
    tall = cut(room, spanning_at(room, 0.25))
    over = predict_scan(tall, replace(place, height=None), board, np.array([math.pi / 2]))
    # the top of the step is only 0.07 m below the transducer, so its edge is louder than the corner at its foot
    assert scan.paths.via(int(scan.winners[0]), room) == ("step/",)
    assert flat.ranges[0] < scan.ranges[0] < over.ranges[0]


def test_readings_in_a_box_room_are_those_of_its_images_in_three_dimensions() -> None:
    board, headings = replace(load_board("polaroid-6500"), max_range=5.0), np.radians(np.arange(0, 360, 2.0))
    out_of_plan = 0
    for position, height in (((1.53, 1.72), 0.3), ((2.67, 0.7), 0.69), ((1.06, 1.46), 0.52)):
        place = Place("here", position, height=height)
        options = PredictionOptions(diffraction=False, receiver=Receiver.FIRST_ECHO)  # images only
        scan = predict_scan(room_of(BOX), place, board, headings, options)
        flat = predict_scan(room_of(BOX), replace(place, height=None), board, headings, options)
        exact = first_images(place, board, headings)
        assert scan.ranges == pytest.approx(exact, abs=1e-9, nan_ok=True)
        out_of_plan += np.count_nonzero(~np.isclose(flat.ranges, exact, equal_nan=True))
    assert out_of_plan > 10  # headings at which the plan alone gives a wrong range


def first_images(place: Place, board: Board, headings: FloatArray) -> FloatArray:
    """Return the range at each heading by all image sources of the box room in three dimensions, (n,) m.

    Images within one wavelength of path add up with their phases; the range is that of the loudest.
    """
    air = room_of(BOX).air
    ka, x, y, z = board.wavenumber(air) * board.aperture_radius, *place.position, place.height or 0.0
    axes = np.column_stack((np.cos(headings), np.sin(headings)))
    images = []
    for i, j, k in itertools.product(range(-5, 6), range(-7, 8), range(-6, 7)):
        image = np.array([image_at(i, x, 3.0) - x, image_at(j, y, 2.0) - y, image_at(k, z, 2.4) - z])
        length = float(np.hypot(np.hypot(*image[:2]), image[2]))
        if (i, j, k) == (0, 0, 0) or not board.blanked_range(Air()) <= length / 2 <= board.max_range:
            continue
        back = np.where(np.array([i, j, k]) % 2 == 0, -image, image)
        level = image_gain(i, j, k) * np.ones(len(headings))
        for way in (image, back):
            cosines = np.clip(axes @ way[:2] / length, -1, 1)
            x_beam = ka * np.sqrt(1 - cosines**2)
            level *= np.where(cosines > 0, lobes(x_beam) * cosines, 0.0)
        images.append((length, level))
    images.sort(key=itemgetter(0))
    lengths, levels = np.array([length for length, _ in images]), np.array([level for _, level in images])
    phasors = levels * np.exp(-1j * board.wavenumber(air) * lengths)[:, None]
    first = np.full(len(headings), np.nan)
    for row in reversed(range(len(lengths))):
        group = slice(*np.searchsorted(lengths, (lengths[row] - 1e-9, lengths[row] + board.wavelength(air))))
        heard = np.abs(phasors[group].sum(axis=0)) >= 10 ** (board.threshold_db / 20)
        loudest = lengths[group][np.abs(levels[group]).argmax(axis=0)]
        first = np.where(heard, loudest / 2, first)
    return first


def lobes(x: FloatArray) -> FloatArray:
    """Return 2 J₁(x)/x with its sign, 1 at 0."""
    return np.asarray(np.where(x > 1e-9, 2 * j1(x) / np.maximum(x, 1e-9), 1.0))


def test_fake_scanner_uses_sections() -> None:
    room = load_room("rooms/doorstep.toml")
    board = replace(load_board("polaroid-6500"), receiver=Receiver.FIRST_ECHO)  # echoes without delay
    detected = RoomEchoes(room, room.places["robot"], board, disturbance=EXACT).receive(
        Ping(math.pi / 2, 0, 0, 0.06, False)
    )
    assert detected.echo_times[0] * room.air.speed_of_sound / 2 == pytest.approx(math.hypot(1.4, 0.07), abs=1e-6)


def test_furniture_is_numbered_before_floor_and_ceiling() -> None:
    room = load_room("rooms/doorstep.toml")
    furnished = with_furniture(room, (1.3, 0.9), np.random.default_rng(1))
    assert furnished.names[-4:] == ("bin", "furniture", "floor", "ceiling")
    assert len(furnished.heights) == len(furnished.scattered) == len(furnished.reflectances) == len(furnished.names)


def test_reflecting_face_is_no_wall_from_floor_to_ceiling() -> None:
    # with such a wall, no path could lead from the wall behind over the floor to the wall ahead
    room, board = room_of(BOX), replace(load_board("paper"), max_range=4.0)
    scan = predict_scan(
        room, replace(HERE, height=0.15), board, np.array([math.pi / 2]), PredictionOptions(unit=Unit.REFLECT)
    )
    vias = [scan.paths.via(k, scan.room) for k in range(len(scan.paths))]
    assert any({"floor", "w[0]", "w[2]"} <= set(via) for via in vias)
    assert ("w[2]", "unit", "w[2]") in vias


def test_nearest_wall_spans_the_height_of_the_transducer() -> None:
    room, board = load_room("rooms/doorstep.toml"), load_board("polaroid-6500")
    for place, distance, via in (("robot", 2.3, ("north",)), ("plan", 1.4, ("step",))):
        scan = predict_with(Model.NEAREST, room, room.places[place], board, np.array([math.pi / 2]))
        assert scan.ranges[0] == pytest.approx(distance)
        assert scan.paths.via(int(scan.winners[0]), room) == via


def test_single_reflections_include_those_out_of_the_plan() -> None:
    room = room_of(BOX)
    scan = predict_scan(room, HERE, load_board("paper"), np.zeros(1), PredictionOptions(max_bounces=1))
    assert scan.paths.bounces.max() == 1
