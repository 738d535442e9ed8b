"""Properties common to all views: each implements the protocol and resets its range."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.views.base import View
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    return window


def test_every_view_implements_the_protocol(window: MainWindow) -> None:
    assert len(window.views.all) == 8
    for view in window.views.all:
        assert isinstance(view, View), type(view)


def test_f_resets_the_axes_of_ranges_and_residuals(qtbot: QtBot, window: MainWindow) -> None:
    view = window.views.ranges
    plots = view.ranges.vb, view.residuals.vb
    usual = [box.viewRange() for box in plots]
    assert usual[0][0] == pytest.approx([0, 360], abs=10)
    for box in plots:
        box.setRange(xRange=(100, 200), yRange=(0.1, 0.2), padding=0)
    assert plots[0].viewRange()[0] == pytest.approx([100, 200])
    qtbot.keyClick(window, Qt.Key.Key_F)
    for box, (x_range, y_range) in zip(plots, usual, strict=True):
        assert box.viewRange()[0] == pytest.approx(x_range)
        assert box.viewRange()[1] == pytest.approx(y_range)


def test_menus_list_the_commands_of_views(window: MainWindow) -> None:
    entries = window.menuBar().actions()  # keeps references, or Qt deletes the menus
    menus = {entry.text().replace("&", ""): entry.menu() for entry in entries}
    for view in window.views.all:
        if view.entry.menu:
            assert set(view.actions()) <= set(menus[view.entry.menu].actions())
    shown = [action.text() for action in menus["View"].actions()]
    assert shown[:4] == ["Plan", "Side by side", "B-scan", "Zoom to all"]
    kept = [action.text() for action in menus["File"].actions() if action.text().startswith("Picture")]
    assert kept == [f"Picture of the {name}…" for name in ("large view", "trace", "ranges", "window")]
    assert [*menus] == ["File", "Scan", "Edit", "Plan", "Trace", "Analyse", "Replay", "View", "Help"]
