"""The help page: every command of the menus with its key, on one screen of 1280 × 800, open and closed with F1."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from gui.main_window import MainWindow
from tests.gui.conftest import OpenWith


def told(window: MainWindow) -> str:
    return "".join(label.text() for label in window.help.page.findChildren(QLabel))


def test_f1_shows_every_key_on_one_screen_and_puts_it_away(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    qtbot.keyClick(window, Qt.Key.Key_F1)
    page = window.help.page
    assert page.isVisible()
    assert (page.width(), page.height()) <= (1280, 800)
    for action in window.commands.all:
        assert f"<b>{action.shortcut().toString()}" in told(window), action.text()
    page.close()
    assert window.help.page is None or not window.help.page.isVisible()


def test_no_key_means_two_things(open_with: OpenWith) -> None:
    window = open_with()
    keys = [key.toString() for action in window.findChildren(type(window.commands.help)) for key in action.shortcuts()]
    assert sorted(keys) == sorted(set(keys))
