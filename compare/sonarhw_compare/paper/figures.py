"""All figures of the paper, drawn by the model, with the claims of its text and the page that lists them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from textwrap import fill
from typing import TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from scipy.optimize import brentq
from scipy.special import j1
from sonarhw_sim.air import Air, EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.board.beam import ComplexArray, beam_gain, burst_loss, impulse_response, square_burst
from sonarhw_sim.board.profile import Board
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray, points_at
from sonarhw_compare.drawings import draw_room, mark_sensors
from sonarhw_compare.paper.scenes import (
    GREEN,
    ORANGE,
    Bounds,
    Claim,
    Exhibit,
    PaperScene,
    PredictedReading,
    finish_plan,
    label_walls,
    mark_silence,
    note,
    plan,
    points,
    ranges,
    sheet,
    span,
)
from sonarhw_compare.picture_file import picture_bytes
from sonarhw_compare.pictures import MEASURED, PREDICTED, WALL

# Figure 5: the impulse response h_R convolved with the pulse, and the loss at each angle.
#
# The convolution is computed here in time, sample by sample, as in the paper's formula. The rest of the product uses
# spectra (`sonarhw_sim.board.beam`).


_FREQUENCY, _CYCLES = 49_412.0, 16  # the 6500's
_RATE = 8e6  # Hz
_SPEED = Air().speed_of_sound
_SLANT = 17.2  # degrees
_CHECKED = (-36.0, -20.0, -28.0)  # dB at that angle: carrier, peak, energy


def burst_off_the_axis(degrees: float = _SLANT, radius: float = 0.0192) -> Claim:
    """Check three measures of the loss at one angle."""
    carrier, peak, energy = _losses(degrees, radius)
    return Claim(
        "h_R convolved with the pulse gives the loss by angle, once on transmission and once on reception (the paper "
        "draws the loss but does not state values; -36, -20 and -28 dB were computed independently of this code)",
        f"at {degrees:g}°, both directions: carrier {carrier:.1f} dB, peak of the burst {peak:.1f} dB, its "
        f"energy {energy:.1f} dB",
        all(abs(value - expected) < 0.6 for value, expected in zip((carrier, peak, energy), _CHECKED, strict=True)),
    )


def loss_grows_to_the_first_null(radius: float = 0.0192) -> Claim:
    """Check the width of the main lobe."""
    angles = np.radians(np.arange(0, 30, 0.05))
    gains = beam_gain(angles, math.tau * _FREQUENCY / _SPEED * radius)
    rising = np.flatnonzero(np.diff(gains) > 0)
    null = math.degrees(angles[rising[0]]) if len(rising) else math.inf
    expected = math.degrees(math.asin(3.8317 / (math.tau * _FREQUENCY / _SPEED * 0.0192)))
    return Claim(
        "the farther from the axis, the larger the loss, until the contributions of the face cancel each other",
        f"the carrier's first null is at {null:.1f}°; that of a disc of 19.2 mm is at {expected:.1f}°",
        abs(null - expected) < 0.1,
    )


def _losses(degrees: float, radius: float) -> tuple[float, float, float]:
    """Return the losses of carrier, peak and energy of a burst in both directions together, dB."""
    burst = square_burst(_FREQUENCY, _CYCLES, _RATE)
    left = _convolved(burst, math.radians(degrees), radius, passes=2)
    gain = beam_gain(np.array([math.radians(degrees)]), math.tau * _FREQUENCY / _SPEED * radius)[0]
    energy = (np.abs(left) ** 2).sum() / (np.abs(burst) ** 2).sum()
    return 40 * math.log10(gain), 20 * math.log10(np.abs(left).max()), 10 * math.log10(energy)


def _convolved(burst: ComplexArray, angle: float, radius: float, passes: int) -> ComplexArray:
    """Return the burst convolved `passes` times with the response of the face at an angle (rad)."""
    half = math.ceil(radius * math.sin(angle) / _SPEED * _RATE) + 1
    times = np.arange(-half, half + 1) / _RATE
    response = impulse_response(times, angle, radius, _SPEED)
    # the samples miss part of the steep edges; the integral is known, so normalise it
    response *= math.cos(angle) / response.sum()
    for _ in range(passes):
        burst = np.convolve(burst, response)
    return burst


def _draw_beam() -> Figure:
    figure = sheet(10, 5.2)
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.15))
    burst = square_burst(_FREQUENCY, _CYCLES, _RATE)
    shown: list[tuple[float, ComplexArray]] = [(0.0, burst)]
    shown += [(degrees, _convolved(burst, math.radians(degrees), 0.0192, passes=1)) for degrees in (5.0, 10.0, _SLANT)]
    for row, (degrees, pulse) in enumerate(shown):
        times = (np.arange(len(pulse)) - len(pulse) / 2) / _RATE
        left.plot(times * 1e6, np.real(pulse) - 2.2 * row, color=PREDICTED, lw=0.8)
        left.text(-305, -2.2 * row, f"{degrees:g}°", fontsize=9, va="center")
    left.set(xlabel="time (µs)", ylabel="pulse at the face, one direction (common scale)", xlim=(-320, 320))
    left.set_yticks([])
    left.set_title("the pulse convolved with h_R", fontsize=11)
    _draw_losses(right)
    return figure


def _draw_losses(axes: Axes) -> None:
    degrees = np.arange(0.05, 40, 0.05)
    angles = np.radians(degrees)
    carrier = beam_gain(angles, math.tau * _FREQUENCY / _SPEED * 0.0192) ** 2
    burst = square_burst(_FREQUENCY, _CYCLES, _RATE / 4)
    peak, energy = burst_loss(angles, burst, _RATE / 4, 0.0192, _SPEED, passes=2)
    for values, colour, style, label in (
        (carrier, PREDICTED, "-", "carrier: used for the level of a path"),
        (peak, MEASURED, "--", "peak of a square 16-cycle burst"),
        (energy, GREEN, "-.", "energy of that burst"),
    ):
        axes.plot(degrees, _decibels(values), style, color=colour, label=label)
    axes.axvline(_SLANT, color="black", lw=0.8, ls=":")
    axes.text(_SLANT + 0.4, -4, f"{_SLANT}°", fontsize=9)
    axes.set(xlabel="angle from the axis (degrees)", ylabel="loss, both directions (dB)", ylim=(-80, 2), xlim=(0, 40))
    axes.set_title("loss by angle, a = 19.2 mm, 49.4 kHz", fontsize=11)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, loc="upper right")


def _decibels(amplitudes: FloatArray) -> FloatArray:
    return np.asarray(20 * np.log10(np.maximum(amplitudes, 1e-6)))


# Figures 10 to 13: the corner of two boxes in open space, with an obtuse and with a right angle.


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
    shown = f"{seen[1]} silent headings before it, {seen[3]} after it" if seen else "no corner between two walls"
    return Claim("with one hole on each side", shown, seen is not None)


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


# Section 3 of the paper: a sensor is moved along one wall of a long corridor, and its errors are correlated.
#
# An error is the range minus the distance of the nearest wall along the axis.


_STEP = 0.1  # m from place to place
_START = PaperScene("corridor", "-2,0.5", (0.0, 360.0, 5.0), "polaroid-6500", receiver=Receiver.FIRST_ECHO)
WALK = tuple(replace(_START, place=f"{x:.1f},0.5") for x in np.arange(-2, 2 + _STEP / 2, _STEP))
_ACROSS = (90.0, 270.0)  # degrees
_LONG = 1.0  # m
_ALIKE = 0.8  # correlation


def right_at_right_angles(walk: tuple[PaperScene, ...] = WALK) -> Claim:
    """Check the readings across the corridor."""
    worst = float(
        np.abs([errors(scene)[scene.readings.index(scene.at(degrees))] for scene in walk for degrees in _ACROSS]).max()
    )
    return Claim(
        "readings at right angles to the walls are correct",
        f"at 90 and 270° the largest error of {2 * len(walk)} readings is {worst * 1000:.1f} mm",
        worst < 1e-3,
    )


def long_ahead_and_behind(walk: tuple[PaperScene, ...] = WALK) -> Claim:
    """Check the readings along the corridor."""
    off = _all_errors(walk)
    long = np.nan_to_num(off) > _LONG
    from_axis = np.abs((np.degrees(walk[0].scan.headings) + 90) % 180 - 90)
    widest = float(from_axis[long.any(axis=0)].max(initial=0.0))
    return Claim(
        "ahead and behind there are reflections and long readings",
        f"{long.sum()} of {np.isfinite(off).sum()} readings are too long by over {_LONG:g} m, the longest by "
        f"{np.nanmax(off):.1f} m; all within {widest:.0f}° of the corridor's direction",
        bool(long.sum() > len(walk)) and 0 < widest <= 60,
    )


def errors_are_correlated_between_headings(walk: tuple[PaperScene, ...] = WALK) -> Claim:
    """Check that neighbouring headings have similar errors."""
    off = _all_errors(walk)
    coefficient, pairs = correlation(off, np.roll(off, -1, axis=1))
    return Claim(
        "errors are correlated from one heading to the next",
        f"coefficient {coefficient:.2f}, over {pairs} pairs of readings {walk[0].degrees[2]:g}° apart",
        coefficient > _ALIKE,
    )


def errors_are_correlated_between_places(walk: tuple[PaperScene, ...] = WALK) -> Claim:
    """Check that neighbouring places have similar errors, also after the mean error of each heading is removed."""
    off = _all_errors(walk)
    coefficient, pairs = correlation(off[:-1], off[1:])
    masked = np.ma.masked_invalid(off)
    rest = np.ma.filled(masked - masked.mean(axis=0), np.nan)
    left, _ = correlation(rest[:-1], rest[1:])
    return Claim(
        "errors are correlated from one position to the next",
        f"coefficient {coefficient:.2f}, over {pairs} pairs of readings {_STEP:g} m apart; {left:.2f} after the mean "
        "error of each heading is subtracted",
        min(coefficient, left) > _ALIKE,
    )


def errors(scene: PaperScene) -> FloatArray:
    """Return the error of every reading, `(n,)` float, m; NaN without an echo."""
    truth = replace(scene, model=Model.NEAREST, seed=None)
    return np.asarray(scene.scan.ranges - truth.scan.ranges)


def correlation(first: FloatArray, second: FloatArray) -> tuple[float, int]:
    """Return the correlation coefficient of two arrays and the number of pairs used; pairs with NaN are ignored."""
    both = np.isfinite(first) & np.isfinite(second)
    return float(np.corrcoef(first[both], second[both])[0, 1]), int(both.sum())


def _all_errors(walk: tuple[PaperScene, ...]) -> FloatArray:
    """Return the errors of all scans, `(places, headings)` float, m."""
    return np.array([errors(scene) for scene in walk])


def _draw_corridor() -> Figure:
    figure = sheet(10, 8)
    top, bottom = figure.subplots(2, 1, height_ratios=(1, 1.35))
    middle = WALK[len(WALK) // 2]
    draw_room(top, middle.scan.room)
    top.plot((-2, 2), (0.5, 0.5), "-", color=MEASURED, lw=2.5, label="positions of the sensor")
    points(top, middle, "predicted from the middle position")
    mark_sensors(top, middle.scan.place.position)
    finish_plan(top, "a corridor 20 m long and 1.8 m wide", (-11.2, 11.2, -4.6, 5.4), "upper center")
    _draw_errors(bottom, figure)
    return figure


def _draw_errors(axes: Axes, figure: Figure) -> None:
    off = _all_errors(WALK)
    places = [float(scene.place.partition(",")[0]) for scene in WALK]
    step = WALK[0].degrees[2]
    extent = (-step / 2, 360 - step / 2, places[0] - _STEP / 2, places[-1] + _STEP / 2)
    axes.set_facecolor("#EEEEEE")
    image = axes.imshow(off, origin="lower", aspect="auto", extent=extent, cmap="cividis", interpolation="nearest")
    figure.colorbar(image, ax=axes, label="range minus distance of the wall (m)")
    axes.set(xlabel="heading (degrees)", ylabel="position along the corridor (m)", xticks=range(0, 360, 30))
    axes.set_title("error of every reading; light grey: no echo", fontsize=11)


# Figures 3 and 4: three scans of a laboratory from a table top, drawn in one plan.


SCANS = tuple(
    PaperScene("figure3_4", "table", (start, start + 360, 5.0), "polaroid-6500", receiver=Receiver.FIRST_ECHO)
    for start in (0.0, 1.5, 3.0)
)
BESIDE_THE_BLACKBOARD = replace(SCANS[0], place="beside")
BESIDE_THE_CLOSET = tuple(replace(scene, place="corner") for scene in SCANS)
_CORNER = "closet-front/closet-side"
_TO_THE_WALL = 270.0  # degrees
_PROTRUSION = 0.020  # m


def near_wall_over_a_short_span(scenes: tuple[PaperScene, ...] = SCANS) -> Claim:
    """Check the readings of the blackboard and beside it."""
    readings = _together(scenes)
    middle = next(k for k, reading in enumerate(readings) if reading.degrees == _TO_THE_WALL)
    first = last = middle
    while readings[first - 1].via == readings[middle].via:
        first -= 1
    while readings[last + 1].via == readings[middle].via:
        last += 1
    wall, beyond = readings[first : last + 1], ranges([readings[first - 1], readings[last + 1]])
    near = ranges(wall)[0]
    return Claim(
        "the nearer wall is found over a short span, and beside it readings are very long",
        f"{near:.3f} m over {span(wall)}, then {' and '.join(f'{far:.2f} m' for far in beyond)}",
        wall[-1].degrees - wall[0].degrees < 40 and len(beyond) == 2 and min(beyond) > 2 * near,
    )


def blackboard_moves_the_wall(before: PaperScene = SCANS[0], beside: PaperScene = BESIDE_THE_BLACKBOARD) -> Claim:
    """Compare the readings in front of the blackboard and in front of the bare wall."""
    blackboard, bare = before.at(_TO_THE_WALL).range, beside.at(_TO_THE_WALL).range
    moved = math.nan if blackboard is None or bare is None else bare - blackboard
    return Claim(
        "a blackboard that protrudes 20 mm from its wall moves the wall",
        f"{bare:.3f} m in front of the wall, {blackboard:.3f} m in front of the blackboard: {moved * 1000:.1f} mm",
        abs(moved - _PROTRUSION) < 1e-3,
    )


def protruding_corner_is_strong(
    scenes: tuple[PaperScene, ...] = SCANS, beside: tuple[PaperScene, ...] = BESIDE_THE_CLOSET
) -> Claim:
    """Check the level of the outer corner, a sharp edge."""
    readings, level = _readings_off(scenes, _CORNER), _loudest(scenes, _CORNER)
    threshold = scenes[0].scan.board.threshold_db
    return Claim(
        "a protruding corner returns a strong echo",
        f"a sharp edge, far from the normals of both its faces: {level:.1f} dB, {len(readings)} readings, threshold "
        f"{threshold:g} dB; 8° beside the normal of one face, where an edge is loud: "
        f"{_loudest(beside, _CORNER):.1f} dB, {len(_readings_off(beside, _CORNER))} readings",
        len(readings) >= 5 and level > threshold + 12,
    )


def person_is_strong(scenes: tuple[PaperScene, ...] = SCANS, person: str = "person") -> Claim:
    """Check that the person is loud, and appears wider than its true angle."""
    readings, level, wide = _readings_off(scenes, person), _loudest(scenes, person), _width(scenes[0], person)
    seen = 5.0 / len(scenes) * len(readings)
    return Claim(
        "people return strong echoes",
        f"{len(readings)} readings over {seen:.0f}°, up to {level:.1f} dB; the person is {wide:.0f}° wide",
        seen > 1.2 * wide and level > scenes[0].scan.board.threshold_db + 12,
    )


def pillar_is_half_lost(scenes: tuple[PaperScene, ...] = SCANS, pillar: str = "pillar") -> Claim:
    """Check which headings towards the pillar read it, and that at the others the sound goes on to other walls."""
    towards = [reading for reading in _together(scenes) if _points_at(scenes[0], reading.degrees, pillar)]
    read = [reading for reading in towards if reading.via == (pillar,)]
    lost = [reading for reading in towards if reading.via != (pillar,)]
    away = sum(pillar in reading.via for reading in lost)
    near, others = min(ranges(read), default=math.nan), min(ranges(lost), default=math.inf)
    return Claim(
        "only half of a pillar is detected, because part of the signal is reflected away",
        f"{len(read)} of the {len(towards)} headings towards it read it, at {near:.2f} m; the others read at least "
        f"{others:.2f} m, {away} of them by the pillar and another wall",
        bool(towards) and 0.35 <= len(read) / len(towards) <= 0.65 and others > 2 * near and away > 0,
    )


def _together(scenes: tuple[PaperScene, ...]) -> list[PredictedReading]:
    """Return all readings sorted by heading, from 0 to 360°."""
    readings = [replace(reading, degrees=reading.degrees % 360) for scene in scenes for reading in scene.readings]
    return sorted(readings, key=lambda reading: reading.degrees)


def _readings_off(scenes: tuple[PaperScene, ...], name: str) -> list[PredictedReading]:
    """Return the readings by one reflection off an object, sorted by heading from -180 to 180°."""
    readings = [reading for scene in scenes for reading in scene.readings_via(name)]
    turned = [replace(reading, degrees=(reading.degrees + 180) % 360 - 180) for reading in readings]
    return sorted(turned, key=lambda reading: reading.degrees)


def _loudest(scenes: tuple[PaperScene, ...], name: str) -> float:
    """Return the highest level of the echo by one reflection off an object, dB."""
    return max(float(level) for scene in scenes for level in _levels(scene, name))


def _levels(scene: PaperScene, name: str) -> list[float]:
    """Return the level at each heading of the echo by one reflection off an object, dB."""
    scan = scene.scan
    path = _straight_from(scan.paths, scan.room, name)
    pings = (scan.ping(k) for k in range(len(scan.headings)))
    return [float(ping.levels[path]) if path is not None else -math.inf for ping in pings]


def _straight_from(paths: Paths, room: Room, name: str) -> int | None:
    rows = (k for k in range(len(paths)) if paths.via(k, room) == (name,))
    return next(rows, None)


def _width(scene: PaperScene, post: str) -> float:
    """Return the angular width of a post as seen from the sensor, degrees."""
    away, radius = _towards(scene, post)
    return 2 * math.degrees(math.asin(radius / np.hypot(*away)))


def _points_at(scene: PaperScene, degrees: float, post: str) -> bool:
    """Return whether the axis at this heading meets a post."""
    (x, y), _ = _towards(scene, post)
    aside = (degrees - math.degrees(math.atan2(y, x)) + 180) % 360 - 180
    return abs(aside) <= _width(scene, post) / 2


def _towards(scene: PaperScene, post: str) -> tuple[FloatArray, float]:
    """Return the vector from the sensor to the centre of a post, and its radius, m."""
    room = scene.scan.room
    x, y, radius = room.posts[room.names.index(post) - len(room.walls)]
    return np.array([x, y]) - scene.scan.place.position, float(radius)


def _draw_laboratory() -> Figure:
    figure = sheet(9, 8)
    axes = figure.add_subplot()
    draw_room(axes, SCANS[0].scan.room)
    looks = ((PREDICTED, "o"), (MEASURED, "s"), (GREEN, "D"))
    for scene, (colour, marker) in zip(SCANS, looks, strict=True):
        points(axes, scene, f"every 5° from {scene.degrees[0]:g}°", colour, marker, 4)
    mark_sensors(axes, SCANS[0].scan.place.position)
    note(axes, "blackboard", (1.8, 0.02), (1.8, 0.55))
    note(axes, "outer corner", (3.6, 3.0), (2.9, 2.6))
    note(axes, "person", (3.7, 1.5), (3.2, 1.0))
    note(axes, "pillar, half lost", (1.121, 1.95), (1.2, 2.75))
    finish_plan(axes, "Laboratory: three scans in one plan", (-5.2, 8.8, -5.2, 6.8), "upper left")
    return figure


# Figures 1 and 2: a plate in front of the transducer, and the raw receive signal of one ping.
#
# Four scenes: no target; the plate tilted; the plate parallel; the plate at 45°, with a cabinet that is detected only
# by reflection off the plate.


_STRAIGHT = (0.0, 1.0, 1.0)
NO_TARGET = PaperScene("figure2a", "stand", _STRAIGHT, "polaroid-6500", Unit.REFLECT, Receiver.FIRST_ECHO, noise=0.001)
TILTED = replace(NO_TARGET, room="figure2b")
PARALLEL = replace(NO_TARGET, room="figure2c")
# by the uniform theory, the small echo is 9 dB fainter than by the paper's factor
AT_45 = replace(NO_TARGET, room="figure2d", edge_strength=EdgeStrength.PAPER)
PLATE_TURNED = replace(AT_45, room="figure2d_turned")
_TRACE_RATE = 500e3  # Hz
_FARTHEST = 4.6  # m, in the picture
_PLATE = (0.65, 1.2)  # m: ranges of a direct echo of the plate at 45°
_CABINET = (1.9, 2.4)  # m: ranges of the echo of the cabinet by reflection off the plate
_MAGNIFIED = 50
_SILENCE = 1e-5  # amplitude; -100 dB


def nothing_returns(scene: PaperScene = NO_TARGET) -> Claim:
    """Check figure 2a: noise, and no echo."""
    loudest, board = _noise_peak(scene), scene.scan.board
    return Claim(
        "(a) no target: only the tail of the chirp, at the left",
        f"from the end of blanking to {board.max_range:g} m only noise of {_level(scene.noise)} (rms, ours), at most "
        f"{_level(loudest)}; the threshold is {board.threshold_db:g} dB",
        scene.noise < loudest < 10 ** (board.threshold_db / 20),
    )


def one_echo(scene: PaperScene = TILTED) -> Claim:
    """Check figure 2b: one echo."""
    echoes = scene.scan.ping(0).echoes
    return Claim(
        "(b) plate tilted: one clean echo",
        f"above the threshold: echoes at {', '.join(f'{echo.range:.3f} m' for echo in echoes) or 'no range'}",
        len(echoes) == 1,
    )


def many_echoes(scene: PaperScene = PARALLEL) -> Claim:
    """Check figure 2c: many evenly spaced echoes."""
    echoes = np.array([echo.range for echo in scene.scan.ping(0).echoes])
    gaps = np.diff(echoes)
    even = len(echoes) > 1 and float(np.ptp(gaps)) < 1e-3
    spacing = f", {gaps.mean():.3f} m apart" if len(gaps) else ""
    return Claim(
        "(c) plate parallel: many echoes, back and forth between plate and transducer",
        f"echoes: {len(echoes)}{spacing}",
        even and len(echoes) >= 5,
    )


def strongest_is_reflected_by_the_plate(scene: PaperScene = AT_45) -> Claim:
    """Check figure 2d: the large echo and the small one before it."""
    early, late = _echo(scene, *_PLATE), _echo(scene, *_CABINET)
    scan = scene.scan
    strongest = int(np.argmax(scan.ping(0).levels))
    via = scan.paths.via(strongest, scan.room)
    return Claim(
        "(d) plate at 45°: the strongest echo goes plate, far object, plate; a small earlier echo comes directly from "
        "the plate",
        f"strongest {' > '.join(via)} at {scan.paths.lengths[strongest] / 2:.3f} m, {_level(late)}; before it the "
        f"plate itself at {scan.paths.lengths[0] / 2:.3f} m, {_level(early)}",
        via == ("plate", "cabinet", "plate") and _noise_peak() < early < late / 10,
    )


def small_echo_vanishes(scene: PaperScene = AT_45, turned: PaperScene = PLATE_TURNED) -> Claim:
    """Check figure 2d after a small turn of the plate: the small echo is lost in noise, the strong one is not."""
    before, after = _echo(scene, *_PLATE), _echo(turned, *_PLATE)
    strong_before, strong_after = _echo(scene, *_CABINET), _echo(turned, *_CABINET)
    noise = _noise_peak()
    vanishes = after < noise < before
    why = "" if vanishes else ": a sharp edge diffracts to all sides, and the mirrored cabinet turns away sooner"
    return Claim(
        "(d) the small echo disappears after a slight turn of the plate",
        f"plate turned by 3°: its echo from {_level(before)} to {_level(after)}, noise at most {_level(noise)}, "
        f"strongest echo from {_level(strong_before)} to {_level(strong_after)}{why}",
        vanishes and strong_after > strong_before / 10,
    )


def _noise_peak(scene: PaperScene = NO_TARGET) -> float:
    """Return the highest amplitude of the trace after blanking."""
    board = scene.scan.board
    return _loudest_within(scene, board.blanked_range(scene.scan.room.air), board.max_range)


def _echo(scene: PaperScene, nearest: float, farthest: float) -> float:
    """Return the highest amplitude of the trace between two ranges (m), without its noise."""
    return _loudest_within(replace(scene, noise=0.0), nearest, farthest)


def _loudest_within(scene: PaperScene, nearest: float, farthest: float) -> float:
    """Return the highest amplitude of the trace between two ranges (m)."""
    ranges, samples = _envelope(scene, farthest + 0.1)
    return float(samples[(ranges > nearest) & (ranges < farthest)].max())


def _envelope(scene: PaperScene, farthest: float) -> tuple[FloatArray, FloatArray]:
    speed = scene.scan.room.air.speed_of_sound
    trace = scene.scan.ping(0).signal(2 * farthest / speed).envelope()
    return trace.times * speed / 2, trace.samples


def _level(amplitude: float) -> str:
    return "below -100 dB" if amplitude < _SILENCE else f"{20 * np.log10(amplitude):.1f} dB"


def _draw_plates() -> Figure:
    figure = sheet(9, 11.4)
    rows = figure.subplots(6, 1)
    panels = (
        (NO_TARGET, "(a) no target"),
        (TILTED, "(b) plate 1 m away, tilted by 4°"),
        (PARALLEL, "(c) plate 1 m away, parallel"),
        (AT_45, "(d) plate at 45°, cabinet reflected in it"),
    )
    for axes, (scene, title) in zip(rows, panels, strict=False):
        axes.plot(*_trace(scene, _FARTHEST), color=PREDICTED, lw=0.5)
        _finish(axes, title, _FARTHEST)
        axes.set_ylim(-1.1, 1.1)
    _draw_magnified(rows[4], f"(a) {_MAGNIFIED} times magnified: noise", _FARTHEST, ((NO_TARGET, "no target"),))
    near_edge = ((AT_45, "as above"), (PLATE_TURNED, "plate turned by 3°"))
    _draw_magnified(rows[5], f"(d) its first 1.4 m, {_MAGNIFIED} times magnified: the plate itself", 1.4, near_edge)
    rows[5].set_xlabel("range: speed of sound × time / 2 (m)")
    figure.supylabel("receive signal (1 is full scale)", fontsize=10)
    return figure


def _draw_magnified(axes: Axes, title: str, farthest: float, scenes: tuple[tuple[PaperScene, str], ...]) -> None:
    for (scene, label), colour in zip(scenes, (PREDICTED, MEASURED), strict=False):
        ranges, samples = _trace(scene, farthest)
        axes.plot(ranges, samples * _MAGNIFIED, color=colour, lw=0.8, label=label)
    _finish(axes, title, farthest)
    axes.set_ylim(-0.8, 0.8)
    axes.legend(fontsize=8, loc="upper right")


def _trace(scene: PaperScene, farthest: float) -> tuple[FloatArray, FloatArray]:
    speed = scene.scan.room.air.speed_of_sound
    samples = scene.scan.ping(0).signal(2 * farthest / speed).rf(_TRACE_RATE)
    return np.arange(len(samples)) / _TRACE_RATE * speed / 2, samples


def _finish(axes: Axes, title: str, farthest: float) -> None:
    axes.set_title(title, fontsize=10, loc="left")
    axes.set_xlim(0, farthest)
    axes.axhline(0, color=WALL, lw=0.4)
    axes.grid(alpha=0.25)


# Figures 7, 8 and 9: the room of shelving, as the unit measured it and as the paper's simulation predicted it.
#
# Also the robot in the text about figure 9, whose body blocks the sound of the false wall.


_ROUND = (0.0, 360.0, 3.0)
FIGURE_7 = PaperScene("simple", "figure7", _ROUND, unit=Unit.REFLECT)
FIGURE_7_BOARD = replace(FIGURE_7, board="polaroid-6500", receiver=Receiver.BOARD)
FIGURE_8 = replace(FIGURE_7, unit=Unit.BLOCK)
FIGURE_9 = PaperScene("simple", "figure9", _ROUND)
# the face is 85 mm from the lower wall, as in figure 9; the reach is limited, because a round body adds many long paths
ROBOT = replace(FIGURE_9, place="0.574,0.237", board="paper-b12", reach=2.0)
_HEIGHT = 0.742  # m, of the room
_NEAR_CIRCLE = 0.005  # m beyond blanking
_VERY_CLOSE = 0.6  # m
_WAVE = 0.05  # m: how far a corner must be behind the wall


def very_close_at_the_right(scene: PaperScene = FIGURE_7) -> Claim:
    """Check for very close readings over a span of headings, by sound between the right wall and the face."""
    reading = scene.at(0.0)
    wall, face = reading.via.count("right"), reading.via.count("unit")
    around = _within(scene, 15.0)
    close = [distance for distance in ranges(around) if distance < _VERY_CLOSE]
    return Claim(
        'on the right the unit reads "very close", where the paper\'s simulation returned infinity',
        f"{_metres(reading)} at 0°: the wall {wall} times and the unit's face {face} times; very close at {len(close)} "
        f"of the {len(around)} headings within 15°: our face is a mirror, which reflects the sound sideways when it is "
        "turned, and a real face, 5.5 wavelengths wide, also spreads it",
        len(close) > len(around) / 2 and wall == face + 1,
    )


def circle_of_minimum_range(scene: PaperScene = FIGURE_7_BOARD) -> Claim:
    """Check for readings at the end of blanking, in several directions."""
    blanked = scene.scan.board.blanked_range(scene.scan.room.air)
    close = [
        reading for reading in scene.readings if reading.range is not None and reading.range < blanked + _NEAR_CIRCLE
    ]
    walls = {reading.via[0] for reading in close}
    nearest = ranges(close)
    extent = f", at {min(nearest):.3f} to {max(nearest):.3f} m, towards {', '.join(sorted(walls))}" if nearest else ""
    return Claim(
        "a circle of readings of minimum range surrounds the unit",
        f"{len(close)} of {len(scene.readings)} readings within {_NEAR_CIRCLE * 1000:g} mm of the end of blanking"
        f"{extent}",
        len(close) >= 12 and walls >= {"top", "bottom", "right"},
    )


def far_wall_is_wavy(scene: PaperScene = FIGURE_8) -> Claim:
    """Check for two corners and the wall between them."""
    return Claim("the far wall is wavy: two corners, and the wall between them", *_wave(scene))


def far_wall_is_wavy_again(scene: PaperScene = FIGURE_9) -> Claim:
    """Check for the same wave from a place beside the lower wall."""
    shown, wavy = _wave(scene)
    beside = scene.scan.place.position[1]
    why = "" if wavy else f"; the lower wall is only {beside * 1000:.0f} mm aside, so that corner hardly stands back"
    return Claim("the far wall is wavy again", shown + why, wavy)


def _wave(scene: PaperScene) -> tuple[str, bool]:
    """Return the readings of two corners and the far wall between them, and whether both corners are behind it."""
    parts = [scene.readings_via(*via) for via in (("top", "left"), ("left",), ("bottom", "left"))]
    if not all(parts):
        return "one of its three parts is not detected", False
    upper, wall, lower = (ranges(part)[0] for part in parts)
    shown = "; ".join(f"{ranges(part)[0]:.3f} m over {span(part)}" for part in parts)
    behind = (upper - wall, lower - wall)
    in_order = parts[0][-1].degrees < parts[1][0].degrees and parts[1][-1].degrees < parts[2][0].degrees
    return (
        f"{shown}: the corners are {behind[0] * 1000:.0f} and {behind[1] * 1000:.0f} mm behind the wall",
        in_order and min(behind) > _WAVE,
    )


def nothing_near_at_the_right(scene: PaperScene = FIGURE_8) -> Claim:
    """Check the side on which the paper's simulation is silent."""
    nearest = min(ranges(_within(scene, 6.0)), default=math.inf)
    return Claim(
        "on the right the simulation returns infinity (our model follows the sound for longer, and a closed room of "
        "reflectance 0.95 always returns an echo: here only echoes that appear far outside the room)",
        f"nearest reading between -6 and 6°: {nearest:.3f} m; the wall is 0.094 m away",
        nearest > 1.5,
    )


