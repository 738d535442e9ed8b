"""The readings as rows of a table, in plain arrays that are extended while a scan grows."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.matching.match import Kind, Matched
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.look.palette import Unclassed
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.prediction_requests import Compared

IntArray = NDArray[np.int64]
Class = Kind | Unclassed
CLASSES: tuple[Class, ...] = (*Kind, Unclassed.MEASURED)
CODES = {kind: code for code, kind in enumerate(CLASSES)}
_UNCLASSED = CODES[Unclassed.MEASURED]
NO_PATH = -1


@dataclass(frozen=True)
class ReadingRows:
    """One row for each reading; every array is (n,)."""

    readings: tuple[Reading, ...]
    angles: FloatArray  # of the turntable, degrees
    headings: FloatArray  # in the room, degrees from 0 to 360
    measured: FloatArray  # m; NaN: no echo
    predicted: FloatArray  # m; NaN: no echo, or not compared
    classes: IntArray  # indices into CLASSES
    paths: IntArray  # indices into `path_names`, or NO_PATH
    path_names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def residuals(self) -> FloatArray:
        """Measured minus predicted, m; NaN if either has no echo."""
        return self.measured - self.predicted

    def path(self, row: int) -> str:
        """Return the path of a reading; empty if it is unknown."""
        return self.path_names[self.paths[row]] if self.paths[row] != NO_PATH else ""

    def counts(self) -> dict[Class, int]:
        """Return the number of readings of each class."""
        return dict(zip(CLASSES, np.bincount(self.classes, minlength=len(CLASSES)).tolist(), strict=True))


_EMPTY = np.empty(0)
_NONE = np.empty(0, np.int64)
NO_ROWS = ReadingRows((), _EMPTY, _EMPTY, _EMPTY, _EMPTY, _NONE, _NONE, ())


def rows_of(
    readings: tuple[Reading, ...], compared: Compared | None, scene: Scene, before: ReadingRows = NO_ROWS
) -> ReadingRows:
    """Return the rows of readings made in a scene.

    Values of the same readings are copied from the rows `before`.
    """
    known = _shared(before.readings, readings)
    fresh = readings[known:]
    angles = np.concatenate((before.angles[:known], np.degrees([reading.angle for reading in fresh])))
    ranges = (reading.range for reading in fresh)
    measured = np.concatenate((before.measured[:known], [math.nan if far is None else far for far in ranges]))
    predicted, classes, paths = np.full(len(angles), math.nan), np.full(len(angles), _UNCLASSED), _no_paths(len(angles))
    names: tuple[str, ...] = ()
    if compared is not None:
        matched = compared.comparison.rows[: max(0, len(angles) - compared.first)]
        stretch = slice(compared.first, compared.first + len(matched))
        predicted[stretch] = [math.nan if row.predicted is None else row.predicted for row in matched]
        classes[stretch] = [CODES[row.kind] for row in matched]
        paths[stretch], names = _named_paths(matched, compared.comparison.prediction)
    headings = np.mod(scene.board.turned(angles) + math.degrees(scene.pose.heading), 360.0)
    return ReadingRows(readings, angles, headings, measured, predicted, classes, paths, names)


def longer_of(rows: ReadingRows, earlier: ReadingRows) -> ReadingRows:
    """Return the longer of two tables if both are of one scan; else `rows`."""
    both = len(rows) and _shared(rows.readings, earlier.readings)
    return earlier if both and len(earlier) > len(rows) else rows


def _shared(earlier: tuple[Reading, ...], later: tuple[Reading, ...]) -> int:
    """Return how many leading readings are the same in both.

    One comparison is enough: a scan only grows, and a replay shows a longer or shorter part of one log.
    """
    both = min(len(earlier), len(later))
    return both if both and earlier[both - 1] is later[both - 1] else 0


def _no_paths(count: int) -> IntArray:
    return np.full(count, NO_PATH, np.int64)


def _named_paths(rows: Iterable[Matched], prediction: PredictedScan) -> tuple[IntArray, tuple[str, ...]]:
    """Return the index of each reading's path name, and the names. The path of a missed echo is the predicted one."""
    missed = {row.index: int(prediction.winners[row.index]) for row in rows if row.kind is Kind.MISSED}
    found = np.array([missed.get(row.index, NO_PATH) if row.path is None else row.path for row in rows], np.int64)
    different, places = np.unique(found, return_inverse=True)
    names = {path: ">".join(prediction.paths.via(path, prediction.room)) for path in different.tolist() if path >= 0}
    in_order = sorted(set(names.values()))
    place = {path: in_order.index(name) for path, name in names.items()}
    return np.array([place.get(path, NO_PATH) for path in different.tolist()], np.int64)[places], tuple(in_order)
