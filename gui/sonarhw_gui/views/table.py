"""The view "Readings": a table to sort, filter by class, by text and by notes, and copy as CSV."""

from dataclasses import replace
from typing import Any

import numpy as np
from PySide6 import QtCore, QtGui, QtWidgets

from sonarhw.errors import counted
from sonarhw_gui.jobs.forecast import IntArray
from sonarhw_gui.model.look import MARKS, Class, Look, Unclassed
from sonarhw_gui.model.rows import (
    CLASSES,
    NO_ROWS,
    Column,
    ReadingRows,
    RowQuery,
    cell_text,
    class_name,
    column_name,
    order_of,
    rows_as_csv,
)
from sonarhw_gui.model.scene import NO_NOTES
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views.base import Gestures, ViewEntry
from sonarhw_gui.views.legend import mark_picture
from sonarhw_gui.widgets import arranged, plain_tip

# The Qt model of the table of readings.
#
# `reading_order` sorts and filters whole arrays. Qt's own proxy model would fetch two cells from Python for each of
# half a million comparisons in a log of one hour.


Index = QtCore.QModelIndex | QtCore.QPersistentModelIndex
_Role = QtCore.Qt.ItemDataRole
_KNOWN_ROLES = frozenset(
    map(
        int,
        (
            *(_Role.DisplayRole, _Role.ToolTipRole, _Role.DecorationRole),
            *(_Role.TextAlignmentRole, _Role.ForegroundRole),
        ),
    )
)  # roles with a value; Qt requests seven roles at each paint of a cell
_COLUMNS = tuple(Column)  # by number, because a call of an enumeration takes longer
_PREDICTED = frozenset((Column.PREDICTED, Column.RESIDUAL, Column.CLASS, Column.PATH, Column.SENTENCE))
_AT_RIGHT = (Column.NUMBER, Column.HEADING, Column.MEASURED, Column.PREDICTED, Column.RESIDUAL)