def upper_wall_is_true(scene: PaperScene = FIGURE_9) -> Claim:
    """Check the reading of the far wall by one reflection."""
    reading = scene.at(90.0)
    return Claim(
        "the upper wall is at its true distance, 657 mm",
        f"{_metres(reading)} at 90°, {_path_text(reading)}",
        reading.via == ("top",) and reading.range is not None and abs(reading.range - 0.657) < 1e-3,
    )


def lower_wall_is_false(scene: PaperScene = FIGURE_9) -> Claim:
    """Check the reading of the near wall, whose sound goes to the far wall and back."""
    reading = scene.at(270.0)
    false = scene.readings_via("bottom", "top", "bottom")
    return Claim(
        "the lower wall, 85 mm away, is false: sound goes to the lower wall, past the unit to the upper, past the unit "
        "to the lower wall and to the unit",
        f"{_metres(reading)} at 270°, {_path_text(reading)}; the same over {span(false)}",
        reading.via == ("bottom", "top", "bottom")
        and reading.range is not None
        and abs(reading.range - 0.827) < 1e-3
        and len(false) >= 5,
    )


def corridor_of_twice_the_width(scene: PaperScene = FIGURE_9) -> Claim:
    """Check the sum of the readings of both walls."""
    up, down = scene.at(90.0).range, scene.at(270.0).range
    width = math.nan if up is None or down is None else up + down
    return Claim(
        "it looks like a corridor of twice the true width, with the robot nearer the true wall",
        f"{up:.3f} + {down:.3f} = {width:.3f} m; twice {_HEIGHT} m is {2 * _HEIGHT:.3f} m",
        up is not None and down is not None and abs(width - 2 * _HEIGHT) < 1e-3 and up < down,
    )


