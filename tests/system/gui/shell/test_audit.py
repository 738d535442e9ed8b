"""Small promises of the window: two clicks draw a wall, one dialog at a time, settings are kept at once, and others."""

from itertools import cycle
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QAction, QDragEnterEvent, QDropEvent, QStatusTipEvent
from PySide6.QtWidgets import QApplication, QDialog
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs import forecast
from sonarhw_gui.jobs.forecast import Forecast
from sonarhw_gui.model.look import DARK
from sonarhw_gui.session.kept import read_memory
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenFake, OpenWith
from tests.system.gui.driving import begin_drag, click, ended, pixel_at, predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    return window


def walls(window: MainWindow) -> int:
    return len(window.session.shown.scene.room.walls)


@pytest.mark.parametrize(("key", "posts"), [(Qt.Key.Key_W, 0), (Qt.Key.Key_P, 1)])
def test_two_clicks_draw_a_wall_or_a_post(qtbot: QtBot, window: MainWindow, key: Qt.Key, posts: int) -> None:
    plan, before = window.views.plan.drawing, walls(window)
    qtbot.keyClick(window, key)
    click(qtbot, plan, plan.plot.vb, (0.3, 0.6))
    until(qtbot, lambda: "click again" in window.views.plan.message.text())
    assert walls(window) == before
    click(qtbot, plan, plan.plot.vb, (0.3, 0.3))
    until(qtbot, lambda: plan.controller.tool.waiting is (posts == 0) and window.commands.undo.isEnabled())
    until(qtbot, lambda: len(window.session.shown.scene.room.posts) == posts)
    until(qtbot, lambda: walls(window) == before + 1 - posts)
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: walls(window) == before and not len(window.session.shown.scene.room.posts))


def test_clicked_walls_are_a_chain_until_a_second_click_on_its_end(qtbot: QtBot, window: MainWindow) -> None:
    plan, before = window.views.plan.drawing, walls(window)
    corners = (0.3, 0.6), (0.3, 0.3), (0.5, 0.3)
    qtbot.keyClick(window, Qt.Key.Key_W)
    for count, at in enumerate(corners):
        click(qtbot, plan, plan.plot.vb, at)
        until(qtbot, lambda count=count: plan.controller.tool.waiting and walls(window) == before + count)
    first, second = window.session.shown.scene.room.walls[-2:]
    assert tuple(first[2:]) == tuple(second[:2])
    click(qtbot, plan, plan.plot.vb, corners[-1])
    until(qtbot, lambda: not plan.controller.tool.waiting)
    assert walls(window) == before + 2
    for left in (1, 0):  # each wall is an undo step
        qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
        until(qtbot, lambda left=left: walls(window) == before + left)


def test_hints_of_commands_do_not_cover_the_status_of_a_scan(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(source=fake("max"))
    bar = window.status_bar
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and "recorded in" in bar.activity.text())
    QApplication.sendEvent(window, QStatusTipEvent(window.commands.scan.statusTip()))
    assert not bar.currentMessage()
    assert bar.activity.isVisible()


def test_esc_after_the_first_click_draws_nothing(qtbot: QtBot, window: MainWindow) -> None:
    plan, before = window.views.plan.drawing, walls(window)
    qtbot.keyClick(window, Qt.Key.Key_W)
    click(qtbot, plan, plan.plot.vb, (0.3, 0.6))
    until(qtbot, lambda: plan.controller.tool.waiting)
    # a first motion may arrive before the click is handled, so it goes on
    ways = cycle([(0.4, 0.3), (0.42, 0.3)])

    def previewed() -> bool:
        qtbot.mouseMove(plan.viewport(), pixel_at(plan, plan.plot.vb, next(ways)))
        return walls(window) == before + 1

    until(qtbot, previewed)
    plan.setFocus()
    qtbot.keyClick(plan, Qt.Key.Key_Escape)
    until(qtbot, lambda: walls(window) == before)
    assert not plan.controller.tool.waiting
    assert not window.commands.undo.isEnabled()


def test_one_dialog_is_open_at_a_time(qtbot: QtBot, window: MainWindow) -> None:
    opening = [action for action in window.findChildren(QAction) if action.text().endswith("…") and action.isEnabled()]
    opening = [action for action in opening if not action.text().startswith("Film")]  # needs a computed heading
    assert len(opening) > 10
    for action in (*opening, window.commands.show_help):
        action.trigger()
        until(qtbot, lambda: len(_dialogs(window)) == 1)
    _dialogs(window)[0].close()


def test_settings_are_stored_when_they_change(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    memory = tmp_path / "window.ini"
    window = open_with(memory=memory)
    until(qtbot, memory.exists)
    window.commands.switch_palette.trigger()
    until(qtbot, lambda: read_memory(memory).look.palette is DARK)
    assert window.isVisible()


def test_dropped_files_are_copied_not_moved(open_with: OpenWith) -> None:
    window = open_with()
    files = QMimeData()
    files.setUrls([QUrl.fromLocalFile(str(ROOM))])
    both, none = Qt.DropAction.CopyAction | Qt.DropAction.MoveAction, Qt.KeyboardModifier.NoModifier
    entered = QDragEnterEvent(window.rect().center(), both, files, Qt.MouseButton.LeftButton, none)
    dropped = QDropEvent(QPointF(window.rect().center()), both, files, Qt.MouseButton.LeftButton, none)
    for event in (entered, dropped):
        event.setDropAction(Qt.DropAction.MoveAction)
        QApplication.sendEvent(window, event)
        assert event.isAccepted()
        assert event.dropAction() is Qt.DropAction.CopyAction


def test_after_a_scan_a_turn_and_disconnect_the_status_is_not_connected(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake
) -> None:
    window = open_with(source=fake("max"))
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and len(window.session.shown.readings) > 0)
    window.session.live.turn(1.0)
    until(qtbot, lambda: "connected" in window.status_bar.activity.text())
    window.session.live.disconnect()
    until(qtbot, lambda: "connected" not in window.status_bar.activity.text())


def test_during_a_drag_the_sentence_says_that_it_is_a_draft(
    qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = window.views.plan.drawing
    sensor = window.session.shown.scene.pose.position
    monkeypatch.setattr(forecast, "_SHORT", 0.0)  # s; else a draft of a fast computer can have all bounces
    with monkeypatch.context() as moving:  # else all paths can be found before the sentence is read
        moving.setattr(Forecast, "_search_when_due", lambda _: None)
        end = begin_drag(qtbot, plan, plan.plot.vb, sensor, (sensor[0] - 0.1, sensor[1] + 0.1))
        until(qtbot, lambda: window.sentence.text().startswith("draft"))
    qtbot.mouseRelease(plan.viewport(), Qt.MouseButton.LeftButton, pos=end)
    until(qtbot, lambda: predicted(window))
    until(qtbot, lambda: not window.sentence.text().startswith("draft"))


def test_the_legend_explains_sensor_turntable_ring_and_pointer(window: MainWindow) -> None:
    visible = {name for name, entry in window.legend.explained.items() if entry.isVisible() and entry.toolTip()}
    assert visible == {
        "wall",
        "sensor",
        "turntable zero",
        "newest",
        "selected",
        "pointer",
    }  # a note only if there is one


def _dialogs(window: MainWindow) -> list[QDialog]:
    return [dialog for dialog in window.findChildren(QDialog) if dialog.isVisible()]
