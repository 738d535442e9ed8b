"""The readings as rows of a table, in plain arrays that are extended while a scan grows."""

import csv
import io
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from sonarhw_compare.match import Kind

from sonarhw.errors import text_cell
from sonarhw.readings import BoolArray, FloatArray, Origin, Reading
from sonarhw_gui.jobs.forecast import NO_PATH, ComparedScan, IntArray
from sonarhw_gui.model.look import MARKS, Class, Look, Unclassed
from sonarhw_gui.model.scene import NO_NOTES, NoteTexts, Scene

CLASSES: tuple[Class, ...] = (*Kind, *Unclassed)  # begins with the codes of `Comparison.kinds`
CODES = {kind: code for code, kind in enumerate(CLASSES)}


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
        """Measured minus predicted, (n,) m; NaN if either has no echo."""
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
    readings: tuple[Reading, ...],
    compared: ComparedScan | None,
    scene: Scene,
    before: ReadingRows = NO_ROWS,
    poses: FloatArray | None = None,
) -> ReadingRows:
    """Return the rows of readings made in a scene, of a sensor that moves at poses (n, 3) m, m and rad.

    Values of the same readings are copied from the rows `before`.
    """
    shared = _shared(before.readings, readings)
    fresh = readings[shared:]
    angles = np.concatenate((before.angles[:shared], np.degrees([reading.angle for reading in fresh])))
    ranges = (reading.range for reading in fresh)
    measured = np.concatenate((before.measured[:shared], [math.nan if far is None else far for far in ranges]))
    uncompared = Unclassed.WAITING if scene.room else Unclassed.MEASURED
    predicted, classes, paths, names = _compared_values(len(angles), compared, CODES[uncompared])
    zeros = scene.pose.heading if poses is None else poses[:, 2]
    headings = np.mod(scene.board.turned(angles) + np.degrees(zeros), 360.0)
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


def _compared_values(
    count: int, compared: ComparedScan | None, uncompared: int
) -> tuple[FloatArray, IntArray, IntArray, tuple[str, ...]]:
    """Return predicted ranges, classes and paths of `count` readings, and the names of the paths."""
    predicted, classes = np.full(count, math.nan), np.full(count, uncompared)
    paths = np.full(count, NO_PATH, np.int64)
    stretches = [stretch for stretch in (compared.stretches if compared else ()) if stretch.first < count]
    names = sorted(set().union(*(stretch.paths[1] for stretch in stretches)))
    places = {name: place for place, name in enumerate(names)}
    for stretch in stretches:
        here = slice(stretch.first, min(stretch.end, count))
        rows = slice(0, here.stop - here.start)
        comparison = stretch.comparison
        predicted[here], classes[here] = comparison.predicted[rows], comparison.kinds[rows]
        numbers, own_names = stretch.paths
        paths[here] = np.array([*(places[name] for name in own_names), NO_PATH], np.int64)[numbers[rows]]
    return predicted, classes, paths, tuple(names)


# The cells of the table of readings as text, and the same rows as CSV.


_NOTHING = "–"


class Column(IntEnum):
    """The columns of the table, from left to right."""

    NUMBER = 0
    HEADING = 1
    MEASURED = 2
    PREDICTED = 3
    RESIDUAL = 4
    CLASS = 5
    NOTE = 6
    PATH = 7
    SENTENCE = 8


def class_name(kind: Class) -> str:
    """Return the name of a class in the table."""
    return MARKS[kind].name if kind in MARKS else "silent"


def cell_text(rows: ReadingRows, row: int, column: Column, look: Look) -> str:
    """Return the text of a cell but those of notes and sentences, in the units of the look; a dash without a value."""
    match column:
        case Column.NUMBER:
            return str(row)
        case Column.HEADING:
            return f"{round(float(rows.headings[row]), 1) % 360:.1f}°"  # so that 360.0° becomes 0.0°
        case Column.MEASURED:
            return _length(rows.measured[row], look)
        case Column.PREDICTED:
            return _length(rows.predicted[row], look)
        case Column.RESIDUAL:
            residual = float(rows.measured[row] - rows.predicted[row])
            return _NOTHING if math.isnan(residual) else look.unit.small.signed(residual)
        case Column.CLASS:
            return class_name(CLASSES[rows.classes[row]])
    return rows.path(row)


