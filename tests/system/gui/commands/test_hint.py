"""The hint of the first start: shown once, ended by a click on a reading, called again from the menu."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import Scene

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenFake, OpenWith
from tests.system.gui.driving import click, position_of, predicted, until


def test_the_hint_is_shown_at_the_first_start_until_a_reading_is_clicked(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    memory = tmp_path / "window.ini"
    window = open_with(source=read_log(recorded), memory=memory)
    assert window.hint.isVisible()
    for word, label in zip(("fake scanner", "predicted", "Click"), window.hint.labels, strict=True):
        assert word in label.text()
    until(qtbot, lambda: predicted(window))
    ranges = window.views.ranges
    click(qtbot, ranges, ranges.ranges.vb, position_of(ranges._marks[0], 20))
    until(qtbot, lambda: not window.hint.isVisible() and window.session.shown.chosen == 20)
    window.close()
    again = open_with(source=read_log(recorded), memory=memory)
    assert not again.hint.isVisible()
    qtbot.keyClick(again, Qt.Key.Key_F1, Qt.KeyboardModifier.ShiftModifier)
    assert again.hint.isVisible()
    again.hint.timer.start(1)
    until(qtbot, lambda: not again.hint.isVisible())


def test_the_hint_is_closed_by_its_button(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    assert not window.hint.isVisible()
    window.commands.show_first_steps.trigger()
    qtbot.mouseClick(window.hint.close_button, Qt.MouseButton.LeftButton)
    assert not window.hint.isVisible()


def test_the_second_start_shows_the_hint_and_names_no_marks_if_the_first_was_closed_before_its_scan(
    open_with: OpenWith, fake: OpenFake, tmp_path: Path
) -> None:
    scanner, memory = fake("max"), tmp_path / "window.ini"
    open_with(source=scanner, memory=memory).close()
    window = open_with(source=scanner, memory=memory)
    assert window.hint.isVisible()
    assert "none yet" in window.hint.labels[0].text()


def test_the_hint_of_a_room_alone_names_no_marks(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    qtbot.keyClick(window, Qt.Key.Key_F1, Qt.KeyboardModifier.ShiftModifier)
    marks, line, to_click = (label.text() for label in window.hint.labels)
    assert ("none yet" in marks, "Blue line: predicted" in line, "Click the blue line" in to_click) == (True,) * 3
    until(qtbot, lambda: predicted(window))
    plan = window.views.plan.drawing
    outline = window.session.shown.outline
    reached = int(np.flatnonzero(np.isfinite(outline.ranges))[0])
    heading, away = outline.headings[reached], outline.ranges[reached]
    x, y = window.session.shown.scene.pose.position
    click(qtbot, plan, plan.plot.vb, (x + away * np.cos(heading), y + away * np.sin(heading)))
    until(qtbot, lambda: window.session.shown.answer is not None and not window.hint.isVisible())


def test_the_hint_without_a_room_says_how_to_get_a_prediction(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, recorded: Path
) -> None:
    window = open_with(scene=replace(scene, room=None, place=None))
    assert "needs a room (Ctrl+R)" in window.hint.labels[1].text()
    window.session.show_log(read_log(recorded))
    until(qtbot, lambda: "from a fake scanner" in window.hint.labels[0].text())
    assert "Click a mark" in window.hint.labels[2].text()
