"""Room for a label whose text changes all the time: another text does not lay out the whole window anew.

Takes a label; hands on a widget that holds it. Only a line that gets higher, as with larger text, asks for more room.
"""

from PySide6.QtCore import QEvent, QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QLabel, QWidget


class LabelSlot(QWidget):
    """As high as its label wants to be, and as wide as it is given."""

    def __init__(self, label: QLabel) -> None:
        super().__init__()
        label.setParent(self)
        self._label = label
        self._height = self._wanted()

    def sizeHint(self) -> QSize:
        """What the label needs at least."""
        return QSize(self._label.minimumWidth(), self._wanted())

    minimumSizeHint = sizeHint

    def event(self, event: QEvent) -> bool:
        """Take the label's wish for another size, and pass it on where it is one for another height."""
        if event.type() is QEvent.Type.LayoutRequest and self._height != self._wanted():
            self._height = self._wanted()
            self.updateGeometry()
        return super().event(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the label all the room there is."""
        self._label.setGeometry(self.rect())

    def _wanted(self) -> int:
        return max(self._label.minimumHeight(), self._label.minimumSizeHint().height())
