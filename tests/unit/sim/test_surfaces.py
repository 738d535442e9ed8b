"""Grid, edges and enclosures of a room equal those of a search among all walls, also where walls crowd at one spot."""

import math
from dataclasses import fields, replace
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sonarhw_sim.rays.fan import first_hit
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.rays.sequences import leg_is_free
from sonarhw_sim.room import edges
from sonarhw_sim.room.edges import _pairs_near, edges_on_walls, find_edges
from sonarhw_sim.room.grid import Listing, lay_grid
from sonarhw_sim.room.room import Enclosures, Room, find_enclosures, inside, load_room, parse_room, walls_enclose

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import polygon_room, room_of, star_room

Wedge = tuple[float, float, float, str]  # x and y of its vertex, m, opening, rad, and name


_coordinate = st.integers(-2, 2).map(float)


_wall = st.tuples(_coordinate, _coordinate, _coordinate, _coordinate).filter(lambda wall: wall[:2] != wall[2:])


def by_place(wedge: Wedge) -> Wedge:
    """Return a sort key in which openings that differ only by rounding are equal."""
    x, y, opening, name = wedge
    return round(x, 6), round(y, 6), round(opening, 6), name


def names_of(walls: FloatArray) -> tuple[str, ...]:
    return tuple(f"w{k}" for k in range(len(walls)))


def faces_at(vertex: tuple[float, float], walls: FloatArray) -> list[tuple[float, int]]:
    """Return the directions of walls from a point, each direction once, with its first wall."""
    faces: dict[float, int] = {}
    for k, (x0, y0, x1, y1) in enumerate(walls.tolist()):
        ends = ((x0, y0), (x1, y1))
        apart = math.dist(ends[0], vertex) + math.dist(vertex, ends[1]) - math.dist(*ends)
        for end in ends:
            if apart < 1e-9 and math.dist(vertex, end) > 1e-9:
                turn = math.atan2(end[1] - vertex[1], end[0] - vertex[0]) % math.tau
                faces.setdefault(round(turn, 9), k)
    return sorted(faces.items())


def crossings(walls: FloatArray) -> set[tuple[float, float]]:
    """Return where walls with whole coordinates cross, from exact fractions."""
    found = set()
    for one, other in combinations(walls.astype(int).tolist(), 2):
        x, y, end_x, end_y = one
        along, across = (end_x - x, end_y - y), (other[2] - other[0], other[3] - other[1])
        area = along[0] * across[1] - along[1] * across[0]
        if area:
            there = other[0] - x, other[1] - y
            at = Fraction(there[0] * across[1] - there[1] * across[0], area)
            on = Fraction(there[0] * along[1] - there[1] * along[0], area)
            if 0 < at < 1 and 0 < on < 1:
                found.add((float(x + at * along[0]), float(y + at * along[1])))
    return found


def wedges(walls: FloatArray) -> list[Wedge]:
    """Return every wedge of air that diffracts, found without a grid."""
    found = []
    for x, y in sorted({(x, y) for wall in walls.tolist() for x, y in (wall[:2], wall[2:])} | crossings(walls)):
        faces = faces_at((x, y), walls)
        for (start, one), (end, other) in zip(faces, faces[1:] + faces[:1], strict=True):
            opening = (end - start) % math.tau or math.tau
            if abs(math.pi / opening - round(math.pi / opening)) > 1e-6:
                pair = sorted((one, other))
                found.append((x, y, opening, f"w{one}/" if one == other else f"w{pair[0]}/w{pair[1]}"))
    return sorted(found, key=by_place)


def found_wedges(walls: FloatArray) -> list[Wedge]:
    edges = find_edges(walls, names_of(walls))
    rows = zip(edges.points.tolist(), edges.openings.tolist(), edges.names, strict=True)
    return sorted(((x, y, opening, name) for (x, y), opening, name in rows), key=by_place)