def body_removes_the_false_wall(scene: PaperScene = ROBOT) -> Claim:
    """Check the reading of the robot in front of the same wall."""
    reading = scene.at(270.0)
    false = [other for other in scene.readings if other.range is not None and abs(other.range - 0.827) < 0.02]
    rattling = set(reading.via) == {"bottom", "body"}
    return Claim(
        "on a B12 robot the body blocks the return, and the chirp travels between body and wall until minimum range",
        f"{_metres(reading)} at 270°, the wall {reading.via.count('bottom')} times and the body "
        f"{reading.via.count('body')} times; {len(false)} readings near 0.827 m",
        rattling and reading.range is not None and reading.range < 0.45 and not false,
    )


def _within(scene: PaperScene, degrees: float) -> list[PredictedReading]:
    """Return the readings at headings within `degrees` of 0°."""
    return [reading for reading in scene.readings if abs((reading.degrees + 180) % 360 - 180) <= degrees]


def _metres(reading: PredictedReading) -> str:
    return "no echo" if reading.range is None else f"{reading.range:.3f} m"


def _path_text(reading: PredictedReading) -> str:
    return f"by {' > '.join(reading.via)}" if reading.via else "by no path"


def _draw_7() -> Figure:
    figure = sheet(11, 5.6)
    left, right = figure.subplots(1, 2)
    bounds = (-0.6, 1.9, -0.9, 1.6)
    plan(left, FIGURE_7, "the paper's receiver, face reflecting", bounds, "center left")
    note(left, "0.470 m:\nwall 5 ×, face 4 ×", (1.304, 0.345), (1.36, 0.66))
    plan(right, FIGURE_7_BOARD, "the ranging board's own receiver", bounds, "center left")
    blanked = FIGURE_7_BOARD.scan.board.blanked_range(FIGURE_7_BOARD.scan.room.air)
    right.add_patch(Circle((0.834, 0.345), blanked, fill=False, ec=MEASURED, ls="--", lw=1.2))
    note(right, "minimum range", (0.834 - blanked * 0.71, 0.345 - blanked * 0.71), (0.1, -0.5))
    return figure


