"""Figure 6: a room like Kuc and Siegel's, by an independent model of single reflections and by ray following."""

import math
from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from scipy.special import j1
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.paper.drawing import MEASURED, finish_plan, points, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene
from sonarhw_compare.pictures.overlay_picture import draw_room, mark_sensors
from sonarhw_compare.pictures.points import points_at

RAY_FOLLOWING = PaperScene("kuc_siegel", "figure6", (0.0, 360.0, 3.0))


def single_reflections(scene: PaperScene) -> FloatArray:
    """Return the ranges by single reflections at the headings of a scene, (n,) m; NaN: no echo."""
    scan = scene.scan
    return single_reflection_ranges(scan.room, scan.board, scan.place.position, scan.headings)


def single_readings_are_theirs(
    followed: PaperScene = RAY_FOLLOWING, model: Callable[[PaperScene], FloatArray] = single_reflections
) -> Claim:
    """Check that both models agree at headings with one reflection."""
    single = np.array([len(reading.via) == 1 for reading in followed.readings])
    apart = np.abs(followed.scan.ranges - model(followed))[single]
    both = apart[~np.isnan(apart)]
    return Claim(
        "readings by a single reflection are those of Kuc and Siegel's model",
        f"{single.sum()} headings with one reflection; an independent model of single reflections has an echo at "
        f"{len(both)} of them, and differs by at most {both.max(initial=0.0) * 1000:.1f} mm",
        bool(single.any()) and len(both) == int(single.sum()) and float(both.max()) < 1e-6,
    )


def several_reflections_are_missing(
    followed: PaperScene = RAY_FOLLOWING, model: Callable[[PaperScene], FloatArray] = single_reflections
) -> Claim:
    """Check that a model of single reflections has no readings by several."""
    several = np.array([len(reading.via) > 1 for reading in followed.readings])
    theirs = model(followed)[several]
    same = int((np.abs(followed.scan.ranges[several] - theirs) < 1e-6).sum())
    return Claim(
        "there are readings by several reflections, which their model does not include",
        f"{several.sum()} of {len(several)} headings; the independent model is silent at {np.isnan(theirs).sum()} of "
        f"them and agrees at {same}",
        float(several.mean()) > 0.25 and same == 0,
    )


def single_reflection_ranges(
    room: Room, board: Board, position: tuple[float, float], headings: FloatArray
) -> FloatArray:
    """Return the range of the nearest wall that is loud enough at each heading (rad), (n,) m; NaN without one.

    A wall reflects sound straight back from the foot of the perpendicular, if the foot is on the wall and in sight.
    Independent of ray following. Diffraction is left out: an edge is above a threshold of -35 dB only within 0.56 m.
    """
    sensor = np.array(position)
    feet = [_foot(sensor, wall) for wall in room.walls.reshape(-1, 2, 2)]
    found = np.full(len(headings), np.inf)
    for row, foot in enumerate(feet):
        if foot is None or _is_hidden(sensor, foot, np.delete(room.walls.reshape(-1, 2, 2), row, axis=0)):
            continue
        x, y = foot - sensor
        distance = math.hypot(x, y)
        levels = room.reflectances[row] * _disc_gain(headings - math.atan2(y, x), board, room) ** 2
        heard = (levels >= 10 ** (board.threshold_db / 20)) & (
            board.blanked_range(room.air) <= distance <= board.max_range
        )
        found[heard] = np.minimum(found[heard], distance)
    return np.where(np.isinf(found), np.nan, found)


def _foot(sensor: FloatArray, wall: FloatArray) -> FloatArray | None:
    """Return the foot of the perpendicular from the sensor, (2,) m; None if it is not on the wall (2, 2)."""
    start, along = wall[0], wall[1] - wall[0]
    part = float((sensor - start) @ along / (along @ along))
    return np.asarray(start + part * along) if 0 <= part <= 1 else None


def _is_hidden(sensor: FloatArray, foot: FloatArray, walls: FloatArray) -> bool:
    """Return whether one of the walls (n, 2, 2) crosses the line between sensor and foot."""
    return any(
        _side(sensor, foot, start) * _side(sensor, foot, end) < 0
        and _side(start, end, sensor) * _side(start, end, foot) < 0
        for start, end in walls
    )


def _side(start: FloatArray, end: FloatArray, point: FloatArray) -> float:
    """Return a value that is positive on the left of the line from start to end, and negative on the right."""
    along, away = end - start, point - start
    return float(along[0] * away[1] - along[1] * away[0])


def _disc_gain(angles: FloatArray, board: Board, room: Room) -> FloatArray:
    """Return the pressure of a vibrating disc at angles (rad) from its axis, relative to straight ahead, one way."""
    wavelength = room.air.speed_of_sound / board.frequency
    x = math.tau / wavelength * board.aperture_radius * np.sin(angles)
    safe = np.where(np.abs(x) < 1e-9, 1.0, x)
    gain = np.where(np.abs(x) < 1e-9, 1.0, 2 * j1(safe) / safe) * np.cos(angles)
    return np.where(np.cos(angles) > 0, np.abs(gain), 0.0)


def _draw() -> Figure:
    figure = sheet(9, 7.4)
    axes = figure.add_subplot()
    draw_room(axes, RAY_FOLLOWING.scan.room)
    points(axes, RAY_FOLLOWING, "ray following")
    scan = RAY_FOLLOWING.scan
    where = points_at(scan.standpoints, scan.headings, single_reflections(RAY_FOLLOWING))
    axes.plot(*where.T, "x", color=MEASURED, ms=5, label="single reflections only (independent model)")
    mark_sensors(axes, RAY_FOLLOWING.scan.place.position)
    finish_plan(axes, "One room by two models, every 3°", (-3.8, 5.4, -2.9, 4.9), "upper left")
    return figure


EXHIBITS = (
    Exhibit(
        "figure6",
        "Figure 6: a room in the manner of Kuc and Siegel's",
        "Walls, inner corners and an outer corner. The dimensions are ours. Points far outside the walls are readings "
        "by several reflections. Kuc and Siegel's part is predicted without the engine: the feet of the perpendiculars "
        "on the walls, if they are in sight, and the pattern of a disc. Edges are below the threshold here.",
        (RAY_FOLLOWING,),
        _draw,
        (single_readings_are_theirs, several_reflections_are_missing),
    ),
)
