"""The B-scan: heading by range as an image, measured, predicted and their difference.

Takes what is shown; hands on gestures.
"""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel

from gui.shown import Shown


class BScanView(QLabel):
    """Draws traces side by side."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor or None

    def __init__(self) -> None:
        super().__init__("B-scan")
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
