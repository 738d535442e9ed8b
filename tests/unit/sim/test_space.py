"""Paths over and under surfaces against exact images in three dimensions, closed forms and symmetry."""

import itertools
import math
from dataclasses import replace
from operator import itemgetter

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_sim.air import Air, Receiver, Unit
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.rays.diffraction import by_wedge
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.space.sections import paths_from

from sonarhw.readings import FloatArray
from tests.oracles.images_in_space import bent_in_space, faces_of, images_in_space
from tests.oracles.rooms_with_heights import BOX, HERE, LEVELS, image_at, image_gain, room_of, wall

WAVELENGTH = 0.00696


SEARCH = PathSearch(8.0, WAVELENGTH, diffraction=False)


def from_above(room: Room, place: Place, search: PathSearch) -> list[tuple[float, float, tuple[str, ...]]]:
    """Return length, gain and via of every path that leaves the horizontal."""
    paths = paths_from(room, place, search)
    aside = np.abs(np.cos(paths.elevations[:, 0])) > 1e-9
    rows = np.flatnonzero((np.abs(paths.elevations).max(axis=1) > 1e-9) & aside)
    return [(float(paths.lengths[k]), float(paths.gains[k]), paths.via(int(k), room)) for k in rows]


def images_of_box(reach: float) -> list[tuple[float, ...]]:
    """Return length, gain, and unit vectors of departure and arrival of paths by all images of a box room."""
    (x, y), z = HERE.position, 0.9
    found = []
    for i, j, k in itertools.product(range(-9, 10), repeat=3):
        if (i, j, k) == (0, 0, 0):
            continue
        image = [image_at(i, x, 3.0) - x, image_at(j, y, 2.0) - y, image_at(k, z, 2.4) - z]
        length = math.hypot(*image)
        if length > reach:
            continue
        # an odd number of mirrorings along an axis reverses that component
        back = [-c if n % 2 == 0 else c for c, n in zip(image, (i, j, k), strict=True)]
        found.append((length, image_gain(i, j, k), *(c / length for c in image), *(c / length for c in back)))
    return sorted(found)


def as_rows(paths: Paths) -> list[tuple[float, ...]]:
    rise, fall = np.sin(paths.elevations).T
    columns = (paths.lengths, paths.gains, *paths.leaving.T, rise, *paths.arriving.T, fall)
    return sorted(zip(*(column.tolist() for column in columns), strict=True))


def test_box_room_has_the_paths_of_its_images_in_three_dimensions() -> None:
    paths = paths_from(room_of(BOX), HERE, SEARCH)
    exact = images_of_box(8.0)
    assert len(exact) > 140
    assert len(paths) == len(exact)
    for row, image in zip(_by_millimetre(as_rows(paths)), _by_millimetre(exact), strict=True):
        assert row == pytest.approx(image, abs=1e-7)


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(seed, marks=pytest.mark.soak) for seed in range(2, 6))])
def test_paths_over_and_under_low_walls_are_those_of_independent_images_in_space(seed: int) -> None:
    random = np.random.default_rng(seed)
    x, y, height, top, bottom = random.uniform((0.3, 0.3, 0.2, 0.3, 0.5), (2.7, 1.7, 2.2, 1.6, 1.6)).tolist()
    fence = wall("fence", (0.5, 0.4), (0.9, 1.6), height=(0.0, top))
    panel = wall("panel", (2.0, 0.3), (2.2, 1.2), height=(bottom, 2.0))
    # the doors of a cupboard, one above the other on one line
    doors = wall("lower", (1.2, 1.7), (1.9, 1.7), height=(0.0, 0.8)) + wall(
        "upper", (1.9, 1.7), (1.2, 1.7), height=(0.8, 1.4)
    )
    room = room_of(BOX + fence + (panel, doors)[seed % 2])
    paths = paths_from(room, Place("here", (x, y), height=height), replace(SEARCH, max_bounces=3))
    exact = _by_direction(images_in_space(faces_of(room), (x, y, height), 3, SEARCH.max_length))
    found = _by_direction(as_rows(paths))
    assert len(exact) > 50
    assert found.keys() == exact.keys()
    for key, row in found.items():
        assert row == pytest.approx(exact[key], abs=1e-7)


