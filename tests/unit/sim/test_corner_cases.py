"""Corner cases have valid results: no NaN, no hang, no path louder or shorter than possible."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.rays.fan import fan
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.errors import InputError
from tests.conftest import Count
from tests.fixtures.rooms_for_tests import polygon_room, room_of
from tests.oracles.image_sources import specular_lengths

RAYS = 1440


SEARCH = PathSearch(max_length=9.0, wavelength=0.00696, max_bounces=4, rays=RAYS)


SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]


def assert_sane(paths: Paths) -> None:
    for column in (paths.lengths, paths.departures, paths.arrivals, paths.gains):
        assert np.isfinite(column).all()
    assert (paths.gains > 0).all()
    assert (paths.gains <= 1.37).all()  # past an edge, out and back, the integral of Fresnel is at most 1.17 squared
    assert (np.diff(paths.lengths) >= -1e-9).all()
    for path in range(len(paths)):
        legs = np.diff(paths.outline(path), axis=0)
        assert np.hypot(*legs.T).sum() == pytest.approx(paths.lengths[path], abs=1e-8)


def paths_at(room: Room, *position: float, search: PathSearch = SEARCH) -> Paths:
    paths = find_paths(room, (position[0], position[1]), search)
    assert_sane(paths)
    return paths


def lengths_of(paths: Paths) -> list[float]:
    return sorted({round(float(length), 6) for length in paths.lengths})


def test_sensor_inside_a_post_has_no_paths() -> None:
    room = polygon_room(SQUARE, extra='[[posts]]\nname = "post"\ncenter = [1.0, 1.0]\nradius = 0.3\nmaterial = "hard"')
    assert len(paths_at(room, 1.1, 1.0)) == 0
    assert len(paths_at(room, 1.0, 1.0)) == 0


def test_ray_along_a_wall_has_sane_paths() -> None:
    # the fin lies along a ray of the fan
    angle = float(fan(RAYS)[100])
    along = np.array([math.cos(angle), math.sin(angle)])
    room = room_of([(*(0.5 * along), *(1.5 * along)), (2.0, -3.0, 2.0, 3.0)])
    found = paths_at(room, 0.0, 0.0)
    assert 4.0 in lengths_of(found)
    assert ("w0",) not in [found.via(path, room) for path in range(len(found))]


@pytest.mark.parametrize("ray", [0, 777])
def test_ray_that_hits_a_vertex_exactly_adds_and_loses_no_path(ray: int) -> None:
    angle = float(fan(RAYS)[ray])
    ring = [(1.5 * math.cos(angle + k * 1.1), 1.5 * math.sin(angle + k * 1.1)) for k in range(6)]
    room = polygon_room(ring)
    found = paths_at(room, 0.0, 0.0, search=PathSearch(9.0, 0.00696, 3, diffraction=False, rays=RAYS))
    assert lengths_of(found) == pytest.approx(sorted(set(np.round(specular_lengths(room, (0.0, 0.0), 3), 6))), abs=1e-6)


def test_crossing_walls_reflect_like_meeting_ones() -> None:
    room = room_of([(-2.0, 0.0, 2.0, 0.0), (0.0, -2.0, 0.0, 2.0)])
    found = find_paths(room, (0.7, 0.4), PathSearch(3.0, 0.00696, diffraction=False, rays=RAYS))
    assert_sane(found)
    assert found.lengths == pytest.approx([0.8, 1.4, 2 * math.hypot(0.7, 0.4)])


def test_a_room_of_very_many_walls_loads_and_has_paths(count: Count) -> None:
    boxed, side = count(2_000, 25_000), count(24, 80)
    # rows of little boxes round an open square
    boxes = [
        (x * 0.2, y * 0.2)
        for x in range(-side, side)
        for y in range(-side, side)
        if max(abs(x), abs(y)) > 4 or (x, y) == (4, 0)
    ][:boxed]
    corners = ", ".join
    chains = [
        f'[[walls]]\nname = "b{k}"\nclosed = true\nmaterial = "hard"\npoints = ['
        + corners(f"[{x + dx!r}, {y + dy!r}]" for dx, dy in ((0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)))
        + "]"
        for k, (x, y) in enumerate(boxes)
    ]
    room = parse_room('name = "many"\n[materials.hard]\nreflectance = 0.9\n' + "\n".join(chains), "many")
    assert len(room.walls) == 4 * boxed
    found = paths_at(room, 0.05, 0.05, search=PathSearch(4.0, 0.00696, 4, rays=RAYS))
    assert found.lengths[0] == pytest.approx(2 * 0.75)
    assert room.names[int(found.surfaces[0, 0])].startswith("b")


_grid = st.integers(-2, 2).map(float)


_wall = st.tuples(_grid, _grid, _grid, _grid).filter(lambda wall: wall[:2] != wall[2:])


_post = st.tuples(_grid, _grid, st.sampled_from([0.1, 0.5, 1.0]))


@settings(max_examples=25, deadline=None)
@given(
    st.lists(_wall, min_size=1, max_size=8),
    st.lists(_post, max_size=2),
    st.tuples(_grid, _grid),
    st.tuples(_grid, _grid),
    st.sampled_from(EdgeStrength),
)
def test_surfaces_that_meet_cross_and_overlap_have_sane_paths(
    walls: list[tuple[float, float, float, float]],
    posts: list[tuple[float, float, float]],
    source: tuple[float, float],
    receiver: tuple[float, float],
    edge_strength: EdgeStrength,
) -> None:
    search = PathSearch(12.0, 0.00696, 4, rays=RAYS, edge_strength=edge_strength)
    assert_sane(find_paths(room_of(walls, posts), source, search, receiver=receiver))


@settings(max_examples=8, deadline=None)
@given(st.lists(_wall, min_size=1, max_size=6), st.lists(_post, max_size=1), st.tuples(_grid, _grid))
def test_scans_at_any_place_have_valid_ranges_or_none(
    walls: list[tuple[float, float, float, float]],
    posts: list[tuple[float, float, float]],
    position: tuple[float, float],
) -> None:
    board = load_board("polaroid-6500")
    headings = np.radians(np.arange(0, 360, 15.0))
    try:
        scan = predict_scan(room_of(walls, posts), Place("here", position), board, headings)
    except InputError as refusal:
        # between a wall and a post that nearly touch it, sound is reflected very often
        if not str(refusal).startswith("too many paths"):
            raise
        return
    detected = scan.ranges[~np.isnan(scan.ranges)]
    assert (detected >= board.blanked_range(scan.room.air)).all()
    assert (detected <= board.max_range + 1e-6).all()
    assert all(math.isfinite(echo.level_db) for k in range(len(headings)) for echo in scan.ping(k).echoes)
