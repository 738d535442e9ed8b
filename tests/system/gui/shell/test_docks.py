"""The docks: opened, brought to the front and closed with their keys."""

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QDockWidget,
    QScrollArea,
    QScrollBar,
    QTabBar,
    QWidget,
)
from pytestqt.qtbot import QtBot
from sonarhw_gui.window.window import MainWindow

from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import until


@pytest.fixture
def window(open_with: OpenWith) -> MainWindow:
    return open_with()


def in_front(window: MainWindow) -> list[str]:
    panels = {"Device": window.device, "Room": window.room, "Fit": window.fit_panel}
    return [name for name, panel in panels.items() if not panel.visibleRegion().isEmpty()]


def test_a_key_brings_its_dock_to_the_front_or_closes_it_there(qtbot: QtBot, window: MainWindow) -> None:
    assert in_front(window) == []
    for key, seen in (
        (Qt.Key.Key_F7, ["Device"]),
        (Qt.Key.Key_F8, ["Room"]),
        (Qt.Key.Key_F7, ["Device"]),  # it was open, behind the Room dock
        (Qt.Key.Key_F7, ["Room"]),
        (Qt.Key.Key_F8, []),
    ):
        qtbot.keyClick(window, key)
        until(qtbot, lambda seen=seen: in_front(window) == seen)
        assert [action.text() for action in window.dock_openers if action.isChecked()] == seen


def turn_wheel(over: QWidget) -> None:
    """Turn the wheel by one step towards the user, as an event of the window system."""
    window = over.window()
    QTest.wheelEvent(window.windowHandle(), over.mapTo(window, over.rect().center()).toPointF(), QPoint(0, -120))


def wheeled(panel: QWidget) -> list[QWidget]:
    """Return the widgets whose value the wheel could change."""
    kinds = (QAbstractSlider, QAbstractSpinBox, QComboBox)
    found = [one for one in panel.findChildren(QWidget) if isinstance(one, kinds)]
    return [one for one in found if not isinstance(one, QScrollBar) and one.window() is panel.window()]


def test_the_wheel_scrolls_a_panel_and_changes_only_the_focused_widget(qtbot: QtBot, window: MainWindow) -> None:
    window.resize(1000, 600)
    qtbot.keyClick(window, Qt.Key.Key_F8)
    room = window.room
    area = next(area for area in window.findChildren(QScrollArea) if area.widget() is room)
    bar = area.verticalScrollBar()
    until(qtbot, lambda: bar.maximum() > 0)
    before, parts = window.session.shown.scene, wheeled(room)
    assert len(parts) >= 15
    for part in parts:
        bar.setValue(0)
        area.ensureWidgetVisible(part)
        at = bar.value()
        turn_wheel(part)
        assert window.session.shown.scene is before, part
        assert bar.value() > at or at == bar.maximum(), part
    for part in (*wheeled(window.device), *wheeled(window.fit_panel)):
        assert part.focusPolicy() is Qt.FocusPolicy.StrongFocus, part
    humidity = room.air.humidity.slider
    area.ensureWidgetVisible(humidity)
    humidity.setFocus()
    turn_wheel(humidity)
    assert window.session.shown.scene is not before


def test_the_tabs_of_all_panels_fit_in_the_least_width_of_a_panel(qtbot: QtBot, window: MainWindow) -> None:
    for action in window.dock_openers:
        action.trigger()
        until(qtbot, action.isChecked)
    docks = [dock for dock in window.findChildren(QDockWidget) if window.tabifiedDockWidgets(dock)]
    window.resizeDocks(docks[:1], [1], Qt.Orientation.Horizontal)
    least = max(dock.minimumSizeHint().width() for dock in docks)
    until(qtbot, lambda: window.finding.width() <= least)
    (bar,) = (bar for bar in window.findChildren(QTabBar) if bar.isVisible() and bar.count() == len(docks) == 6)
    assert bar.tabRect(5).right() - bar.tabRect(0).left() <= window.finding.width()
