"""The view "Trace": measured and predicted trace of the selected reading, with blanking, gain, threshold and echoes.

The bottom axis is time; the top axis is the range at that time.
"""

from functools import partial

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Slot
from PySide6.QtGui import QActionGroup
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget
from sonarhw_compare.scans import heading_text
from sonarhw_sim.air import Air

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import ViewLayer
from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.label_slot import LabelSlot
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.plots.canvas import Canvas, new_plot
from sonarhw_gui.plots.plot_look import cosmetic_pen, label_axis
from sonarhw_gui.plots.view_actions import add_buttons, view_action
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.initial_range import initial_range
from sonarhw_gui.shown.shown import Cursor, Shown
from sonarhw_gui.trace.echo_names import EchoNames
from sonarhw_gui.trace.trace_axes import EMPTY, GainAxis, HeightAxis, Heights, UnitAxis, heights_of, signal_curve
from sonarhw_gui.trace.trace_cursors import TraceCursors
from sonarhw_gui.trace.trace_marks import TraceMarks
from sonarhw_gui.trace.trace_sound import TraceSound
from sonarhw_gui.view import Gestures, ViewEntry
from sonarhw_gui.work.chosen_trace import ChosenTrace, Curve

_LOWEST = 120  # pixels, minimum height at the default text size; leaves room for the axis labels
_STEPS = 200  # key presses that move a cursor across the view


class TraceView(QWidget):
    """Draws the trace of the selected reading."""

    entry = ViewEntry("Trace", picture_key="Ctrl+Alt+T", menu="Trace")

    def __init__(self) -> None:
        super().__init__()
        self.gestures = Gestures(self)
        self._shown: Shown | None = None
        self._look = Look()
        self._trace: ChosenTrace | None = None
        self._duration, self._heights = 0.0, EMPTY
        self.envelope = view_action(self, "Envelope", "V", "Show the envelope in dB")
        self.rf = view_action(self, "RF", "R", "Show the signal with its carrier")
        self.forms = QActionGroup(self)
        for form in (self.envelope, self.rf):
            self.forms.addAction(form)
        self.envelope.setChecked(True)
        self.cursors_shown = view_action(self, "Cursors", "C", "Show two cursors for time and range; drag to move")
        self.title, self.readout = ElidedLabel(), PlainLabel()
        self.title.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        gain_axis = GainAxis()
        self._times, self._ranges, self._levels = UnitAxis("bottom"), UnitAxis("top"), HeightAxis()
        axes = {"left": self._levels, "right": gain_axis, "top": self._ranges, "bottom": self._times}
        self.plot = new_plot(axes, zooms_height=False)
        self.canvas = Canvas(self.plot)
        self._predicted, self._measured = _curve_item(), _curve_item()
        for item in (self._predicted, self._measured):
            self.plot.addItem(item, ignoreBounds=True)
        self.marks = TraceMarks(self.plot, gain_axis)
        self.sound = TraceSound(self.plot)
        self.names = EchoNames(self.plot.vb)
        self.cursors = TraceCursors(self.plot, self)
        self._pointer = pg.InfiniteLine(angle=90)
        self.plot.addItem(self._pointer, ignoreBounds=True)
        self._arrange()
        self._connect()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if before is None or before.trace is not shown.trace or _marked(before) != _marked(shown):
            self.canvas.repaint_whole()
        if shown.changed_since(before, "look"):
            self._set_look(shown.look)
        if shown.changed_since(before, "trace", "look"):
            self._draw(shown.trace)
        self._show_layers(shown)
        if shown.trace is None and not self._duration:
            self._show_board_range(shown.scene)
        self._update_title()
        if before is None or _moved(before, shown):
            self.sound.draw(shown.sound, self._heights)
        self._point(shown.cursor)

    def _arrange(self) -> None:
        row = QHBoxLayout()
        row.setContentsMargins(8, 2, 8, 0)
        row.setSpacing(3)
        row.addWidget(LabelSlot(self.title), stretch=1)
        add_buttons(row, (self.envelope, self.rf, self.cursors_shown))
        self.readout.setVisible(False)
        self.readout.setContentsMargins(8, 0, 8, 2)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(row)
        column.addWidget(self.canvas, stretch=1)
        column.addWidget(self.readout)

    def _connect(self) -> None:
        self.forms.triggered.connect(self._redraw)
        self.cursors_shown.toggled.connect(self._show_cursors)
        self.cursors.moved.connect(self._read_cursors)
        self.canvas.hovered.connect(self._point_at)
        for which, name in enumerate("AB"):
            for side, by in (("Left", -1), ("Right", 1)):
                key = f"Alt+Shift+{side}" if which else f"Alt+{side}"
                action = view_action(
                    self, f"Cursor {name} {side.lower()}", key, "Move the cursor by a small step", checkable=False
                )
                action.triggered.connect(partial(self._step_cursor, which, by))

    def picture(self) -> QWidget:
        """Return the plot with its title."""
        return self

    def _set_look(self, look: Look) -> None:
        self._look = look
        colours = look.palette
        self.canvas.set_look(look)
        self.canvas.setMinimumHeight(round(_LOWEST * look.scale))
        self._times.set_unit("ms", 1e3)
        gain = self.plot.getAxis("right")
        label_axis(gain, "gain (dB)")
        for axis in (gain, self._ranges):
            axis.setGrid(False)
        self._predicted.setPen(cosmetic_pen(colours.predicted, width=1, style=Qt.PenStyle.DashLine))
        self._measured.setPen(cosmetic_pen(colours.measured, width=1))
        self._pointer.setPen(cosmetic_pen(colours.chosen, width=1, style=Qt.PenStyle.DotLine))
        for part in (self.marks, self.names, self.cursors, self.sound):
            part.set_look(look)

    def _draw(self, trace: ChosenTrace | None) -> None:
        self._trace = trace
        rf = self.rf.isChecked()
        self._heights = heights = heights_of(trace, rf) if trace else EMPTY
        self._levels.set_heights(heights)
        unit = self._look.unit
        self._ranges.set_unit(unit.label, (trace.speed if trace else Air().speed_of_sound) / 2 * unit.per_metre)
        for item, sound in (
            (self._measured, trace.measured if trace else None),
            (self._predicted, trace.predicted if trace else None),
        ):
            curve = None if sound is None else signal_curve(sound) if rf else sound.envelope
            _set_curve(item, curve, heights)
        self.marks.draw(trace, heights, self._look)
        self.names.draw(trace.echoes if trace else (), heights)
        self._update_title()
        self._measured.setZValue(1 if rf else -1)
        if trace is not None:
            self._set_time_range(trace)
        self._read_cursors()

    def _show_layers(self, shown: Shown) -> None:
        self._measured.setVisible(shown.draws(ViewLayer.TRACE))
        self._predicted.setVisible(shown.draws(ViewLayer.PREDICTED))
        self.names.set_visible(shown.draws(ViewLayer.PREDICTED))
        self.marks.set_visible(shown)

    def _update_title(self) -> None:
        shown = self._shown
        due = None if shown is None else shown.due_heading
        self.title.setText(_title(self._trace, self.rf.isChecked(), due, shown is not None and shown.asked is not None))

    @Slot()
    def fit(self) -> None:
        """Show all of the trace."""
        if self._trace is not None:
            self.plot.setXRange(0.0, self._trace.duration, padding=0)

    def _set_time_range(self, trace: ChosenTrace) -> None:
        if self._duration == trace.duration or self._shown is None:
            return  # keep the zoom from one reading to the next
        self._duration = trace.duration
        farthest = initial_range(self._shown)
        end = trace.duration if farthest is None else min(trace.duration, trace.time_at(farthest))
        self.plot.setLimits(xMin=0.0, xMax=trace.duration)
        self.plot.setXRange(0.0, end, padding=0)
        self.cursors.fit(trace.duration, end)

    def _show_board_range(self, scene: Scene) -> None:
        air = scene.room.air if scene.room else Air()
        self.plot.setXRange(0.0, 2 * scene.board.max_range / air.speed_of_sound, padding=0)

    @Slot()
    def _redraw(self) -> None:
        self._draw(self._trace)

    @Slot(bool)
    def _show_cursors(self, shown: bool) -> None:
        self.cursors.show(shown)
        self.readout.setVisible(shown)
        self._read_cursors()

    def _step_cursor(self, which: int, by: int) -> None:
        left, right = self.plot.viewRange()[0]
        self.cursors_shown.setChecked(True)
        self.cursors.step(which, by * (right - left) / _STEPS)

    @Slot()
    def _read_cursors(self) -> None:
        if self._trace is not None:
            self.readout.setText(self.cursors.text(self._trace, self._look))

    @Slot(object)
    def _point_at(self, position: QPointF | None) -> None:
        box = self.plot.vb
        if position is None:
            self.gestures.pointed.emit(None)
        elif self._trace is not None and box.sceneBoundingRect().contains(position):
            time = box.mapSceneToView(position).x()
            self.gestures.pointed.emit(Cursor(self._trace.heading, self._trace.range_at(time)))

    def _point(self, cursor: Cursor | None) -> None:
        self._pointer.setVisible(cursor is not None and self._trace is not None)
        if cursor is not None and self._trace is not None:
            self._pointer.setValue(self._trace.time_at(cursor.range))


