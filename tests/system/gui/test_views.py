"""The views beside the plan: B-scan, trace, ranges, table, sentence; dense scans; what all views have in common."""

import csv
import gc
import io
import math
import re
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from weakref import ref

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QGuiApplication, QTextLayout
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLabel, QMenu, QWidget
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind, compare_readings
from sonarhw_gui.jobs import forecast
from sonarhw_gui.jobs.forecast import STRETCH, ComparedScan, PathsFound, Stretch
from sonarhw_gui.jobs.traces import Pane, chosen_trace
from sonarhw_gui.model.edits import sensor_at
from sonarhw_gui.model.look import DARK, LIGHT, LengthUnit, Look, Unclassed, ViewLayer
from sonarhw_gui.model.rows import Column, RowQuery, order_of, rows_as_csv
from sonarhw_gui.model.scene import NoteTexts, Scene
from sonarhw_gui.model.shown import Cursor, Shown
from sonarhw_gui.views.base import View
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.views.ranges import RangeView
from sonarhw_gui.views.table import TableView
from sonarhw_gui.views.trace import TraceView
from sonarhw_gui.window.bars import MISFITS, Sentence, shortened_to_lines
from sonarhw_gui.window.start import open_application
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import RoomEchoes

from sonarhw.errors import text_cell
from sonarhw.log import read_log
from sonarhw.readings import Ping, Reading
from tests.checkout import CHECKOUT
from tests.fixtures.contributing import worked_example
from tests.system.gui import driving as ui
from tests.system.gui.conftest import ORDER, OpenFake, OpenWith
from tests.system.gui.dense_scan import SHORT, dense_log

SPEED = 343.2
VIEWS = "Plan", "Side by side", "B-scan", "Trace", "Ranges", "Readings"


def alone(qtbot: QtBot, view: QWidget, width: int, height: int) -> None:
    """Show a view without a window around it."""
    qtbot.addWidget(view)
    view.resize(width, height)
    ui.activate(view)


# all views


def test_every_view_has_a_menu_and_selects_readings(window: MainWindow, recorded: Path) -> None:
    views, showing = window.views, window.session.showing
    ranges, plan = views.ranges, views.plan.drawing
    assert len(views.all) == 8
    assert all(isinstance(view, View) for view in views.all)
    ui.until(lambda: ranges.ranges.vb.viewRange()[0] == pytest.approx([0, 360], abs=10))

    # readings are selected with the mouse in any view, and with keys
    assert showing.shown.chosen == ORDER.readings - 1
    ui.click(plan, plan.plot.vb, ui.drawn(plan.marks)[27])
    assert showing.shown.chosen == 27
    ui.until(lambda: "Trace at 270.0°" in views.trace.title.text())
    assert all(part in window.sentence.text() for part in ("at 270.0°", "bottom, top, bottom"))
    row, prediction = showing.shown.chosen_row, showing.shown.prediction
    ping, speed = prediction.ping(row.index), prediction.room.air.speed_of_sound
    marked = np.concatenate([heads.getData()[0] for heads in views.trace.numbers.heads.values()])
    echoes = ping.echoes + ping.blanked_echoes
    assert sorted(marked) == sorted(prediction.apparent_lengths[echo.path] / speed for echo in echoes)
    tips = [tip for heads in views.trace.numbers.heads.values() for tip in heads.about]
    assert any(tip.startswith("2: bottom>top>bottom\n") for tip in tips)  # 1 arrives within blanking
    ui.click(plan, plan.plot.vb, (0.2, 0.35))  # far from all readings
    assert showing.shown.chosen == 27
    x, y = ui.drawn(ranges.marks[0])[9]
    ui.click(ranges, ranges.ranges.vb, (x + 2.0, y))  # the nearest one
    assert showing.shown.chosen == views.table.view.currentIndex().row() == 9
    table, model = views.table.view, views.table.model
    table.scrollToTop()
    ui.push(table.viewport(), table.visualRect(model.index(1, 1)).center())
    assert (showing.shown.chosen, "at 10.0°" in window.sentence.text()) == (1, True)
    ui.key(table, "Down")
    assert showing.shown.chosen == 2
    for pressed, chosen in (("Esc", -1), ("Right", 0), ("Left", -1), ("Left", -2), ("Esc", -1)):
        ui.key(window, pressed)
        assert showing.shown.chosen == chosen % ORDER.readings

    # ranges and residuals are reset by key; the menu resets only its own view
    plots = ranges.ranges.vb, ranges.residuals.vb
    usual = [box.viewRange() for box in plots]
    for box in plots:
        box.setRange(xRange=(100, 200), yRange=(0.1, 0.2), padding=0)
    assert plots[1].viewRange()[0] == pytest.approx([100, 200])
    ui.key(window, "F")
    for box, sides in zip(plots, usual, strict=True):
        np.testing.assert_allclose(box.viewRange(), sides, rtol=1e-4)
    plots[0].setRange(xRange=(100, 200), yRange=(0.1, 0.2), padding=0)
    plan.plot.vb.setRange(QRectF(0, 0, 0.1, 0.1), padding=0)
    zoomed = plan.plot.vb.viewRect()
    showing.switch(Kind.MATCH, False)
    for below, text in ((ranges.viewport(), "Fit this view"), (plan.viewport(), "Show all layers")):
        menu = ui.menu_of(below)
        next(action for action in menu.actions() if action.text() == text).trigger()
        menu.close()
    np.testing.assert_allclose(plots[0].viewRange(), usual[0], rtol=1e-4)
    assert (plan.plot.vb.viewRect(), showing.shown.hidden) == (zoomed, frozenset())
    for _ in range(200):  # zooming out never leaves readable headings
        plots[0].scaleBy((1.5, 1.5))
    (left, right), (low, high) = plots[0].viewRange()
    assert -20 <= left < right <= 380
    assert high - low <= 1e5

    # each has one menu, none of pyqtgraph; the menus of the window list the commands of the views
    for name in VIEWS:
        for action in window.commands.views:
            if action.text() == name:
                action.trigger()
        view = next(view for view in views.all if view.entry.name == name)
        ui.until(view.isVisible)
        canvas = view if isinstance(view, pg.GraphicsView) else view.findChild(pg.GraphicsView)
        below = canvas.viewport() if canvas is not None else view.view.viewport()
        QTest.mouseClick(below, Qt.MouseButton.RightButton, pos=below.rect().center() - QPoint(20, 20))
        assert not [menu for menu in QApplication.topLevelWidgets() if isinstance(menu, QMenu) and menu.isVisible()]
        menu = ui.menu_of(below)
        texts = {action.text() for action in menu.actions()}
        assert {"Fit this view", *(action.text() for action in view.actions())} <= texts, name
        assert any("Picture" in text for text in texts) is (name != "Readings")
        assert "Export..." not in texts, name
        menu.close()
    items = [item for view in window.findChildren(pg.GraphicsView) for item in view.scene().items()]
    plotted = [item for item in items if isinstance(item, pg.PlotItem | pg.ViewBox)]
    assert len(plotted) >= 8
    assert not any(item.menuEnabled() for item in plotted)
    entries = window.menuBar().actions()  # keeps references, or Qt deletes the menus
    menus = {entry.text().replace("&", ""): entry.menu() for entry in entries}
    assert [*menus] == ["File", "Scan", "Edit", "Plan", "Trace", "Analyse", "Replay", "View", "Help"]
    assert all(set(view.actions()) <= set(menus[view.entry.menu].actions()) for view in views.all if view.entry.menu)
    listed = [action.text() for action in menus["View"].actions()]
    assert listed[:4] == ["Plan", "Side by side", "B-scan", "Zoom to all"]
    kept = [action.text() for action in menus["File"].actions() if action.text().startswith("Picture")]
    assert kept == [f"Picture of the {name}…" for name in ("large view", "trace", "ranges", "window")]


