"""The B-scan view: panes, linked cursor, clicks, and notes about missing traces and predictions."""

import gc
import math
from dataclasses import replace
from pathlib import Path
from weakref import ref

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from pytestqt.qtbot import QtBot
from sonarhw_compare.pictures import SAME_HEADING, difference
from sonarhw_gui.jobs.traces import Pane, bscan_slice
from sonarhw_gui.model.look import LIGHT
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Cursor, Shown
from sonarhw_gui.views.bscan import BScanView
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.window.start import open_application
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from sonarhw.readings import Reading
from tests.system.gui.conftest import ORDER, OpenFake, OpenWith
from tests.system.gui.driving import ended, pixel_at, predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_3)
    until(qtbot, lambda: computed(window))
    return window


def computed(window: MainWindow) -> bool:
    bscan = window.session.shown.bscan
    return bscan is not None and bscan.rows.done == 1 and bscan.settings == window.views.bscan.settings


def at(window: MainWindow, pane: Pane, x: float, y: float) -> QPoint:
    return pixel_at(window.views.bscan.canvas, window.views.bscan.panes[pane].plot.vb, (x, y))


def test_a_click_on_a_heading_chooses_its_reading(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.mouseClick(
        window.views.bscan.canvas.viewport(), Qt.MouseButton.LeftButton, pos=at(window, Pane.MEASURED, 271, 0.6)
    )
    assert window.session.shown.chosen == 27
    assert "at 270.0°" in window.sentence.text()


def test_hidden_views_are_created_when_first_visible_with_the_current_settings(
    qtbot: QtBot, open_with: OpenWith, recorded: Path
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    assert len(window.findChildren(PlanDrawing)) == 1
    assert not window.views.bscan.panes
    window.commands.fit.trigger()
    window.views.bscan.polar.trigger()
    window.views.bscan.choices.actions()[1].trigger()
    qtbot.keyClick(window, Qt.Key.Key_3)
    until(qtbot, lambda: computed(window))
    assert list(window.views.bscan.panes) == [Pane.PREDICTED]
    assert window.session.shown.bscan.settings.polar
    qtbot.keyClick(window, Qt.Key.Key_2)
    assert len(window.findChildren(PlanDrawing)) == 3


def test_a_click_in_a_polar_image_chooses_the_direction_from_the_sensor(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_O)
    until(qtbot, lambda: window.views.bscan.settings.polar and computed(window))
    x, y = window.session.shown.scene.pose.position
    where = at(window, Pane.MEASURED, x + 0.5 * math.cos(2.1), y + 0.5 * math.sin(2.1))
    qtbot.mouseClick(window.views.bscan.canvas.viewport(), Qt.MouseButton.LeftButton, pos=where)
    assert window.session.shown.chosen == 12  # 2.1 rad are 120.3°


def test_the_mouse_links_the_cursor_of_every_view(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.mouseMove(window.views.bscan.canvas.viewport(), at(window, Pane.MEASURED, 90, 0.6))
    until(qtbot, lambda: window.session.shown.cursor is not None)
    until(qtbot, lambda: abs(window.session.shown.cursor.range - 0.6) < 0.02)
    assert math.degrees(window.session.shown.cursor.heading) == pytest.approx(90.0, abs=1.0)
    until(qtbot, lambda: window.views.trace._pointer.isVisible())
    trace = window.session.shown.trace
    assert window.views.trace._pointer.value() == pytest.approx(
        trace.time_at(window.session.shown.cursor.range), rel=1e-3
    )


def test_the_cursor_of_another_view_is_drawn_in_every_pane(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_F4, Qt.KeyboardModifier.ShiftModifier)
    until(qtbot, lambda: len(window.views.bscan.settings.panes) == len(Pane) and computed(window))
    window.session.showing.point_at(Cursor(math.radians(45.0), 0.7))
    for pane in window.views.bscan.panes.values():
        until(qtbot, lambda pane=pane: len(pane._cursor.getData()[0]) > 0)
        x, y = pane._cursor.getData()
        assert (x[0], y[0]) == pytest.approx((45.0, 0.7))


def test_the_three_panes_have_common_pan_and_zoom(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_F4, Qt.KeyboardModifier.ShiftModifier)
    until(qtbot, lambda: len(window.views.bscan.settings.panes) == len(Pane) and computed(window))
    window.views.bscan.panes[Pane.PREDICTED].plot.vb.setRange(xRange=(30, 60), yRange=(0.2, 0.8), padding=0)
    for pane in window.views.bscan.panes.values():
        np.testing.assert_allclose(pane.plot.vb.viewRange(), [[30, 60], [0.2, 0.8]])
    window.commands.fit.trigger()
    (left, right), (_, top) = window.views.bscan.panes[Pane.DIFFERENCE].plot.vb.viewRange()
    assert right - left >= 360
    assert top == pytest.approx(window.session.shown.bscan.rows.cells.reach)


def test_a_hidden_bscan_is_not_computed(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_1)
    before = window.session.shown.bscan
    window.session.showing.set_place("figure7")
    until(qtbot, lambda: predicted(window))
    assert window.session.shown.bscan is before
    qtbot.keyClick(window, Qt.Key.Key_3)
    until(qtbot, lambda: window.session.shown.bscan is not before and computed(window))


def test_a_live_scan_fills_the_bscan_heading_by_heading(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(source=fake("max"))
    qtbot.keyClick(window, Qt.Key.Key_3)
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and predicted(window) and computed(window))
    until(qtbot, lambda: len(window.session.shown.bscan.measured.headings) == ORDER.readings)
    angles = np.sort([reading.angle for reading in window.session.shown.readings])
    np.testing.assert_allclose(window.session.shown.bscan.measured.headings, angles, atol=0.5 * SAME_HEADING)
    # the fake's room is the predicted room, so both agree except for noise
    bscan = window.session.shown.bscan
    apart = difference(bscan.measured, bscan.predicted, window.session.shown.scene.board.threshold_db).levels
    assert np.nanmean(np.abs(apart) < 3.0) > 0.95


@pytest.fixture
def view(qtbot: QtBot) -> BScanView:
    open_application()
    view = BScanView()
    qtbot.addWidget(view)
    view.resize(700, 500)
    view.show()
    return view


def checked(window: MainWindow) -> str:
    return window.views.bscan.choices.checkedAction().text()


def test_a_room_alone_opens_on_its_prediction_until_there_are_readings(
    qtbot: QtBot, open_with: OpenWith, recorded: Path
) -> None:
    window = open_with()
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_3)
    until(qtbot, lambda: computed(window))
    assert checked(window) == "Predicted"
    assert window.views.bscan.panes[Pane.PREDICTED].plot.isVisible()
    window.session.show_log(read_log(recorded))
    until(qtbot, lambda: computed(window) and predicted(window))
    assert checked(window) == "Recorded"
    window.session.leave_replay()
    assert checked(window) == "Recorded"


@pytest.mark.parametrize(("key", "choice"), [(Qt.Key.Key_F2, "Recorded"), (Qt.Key.Key_F3, "Predicted")])
def test_the_pane_that_the_user_has_chosen_stays(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, key: Qt.Key, choice: str
) -> None:
    window = open_with()
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_3)
    qtbot.keyClick(window, key)
    until(qtbot, lambda: computed(window))
    assert checked(window) == choice
    assert ("no readings" in window.views.bscan.note.text()) == (choice == "Recorded")
    window.session.show_log(read_log(recorded))
    until(qtbot, lambda: computed(window) and predicted(window))
    assert checked(window) == choice


def test_a_log_without_traces_is_reported(view: BScanView, scene: Scene) -> None:
    readings = tuple(Reading(k, 0, 0, math.radians(10 * k), 0.1 * k, (0.003,), 343.2) for k in range(36))
    answer = bscan_slice(scene, readings, None, view.settings, LIGHT, None)
    view.show_state(Shown(scene, readings=readings, chosen=3, bscan_ref=ref(answer)))
    assert "no traces recorded" in view.note.text()
    assert "no prediction" in view.note.text()
    marked = np.argwhere(np.isfinite(answer.measured.levels))
    assert len(marked) == 36


def test_the_view_reports_a_pending_image(view: BScanView, scene: Scene) -> None:
    view.show_state(Shown(scene))
    assert "computing …" in view.note.text()


def test_a_picture_of_another_wish_is_not_drawn(qtbot: QtBot, view: BScanView, scene: Scene) -> None:
    stale = bscan_slice(scene, (), None, replace(view.settings, polar=True), LIGHT, None)
    view.show_state(Shown(scene, bscan_ref=ref(stale)))
    assert view.panes[Pane.MEASURED]._image.image is None


def test_no_hidden_view_keeps_the_b_scan_of_a_closed_log(qtbot: QtBot, window: MainWindow, recorded: Path) -> None:
    """Each hidden view keeps what it drew last. Seven old B-scans took 200 MB."""
    old = ref(window.session.shown.bscan)
    for key in (Qt.Key.Key_2, Qt.Key.Key_1):
        qtbot.keyClick(window, key)
    qtbot.wait(60)
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.log_file == str(recorded) and predicted(window))
    gc.collect()
    assert old() is None
