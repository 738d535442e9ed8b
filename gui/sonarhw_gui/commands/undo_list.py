"""The menu of undo steps: every edit that can be undone, newest first. A click undoes it and all later ones."""

from PySide6.QtCore import Slot
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from sonarhw_gui.session.shown_model import ShownModel

_MOST = 30  # steps; a longer menu would not fit a screen


class UndoList(QMenu):
    """Lists the steps when it opens."""

    def __init__(self, showing: ShownModel, parent: QWidget) -> None:
        super().__init__("Undo steps", parent)
        self._showing = showing
        self.aboutToShow.connect(self.show_steps)
        self.triggered.connect(self._undo)
        self.show_steps()

    @Slot()
    def show_steps(self) -> None:
        """List the edits that can be undone."""
        self.clear()
        steps = self._showing.history.steps[:_MOST]
        for number, label in enumerate(steps, start=1):
            self.addAction(label.replace("&", "&&")).setData(number)
        if not steps:
            self.addAction("nothing to undo").setEnabled(False)

    @Slot(QAction)
    def _undo(self, action: QAction) -> None:
        self._showing.undo_steps(action.data())