def test_every_entry_of_the_legend_switches_its_layer_with_a_key(window: MainWindow) -> None:
    views = window.views
    ui.until(lambda: window.session.shown.trace is not None and views.trace.measured.isVisible())
    items_of = {
        ViewLayer.TRACE: [views.trace.measured],
        ViewLayer.PREDICTED: [views.trace.predicted, views.plan.drawing.outline, views.ranges.outline],
        ViewLayer.THRESHOLD: [views.trace.marks.threshold],
        ViewLayer.BEAM: [views.plan.drawing.sensor.beam],
        ViewLayer.BLANKING: [views.trace.marks.blanking],
        ViewLayer.RAYS: [],
    }
    assert set(items_of) == set(ViewLayer)
    for layer, items in items_of.items():
        assert all(item.isVisible() for item in items), layer
        entry = window.legend.entries[layer]
        entry.setFocus()
        ui.key(entry, "Space")
        ui.until(lambda layer=layer: layer in window.session.shown.hidden)
        assert not any(item.isVisible() for item in items), layer
    rays = views.plan.drawing.path.rays.getData()[0]
    assert rays is None or not len(rays)
    ui.key(entry, "Space")
    ui.until(lambda: layer not in window.session.shown.hidden)
    assert all(item.isVisible() for item in items)


# the B-scan


def computed(window: MainWindow) -> bool:
    bscan = window.session.shown.bscan
    return bscan is not None and bscan.rows.done == 1 and bscan.settings == window.views.bscan.settings


def test_hidden_views_keep_nothing_of_another_room(open_with: OpenWith, recorded: Path) -> None:
    window = open_with()
    session, views = window.session, window.views
    session.open_file(str(recorded))
    ui.until(lambda: session.replay is not None and ui.predicted(window))
    session.showing.choose(3)
    for number in (1, 2, 0):
        views.show_number(number)
        ui.pause(60)  # two ticks
    for dock in (*views.docks, *window.docks):
        dock.bring_to_front()
        ui.pause(60)
    compared = session.shown.compared
    assert compared is not None
    parts = [ref(session.shown.outline), *(ref(stretch.comparison) for stretch in compared.stretches)]
    del compared
    session.open_file(str(CHECKOUT / "rooms" / "corridor.toml"))
    ui.until(lambda: session.shown.scene.room.name == "Corridor" and ui.predicted(window))
    ui.pause(60)
    gc.collect()
    assert [part() for part in parts] == [None] * len(parts)


