"""Small widgets that are not specific to sonar: labels, number fields, sliders, lists, tables, bars and layouts."""

from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any, TypeVar, cast

from PySide6 import QtCore, QtGui, QtWidgets
from PySide6.QtGui import QColor, QFont, QIcon, QKeyEvent, QPainter, QPaintEvent, QPixmap, QPolygonF, QResizeEvent

_Box = TypeVar("_Box", bound=QtWidgets.QBoxLayout)
# A layout that wraps its items into further lines, so that a long row never makes the window too wide.


class FlowLayout(QtWidgets.QLayout):
    """Items in lines, wrapped like words in a text."""

    def __init__(self, parent: QtWidgets.QWidget, margins: QtCore.QMargins, gap: int) -> None:
        super().__init__(parent)
        self._items: list[QtWidgets.QLayoutItem] = []
        self.gap = gap
        self.setContentsMargins(margins)

    def addItem(self, item: QtWidgets.QLayoutItem) -> None:
        """Append an item."""
        self._items.append(item)

    def count(self) -> int:
        """Return the number of items."""
        return len(self._items)

    def itemAt(self, index: int) -> QtWidgets.QLayoutItem | None:
        """Return an item, or None if the index is out of range."""
        return self._items[index] if 0 <= index < len(self._items) else None

    def takeAt(self, index: int) -> QtWidgets.QLayoutItem | None:  # type: ignore[override, unused-ignore]
        """Remove and return an item; None if the index is out of range, which ends Qt's loop."""
        return self._items.pop(index) if 0 <= index < len(self._items) else None

    def expandingDirections(self) -> QtCore.Qt.Orientation:
        """Return that the layout does not expand."""
        return QtCore.Qt.Orientation(0)

    def hasHeightForWidth(self) -> bool:
        """Return that the height depends on the width."""
        return True

    def heightForWidth(self, width: int) -> int:
        """Return the height for a width."""
        return self._placed(QtCore.QRect(0, 0, width, 0), move=False)

    def setGeometry(self, area: QtCore.QRect) -> None:
        """Place every item."""
        super().setGeometry(area)
        self._placed(area, move=True)

    def sizeHint(self) -> QtCore.QSize:
        """Return the size of all items in one line."""
        margins = self.contentsMargins()
        hints = [item.sizeHint() for item in self._items if not item.isEmpty()]
        width = sum(hint.width() for hint in hints) + self.gap * max(0, len(hints) - 1)
        height = max((hint.height() for hint in hints), default=0)
        return QtCore.QSize(width, height).grownBy(margins)

    def minimumSize(self) -> QtCore.QSize:
        """Return the size of the largest item."""
        width = max((item.minimumSize().width() for item in self._items), default=0)
        height = max((item.minimumSize().height() for item in self._items), default=0)
        return QtCore.QSize(width, height).grownBy(self.contentsMargins())

    def _placed(self, area: QtCore.QRect, move: bool) -> int:
        """Return the height that the items need in the width of `area`; `move` also places them."""
        margins = self.contentsMargins()
        inside = area.marginsRemoved(margins)
        x, y, line = inside.left(), inside.top(), 0
        for item in self._items:
            hint = item.sizeHint()
            if item.isEmpty():
                continue
            if x > inside.left() and x + hint.width() > inside.right() + 1:
                x, y, line = inside.left(), y + line + self.gap // 2, 0
            if move:
                item.setGeometry(QtCore.QRect(QtCore.QPoint(x, y), hint))
            x += hint.width() + self.gap
            line = max(line, hint.height())
        return y + line + margins.bottom() - area.top()


# A container for a widget whose content changes with each reading. The change does not trigger a new layout of the
# window, which moves every dock.
#
# Only a change of the height does, as with a larger text size.


