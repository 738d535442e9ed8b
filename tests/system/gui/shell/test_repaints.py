"""Hundreds of repaints do not change the reference count of None (some PySide6 versions lose or leak references)."""

import gc
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot
from sonarhw_gui.session.session import Turns
from sonarhw_gui.views.base import Canvas, PlotAxis

from sonarhw.log import read_log
from tests.conftest import Count
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import begin_drag, pixel_at, predicted, until

REPAINTS = 120, 10_000  # by default, in a soak test
NOISE = 60  # normal variation; a leak adds one or more references per item and repaint


def test_repaints_do_not_leak_references_to_none(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, count: Count
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    views = (window.views.plan.drawing, window.views.trace.canvas, window.views.ranges)

    def repaint(times: int) -> None:
        for k in range(times):
            window.session.showing.choose(k % ORDER.readings)
            for view in views:
                view.viewport().repaint()

    repaint(ORDER.readings)
    gc.collect()
    before = sys.getrefcount(None)
    repaint(count(*REPAINTS))
    gc.collect()
    assert abs(sys.getrefcount(None) - before) < NOISE


def test_texts_take_turns_and_each_shows_the_last_change(qtbot: QtBot) -> None:
    owner, state, drawn = QObject(), [0], []

    def draw(part: int) -> None:
        drawn.append((part, state[0]))
        if len(drawn) == 1:  # a change after the first part was drawn
            state[0] = 1
            turns.soon()

    turns = Turns([partial(draw, part) for part in range(3)], 1, owner)
    turns.soon()
    until(qtbot, lambda: len(drawn) >= 4)
    assert drawn == [(0, 0), (1, 1), (2, 1), (0, 1)]
    turns.soon()
    turns.all_now()
    assert [part for part, _ in drawn[4:]] == [0, 1, 2]
    qtbot.wait(20)
    assert len(drawn) == 7  # without a change, nothing is due


def test_each_frame_updates_one_part_and_the_others_follow_the_last_frame(qtbot: QtBot) -> None:
    owner, drawn = QObject(), []
    turns = Turns([partial(drawn.append, part) for part in range(3)], 1, owner)
    turns.advance()
    turns.advance()
    assert drawn == [0, 1]
    until(qtbot, lambda: len(drawn) >= 4)
    qtbot.wait(20)
    assert drawn == [0, 1, 2, 0]  # each part was updated after the last frame


class LayoutRequests(QObject):
    """Counts the layouts of a widget."""

    def __init__(self, widget: QWidget) -> None:
        super().__init__(widget)
        self.count = 0
        widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        self.count += event.type() is QEvent.Type.LayoutRequest
        return False


def test_a_drag_of_the_sensor_lays_out_no_view(qtbot: QtBot, open_with: OpenWith) -> None:
    """The place beside the tools changes with every move, and a layout reaches the whole window."""
    window = open_with()
    until(qtbot, lambda: predicted(window))
    plan, texts = window.views.plan.drawing, set()
    start = tuple(window.session.shown.scene.pose.position)
    begin_drag(qtbot, plan, plan.plot.vb, start, (0.6, 0.3))
    qtbot.wait(1)
    requests = LayoutRequests(window.views.plan)
    for x in (0.5, 0.45, 0.4, 0.35, 0.3):
        qtbot.mouseMove(plan.viewport(), pixel_at(plan, plan.plot.vb, (x, 0.3)))
        until(qtbot, lambda before=set(texts): window.views.plan.message.text() not in before)
        texts.add(window.views.plan.message.text())
        qtbot.wait(1)  # a layout is a posted event
    qtbot.mouseRelease(plan.viewport(), Qt.MouseButton.LeftButton)
    assert (len(texts), requests.count) == (5, 0)


class Events(QObject):
    """Lists the paints of widgets and of their window in order."""

    def __init__(self, window: QWidget, **parts: QWidget) -> None:
        super().__init__(window)
        self.names: list[str] = []
        self._of = {window: "window", **{part: name for name, part in parts.items()}}
        for widget in self._of:
            widget.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() is (QEvent.Type.UpdateRequest if self._of[watched] == "window" else QEvent.Type.Paint):
            self.names.append(self._of[watched])
        return False


def test_the_sentence_and_new_rows_are_painted_in_one_frame(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    replay, table = window.session.replay, window.views.table.view
    replay.seek(0.9 * replay.duration)
    window.session.showing.choose(0)
    qtbot.wait(60)  # two ticks
    events = Events(window, sentence=window.sentence, rows=table.viewport())
    replay.step(1)
    until(qtbot, lambda: "rows" in events.names)
    assert events.names[:2] == ["window", "rows"]
    window.session.showing.choose(1)
    until(qtbot, lambda: "sentence" in events.names)
    qtbot.wait(60)
    assert events.names.count("sentence") == 1


def test_axes_cover_the_area_that_pyqtgraph_computes(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    drawing, look = window.views.plan.drawing, window.session.shown.look
    for change in (
        lambda: window.resize(1500, 900),
        lambda: drawing.zoom(1e-3),
        lambda: window.session.showing.set_look(replace(look, scale=1.5)),
        lambda: window.views.ranges.ranges.showGrid(x=False, y=False),
        lambda: window.resize(1024, 700),
    ):
        change()
        qtbot.wait(60)  # two ticks
        items = (item for canvas in window.findChildren(Canvas) for item in canvas.scene().items())
        axes = [axis for axis in items if isinstance(axis, PlotAxis) and axis.isVisible()]
        assert len(axes) >= 10
        assert [axis.boundingRect() for axis in axes] == [pg.AxisItem.boundingRect(axis) for axis in axes]