@settings(max_examples=40, deadline=None)
@given(st.lists(_wall, min_size=1, max_size=9))
@example([(-2.0, 0.0, 2.0, -2.0), (-2.0, 1.0, 2.0, -2.0)])  # an opening between two rounded values
@example(
    [(0.0, 0.0, 0.0, -1.0), (0.0, 0.0, 0.0, -2.0), (-1.0, 0.0, 1.0, -2.0)]
)  # openings that differ only by rounding
def test_edges_equal_those_of_a_search_without_grid(drawn: list[tuple[float, ...]]) -> None:
    walls = np.array(drawn)
    found, expected = found_wedges(walls), wedges(walls)
    assert [name for *_, name in found] == [name for *_, name in expected]
    assert [at for *at, _, _ in found] == [pytest.approx(at, abs=1e-9) for *at, _, _ in expected]
    assert [angle for _, _, angle, _ in found] == pytest.approx([angle for _, _, angle, _ in expected], abs=1e-6)
    edges = find_edges(walls, names_of(walls))
    listing = edges_on_walls(edges, walls)
    for k in range(len(walls)):
        on = {
            row
            for row, (x, y) in enumerate(edges.points.tolist())
            if k in {wall for _, wall in faces_at((x, y), walls)}
        }
        assert set(listing.numbers[listing.starts[k] : listing.starts[k + 1]].tolist()) == on


# The grid.


# also round numbers: some_walls and rays along the lines between cells
coordinates = st.one_of(st.floats(-5, 5), st.integers(-5, 5).map(float))


points = st.tuples(coordinates, coordinates)


some_walls = st.tuples(points, points).filter(lambda ends: math.dist(*ends) > 1e-3).map(lambda ends: ends[0] + ends[1])


some_posts = st.tuples(coordinates, coordinates, st.floats(0.01, 1.0))


directions = st.one_of(st.floats(0, math.tau), st.integers(0, 7).map(lambda k: k * math.pi / 4))


clutter = st.tuples(st.lists(some_walls, min_size=1, max_size=30), st.lists(some_posts, max_size=5))


@settings(max_examples=50, deadline=None)
@given(clutter, points, directions)
def test_first_hit_is_the_nearest_of_all_surfaces(
    things: tuple[list[tuple[float, ...]], list[tuple[float, ...]]], start: tuple[float, float], direction: float
) -> None:
    surfaces = lay_grid(np.array(things[0]), np.array(things[1]).reshape(-1, 3))
    ray = (*start, math.cos(direction), math.sin(direction))
    count = len(things[0]) + len(things[1])
    one_cell = Listing(np.array([0, count], np.int32), np.arange(count, dtype=np.int32))
    nearest, _ = first_hit(*ray, -1, surfaces._replace(listing=one_cell))
    distance, surface = first_hit(*ray, -1, surfaces)
    assert distance == nearest
    assert (surface == -1) == math.isinf(nearest)


@settings(max_examples=40, deadline=None)
@given(clutter, points, points)
def test_leg_is_free_if_no_single_surface_blocks_it(
    things: tuple[list[tuple[float, ...]], list[tuple[float, ...]]],
    start: tuple[float, float],
    end: tuple[float, float],
) -> None:
    all_walls, all_posts = np.array(things[0]), np.array(things[1]).reshape(-1, 3)
    leg = np.array(start), np.array(end)
    none = np.empty((0, 3))
    alone = [leg_is_free(*leg, lay_grid(all_walls[k : k + 1], none)) for k in range(len(all_walls))]
    alone += [leg_is_free(*leg, lay_grid(np.empty((0, 4)), all_posts[k : k + 1])) for k in range(len(all_posts))]
    assert leg_is_free(*leg, lay_grid(all_walls, all_posts)) == all(alone)


