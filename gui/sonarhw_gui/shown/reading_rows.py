"""The readings as rows of a table: plain arrays, sorted and filtered at once however many there are.

Takes readings and how they compare; hands on `ReadingRows`, an order of them, and any row as text. No widgets.
"""

import csv
import io
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.matching.match import Kind, Matched
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import MARKS, Unclassed
from sonarhw_gui.look.residual_unit import residual_unit
from sonarhw_gui.work.prediction_requests import Compared

IntArray = NDArray[np.int64]
Class = Kind | Unclassed
CLASSES: tuple[Class, ...] = (*Kind, Unclassed.MEASURED)
_CODES = {kind: code for code, kind in enumerate(CLASSES)}
_UNCLASSED = _CODES[Unclassed.MEASURED]
_NO_PATH = -1
_NOTHING = "–"


class Column(IntEnum):
    """The columns of the table, from left to right."""

    NUMBER = 0
    HEADING = 1
    MEASURED = 2
    PREDICTED = 3
    RESIDUAL = 4
    CLASS = 5
    PATH = 6
    SENTENCE = 7


@dataclass(frozen=True)
class ReadingRows:
    """One row a reading; every array is (n,)."""

    readings: tuple[Reading, ...]
    angles: FloatArray  # of the turntable, degrees
    headings: FloatArray  # in the room, degrees from 0 to 360
    measured: FloatArray  # m; NaN: no echo
    predicted: FloatArray  # m; NaN: no echo, or not compared
    classes: IntArray  # which of CLASSES
    paths: IntArray  # which of `path_names`, or −1
    path_names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def residuals(self) -> FloatArray:
        """Measured less predicted, m; NaN where either is silent."""
        return self.measured - self.predicted

    def path(self, row: int) -> str:
        """The path of a reading; empty where none is known."""
        return self.path_names[self.paths[row]] if self.paths[row] != _NO_PATH else ""

    def counts(self) -> dict[Class, int]:
        """How many readings there are of each class."""
        return dict(zip(CLASSES, np.bincount(self.classes, minlength=len(CLASSES)).tolist(), strict=True))


@dataclass(frozen=True)
class Wanted:
    """Which rows, and in what order."""

    column: Column = Column.NUMBER
    descending: bool = False
    hidden: frozenset[Class] = frozenset()
    text: str = ""  # each word of it stands in the heading, the class or the path

    @property
    def everything(self) -> bool:
        """Whether the rows stand as they came, all of them."""
        return self.column is Column.NUMBER and not (self.descending or self.hidden or self.text)


_EMPTY = np.empty(0)
_NONE = np.empty(0, np.int64)
NO_ROWS = ReadingRows((), _EMPTY, _EMPTY, _EMPTY, _EMPTY, _NONE, _NONE, ())