def _draw_8() -> Figure:
    figure = sheet(7.5, 6.5)
    axes = figure.add_subplot()
    plan(axes, FIGURE_8, "Figure 8: as the paper's simulation predicts it", (-0.7, 1.7, -0.75, 1.5))
    note(axes, "wavy far wall", (-0.02, 0.2), (-0.42, -0.35))
    note(axes, "nothing near", (0.928, 0.345), (1.35, 0.345))
    return figure


def _draw_9() -> Figure:
    figure = sheet(11, 5.8)
    left, right = figure.subplots(1, 2)
    bounds = (-0.8, 1.8, -1.2, 1.4)
    plan(left, FIGURE_9, "Figure 9", bounds)
    note(left, "true wall", (0.72, 0.742), (0.3, 1.1))
    note(left, "false wall", (0.75, -0.742), (0.3, -0.98))
    _draw_robot(right, bounds)
    return figure


def _draw_robot(axes: Axes, bounds: Bounds) -> None:
    draw_room(axes, ROBOT.scan.room)
    points(axes, ROBOT, "predicted")
    mark_sensors(axes, ROBOT.scan.place.position, "centre of its body")
    note(axes, "0.425 m: multiple reflections", (0.574, 0.085 - 0.425), (0.574, -0.9))
    finish_plan(axes, "the same wall in front of a B12 robot", bounds, "upper left")


