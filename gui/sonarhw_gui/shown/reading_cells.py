"""The cells of the table of readings as text, and the same rows as CSV."""

import csv
import io
import math
from collections.abc import Callable, Iterable
from enum import IntEnum

from sonarhw.export import text_cell
from sonarhw.readings import Origin
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import MARKS, Class
from sonarhw_gui.look.residual_unit import residual_unit
from sonarhw_gui.scene.note_texts import NoteTexts
from sonarhw_gui.shown.reading_rows import CLASSES, ReadingRows

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


def _heading_text(rows: ReadingRows, row: int) -> str:
    """Return the heading, rounded so that 360.0° becomes 0.0°."""
    return f"{round(float(rows.headings[row]), 1) % 360:.1f}°"


def cell_text(rows: ReadingRows, row: int, column: Column, look: Look) -> str:
    """Return the text of a cell but those of notes and sentences, in the units of the look; a dash without a value."""
    match column:
        case Column.NUMBER:
            return str(row)
        case Column.HEADING:
            return _heading_text(rows, row)
        case Column.MEASURED:
            return _length(rows.measured[row], look)
        case Column.PREDICTED:
            return _length(rows.predicted[row], look)
        case Column.RESIDUAL:
            residual = float(rows.measured[row] - rows.predicted[row])
            return _NOTHING if math.isnan(residual) else residual_unit(look.unit).text(residual)
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
            return f"residual ({residual_unit(look.unit).label})"
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
