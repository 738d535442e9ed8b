"""Shading of probable ranges: opacities against a closed form, and the pixels of the plan."""

import math
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from sonarhw_compare.drawings import draw_plan
from sonarhw_compare.pictures import PREDICTED, shading_around
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, parse_room

WALL = parse_room(
    'name = "wall"\n[materials.hard]\nreflectance = 0.9\n'
    '[[walls]]\nname = "w"\npoints = [[1.5, -1.0], [1.5, 1.0]]\nmaterial = "hard"\n',
    "wall",
)
LEVEL = 20 * math.log10(0.9)  # dB, of the wall straight ahead
SPREAD = math.hypot(0.012, 0.005)  # m, of the board and of the room


def prediction(over_db: float) -> PredictedScan:
    """Return the prediction of a board that receives the wall straight ahead `over_db` over its threshold."""
    board = replace(load_board("paper"), threshold_db=LEVEL - over_db, threshold_sd_db=2.0, range_sd=0.012)
    board = replace(board, aperture_radius=0.004)  # a wide beam
    return predict_scan(WALL, Place("here", (0.0, 0.0)), board, np.radians(np.arange(0.0, 360.0, 90.0)))


@pytest.mark.parametrize("over_db", [-2.0, 0.0, 2.0])
def test_opacity_is_the_probability_of_the_echo_with_the_spread_of_its_range(over_db: float) -> None:
    shading = shading_around(prediction(over_db))
    heard = NormalDist().cdf(over_db / 2.0)
    middles = (np.arange(shading.opacities.shape[1]) + 0.5) * shading.reach / shading.opacities.shape[1]
    at = np.interp([1.5, 1.5 + SPREAD, 1.5 - 2 * SPREAD, 1.0], middles, shading.opacities[0])
    assert at == pytest.approx(heard * np.exp([0.0, -0.5, -2.0, -1000.0]), abs=0.02)
    assert not shading.opacities[180].any()  # no wall behind the sensor


def pixel(figure: Figure, x: float, y: float) -> tuple[float, ...]:
    """Return the colour at a point of the plan, m; 0 to 1."""
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())  # type: ignore[attr-defined]
    column, row = figure.axes[0].transData.transform((x, y))
    return tuple(picture[picture.shape[0] - 1 - round(row), round(column), :3] / 255)


def test_the_plan_is_shaded_where_an_echo_is_probable() -> None:
    scan = prediction(5.0)
    plain, shaded = draw_plan(scan), draw_plan(scan, shading=shading_around(scan))
    assert [one.get_text() for one in shaded.legends[0].get_texts()][-1] == "probability of a range"
    assert len(plain.legends[0].get_texts()) == len(shaded.legends[0].get_texts()) - 1
    # at 20°, the arc of the wall is away from the wall, from marks and from lines of the grid
    heading = math.radians(20)
    at = 1.5 * math.cos(heading), 1.5 * math.sin(heading)
    row = shading_around(scan).opacities[20]
    expected = row.max() * np.array(to_rgb(PREDICTED)) + (1 - row.max()) * np.ones(3)
    assert 0.3 < row.max() < 0.7
    assert pixel(shaded, *at) == pytest.approx(expected, abs=0.05)
    assert pixel(plain, *at) == (1.0, 1.0, 1.0)
    assert plain.axes[0].get_xlim() == shaded.axes[0].get_xlim()