# Figure 14: the rays of one reading, between walls that are labelled with their reflectances.


READING = replace(FIGURE_9, degrees=(270.0, 271.0, 1.0))
_LEGS = (0.085, 0.742, 0.742, 0.085)  # m
_OTHERS = 3  # echoes drawn after the first
_DRIFT = 0.05  # m: total sideways shift of rays that run back and forth on one line


def legs_of_the_reading(scene: PaperScene = READING) -> Claim:
    """Check the path of the false wall, leg by leg."""
    legs = _legs(scene)
    expected = len(legs) == len(_LEGS) and bool(np.allclose(legs, _LEGS, atol=1e-6))
    return Claim(
        "the rays of one reading: the lower wall, past the unit, the upper wall, past the unit, the lower wall",
        f"legs of {', '.join(f'{leg * 1000:.0f}' for leg in legs)} mm, "
        f"{legs.sum():.3f} m in total, a range of {legs.sum() / 2:.3f} m",
        expected,
    )


def level_is_the_product_of_reflectances(scene: PaperScene = READING) -> Claim:
    """Check that the level is the product of the reflectances."""
    scan, winner = scene.scan, int(scene.scan.winners[0])
    level = float(scan.ping(0).levels[winner])
    touched = [scan.room.reflectances[surface] for surface in scan.paths.surfaces[winner] if surface >= 0]
    expected = 20 * math.log10(math.prod(touched))
    return Claim(
        "walls are labelled with their reflectances, and each reduces the level",
        f"{' × '.join(f'{part:g}' for part in touched)} is {expected:.2f} dB; the reading has {level:.2f} dB",
        len(touched) == 3 and abs(level - expected) < 0.01,
    )


