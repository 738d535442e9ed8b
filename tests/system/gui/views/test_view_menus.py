"""Every view has a context menu of the window, none of pyqtgraph, and resets its range; images keep their size."""

from pathlib import Path

import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint, QRectF, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QApplication, QMenu, QWidget
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

VIEWS = "Plan", "Side by side", "B-scan", "Trace", "Ranges", "Readings"


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    return window


def shown_view(qtbot: QtBot, window: MainWindow, name: str) -> QWidget:
    for action in window.commands.views:
        if action.text() == name:
            action.trigger()
    view = next(view for view in window.views.all if view.entry.name == name)
    until(qtbot, view.isVisible)
    return view


def surface(view: QWidget) -> QWidget:
    """Return the widget below the mouse in a view."""
    canvas = view if isinstance(view, pg.GraphicsView) else view.findChild(pg.GraphicsView)
    return canvas.viewport() if canvas is not None else view.view.viewport()


def ask_for_menu(window: MainWindow, below: QWidget) -> QMenu:
    at = below.rect().center()
    QApplication.sendEvent(below, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, below.mapToGlobal(at)))
    return QApplication.activePopupWidget()


def test_a_right_click_opens_the_menu_of_the_window_and_no_other(qtbot: QtBot, window: MainWindow) -> None:
    for name in VIEWS:
        view = shown_view(qtbot, window, name)
        below = surface(view)
        qtbot.mouseClick(below, Qt.MouseButton.RightButton, pos=below.rect().center() - QPoint(20, 20))
        assert not [menu for menu in QApplication.topLevelWidgets() if isinstance(menu, QMenu) and menu.isVisible()]
        menu = ask_for_menu(window, below)
        texts = [action.text() for action in menu.actions()]
        assert "Fit this view" in texts, name
        assert {action.text() for action in view.actions()} <= set(texts), name
        assert any("Picture" in text for text in texts) is (name != "Readings")
        assert "Export..." not in texts, name
        menu.close()


def test_no_plot_has_a_menu_of_pyqtgraph(qtbot: QtBot, window: MainWindow) -> None:
    for name in VIEWS[:3]:
        shown_view(qtbot, window, name)
    found = 0
    for view in window.findChildren(pg.GraphicsView):
        for item in view.scene().items():
            if isinstance(item, pg.PlotItem | pg.ViewBox):
                found += 1
                assert not item.menuEnabled()
    assert found >= 8


def test_the_menu_resets_only_its_own_view(qtbot: QtBot, window: MainWindow) -> None:
    ranges, plan = window.views.ranges, window.views.plan.drawing.plot.vb
    usual = ranges.ranges.vb.viewRange()
    ranges.ranges.vb.setRange(xRange=(100, 200), yRange=(0.1, 0.2), padding=0)
    plan.setRange(QRectF(0, 0, 0.1, 0.1), padding=0)
    zoomed = plan.viewRect()
    menu = ask_for_menu(window, surface(ranges))
    next(action for action in menu.actions() if action.text() == "Fit this view").trigger()
    menu.close()
    assert ranges.ranges.vb.viewRange()[0] == pytest.approx(usual[0])
    assert ranges.ranges.vb.viewRange()[1] == pytest.approx(usual[1])
    assert plan.viewRect() == zoomed


def test_hidden_layers_are_shown_again_from_the_menu(qtbot: QtBot, window: MainWindow) -> None:
    window.session.showing.switch(Kind.MATCH, False)
    menu = ask_for_menu(window, surface(window.views.plan))
    next(action for action in menu.actions() if action.text() == "Show all layers").trigger()
    menu.close()
    assert not window.session.shown.hidden


def test_zooming_out_never_leaves_readable_headings(window: MainWindow) -> None:
    box = window.views.ranges.ranges.vb
    for _ in range(200):
        box.scaleBy((1.5, 1.5))
    (left, right), (low, high) = box.viewRange()
    assert left >= -20
    assert right <= 380
    assert high - low <= 1e5


def test_a_polar_image_keeps_its_size_when_panes_change(qtbot: QtBot, window: MainWindow) -> None:
    view = shown_view(qtbot, window, "B-scan")
    until(qtbot, lambda: window.session.shown.bscan is not None and not view.note.text().startswith("computing"))
    view.polar.trigger()
    until(qtbot, lambda: window.session.shown.bscan.settings == view.settings)
    recorded, *_, three = view.choices.actions()
    box = view.panes[view.settings.panes[0]].plot.vb

    def across() -> float:
        QApplication.processEvents()
        return box.viewRect().width()

    before = across()
    for _ in range(3):
        for choice in (three, recorded):
            choice.trigger()
            until(qtbot, lambda: window.session.shown.bscan.settings == view.settings)
            across()
    assert across() == pytest.approx(before, rel=0.01)
