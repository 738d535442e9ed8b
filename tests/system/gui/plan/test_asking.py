"""Questions about headings without a scan: by mouse and keys; the list of echoes draws the path pointed at."""

import math
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import click, drag, predicted, until

SENSOR = 0.774, 0.085
FALSE_WALL = 0.774, 0.085 - 0.827  # below the room, where heading 270° reads


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith) -> MainWindow:
    window = open_with()
    until(qtbot, lambda: predicted(window))
    return window


def click_plan(qtbot: QtBot, window: MainWindow, at: tuple[float, float]) -> None:
    click(qtbot, window.views.plan.drawing, window.views.plan.drawing.plot.vb, at)


def answered(window: MainWindow, degrees: float) -> bool:
    shown = window.session.shown
    return shown.answer is not None and math.degrees(shown.answer.headings[0]) == pytest.approx(degrees, abs=1e-6)


def open_list(qtbot: QtBot, window: MainWindow) -> None:
    window.views.docks[3].opener.trigger()
    until(qtbot, lambda: window.views.echo_list.list is not None)


def test_a_click_on_the_outline_explains_its_heading(qtbot: QtBot, window: MainWindow) -> None:
    for _ in range(4):
        qtbot.keyClick(window, Qt.Key.Key_Minus)  # zoom out: the false wall is outside the room
    qtbot.wait(50)
    click_plan(qtbot, window, FALSE_WALL)
    until(qtbot, lambda: window.session.shown.answer is not None)
    shown = window.session.shown
    assert math.degrees(shown.asked) == pytest.approx(270, abs=1)
    assert window.sentence.text().startswith("0.827 m predicted at 2")
    assert (
        "three reflections, bottom, top, bottom; the near wall (0.085 m) lies within blanking" in window.sentence.text()
    )
    assert shown.scene.pose.heading == 0  # the turntable stays
    assert shown.trace.predicted is not None
    assert shown.trace.measured is None
    assert window.views.trace.title.text().endswith("predicted only")


def test_keys_turn_the_question_by_one_degree(qtbot: QtBot, window: MainWindow) -> None:
    for key, degrees in ((Qt.Key.Key_BracketLeft, 1), (Qt.Key.Key_BracketLeft, 2), (Qt.Key.Key_BracketRight, 1)):
        qtbot.keyClick(window, key)
        until(qtbot, lambda degrees=degrees: answered(window, degrees))
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    until(qtbot, lambda: window.session.shown.asked is None)
    assert window.session.shown.answer is None


def test_the_tool_ask_turns_the_beam_with_the_mouse(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_Q)
    before = window.session.shown.scene
    view = window.views.plan.drawing
    drag(qtbot, view, view.plot.vb, (0.774, 0.5), (0.3, 0.085))
    until(qtbot, lambda: window.session.shown.answer is not None and abs(window.session.shown.asked - math.pi) < 0.02)
    assert window.session.shown.scene is before
    assert view.sensor.handle_at[0] < SENSOR[0]  # the beam points left
    qtbot.keyClick(window, Qt.Key.Key_H)
    drag(qtbot, view, view.plot.vb, view.sensor.handle_at, (0.774, 0.3))  # the beam of the question, not the turntable
    until(qtbot, lambda: abs(window.session.shown.asked - math.pi / 2) < 0.05)
    assert window.session.shown.scene is before


def test_the_list_of_echoes_is_ranked_and_draws_the_path_pointed_at(qtbot: QtBot, window: MainWindow) -> None:
    window.session.showing.ask(math.radians(270))
    until(qtbot, lambda: answered(window, 270))
    open_list(qtbot, window)
    listed, table = window.views.echo_list, window.views.echo_list.table
    texts = [[table.item(row, column).text() for column in range(4)] for row in range(table.rowCount())]
    assert texts[0] == ["0.827 m", "−1.3 dB", "wins", "bottom>top>bottom"]
    assert texts[1][2] == "0.014 m behind the winner"
    assert [texts[-1][0], *texts[-1][2:]] == ["0.085 m", "blanked", "bottom"]
    assert listed.note.text().startswith("the runner-up (0.841 m) would win with right 0.0")
    pixel = table.visualItemRect(table.item(1, 3)).center()
    qtbot.mouseMove(table.viewport(), pixel)
    qtbot.mouseMove(table.viewport(), pixel + QPoint(1, 0))
    until(qtbot, lambda: window.session.shown.pointed_path is not None)
    pointed = window.views.plan.drawing.path._pointed
    until(qtbot, lambda: len(pointed.getData()[0]) > 0)
    drawn = np.column_stack(pointed.getData())
    answer = window.session.shown.answer
    assert answer.paths.via(window.session.shown.pointed_path, answer.room) == ("bottom", "right", "top", "bottom")
    assert drawn == pytest.approx(answer.paths.outline(window.session.shown.pointed_path))
    table.setFocus()
    qtbot.keyClick(table, Qt.Key.Key_Down)
    qtbot.keyClick(table, Qt.Key.Key_End, Qt.KeyboardModifier.ControlModifier)
    assert table.currentRow() == table.rowCount() - 1
    assert listed.note.text().startswith("this echo (0.085 m) would win with blanking 0.1")


def test_a_reading_lists_its_runner_up(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    window.session.showing.choose(27)  # at 270°
    open_list(qtbot, window)
    assert window.views.echo_list.title.text().startswith("270.0° · ")
    assert "the runner-up" in window.views.echo_list.note.text()
    window.session.showing.ask(math.radians(180))
    until(qtbot, lambda: answered(window, 180))
    qtbot.keyClick(window, Qt.Key.Key_Right)  # back to the readings
    assert window.session.shown.asked is None
    assert window.session.shown.chosen == 28


def test_the_answer_follows_an_edit_of_the_room(qtbot: QtBot, window: MainWindow) -> None:
    window.session.showing.ask(math.radians(90))
    until(qtbot, lambda: answered(window, 90))
    qtbot.keyClick(window, Qt.Key.Key_Up, Qt.KeyboardModifier.ShiftModifier)  # the sensor, 1 cm nearer to the top
    scene = window.session.shown.scene
    expected = predict_scan(scene.room, scene.pose, scene.board, np.radians([90.0]), scene.options).ranges[0]
    until(qtbot, lambda: window.session.shown.answer.place == scene.pose)
    assert window.session.shown.answer.ranges[0] == pytest.approx(expected)
