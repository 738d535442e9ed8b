"""Figures 10 to 13: the corner of two boxes in open space, with an obtuse and with a right angle."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.optimize import brentq
from sonarhw_sim.air import Model
from sonarhw_sim.board.beam import beam_gain

from sonarhw_compare.paper.drawing import Bounds, label_walls, mark_silence, note, plan, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene, PredictedReading, ranges, span
from sonarhw_compare.pictures.points import points_at

OBLIQUE = PaperScene("oblique_corner", "near", (-60.0, 63.0, 3.0))
OBLIQUE_FAR = replace(OBLIQUE, place="far")
RIGHT = PaperScene("right_corner", "figure12", (-30.0, 123.0, 3.0))
RIGHT_NEARER = replace(RIGHT, place="figure13")
Parts: TypeAlias = tuple[tuple[str, ...], ...]  # the paths of neighbouring readings, by heading; (): silence
_RIGHT_PARTS: Parts = (("right",), (), ("upper", "right"), (), ("upper",))
_OBLIQUE_PARTS: Parts = (("lower",), (), ("upper",))


def walls_do_not_meet(scene: PaperScene = OBLIQUE) -> Claim:
    """Check that there is a gap of headings and of ranges between the walls."""
    lower, upper = scene.readings_via("lower"), scene.readings_via("upper")
    if not (lower and upper):
        return Claim(_APART, "one of the walls is not detected", False)
    between = [reading for reading in scene.readings if lower[-1].degrees < reading.degrees < upper[0].degrees]
    jump = ranges(lower)[-1] - ranges(upper)[0]
    return Claim(
        _APART,
        f"`lower` {ranges(lower)[0]:.3f} m over {span(lower)}, `upper` {ranges(upper)[0]:.3f} m over {span(upper)}; "
        f"{len(between)} silent headings between them, and {jump * 1000:.0f} mm of range",
        len(between) > 0 and not ranges(between) and abs(jump) > 0.05,
    )


_APART = "an oblique corner looks like two walls that do not meet"


def lower_is_seen_behind_upper(scene: PaperScene = OBLIQUE) -> Claim:
    """Check that the arc of the lower wall extends behind the upper wall."""
    truly = replace(scene, model=Model.NEAREST)
    behind = [
        reading.range - wall.range
        for reading, wall in zip(scene.readings, truly.readings, strict=True)
        if reading.via == ("lower",) and wall.via == ("upper",) and reading.range and wall.range
    ]
    nearer = min(ranges(scene.readings_via("upper")), default=math.inf) < min(
        ranges(scene.readings_via("lower")), default=math.inf
    )
    deepest = max(behind, default=0.0)
    return Claim(
        "the lower wall is seen behind the true position of the nearer, upper wall",
        f"{len(behind)} readings of `lower` are behind `upper`, by up to {deepest * 1000:.0f} mm",
        nearer and len(behind) >= 2 and deepest > 0.02,
    )


def oblique_almost_unchanged(scene: PaperScene = OBLIQUE_FAR, nearer: PaperScene = OBLIQUE) -> Claim:
    """Check that the walls and the silence between them are almost as wide from a nearer place."""
    return _unchanged(scene, nearer, _OBLIQUE_PARTS)


def oblique_walls_are_lost_off_the_axis(scene: PaperScene = OBLIQUE) -> Claim:
    """Check that no wall returns an echo beyond the critical angle."""
    return _lost_beyond_the_critical_angle(scene, (("upper",), ("lower",)))


def corner_is_a_tangential_wall(scene: PaperScene = RIGHT) -> Claim:
    """Check that the corner has one range, that of its vertex."""
    corner = _corner(scene)
    away = math.dist(scene.scan.place.position, _vertex(scene))
    off = max((abs(distance - away) for distance in ranges(corner)), default=math.inf)
    return Claim(
        "the corner becomes a wall tangential to it",
        f"one range over {span(corner)}, {ranges(corner)[0] if corner else math.nan:.3f} m; the vertex is "
        f"{away:.3f} m away",
        len(corner) >= 5 and off < 1e-3,
    )


def hole_at_each_side(scene: PaperScene = RIGHT) -> Claim:
    """Check that there is silence between the corner and each wall."""
    seen = _widths(scene, _RIGHT_PARTS)
    found = f"{seen[1]} silent headings before it, {seen[3]} after it" if seen else "no corner between two walls"
    return Claim("with one hole on each side", found, seen is not None)


def almost_unchanged_from_nearer(scene: PaperScene = RIGHT, nearer: PaperScene = RIGHT_NEARER) -> Claim:
    """Check that corner and holes are almost as wide from a nearer place."""
    return _unchanged(scene, nearer, _RIGHT_PARTS)


def _unchanged(scene: PaperScene, nearer: PaperScene, parts: Parts) -> Claim:
    first, second = _widths(scene, parts), _widths(nearer, parts)
    if first is None or second is None:
        return Claim(_UNCHANGED, "no corner between two walls", False)
    moved = math.dist(scene.scan.place.position, _vertex(scene)) - math.dist(
        nearer.scan.place.position, _vertex(nearer)
    )
    names = [" > ".join(via) or "silence" for via in parts]
    before, after = (", ".join(f"{name} {wide}" for name, wide in zip(names, w, strict=True)) for w in (first, second))
    return Claim(
        _UNCHANGED,
        f"{moved:.3f} m nearer; headings of each part: {before}; then {after}",
        moved > 0.3 and largest_difference(first, second) <= 1,
    )


_UNCHANGED = "almost unchanged as the robot moves towards it"


def right_walls_are_lost_off_the_axis(scene: PaperScene = RIGHT) -> Claim:
    """Check that no wall returns an echo beyond the critical angle."""
    return _lost_beyond_the_critical_angle(scene, (("upper",), ("right",), ("upper", "right")))


def _widths(scene: PaperScene, parts: Parts) -> list[int] | None:
    """Return the number of headings of each part, in order; None if the readings have other parts."""
    runs = [(via, len(list(run))) for via, run in groupby(reading.via for reading in scene.readings)]
    while runs and runs[0][0] == ():
        runs.pop(0)
    while runs and runs[-1][0] == ():
        runs.pop()
    return [wide for _, wide in runs] if tuple(via for via, _ in runs) == parts else None


def largest_difference(first: Sequence[int], second: Sequence[int]) -> int:
    """Return the largest difference of two widths of the same part."""
    return max(abs(one - other) for one, other in zip(first, second, strict=True))


def _corner(scene: PaperScene) -> list[PredictedReading]:
    return scene.readings_via("upper", "right")


def _vertex(scene: PaperScene) -> tuple[float, float]:
    """Return the point where the two boxes meet, m."""
    x, y = scene.scan.room.walls[0][2:]
    return float(x), float(y)


def _lost_beyond_the_critical_angle(scene: PaperScene, paths: tuple[tuple[str, ...], ...]) -> Claim:
    """Check that each path is detected up to the angle at which its level falls below the threshold, and no farther."""
    scan = scene.scan
    largest = max(
        (_off_axis(scene, reading) for via in paths for reading in scene.readings_via(*via)), default=math.nan
    )
    others = [reading for reading in scene.readings if reading.via not in ((), *paths)]
    critical = _critical_degrees(scene)
    return Claim(
        "beyond the critical angle a wall in the open is lost",
        f"echoes up to {largest:.0f}° from normal incidence; a perfect wall falls below the threshold of "
        f"{scan.board.threshold_db:g} dB at {critical:.1f}°; {np.isnan(scan.ranges).sum()} of {len(scan.headings)} "
        "headings are silent",
        critical - 2 * scene.degrees[2] < largest < critical and not others and bool(np.isnan(scan.ranges).any()),
    )


def _off_axis(scene: PaperScene, reading: PredictedReading) -> float:
    """Return the angle between the axis and the departing sound of a reading, degrees."""
    scan = scene.scan
    row = next(k for k, other in enumerate(scene.readings) if other is reading)
    departure = scan.paths.departures[scan.winners[row]]
    return abs((math.degrees(departure) - reading.degrees + 180) % 360 - 180)


def _critical_degrees(scene: PaperScene) -> float:
    """Return the angle at which the main lobe, in both directions, falls to the threshold, degrees."""
    board = scene.scan.board
    ka = board.wavenumber(scene.scan.room.air) * board.aperture_radius
    null = math.asin(3.8317 / ka)

    def over(angle: float) -> float:
        return 40 * math.log10(float(beam_gain(np.array([angle]), ka)[0])) - board.threshold_db

    return math.degrees(brentq(over, 1e-3, null * 0.999))


def _draw_oblique() -> Figure:
    figure = sheet(11, 6)
    bounds = (-0.5, 1.3, -1.05, 0.75)
    places = ((OBLIQUE, "near"), (OBLIQUE_FAR, "1.5 times as far"))
    for axes, (scene, title) in zip(figure.subplots(1, 2), places, strict=True):
        _draw_corner(axes, scene, f"oblique corner, {title}", bounds, ("upper", "lower"))
        _note_at(axes, scene, scene.readings_via("lower")[-1], "lower,\nbehind upper", (0.3, 0.12))
    return figure


def _draw_right() -> Figure:
    figure = sheet(11, 6)
    bounds = (-0.35, 1.05, -0.5, 1.05)
    places = ((RIGHT, "first place"), (RIGHT_NEARER, "nearer"))
    for axes, (scene, title) in zip(figure.subplots(1, 2), places, strict=True):
        _draw_corner(axes, scene, f"right-angle corner, {title}", bounds, ("upper", "right"))
        _note_at(axes, scene, _corner(scene)[3], "the corner, as a wall", (-0.35, -0.17))
    return figure


def _draw_corner(axes: Axes, scene: PaperScene, title: str, bounds: Bounds, walls: tuple[str, str]) -> None:
    mark_silence(axes, scene, 0.18)
    label_walls(axes, scene, walls)
    plan(axes, scene, title, bounds, "lower left")


def _note_at(axes: Axes, scene: PaperScene, reading: PredictedReading, text: str, aside: tuple[float, float]) -> None:
    """Write text beside the point of one reading."""
    headings, distances = np.radians([reading.degrees]), np.array(ranges([reading]))
    x, y = points_at(scene.scan.place.position, headings, distances)[0]
    note(axes, text, (x, y), (x + aside[0], y + aside[1]))


EXHIBITS = (
    Exhibit(
        "figure10_11",
        "Figures 10 and 11: an oblique corner",
        "Two boxes at an obtuse angle in open space, one reading every 3°. The dimensions are ours: the upper box is "
        "120 mm nearer, and the corner is near the perpendicular foot on the lower box, so that the arc of the lower "
        "box extends behind the upper one.",
        (OBLIQUE, OBLIQUE_FAR),
        _draw_oblique,
        (
            walls_do_not_meet,
            lower_is_seen_behind_upper,
            oblique_almost_unchanged,
            oblique_walls_are_lost_off_the_axis,
        ),
    ),
    Exhibit(
        "figure12_13",
        "Figures 12 and 13: a right-angle corner",
        "Two boxes at a right angle in open space, one reading every 3°, from two places; the second is nearer to the "
        "corner. The dimensions are ours.",
        (RIGHT, RIGHT_NEARER),
        _draw_right,
        (
            corner_is_a_tangential_wall,
            hole_at_each_side,
            almost_unchanged_from_nearer,
            right_walls_are_lost_off_the_axis,
        ),
    ),
)
