"""The docks: panels at the side of the window that the user can open, close and move."""

from typing import Protocol, cast

from PySide6.QtCore import QSize, Qt, Slot
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QDockWidget, QLayout, QMainWindow, QScrollArea, QWidget

from sonarhw_gui.shown.shown import Shown

_LEAST_WIDTH = 290  # pixels


class Panel(Protocol):
    """A widget that shows a part of a `Shown`."""

    def show_state(self, shown: Shown) -> None:
        """Show the changes since the last call."""

    def isVisibleTo(self, ancestor: QWidget) -> bool:
        """Return whether it is visible when `ancestor` is. Implemented by QWidget."""


class _VerticalScrollArea(QScrollArea):
    """Scrolls vertically; never narrower than its content."""

    def __init__(self, panel: QWidget) -> None:
        super().__init__()
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        panel.setMinimumWidth(_LEAST_WIDTH)
        self.setWidget(panel)
        self._panel = panel

    def minimumSizeHint(self) -> QSize:
        """Return the width of the panel and the scroll bar."""
        width = max(self._panel.minimumSizeHint().width(), self._panel.minimumWidth())
        return QSize(width + self.verticalScrollBar().sizeHint().width(), super().minimumSizeHint().height())


class _Dock(QDockWidget):
    """A dock with a panel, and an action that opens it, brings it to the front, or closes it."""

    def __init__(self, name: str, key: str, about: str, panel: Panel, window: QMainWindow) -> None:
        super().__init__(name, window)
        self._panel, self._main_window = panel, window
        self._shown: Shown | None = None
        self.setWidget(_VerticalScrollArea(cast(QWidget, panel)))
        self.setObjectName(name)  # key of the stored layout
        self.opener = QAction(name, self, checkable=True, shortcut=QKeySequence(key))  # checked: it is in front
        self.opener.setToolTip(f"{about} ({key})")
        self.opener.triggered.connect(self._open_or_close)
        self.visibilityChanged.connect(self.opener.setChecked)

    def show_state(self, shown: Shown) -> None:
        """Update the panel if it is visible."""
        self._shown = shown
        if self._panel.isVisibleTo(self._main_window):
            self._panel.show_state(shown)

    def bring_to_front(self) -> None:
        """Open it in front of the others."""
        if self._shown is not None:
            self._panel.show_state(self._shown)
            for layout in reversed(self.findChildren(QLayout)):  # inner ones first
                layout.activate()  # else the first paint has the height from before
        self.show()
        self.raise_()

    @Slot(bool)
    def _open_or_close(self, wanted: bool) -> None:
        if wanted:
            self.bring_to_front()
        else:
            self.close()


class Docks:
    """The docks of one window, as tabs. All are closed initially."""

    def __init__(self, window: QMainWindow) -> None:
        self._window = window
        self._docks: list[_Dock] = []

    def add(self, name: str, key: str, about: str, panel: Panel) -> QDockWidget:
        """Return a new dock with `panel`; `key` opens and closes it, and `about` says what it is for."""
        dock = _Dock(name, key, about, panel, self._window)
        self._window.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, dock)
        if self._docks:
            self._window.tabifyDockWidget(self._docks[-1], dock)
        dock.hide()
        self._docks.append(dock)
        return dock

    def show(self, name: str) -> None:
        """Open a dock in front of the others."""
        next(dock for dock in self._docks if dock.objectName() == name).bring_to_front()

    def show_state(self, shown: Shown) -> None:
        """Update the visible panels."""
        for dock in self._docks:
            dock.show_state(shown)

    @property
    def actions(self) -> list[QAction]:
        """The actions that open and close the docks."""
        return [dock.opener for dock in self._docks]
