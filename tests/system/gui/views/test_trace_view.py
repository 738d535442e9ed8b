"""The trace view: consistent axes, separate names, carrier and cursors by key, and the linked cursor."""

import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs.traces import chosen_trace
from sonarhw_gui.model.look import DARK, LengthUnit, Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Cursor, Shown
from sonarhw_gui.views.trace import TraceView
from sonarhw_gui.window.start import open_application
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import RoomEchoes

from sonarhw.readings import Ping, Reading
from tests.system.gui.driving import activate, drag, pixel_at, until

HEADING = math.radians(270.0)


@pytest.fixture(scope="module")
def shown(scene: Scene, echoes: RoomEchoes) -> Shown:
    ping = echoes.receive(Ping(HEADING, 0, 0, 0.0115, trace=True))
    reading = Reading(0, 0, 0, HEADING, 0.0, ping.echo_times, 343.2, trace=ping.trace)
    prediction = predict_scan(scene.room, scene.pose, scene.board, np.array([HEADING]))
    trace = chosen_trace(scene, reading, prediction, 0)
    return Shown(scene, readings=(reading,), chosen=0, trace=trace)


@pytest.fixture
def view(qtbot: QtBot, shown: Shown) -> TraceView:
    open_application()
    view = TraceView()
    qtbot.addWidget(view)
    view.resize(900, 400)
    activate(qtbot, view)
    view.show_state(shown)
    until(qtbot, lambda: view.plot.vb.width() > 600)
    return view


@pytest.mark.parametrize(("unit", "metres"), [(LengthUnit.M, 1.0), (LengthUnit.CM, 0.01), (LengthUnit.FT, 0.3048)])
def test_the_top_axis_shows_the_range_at_the_time_below(
    view: TraceView, shown: Shown, unit: LengthUnit, metres: float
) -> None:
    view.show_state(replace(shown, look=Look(unit=unit)))
    for spacing, times in view._ranges.tickValues(0.0, shown.trace.duration, 800.0)[:1]:
        for time, text in zip(times, view._ranges.tickStrings(times, view._ranges.scale, spacing), strict=True):
            figure, name = text.split(" ")
            assert name == unit.label
            assert float(figure) * metres == pytest.approx(
                343.2 * time / 2, abs=0.51 * metres * 10 ** -_decimals(figure)
            )


def _decimals(figure: str) -> int:
    return len(figure.partition(".")[2])


def test_the_tooltip_of_an_echo_says_whether_its_level_is_a_sum(view: TraceView, shown: Shown) -> None:
    alone = [replace(echo, summed=False) for echo in shown.trace.echoes]
    for echoes, sums in ((shown.trace.echoes, True), (alone, False)):
        view.names.draw(echoes, view.names._heights)
        tips = [tip for heads in view.names._heads.values() for tip in heads.about]
        assert len(tips) >= 3
        assert all(("dB, sum of all arrivals within one wavelength" in tip) == sums for tip in tips)


def test_names_of_echoes_do_not_overlap(view: TraceView) -> None:
    names = [item for item in view.names._items if item.isVisible()]
    assert len(names) >= 3
    # a pixel of rounding on each side
    boxes = [item.mapRectToScene(item.boundingRect()).adjusted(1, 1, -1, -1) for item in names]
    assert not [1 for k, one in enumerate(boxes) for other in boxes[:k] if one.intersects(other)]


def test_every_mark_is_at_the_time_of_its_echo(view: TraceView, shown: Shown) -> None:
    x = np.concatenate([heads.getData()[0] for heads in view.names._heads.values()])
    assert sorted(x) == sorted(echo.time for echo in shown.trace.echoes)
    assert view.marks._blanking.getRegion() == (0.0, shown.scene.board.blanking)
    reported, height = view.marks._reported.getData()
    assert reported.tolist() == list(shown.readings[0].echo_times)
    assert set(height) == {shown.scene.board.threshold_db}


def test_keys_switch_between_carrier_and_envelope(qtbot: QtBot, view: TraceView, shown: Shown) -> None:
    assert "dB" in view.plot.getAxis("left").labelText
    qtbot.keyClick(view, Qt.Key.Key_R)
    until(qtbot, lambda: "signal" in view.plot.getAxis("left").labelText)
    _, drawn = view._predicted.getOriginalDataset()
    assert drawn.min() < -0.02
    assert drawn.max() > 0.02
    assert "envelope only" in view.title.text()
    qtbot.keyClick(view, Qt.Key.Key_V)
    until(qtbot, lambda: "dB" in view.plot.getAxis("left").labelText)
    assert view._predicted.getOriginalDataset()[1].max() <= 0


