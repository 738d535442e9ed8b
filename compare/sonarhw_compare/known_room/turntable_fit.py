"""Geometry of a board from scans of a known room, by the likelihood of `fit`.

Shared by all scans: range offset and its slope, turntable scale, position of the turning axis, threshold and aperture,
and the reflectances of the room, because threshold and reflectance decide together which echoes are heard. An echo with
two reflections loses twice as much as one with a single reflection, which separates the two.
The pose of each scan is a nuisance parameter: its position has a normal prior of 1.5 cm around the given one (marks and
robots are only right within some 3 cm), its heading is free. Neighbouring readings of one echo have the same error, so
the log-likelihood of a scan is divided by its number of readings per independent reading.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.likelihood.objective import MODERATE, Objective, Problem, make_problem
from sonarhw_compare.fit.search.refine import climb, covariance_of, refined
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import (
    APERTURE,
    AXIS_X,
    AXIS_Y,
    HEADING,
    OFFSET,
    REFLECTANCE,
    SCALE,
    SLOPE,
    THRESHOLD,
    BoardQuantity,
    X,
    Y,
    reflectance_of,
)
from sonarhw_compare.known_room.starting_turntable import StartingTurntable
from sonarhw_compare.matching.regions import angles_and_ranges, mean_run

POSITION_SD = 0.015  # m, of a given position
_REACH = 0.06  # m, largest error of a given position
_TURN = math.radians(45.0)  # largest error of a starting heading
_SEARCHES, _ITERATIONS = 2, 4
_CLIMBS = 6  # at most, for the spreads
_GAIN = 0.01  # of the log-likelihood, that is worth another climb
_RANGE, _LEVEL = 0, 1  # rows of the noises
# shared quantities, with the standard deviation of their priors around the given profile; None: none
SHARED: tuple[tuple[BoardQuantity, float | None], ...] = (
    (OFFSET, 0.03),
    (SLOPE, 0.01),
    (SCALE, 0.05),
    (AXIS_X, 0.01),
    (AXIS_Y, 0.01),
    (THRESHOLD, 5.0),
    (APERTURE, None),
)


@dataclass(frozen=True)
class SharedValue:
    """A value with its standard deviation, in the units of the profile."""

    value: float
    deviation: float


@dataclass(frozen=True)
class TurntableFit:
    """The geometry that explains all scans best."""

    shared: dict[str, SharedValue]  # by key of the profile
    reflectances: dict[str, SharedValue]  # by material; those with a table, or outside the bounds of `fit`, stay
    places: tuple[Place, ...]  # of the scans, with the actual heading of the turntable's zero


def fit_turntable(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    start: StartingTurntable,
    tick: Callable[[], None],
) -> TurntableFit:
    """Return the geometry of the board and the poses of the scans. `tick` is called before each search of paths."""
    # the actual heading of the zero is free, so the home angle is 0 here
    board = replace(board, home_angle_deg=0.0)
    problem = _problem(scans, room, board, start)
    values = problem.start()
    values = refined(problem, values, None, (MODERATE, None), tick=tick, searches=_SEARCHES, iterations=_ITERATIONS)
    deviations = np.sqrt(np.diag(covariance_of(problem.near(values), values))) * problem.widenings
    shared = {
        quantity.key: SharedValue(quantity.read(quantity.put(board, float(values[row]))), float(deviations[row]))
        for row, parameter in enumerate(problem.parameters)
        if isinstance(quantity := parameter.quantity, BoardQuantity)
    }
    reflectances = {
        problem.parameters[row].of: SharedValue(float(values[row]), float(deviations[row]))
        for row in problem.rows_of(REFLECTANCE)
    }
    # between the steps of the likelihood the curvature along the scale is that of the prior
    scale = shared[SCALE.key]
    shared[SCALE.key] = replace(scale, deviation=min(scale.deviation, start.scale_deviation))
    return TurntableFit(shared, reflectances, problem.setting(values)[1])


def _problem(scans: Sequence[PlacedScan], room: Room, board: Board, start: StartingTurntable) -> Problem:
    parameters: list[Parameter] = []
    placed = []
    for k, (scan, found) in enumerate(zip(scans, start.places, strict=True)):
        for quantity, at in zip((X, Y), scan.place.position, strict=True):
            parameters.append(Parameter(quantity, "", k, at - _REACH, at + _REACH, at, POSITION_SD, str(k)))
        parameters.append(Parameter(HEADING, "", k, found.heading - _TURN, found.heading + _TURN, label=str(k)))
        placed.append(replace(scan, place=replace(scan.place, heading=found.heading)))
    begin = {SCALE: start.scale, THRESHOLD: start.threshold_db}
    for shared, deviation in SHARED:
        lower, upper = shared.bounds(room, board)
        expected = None if deviation is None else begin.get(shared, shared.value(board))
        expected = expected if expected is None else min(max(expected, lower), upper)
        parameters.append(Parameter(shared, "", None, lower, upper, expected, deviation))
    parameters += _reflectances(room, board)
    problem = make_problem(placed, room, board, parameters, PredictionOptions(), all_echoes=False)
    return replace(problem, redundancies=tuple(readings_per_independent(scan, board) for scan in scans))


def _reflectances(room: Room, board: Board) -> list[Parameter]:
    """Return the reflectance of each material, with the bounds and the prior that `fit` states."""
    lower, upper = REFLECTANCE.bounds(room, board)
    deviation = REFLECTANCE.tolerance(board) if REFLECTANCE.tolerance else None
    present = {name: reflectance_of(room, name) for name in REFLECTANCE.parts(room)}
    return [
        Parameter(REFLECTANCE, name, None, lower, upper, value, deviation)
        for name, value in present.items()
        if lower <= value <= upper
    ]


def readings_per_independent(scan: PlacedScan, board: Board) -> float:
    """Return the number of readings per independent reading of a scan, without the carrier's own body."""
    return mean_run(*angles_and_ranges(without_own_body(board.own_body, scan.readings)))


