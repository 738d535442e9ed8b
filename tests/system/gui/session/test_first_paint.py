"""The start of a window: it is painted first, then predictions begin, so that kernels do not delay the first paint."""

import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.start import WindowStart, open_application, open_window
from sonarhw_gui.window.window import MainWindow

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


@pytest.mark.parametrize("command", ["demo", "gui simple", "gui {log}"])
def test_no_slow_package_is_imported_before_the_first_paint(command: str, recorded: Path) -> None:
    """Later, a thread imports the compiler of kernels; it takes longer than all of PySide6."""
    program = """
import os, sys
from sonarhw_gui.session.session import WindowSession

def end(session):
    print(sorted({"numba", "llvmlite", "scipy", "matplotlib"} & set(sys.modules)), flush=True)
    os._exit(0)

WindowSession.begin = end  # called after the first paint
from sonarhw_cli.entry import main
main()
"""
    words = command.format(log=recorded).split()
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
