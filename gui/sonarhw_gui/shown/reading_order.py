"""Filters and sorts the rows of the table of readings, as whole arrays."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_gui.look.palette import Class
from sonarhw_gui.scene.note_texts import NO_NOTES, NoteTexts
from sonarhw_gui.shown.reading_cells import Column, class_name
from sonarhw_gui.shown.reading_rows import CLASSES, CODES, ReadingRows
from sonarhw_gui.work.comparing import NO_PATH, IntArray


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
