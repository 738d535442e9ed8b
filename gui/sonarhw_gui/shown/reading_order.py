"""Filters and sorts the rows of the table of readings, as whole arrays."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import Class
from sonarhw_gui.shown.reading_cells import Column, class_name
from sonarhw_gui.shown.reading_rows import CLASSES, CODES, ReadingRows
from sonarhw_gui.work.comparing import NO_PATH, IntArray


@dataclass(frozen=True)
class RowQuery:
    """Which rows the table shows, and in which order."""

    column: Column = Column.NUMBER
    descending: bool = False
    hidden: frozenset[Class] = frozenset()
    text: str = ""  # words; each must occur in the heading, the class or the path


def order_of(rows: ReadingRows, query: RowQuery) -> IntArray:
    """Return the numbers of the rows of a query, in order; rows without a value are always last."""
    kept = np.ones(len(rows), bool)
    if query.hidden:
        kept &= ~np.isin(rows.classes, [CODES[kind] for kind in query.hidden])
    if query.text.strip():
        kept &= _containing(rows, query.text.casefold().split())
    keys = _sort_keys(rows, query.column)
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


def _containing(rows: ReadingRows, words: list[str]) -> NDArray[np.bool_]:
    # each word is searched in the few distinct texts of a column, not in every row
    angles, which = np.unique(np.round(rows.headings, 1), return_inverse=True)
    kept = np.ones(len(rows), bool)
    for word in words:
        in_heading = np.array([word in f"{angle:.1f}°" for angle in angles.tolist()], bool)[which]
        in_class = np.array([word in class_name(kind) for kind in CLASSES], bool)[rows.classes]
        in_path = np.array([*(word in name.casefold() for name in rows.path_names), False], bool)[rows.paths]
        kept &= in_heading | in_class | in_path
    return kept
