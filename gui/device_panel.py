"""The device panel: what to scan, and how the scanner is.

Takes what is shown; hands on gestures.
"""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel

from gui.shown import Shown


class DevicePanel(QLabel):
    """What the scanner does."""

    def __init__(self) -> None:
        super().__init__("device")
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