def test_a_title_that_does_not_fit_ends_in_an_ellipsis_and_is_complete_in_the_tooltip(view: TraceView) -> None:
    whole, title = "Trace at 355.0° · no trace recorded · no prediction", view.title
    title.resize(160, 24)
    title.setText(whole)
    assert title.toolTip() == whole
    drawn = title.grab().toImage()
    title.setText(title.fontMetrics().elidedText(whole, Qt.TextElideMode.ElideRight, 160))
    assert title.text().endswith("…")
    assert title.grab().toImage() == drawn


def test_two_cursors_show_time_range_and_differences(qtbot: QtBot, view: TraceView, shown: Shown) -> None:
    assert not view.readout.isVisible()
    qtbot.keyClick(view, Qt.Key.Key_C)
    until(qtbot, view.readout.isVisible)
    for start, end in zip(view.cursors.times, (0.002, 0.005), strict=True):
        drag(qtbot, view.canvas, view.plot.vb, (start, -20.0), (end, -20.0))
    first, second = view.cursors.times
    assert (first, second) == pytest.approx((0.002, 0.005), abs=3e-5)
    read = [float(figure) for figure in re.findall(r"-?\d+\.\d+", view.readout.text())]
    expected = [first * 1e3, first * 171.6, second * 1e3, second * 171.6]
    assert read == pytest.approx([*expected, (second - first) * 1e3, (second - first) * 171.6], abs=0.006)


def test_keys_move_the_cursors(qtbot: QtBot, view: TraceView) -> None:
    before = view.cursors.times
    qtbot.keyClick(view, Qt.Key.Key_Right, Qt.KeyboardModifier.AltModifier)
    qtbot.keyClick(view, Qt.Key.Key_Left, Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.ShiftModifier)
    assert view.readout.isVisible()
    assert view.cursors.times[0] > before[0]
    assert view.cursors.times[1] < before[1]


def test_the_mouse_points_at_a_range_of_the_chosen_heading(qtbot: QtBot, view: TraceView) -> None:
    cursors: list[Cursor | None] = []
    view.gestures.pointed.connect(cursors.append)
    qtbot.mouseMove(view.canvas.viewport(), pixel_at(view.canvas, view.plot.vb, (0.004, -20.0)))
    until(qtbot, lambda: bool(cursors) and cursors[-1] is not None)
    assert cursors[-1].range == pytest.approx(0.6864, abs=0.01)
    assert math.degrees(cursors[-1].heading) % 360 == pytest.approx(270.0)


def test_the_cursor_of_another_view_is_drawn_at_its_time(view: TraceView, shown: Shown) -> None:
    view.show_state(replace(shown, cursor=Cursor(0.3, 0.5)))
    assert view._pointer.isVisible()
    assert view._pointer.value() == pytest.approx(2 * 0.5 / 343.2)
    view.show_state(replace(shown, cursor=None))
    assert not view._pointer.isVisible()


def test_a_zoom_stays_for_the_next_reading_until_fit_view(view: TraceView, shown: Shown) -> None:
    view.plot.setXRange(0.002, 0.003, padding=0)
    view.show_state(replace(shown, trace=replace(shown.trace)))
    assert view.plot.viewRange()[0] == pytest.approx([0.002, 0.003])
    view.fit()
    assert view.plot.viewRange()[0] == pytest.approx([0.0, shown.trace.duration])


@pytest.mark.parametrize(
    "draw", [lambda shown: replace(shown, look=Look(palette=DARK)), lambda shown: replace(shown, trace=None)]
)
def test_a_changed_palette_or_a_missing_trace_is_drawn(
    qtbot: QtBot, view: TraceView, shown: Shown, draw: Callable[[Shown], Shown]
) -> None:
    view.show_state(draw(shown))
    image = view.canvas.grab().toImage()
    assert image.pixelColor(3, 3).name().upper() == draw(shown).look.palette.paper


def test_before_the_first_reading_the_axes_extend_to_the_maximum_range(qtbot: QtBot, scene: Scene) -> None:
    view = TraceView()
    qtbot.addWidget(view)
    view.show_state(Shown(scene))
    begin, end = view.plot.viewRange()[0]
    assert begin == 0.0
    assert end * scene.room.air.speed_of_sound / 2 == pytest.approx(scene.board.max_range)


def test_the_title_of_a_late_trace_names_the_next_one(view: TraceView, shown: Shown) -> None:
    newest = replace(shown.readings[0], number=1, angle=shown.readings[0].angle + math.radians(5))
    assert "being computed" not in view.title.text()
    view.show_state(replace(shown, readings=(*shown.readings, newest), chosen=1))
    assert f"{math.degrees(shown.heading(0) + math.radians(5)) % 360:.1f}° is being computed" in view.title.text()