def rows_of(
    readings: tuple[Reading, ...], compared: Compared | None, zero: float, before: ReadingRows = NO_ROWS
) -> ReadingRows:
    """The rows of readings, a stretch of them compared; `zero` is where turntable angle 0 points in the room, rad.

    What `before` knows of the same readings is taken from there.
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
        classes[stretch] = [_CODES[row.kind] for row in matched]
        paths[stretch], names = _named_paths(matched, compared.comparison.prediction)
    headings = np.mod(angles + math.degrees(zero), 360.0)
    return ReadingRows(readings, angles, headings, measured, predicted, classes, paths, names)


def longer_of(rows: ReadingRows, earlier: ReadingRows) -> ReadingRows:
    """Whichever knows more readings, where both are of one scan; else `rows`."""
    both = len(rows) and _shared(rows.readings, earlier.readings)
    return earlier if both and len(earlier) > len(rows) else rows


def _shared(earlier: tuple[Reading, ...], later: tuple[Reading, ...]) -> int:
    """How many readings both begin with: a scan only grows, and a replay shows more of it or less."""
    both = min(len(earlier), len(later))
    return both if both and earlier[both - 1] is later[both - 1] else 0


def _no_paths(count: int) -> IntArray:
    return np.full(count, _NO_PATH, np.int64)


def _named_paths(rows: Iterable[Matched], prediction: PredictedScan) -> tuple[IntArray, tuple[str, ...]]:
    """The path that accounts for each reading, of a missed one the path that was expected, by rows of names."""
    missed = {row.index: int(prediction.winners[row.index]) for row in rows if row.kind is Kind.MISSED}
    found = np.array([missed.get(row.index, _NO_PATH) if row.path is None else row.path for row in rows], np.int64)
    different, places = np.unique(found, return_inverse=True)
    names = {path: ">".join(prediction.paths.via(path, prediction.room)) for path in different.tolist() if path >= 0}
    in_order = sorted(set(names.values()))
    place = {path: in_order.index(name) for path, name in names.items()}
    return np.array([place.get(path, _NO_PATH) for path in different.tolist()], np.int64)[places], tuple(in_order)


def order_of(rows: ReadingRows, wanted: Wanted) -> IntArray:
    """Which rows are wanted, in their order; rows without a value stand last either way."""
    kept = np.ones(len(rows), bool)
    if wanted.hidden:
        kept &= ~np.isin(rows.classes, [_CODES[kind] for kind in wanted.hidden])
    if wanted.text.strip():
        kept &= _saying(rows, wanted.text.casefold().split())
    keys = _sort_keys(rows, wanted.column)
    order = np.argsort(-keys if wanted.descending else keys, kind="stable")
    return order[kept[order]]


def _sort_keys(rows: ReadingRows, column: Column) -> FloatArray:
    match column:
        case Column.NUMBER:
            return np.arange(len(rows), dtype=np.float64)
        case Column.HEADING:
            return rows.headings
        case Column.MEASURED:
            return rows.measured
        case Column.PREDICTED:
            return rows.predicted
        case Column.RESIDUAL:
            return rows.residuals
        case Column.CLASS:
            return rows.classes.astype(np.float64)
    return np.where(rows.paths == _NO_PATH, math.nan, rows.paths)


def _saying(rows: ReadingRows, words: list[str]) -> NDArray[np.bool_]:
    # a word is looked up in the few different texts of a column, not in every row
    angles, which = np.unique(np.round(rows.headings, 1), return_inverse=True)
    kept = np.ones(len(rows), bool)
    for word in words:
        in_heading = np.array([word in f"{angle:.1f}°" for angle in angles.tolist()], bool)[which]
        in_class = np.array([word in class_name(kind) for kind in CLASSES], bool)[rows.classes]
        in_path = np.array([*(word in name.casefold() for name in rows.path_names), False], bool)[rows.paths]
        kept &= in_heading | in_class | in_path
    return kept


def class_name(kind: Class) -> str:
    """A class as it stands in the table."""
    return MARKS[kind].name if kind in MARKS else "silent"


def heading_text(rows: ReadingRows, row: int) -> str:
    """The heading, rounded so that no 360.0° appears."""
    return f"{round(float(rows.headings[row]), 1) % 360:.1f}°"


def cell_text(rows: ReadingRows, row: int, column: Column, look: Look) -> str:
    """What stands in a cell, in the units of the look; a dash where there is no value."""
    match column:
        case Column.NUMBER:
            return str(row)
        case Column.HEADING:
            return heading_text(rows, row)
        case Column.MEASURED:
            return _length(rows.measured[row], look)
        case Column.PREDICTED:
            return _length(rows.predicted[row], look)
        case Column.RESIDUAL:
            apart = float(rows.measured[row] - rows.predicted[row])
            return _NOTHING if math.isnan(apart) else residual_unit(look.unit).text(apart)
        case Column.CLASS:
            return class_name(CLASSES[rows.classes[row]])
    return rows.path(row)


def column_name(column: Column, look: Look) -> str:
    """What stands over a column, with its unit."""
    match column:
        case Column.MEASURED | Column.PREDICTED:
            return f"{column.name.lower()} ({look.unit.label})"
        case Column.RESIDUAL:
            return f"residual ({residual_unit(look.unit).label})"
        case Column.NUMBER:
            return "no."
    return column.name.lower()


def _length(metres: float, look: Look) -> str:
    return _NOTHING if math.isnan(metres) else f"{look.unit.of(metres):.{look.unit.decimals}f}"


_CSV_HEADER = (
    "number", "heading_deg", "measured_m", "predicted_m", "residual_m", "class", "path", "sentence",
)  # fmt: skip


def rows_as_csv(rows: ReadingRows, order: Iterable[int], sentence: Callable[[int], str]) -> str:
    """These rows as CSV with a header: degrees and metres whatever the look, empty where there is no value."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_CSV_HEADER)
    residuals = rows.residuals
    for row in order:
        lengths = (rows.measured[row], rows.predicted[row], residuals[row])
        told = ("" if math.isnan(length) else f"{length:.4f}" for length in lengths)
        kind = class_name(CLASSES[rows.classes[row]])
        heading = f"{rows.headings[row]:.4f}"
        writer.writerow((row, heading, *told, kind, rows.path(row), sentence(int(row))))
    return text.getvalue()