@pytest.mark.parametrize("height", [0.35, 0.9])
def test_paths_bent_by_a_rim_are_those_that_minimise_the_length_in_space(height: float) -> None:
    room = room_of(BOX + wall("fence", (0.6, 0.3), (1.0, 1.6), height=(0.0, 0.5)))
    position = (1.6, 0.7)
    search = replace(SEARCH, max_length=6.5, max_bounces=2, diffraction=True, faintest_diffraction=1e-9)
    paths = paths_from(room, Place("here", position, height=height), search)
    paths = paths.select(np.flatnonzero(paths.edges >= len(room.edges)))
    assert {paths.via(k, room)[paths.bends[k]] for k in range(len(paths))} == {"fence/"}
    rim = np.array([[0.6, 0.3, 0.5], [1.0, 1.6, 0.5]])
    exact = bent_in_space(faces_of(room), rim, (*position, height), 2, search.max_length)
    rows = [(row[0], *row[2:]) for row in as_rows(paths)]
    assert len(exact) > 20
    assert {tuple(np.round(row, 4) + 0.0) for row in rows} == {tuple(np.round(row, 4) + 0.0) for row in exact}


@pytest.mark.parametrize(("top", "height"), [((0.0, 0.7), 1.1), ((0.72, 0.75), 0.4)])
def test_paths_by_boxes_are_those_of_independent_images(top: tuple[float, float], height: float) -> None:
    # an L-shaped room
    ends = ((0.0, 0.0), (3.0, 0.0), (3.0, 1.2), (1.7, 1.2), (1.7, 2.4), (0.0, 2.4))
    corners = ((0.4, 0.3), (1.3, 0.35), (1.25, 0.9), (0.45, 0.8))
    room = room_of(wall("w", *ends, closed=True) + wall("table", *corners, height=top, closed=True) + "lids = true\n")
    position = (0.8, 1.1)
    paths = paths_from(room, Place("here", position, height=height), replace(SEARCH, max_length=6.0, max_bounces=3))
    vias = {name for k in range(len(paths)) for name in paths.via(k, room)}
    assert ("table underside" if height < 0.5 else "table lid") in vias
    exact = _by_direction(images_in_space(faces_of(room), (*position, height), 3, 6.0))
    found = _by_direction(as_rows(paths))
    assert len(exact) > 20
    assert found.keys() == exact.keys()
    for key, row in found.items():
        assert row == pytest.approx(exact[key], abs=1e-7)


def test_a_narrow_wall_that_another_joins_is_as_loud_by_the_floor_with_a_low_wall_in_the_room() -> None:
    strip = wall("strip", (1.0, -0.005), (1.0, 0.005)) + wall("stem", (1.0, 0.0), (1.1, 0.0))
    far = wall("rug", (-3.0, -0.5), (-3.0, 0.5), height=(0.0, 0.01))
    loudest = []
    for walls in (strip, strip + far):
        room = room_of(walls, LEVELS[: LEVELS.index("[ceiling]")])
        search = replace(SEARCH, max_length=3.0, diffraction=True, faintest_diffraction=1e-6)
        paths = paths_from(room, Place("here", (0.0, 0.2), height=0.3), search)
        bent = np.flatnonzero((paths.edges >= 0) & (paths.bounces == 1) & (paths.surfaces[:, 0] >= len(room.walls)))
        loudest.append(sorted(paths.gains[bent].tolist()))
    assert len(loudest[0]) > 1
    assert loudest[0] == pytest.approx(loudest[1], rel=1e-9)


def _by_direction(rows: list[tuple[float, ...]]) -> dict[tuple[float, ...], tuple[float, ...]]:
    """Return rows of `as_rows` by length and directions: two walls of equal reflectance may be touched at one point."""
    return {tuple(round(value, 5) + 0.0 for value in (row[0], *row[2:])): row for row in rows}