def _marked(shown: Shown) -> tuple[object, ...]:
    return shown.cursor, shown.hidden, None if shown.sound is None else shown.sound.time


def _moved(before: Shown, shown: Shown) -> bool:
    """Return whether the sound is at another moment, or its mark at another height."""
    return before.sound is not shown.sound or (shown.sound is not None and before.trace is not shown.trace)


def _curve_item() -> pg.PlotDataItem:
    # draws the highest and the lowest of all samples at one pixel
    return pg.PlotDataItem(connect="finite", autoDownsample=True, downsampleMethod="peak", clipToView=True)


def _set_curve(item: pg.PlotDataItem, curve: Curve | None, heights: Heights) -> None:
    if curve is None:
        item.setData(np.empty(0), np.empty(0))
    else:
        # the board's own burst is louder than any echo
        item.setData(curve.times, curve.values.clip(heights.bottom, heights.top))


def _title(trace: ChosenTrace | None, rf: bool, due: float | None = None, asked: bool = False) -> str:
    """Return the title; `due` is the selected heading, which may differ until its trace is computed."""
    if trace is None:
        return "Trace: no reading yet"
    parts = [f"Trace at {heading_text(trace.heading)}"]
    if due is not None and heading_text(due) != heading_text(trace.heading):
        parts.append(f"{heading_text(due)} is being computed")
    if trace.measured is None:
        parts.append("predicted only" if asked else "no trace recorded")
    elif rf and trace.measured.rf is None:
        parts.append("recorded: envelope only")
    if trace.predicted is None:
        parts.append("no prediction")
    elif rf and trace.predicted.undersampled:
        parts.append(f"both undersampled at {trace.predicted.rate / 1e3:.1f} kHz")
    if trace.gain.stepped:
        parts.append("stepped gain")
    return " · ".join(parts)
