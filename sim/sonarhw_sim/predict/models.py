"""Prediction by any model: ray following, and the baseline models that the paper compares with.

Every model is a function with the arguments of `predict_scan` that returns a `PredictedScan`.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.choices import Model, Receiver
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.predicted_scan import PredictedScan, silent_scan, whole_microdegrees
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, received_by
from sonarhw_sim.rays.first_surface import first_hit
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.grid import Surfaces
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.sections import cut, spanning_at

CONE_HALF_ANGLE = math.radians(15)  # the "±15° cone" of robotics
_CONE_RAYS = 121
# Spread of readings of one surface at range z: σ = 0.01 m + 0.015 z, as used in maps made with Polaroid units, errors
# of the map included. The paper (§1, citing Lange, Korba, Wong 1989) only adds that the far tail is slightly longer.
# Its exponential form and its scale of σ/2 are our assumption.
SPREAD = 0.01  # m
SPREAD_BY_RANGE = 0.015
FAR_TAIL = 0.5


ModelFunction = Callable[[Room, Place, Board, FloatArray, PredictionOptions], PredictedScan]
_FUNCTIONS: dict[Model, ModelFunction] = {Model.RAY_FOLLOWING: predict_scan}


def predict_with(
    model: Model,
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """Return the scan that `model` predicts for `board` at `place` and at `headings` (n,) rad in the room."""
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    return _FUNCTIONS[model](room, place, board, headings, options or PredictionOptions())


def predicts(model: Model) -> Callable[[ModelFunction], ModelFunction]:
    """Return a decorator that makes a function the prediction of `model`."""

    def register(function: ModelFunction) -> ModelFunction:
        _FUNCTIONS[model] = function
        return function

    return register


@predicts(Model.KUC_SIEGEL)
def _single_reflections(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    return predict_scan(room, place, board, headings, replace(options, max_bounces=1, single=True))


@predicts(Model.NEAREST)
def _nearest_ahead(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    options = replace(options, receiver=options.receiver_of(board, Model.NEAREST))
    scan = _nearest_wall(room, place, _without_blanking(board, options), headings, np.zeros(1))
    return received_by(scan if options.seed is None else _with_errors(scan, options.seed), options)


@predicts(Model.CONE)
def _nearest_in_cone(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    options = replace(options, receiver=options.receiver_of(board, Model.CONE))
    cone = np.linspace(-CONE_HALF_ANGLE, CONE_HALF_ANGLE, _CONE_RAYS)
    return received_by(_nearest_wall(room, place, _without_blanking(board, options), headings, cone), options)


def _without_blanking(board: Board, options: PredictionOptions) -> Board:
    """Return the board for the two models of nearest walls: with the paper's receiver, it has no blanking."""
    if options.receiver_of(board) is Receiver.BOARD:
        return board
    return replace(board, blanking=0.0, blanking_inhibit=None)


def _with_errors(scan: PredictedScan, seed: int) -> PredictedScan:
    """Return the scan with a random error on every range, a function of the seed and its heading."""
    assert scan.only_at is not None
    distances = scan.paths.lengths / 2
    drawn = np.array([_range_error(seed, float(heading)) for heading in scan.headings[scan.only_at]])
    errors = drawn * (SPREAD + SPREAD_BY_RANGE * distances)
    return replace(scan, lateness=2 * np.maximum(errors, -distances))


def _range_error(seed: int, heading: float) -> float:
    """Return an error of mean 0 in units of σ: normal with σ 1, plus exponential with scale FAR_TAIL."""
    random = np.random.default_rng((seed, 4, whole_microdegrees(heading)))
    return float(random.normal() + FAR_TAIL * (random.exponential() - 1))


def _nearest_wall(room: Room, place: Place, board: Board, headings: FloatArray, cone: FloatArray) -> PredictedScan:
    """Return a scan without readings: at each heading, the path to the nearest surface within heading + `cone`."""
    starts = np.array([board.mounting.pose(board.at_axis(place), float(heading)).receiver for heading in headings])
    spanning = spanning_at(room, place.height)
    section = cut(room, spanning)
    distances, directions, surfaces = _nearest_hits(starts.reshape(-1, 2), headings[:, None] + cone, section.surfaces)
    rows = np.argsort(distances, kind="stable")
    rows = rows[surfaces[rows] >= 0]
    distances, directions, surfaces = distances[rows], directions[rows], surfaces[rows]
    paths = Paths(
        lengths=2 * distances,
        departures=headings[rows],  # these models treat every surface as straight ahead
        arrivals=headings[rows],
        gains=np.ones(len(rows)),
        phases=np.zeros(len(rows)),
        spreads=np.zeros(len(rows)),
        surfaces=np.array(spanning, dtype=np.int32)[surfaces].reshape(-1, 1),
        edges=np.full(len(rows), -1, dtype=np.int32),
        bends=np.ones(len(rows), dtype=np.int32),
        elevations=np.zeros((len(rows), 2)),
        points=_there_and_back(starts[rows], directions, distances),
    )
    return silent_scan(room, place, board, headings, paths, rows)


@compiled
def _nearest_hits(
    starts: FloatArray, directions: FloatArray, surfaces: Surfaces
) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return distance, direction and surface of the nearest hit of each row of directions (n, m) from starts (n, 2).

    Distances and starts are in m, directions in rad. Without a hit, the distance is inf and the surface -1. Of equal
    distances, the first is used.
    """
    count = len(starts)
    distances, chosen, hit = np.full(count, np.inf), np.zeros(count), np.full(count, -1, np.intp)
    for k in range(count):
        for direction in directions[k]:
            dx, dy = math.cos(direction), math.sin(direction)
            distance, surface = first_hit(starts[k, 0], starts[k, 1], dx, dy, -1, surfaces)
            if distance < distances[k]:
                distances[k], chosen[k], hit[k] = distance, direction, surface
    return distances, chosen, hit


def _there_and_back(starts: FloatArray, directions: FloatArray, distances: FloatArray) -> FloatArray:
    touches = starts + distances[:, None] * np.column_stack((np.cos(directions), np.sin(directions)))
    points = np.full((len(directions), 4, 2), np.nan)
    points[:, 0], points[:, 1], points[:, 2] = starts, touches, starts
    return points
