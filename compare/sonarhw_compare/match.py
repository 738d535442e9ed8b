"""Comparison of readings with the prediction at their headings: class, path and residual of each, and a summary."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, of_own_body
from sonarhw_sim.predict.predicted_scan import PredictedScan, nearest_paths
from sonarhw_sim.predict.prediction import PredictionOptions, predict_along, predict_with
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import estimate_degrees
from sonarhw.readings import FloatArray, Origin, Reading, Table

# m, largest residual of a match; slightly over 5 cm, for boards that report whole centimetres
TOLERANCE = 0.05 + 1e-9


class Kind(StrEnum):
    """Class of a reading compared with its prediction."""

    MATCH = "match"
    SHORT = "short"  # measured nearer than predicted
    LONG = "long"  # measured farther than predicted
    MISSED = "missed"  # predicted, not measured
    EXTRA = "extra"  # measured, not predicted
    BOTH_SILENT = "both_silent"
    OWN_BODY = "own_body"  # an echo of the carrier of the sensor (`own_body` of the board); in no share

    @property
    def label(self) -> str:
        """The name in texts, tables and pictures."""
        return self.value.replace("_", " ")


@dataclass(frozen=True)
class Matched:
    """One reading beside its prediction."""

    index: int  # row among the prediction's headings
    reading: Reading
    heading: float  # rad in the room
    measured: float | None  # m, offset added
    predicted: float | None  # m
    kind: Kind
    path: int | None  # row of the predicted path that explains the reading; None without one

    @property
    def residual(self) -> float | None:
        """Measured minus predicted, m; None if one of them has no echo, or the echo is of the carrier's own body."""
        if self.measured is None or self.predicted is None or self.kind is Kind.OWN_BODY:
            return None
        return self.measured - self.predicted


@dataclass(frozen=True)
class Summary:
    """Figures of a comparison, the keys of `compare --json`."""

    n: int
    n_echo: int  # measured echoes, without those of the carrier's own body
    matched: int
    within_5cm: float | None  # matched / n_echo; None without measured echoes
    median_abs_error_m: float | None
    no_echo_agreement: float | None  # balanced accuracy of silence; None if all headings are of one kind
    no_echo_roc_area: float | None  # ROC area of predicted levels for silence; None likewise
    classes: dict[str, int]
    explained: float | None  # share of n_echo with any predicted echo within 5 cm
    heading_deg: float  # of turntable step 0 in the room, on the same turn as that of the given place
    offset_m: float
    x_m: float  # of the sensor in the room
    y_m: float
    origin: str = Origin.MEASURED.value  # of the readings


KINDS = tuple(Kind)  # by their codes in `Comparison.kinds`
_CODES = {kind: code for code, kind in enumerate(KINDS)}