def spreads(
    scans: Sequence[PlacedScan], room: Room, board: Board, places: Sequence[Place], tick: Callable[[], None]
) -> tuple[SharedValue, SharedValue]:
    """Return the spreads of range, m, and threshold, dB, of readings, with board and poses (actual headings) given."""
    tick()
    board = replace(board, home_angle_deg=0.0)
    placed = [replace(scan, place=place) for scan, place in zip(scans, places, strict=True)]
    # a fit needs a free quantity; it stays at its value
    fixed = (Parameter(OFFSET, "", None, *OFFSET.bounds(room, board)),)
    problem = make_problem(placed, room, board, fixed, PredictionOptions(), all_echoes=False)
    problem = replace(problem, redundancies=tuple(readings_per_independent(scan, board) for scan in scans))
    movable = np.append(False, np.ones(len(problem.noises), np.bool_))
    objective = problem.near(problem.start())
    values = _top(objective, problem.start(), movable)
    logarithms = values[1:]
    deviations: FloatArray = np.sqrt(np.diag(covariance_of(objective, values)))[1:]
    return tuple(
        SharedValue(math.exp(logarithms[row]), math.exp(logarithms[row]) * float(deviations[row]))
        for row in (_RANGE, _LEVEL)
    )  # type: ignore[return-value]


def _top(objective: Objective, values: FloatArray, movable: BoolArray) -> FloatArray:
    """Return the values at the maximum of an objective near `values`; only those `movable` (size,) change.

    One climb may end in a corner of the bounds, where moves along its directions change nothing. The next climb has
    directions of its own.
    """
    for _ in range(_CLIMBS):
        before, values = values, climb(objective, values, movable)
        if objective(values) - objective(before) < _GAIN:
            break
    return values