def _by_millimetre(rows: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    return sorted(rows, key=lambda row: tuple(round(value, 3) + 0.0 for value in row))


def test_vertical_edge_diffracts_sound_from_the_floor() -> None:
    room = room_of(wall("end", (0.35, 0.0), (1.0, -0.4)))
    place = Place("here", (0.0, 0.0), height=0.2)
    search = PathSearch(1.0, WAVELENGTH, faintest_diffraction=1e-4)
    in_plan = find_paths(room, place.position, search)
    detected = [(far, gain) for far, gain, via in from_above(room, place, search) if set(via) == {"end/", "floor"}]
    length = math.hypot(0.7, 0.4)
    assert len(detected) == 1  # equal legs: the path meets the edge at its foot
    # Keller's cone; the uniform theory differs little so far from reflection
    assert detected[0] == pytest.approx((length, 0.8 * in_plan.gains[0] * math.sqrt(length / 0.7)), rel=1e-4)


def test_parallel_sections_share_the_face_between_them() -> None:
    # the top of the wall crosses the transducer's face, 40 mm wide, a quarter of it below its centre
    room = room_of(wall("kerb", (-2.0, 1.0), (2.0, 1.0), height=(-1.0, 0.89)), levels="")
    place, search = Place("here", (0.0, 0.0), height=0.9), PathSearch(3.0, WAVELENGTH, diffraction=False)
    assert len(paths_from(room, place, search)) == 0
    several = paths_from(room, place, search, face=0.02, sections=20)
    half_chord = math.acos(0.5)
    below = (half_chord - 0.5 * math.sin(half_chord)) / math.pi  # share of a disc beyond half its radius
    assert several.lengths == pytest.approx([2.0])
    assert several.gains == pytest.approx([0.9 * below], rel=0.05)
    whole = paths_from(room_of(BOX), HERE, SEARCH, face=0.02, sections=3)
    assert whole.gains == pytest.approx(paths_from(room_of(BOX), HERE, SEARCH).gains)


def test_sender_and_receiver_at_any_distance_hear_the_floor() -> None:
    room, place = room_of(BOX), replace(HERE, position=(1.1, 0.7))
    for apart in (0.026, 0.3, 1.5):
        paths = paths_from(room, place, SEARCH, receiver=(1.1 + apart, 0.7))
        lengths = {paths.via(k, room): float(paths.lengths[k]) for k in range(len(paths))}
        assert lengths[("w[2]",)] == pytest.approx(math.hypot(2.6, apart))
        assert lengths[("floor",)] == pytest.approx(math.hypot(1.8, apart))
        assert lengths[("floor", "w[2]")] == pytest.approx(math.hypot(2.6, 1.8, apart))


# Rays with different slopes in one direction are followed as one until they part.


# Rims of boxes and posts with lids.


TOP, SHARE = 0.5, 0.9


ABOVE = np.array([0.2, 0.1, 1.0])


CORNERS = np.array([[1.0, -0.2], [1.5, -0.3], [1.6, 0.4], [1.1, 0.35]])


CENTRE, RADIUS = np.array([0.3, 1.2]), 0.1


def _lidded(lids: bool) -> Room:
    closed = "lids = true\n" if lids else ""
    return parse_room(
        f"""
name = "room"
[materials.hard]
reflectance = {SHARE}
[[walls]]
name = "box"
points = {CORNERS.tolist()}
closed = true
material = "hard"
height = [0.0, {TOP}]
{closed}
[[posts]]
name = "leg"
center = {CENTRE.tolist()}
radius = {RADIUS}
material = "hard"
height = [0.0, {TOP}]
{closed}
[places.here]
position = {ABOVE[:2].tolist()}
height = {ABOVE[2]}
""",
        "room",
    )


def _bent(lids: bool) -> tuple[Room, Paths]:
    room = _lidded(lids)
    paths = paths_from(room, room.places["here"], PathSearch(4.0, WAVELENGTH, faintest_diffraction=1e-4))
    return room, paths.select(np.flatnonzero(paths.edges >= len(room.edges)))


def _expected() -> dict[float, float]:
    """Return the amplitude by length, m, of sound straight to the upper edges of a solid box and back."""
    found = {}
    for start, end in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True):
        along = (end - start) / np.hypot(*(end - start))
        at = float((ABOVE[:2] - start) @ along)
        if not 0.0 < at < np.hypot(*(end - start)):
            continue
        away = ABOVE[:2] - start - at * along
        aside, rise = float(away @ (along[1], -along[0])), ABOVE[2] - TOP
        # from the side of the wall, straight down, through the air outside to the lid
        angle, leg = np.array([math.atan2(rise, aside) + math.pi / 2]), np.array([math.hypot(aside, rise)])
        faces = np.full((1, 2), SHARE)
        found[float(2 * leg[0])] = float(abs(by_wedge(angle, angle, np.array([1.5]), faces, leg, leg, WAVELENGTH)[0]))
    return found


def test_rims_of_a_box_with_lids_are_the_edges_of_a_solid() -> None:
    room, paths = _bent(lids=True)
    rows = [k for k in range(len(paths)) if paths.via(k, room)[0].endswith("box lid")]
    expected = _expected()
    assert len(expected) == 2  # one of them is seen across the lid
    assert paths.lengths[rows].tolist() == pytest.approx(sorted(expected), abs=1e-9)
    assert paths.gains[rows].tolist() == pytest.approx([expected[length] for length in sorted(expected)], rel=1e-9)


# Readings in rooms with heights.


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


def test_reflecting_face_is_no_wall_from_floor_to_ceiling() -> None:
    # with such a wall, no path could lead from the wall behind over the floor to the wall ahead
    room, board = room_of(BOX), replace(load_board("paper"), max_range=4.0)
    scan = predict_scan(
        room, replace(HERE, height=0.15), board, np.array([math.pi / 2]), PredictionOptions(unit=Unit.REFLECT)
    )
    vias = [scan.paths.via(k, scan.room) for k in range(len(scan.paths))]
    assert any({"floor", "w[0]", "w[2]"} <= set(via) for via in vias)
    assert ("w[2]", "unit", "w[2]") in vias
