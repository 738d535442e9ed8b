"""Maps: the certainty grid of Moravec and Elfes, walls and points between arcs, and the picture of both."""

import math
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from matplotlib.axes import Axes
from sonarhw_compare import map
from sonarhw_compare.arcs import Arc
from sonarhw_compare.drawings import draw_map
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.map import room_of as room_of_features
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import CONE_HALF_ANGLE
from sonarhw_sim.room.room import Place

from tests.fixtures.predicted_readings import readings_of
from tests.fixtures.rooms_for_tests import room_of

# The certainty grid, cell by cell.


BOARD = load_board("paper")


HERE = Place("", (0.3, 0.1))


def grid_of(*rows: tuple[float, float], cell: float = 0.01, x: float = 0.3) -> map.CertaintyGrid:
    """Return the grid of readings of headings (degrees) and ranges (m) at (`x`, 0.1)."""
    degrees, ranges = zip(*rows, strict=True)
    return map.certainty_grid(
        [PlacedScan(readings_of(np.radians(degrees), ranges), replace(HERE, position=(x, 0.1)))],
        BOARD,
        [np.ones(len(rows), np.bool_)],
        cell,
    )


def polar(grid: map.CertaintyGrid, degrees: float) -> tuple[np.ndarray, np.ndarray]:
    """Return distance from the sensor and angle from the axis of each cell, m and rad."""
    rows, columns = np.indices(grid.empty.shape)
    x = grid.left + (columns + 0.5) * grid.cell - 0.3
    y = grid.bottom + (rows + 0.5) * grid.cell - 0.1
    aside = np.remainder(np.arctan2(y, x) - math.radians(degrees) + math.pi, math.tau) - math.pi
    return np.hypot(x, y), np.abs(aside)


@pytest.mark.parametrize(("degrees", "far"), [(0.0, 0.8), (70.0, 1.3), (200.0, 0.5)])
def test_one_reading_gives_the_printed_profiles(degrees: float, far: float) -> None:
    grid = grid_of((degrees, far))
    away, aside = polar(grid, degrees)
    share = np.where(aside < CONE_HALF_ANGLE, 1 - (aside / CONE_HALF_ANGLE) ** 2, 0.0)
    before = far - map.DEPTH
    empty = np.where(away < before, share * (1 - (away / before) ** 2), 0.0)
    assert grid.empty == pytest.approx(empty, abs=1e-9)
    occupied = np.where(np.abs(away - far) < map.DEPTH, share * (1 - ((away - far) / map.DEPTH) ** 2), 0.0) * (
        1 - empty
    )
    # an arc adds 1 in all; the highest certainty of the grid is then 1
    assert grid.occupied == pytest.approx(occupied / occupied.max(), abs=1e-9)
    assert grid.certainty == pytest.approx(np.where(grid.occupied >= empty, grid.occupied, -empty), abs=1e-9)


def test_certainty_outside_the_grid_is_0_and_inside_that_of_the_cell() -> None:
    grid = map.CertaintyGrid(1.0, 2.0, 0.5, np.zeros((2, 3)), np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]))
    points = [
        [1.01, 2.01],
        [2.49, 2.01],
        [1.01, 2.99],
        [2.49, 2.99],
        [0.99, 2.5],
        [2.51, 2.5],
        [1.5, 1.99],
        [1.5, 3.01],
    ]
    assert grid.at(np.array(points)) == pytest.approx([0.1, 0.3, 0.4, 0.6, 0, 0, 0, 0])
    assert grid.extent == (1.0, 2.5, 2.0, 3.0)


# Walls and points between the arcs of several places.


def arc_to(centre: tuple[float, float], target: tuple[float, float]) -> Arc:
    """Return an arc with its middle at a target."""
    dx, dy = target[0] - centre[0], target[1] - centre[1]
    return Arc(0, (), centre, math.hypot(dx, dy), math.atan2(dy, dx), math.radians(8))


