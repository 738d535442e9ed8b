"""The sentence that explains the selected reading, and the line with the bounces of its path.

The tooltip has the full text of what does not fit.
"""

from math import ceil

from PySide6.QtCore import Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPalette, QResizeEvent, QTextLayout

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.shown.bounces import bounces_text
from sonarhw_gui.shown.shown import Shown

_LINES = 2  # fixed height, so that a longer sentence does not move the views
_MARGIN, _ABOVE, _BELOW = 12, 3, 3
_SIZE = 1.2  # of the default text size


class Sentence(PlainLabel):
    """Explains the selected reading."""

    def __init__(self) -> None:
        super().__init__()
        self._whole = ""
        self._look: Look | None = None
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setContentsMargins(_MARGIN, _ABOVE, _MARGIN, _ABOVE)
        self.setMinimumWidth(1)

    def show_state(self, shown: Shown) -> None:
        """Show the sentence of the selected reading, in grey while it belongs to an older prediction."""
        _fade(self, shown.outdated)
        if self._look is None or self._look.scale != shown.look.scale:
            self._look = shown.look
            self.setFont(text_font(shown.look, _SIZE))
            self.setFixedHeight(_LINES * ceil(QFontMetricsF(self.font()).lineSpacing()) + 2 * _ABOVE)
            self._fit()
        if self._whole != shown.sentence:
            self._whole = shown.sentence
            self._fit()

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit the sentence into the new width."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        fitting = shortened_to_lines(self._whole, self.font(), self.width() - 2 * _MARGIN, _LINES)
        self.setText(fitting)
        self.heightForWidth(self.width())  # lays out now: during the paint, it would ask for another one
        self.setToolTip(self._whole if fitting != self._whole else "")


class BounceLine(ElidedLabel):
    """The note on the selected reading, and the bounces of its path, numbered as in the plan, with the loss of each."""

    def __init__(self) -> None:
        super().__init__()
        self.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.setContentsMargins(_MARGIN, 0, _MARGIN, _BELOW)
        self._look: Look | None = None

    def show_state(self, shown: Shown) -> None:
        """Show note and bounces, in grey while they belong to an older prediction."""
        _fade(self, shown.outdated)
        if self._look is None or self._look.scale != shown.look.scale:
            self._look = shown.look
            self.setFont(text_font(shown.look))
            self.setFixedHeight(ceil(QFontMetricsF(self.font()).lineSpacing()) + _BELOW)
        note = "" if shown.asked is not None else shown.notes.of(shown.chosen)
        text = " — ".join(filter(None, (f"note: {note}" if note else "", bounces_text(shown))))
        self.setText(text)


def _fade(label: PlainLabel, outdated: bool) -> None:
    """Show a text in grey or in black. Qt sends a change of the palette even if the role is the same."""
    role = QPalette.ColorRole.PlaceholderText if outdated else QPalette.ColorRole.WindowText
    if label.foregroundRole() != role:
        label.setForegroundRole(role)


def shortened_to_lines(text: str, font: QFont, width: float, lines: int) -> str:
    """Return the text that fits into `lines` lines of `width` pixels; a shortened text ends in …."""
    layout = QTextLayout(text, font)
    layout.beginLayout()
    starts = []
    while (line := layout.createLine()).isValid():
        line.setLineWidth(max(width, 1.0))
        starts.append(line.textStart())
    layout.endLayout()
    if len(starts) <= lines:
        return text
    last = starts[lines - 1]
    metrics = QFontMetricsF(font)
    return text[:last] + metrics.elidedText(text[last:], Qt.TextElideMode.ElideRight, width)
