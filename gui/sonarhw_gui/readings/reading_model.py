"""The Qt model of the table of readings.

`reading_order` sorts and filters whole arrays. Qt's own proxy model would fetch two cells from Python for each of
half a million comparisons in a log of one hour.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, Qt
from PySide6.QtGui import QBrush, QColor, QPixmap

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import MARKS, Class, Unclassed
from sonarhw_gui.parts.plain_label import plain_tip
from sonarhw_gui.plots.legend_pictures import mark_picture
from sonarhw_gui.scene.note_texts import NO_NOTES
from sonarhw_gui.shown.reading_cells import Column, cell_text, column_name
from sonarhw_gui.shown.reading_order import RowQuery, order_of
from sonarhw_gui.shown.reading_rows import CLASSES, NO_ROWS, ReadingRows
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.work.comparing import IntArray

Index = QModelIndex | QPersistentModelIndex
_Role = Qt.ItemDataRole
_KNOWN_ROLES = frozenset(
    map(
        int,
        (
            *(_Role.DisplayRole, _Role.ToolTipRole, _Role.DecorationRole),
            *(_Role.TextAlignmentRole, _Role.ForegroundRole),
        ),
    )
)  # roles with a value; Qt requests seven roles at each paint of a cell
_PREDICTED = frozenset((Column.PREDICTED, Column.RESIDUAL, Column.CLASS, Column.PATH, Column.SENTENCE))
_AT_RIGHT = (Column.NUMBER, Column.HEADING, Column.MEASURED, Column.PREDICTED, Column.RESIDUAL)


class ReadingModel(QAbstractTableModel):
    """The filtered rows in the selected order."""

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.rows: ReadingRows = NO_ROWS
        self.order: IntArray = np.empty(0, np.int64)  # index into `rows` for each row of the table
        self.query = RowQuery()
        self._shown: Shown | None = None
        self._sentences: dict[int, str] = {}
        self._marks: dict[Class, QPixmap] = {}
        self._faint: QBrush | None = None  # colour of predicted values while they are outdated

    def show_state(self, shown: Shown) -> None:
        """Update readings, classes and look."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, "look", "origin"):
            self._marks = {kind: _mark(kind, shown.look) for kind in CLASSES}
            self._sentences.clear()
            self.headerDataChanged.emit(Qt.Orientation.Horizontal, 0, len(Column) - 1)
            self._emit_data_changed()
        if before is None or not shown.same_readings(before):
            self._sentences.clear()
            self._change(shown.rows, order_of(shown.rows, self.query, shown.notes))
        elif before.notes is not shown.notes:
            self._change(self.rows, order_of(self.rows, self.query, shown.notes))
        if shown.changed_since(before, "outdated", "look"):
            self._faint = QBrush(QColor(shown.look.palette.faint)) if shown.outdated else None
            self._emit_data_changed()

    def set_query(self, query: RowQuery) -> None:
        """Apply a filter and an order."""
        self.query = query
        self._change(self.rows, order_of(self.rows, query, self._shown.notes if self._shown else NO_NOTES))

    def row_of(self, reading: int) -> int | None:
        """Return the table row of a reading; None if it is filtered out."""
        places = np.flatnonzero(self.order == reading)
        return int(places[0]) if len(places) else None

    # QAbstractTableModel

    def rowCount(self, parent: Index = QModelIndex()) -> int:
        """Return the number of rows."""
        return 0 if parent.isValid() else len(self.order)

    def columnCount(self, parent: Index = QModelIndex()) -> int:
        """Return the number of columns."""
        return 0 if parent.isValid() else len(Column)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return text, mark, alignment, tooltip or colour of a cell."""
        if role not in _KNOWN_ROLES or not index.isValid() or self._shown is None:
            return None
        row, column = int(self.order[index.row()]), Column(index.column())
        match role:
            case _Role.DisplayRole:
                return self._text(self._shown, row, column)
            case _Role.ToolTipRole if column in (Column.NOTE, Column.PATH, Column.SENTENCE):
                return plain_tip(self._text(self._shown, row, column))
            case _Role.DecorationRole if column is Column.CLASS:
                return self._marks[CLASSES[self.rows.classes[row]]]
            case _Role.TextAlignmentRole if column in _AT_RIGHT:
                return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
            case _Role.ForegroundRole if column in _PREDICTED:
                return self._faint
        return None

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return the name of a column with its unit."""
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole and self._shown:
            return column_name(Column(section), self._shown.look, self._shown.origin)
        return None

    def sort(self, column: int, order: Qt.SortOrder = Qt.SortOrder.AscendingOrder) -> None:
        """Sort by a column. Sentences begin with the range and are sorted by it."""
        by = Column.MEASURED if column == Column.SENTENCE else Column(column)
        descending = order is Qt.SortOrder.DescendingOrder
        self.set_query(replace(self.query, column=by, descending=descending))

    # changes

    def _text(self, shown: Shown, row: int, column: Column) -> str:
        if column is Column.NOTE:
            return shown.notes.of(row)
        if column is not Column.SENTENCE:
            return cell_text(self.rows, row, column, shown.look)
        if row not in self._sentences:
            self._sentences[row] = shown.sentence_of(row)
        return self._sentences[row]

    def _change(self, rows: ReadingRows, order: IntArray) -> None:
        """Replace the rows so that the view keeps its scroll position while a scan adds rows at the end."""
        before, after = len(self.order), len(order)
        both = min(before, after)
        if not np.array_equal(self.order[:both], order[:both]):
            self.beginResetModel()
            self.rows, self.order = rows, order
            self.endResetModel()
            return
        if after > before:
            self.beginInsertRows(QModelIndex(), before, after - 1)
            self.rows, self.order = rows, order
            self.endInsertRows()
        elif after < before:
            self.beginRemoveRows(QModelIndex(), after, before - 1)
            self.rows, self.order = rows, order
            self.endRemoveRows()
        self.rows, self.order = rows, order
        self._emit_data_changed()

    def _emit_data_changed(self) -> None:
        if len(self.order):
            self.dataChanged.emit(self.index(0, 0), self.index(len(self.order) - 1, len(Column) - 1))


def _mark(kind: Class, look: Look) -> QPixmap:
    """Return the mark of a class, or an empty picture of the same size."""
    if kind in MARKS:
        return mark_picture(kind, look.palette, 1.0)
    empty = QPixmap(mark_picture(Unclassed.MEASURED, look.palette, 1.0).size())
    empty.fill(Qt.GlobalColor.transparent)
    return empty