class ReadingModel(QtCore.QAbstractTableModel):
    """The filtered rows in the selected order."""

    def __init__(self, parent: QtCore.QObject) -> None:
        super().__init__(parent)
        self.rows: ReadingRows = NO_ROWS
        self.order: IntArray = np.empty(0, np.int64)  # index into `rows` for each row of the table
        self.query = RowQuery()
        self._shown: Shown | None = None
        self._sentences: dict[int, str] = {}
        self._marks: dict[Class, QtGui.QPixmap] = {}
        self._faint: QtGui.QBrush | None = None  # colour of predicted values while they are outdated

    def show_state(self, shown: Shown) -> None:
        """Update readings, classes and look."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, lambda new: (new.look, new.origin)):
            self._marks = {kind: _mark(kind, shown.look) for kind in CLASSES}
            self._sentences.clear()
            self.headerDataChanged.emit(QtCore.Qt.Orientation.Horizontal, 0, len(Column) - 1)
            self._emit_data_changed()
        if before is None or not shown.same_readings(before):
            self._sentences.clear()
            self._change(shown.rows, order_of(shown.rows, self.query, shown.notes))
        elif before.notes is not shown.notes:
            self._change(self.rows, order_of(self.rows, self.query, shown.notes))
        if shown.changed_since(before, lambda new: (new.outdated, new.look)):
            self._faint = QtGui.QBrush(QtGui.QColor(shown.look.palette.faint)) if shown.outdated else None
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

    def rowCount(self, parent: Index = QtCore.QModelIndex()) -> int:
        """Return the number of rows."""
        return 0 if parent.isValid() else len(self.order)

    def columnCount(self, parent: Index = QtCore.QModelIndex()) -> int:
        """Return the number of columns."""
        return 0 if parent.isValid() else len(Column)

    def data(self, index: Index, role: int = QtCore.Qt.ItemDataRole.DisplayRole) -> Any:
        """Return text, mark, alignment, tooltip or colour of a cell."""
        if role not in _KNOWN_ROLES or not index.isValid() or self._shown is None:
            return None
        row, column = int(self.order[index.row()]), _COLUMNS[index.column()]
        match role:
            case _Role.DisplayRole:
                return self._text(self._shown, row, column)
            case _Role.ToolTipRole if column in (Column.NOTE, Column.PATH, Column.SENTENCE):
                return plain_tip(self._text(self._shown, row, column))
            case _Role.DecorationRole if column is Column.CLASS:
                return self._marks[CLASSES[self.rows.classes[row]]]
            case _Role.TextAlignmentRole if column in _AT_RIGHT:
                return QtCore.Qt.AlignmentFlag.AlignRight | QtCore.Qt.AlignmentFlag.AlignVCenter
            case _Role.ForegroundRole if column in _PREDICTED:
                return self._faint
        return None

    def headerData(
        self, section: int, orientation: QtCore.Qt.Orientation, role: int = QtCore.Qt.ItemDataRole.DisplayRole
    ) -> Any:
        """Return the name of a column with its unit."""
        if (
            orientation is QtCore.Qt.Orientation.Horizontal
            and role == QtCore.Qt.ItemDataRole.DisplayRole
            and self._shown
        ):
            return column_name(Column(section), self._shown.look, self._shown.origin)
        return None

    def sort(self, column: int, order: QtCore.Qt.SortOrder = QtCore.Qt.SortOrder.AscendingOrder) -> None:
        """Sort by a column. Sentences begin with the range and are sorted by it."""
        by = Column.MEASURED if column == Column.SENTENCE else Column(column)
        descending = order is QtCore.Qt.SortOrder.DescendingOrder
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
            self.beginInsertRows(QtCore.QModelIndex(), before, after - 1)
            self.rows, self.order = rows, order
            self.endInsertRows()
        elif after < before:
            self.beginRemoveRows(QtCore.QModelIndex(), after, before - 1)
            self.rows, self.order = rows, order
            self.endRemoveRows()
        self.rows, self.order = rows, order
        self._emit_data_changed()

    def _emit_data_changed(self) -> None:
        if len(self.order):
            self.dataChanged.emit(self.index(0, 0), self.index(len(self.order) - 1, len(Column) - 1))


def _mark(kind: Class, look: Look) -> QtGui.QPixmap:
    """Return the mark of a class, or an empty picture of the same size."""
    if kind in MARKS:
        return mark_picture(kind, look.palette, 1.0)
    empty = QtGui.QPixmap(mark_picture(Unclassed.MEASURED, look.palette, 1.0).size())
    empty.fill(QtCore.Qt.GlobalColor.transparent)
    return empty


_LEAST = {
    Column.CLASS: "missed",
    Column.NOTE: "a note on this",
    Column.PATH: "north>pillar",
    Column.SENTENCE: "0.827 m at 270.0°: three reflections",
}
_USUAL_PATH = "bottom>top>bottom"
_HIDDEN_FIRST = Column.SENTENCE, Column.PREDICTED, Column.NUMBER  # in a narrow table
_MARK = 20  # pixels, mark of a class with the gap before the name
_BESIDE = 12  # pixels, margins
_ARROW = 14  # pixels, sort indicator in the header
_LEAST_WORDS = 70  # pixels, of the field for words
_SELECT = QtCore.QItemSelectionModel.SelectionFlag.ClearAndSelect | QtCore.QItemSelectionModel.SelectionFlag.Rows


class _Rows(QtWidgets.QTableView):
    """A table view that leaves copying to its owner."""

    copied = QtCore.Signal()
    resized = QtCore.Signal()

    def keyPressEvent(self, event: QtGui.QKeyEvent) -> None:
        """Copy rows instead of the text of one cell."""
        if event.matches(QtGui.QKeySequence.StandardKey.Copy):
            self.copied.emit()
        else:
            super().keyPressEvent(event)

    def lay_out(self) -> None:
        """Lay out new rows now: Qt would do it after the next paint, and paint again."""
        self.executeDelayedItemsLayout()

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Keep the selected row visible."""
        super().resizeEvent(event)
        self.resized.emit()
        self.scrollTo(self.currentIndex())


