"""Section 3 of the paper: a sensor is moved along one wall of a long corridor, and its errors are correlated.

An error is the range minus the distance of the nearest wall along the axis.
"""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sonarhw_sim.air import Model, Receiver

from sonarhw.readings import FloatArray
from sonarhw_compare.paper.drawing import MEASURED, finish_plan, points, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene
from sonarhw_compare.pictures.overlay_picture import draw_room, mark_sensors

_STEP = 0.1  # m from place to place
_START = PaperScene("corridor", "-2,0.5", (0.0, 360.0, 5.0), "polaroid-6500", receiver=Receiver.FIRST_ECHO)
WALK = tuple(replace(_START, place=f"{x:.1f},0.5") for x in np.arange(-2, 2 + _STEP / 2, _STEP))
_ACROSS = (90.0, 270.0)  # degrees
_LONG = 1.0  # m
_ALIKE = 0.8  # correlation


def right_at_right_angles(walk: tuple[PaperScene, ...] = WALK) -> Claim:
    """Check the readings across the corridor."""
    worst = float(np.abs([errors(scene)[_row(scene, degrees)] for scene in walk for degrees in _ACROSS]).max())
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
    found, pairs = correlation(off, np.roll(off, -1, axis=1))
    return Claim(
        "errors are correlated from one heading to the next",
        f"coefficient {found:.2f}, over {pairs} pairs of readings {walk[0].degrees[2]:g}° apart",
        found > _ALIKE,
    )


def errors_are_correlated_between_places(walk: tuple[PaperScene, ...] = WALK) -> Claim:
    """Check that neighbouring places have similar errors, also after the mean error of each heading is removed."""
    off = _all_errors(walk)
    found, pairs = correlation(off[:-1], off[1:])
    masked = np.ma.masked_invalid(off)
    rest = np.ma.filled(masked - masked.mean(axis=0), np.nan)
    left, _ = correlation(rest[:-1], rest[1:])
    return Claim(
        "errors are correlated from one position to the next",
        f"coefficient {found:.2f}, over {pairs} pairs of readings {_STEP:g} m apart; {left:.2f} after the mean error "
        "of each heading is subtracted",
        min(found, left) > _ALIKE,
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


def _row(scene: PaperScene, degrees: float) -> int:
    return scene.readings.index(scene.at(degrees))


def _draw() -> Figure:
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


EXHIBITS = (
    Exhibit(
        "corridor",
        "Section 3: along a corridor",
        f"{len(WALK)} places {_STEP:g} m apart, 0.5 m from one wall, one reading every "
        f"{WALK[0].degrees[2]:g}°. The dimensions are ours. The command predicts the scan at the first place.",
        WALK[:1],
        _draw,
        (
            right_at_right_angles,
            long_ahead_and_behind,
            errors_are_correlated_between_headings,
            errors_are_correlated_between_places,
        ),
    ),
)