def _legs(scene: PaperScene) -> FloatArray:
    outline = scene.scan.paths.outline(int(scene.scan.winners[0]))
    return np.asarray(np.hypot(*np.diff(outline, axis=0).T))


def _drawn_apart(outline: FloatArray) -> FloatArray:
    """Return an outline `(n, 2)` float, m, shifted sideways with its length if all legs are on one vertical line."""
    if np.ptp(outline[:, 0]) > 1e-9:
        return outline
    travelled = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(outline, axis=0).T))))
    aside = _DRIFT * (travelled / travelled[-1] - 0.5)
    return np.asarray(outline + np.column_stack((aside, np.zeros(len(outline)))))


def _draw_rays() -> Figure:
    figure = sheet(9, 6.6)
    axes = figure.add_subplot()
    scan = READING.scan
    draw_room(axes, scan.room)
    label_walls(axes, READING, ("bottom", "right", "top", "left"), with_reflectance=True)
    colours = ((PREDICTED, "-"), (MEASURED, "--"), (GREEN, "-."), (ORANGE, ":"))
    echoes = scan.ping(0).echoes[: _OTHERS + 1]
    for number, (echo, (colour, style)) in enumerate(zip(echoes, colours, strict=True)):
        corners = _drawn_apart(scan.paths.outline(echo.path))
        via = " > ".join(scan.paths.via(echo.path, scan.room))
        label = f"{echo.range:.3f} m, {echo.level_db:.1f} dB: {via}"
        axes.plot(*corners.T, style, color=colour, lw=1.2 if number else 2.6, zorder=4 - number, label=label)
    mark_sensors(axes, READING.scan.place.position)
    finish_plan(axes, "The reading at 270°, and the three echoes after it", (-0.06, 0.99, -0.1, 0.8), "upper left")
    axes.legend(loc="center left", bbox_to_anchor=(0.08, 0.72), fontsize=9)
    return figure


