"""The docks: panels at the side of the window, each of which can be closed, moved and opened again.

Takes the window and its panels; hands on the docks.
"""

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QDockWidget, QMainWindow, QScrollArea, QWidget


class _Upright(QScrollArea):
    """Scrolls up and down; never narrower than what is in it."""

    def __init__(self, panel: QWidget) -> None:
        super().__init__()
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setWidget(panel)

    def minimumSizeHint(self) -> QSize:
        """Room for the panel and the scroll bar beside it."""
        panel = self.widget()
        width = max(panel.minimumSizeHint().width(), panel.minimumWidth())
        return QSize(width + self.verticalScrollBar().sizeHint().width(), super().minimumSizeHint().height())


class Docks:
    """The docks of one window, closed at first, behind one another."""

    def __init__(self, window: QMainWindow) -> None:
        self._window = window
        self._docks: list[QDockWidget] = []

    def add(self, name: str, key: str, panel: QWidget) -> QDockWidget:
        """A dock for `panel`; `key` opens and closes it."""
        dock = QDockWidget(name, self._window)
        dock.setObjectName(name)  # by which the layout is remembered
        dock.setWidget(_Upright(panel))
        dock.toggleViewAction().setShortcut(QKeySequence(key))
        dock.toggleViewAction().setToolTip(f"Open or close this panel ({key})")
        self._window.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, dock)
        if self._docks:
            self._window.tabifyDockWidget(self._docks[-1], dock)
        dock.hide()
        self._docks.append(dock)
        return dock

    def show(self, name: str) -> None:
        """Open a dock, in front of the others."""
        dock = next(dock for dock in self._docks if dock.objectName() == name)
        dock.show()
        dock.raise_()

    @property
    def actions(self) -> list[QAction]:
        """What opens and closes them."""
        return [dock.toggleViewAction() for dock in self._docks]
