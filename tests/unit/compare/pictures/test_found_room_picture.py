"""The picture of a found room shows each echo by how the room explains it, and where sound touched a known room."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sonarhw_compare.drawings import draw_found_room
from sonarhw_compare.fit import PlacedScan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray, Reading
from tests.fixtures.rooms_for_tests import polygon_room

BOARD = load_board("paper")
KNOWN = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
PLACE = Place("", (1.0, 0.7))
HEADINGS = np.radians(np.arange(0.0, 360.0, 5.0))


@pytest.fixture(scope="module")
def scan() -> PlacedScan:
    """A predicted scan whose first reading is false: its echo has no path."""
    speed = KNOWN.air.speed_of_sound
    ranges = predict_scan(KNOWN, PLACE, BOARD, HEADINGS).ranges.tolist()
    times = [() if np.isnan(one) else (2 * one / speed,) for one in (1.3, *ranges[1:])]
    readings = [
        Reading(number, 0, 0, angle, 0.1 * number, time, speed)
        for number, (angle, time) in enumerate(zip(HEADINGS.tolist(), times, strict=True))
    ]
    return PlacedScan(readings, PLACE)


def drawn(figure: Figure, plan: int, label: str) -> FloatArray:
    """Return the points of the line with this label, (n, 2) m."""
    axes: Axes = figure.axes[plan]
    (line,) = (one for one in axes.lines if one.get_label() == label)
    return np.asarray(line.get_xydata())


def test_echoes_are_drawn_by_the_kind_of_their_path(scan: PlacedScan) -> None:
    figure = draw_found_room([scan], KNOWN, BOARD)
    assert len(figure.axes) == 2
    np.testing.assert_allclose(drawn(figure, 0, "echo: no path in the found room"), [[2.3, 0.7]])
    once = drawn(figure, 0, "echo: one reflection")
    # the wall that the place faces at 0.7 m: a range of 0.7 m at 270 degrees
    assert np.abs(once - (1.0, 0.0)).max(axis=1).min() < 1e-3
    echoes = sum(reading.range is not None for reading in scan.readings)
    several = drawn(figure, 0, "echo: several reflections")
    assert len(once) + len(several) + 1 == echoes


def test_open_ends_and_touches_of_a_known_room_are_drawn(scan: PlacedScan) -> None:
    found = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0)])
    figure = draw_found_room([scan], found, BOARD, [(0.0, 2.0)], KNOWN)
    assert len(figure.axes) == 3
    assert drawn(figure, 1, "open end").tolist() == [[0.0, 2.0]]
    touched = drawn(figure, 2, "touched by sound on its way to an echo")
    on_wall = [np.abs(touched[:, axis] - at) < 1e-6 for axis, at in ((0, 0.0), (0, 3.0), (1, 0.0), (1, 2.0))]
    assert np.any(on_wall, axis=0).all()
    assert np.abs(touched - (1.0, 0.0)).max(axis=1).min() < 1e-6


def test_names_do_not_cover_each_other(scan: PlacedScan) -> None:
    room: Room = KNOWN
    middles = [tuple(one.xyann) for one in draw_found_room([scan], room, BOARD).axes[1].texts]
    assert len(middles) == len(room.names)
    twice = replace(
        room,
        walls=np.vstack([room.walls, room.walls + 0.01]),
        names=(*room.names, *(f"{name} again" for name in room.names)),
        reflectances=np.tile(room.reflectances, 2),
        scattered=np.tile(room.scattered, 2),
        heights=np.tile(room.heights, (2, 1)),
        materials=room.materials * 2,
    )
    assert len(draw_found_room([scan], twice, BOARD).axes[1].texts) == len(room.names)
