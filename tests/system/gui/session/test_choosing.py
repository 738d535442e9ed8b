"""Selecting a reading with the mouse in any view, and with the keys."""

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import click, position_of, predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    return window


def test_a_click_in_the_plan_selects_the_reading(qtbot: QtBot, window: MainWindow) -> None:
    click(
        qtbot,
        window.views.plan.drawing,
        window.views.plan.drawing.plot.vb,
        position_of(window.views.plan.drawing._marks, 27),
    )
    assert window.session.shown.chosen == 27
    assert "at 270.0°" in window.sentence.text()
    assert "bottom, top, bottom" in window.sentence.text()
    until(qtbot, lambda: "Trace at 270.0°" in window.views.trace.title.text())


def test_the_rays_of_the_selected_reading_end_at_the_sensor(qtbot: QtBot, window: MainWindow) -> None:
    window.session.showing.choose(27)
    x, y = window.views.plan.drawing.path._rays.getData()
    assert len(x) == 5  # sensor, bottom, top, bottom, sensor
    assert (x[0], y[0]) == (x[-1], y[-1]) == window.session.shown.scene.place.position


def test_a_click_between_points_of_the_range_view_selects_the_nearest_reading(qtbot: QtBot, window: MainWindow) -> None:
    x, y = position_of(window.views.ranges._marks[0], 9)
    click(qtbot, window.views.ranges, window.views.ranges.ranges.vb, (x + 2.0, y))
    assert window.session.shown.chosen == 9
    assert "at 90.0°" in window.sentence.text()


def test_a_row_of_the_table_is_selected_in_every_view(qtbot: QtBot, window: MainWindow) -> None:
    view, model = window.views.table.view, window.views.table.model
    view.scrollToTop()
    place = view.visualRect(model.index(1, 1)).center()
    qtbot.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert window.session.shown.chosen == 1
    assert "at 10.0°" in window.sentence.text()
    qtbot.keyClick(view, Qt.Key.Key_Down)
    assert window.session.shown.chosen == 2
    click(qtbot, window.views.ranges, window.views.ranges.ranges.vb, position_of(window.views.ranges._marks[0], 9))
    assert view.currentIndex().row() == 9


def test_a_click_far_from_all_readings_changes_nothing(qtbot: QtBot, window: MainWindow) -> None:
    before = window.session.shown.chosen
    click(qtbot, window.views.plan.drawing, window.views.plan.drawing.plot.vb, (0.2, 0.35))
    assert window.session.shown.chosen == before


def test_left_and_right_step_through_the_readings(qtbot: QtBot, window: MainWindow) -> None:
    assert window.session.shown.chosen == ORDER.readings - 1
    qtbot.keyClick(window, Qt.Key.Key_Right)
    assert window.session.shown.chosen == 0
    qtbot.keyClick(window, Qt.Key.Key_Left)
    qtbot.keyClick(window, Qt.Key.Key_Left)
    assert window.session.shown.chosen == ORDER.readings - 2
    qtbot.keyClick(window, Qt.Key.Key_Escape)
    assert window.session.shown.chosen == ORDER.readings - 1


def test_every_predicted_echo_of_the_selected_heading_is_marked(qtbot: QtBot, window: MainWindow) -> None:
    window.session.showing.choose(27)
    until(qtbot, lambda: "Trace at 270.0°" in window.views.trace.title.text())
    row, prediction = window.session.shown.chosen_row, window.session.shown.prediction
    echoes = prediction.ping(row.index).echoes + prediction.ping(row.index).blanked_echoes
    speed = prediction.room.air.speed_of_sound
    marked = np.concatenate([heads.getData()[0] for heads in window.views.trace.names._heads.values()])
    assert sorted(marked) == sorted(prediction.apparent_lengths[echo.path] / speed for echo in echoes)
    named = [item.toPlainText() for item in window.views.trace.names._items if item.isVisible()]
    assert "bottom>top>bottom" in named


def test_another_place_changes_the_prediction(qtbot: QtBot, window: MainWindow) -> None:
    before = window.session.shown.outline
    window.toolbar.place.setCurrentText("figure7")
    window.toolbar.place.textActivated.emit("figure7")
    until(qtbot, lambda: predicted(window))
    assert window.session.shown.outline is not before
    assert window.session.shown.outline.place.name == "figure7"
