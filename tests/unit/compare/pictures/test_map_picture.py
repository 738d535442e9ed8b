"""The data in the picture of a map: arcs, walls, corners and edges at their positions."""

import math
from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from matplotlib.axes import Axes
from sonarhw_compare.arcs import Arc
from sonarhw_compare.drawings import draw_map
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.map import CertaintyGrid, Features, Layer, Point, RoomMap, Wall
from sonarhw_sim.room.room import Place

from tests.fixtures.rooms_for_tests import room_of

CENTRES = ((0.0, 0.0), (0.5, 0.0), (1.0, 0.0))
ARCS = tuple(Arc(k, (), centre, 2.0, math.pi / 2, math.radians(10)) for k, centre in enumerate(CENTRES))
WALL = Wall((0.0, 2.0), (1.0, 2.0), math.pi / 2, (0, 1, 2))
CORNER, EDGE = Point((1.5, 2.0), True, ()), Point((-0.5, 1.0), False, ())


def found(places: int) -> RoomMap:
    """Return a map from this number of places, with one wall, one corner and one edge."""
    grid = CertaintyGrid(-1.0, -1.0, 0.1, np.zeros((40, 40)), np.zeros((40, 40)))
    kept = (np.ones(0, np.bool_),) * places
    layer = Layer(kept, grid, Features(ARCS[:places], (WALL,), (CORNER, EDGE)))
    scans = tuple(PlacedScan([], Place("", centre)) for centre in CENTRES[:places])
    return RoomMap(scans, layer, room_of([[0.0, 2.0, 1.0, 2.0]]), layer, kept)


def line(axes: Axes, label: str) -> list[list[float]]:
    """Return the points of the line with this label."""
    (drawn,) = (one for one in axes.lines if one.get_label() == label)
    return cast(list[list[float]], np.asarray(drawn.get_xydata()).tolist())


def test_features_are_drawn_at_their_positions() -> None:
    figure = draw_map(found(3), room_of([[0.0, -1.0, 1.0, -1.0]], [(0.5, -0.5, 0.25)]))
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


def test_features_of_two_places_are_called_possible() -> None:
    left, _ = draw_map(found(2)).axes
    assert line(left, "possible corner") == [[1.5, 2.0]]
    assert "corner" not in [one.get_label() for one in left.lines]


def test_echoes_that_are_not_determined_make_one_plan() -> None:
    figure = draw_map(replace(found(3), followed_room=None))
    assert len(figure.axes) == 1
    (legend,) = figure.legends
    figure.draw_without_rendering()
    box = legend.get_window_extent()
    assert 0 <= box.x0 < box.x1 <= figure.bbox.width


def test_the_legend_names_what_is_drawn() -> None:
    whole = found(3)
    bare = replace(whole.plain, features=Features((), (), ()))
    for layer, expected in ((whole.plain, {"region of constant depth", "wall", "corner", "edge"}), (bare, set())):
        (legend,) = draw_map(replace(whole, plain=layer, direct=layer)).legends
        named = {text.get_text() for text in legend.get_texts()}
        assert named == expected | {"sensor", "empty", "unknown", "occupied"}