def test_a_bscan_is_computed_while_it_is_visible(open_with: OpenWith, recorded: Path) -> None:
    window = open_with()  # a room alone opens on its prediction, until there are readings
    view, session, trace = window.views.bscan, window.session, window.views.trace

    def at(pane: Pane, x: float, y: float) -> QPoint:
        return ui.pixel_at(view.canvas, view.panes[pane].plot.vb, (x, y))

    def checked() -> str:
        return view.choices.checkedAction().text()

    ui.until(lambda: ui.predicted(window))
    assert (len(window.findChildren(PlanDrawing)), len(view.panes)) == (1, 0)  # hidden views are not created
    ui.key(window, "3")
    ui.until(lambda: computed(window))
    assert checked() == "Predicted"
    assert view.panes[Pane.PREDICTED].plot.isVisible()
    session.open_file(str(recorded))
    ui.until(
        lambda: session.replay is not None and computed(window) and ui.predicted(window) and checked() == "Recorded"
    )
    ui.push(view.canvas.viewport(), at(Pane.MEASURED, 271, 0.6))
    assert session.shown.chosen == 27
    ui.until(lambda: "at 270.0°" in window.sentence.text())
    QTest.mouseMove(view.canvas.viewport(), at(Pane.MEASURED, 90, 0.6))
    ui.until(lambda: session.shown.cursor is not None and abs(session.shown.cursor.range - 0.6) < 0.02)
    assert math.degrees(session.shown.cursor.heading) == pytest.approx(90.0, abs=1.0)
    ui.until(trace.pointer.isVisible)
    assert trace.pointer.value() == pytest.approx(session.shown.trace.time_at(session.shown.cursor.range), rel=1e-3)

    ui.key(window, "Shift+F4")  # all panes, with common pan, zoom and cursor
    ui.until(lambda: len(view.settings.panes) == len(Pane) and computed(window))
    session.showing.point_at(Cursor(math.radians(45.0), 0.7))
    for pane in view.panes.values():
        ui.until(lambda pane=pane: np.allclose(pane.cursor.getData(), [[45.0], [0.7]]))
    view.panes[Pane.PREDICTED].plot.vb.setRange(xRange=(30, 60), yRange=(0.2, 0.8), padding=0)
    for pane in view.panes.values():
        np.testing.assert_allclose(pane.plot.vb.viewRange(), [[30, 60], [0.2, 0.8]])
    window.commands.fit.trigger()
    (left, right), (_, top) = view.panes[Pane.DIFFERENCE].plot.vb.viewRange()
    assert right - left >= 360
    assert top == pytest.approx(session.shown.bscan.rows.cells.reach)

    ui.key(window, "O")  # polar: a click chooses the direction from the sensor, and the size stays when panes change
    ui.until(lambda: view.settings.polar and computed(window))
    recorded_only, *_, three = view.choices.actions()
    recorded_only.trigger()
    ui.until(lambda: computed(window))
    (x, y), box = session.shown.scene.pose.position, view.panes[Pane.MEASURED].plot.vb
    assert 0.742 < min(box.viewRect().width(), box.viewRect().height()) < 1.5  # around the room, 0.928 m by 0.742 m
    ui.push(view.canvas.viewport(), at(Pane.MEASURED, x + 0.5 * math.cos(2.1), y + 0.5 * math.sin(2.1)))
    assert session.shown.chosen == 12  # 2.1 rad are 120.3°
    QApplication.processEvents()
    before = box.viewRect().width()
    for choice in (three, recorded_only, three, recorded_only):
        choice.trigger()
        ui.until(lambda: computed(window))
        QApplication.processEvents()
    assert box.viewRect().width() == pytest.approx(before, rel=0.01)

    ui.key(window, "1")  # a hidden one is not computed, and keeps no B-scan of a closed log
    session.showing.set_place("figure7")
    ui.until(lambda: ui.predicted(window))
    ui.pause(60)  # two ticks
    assert not session.shown.bscan.rows.predicted
    ui.key(window, "3")
    ui.until(lambda: computed(window))
    assert session.shown.bscan.rows.outline is session.shown.outline
    old = ref(session.shown.bscan)
    ui.key(window, "2", "1")
    ui.pause(60)
    session.leave_replay()
    session.open_file(str(recorded))
    ui.until(lambda: session.replay is not None and ui.predicted(window))
    gc.collect()
    assert old() is None  # seven old B-scans took 200 MB


