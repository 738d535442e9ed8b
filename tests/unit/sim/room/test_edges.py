"""The edges of a room equal those of a search of all walls at all vertices, for any number of walls."""

import math
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.edges import edges_on_walls, find_edges
from sonarhw_sim.room.room import parse_room

from sonarhw.readings import FloatArray
from tests.oracles import one_heading, reference

NO_POSTS = np.empty((0, 3))
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


@settings(max_examples=60, deadline=None)
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
    assert [opening for _, _, opening, _ in found] == pytest.approx(
        [opening for _, _, opening, _ in expected], abs=1e-6
    )
    edges = find_edges(walls, names_of(walls))
    listing = edges_on_walls(edges, walls)
    for k in range(len(walls)):
        on = {
            row
            for row, (x, y) in enumerate(edges.points.tolist())
            if k in {wall for _, wall in faces_at((x, y), walls)}
        }
        assert set(listing.numbers[listing.starts[k] : listing.starts[k + 1]].tolist()) == on


def test_a_chain_of_thousands_has_an_edge_at_every_corner() -> None:
    turns = np.arange(3000) * (math.tau / 3000)
    corners = np.column_stack((np.cos(turns), np.sin(turns)))
    walls = np.hstack((corners, np.roll(corners, -1, axis=0)))
    edges = find_edges(walls, names_of(walls))
    outside, inside = edges.openings > math.pi, edges.openings < math.pi
    assert outside.sum() == inside.sum() == 3000
    assert {name for name, out in zip(edges.names, outside, strict=True) if out} == {
        f"w{min(k, (k + 1) % 3000)}/w{max(k, (k + 1) % 3000)}" for k in range(3000)
    }


def test_a_post_at_the_end_of_a_wall_does_not_change_its_edge() -> None:
    text = """
        name = "Post at an end"
        materials.hard = { reflectance = 0.9 }
        places.here = { position = [0.0, 0.0] }
        posts = [{ name = "post", center = [1.0, 0.52], radius = 0.01, material = "hard" }]
        walls = [{ name = "panel", points = [[1.0, -0.5], [1.0, 0.5]], material = "hard" }]
    """
    room, board = parse_room(text, "room"), load_board("paper")
    for degrees in (0, 20, 26):
        heading = math.radians(degrees)
        slow = reference.range_at(room, room.places["here"], board, heading)
        found = one_heading.range_at(room, room.places["here"], board, heading)
        assert found == (None if slow is None else pytest.approx(slow, abs=1e-9))