@dataclass(frozen=True, eq=False)
class Comparison(Table):
    """Every reading of a scan beside its prediction; n readings."""

    prediction: PredictedScan  # at exactly the readings' headings
    readings: tuple[Reading, ...]
    measured: FloatArray  # (n,) m, offset added; NaN: no echo
    kinds: NDArray[np.int64]  # (n,) index of each class in `KINDS`
    paths: NDArray[np.int64]  # (n,) row of the predicted path that explains each reading; -1 without one
    offset: float  # m, added to every measured range
    origin: Origin = Origin.MEASURED  # of the readings, in texts and pictures

    @cached_property
    def predicted(self) -> FloatArray:
        """Predicted ranges, (n,) m; NaN: no echo."""
        return self.prediction.ranges

    @property
    def of_room(self) -> NDArray[np.bool_]:
        """Which readings are not of the carrier's own body, (n,)."""
        return np.asarray(self.kinds != _CODES[Kind.OWN_BODY])

    @cached_property
    def rows(self) -> tuple[Matched, ...]:
        """The readings one by one."""
        return tuple(self.row(index) for index in range(len(self.readings)))

    def row(self, index: int) -> Matched:
        """Return one reading beside its prediction."""
        predicted, path = float(self.predicted[index]), int(self.paths[index])
        return Matched(
            index,
            self.readings[index],
            float(self.prediction.headings[index]),
            None if self.readings[index].range is None else float(self.measured[index]),
            None if math.isnan(predicted) else predicted,
            KINDS[self.kinds[index]],
            None if path < 0 else path,
        )

    @property
    def heading(self) -> float:
        """Heading of turntable step 0 in the room, rad."""
        return self.prediction.place.heading

    def columns(self) -> dict[str, Any]:
        """Return headings (degrees), measured and predicted ranges, residuals (m, NaN: none), classes and paths."""
        prediction = self.prediction
        paths, room = prediction.paths, prediction.room
        via = ["" if path < 0 else ">".join(paths.via(path, room)) for path in self.paths.tolist()]
        return {
            "heading_deg": np.degrees(prediction.headings),
            "measured_m": self.measured.copy(),
            "predicted_m": self.predicted.copy(),
            "residual_m": np.where(self.of_room, self.measured - self.predicted, math.nan),
            "class": np.array([KINDS[code].value for code in self.kinds.tolist()], dtype=object),
            "via": np.array(via, dtype=object),
        }

    def summary(self) -> Summary:
        """Return the figures of the whole scan."""
        codes = np.bincount(self.kinds, minlength=len(KINDS)).tolist()
        kinds = Counter(dict(zip(KINDS, codes, strict=True)))
        of_room, sounding = self.of_room, ~np.isnan(self.measured)
        echoes, matched = int((sounding & of_room).sum()), kinds[Kind.MATCH]
        errors = np.abs(self.measured - self.predicted)[of_room]
        errors = errors[~np.isnan(errors)]
        explained = int((self.paths[sounding & of_room] >= 0).sum())
        return Summary(
            n=len(self.readings),
            n_echo=echoes,
            matched=matched,
            within_5cm=matched / echoes if echoes else None,
            median_abs_error_m=float(np.median(errors)) if len(errors) else None,
            no_echo_agreement=_balanced_accuracy(kinds),
            no_echo_roc_area=roc_area(self.prediction.over_threshold[of_room], sounding[of_room]),
            classes={kind.value: kinds[kind] for kind in KINDS},
            explained=explained / echoes if echoes else None,
            heading_deg=estimate_degrees(self.heading, self.heading),
            offset_m=self.offset,
            x_m=self.prediction.place.position[0],
            y_m=self.prediction.place.position[1],
            origin=self.origin.value,
        )


def compare_readings(
    readings: Sequence[Reading],
    room: Room,
    place: Place | Sequence[Place],
    board: Board,
    options: PredictionOptions | None = None,
    *,
    offset: float = 0.0,
) -> Comparison:
    """Return each reading with the prediction at its heading.

    A sensor that moves has a place for each reading. The heading of a place is the actual one of the turntable's zero
    (`Board.faced`). `offset` (m) is added to every measured range. Raises InputError if the board is a ring and no
    sensor points along a reading.
    """
    prediction = predicted_for(readings, room, place, board, options)
    return match_readings(readings, prediction, offset)


def predicted_for(
    readings: Sequence[Reading],
    room: Room,
    place: Place | Sequence[Place],
    board: Board,
    options: PredictionOptions | None = None,
    model: Model = Model.RAY_FOLLOWING,
) -> PredictedScan:
    """Return the prediction at the headings of readings, which were made at one place, or each at its own."""
    headings = headings_of(readings, place, board)
    if isinstance(place, Place):
        return predict_with(model, room, place, board, headings, options)
    return predict_along(model, room, place, board, headings, options)


def headings_of(readings: Sequence[Reading], place: Place | Sequence[Place], board: Board) -> FloatArray:
    """Return the heading of each reading in the room, (n,) rad; that of a place is the actual one of step 0."""
    turns = board.turned(np.array([reading.angle for reading in readings], np.float64))
    if isinstance(place, Place):
        return place.heading + turns
    return np.array([there.heading for there, _ in zip(place, readings, strict=True)], np.float64) + turns


def match_readings(readings: Sequence[Reading], prediction: PredictedScan, offset: float = 0.0) -> Comparison:
    """Return each of n readings beside its row of a prediction at their headings; `offset` (m) is added to its range.

    The origin is that of the first reading.
    """
    origin = (readings[0].origin if readings else None) or Origin.MEASURED
    reported = np.array([reading.range for reading in readings], dtype=np.float64)  # None is NaN
    measured = reported + offset
    kinds = classify(measured, prediction.ranges)
    if own_body := prediction.board.own_body:
        kinds[of_own_body(own_body, readings)] = _CODES[Kind.OWN_BODY]
    paths = _accounting_paths(prediction, measured, kinds)
    return Comparison(prediction, tuple(readings), measured, kinds, paths, offset, origin)


