"""The view "Side by side": the content of each plan, and their common pan and zoom."""

from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.views.plan_layers import _set_beside
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import click, drag, pixel_at, predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_2)
    until(qtbot, lambda: window.views.side_by_side.predicted.shown is window.session.shown)
    return window


def turn_wheel(view: PlanDrawing, at: tuple[float, float], notches: int) -> None:
    pixel = pixel_at(view, view.plot.vb, at)
    place = view.viewport().mapToGlobal(pixel)
    nothing, none = QPoint(), Qt.MouseButton.NoButton
    angle = QPoint(0, 120 * notches)
    modifiers, phase = Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    wheel = QWheelEvent(QPointF(pixel), QPointF(place), nothing, angle, none, modifiers, phase, False)
    QApplication.sendEvent(view.viewport(), wheel)


def test_one_plan_shows_measured_and_the_other_predicted_ranges(window: MainWindow) -> None:
    measured, predicted = window.views.side_by_side.measured, window.views.side_by_side.predicted
    counts = [len(positions) for _, positions in measured._marks.placed.values()]
    rows = window.session.shown.rows
    assert sum(counts) == np.count_nonzero(np.isfinite(rows.measured) | np.isfinite(rows.predicted)) > 30
    assert not predicted._marks.placed
    outline = predicted._outline.getData()[1]
    predicted_ranges = window.session.shown.outline.ranges
    assert np.isfinite(outline).sum() == np.isfinite(predicted_ranges).sum()
    assert not len(measured._outline.getData()[1])
    for view in (measured, predicted):
        assert len(view.room._walls.getData()[0]) == 8


def test_both_plans_have_common_pan_and_zoom(qtbot: QtBot, window: MainWindow) -> None:
    views = window.views.side_by_side.measured, window.views.side_by_side.predicted
    (left, right), _ = views[0].plot.vb.viewRange()
    turn_wheel(views[1], (0.4, 0.4), 3)
    drag(qtbot, views[0], views[0].plot.vb, (0.3, 0.3), (0.35, 0.35))
    middles = [np.mean(view.plot.vb.viewRange(), axis=1) for view in views]
    pixels = [view.plot.vb.viewPixelSize() for view in views]
    assert middles[0] == pytest.approx(middles[1])
    assert pixels[0] == pytest.approx(pixels[1], rel=0.005)  # one may be a pixel wider
    closer_left, closer_right = views[0].plot.vb.viewRange()[0]
    assert closer_right - closer_left < 0.8 * (right - left)
    qtbot.keyClick(window, Qt.Key.Key_F)
    assert views[0].plot.vb.viewRange()[0] == pytest.approx([left, right], abs=0.01)


def test_a_click_among_predicted_points_selects_the_reading_at_that_heading(qtbot: QtBot, window: MainWindow) -> None:
    x, y = window.session.shown.scene.pose.position
    view = window.views.side_by_side.predicted
    click(qtbot, view, view.plot.vb, (x - 0.3, y + 0.02))
    assert window.session.shown.heading(window.session.shown.chosen) == pytest.approx(np.pi)
    assert "at 180.0°" in window.sentence.text()


def test_a_sensor_dragged_in_one_plan_moves_in_both(qtbot: QtBot, window: MainWindow) -> None:
    views = window.views.side_by_side.measured, window.views.side_by_side.predicted
    start = window.session.shown.scene.pose.position
    drag(qtbot, views[1], views[1].plot.vb, start, (0.5, 0.3))
    until(qtbot, lambda: predicted(window))
    for view in views:
        assert view.sensor._sensor.getData()[0][0] == pytest.approx(0.5, abs=0.005)


def test_labels_of_close_places_do_not_overlap(window: MainWindow) -> None:
    plan = window.views.side_by_side.predicted
    x, y = plan.shown.scene.pose.position
    labels, taken = plan.path._labels[:3], []
    for k, label in enumerate(labels):
        label.setText("1  −14.1 dB")
        label.setVisible(True)
        _set_beside(label, np.array((x + 0.01 * k, y)), taken)
    boxes = [label.mapRectToDevice(label.boundingRect()) for label in labels]
    assert not any(one.intersects(other) for k, one in enumerate(boxes) for other in boxes[:k])