class TableView(QtWidgets.QWidget):
    """A table with one row for each reading, and filters above it."""

    entry = ViewEntry("Readings", is_text=True)

    def __init__(self) -> None:
        super().__init__()
        self.gestures = Gestures(self)
        self._shown: Shown | None = None
        self._sorted_by = Column.NUMBER
        self._path_width = 0  # pixels, while the column of sentences is visible
        self._following = False  # whether the selection changes because the selected reading or the rows changed
        self.model = ReadingModel(self)
        self.view = self._made_view()
        self.words = QtWidgets.QLineEdit(
            clearButtonEnabled=True, placeholderText="wall, heading, class or note (Ctrl+F)"
        )
        self.words.setMinimumWidth(_LEAST_WORDS)
        self.words.setToolTip("Show only readings whose path, heading, class and note contain all these words")
        self.noted = QtWidgets.QToolButton(autoRaise=True)
        self.noted.setCheckable(True)
        self.noted.hide()
        self.noted.setToolTip("List only readings with a note")
        self.copy = QtWidgets.QToolButton()
        copy = QtGui.QAction("Copy CSV", self)
        copy.setToolTip("Copy the selected rows; with fewer than two selected, copy all listed rows (Ctrl+C)")
        copy.triggered.connect(self.copy_rows)
        self.copy.setDefaultAction(copy)
        self.addAction(copy)
        self.words.setSizePolicy(
            QtWidgets.QSizePolicy.Policy.Ignored, QtWidgets.QSizePolicy.Policy.Fixed
        )  # the buttons come first
        parts = self.noted, self.words, self.copy
        bar = arranged(QtWidgets.QHBoxLayout(), *parts, rest=self.words, margins=(6, 2, 6, 2), gap=2)
        arranged(QtWidgets.QVBoxLayout(self), bar, self.view)
        self._connect()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, lambda new: (new.look,)):
            self._set_look(shown)
        if before is not None and before.hidden is not shown.hidden:
            self._filter()
        self._following = True  # added or removed rows move the selection; the user has picked nothing
        self.model.show_state(shown)
        self._following = False
        if shown.changed_since(before, lambda new: (new.notes,)):
            self._count_notes(shown)
        if before is None or _width_inputs(before) != _width_inputs(shown):
            self._widen_columns(shown)
        self._follow(shown.chosen)
        self.view.lay_out()

    def fit(self) -> None:
        """Show the selected reading, and the columns that fit."""
        self._follow_again()
        self._choose_columns()

    def picture(self) -> None:
        """Return None: only plots are saved as pictures."""

    @QtCore.Slot()
    def copy_rows(self) -> None:
        """Copy the selected rows as CSV; with fewer than two selected, copy all listed rows."""
        if self._shown is not None:
            selected = sorted(index.row() for index in self.view.selectionModel().selectedRows())
            order = self.model.order[selected] if len(selected) > 1 else self.model.order
            in_metres = replace(self._shown, look=Look())
            text = rows_as_csv(self.model.rows, order.tolist(), in_metres.sentence_of, in_metres.notes)
            QtGui.QGuiApplication.clipboard().setText(text)

    def _made_view(self) -> _Rows:
        view = _Rows(showGrid=False, wordWrap=False)
        view.setAlternatingRowColors(True)
        view.setModel(self.model)
        view.setSelectionBehavior(QtWidgets.QAbstractItemView.SelectionBehavior.SelectRows)
        view.setEditTriggers(QtWidgets.QAbstractItemView.EditTrigger.NoEditTriggers)
        view.setVerticalScrollMode(QtWidgets.QAbstractItemView.ScrollMode.ScrollPerItem)
        view.setTabKeyNavigation(False)
        view.verticalHeader().hide()
        view.horizontalHeader().setStretchLastSection(True)
        view.horizontalHeader().setHighlightSections(False)
        view.horizontalHeader().setSortIndicator(Column.NUMBER, QtCore.Qt.SortOrder.AscendingOrder)
        view.setSortingEnabled(True)
        return view

    def _connect(self) -> None:
        self.view.selectionModel().currentRowChanged.connect(self._row_changed)
        self.view.clicked.connect(self._pick)
        self.model.modelReset.connect(self._follow_again)
        self.words.textChanged.connect(self._filter)
        self.noted.toggled.connect(self._filter)
        self.view.copied.connect(self.copy_rows)
        self.view.resized.connect(self._choose_columns)
        self.view.horizontalHeader().sortIndicatorChanged.connect(self._move_arrow)
        QtGui.QShortcut(QtGui.QKeySequence.StandardKey.Find, self).activated.connect(self.words.setFocus)

    def _set_look(self, shown: Shown) -> None:
        look = shown.look
        font = text_font(look, 0.9)
        metrics = QtGui.QFontMetrics(font)
        self.view.setFont(font)
        self.view.horizontalHeader().setFont(font)
        self.view.verticalHeader().setDefaultSectionSize(metrics.height() + 4)
        for column in Column:
            self.view.setColumnWidth(column, self._needed(shown, column))
        self._path_width = metrics.horizontalAdvance(_USUAL_PATH) + _BESIDE
        self.noted.setFont(font)

    def _widen_columns(self, shown: Shown) -> None:
        """Widen the columns for longer numbers and class names."""
        for column in (Column.NUMBER, Column.CLASS):
            self.view.setColumnWidth(column, max(self._needed(shown, column), self.view.columnWidth(column)))
        self._choose_columns()

    def _needed(self, shown: Shown, column: Column) -> int:
        """Return the pixels that a column needs to be readable; for a path or a sentence, a useful minimum."""
        widest = _LEAST.get(column, "")
        if column is Column.NUMBER:
            widest = "0" * _digits(shown)
        elif column is Column.CLASS and shown.scene.room is None:
            widest = class_name(Unclassed.MEASURED)
        text = max(
            map(self.view.fontMetrics().horizontalAdvance, (widest, column_name(column, shown.look, shown.origin)))
        )
        return text + _BESIDE + _MARK * (column is Column.CLASS) + _ARROW * (column is self._sorted_by)

    @QtCore.Slot()
    def _choose_columns(self) -> None:
        """Hide the least important columns until the others are readable."""
        if self._shown is None:
            return
        needed = {column: self._needed(self._shown, column) for column in Column}
        if not self._shown.notes:
            del needed[Column.NOTE]
        for column in _HIDDEN_FIRST:
            if sum(needed.values()) > self.view.viewport().width():
                del needed[column]
        for column in Column:
            self.view.setColumnHidden(column, column not in needed)
        # the last column is stretched but never made smaller
        self.view.setColumnWidth(Column.PATH, self._path_width if Column.SENTENCE in needed else needed[Column.PATH])

    @QtCore.Slot(int)
    def _move_arrow(self, column: int) -> None:
        before, self._sorted_by = self._sorted_by, Column(column)
        if self._shown is not None:
            for which in (before, self._sorted_by):
                self.view.setColumnWidth(which, self._needed(self._shown, which))
            self._choose_columns()

    def _count_notes(self, shown: Shown) -> None:
        count = len(shown.notes)
        self.noted.setText(counted(count, "note"))
        self.noted.setAccessibleName(f"only readings with a note: {count}")
        self.noted.setFixedSize(self.noted.sizeHint())
        self.noted.setVisible(count > 0)
        if not count:
            self.noted.setChecked(False)  # otherwise no reading would be listed

    @QtCore.Slot()
    def _filter(self) -> None:
        hidden = frozenset(kind for kind in CLASSES if self._shown is not None and kind in self._shown.hidden)
        self._following = True
        query = replace(self.model.query, hidden=hidden, text=self.words.text(), noted=self.noted.isChecked())
        self.model.set_query(query)
        self._following = False
        self._follow_again()

    # selection and selected reading

    def _follow(self, chosen: int | None) -> None:
        """Select the row of the selected reading if it is listed."""
        place = None if chosen is None else self.model.row_of(chosen)
        current, selection = self.view.currentIndex(), self.view.selectionModel()
        # if the selected row was removed, Qt makes its neighbour current without selecting it
        if place is None or (place == current.row() and selection.hasSelection()):
            return
        self._following = True
        # not through the view, which selects differently while Ctrl or Shift is held
        selection.setCurrentIndex(self.model.index(place, max(current.column(), 0)), _SELECT)
        self._following = False

    @QtCore.Slot()
    def _follow_again(self) -> None:
        if self._shown is not None:
            self._follow(self._shown.chosen)
            self.view.scrollTo(self.view.currentIndex())

    @QtCore.Slot(QtCore.QModelIndex, QtCore.QModelIndex)
    def _row_changed(self, current: QtCore.QModelIndex, before: QtCore.QModelIndex) -> None:
        if not self._following:
            self._pick(current)

    @QtCore.Slot(QtCore.QModelIndex)
    def _pick(self, index: QtCore.QModelIndex) -> None:
        if index.isValid():
            self.gestures.picked.emit(int(self.model.order[index.row()]))


def _width_inputs(shown: Shown) -> tuple[Look, int, bool, bool]:
    """Return the values that the column widths depend on."""
    return shown.look, _digits(shown), shown.scene.room is None, bool(shown.notes)


def _digits(shown: Shown) -> int:
    return len(str(len(shown.readings)))
