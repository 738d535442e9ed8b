"""A window whose docks can be tabs, with their whole names."""

from PySide6.QtCore import QChildEvent, Qt
from PySide6.QtWidgets import QMainWindow, QTabBar


class TabbedWindow(QMainWindow):
    """A main window that does not shorten the names of tabs. Tabs that do not fit scroll."""

    def childEvent(self, event: QChildEvent) -> None:
        """Set a new tab bar up; Qt makes them itself and would shorten a name to a letter."""
        super().childEvent(event)
        bar = event.child()
        if event.polished() and isinstance(bar, QTabBar):
            bar.setElideMode(Qt.TextElideMode.ElideNone)
            bar.setUsesScrollButtons(True)