@pytest.mark.parametrize(("apart", "length"), [(0.06, 0.1), (0.1, 0.1), (0.4, 0.4)])
def test_a_wall_is_as_long_as_the_touched_part_but_at_least_10_centimetres(apart: float, length: float) -> None:
    (wall,) = map.find_features([arc_to((x, 0.0), (x, 1.0)) for x in (0.3, 0.3 + apart)]).walls
    ends = sorted((wall.start, wall.end))
    assert [y for _, y in ends] == pytest.approx([1.0, 1.0], abs=1e-6)
    assert [x for x, _ in ends] == pytest.approx([0.3 + (apart - length) / 2, 0.3 + (apart + length) / 2], abs=1e-6)


def test_two_places_distinguish_a_wall_from_a_point() -> None:
    centres = [(0.0, 0.0), (0.6, 0.1)]
    wall = map.find_features([arc_to(centre, (centre[0], 1.0)) for centre in centres])
    assert [round(math.degrees(one.normal)) for one in wall.walls] == [90]
    np.testing.assert_allclose([wall.walls[0].start[1], wall.walls[0].end[1]], 1.0, atol=1e-6)
    point = map.find_features([arc_to(centre, (0.4, 1.0)) for centre in centres])
    (found,) = point.points
    np.testing.assert_allclose(found.position, (0.4, 1.0), atol=1e-6)
    assert not found.is_corner


def test_one_place_gives_arcs_only() -> None:
    features = map.find_features([arc_to((0.0, 0.0), (0.0, 1.0)), arc_to((0.01, 0.0), (0.01, 1.0))])
    assert (features.walls, features.points) == ((), ())
    assert len(features.alone) == 2


@pytest.mark.parametrize(
    ("x", "behind", "possible"),
    [
        (0.45, 1.0, True),
        (0.04, 1.0, False),
        (0.86, 1.0, False),
        (0.45, 0.11, True),
        (0.45, 0.09, False),
        (1.5, 1.0, False),
    ],
)
def test_a_wall_through_which_a_scan_detects_echoes_is_possible_only(x: float, behind: float, possible: bool) -> None:
    centres = [(0.0, 0.0), (0.4, 0.1), (0.9, 0.05)]
    features = map.find_features([arc_to(centre, (centre[0], 1.0)) for centre in centres])
    looking_up = PlacedScan(
        readings_of(np.radians(84.0 + 3 * np.arange(5)), np.full(5, 0.8 + behind)), Place("", (x, 0.2))
    )
    marked = map.with_possible_walls(features, [looking_up], BOARD, [np.ones(5, dtype=np.bool_)])
    assert [wall.possible for wall in marked.walls] == [possible]
    assert (room_of_features(marked) is None) == possible


def wall(start: tuple[float, float], end: tuple[float, float], degrees: float, *arcs: int) -> map.Wall:
    return map.Wall(start, end, math.radians(degrees), arcs)


def arc(x: float, y: float, distance: float, degrees: float) -> Arc:
    return Arc(0, (), (x, y), distance, math.radians(degrees), math.radians(5))


UP, ASIDE = arc(0.5, 0.0, 1.0, 90.0), arc(0.5, 0.0, 1.0, 0.0)


def ends(*walls: map.Wall) -> list[list[float]]:
    room = room_of_features(map.Features((UP, ASIDE), walls, ()))
    return np.round(room.walls, 6).tolist()


@pytest.mark.parametrize("gap", [0.0, 0.5, 0.99])
def test_walls_less_than_a_metre_from_their_corner_are_extended_to_it(gap: float) -> None:
    """One wall along y = 1, one along x = 1.5; both end `gap` before the corner."""
    level = wall((0.2, 1.0), (1.5 - gap, 1.0), 90, 0)
    upright = wall((1.5, -0.4), (1.5, 1.0 - gap), 0, 1)
    assert ends(level, upright) == [[0.2, 1.0, 1.5, 1.0], [1.5, -0.4, 1.5, 1.0]]


