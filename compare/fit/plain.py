"""A plain search for where the turntable pointed and how far its ranges are off.

Takes readings and a prediction's ranges all round; hands on the heading and the offset at which most readings agree.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compare.match import TOLERANCE
from sim.board import Board
from sim.models import Model, predict_with
from sim.prediction import PredictionOptions
from sim.room import Place, Room
from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, Reading

HEADINGS = 720  # tried all round: 0.5° apart
OFFSETS = np.linspace(-0.06, 0.06, 25)  # m
PARAMETERS = ("heading", "offset")


@dataclass(frozen=True)
class Fit:
    """What explains a scan best."""

    heading: float  # rad: of turntable step 0 in the room
    offset: float  # m, added to every measured range


def fit_scan(
    readings: Sequence[Reading],
    room: Room,
    place: Place,
    board: Board,
    free: frozenset[str],
    *,
    model: Model = Model.RAY_FOLLOWING,
    options: PredictionOptions | None = None,
) -> Fit:
    """The heading and offset, where they are `free`, at which most readings lie within 5 cm of the prediction.

    What is not free stays at the place's heading and no offset. Ties go to the smaller mean error, then to the smaller
    offset. Raises InputError where `free` names something else, no reading has an echo, or a heading is sought for a
    ring, which has no turntable.
    """
    _check(readings, free)
    if board.ring is not None:
        raise InputError(f"--fit: board {board.name!r} is a ring of sensors, and has no turntable to fit")
    all_round = np.arange(HEADINGS, dtype=np.float64) * (math.tau / HEADINGS)
    headings = all_round if "heading" in free else np.zeros(1)
    offsets = OFFSETS if "offset" in free else np.zeros(1)
    table = predict_with(model, room, place, board, all_round, options).ranges
    start = 0.0 if "heading" in free else place.heading
    angles = np.array([reading.angle for reading in readings])
    measured = np.array([math.nan if reading.range is None else reading.range for reading in readings])
    scores = [_score(table, start + heading + angles, measured, offsets) for heading in headings]
    best = max(range(len(scores)), key=lambda k: scores[k][0])
    return Fit(float(start + headings[best]), float(offsets[scores[best][1]]))


def _check(readings: Sequence[Reading], free: frozenset[str]) -> None:
    unknown = free.difference(PARAMETERS)
    if unknown:
        raise InputError(f"--fit {sorted(unknown)[0]}: expected some of {', '.join(PARAMETERS)}")
    if all(reading.range is None for reading in readings):
        raise InputError("nothing to fit: no reading of this scan has an echo")


def _score(
    table: FloatArray, headings: FloatArray, measured: FloatArray, offsets: FloatArray
) -> tuple[tuple[int, float, float], int]:
    """How well readings agree at the best of `offsets` (count, - mean error, - |offset|), and which that is."""
    predicted = table[np.round(headings * (HEADINGS / math.tau)).astype(int) % HEADINGS]
    errors = np.abs(measured + offsets[:, None] - predicted)
    agree = errors <= TOLERANCE
    counts = agree.sum(axis=1)
    means = np.where(agree, errors, 0.0).sum(axis=1) / np.maximum(counts, 1)
    scores = [
        (int(count), -float(mean), -abs(float(offset)))
        for count, mean, offset in zip(counts, means, offsets, strict=True)
    ]
    best = max(range(len(scores)), key=scores.__getitem__)
    return scores[best], best
