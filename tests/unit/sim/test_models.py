"""The baseline models against closed forms and ray following."""

import math
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import FAR_TAIL, SPREAD, SPREAD_BY_RANGE, PredictionOptions, predict_with
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import polygon_room

PAPER = load_board("paper")


SQUARE = polygon_room([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])


HERE = Place("here", (0.0, 0.0))


ALL_ROUND = np.radians(np.arange(0, 360, 7.0))


def to_the_square(headings: FloatArray) -> FloatArray:
    return 1 / np.maximum(np.abs(np.cos(headings)), np.abs(np.sin(headings)))


def test_nearest_is_the_distance_along_the_axis_at_any_incidence() -> None:
    scan = predict_with(Model.NEAREST, SQUARE, HERE, PAPER, ALL_ROUND)
    assert scan.ranges == pytest.approx(to_the_square(ALL_ROUND), abs=1e-12)


def test_cone_is_the_nearest_distance_within_fifteen_degrees_of_the_axis() -> None:
    scan = predict_with(Model.CONE, SQUARE, HERE, PAPER, ALL_ROUND)
    within = np.radians(np.linspace(-15, 15, 3001))
    expected = to_the_square(ALL_ROUND[:, None] + within).min(axis=1)
    assert scan.ranges == pytest.approx(expected, abs=1e-5)


def erring(seed: int, headings: FloatArray, distance: float = 2.0) -> PredictedScan:
    """Return a scan of a round wall about the place, with random errors."""
    corners = [(distance * math.cos(a), distance * math.sin(a)) for a in np.radians(np.arange(0, 360, 1.0))]
    options = PredictionOptions(seed=seed)
    return predict_with(Model.NEAREST, polygon_room(corners), HERE, PAPER, headings, options)


def test_errors_are_normal_with_a_longer_far_tail() -> None:
    headings = np.radians(np.arange(0, 360, 0.1))
    errors = erring(4, headings).ranges - 2.0
    spread = SPREAD + SPREAD_BY_RANGE * 2.0
    # a normal variable plus an exponential one, shifted to mean 0
    from scipy.stats import exponnorm, kstest  # takes a second

    expected = exponnorm(FAR_TAIL, loc=-FAR_TAIL * spread, scale=spread)
    assert kstest(errors, expected.cdf).pvalue > 0.01
    assert np.mean(errors) == pytest.approx(0.0, abs=0.1 * spread)
    assert (errors > 3 * spread).sum() > 2 * (errors < -3 * spread).sum()


@pytest.mark.parametrize(
    ("name", "place"), [("simple", "figure9"), ("oblique_corner", "near"), ("right_corner", "figure12")]
)
def test_kuc_siegel_has_only_echoes_straight_back_from_one_wall_or_edge(name: str, place: str) -> None:
    room = load_room(Path("rooms") / f"{name}.toml")
    here = room.places[place]
    scan = predict_with(Model.KUC_SIEGEL, room, here, PAPER, ALL_ROUND)
    assert len(scan.paths) > 0
    for path in range(len(scan.paths)):
        out, home = scan.paths.outline(path)[1:3]
        assert len(scan.paths.outline(path)) == 3
        assert home == pytest.approx(here.position)
        assert scan.paths.lengths[path] == pytest.approx(2 * math.dist(out, here.position))
    # the foot of the perpendicular on each wall that has one
    feet = [distance for wall in room.walls if (distance := perpendicular(np.array(here.position), wall)) is not None]
    single = scan.paths.lengths[scan.paths.edges < 0] / 2
    assert all(np.isclose(feet, distance).any() for distance in single)


def perpendicular(point: FloatArray, wall: FloatArray) -> float | None:
    start, end = wall[:2], wall[2:]
    along = (end - start) / np.hypot(*(end - start))
    at = float((point - start) @ along)
    foot = start + at * along
    return float(np.hypot(*(point - foot))) if 0 <= at <= np.hypot(*(end - start)) else None


@pytest.mark.parametrize("model", Model)
def test_every_model_predicts_a_scan(model: Model) -> None:
    assert np.isfinite(predict_with(model, SQUARE, HERE, PAPER, np.zeros(1)).ranges).all()
