"""The docks: opened, brought to the front and closed with their keys."""

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from gui.main_window import MainWindow
from tests.gui.conftest import OpenWith


@pytest.fixture
def window(open_with: OpenWith) -> MainWindow:
    return open_with()


def in_front(window: MainWindow) -> list[str]:
    panels = {"Device": window.device, "Room": window.room, "Fit": window.fit_panel}
    return [name for name, panel in panels.items() if not panel.visibleRegion().isEmpty()]


def test_a_key_brings_its_dock_to_the_front_and_closes_it_only_there(qtbot: QtBot, window: MainWindow) -> None:
    assert in_front(window) == []
    for key, seen in (
        (Qt.Key.Key_F7, ["Device"]),
        (Qt.Key.Key_F8, ["Room"]),
        (Qt.Key.Key_F7, ["Device"]),  # it was open, behind Room
        (Qt.Key.Key_F7, ["Room"]),
        (Qt.Key.Key_F8, []),
    ):
        qtbot.keyClick(window, key)
        qtbot.wait(50)
        assert in_front(window) == seen
        assert [action.text() for action in window.docks.actions if action.isChecked()] == seen
