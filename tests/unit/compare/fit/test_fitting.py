"""A fit as a whole: its starts, the interval of each estimate, progress and cancellation."""

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.fit import FitOptions, FitResult, PlacedScan, fit_scans, free_parameters
from sonarhw_compare.fit.fitting import _estimate, _redundancies, _starts, _turns, is_unconstrained
from sonarhw_compare.fit.objective import Objective, Problem
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.quantities import HEADING, WORDS, X
from sonarhw_compare.fit.starting import ScoredValues
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, parse_room

from sonarhw.errors import Cancelled
from sonarhw.readings import FloatArray, Reading
from tests.unit.compare.fit.test_starting_poses import BOARD, ROOM, exact_scan, problem_at

(THRESHOLD,) = WORDS["threshold"]


def scored_values(x: float, heading: float, score: float) -> ScoredValues:
    """Return a pose of the scan that begins at that row; all other values are NaN."""
    return ScoredValues(np.array([x, heading, x, heading, math.nan]), score)


def test_starts_are_the_best_poses_together_and_then_up_to_three_others_of_one_scan() -> None:
    """Others count if their log-likelihood is less than 25 below the best one, for each independent reading."""
    problem = SimpleNamespace(
        start=lambda: np.array([0.0, 0.0, 0.0, 0.0, 7.0]), pose_rows=lambda scan: [2 * scan, 2 * scan + 1]
    )
    problem.redundancies = (1.0, 2.0)
    first = [scored_values(1.0, 10.0, 5.0), scored_values(2.0, 20.0, -19.9), scored_values(3.0, 30.0, -20.1)]
    second = [scored_values(k, -k, -10.0 * k) for k in range(1, 7)]
    starts = [start.tolist() for start in _starts(cast(Problem, problem), [first, second])]
    assert starts == [
        [1.0, 10.0, 1.0, -1.0, 7.0],
        [2.0, 20.0, 1.0, -1.0, 7.0],
        [1.0, 10.0, 2.0, -2.0, 7.0],
        [1.0, 10.0, 3.0, -3.0, 7.0],
        [1.0, 10.0, 4.0, -4.0, 7.0],
    ]


def test_the_interval_of_a_heading_is_at_most_a_circle() -> None:
    wide = _estimate(Parameter(HEADING), 1.0, 9.0, -7.0, 9.0)
    assert (wide.value, wide.deviation) == (1.0, math.pi)
    assert (wide.lower, wide.upper) == pytest.approx((1.0 - math.pi, 1.0 + math.pi))
    narrow = _estimate(Parameter(HEADING), 1.0, 0.2, 0.6, 1.4)
    assert (narrow.deviation, narrow.lower, narrow.upper) == (0.2, 0.6, 1.4)
    length = _estimate(Parameter(X), 1.0, 9.0, -7.0, 9.0)
    assert (length.deviation, length.lower, length.upper) == (9.0, -7.0, 9.0)


def test_headings_are_turned_near_that_of_their_own_place() -> None:
    parameters = (Parameter(X, scan=0), Parameter(HEADING, scan=0), Parameter(HEADING, scan=1), Parameter(HEADING))
    places = tuple(Place("", (0.0, 0.0), heading=math.radians(degrees)) for degrees in (10.0, 300.0))
    problem = cast(Problem, SimpleNamespace(parameters=parameters, places=places))
    values = np.array([400.0, math.radians(350.0), math.radians(-20.0), math.radians(725.0), 500.0])
    assert np.degrees(_turns(problem, values)) == pytest.approx([0.0, -360.0, 360.0, -720.0, 0.0])


def test_readings_are_independent_unless_the_board_rounds_or_has_its_own_receiver() -> None:
    exact = problem_at(0.5, 0.4, 0.0, ("x",))
    ranges = np.repeat(np.arange(1.0, 9.0), 3)[:, None]
    scan = exact.scans[0]._replace(angles=np.radians(np.arange(24.0)), ranges=ranges)
    for rounding, receiver, several in (
        (0.0, Receiver.FIRST_ECHO, False),
        (0.01, Receiver.FIRST_ECHO, True),
        (0.0, Receiver.BOARD, True),
    ):
        options = replace(exact.prediction, receiver=receiver)
        found = _redundancies(replace(exact, scans=(scan, scan), rounding=rounding, prediction=options))
        assert len(found) == 2
        assert (max(found) > 1.0) is several
        assert min(found) >= 1.0


def fitted(scan: PlacedScan, free: tuple[str, ...], shares: list[tuple[float, str]]) -> FitResult:
    """Return a quick fit that starts at the given place."""
    options = FitOptions(samples=0, global_search=False)
    parameters = free_parameters(free, [""], ROOM, BOARD)
    return fit_scans(
        [scan], ROOM, BOARD, parameters, options=options, progress=lambda share, step: shares.append((share, step))
    )