def test_a_leg_exactly_through_the_corner_of_two_walls_is_not_free() -> None:
    leg = np.array([0.0, 0.0]), np.array([2.0, 2.0])
    some_walls = np.array([[1.0, 1.0, 0.0, 2.0], [1.0, 1.0, 2.0, 0.0]])
    for one, other in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        turned = np.array([np.roll(wall, 1 - turn) for wall, turn in zip(some_walls, (one, other), strict=True)])
        assert not leg_is_free(*leg, lay_grid(turned, np.empty((0, 3))))


# Enclosures.


def separated_from(room: Room, x: float, y: float) -> set[str]:
    shut = room.enclosures.separated_from(np.array([[x, y]]))[0]
    return {name for name, gone in zip(room.edges.names, shut, strict=True) if gone}


def test_open_chain_separates_no_edges() -> None:
    gap = polygon_room([(-1.0, -1.0), (1.5, -1.0), (1.5, 1.2), (-1.0, 1.2)], closed=False)
    assert len(find_enclosures(gap.walls, gap.edges).starts) == 0
    assert separated_from(gap, 0.0, 0.0) == set()


@pytest.mark.parametrize(
    ("point", "outside"),
    [((1.0, 1.0), False), ((5.0, 5.0), True), ((-0.1, 1.0), True), ((0.0, 1.0), False), ((2.9, 2.9), True)],
)
def test_points_that_no_chain_encloses_are_outside(point: tuple[float, float], outside: bool) -> None:
    l_shaped = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (2.0, 2.0), (2.0, 3.0), (0.0, 3.0)])
    assert l_shaped.is_outside(point) is outside


def test_open_rooms_have_no_outside() -> None:
    assert not polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0)], closed=False).is_outside((9.0, 9.0))
    box = [(1.0, 1.0, 2.0, 1.0), (2.0, 1.0, 2.0, 2.0), (2.0, 2.0, 1.0, 2.0), (1.0, 2.0, 1.0, 1.0)]
    assert not room_of([(0.0, 0.0, 9.0, 0.0), *box]).is_outside((0.5, 0.5))
    assert room_of(box).is_outside((0.5, 0.5))


def test_crossing_walls_enclose_a_room_and_a_gap_opens_it() -> None:
    # four walls like a hash sign
    walls = np.array([(-2.0, s, 2.0, s) for s in (-1.0, 1.0)] + [(s, -2.0, s, 2.0) for s in (-1.0, 1.0)])
    assert walls_enclose(walls, (0.3, 0.2))
    assert not walls_enclose(walls, (1.5, 0.2))
    walls[3, 3] = 0.99
    assert not walls_enclose(walls, (0.3, 0.2))


def test_the_arena_whose_walls_meet_in_mid_wall_has_an_outside() -> None:
    arena = load_room("rooms/arena.toml")
    for place in arena.places.values():
        assert not arena.is_outside(place.position)
    assert not arena.is_outside((0.0, 1.0))
    for point in ((3.0, 3.0), (-1.0, -1.0), (0.4, 1.9), (1.9, 1.2), (math.pi, 0.1)):
        assert arena.is_outside(point)


# Walls that crowd at one spot.


def overlapping(count: int) -> str:
    """Return a room of walls on the x axis, each of which overlaps all others."""
    sections = [
        f'[[walls]]\nname = "w{k}"\npoints = [[{k}, 0], [{k + count}, 0]]\nmaterial = "m"' for k in range(count)
    ]
    return "\n".join(['name = "o"', "[materials.m]", "reflectance = 0.9", *sections])


def test_too_many_overlapping_walls_are_refused_with_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(edges, "MOST_FACES", 1000)
    assert len(parse_room(overlapping(15), "few.toml").edges) == 2
    with pytest.raises(InputError, match=r"^many\.toml: walls: too many overlap, .* y = 0 m: .* at most 1000 .*wall$"):
        parse_room(overlapping(40), "many.toml")


SEARCH = PathSearch(8.0, 0.00696, 6)