# Figure 6: a room like Kuc and Siegel's, by an independent model of single reflections and by ray following.


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
    differences = np.abs(followed.scan.ranges - model(followed))[single]
    both = differences[~np.isnan(differences)]
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
    nearest = np.full(len(headings), np.inf)
    for row, foot in enumerate(feet):
        if foot is None or _is_hidden(sensor, foot, np.delete(room.walls.reshape(-1, 2, 2), row, axis=0)):
            continue
        x, y = foot - sensor
        distance = math.hypot(x, y)
        levels = room.reflectances[row] * _disc_gain(headings - math.atan2(y, x), board, room) ** 2
        heard = (levels >= 10 ** (board.threshold_db / 20)) & (
            board.blanked_range(room.air) <= distance <= board.max_range
        )
        nearest[heard] = np.minimum(nearest[heard], distance)
    return np.where(np.isinf(nearest), np.nan, nearest)


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


def _draw_single_reflections() -> Figure:
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


# The page of figures: a picture of every exhibit, and the text of `figures.md`, in the order of the paper.


PAGE = "figures.md"
EXHIBITS: tuple[Exhibit, ...] = (
    Exhibit(
        "figure2",
        "Figures 1 and 2: one plate, four raw traces",
        "A plate on a stand in front of the transducer, whose face reflects returning sound. The paper does not "
        "explain the small early echo from the plate at 45° in (d); here it is diffraction at the near edge of the "
        "plate, 4.6° off the axis, with the paper's factor for edges. By the uniform theory it is 9 dB fainter, below "
        "the peaks of the noise. The receiver's gain compensates for the distance, so echoes lose level only by "
        "reflection and by the directivity of the face. All traces here, but not those of the commands, have the same "
        "noise, of -60 dB (ours).",
        (NO_TARGET, TILTED, PARALLEL, AT_45, PLATE_TURNED),
        _draw_plates,
        (nothing_returns, one_echo, many_echoes, strongest_is_reflected_by_the_plate, small_echo_vanishes),
    ),
    Exhibit(
        "figure3_4",
        "Figures 3 and 4: a laboratory from a table top",
        "Three scans in one plan, one reading every 5°. The room resembles the paper's. The outer corner is sharp; the "
        "paper does not say how it was seen. The pillar is round and 0.6 m thick, with nothing in front of it.",
        SCANS,
        _draw_laboratory,
        (
            near_wall_over_a_short_span,
            blackboard_moves_the_wall,
            protruding_corner_is_strong,
            person_is_strong,
            pillar_is_half_lost,
        ),
    ),
    Exhibit(
        "figure5",
        "Figure 5: the impulse response and the pulse",
        "A circular face of 19.2 mm radius and a square burst of 16 cycles of 49.4 kHz, at 20 °C and 50 % "
        "humidity. Left: Kuc and Siegel's h_R convolved with the burst, summed in time. Right: the loss at "
        "each angle in both directions together.",
        (),
        _draw_beam,
        (burst_off_the_axis, loss_grows_to_the_first_null),
    ),
    Exhibit(
        "figure6",
        "Figure 6: a room in the manner of Kuc and Siegel's",
        "Walls, inner corners and an outer corner. Points far outside the walls are readings by several reflections. "
        "Kuc and Siegel's part is predicted without the engine: the feet of the perpendiculars on the walls, if they "
        "are in sight, and the pattern of a disc. Edges are below the threshold here.",
        (RAY_FOLLOWING,),
        _draw_single_reflections,
        (single_readings_are_theirs, several_reflections_are_missing),
    ),
    Exhibit(
        "figure7",
        "Figure 7: the simple room, as the unit measured it",
        "Room and places are the paper's: 928 × 742 mm of shelving. The reflectance, 0.95, is ours. One reading every "
        "3°. The sensor is 397 mm from the top and 94 mm from the right. The unit's face reflects. Left: the first "
        "echo above the threshold. Right: the ranging board's own receiver, which integrates, so that sound that "
        "arrives at the end of blanking is read there.",
        (FIGURE_7, FIGURE_7_BOARD),
        _draw_7,
        (very_close_at_the_right, circle_of_minimum_range),
    ),
    Exhibit(
        "figure8",
        "Figure 8: the simple room, as the paper's simulation predicts it",
        "Room and place are those of figure 7. The unit blocks the sound that returns to its face.",
        (FIGURE_8,),
        _draw_8,
        (far_wall_is_wavy, nothing_near_at_the_right),
    ),
    Exhibit(
        "figure9",
        "Figure 9: a false wall, and a robot that does not detect it",
        "Room and place are the paper's, as in figure 7. The sensor is 657 mm from the top and 154 mm from the right; "
        "sound passes it. The robot of the text has a round body of 152 mm radius (this radius and its position along "
        "the wall are ours). Its face is also 85 mm from the lower wall when it points there.",
        (FIGURE_9, ROBOT),
        _draw_9,
        (
            upper_wall_is_true,
            far_wall_is_wavy_again,
            lower_wall_is_false,
            corridor_of_twice_the_width,
            body_removes_the_false_wall,
        ),
    ),
    Exhibit(
        "figure10_11",
        "Figures 10 and 11: an oblique corner",
        "Two boxes at an obtuse angle in open space, one reading every 3°. The upper box is 120 mm nearer, and the "
        "corner is near the perpendicular foot on the lower box, so that the arc of the lower box extends behind the "
        "upper one.",
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
        "corner.",
        (RIGHT, RIGHT_NEARER),
        _draw_right,
        (
            corner_is_a_tangential_wall,
            hole_at_each_side,
            almost_unchanged_from_nearer,
            right_walls_are_lost_off_the_axis,
        ),
    ),
    Exhibit(
        "figure14",
        "Figure 14: the rays of one reading",
        "The reading of figure 9 at 270° with thick rays, and the next three echoes with thin rays. The paper does not "
        "say which reading it shows. Rays that run back and forth on one line are shifted sideways, by 50 mm in total.",
        (READING,),
        _draw_rays,
        (legs_of_the_reading, level_is_the_product_of_reflectances),
    ),
    Exhibit(
        "corridor",
        "Section 3: along a corridor",
        f"{len(WALK)} places {_STEP:g} m apart, 0.5 m from one wall, one reading every "
        f"{WALK[0].degrees[2]:g}°. The command predicts the scan at the first place.",
        WALK[:1],
        _draw_corridor,
        (
            right_at_right_angles,
            long_ahead_and_behind,
            errors_are_correlated_between_headings,
            errors_are_correlated_between_places,
        ),
    ),
)
_HEAD = """\
# The paper's figures

Every figure of Dudek, Jenkin, Milios, Wilkes, *Reflections on modelling a sonar range sensor* (CIM-92-9), drawn
again by the model. Each table lists what the paper says, what the model shows, and whether they agree.
`sonarhw figures DIR` writes this page and its pictures; the tests check every line. The commands of each figure
predict the same scans. Only the paper's text and its dimensions are compared, not its pictures. A value that is *ours*
was chosen here, because the paper does not state it; so were the dimensions of all rooms but the simple one. Plans are
cropped where they would show only distant readings.
"""
_END = """\
Next: `docs/explanation/model.md`, how the model computes this, its accuracy and its limits.
"""


