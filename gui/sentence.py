"""The sentence about the chosen reading, always in sight.

Takes what is shown; hands on nothing.
"""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from gui.shown import Shown


class Sentence(QLabel):
    """Says how the chosen reading came about."""

    def __init__(self) -> None:
        super().__init__()
        self.setWordWrap(True)
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.setContentsMargins(12, 6, 12, 6)
        font = self.font()
        font.setPointSizeF(font.pointSizeF() * 1.2)
        self.setFont(font)
        # room for two lines, so that the views do not jump when a long one comes
        self.setMinimumHeight(2 * self.fontMetrics().lineSpacing() + 12)

    def show_state(self, shown: Shown) -> None:
        """Say the sentence of the chosen reading."""
        if self.text() != shown.sentence:
            self.setText(shown.sentence)