def test_a_quick_fit_of_an_exact_scan_ends_at_its_place_with_symmetric_intervals() -> None:
    shares: list[tuple[float, str]] = []
    scan = exact_scan(0.5, 0.4, 5.0)
    result = fitted(
        replace(scan, place=Place("", (0.503, 0.398), heading=math.radians(364.0))), ("position", "heading"), shares
    )
    truth = {"x": 0.5, "y": 0.4, "heading": math.radians(365.0)}
    assert list(result.estimates) == list(truth)
    for name, estimate in result.estimates.items():
        # the beam is wide, so the heading is known to a few degrees only
        assert estimate.value == pytest.approx(truth[name], abs=0.1 if name == "heading" else 0.01)
        assert estimate.deviation > 0
        assert estimate.upper - estimate.value == pytest.approx(1.96 * estimate.deviation)
        assert estimate.value - estimate.lower == pytest.approx(1.96 * estimate.deviation)
    assert np.diag(result.correlations) == pytest.approx([1.0, 1.0, 1.0])
    assert result.correlations == pytest.approx(result.correlations.T)
    assert result.places[0].position == (result.estimates["x"].value, result.estimates["y"].value)
    assert result.places[0].heading == result.estimates["heading"].value
    assert result.agreement[0].within_5cm == 1.0
    assert result.samples.shape == (0, 3)
    assert result.modes[0].score == 0.0
    assert [share for share, _ in shares] == sorted(share for share, _ in shares)
    assert {step for _, step in shares} == {"refining", "sampling"}
    assert shares[-1] == (1.0, "sampling")


def with_noisy_rounding(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Change the last digits of objective and eigenvectors, and the basis of equal eigenvalues, as processors do."""
    random, many, eigh = np.random.default_rng(seed), Objective.many, np.linalg.eigh

    def noisy(objective: Objective, values: FloatArray) -> FloatArray:
        exact = many(objective, values)
        return exact * (1 + 1e-13 * random.uniform(-1, 1, exact.shape))

    def other(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, vectors = eigh(matrix)
        for value in values if matrix.ndim == 2 else ():
            same = np.abs(values - value) < 1e-6
            turn = np.linalg.qr(random.normal(size=(same.sum(), same.sum())))[0]
            vectors[..., same] = vectors[..., same] @ turn
        return values, vectors * (1 + 1e-12 * random.uniform(-1, 1, vectors.shape))

    monkeypatch.setattr(Objective, "many", noisy)
    monkeypatch.setattr(np.linalg, "eigh", other)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("samples", [0, 200])
def test_values_without_effect_have_their_prior_whatever_the_rounding(
    seed: int, samples: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No sound reaches the walls of carpet and felt."""
    arena = Path("rooms/arena.toml").read_text(encoding="utf-8")
    for name, x, reflectance in (("carpet", -1.0, 0.7), ("felt", -2.0, 0.4)):
        arena += f'[[walls]]\nname = "{name}"\nmaterial = "{name}"\npoints = [[{x}, 0.0], [{x}, 1.68]]\n'
        arena += f"[materials.{name}]\nreflectance = {reflectance}\n"
    room, board = parse_room(arena, "arena"), replace(load_board("polaroid-6500"), max_range=0.9)
    place, angles = room.place("p3"), np.radians(np.arange(0.0, 360.0, 15.0))
    ranges, speed = predict_scan(room, place, board, board.heading_at(angles, 0.0)).ranges, room.air.speed_of_sound
    readings = [
        Reading(k, 0, 0, angle, 0.1 * k, () if math.isnan(one) else (2 * one / speed,), speed)
        for k, (angle, one) in enumerate(zip(angles.tolist(), ranges.tolist(), strict=True))
    ]
    free = free_parameters(["offset", "reflectance"], [""], room, board)
    with_noisy_rounding(monkeypatch, seed)
    options = FitOptions(samples=samples, global_search=False, exact=True)
    result = fit_scans([PlacedScan(readings, place)], room, board, free, options=options)
    determined = [one.name for one in free if not is_unconstrained(one, result.estimates[one.name])]
    assert determined == ["offset", "reflectance:board"]
    for name, value in (("carpet", 0.7), ("felt", 0.4)):
        found = result.estimates[f"reflectance:{name}"]
        assert (found.value, found.deviation) == (value, pytest.approx(0.8 / math.sqrt(12)))
        assert (found.lower, found.upper) == pytest.approx((0.22, 0.98))
    assert result.correlations[2:, :2].tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert result.samples.shape[1] == 4


def test_progress_can_end_a_fit_by_an_exception() -> None:
    shares: list[float] = []

    def progress(share: float, _step: str) -> None:
        shares.append(share)
        if len(shares) == 3:
            raise Cancelled("no longer wanted")

    scan = exact_scan(0.5, 0.4, 0.0)
    with pytest.raises(Cancelled, match="no longer wanted"):
        fit_scans([scan], ROOM, BOARD, free_parameters(["x"], [""], ROOM, BOARD), progress=progress)
    assert len(shares) == 3
