"""The help page: every command of the menus with its key, on a screen of 1280 × 800, opened and closed with F1."""

from pathlib import Path

import pytest
from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind
from sonarhw_gui.model.look import Look
from sonarhw_gui.window.dialogs import HelpPage
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.checkout import CHECKOUT
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import PATIENCE, dialog_of, until


def page_text(window: MainWindow) -> str:
    return "".join(label.text() for label in dialog_of(window).findChildren(QLabel))


def test_f1_shows_every_key_on_one_screen(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    qtbot.keyClick(window, Qt.Key.Key_F1)
    page = dialog_of(window)
    assert page.isVisible()
    assert (page.width(), page.height()) <= (1280, 800)
    for action in [*window.commands.actions.values()]:
        assert f"<b>{action.shortcut().toString()}" in page_text(window), action.text()
    page.close()
    assert dialog_of(window) is None


def test_esc_closes_the_page_first_and_then_follows_the_newest_reading(
    qtbot: QtBot, open_with: OpenWith, recorded: Path
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: window.session.shown.chosen is not None)
    window.session.showing.choose(3)
    qtbot.keyClick(window, Qt.Key.Key_F1)
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert dialog_of(window) is None
    assert window.session.shown.chosen == 3
    until(qtbot, lambda: dialog_of(window) is None)
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert window.session.shown.chosen != 3


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_the_last_key_is_visible_or_can_be_scrolled_to(qtbot: QtBot, open_with: OpenWith, scale: float) -> None:
    window = open_with()
    window.session.showing.set_look(Look(scale=scale))
    every = [*window.commands.actions.values()]
    groups = {f"Group {k}": every[k : k + 8] for k in range(0, len(every), 8)}
    page = HelpPage(groups, Look(scale=scale), None, QSize(1280, 760))
    with qtbot.waitExposed(page, timeout=PATIENCE):
        page.show()
    assert page.width() <= 1280
    assert page.height() <= 760
    assert page.area.horizontalScrollBar().maximum() == 0
    assert scale > 1 or page.area.verticalScrollBar().maximum() == 0
    page.area.verticalScrollBar().setValue(page.area.verticalScrollBar().maximum())
    for label in page.findChildren(QLabel):
        assert label.height() >= label.heightForWidth(label.width())
        end = label.mapTo(page.area.viewport(), label.rect().bottomLeft())
        assert page.area.viewport().rect().contains(end) or "<table>" not in label.text()
    page.close()


def test_every_key_has_one_meaning(open_with: OpenWith) -> None:
    window = open_with()
    keys = [
        key.toString() for action in window.findChildren(type(window.commands.show_help)) for key in action.shortcuts()
    ]
    assert sorted(keys) == sorted(set(keys))


def test_f1_explains_each_class_of_readings_in_the_words_of_the_docs(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    qtbot.keyClick(window, Qt.Key.Key_F1)
    text, page = page_text(window), (CHECKOUT / "docs" / "comparing" / "compare.md").read_text(encoding="utf-8")
    rows = [line.strip("|").split(" | ") for line in page.splitlines() if line.count(" | ") == 2]
    explained = {kind.strip(): (meaning, hint.strip()) for kind, meaning, hint in rows if kind.strip() != "class"}
    assert explained.keys() == {kind.label for kind in Kind} - {"both silent"}
    for kind, (meaning, hint) in explained.items():
        assert f"<b>{kind}</b>: {meaning}" in text
        assert f"{hint}." in text
