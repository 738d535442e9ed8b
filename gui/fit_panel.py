"""The fit panel: find where the scanner stood.

Takes what is shown; hands on gestures.
"""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel

from gui.shown import Shown


class FitPanel(QLabel):
    """Asks for a fit and shows what came out."""

    edited = Signal(object, str, object)  # Scene, what was done, gesture

    def __init__(self) -> None:
        super().__init__("fit")
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