class LayoutBarrier(QtWidgets.QWidget):
    """Takes its height from its widget and its width from the layout."""

    def __init__(self, widget: QtWidgets.QWidget) -> None:
        super().__init__()
        widget.setParent(self)
        self._widget = widget
        self._height = self._needed_height()

    def sizeHint(self) -> QtCore.QSize:
        """Return the minimum width of the widget, and the height that it needs."""
        return QtCore.QSize(self._widget.minimumWidth(), self._needed_height())

    minimumSizeHint = sizeHint

    def event(self, event: QtCore.QEvent) -> bool:
        """Pass a layout request to the parent only if the needed height has changed, also while it was hidden."""
        kinds = QtCore.QEvent.Type.LayoutRequest, QtCore.QEvent.Type.Show
        if event.type() in kinds and self._height != (needed := self._needed_height()):
            self._height = needed
            self.updateGeometry()
        return super().event(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the widget the whole area."""
        self._widget.setGeometry(self.rect())

    def _needed_height(self) -> int:
        least = self._widget.minimumHeight()
        if least == self._widget.maximumHeight():
            return least  # the size hint of a wrapped text lays it out for another width, which paints it twice
        if self._widget.hasHeightForWidth():
            return max(least, self._widget.heightForWidth(self.width()))
        return max(least, self._widget.minimumSizeHint().height())


# Icons of the replay bar. Not every font has these symbols, and Qt's own icons are dark on dark.


_SIZE = 16  # pixels
Shape = Sequence[tuple[float, ...]]  # two corners of a bar, or three of a triangle, in sixteenths

PLAY: Shape = ((4, 2, 4, 14, 14, 8),)
PAUSE: Shape = ((3, 2, 6.5, 14), (9.5, 2, 13, 14))
STEP_FORTH: Shape = ((2, 3, 4.5, 13), (6.5, 3, 6.5, 13, 14, 8))
STEP_BACK: Shape = ((11.5, 3, 14, 13), (9.5, 3, 9.5, 13, 2, 8))
NEXT_SCAN: Shape = ((1, 3, 1, 13, 7, 8), (7, 3, 7, 13, 13, 8), (13, 3, 15, 13))
PREVIOUS_SCAN: Shape = ((15, 3, 15, 13, 9, 8), (9, 3, 9, 13, 3, 8), (1, 3, 3, 13))


def media_icon(shape: Shape, colour: str, faint: str, ratio: float) -> QIcon:
    """Return an icon in `colour`, and in `faint` when disabled; `ratio`: device pixels per pixel."""
    icon = QIcon(_drawn(shape, colour, ratio))
    icon.addPixmap(_drawn(shape, faint, ratio), QIcon.Mode.Disabled)
    return icon


def _drawn(shape: Shape, colour: str, ratio: float) -> QPixmap:
    picture = QPixmap(round(_SIZE * ratio), round(_SIZE * ratio))
    picture.setDevicePixelRatio(ratio)
    picture.fill(QtCore.Qt.GlobalColor.transparent)
    with QPainter(picture) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QtCore.Qt.PenStyle.NoPen)
        painter.setBrush(QColor(colour))
        for part in shape:
            corners = [QtCore.QPointF(*part[k : k + 2]) for k in range(0, len(part), 2)]
            if len(corners) == 2:
                painter.drawRect(QtCore.QRectF(*corners))
            else:
                painter.drawPolygon(QPolygonF(corners))
    return picture


# A bar that hides some of its parts where it is too narrow for all of them.


GAP = 6  # pixels between the parts


class NarrowBar(QtWidgets.QWidget):
    """A bar with groups of parts that it can do without: a narrow bar hides the first, a narrower one the next too."""

    dispensable: tuple[tuple[QtWidgets.QWidget, ...], ...] = ()

    def minimumSizeHint(self) -> QtCore.QSize:
        """Return the size without the parts that a narrow bar hides."""
        whole = super().minimumSizeHint()
        shown = [part for group in self.dispensable for part in group if not part.isHidden()]
        return QtCore.QSize(whole.width() - _width_of(shown), whole.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Hide what does not fit."""
        super().resizeEvent(event)
        self.hide_what_does_not_fit()

    def hide_what_does_not_fit(self) -> None:
        """Show the groups that fit into the width."""
        needed = self.minimumSizeHint().width()
        for group in reversed(self.dispensable):
            needed += _width_of(group)
            for part in group:
                part.setVisible(self.width() >= needed)


def _width_of(parts: Iterable[QtWidgets.QWidget]) -> int:
    return sum(part.sizeHint().width() + GAP for part in parts)


# A label that shows any text as it is. Names from files and devices may look like HTML.


class PlainLabel(QtWidgets.QLabel):
    """A label whose text and tooltip are never interpreted as HTML."""

    def __init__(self, text: str = "", *, wordWrap: bool = False) -> None:
        super().__init__(text, textFormat=QtCore.Qt.TextFormat.PlainText, wordWrap=wordWrap)

    @QtCore.Slot(str)
    def setToolTip(self, text: str) -> None:
        """Set the tooltip."""
        super().setToolTip(plain_tip(text))


def title_label(text: str) -> PlainLabel:
    """Return a bold label."""
    label, bold = PlainLabel(text), QFont()
    bold.setBold(True)  # only this property: a style sheet would keep the colour of the look that it was made in
    label.setFont(bold)
    return label


def plain_tip(text: str) -> str:
    """Return a tooltip that shows exactly this text. Qt interprets a tooltip that looks like HTML as HTML."""
    return f"<p>{escape(text)}</p>" if QtGui.Qt.mightBeRichText(text) else text


class ElidedLabel(PlainLabel):
    """One line of text, shortened to the width of the label."""

    def __init__(self) -> None:
        super().__init__()
        self.setAlignment(QtCore.Qt.AlignmentFlag.AlignRight | QtCore.Qt.AlignmentFlag.AlignVCenter)

    @QtCore.Slot(str)
    def setText(self, text: str) -> None:
        """Set the text and the tooltip."""
        if text != self.text():
            super().setText(text)
            self.setToolTip(text)

    def minimumSizeHint(self) -> QtCore.QSize:
        """Return a minimum width of 0."""
        return QtCore.QSize(0, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the shortened text."""
        with QPainter(self) as painter:
            area = self.contentsRect()
            text = self.fontMetrics().elidedText(self.text(), QtCore.Qt.TextElideMode.ElideRight, area.width())
            painter.drawText(area, self.alignment(), text)


# Let the mouse wheel scroll a panel instead of changing the field under the pointer, if the field has no focus.


class _WheelFilter(QtCore.QObject):
    """Leaves wheel events to the parent of its widget."""

    def __init__(self, widget: QtWidgets.QWidget) -> None:
        super().__init__(widget)
        self._widget = widget

    def eventFilter(self, watched: QtCore.QObject, event: QtCore.QEvent) -> bool:
        """Block wheel events of a widget without the focus."""
        if event.type() is not QtCore.QEvent.Type.Wheel or self._widget.hasFocus():
            return False
        event.ignore()
        return True


def ignore_wheel_without_focus(widget: QtWidgets.QWidget) -> None:
    """Let a slider, field or list react to the wheel only after a click or the Tab key."""
    widget.setFocusPolicy(QtCore.Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_WheelFilter(widget))


# A row of buttons that is one tab stop.


_ARROWS = {QtCore.Qt.Key.Key_Left: -1, QtCore.Qt.Key.Key_Right: 1}


class ArrowRow(QtCore.QObject):
    """Moves the focus between the buttons of a row with the left and right keys, so that Tab visits one of them."""

    def __init__(self, row: QtWidgets.QWidget) -> None:
        super().__init__(row)
        self._row = row
        self._newest: QtCore.QObject | None = None  # the button that had the focus last
        for button in row.findChildren(QtWidgets.QAbstractButton):
            button.installEventFilter(self)

    def buttons(self) -> list[QtWidgets.QAbstractButton]:
        """Return the buttons that can have the focus, from left to right."""
        buttons = self._row.findChildren(QtWidgets.QAbstractButton)
        usable = (button for button in buttons if button.isVisible() and button.isEnabled())
        focusable = (button for button in usable if button.focusPolicy() & QtCore.Qt.FocusPolicy.TabFocus)
        return sorted(focusable, key=lambda button: (button.y(), button.x()))

    def skips(self, widget: QtWidgets.QWidget) -> bool:
        """Return whether Tab skips a widget: a button of the row beside the one that had the focus last."""
        buttons = self.buttons()
        return widget in buttons and widget is not (self._newest if self._newest in buttons else buttons[0])

    def eventFilter(self, watched: QtCore.QObject, event: QtCore.QEvent) -> bool:
        """Use the left and right keys of the buttons."""
        if event.type() is QtCore.QEvent.Type.FocusIn:
            self._newest = watched
        if not isinstance(event, QKeyEvent) or event.key() not in _ARROWS:
            return False
        event.accept()  # else the window steps through the readings with these keys
        if event.type() is QtCore.QEvent.Type.KeyPress:
            buttons = self.buttons()
            place = buttons.index(cast(QtWidgets.QAbstractButton, watched)) + _ARROWS[QtCore.Qt.Key(event.key())]
            buttons[place % len(buttons)].setFocus(QtCore.Qt.FocusReason.TabFocusReason)
        return True


# A number field without digit grouping that accepts a comma as the decimal point.
#
# A value is applied on Enter or when the field loses the focus; incomplete input is not applied.


class NumberField(QtWidgets.QDoubleSpinBox):
    """A number with decimals, in the same format on every system."""

    def __init__(self, low: float, high: float, decimals: int = 2, suffix: str = "") -> None:
        super().__init__(decimals=decimals, minimum=low, maximum=high, suffix=suffix)
        plain = QtCore.QLocale.c()
        plain.setNumberOptions(
            QtCore.QLocale.NumberOption.OmitGroupSeparator | QtCore.QLocale.NumberOption.RejectGroupSeparator
        )
        self.setLocale(plain)
        self.setKeyboardTracking(False)
        ignore_wheel_without_focus(self)

    def validate(self, text: str, cursor: int) -> Any:
        """Accept a comma and replace it by a decimal point."""
        return super().validate(text.replace(",", "."), cursor)


# A drop-down list of names that does not widen its panel.


_SHORT = 8  # characters, minimum width of a list


def short_list() -> QtWidgets.QComboBox:
    """Return an empty list that does not widen the panel for a long name."""
    field = QtWidgets.QComboBox()
    field.setSizeAdjustPolicy(QtWidgets.QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    field.setMinimumContentsLength(_SHORT)
    ignore_wheel_without_focus(field)
    return field


def show_names(field: QtWidgets.QComboBox, names: Iterable[str], current: str) -> None:
    """Fill a list with names and choose `current` if it is among them."""
    wanted = [*names]
    with QtCore.QSignalBlocker(field):
        if [field.itemText(k) for k in range(field.count())] != wanted:
            field.clear()
            field.addItems(wanted)
        field.setCurrentIndex(wanted.index(current) if current in wanted else 0)


# A slider with a number field for the same value. One drag of the slider is one gesture, and so one undo step.


class SliderField(QtWidgets.QWidget):
    """A slider and a number field for one value between two bounds."""

    changed = QtCore.Signal(float, object)  # the value, the gesture

    def __init__(self, low: float, high: float, decimals: int, suffix: str, tip: str) -> None:
        super().__init__()
        self._step = 10.0**-decimals
        self._low = low
        self._gesture = object()
        self.slider = QtWidgets.QSlider(QtCore.Qt.Orientation.Horizontal)
        self.slider.setRange(0, round((high - low) / self._step))
        self.slider.setPageStep(max(1, self.slider.maximum() // 10))
        ignore_wheel_without_focus(self.slider)
        self.field = NumberField(low, high, decimals, suffix)
        self.field.setSingleStep(self._step)
        self.field.setSizePolicy(QtWidgets.QSizePolicy.Policy.Fixed, QtWidgets.QSizePolicy.Policy.Fixed)
        for part in (self.slider, self.field):
            part.setToolTip(tip)
            part.setAccessibleName(tip)
        row = QtWidgets.QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.slider, stretch=1)
        row.addWidget(self.field)
        self.setFocusProxy(self.slider)
        self.slider.sliderPressed.connect(self._begin)
        self.slider.valueChanged.connect(self._slid)
        self.field.valueChanged.connect(self._typed)

    @property
    def value(self) -> float:
        """The current value."""
        return self.field.value()

    def show_value(self, value: float) -> None:
        """Show a value, except while the user drags the slider."""
        if self.slider.isSliderDown() or abs(value - self.field.value()) < self._step / 2:
            return
        self._set_both(value)

    def _set_both(self, value: float) -> None:
        with QtCore.QSignalBlocker(self.slider), QtCore.QSignalBlocker(self.field):
            self.slider.setValue(round((value - self._low) / self._step))
            self.field.setValue(value)

    @QtCore.Slot()
    def _begin(self) -> None:
        self._gesture = object()

    @QtCore.Slot(int)
    def _slid(self, steps: int) -> None:
        if not self.slider.isSliderDown():
            self._begin()  # changed by key or wheel
        self._set(self._low + steps * self._step)

    @QtCore.Slot(float)
    def _typed(self, value: float) -> None:
        self._begin()
        self._set(value)

    def _set(self, value: float) -> None:
        self._set_both(value)
        self.changed.emit(self.field.value(), self._gesture)


def text_table(*columns: str) -> QtWidgets.QTableWidget:
    """Return an empty table of texts with these columns, of which the user can select a row."""
    table = QtWidgets.QTableWidget(0, len(columns))
    table.setHorizontalHeaderLabels(columns)
    table.setSelectionBehavior(QtWidgets.QAbstractItemView.SelectionBehavior.SelectRows)
    table.setSelectionMode(QtWidgets.QAbstractItemView.SelectionMode.SingleSelection)
    table.setEditTriggers(QtWidgets.QAbstractItemView.EditTrigger.NoEditTriggers)
    table.verticalHeader().hide()
    table.horizontalHeader().setStretchLastSection(True)
    return table


def cell(text: str, tip: str = "") -> QtWidgets.QTableWidgetItem:
    """Return a cell of a table; its tooltip is `tip`, or else the whole text."""
    item = QtWidgets.QTableWidgetItem(text)
    item.setToolTip(plain_tip(tip or text))
    return item


def arranged(
    layout: _Box,
    *parts: QtWidgets.QWidget | QtWidgets.QLayout,
    rest: QtWidgets.QWidget | None = None,
    margins: tuple[int, int, int, int] = (0, 0, 0, 0),
    gap: int = 0,
) -> _Box:
    """Return a row or column with these parts; `rest` is the one that gets the space that is left."""
    layout.setContentsMargins(*margins)
    layout.setSpacing(gap)
    for part in parts:
        if isinstance(part, QtWidgets.QLayout):
            layout.addLayout(part)
        else:
            layout.addWidget(part, stretch=int(part is rest))
    return layout


def stacked(
    widget: QtWidgets.QWidget,
    *parts: QtWidgets.QWidget | QtWidgets.QLayout | tuple[QtWidgets.QWidget | None, ...] | None,
) -> QtWidgets.QVBoxLayout:
    """Arrange parts one below the other; those of a tuple side by side. A list, a table, or None takes the rest."""
    column = QtWidgets.QVBoxLayout(widget)
    for part in parts:
        if part is None:
            column.addStretch(1)
        elif isinstance(part, QtWidgets.QWidget):
            column.addWidget(part, stretch=int(isinstance(part, QtWidgets.QAbstractItemView)))
        elif isinstance(part, QtWidgets.QLayout):
            column.addLayout(part)
        else:
            column.addLayout(beside(*part))
    return column


def beside(*parts: QtWidgets.QWidget | None) -> QtWidgets.QHBoxLayout:
    """Return parts side by side; None takes the rest."""
    row = QtWidgets.QHBoxLayout()
    for part in parts:
        if part is None:
            row.addStretch(1)
        else:
            row.addWidget(part)
    return row


def button(text: str, tip: str, slot: Callable[..., object] | QtCore.SignalInstance) -> QtWidgets.QPushButton:
    """Return a button that runs `slot`, or emits that signal."""
    made = QtWidgets.QPushButton(text)
    made.setToolTip(tip)
    made.clicked.connect(slot)
    return made


# Dialogs that are not modal, one at a time in each window.


def close_dialogs(window: QtWidgets.QWidget, but: QtWidgets.QDialog | None = None) -> None:
    """Close every open dialog of `window`, except `but`."""
    for dialog in window.findChildren(QtWidgets.QDialog):
        if dialog is not but and dialog.isVisible():
            dialog.close()


def show_alone(dialog: QtWidgets.QDialog) -> None:
    """Show a dialog, which is deleted when it is closed, and close the others of its window."""
    parent = dialog.parentWidget()
    if parent is not None:
        close_dialogs(parent.window(), but=dialog)
    dialog.setAttribute(QtCore.Qt.WidgetAttribute.WA_DeleteOnClose)
    dialog.show()
    dialog.raise_()
