"""The models by name: ray following, and those the paper argues against, to hold beside it.

Takes what `predict_scan` takes and the name of a model; hands on the same `PredictedScan`, whatever the model.
"""

import math
from dataclasses import replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from sim.board import Board
from sim.paths import Paths
from sim.prediction import PredictedScan, PredictionOptions, Unit, predict_scan
from sim.rays import first_hit
from sim.room import Place, Room
from sonarhw.readings import FloatArray

CONE_HALF_ANGLE = math.radians(15)  # the "±15° cone" of robotics
_CONE_RAYS = 121


class Model(StrEnum):
    """How to predict."""

    RAY_FOLLOWING = "ray-following"
    NEAREST = "nearest"  # the first wall along the axis
    CONE = "cone"  # the nearest wall within ±15°
    KUC_SIEGEL = "kuc-siegel"  # single reflections and edges only


def predict_with(
    model: Model,
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    options: PredictionOptions | None = None,
) -> PredictedScan:
    """What `model` says that `board` would report from `place` at `headings` (n,) rad in the room."""
    options = options or PredictionOptions()
    match model:
        case Model.RAY_FOLLOWING:
            return predict_scan(room, place, board, headings, options)
        case Model.KUC_SIEGEL:
            return predict_scan(room, place, board, headings, replace(options, max_bounces=1))
        case Model.NEAREST:
            return _nearest_wall(room, place, board, headings, np.zeros(1))
        case Model.CONE:
            cone = np.linspace(-CONE_HALF_ANGLE, CONE_HALF_ANGLE, _CONE_RAYS)
            return _nearest_wall(room, place, board, headings, cone)


def _nearest_wall(room: Room, place: Place, board: Board, headings: FloatArray, cone: FloatArray) -> PredictedScan:
    """One straight path a heading: to the nearest surface in sight among the directions heading + `cone`, and back."""
    x, y = place.position
    found = [_nearest_in(room, x, y, heading + cone) for heading in headings]
    hits = [(k, *hit) for k, hit in enumerate(found) if hit is not None]
    rows = np.array([k for k, *_ in hits], dtype=np.intp)
    distances = np.array([distance for _, _, distance, _ in hits], dtype=np.float64)
    order = np.argsort(distances, kind="stable")
    hits, rows, distances = [hits[k] for k in order], rows[order], distances[order]
    directions = np.array([direction for _, direction, _, _ in hits], dtype=np.float64)
    believed = np.asarray(headings)[rows]  # these models take whatever they meet for straight ahead
    surfaces = np.array([[surface] for *_, surface in hits], dtype=np.int32).reshape(-1, 1)
    paths = Paths(
        lengths=2 * distances,
        departures=believed,
        arrivals=believed,
        gains=np.ones(len(hits)),
        surfaces=surfaces,
        edges=np.full(len(hits), -1, dtype=np.int32),
        bends=np.ones(len(hits), dtype=np.int32),
        elevations=np.zeros((len(hits), 2)),
        points=_there_and_back(np.array([x, y]), directions, distances),
    )
    winners = np.full(len(headings), -1, dtype=np.intp)
    winners[rows] = np.arange(len(hits))
    winners[rows[distances > board.max_range]] = -1
    reached = np.append(distances, np.nan)[winners]
    return PredictedScan(room, place, board, np.asarray(headings), paths, Unit.PASS, winners, reached, rows)


def _nearest_in(room: Room, x: float, y: float, directions: FloatArray) -> tuple[float, float, int] | None:
    """Direction (rad), distance (m) and number of the nearest surface among directions; None where all look out."""
    hits = [
        (distance, direction, surface)
        for direction in directions
        for distance, surface in [first_hit(x, y, math.cos(direction), math.sin(direction), -1, room.walls, room.posts)]
        if surface >= 0
    ]
    if not hits:
        return None
    distance, direction, surface = min(hits)
    return float(direction), float(distance), int(surface)


def _there_and_back(start: NDArray[np.float64], directions: FloatArray, distances: FloatArray) -> FloatArray:
    touches = start + distances[:, None] * np.column_stack((np.cos(directions), np.sin(directions)))
    points = np.full((len(directions), 4, 2), np.nan)
    points[:, 0], points[:, 1], points[:, 2] = start, touches, start
    return points