def classify(measured: FloatArray, predicted: FloatArray) -> NDArray[np.int64]:
    """Return the code of each reading's class, (n,), from measured and predicted ranges, (n,) m; NaN: no echo."""
    silent, unexpected = np.isnan(measured), np.isnan(predicted)
    cases = [
        (silent & unexpected, Kind.BOTH_SILENT),
        (silent, Kind.MISSED),
        (unexpected, Kind.EXTRA),
        (np.abs(measured - predicted) <= TOLERANCE, Kind.MATCH),
        (measured < predicted, Kind.SHORT),
    ]
    conditions, kinds = zip(*cases, strict=True)
    return np.select(conditions, [_CODES[kind] for kind in kinds], _CODES[Kind.LONG]).astype(np.int64)


def _accounting_paths(prediction: PredictedScan, measured: FloatArray, kinds: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return for each reading the path that explains it: the predicted one if it matches, else that of another echo.

    The other echo is the one nearest in range. -1: no echo within 5 cm, silence, or an echo of the own body.
    """
    matching = kinds == _CODES[Kind.MATCH]
    chosen = np.where(matching, prediction.winners, -1)
    unexplained = np.flatnonzero(~np.isnan(measured) & (kinds != _CODES[Kind.OWN_BODY]) & (chosen < 0))
    chosen[unexplained] = nearest_paths(prediction, unexplained, measured[unexplained], TOLERANCE)
    return chosen


def _balanced_accuracy(kinds: Counter[Kind]) -> float | None:
    silent = kinds[Kind.BOTH_SILENT] + kinds[Kind.MISSED]
    sounding = kinds.total() - silent - kinds[Kind.OWN_BODY]
    if silent == 0 or sounding == 0:
        return None
    return (kinds[Kind.BOTH_SILENT] / silent + (sounding - kinds[Kind.EXTRA]) / sounding) / 2


def roc_area(scores: FloatArray, sounding: Sequence[bool] | NDArray[np.bool_]) -> float | None:
    """Return the area under the ROC curve of scores (n,); a higher score predicts an echo, and 0.5 is chance.

    Consider all pairs of a heading with an echo and one without. The area is the share of pairs in which the heading
    with an echo has the higher score; ties count half. None if all headings are of one kind.
    """
    echo = np.asarray(sounding, dtype=np.bool_)
    silent = np.sort(scores[~echo])
    if echo.all() or not echo.any():
        return None
    below, up_to = (np.searchsorted(silent, scores[echo], side) for side in ("left", "right"))
    return float((below + up_to).mean() / (2 * len(silent)))


# The warning that a prediction explains few echoes of a scan, one for `compare`, `report`, `fit` and `locate`.


FEWEST = 0.6  # of the echoes; nine real scans have at least 76 % within 5 cm in the right room


def explains_few(share: float | None) -> bool:
    """Return whether a share of echoes within 5 cm of the prediction is too small; not if it is unknown."""
    return share is not None and share < FEWEST


def few_explained(scan: str, share: float | None, echoes: int, *, located: bool = False) -> tuple[str, ...]:
    """Return a warning if only a small share of `echoes` is within 5 cm of the prediction.

    `located`: the place was searched in the whole room, so it is not the cause.
    """
    if share is None or not explains_few(share):
        return ()
    return (few_explained_line(scan, share, echoes, located=located),)


def few_explained_line(scan: str, share: float, echoes: int, *, located: bool = False) -> str:
    """Return the warning of `few_explained` for a `share` that is too small."""
    problem = f"{scan}: only {share:.0%} of {echoes} echoes are within 5 cm of the prediction"
    if located:
        return f"{problem}; check the room and the board"
    return f"{problem}; check the room, the place and the board; `sonarhw locate` finds an unknown place"


# Bootstrap of readings in blocks of neighbours, whose errors are alike.


DRAWS = 400


def drawn_blocks(readings: int, redundancy: float, random: np.random.Generator) -> FloatArray:
    """Return how often each reading is drawn, (draws, readings), if blocks of neighbours are drawn with replacement.

    A block has `redundancy` readings, which is the number of readings per independent reading.
    """
    length = max(1, round(redundancy))
    starts = random.integers(0, readings, (DRAWS, max(1, readings // length)))
    counts = np.zeros((DRAWS, readings))
    for by in range(length):
        np.add.at(counts, (np.arange(DRAWS)[:, None], (starts + by) % readings), 1.0)
    return counts
