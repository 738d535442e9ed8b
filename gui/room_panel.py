"""The room panel: materials, air, receiver.

Takes what is shown; hands on gestures.
"""

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QLabel

from gui.shown import Shown


class RoomPanel(QLabel):
    """What the room is made of."""

    edited = Signal(object, str, object)  # Scene, what was done, gesture

    def __init__(self) -> None:
        super().__init__("room")
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