def test_a_live_scan_fills_the_bscan_in_the_pane_that_the_user_has_chosen(open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(source=fake("max"))
    ui.until(lambda: ui.predicted(window))
    ui.key(window, "3", "F2")  # chosen before there are readings
    ui.until(lambda: computed(window))
    assert "no readings" in window.views.bscan.note.text()
    window.commands.scan.trigger()
    ui.until(lambda: ui.ended(window) and ui.predicted(window) and computed(window))
    ui.until(lambda: len(window.session.shown.bscan.measured.headings) == ORDER.readings)
    assert window.views.bscan.choices.checkedAction().text() == "Recorded"


# the trace


@pytest.fixture(scope="module")
def traced(scene: Scene, echoes: RoomEchoes) -> Shown:
    heading = math.radians(270.0)
    ping = echoes.receive(Ping(heading, 0, 0, 0.0115, trace=True))
    reading = Reading(0, 0, 0, heading, 0.0, ping.echo_times, SPEED, trace=ping.trace)
    prediction = predict_scan(scene.room, scene.pose, scene.board, np.array([heading]))
    return Shown(scene, readings=(reading,), chosen=0, trace=chosen_trace(scene, reading, prediction, 0))


@pytest.fixture
def trace(qtbot: QtBot, traced: Shown) -> TraceView:
    open_application()
    view = TraceView()
    alone(qtbot, view, 900, 400)
    view.show_state(traced)
    ui.until(lambda: view.plot.vb.width() > 600)
    return view


def test_a_trace_has_consistent_axes_and_every_mark_at_the_time_of_its_echo(trace: TraceView, traced: Shown) -> None:
    for unit, metres in ((LengthUnit.M, 1.0), (LengthUnit.CM, 0.01), (LengthUnit.FT, 0.3048)):
        trace.show_state(replace(traced, look=Look(unit=unit)))
        axis = trace.range_axis  # the range at the time below
        spacing, times = axis.tickValues(0.0, traced.trace.duration, 800.0)[0]
        for time, text in zip(times, axis.tickStrings(times, axis.scale, spacing), strict=True):
            figure, name = text.split(" ")
            rounded = 0.51 * metres * 10 ** -len(figure.partition(".")[2])
            assert name == unit.label
            assert float(figure) * metres == pytest.approx(SPEED * time / 2, abs=rounded)
    x = np.concatenate([heads.getData()[0] for heads in trace.numbers.heads.values()])
    assert sorted(x) == sorted(echo.time for echo in traced.trace.echoes)
    assert trace.marks.blanking.getRegion() == (0.0, traced.scene.board.blanking)
    reported, height = trace.marks.reported.getData()
    assert reported.tolist() == list(traced.readings[0].echo_times)
    assert set(height) == {traced.scene.board.threshold_db}
    numbers = [item for item in trace.numbers.items if item.isVisible()]
    assert len(numbers) >= 2
    times = [item.pos().x() for item in sorted(numbers, key=lambda item: int(item.toPlainText()))]
    assert times == sorted(times)
    boxes = [item.mapRectToScene(item.boundingRect()).adjusted(1, 1, -1, -1) for item in numbers]  # a pixel of rounding
    assert not [1 for k, one in enumerate(boxes) for other in boxes[:k] if one.intersects(other)]
    alone = [replace(echo, summed=False) for echo in traced.trace.echoes]
    for echoes, sums in ((traced.trace.echoes, True), (alone, False)):
        trace.numbers.draw(echoes, trace.numbers.heights)
        tips = [tip for heads in trace.numbers.heads.values() for tip in heads.about]
        assert len(tips) >= 3
        assert all(("dB, sum of all arrivals within one wavelength" in tip) == sums for tip in tips)


def test_keys_switch_to_the_carrier_and_move_two_cursors(trace: TraceView, traced: Shown) -> None:
    label = trace.plot.getAxis("left")
    assert "dB" in label.labelText
    ui.key(trace, "R")
    ui.until(lambda: "signal" in label.labelText)
    _, carrier = trace.predicted.getOriginalDataset()
    assert carrier.min() < -0.02 < 0.02 < carrier.max()
    assert "envelope only" in trace.title.text()
    ui.key(trace, "V")
    ui.until(lambda: "dB" in label.labelText)
    assert trace.predicted.getOriginalDataset()[1].max() <= 0

    assert not trace.readout.isVisible()
    ui.key(trace, "C")
    ui.until(trace.readout.isVisible)
    for start, end in zip(trace.cursors.times, (0.002, 0.005), strict=True):
        ui.drag(trace.canvas, trace.plot.vb, (start, -20.0), (end, -20.0))
    first, second = trace.cursors.times
    assert (first, second) == pytest.approx((0.002, 0.005), abs=3e-5)
    read = [float(figure) for figure in re.findall(r"-?\d+\.\d+", trace.readout.text())]
    ways = [first * 1e3, first * 171.6, second * 1e3, second * 171.6]
    assert read == pytest.approx([*ways, (second - first) * 1e3, (second - first) * 171.6], abs=0.006)
    ui.key(trace, "Alt+Right", "Alt+Shift+Left")
    assert trace.cursors.times[0] > first
    assert trace.cursors.times[1] < second


def test_the_trace_follows_the_cursor_and_keeps_its_zoom(trace: TraceView, traced: Shown) -> None:
    cursors: list[Cursor | None] = []
    trace.gestures.pointed.connect(cursors.append)
    QTest.mouseMove(trace.canvas.viewport(), ui.pixel_at(trace.canvas, trace.plot.vb, (0.004, -20.0)))
    ui.until(lambda: bool(cursors) and cursors[-1] is not None)
    assert cursors[-1].range == pytest.approx(0.6864, abs=0.01)
    assert math.degrees(cursors[-1].heading) % 360 == pytest.approx(270.0)
    trace.show_state(replace(traced, cursor=Cursor(0.3, 0.5)))
    assert (trace.pointer.isVisible(), trace.pointer.value()) == (True, pytest.approx(2 * 0.5 / SPEED))
    trace.show_state(replace(traced, cursor=None))
    assert not trace.pointer.isVisible()
    trace.plot.setXRange(0.002, 0.003, padding=0)
    trace.show_state(replace(traced, trace=replace(traced.trace)))  # stays for the next reading
    assert trace.plot.viewRange()[0] == pytest.approx([0.002, 0.003])
    trace.fit()
    assert trace.plot.viewRange()[0] == pytest.approx([0.0, traced.trace.duration])

    newest = replace(traced.readings[0], number=1, angle=traced.readings[0].angle + math.radians(5))
    assert "being computed" not in trace.title.text()
    trace.show_state(replace(traced, readings=(*traced.readings, newest), chosen=1))
    assert f"{math.degrees(traced.heading(0) + math.radians(5)) % 360:.1f}° is being computed" in trace.title.text()
    whole, title = "Trace at 355.0° · no trace recorded · no prediction", trace.title
    title.resize(160, 24)  # a title that does not fit ends in an ellipsis
    title.setText(whole)
    assert title.toolTip() == whole
    image = title.grab().toImage()
    title.setText(title.fontMetrics().elidedText(whole, Qt.TextElideMode.ElideRight, 160))
    assert title.text().endswith("…")
    assert title.grab().toImage() == image
    for state in (replace(traced, look=Look(palette=DARK)), replace(traced, trace=None)):
        trace.show_state(state)
        assert trace.canvas.grab().toImage().pixelColor(3, 3).name().upper() == state.look.palette.paper


# ranges and residuals


@pytest.fixture
def four(scene: Scene) -> Shown:
    """Four readings, a quarter turn apart; the last one has no echo."""
    readings = tuple(
        Reading(k, 0, 0, math.radians(90 * k), 0.1 * k, () if far is None else (2 * far / SPEED,), SPEED)
        for k, far in enumerate((0.8, 0.5, 0.9, None))
    )
    return compared(Shown(scene, readings=readings, chosen=0))


def compared(shown: Shown) -> Shown:
    scene = shown.scene
    comparison = compare_readings(shown.readings, scene.room, scene.pose, scene.board)
    return replace(shown, compared=ComparedScan((Stretch(0, comparison),)))


@pytest.fixture
def ranges(qtbot: QtBot, four: Shown) -> RangeView:
    view = RangeView()
    view.show_state(four)
    alone(qtbot, view, 600, 350)
    return view


def colour_at(view: pg.GraphicsView, box: pg.ViewBox, at: tuple[float, float]) -> QColor:
    return view.grab().toImage().pixelColor(ui.pixel_at(view, box, at))


def test_residuals_are_measured_minus_predicted_and_beyond_the_scale_an_arrow(ranges: RangeView, four: Shown) -> None:
    for row in four.compared.stretches[0].comparison.rows:
        if row.kind in (Kind.MATCH, Kind.SHORT, Kind.LONG):
            heading, residual = ui.drawn(ranges.marks[1])[row.index]
            assert heading == pytest.approx(90 * row.index)
            assert residual == pytest.approx(float(np.clip(row.residual, -0.25, 0.25)))
    far = (four.row(0).predicted, None, four.row(2).predicted + 0.4, four.row(3).predicted - 0.2)
    readings = tuple(
        replace(reading, echo_times=() if metres is None else (2 * metres / SPEED,))
        for reading, metres in zip(four.readings, far, strict=True)
    )
    ranges.show_state(compared(replace(four, readings=readings)))
    points = {kind: list(zip(*ranges.beyond[kind].getData(), strict=True)) for kind in ranges.beyond}
    assert points == {Kind.SHORT: [], Kind.LONG: [(pytest.approx(180), pytest.approx(0.25))]}
    assert ranges.beyond[Kind.LONG].isVisible()
    box = ranges.residuals.vb
    assert colour_at(ranges, box, (180, 0.25)).name() == QColor(four.look.palette.long).name()
    for away in (40, 0):
        QTest.mouseMove(ranges.viewport(), ui.pixel_at(ranges, box, (180, 0.25)) - QPoint(away, away))
    ui.until(lambda: "residual +400 mm" in box.toolTip())
    ranges.show_state(replace(four, compared=None))
    assert not ranges.beyond[Kind.LONG].isVisible()
    for unit, small, scale in (
        (LengthUnit.CM, "cm", 100),
        (LengthUnit.FT, "in", 1 / 0.0254),
        (LengthUnit.M, "mm", 1000),
    ):
        ranges.show_state(replace(four, look=Look(unit=unit)))
        left = ranges.residuals.getAxis("left")
        assert ranges.ranges.getAxis("left").labelText == f"range ({unit.label})"
        assert (left.labelText, left.scale) == (f"residual ({small})", pytest.approx(scale))
    for height, label in ((400, "residual (mm)"), (150, "mm"), (400, "residual (mm)")):
        ranges.resize(ranges.width(), height)
        assert left.labelText == label
        assert height - 20 < ranges.residuals.mapRectToScene(ranges.residuals.boundingRect()).bottom() <= height


# the table

COUNT = ORDER.readings


@pytest.fixture(scope="module")
def shown(scene: Scene, recorded: Path) -> Shown:
    """A scan with one missed, one short and one long reading."""
    readings = list(read_log(recorded).readings)
    for place, factor in ((3, None), (5, 0.7), (7, 1.4)):
        echo = readings[place].echo_times[0]
        readings[place] = replace(readings[place], echo_times=() if factor is None else (echo * factor,))
    return compared(Shown(scene, readings=tuple(readings), chosen=COUNT - 1))


@pytest.fixture
def table(qtbot: QtBot, shown: Shown) -> TableView:
    table = TableView()
    table.show_state(shown)
    alone(qtbot, table, 900, 300)
    return table


def listed(table: TableView, column: Column = Column.NUMBER) -> list[str]:
    return [table.model.data(table.model.index(row, column)) for row in range(table.model.rowCount())]


def cell(table: TableView, row: int) -> QPoint:
    return table.view.visualRect(table.model.index(row, Column.HEADING)).center()


def click_header(table: TableView, column: Column) -> None:
    header = table.view.horizontalHeader()
    ui.push(header.viewport(), QPoint(header.sectionPosition(column) + 20, 5))


def clipboard_rows() -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(QGuiApplication.clipboard().text())))


