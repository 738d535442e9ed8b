"""A window whose docks can be tabs, with their whole names."""

from PySide6.QtCore import QChildEvent, Qt
from PySide6.QtWidgets import QMainWindow, QProxyStyle, QStyle, QStyleOption, QTabBar, QWidget

_SPACE = 9  # pixels, of a tab beside its name; that of Qt is 24


class _NarrowTabs(QProxyStyle):
    """Less space beside the names of tabs, so that those of all panels fit in the width of a panel."""

    def pixelMetric(
        self, metric: QStyle.PixelMetric, option: QStyleOption | None = None, widget: QWidget | None = None
    ) -> int:
        """Return a length of the style in pixels."""
        if metric == QStyle.PixelMetric.PM_TabBarTabHSpace:
            return _SPACE
        return super().pixelMetric(metric, option, widget)


class TabbedWindow(QMainWindow):
    """A main window that does not shorten the names of tabs. Tabs that do not fit scroll."""

    def __init__(self) -> None:
        super().__init__()
        self._tab_style = _NarrowTabs()  # a tab bar does not keep its style alive
        self._tab_style.setParent(self)

    def childEvent(self, event: QChildEvent) -> None:
        """Set a new tab bar up; Qt makes them itself and would shorten a name to a letter."""
        super().childEvent(event)
        bar = event.child()
        if event.polished() and isinstance(bar, QTabBar):
            bar.setStyle(self._tab_style)
            bar.setElideMode(Qt.TextElideMode.ElideNone)
            bar.setUsesScrollButtons(True)
