"""A container for a label whose text changes often. A new text does not trigger a new layout of the window.

Only a change of the label's height does, as with a larger text size.
"""

from PySide6.QtCore import QEvent, QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QLabel, QWidget


class LabelSlot(QWidget):
    """Takes its height from its label and its width from the layout."""

    def __init__(self, label: QLabel) -> None:
        super().__init__()
        label.setParent(self)
        self._label = label
        self._height = self._needed_height()

    def sizeHint(self) -> QSize:
        """Return the minimum size of the label."""
        return QSize(self._label.minimumWidth(), self._needed_height())

    minimumSizeHint = sizeHint

    def event(self, event: QEvent) -> bool:
        """Pass a layout request of the label to the parent only if its height has changed."""
        if event.type() is QEvent.Type.LayoutRequest and self._height != (needed := self._needed_height()):
            self._height = needed
            self.updateGeometry()
        return super().event(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give the label the whole area."""
        self._label.setGeometry(self.rect())

    def _needed_height(self) -> int:
        least = self._label.minimumHeight()
        if least == self._label.maximumHeight():
            return least  # the size hint of a wrapped text lays it out for another width, which paints it twice
        return max(least, self._label.minimumSizeHint().height())