def test_the_view_of_the_worked_example_counts_the_residuals(qtbot: QtBot, four: Shown) -> None:
    view = worked_example("class HistogramView", {"__name__": "histogram"})["HistogramView"]()
    assert isinstance(view, View)
    view.show_state(four)
    alone(qtbot, view, 400, 300)
    residuals = [row.residual for row in four.compared.stretches[0].comparison.rows if row.residual is not None]
    assert residuals
    assert view.steps.getData()[1].sum() == sum(abs(residual) < 0.255 for residual in residuals)


def test_the_table_is_sorted_and_filtered_by_numbers_words_and_classes(table: TableView, shown: Shown) -> None:
    rows = shown.rows
    assert order_of(rows, RowQuery(text="top")).tolist() == [k for k in range(len(rows)) if "top" in rows.path(k)]
    assert order_of(rows, RowQuery(text="270.0 match bottom")).tolist() == [27]
    assert order_of(rows, RowQuery(text="nothing like it")).tolist() == []
    QTest.keyClicks(table.words, "270")
    assert listed(table) == ["27"]
    table.words.clear()
    assert len(listed(table)) == COUNT
    picked: list[int] = []
    table.gestures.picked.connect(picked.append)
    for _ in range(2):
        click_header(table, Column.HEADING)
    headings = [float(text.rstrip("°")) for text in listed(table, Column.HEADING)]
    assert headings == sorted(headings, reverse=True)
    table.view.scrollToTop()
    ui.push(table.view.viewport(), cell(table, 2))
    assert picked[-1] == int(listed(table)[2])
    ui.key(table.view, "Down")
    assert picked[-1] == int(listed(table)[3])
    matches = table.model.rows.counts()[Kind.MATCH]
    table.show_state(replace(shown, hidden=frozenset((Kind.MATCH,))))
    assert "match" not in listed(table, Column.CLASS)
    assert len(listed(table)) == COUNT - matches
    table.show_state(shown)
    assert len(listed(table)) == COUNT


