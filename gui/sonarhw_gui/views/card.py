"""The card below the large view: why the selected reading has its range, and what to do next."""

from collections.abc import Sequence
from math import ceil

from PySide6 import QtCore, QtGui, QtWidgets
from sonarhw_compare.match import Kind

from sonarhw_gui.model.look import MARKS, Class, Look
from sonarhw_gui.model.shown import Shown, bounces_text
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views.legend import mark_picture
from sonarhw_gui.widgets import ElidedLabel, LabelSlot, PlainLabel, arranged

_WHY_LINES = 2  # fixed height, so that a longer sentence does not move the views
_MARGIN = 12
_HEAD, _WHY = 1.15, 1.0  # of the default text size
MISFITS = Kind.SHORT, Kind.LONG, Kind.EXTRA, Kind.MISSED


def chosen_class(shown: Shown) -> Class | None:
    """Return the class of the selected reading; None without one, before it is compared, or for an asked heading."""
    if shown.chosen is None or shown.asked is not None:
        return None
    row = shown.row(shown.chosen)
    return None if row is None else row.kind


class Sentence(QtWidgets.QWidget):
    """Explains the selected reading: what it is in one bold line, and why in two lines.

    The tooltip has the whole sentence if it does not fit.
    """

    def __init__(self) -> None:
        super().__init__()
        self._whole = ""
        self._look: Look | None = None
        self.head, self.why = PlainLabel(), PlainLabel(wordWrap=True)
        for label in (self.head, self.why):
            label.setTextInteractionFlags(QtCore.Qt.TextInteractionFlag.TextSelectableByMouse)
            label.setMinimumWidth(1)
        arranged(QtWidgets.QVBoxLayout(self), LabelSlot(self.head), LabelSlot(self.why))

    def text(self) -> str:
        """Return the whole sentence."""
        return self._whole

    def show_state(self, shown: Shown) -> None:
        """Show the sentence of the selected reading, in grey while it belongs to an older prediction."""
        for label in (self.head, self.why):
            _fade(label, shown.outdated)
        if self._look is None or self._look.scale != shown.look.scale:
            self._look = shown.look
            head = text_font(shown.look, _HEAD)
            head.setBold(True)
            _set_font(self.head, head, 1)
            _set_font(self.why, text_font(shown.look, _WHY), _WHY_LINES)
            self._fit()
        if self._whole != shown.sentence:
            self._whole = shown.sentence
            self._fit()

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Fit the sentence into the new width."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        whole_head, _, whole_why = self._whole.partition("; ")
        head = shortened_to_lines(whole_head, self.head.font(), self.width(), 1)
        why = shortened_to_lines(whole_why, self.why.font(), self.width(), _WHY_LINES)
        self.head.setText(head)
        self.why.setText(why)
        self.why.heightForWidth(self.width())  # lays out now: during the paint, it would ask for another one
        self.setToolTip(self._whole if (head, why) != (whole_head, whole_why) else "")


class BounceLine(ElidedLabel):
    """The note on the selected reading, and the bounces of its path, numbered as in the plan, with the loss of each."""

    def __init__(self) -> None:
        super().__init__()
        self.setAlignment(QtCore.Qt.AlignmentFlag.AlignLeft | QtCore.Qt.AlignmentFlag.AlignVCenter)
        self._look: Look | None = None

    def show_state(self, shown: Shown) -> None:
        """Show note and bounces, in grey while they belong to an older prediction."""
        _fade(self, shown.outdated)
        if self._look is None or self._look.scale != shown.look.scale:
            self._look = shown.look
            _set_font(self, text_font(shown.look), 1)
        note = "" if shown.asked is not None else shown.notes.of(shown.chosen)
        text = " — ".join(filter(None, (f"note: {note}" if note else "", bounces_text(shown))))
        self.setText(text)


class Card(QtWidgets.QFrame):
    """The sentence and the bounces, with the mark of the reading's class, and buttons for what to do next."""

    def __init__(self, for_misfits: Sequence[QtGui.QAction], for_all: Sequence[QtGui.QAction]) -> None:
        """`for_misfits`: the actions that are offered only for a reading that does not match."""
        super().__init__()
        self.sentence, self.bounces = Sentence(), BounceLine()
        self._mark = PlainLabel()
        self._drawn: tuple[Class | None, Look] | None = None
        self.misfit_buttons = [_button(action) for action in for_misfits]
        buttons = [*self.misfit_buttons, *map(_button, for_all)]
        bounces = LabelSlot(self.bounces)
        lower = arranged(QtWidgets.QHBoxLayout(), bounces, *buttons, rest=bounces, gap=4)
        text = arranged(QtWidgets.QVBoxLayout(), self.sentence, lower, gap=2)
        row = QtWidgets.QHBoxLayout(self)
        row.setContentsMargins(_MARGIN, 3, 6, 4)
        row.addWidget(self._mark, alignment=QtCore.Qt.AlignmentFlag.AlignTop)
        row.addLayout(text, stretch=1)
        self.setAutoFillBackground(True)

    def show_state(self, shown: Shown) -> None:
        """Show the selected reading, its mark, and what can be done."""
        self.sentence.show_state(shown)
        self.bounces.show_state(shown)
        kind = chosen_class(shown)
        if self._drawn == (kind, shown.look):
            return
        self._drawn = kind, shown.look
        misfit = kind in MISFITS
        for button in self.misfit_buttons:
            button.setVisible(misfit)
        colours, palette = shown.look.palette, self.palette()
        paper = colours.warning_paper if misfit else colours.window
        palette.setColor(QtGui.QPalette.ColorRole.Window, QtGui.QColor(paper))
        self.setPalette(palette)
        self._mark.setVisible(kind in MARKS)
        if kind is not None and kind in MARKS:
            self._mark.setPixmap(mark_picture(kind, colours, self.devicePixelRatioF()))
            self._mark.setToolTip(f"{MARKS[kind].name}: {MARKS[kind].meaning}")


def _button(action: QtGui.QAction) -> QtWidgets.QToolButton:
    button = QtWidgets.QToolButton()
    button.setDefaultAction(action)
    button.setFocusPolicy(QtCore.Qt.FocusPolicy.NoFocus)  # each has a key and a place in a menu
    return button


def _set_font(label: PlainLabel, font: QtGui.QFont, lines: int) -> None:
    label.setFont(font)
    label.setFixedHeight(lines * ceil(QtGui.QFontMetricsF(font).lineSpacing()) + 2)


def _fade(label: PlainLabel, outdated: bool) -> None:
    """Show a text in grey or in black. Qt sends a change of the palette even if the role is the same."""
    role = QtGui.QPalette.ColorRole.PlaceholderText if outdated else QtGui.QPalette.ColorRole.WindowText
    if label.foregroundRole() != role:
        label.setForegroundRole(role)


def shortened_to_lines(text: str, font: QtGui.QFont, width: float, lines: int) -> str:
    """Return the text that fits into `lines` lines of `width` pixels; a shortened text ends in …."""
    layout = QtGui.QTextLayout(text, font)
    layout.beginLayout()
    starts = []
    while (line := layout.createLine()).isValid():
        line.setLineWidth(max(width, 1.0))
        starts.append(line.textStart())
    layout.endLayout()
    if len(starts) <= lines:
        return text
    last = starts[lines - 1]
    metrics = QtGui.QFontMetricsF(font)
    return text[:last] + metrics.elidedText(text[last:], QtCore.Qt.TextElideMode.ElideRight, width)
