"""Let the mouse wheel scroll a panel instead of changing the field under the pointer, if the field has no focus."""

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QWidget


class _WheelFilter(QObject):
    """Leaves wheel events to the parent of its widget."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self._widget = widget

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Block wheel events of a widget without the focus."""
        if event.type() is not QEvent.Type.Wheel or self._widget.hasFocus():
            return False
        event.ignore()
        return True


def ignore_wheel_without_focus(widget: QWidget) -> None:
    """Let a slider, field or list react to the wheel only after a click or the Tab key."""
    widget.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    widget.installEventFilter(_WheelFilter(widget))