def without_enclosures(room: Room) -> Room:
    blind = replace(room)
    nothing = np.empty(0, np.intp)
    blind.__dict__["enclosures"] = Enclosures(
        np.empty((0, 4)), nothing, nothing, nothing, np.empty(0, np.bool_), len(room.edges)
    )
    return blind


def assert_same_paths(one: Paths, other: Paths) -> None:
    for column in fields(Paths):
        np.testing.assert_array_equal(getattr(one, column.name), getattr(other, column.name))


@pytest.mark.parametrize("seed", range(3))
def test_paths_are_the_same_without_enclosures(seed: int) -> None:
    room = star_room(seed, 7, convex=False)
    assert len(room.edges) > 0
    random = np.random.default_rng(seed)
    for distance in (0.3, 4.0):
        angle = random.uniform(0, math.tau)
        position = distance * math.cos(angle), distance * math.sin(angle)
        assert_same_paths(find_paths(room, position, SEARCH), find_paths(without_enclosures(room), position, SEARCH))


@pytest.mark.parametrize("seed", range(2))
def test_walls_of_one_chain_enclose_the_points_inside(seed: int) -> None:
    walls, random = star_room(seed, 9, convex=False).walls, np.random.default_rng(seed)
    points = random.uniform(walls.min(), walls.max(), (40, 2))
    enclosed = [walls_enclose(walls, (float(x), float(y))) for x, y in points]
    assert enclosed == inside(points, walls).tolist()
    assert 0 < sum(enclosed) < 40


def star(count: int, length: float = 5.0) -> FloatArray:
    """Walls from one point, in a large room."""
    angles = np.arange(count) * math.tau / count
    walls = np.column_stack((np.zeros((count, 2)), length * np.cos(angles), length * np.sin(angles)))
    return np.vstack((walls, [(-50, -50, 50, -50), (50, 50, -50, 50)]))


def tuft(count: int) -> FloatArray:
    """Short walls within 1 cm, in a large room."""
    random = np.random.default_rng(1)
    start = random.uniform(0, 0.01, (count, 2))
    walls = np.hstack((start, start + random.uniform(-1e-3, 1e-3, (count, 2))))
    return np.vstack((walls, [(-50, -50, 50, 50)]))


CROWDS = {"star": star, "small star": lambda count: star(count, 0.1), "tuft": tuft}


def vertices_of(walls: FloatArray) -> FloatArray:
    return np.unique(walls.reshape(-1, 2), axis=0)


def pairs(walls: FloatArray) -> list[tuple[int, int]]:
    """Return the vertices and walls that are compared."""
    vertices = vertices_of(walls)
    near = _pairs_near(np.arange(len(vertices)), np.arange(len(walls), dtype=np.int32), vertices, walls)
    return [pair for vertex, wall in near for pair in zip(vertex.tolist(), wall.tolist(), strict=True)]


@pytest.mark.parametrize("crowd", CROWDS)
def test_the_number_of_comparisons_grows_with_the_number_of_walls(crowd: str) -> None:
    for count in (1000, 4000):
        assert len(pairs(CROWDS[crowd](count))) < 60 * count


@pytest.mark.parametrize("crowd", CROWDS)
def test_every_end_on_a_wall_is_compared_with_it_once(crowd: str) -> None:
    walls = CROWDS[crowd](400)
    vertices, compared = vertices_of(walls), pairs(walls)
    assert len(set(compared)) == len(compared)
    for number, (x, y, end_x, end_y) in enumerate(walls):
        share = ((vertices - (x, y)) @ (end_x - x, end_y - y)) / ((end_x - x) ** 2 + (end_y - y) ** 2)
        foot = (x, y) + np.clip(share, 0, 1)[:, None] * (end_x - x, end_y - y)
        on = np.flatnonzero(np.hypot(*(vertices - foot).T) <= 1e-6)
        assert {(vertex, number) for vertex in on.tolist()} <= set(compared)