def test_copied_rows_are_csv_in_metres_and_degrees_with_any_look(table: TableView, shown: Shown) -> None:
    notes = NoteTexts({27: 'a door, "open"', 3: "=1+1"})
    table.show_state(replace(shown, look=Look(unit=LengthUnit.FT), notes=notes))
    names = [table.model.headerData(column, Qt.Orientation.Horizontal) for column in Column]
    assert {"measured (ft)", "residual (in)"} <= set(names)
    assert listed(table, Column.MEASURED)[27] == f"{shown.readings[27].range / 0.3048:.2f}"
    table.copy_rows()
    assert QGuiApplication.clipboard().text() == rows_as_csv(shown.rows, range(COUNT), shown.sentence_of, notes)
    copied = clipboard_rows()
    first, silent = copied[27], copied[3]
    assert (first["heading_deg"], first["class"], first["path"]) == ("270.0000", "match", "bottom>top>bottom")
    assert float(first["measured_m"]) == pytest.approx(shown.readings[27].range, abs=1e-4)
    assert first["sentence"] == shown.sentence_of(27)
    assert [first["note"], silent["note"], copied[4]["note"]] == ['a door, "open"', text_cell("=1+1"), ""]
    assert (silent["measured_m"], silent["residual_m"], silent["class"]) == ("", "", "missed")
    table.words.setText("match")
    ui.push(table.copy)  # all listed rows, or the selected ones
    assert [row["number"] for row in clipboard_rows()] == listed(table)
    ui.push(table.view.viewport(), cell(table, 0))
    shift = Qt.KeyboardModifier.ShiftModifier
    QTest.mouseClick(table.view.viewport(), Qt.MouseButton.LeftButton, shift, pos=cell(table, 2))
    table.view.setFocus()
    ui.key(table.view, "Ctrl+C")
    assert [row["number"] for row in clipboard_rows()] == listed(table)[:3]