def test_nearly_parallel_walls_do_not_meet() -> None:
    slight = math.tan(math.radians(8))
    level, oblique = wall((0.2, 1.0), (0.8, 1.0), 90, 0), wall((0.9, 1.02), (1.5, 1.02 + 0.6 * slight), 98, 1)
    assert ends(level, oblique)[0] == [0.2, 1.0, 0.8, 1.0]


@pytest.mark.parametrize(
    ("y", "left", "reachable"),
    [
        (2.0, 0.3, False),  # behind the near wall
        (1.05, 0.3, True),  # so near behind it that it may be the same wall
        (2.0, 0.55, False),  # the near wall counts as 10 cm longer
        (2.0, 0.65, True),  # the straight line passes the end of the near wall
    ],
)
def test_a_wall_behind_another_is_an_image(y: float, left: float, reachable: bool) -> None:
    arcs = (UP, arc(0.5, 0.0, y, 90.0))
    near, far = wall((left, 1.0), (left + 1.0, 1.0), 90, 0), wall((0.3, y), (0.9, y), 90, 1)
    assert map.reachable_walls(map.Features(arcs, (far, near), ())) == ((near, far) if reachable else (near,))


# The picture of a map.


CENTRES = ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0))


ARCS = tuple(Arc(k, (), centre, 2.0, math.pi / 2, math.radians(10)) for k, centre in enumerate(CENTRES))


WALL = map.Wall((0.0, 2.0), (1.0, 2.0), math.pi / 2, (0, 1, 2))


CORNER, EDGE = map.Point((1.5, 2.0), True, ()), map.Point((-0.5, 1.0), False, ())


def map_from(places: int) -> map.RoomMap:
    """Return a map from this number of places, with one wall, one corner and one edge."""
    grid = map.CertaintyGrid(-1.0, -1.0, 0.1, np.zeros((40, 40)), np.zeros((40, 40)))
    kept = (np.ones(0, np.bool_),) * places
    layer = map.Layer(kept, grid, map.Features(ARCS[:places], (WALL,), (CORNER, EDGE)))
    scans = tuple(PlacedScan([], Place("", centre)) for centre in CENTRES[:places])
    return map.RoomMap(scans, layer, room_of([[0.0, 2.0, 1.0, 2.0]]), layer, kept)


def line(axes: Axes, label: str) -> list[list[float]]:
    """Return the points of the line with this label."""
    (drawn,) = (one for one in axes.lines if one.get_label() == label)
    return cast(list[list[float]], np.asarray(drawn.get_xydata()).tolist())


def test_features_are_drawn_at_their_positions() -> None:
    figure = draw_map(map_from(3), room_of([[0.0, -1.0, 1.0, -1.0]], [(0.5, -0.5, 0.25)]))
    assert len(figure.axes) == 2
    for axes in figure.axes:
        assert line(axes, "corner") == [[1.5, 2.0]]
        assert line(axes, "edge") == [[-0.5, 1.0]]
        assert line(axes, "sensor") == [list(centre) for centre in CENTRES]
        drawn = [np.asarray(one.get_xydata()).tolist() for one in axes.lines]
        assert [[0.0, 2.0], [1.0, 2.0]] in drawn
        assert [[0.0, -1.0], [1.0, -1.0]] in drawn
        (post,) = axes.patches
        assert (post.center, post.radius) == ((0.5, -0.5), 0.25)
        (arc,) = (np.array(points) for points in drawn if len(points) > 3 and abs(points[0][0] - 0.85) < 0.1)
        np.testing.assert_allclose(np.hypot(arc[:, 0] - 0.5, arc[:, 1]), 2.0)
        bearings = np.degrees(np.arctan2(arc[:, 1], arc[:, 0] - 0.5))
        assert (bearings.min(), bearings.max()) == pytest.approx((80.0, 100.0))
        # 8 % of the longer side is left free
        assert axes.get_xlim() == pytest.approx((-0.5 - 0.08 * 3.0, 1.5 + 0.08 * 3.0), abs=0.02)
        assert axes.get_ylim() == pytest.approx((-1.0 - 0.08 * 3.0, 2.0 + 0.08 * 3.0), abs=0.02)
