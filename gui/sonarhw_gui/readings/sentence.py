"""The sentence about the chosen reading, always in sight and never cut: what does not fit is in the tooltip.

Takes what is shown; hands on nothing.
"""

from math import ceil

from PySide6.QtCore import Qt
from PySide6.QtGui import QFont, QFontMetricsF, QPalette, QResizeEvent, QTextLayout
from PySide6.QtWidgets import QLabel

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.shown.shown import Shown

_LINES = 2  # room for so many, so that the views do not jump when a long one comes
_MARGIN, _ABOVE = 12, 6
_SIZE = 1.2  # of usual text


class Sentence(QLabel):
    """Says how the chosen reading came about."""

    def __init__(self) -> None:
        super().__init__()
        self._whole = ""
        self._look: Look | None = None
        self.setWordWrap(True)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setContentsMargins(_MARGIN, _ABOVE, _MARGIN, _ABOVE)
        self.setMinimumWidth(1)

    def show_state(self, shown: Shown) -> None:
        """Say the sentence of the chosen reading; faintly while it is that of the prediction before."""
        self.setForegroundRole(QPalette.ColorRole.PlaceholderText if shown.outdated else QPalette.ColorRole.WindowText)
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
        self.setToolTip(self._whole if fitting != self._whole else "")


def shortened_to_lines(text: str, font: QFont, width: float, lines: int) -> str:
    """The text as far as it goes into so many lines of `width` pixels, ended by … where that is not all of it."""
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