def column_name(column: Column, look: Look, origin: Origin) -> str:
    """Return the header of a column, with its unit; that of measured ranges names the origin of the readings."""
    match column:
        case Column.MEASURED:
            return f"{origin} ({look.unit.label})"
        case Column.PREDICTED:
            return f"predicted ({look.unit.label})"
        case Column.RESIDUAL:
            return f"residual ({look.unit.small.label})"
        case Column.NUMBER:
            return "no."
    return column.name.lower()


def _length(metres: float, look: Look) -> str:
    return _NOTHING if math.isnan(metres) else f"{look.unit.of(metres):.{look.unit.decimals}f}"


_CSV_HEADER = (
    "number", "heading_deg", "measured_m", "predicted_m", "residual_m", "class", "path", "sentence", "note",
)  # fmt: skip


def rows_as_csv(rows: ReadingRows, order: Iterable[int], sentence: Callable[[int], str], notes: NoteTexts) -> str:
    """Return these rows as CSV with a header: always degrees and metres, empty if there is no value."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_CSV_HEADER)
    residuals = rows.residuals
    for row in order:
        lengths = (rows.measured[row], rows.predicted[row], residuals[row])
        texts = ("" if math.isnan(length) else f"{length:.4f}" for length in lengths)
        kind = class_name(CLASSES[rows.classes[row]])
        heading = f"{rows.headings[row]:.4f}"
        words = rows.path(row), sentence(int(row)), notes.of(int(row))
        writer.writerow((row, heading, *texts, kind, *map(text_cell, words)))
    return text.getvalue()


# Filters and sorts the rows of the table of readings, as whole arrays.


@dataclass(frozen=True)
class RowQuery:
    """Which rows the table shows, and in which order."""

    column: Column = Column.NUMBER
    descending: bool = False
    hidden: frozenset[Class] = frozenset()
    text: str = ""  # words; each must occur in the heading, the class, the path or the note
    noted: bool = False  # only readings with a note


def order_of(rows: ReadingRows, query: RowQuery, notes: NoteTexts = NO_NOTES) -> IntArray:
    """Return the numbers of the rows of a query, in order; rows without a value are always last."""
    kept = np.ones(len(rows), bool)
    if query.hidden:
        kept &= ~np.isin(rows.classes, [CODES[kind] for kind in query.hidden])
    if query.text.strip():
        kept &= _containing(rows, query.text.casefold().split(), notes)
    if query.noted:
        kept &= _among(rows, notes.by_reading)
    keys = _note_keys(rows, notes) if query.column is Column.NOTE else _sort_keys(rows, query.column)
    order = np.argsort(-keys if query.descending else keys, kind="stable")
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
    return np.where(rows.paths == NO_PATH, math.nan, rows.paths)


def _note_keys(rows: ReadingRows, notes: NoteTexts) -> FloatArray:
    """Return the rank of each note; NaN without one."""
    keys = np.full(len(rows), math.nan)
    for rank, place in enumerate(sorted(notes.by_reading, key=notes.of)):
        if place < len(rows):
            keys[place] = rank
    return keys


def _among(rows: ReadingRows, readings: Iterable[int]) -> BoolArray:
    return np.isin(np.arange(len(rows)), list(readings))


def _containing(rows: ReadingRows, words: list[str], notes: NoteTexts) -> BoolArray:
    # each word is searched in the few distinct texts of a column, not in every row
    angles, which = np.unique(np.round(rows.headings, 1), return_inverse=True)
    kept = np.ones(len(rows), bool)
    for word in words:
        in_heading = np.array([word in f"{angle:.1f}°" for angle in angles.tolist()], bool)[which]
        in_class = np.array([word in class_name(kind) for kind in CLASSES], bool)[rows.classes]
        in_path = np.array([*(word in name.casefold() for name in rows.path_names), False], bool)[rows.paths]
        in_note = _among(rows, (place for place, note in notes.by_reading.items() if word in note.casefold()))
        kept &= in_heading | in_class | in_path | in_note
    return kept