def picture_name(exhibit: Exhibit, suffix: str) -> str:
    """Return the file name of an exhibit's picture."""
    return f"{exhibit.name}{suffix}"


def picture(exhibit: Exhibit, suffix: str = ".png") -> bytes:
    """Return the picture of an exhibit in the format of `suffix`."""
    return picture_bytes(exhibit.draw(), suffix, tight=True)


def claims(exhibit: Exhibit) -> tuple[Claim, ...]:
    """Return the paper's claims about an exhibit, checked against the model."""
    return tuple(claim() for claim in exhibit.claims)


def page(suffix: str = ".png") -> str:
    """Return the text of the page, Markdown, with pictures of this format."""
    return "\n".join((_HEAD, *(_section(exhibit, suffix) for exhibit in EXHIBITS), _END))


def _section(exhibit: Exhibit, suffix: str) -> str:
    lines = [f"## {exhibit.title}", "", fill(exhibit.setting, 118), ""]
    if exhibit.scenes:
        lines += ["```", *(scene.command for scene in exhibit.scenes), "```", ""]
    lines += [f"![{exhibit.title}]({picture_name(exhibit, suffix)})", ""]
    lines += ["| the paper says | the model shows | agrees |", "|---|---|---|"]
    lines += [_row(claim) for claim in claims(exhibit)]
    return "\n".join((*lines, ""))


def _row(claim: Claim) -> str:
    return f"| {claim.says} | {claim.measured} | {'yes' if claim.holds else '**no**'} |"
