"""The start of a window: it is painted first, then predictions begin, so that kernels do not delay the first paint."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shell.application import WindowStart, open_application, open_window
from sonarhw_gui.shell.main_window import MainWindow

from tests.system.gui.driving import predicted, until


@pytest.fixture
def window(qtbot: QtBot, scene: Scene, tmp_path: Path) -> MainWindow:
    """A window that is not shown yet."""
    open_application()
    window = open_window(WindowStart(scene, recordings=tmp_path))
    qtbot.addWidget(window)
    return window


def test_a_window_predicts_nothing_before_it_is_shown(qtbot: QtBot, window: MainWindow) -> None:
    assert not window.session.showing.forecast.searching
    window.show()
    until(qtbot, lambda: predicted(window))


def test_a_window_that_is_never_painted_predicts_too(qtbot: QtBot, window: MainWindow) -> None:
    """As a window on another desktop."""
    window.setAttribute(Qt.WidgetAttribute.WA_DontShowOnScreen)
    window.show()
    until(qtbot, lambda: predicted(window))


def test_a_window_that_was_closed_before_its_paint_begins_nothing(window: MainWindow) -> None:
    window.close()
    window.session.begin()
    assert not window.session.showing.forecast.searching