@pytest.mark.parametrize(
    ("width", "unit", "left_out"),
    [
        (430, LengthUnit.M, {Column.NUMBER, Column.PREDICTED, Column.SENTENCE}),  # on a small screen, beside a panel
        (430, LengthUnit.FT, {Column.PREDICTED, Column.SENTENCE}),
        (590, LengthUnit.CM, {Column.SENTENCE}),  # on a small screen
        (870, LengthUnit.M, set()),  # on a large one
    ],
)
def test_only_paths_and_sentences_are_cut_off_without_horizontal_scrolling(
    table: TableView, shown: Shown, width: int, unit: LengthUnit, left_out: set[Column]
) -> None:
    table.show_state(replace(shown, look=Look(unit=unit)))
    left_out = left_out | {Column.NOTE}  # there are no notes
    click_header(table, Column.RESIDUAL)
    for pixels in (300, 1500, 300, width):
        table.resize(pixels, 200)
    view, header = table.view, table.view.horizontalHeader()
    ui.until(lambda: view.viewport().width() > width - 40)
    assert view.horizontalScrollBar().maximum() == 0
    assert {column for column in Column if view.isColumnHidden(column)} == left_out
    assert header.sortIndicatorSection() == Column.RESIDUAL
    assert view.columnWidth(Column.PATH) >= view.fontMetrics().horizontalAdvance("bottom>top")
    for column in (column for column in Column if column < Column.PATH and column not in left_out):
        room = view.columnWidth(column) - 8
        name = table.model.headerData(column, Qt.Orientation.Horizontal)
        assert header.fontMetrics().horizontalAdvance(name) + 14 * (column is Column.RESIDUAL) <= room
        mark = 20 if column is Column.CLASS else 0
        assert max(map(view.fontMetrics().horizontalAdvance, listed(table, column))) + mark <= room


# the sentence


def test_a_long_sentence_is_shortened(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, scene: Scene) -> None:
    walls = ", ".join(["bottom", "top", "left", "right"] * 20)
    whole = f"0.827 m at 270.0°: {walls}; a later echo by {walls}; the near wall lies within blanking"
    monkeypatch.setattr(Shown, "sentence", whole)
    sentence = Sentence()
    qtbot.addWidget(sentence)
    sentence.resize(500, 60)
    with qtbot.waitExposed(sentence, timeout=ui.PATIENCE):
        sentence.show()

    def lines(label: QLabel) -> int:
        layout = QTextLayout(label.text(), label.font())
        layout.beginLayout()
        count = 0
        while (line := layout.createLine()).isValid():
            line.setLineWidth(sentence.width())
            count += 1
        layout.endLayout()
        return count

    seen = []
    for scale in (0.7, 1.0, 1.3, 1.6, 2.0):
        sentence.show_state(Shown(scene, look=replace(Look(), scale=scale)))
        head, why = sentence.head.text(), sentence.why.text()
        assert (lines(sentence.head), lines(sentence.why)) == (2, 1)
        assert head.endswith("…")
        assert whole.startswith(head[:-1])
        assert why.endswith("…")
        assert whole.partition("; ")[2].startswith(why[:-1])
        assert (sentence.text(), sentence.toolTip()) == (whole, whole)
        for label, most in ((sentence.head, 2), (sentence.why, 1)):
            assert most * QFontMetricsF(label.font()).lineSpacing() <= label.height()
        seen.append((sentence.why.height(), -len(why)))
    assert seen == sorted(seen)  # larger text: higher, and less of it
    monkeypatch.setattr(Shown, "sentence", f"0.827 m at 270.0°; {walls}")  # a short head leaves two lines
    sentence.show_state(Shown(scene))
    assert (lines(sentence.head), lines(sentence.why)) == (1, 2)
    monkeypatch.setattr(Shown, "sentence", whole)
    sentence.show_state(Shown(scene))
    sentence.resize(20000, sentence.height())
    ui.until(lambda: "; ".join((sentence.head.text(), sentence.why.text())) == whole)
    assert sentence.toolTip() == ""
    assert shortened_to_lines("0.827 m at 270.0°", sentence.font(), 500, 2) == "0.827 m at 270.0°"


