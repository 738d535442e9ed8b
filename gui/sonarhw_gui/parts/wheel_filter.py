"""The wheel over a panel scrolls the panel: what lies under the pointer is changed only where it has the focus.

Takes a slider, a field or a list.
"""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QWidget


class _Passing(QObject):
    """Passes the wheel on to what holds its widget."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self._widget = widget

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Take a wheel away from a widget without the focus."""
        if event.type() is not QEvent.Type.Wheel or self._widget.hasFocus():
            return False
        event.ignore()
        return True


def ignore_wheel_without_focus(widget: QWidget) -> None:
    """Let a widget have the wheel only after a click or the tab key."""
    widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_Passing(widget))
