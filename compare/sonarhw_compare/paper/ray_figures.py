"""Figure 14: the rays of one reading, between walls that are labelled with their reflectances."""

import math
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

from sonarhw.readings import FloatArray
from sonarhw_compare.paper.drawing import (
    GREEN,
    MEASURED,
    ORANGE,
    PREDICTED,
    finish_plan,
    label_walls,
    sheet,
)
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene
from sonarhw_compare.paper.simple_room_figures import FIGURE_9
from sonarhw_compare.pictures.overlay_picture import draw_room, mark_sensors

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


def _draw() -> Figure:
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


EXHIBITS = (
    Exhibit(
        "figure14",
        "Figure 14: the rays of one reading",
        "The reading of figure 9 at 270° with thick rays, and the next three echoes with thin rays. The paper does not "
        "say which reading it shows. Rays that run back and forth on one line are shifted sideways, by 50 mm in total.",
        (READING,),
        _draw,
        (legs_of_the_reading, level_is_the_product_of_reflectances),
    ),
)