def test_the_card_leads_from_a_misfit_to_its_causes_and_to_all_echoes(window: MainWindow) -> None:
    session, find = window.session, window.card.misfit_buttons[0]
    matches = [session.shown.row(k).kind is Kind.MATCH for k in range(len(session.shown.readings))]
    session.showing.choose(matches.index(True))
    ui.until(lambda: not find.isVisible())
    session.showing.edit(*sensor_at(session.shown.scene, (0.6, 0.2)))

    def misfits() -> list[int]:
        rows = [session.shown.row(k) for k in range(len(matches))]
        return [k for k, row in enumerate(rows) if row is not None and row.kind in MISFITS]

    ui.until(lambda: ui.predicted(window) and misfits())
    session.showing.choose(misfits()[0])
    ui.until(find.isVisible)
    ui.key(window, "Ctrl+Shift+L")
    ui.until(lambda: window.views.echo_list.isVisible() and not window.views.echo_list.visibleRegion().isEmpty())
    ui.push(find)
    ui.until(lambda: session.causes.state.running)
    assert not window.causes.visibleRegion().isEmpty()
    ui.push(window.causes.cancel)
    ui.until(lambda: not session.causes.state.running)


# dense scans

DENSE = 3600
Stretches = tuple[tuple[int, tuple[Reading, ...]], ...]


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[threading.Event, list[int]]]:
    """Let only comparisons with the last stretch through until the event is set; list the first reading of each."""
    gate, requests, compare = threading.Event(), list[int](), forecast.compare_stretches

    def compare_later(found: PathsFound, stretches: Stretches, *begin: object) -> tuple[Stretch, ...]:
        if stretches and all(first + len(readings) < DENSE for first, readings in stretches):
            gate.wait()
        requests.extend(first for first, _ in stretches[:1])
        return compare(found, stretches, *begin)

    monkeypatch.setattr(forecast, "compare_stretches", compare_later)
    yield gate, requests
    gate.set()


def test_a_dense_scan_is_compared_from_the_selected_reading_on_and_its_classes_can_be_hidden(
    open_with: OpenWith, scene: Scene, tmp_path: Path, held: tuple[threading.Event, list[int]]
) -> None:
    gate, requests = held
    log = dense_log(tmp_path / "dense.mcap", scene, DENSE)
    window = open_with(source=log)
    session, views, activity = window.session, window.views, window.status_bar.activity
    ui.until(lambda: session.shown.row(DENSE - 1) is not None)
    assert session.shown.row(0) is None
    assert set(session.shown.classes) >= {Unclassed.WAITING, Kind.MATCH}
    assert 0 < len(session.shown.classes[Unclassed.WAITING].readings) <= DENSE - STRETCH
    ui.until(lambda: "readings to compare" in activity.text())
    assert window.legend.entries[Unclassed.WAITING].text().endswith(" waiting")
    assert LIGHT.of(Unclassed.WAITING) not in {LIGHT.of(kind) for kind in Kind}
    session.showing.choose(5)
    before = len(requests)
    gate.set()
    ui.until(lambda: ui.predicted(window))
    assert 0 in requests[before : before + 2]  # the request that was already waiting has the next stretch at the end
    assert Unclassed.WAITING not in session.shown.classes
    ui.until(lambda: "to compare" not in activity.text())
    expected = compare_readings(log.readings, scene.room, scene.pose, scene.board)  # as the command does
    assert [session.shown.row(k).kind for k in range(DENSE)] == [row.kind for row in expected.rows]
    assert expected.rows[SHORT.start].kind is Kind.SHORT
    assert not any("being compared" in session.shown.sentence_of(k) for k in (0, DENSE // 2, DENSE - 1))

    def classes() -> set[str]:
        model = views.table.model
        return {model.data(model.index(row, Column.CLASS)) for row in range(0, model.rowCount(), 10)}

    entry = window.legend.entries[Kind.SHORT]
    assert entry.text() == f"{sum(row.kind is Kind.SHORT for row in expected.rows)} short"
    marks = [views.plan.drawing.marks, *views.ranges.marks]
    for visible in (False, True):
        ui.push(entry)
        ui.until(lambda visible=visible: ("short" in classes()) is visible)
        assert [Kind.SHORT in one.placed for one in marks] == [visible] * len(marks)
        assert entry.accessibleName().endswith("shown" if visible else "hidden")

    # marks keep the colour of their class: outlines in the colour of the paper would cover their neighbours
    session.showing.switch(ViewLayer.PREDICTED, False)
    drawing = views.plan.drawing
    drawing.plot.vb.autoRange()
    ui.pause(50)
    image, ratio, positions = drawing.viewport().grab().toImage(), drawing.devicePixelRatioF(), ui.drawn(drawing.marks)
    for reading, kind in (((SHORT.start + SHORT.stop) // 2, Kind.SHORT), (SHORT.stop + 200, Kind.MATCH)):
        at = ui.pixel_at(drawing, drawing.plot.vb, positions[reading])
        colour = image.pixelColor(round(at.x() * ratio), round(at.y() * ratio))
        own = QColor(session.shown.look.palette.of(kind)).getRgb()
        assert colour.getRgb() == pytest.approx(own, abs=30)  # lines of the grid are drawn over the marks
