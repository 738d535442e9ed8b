"""The view "Trace": measured and predicted trace of the selected reading, with blanking, gain, threshold and echoes.

The bottom axis is time; the top axis is the range at that time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt, Slot
from PySide6.QtGui import QActionGroup, QFont, QFontMetricsF
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget
from sonarhw_sim.air import Air

from sonarhw.errors import heading_text
from sonarhw.readings import FloatArray
from sonarhw_gui.jobs.traces import ChosenTrace, Curve, NamedEcho, TraceCurves
from sonarhw_gui.model.look import Look, ViewLayer
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Cursor, Shown, SoundState, initial_range
from sonarhw_gui.views import base
from sonarhw_gui.views.marks import PlotLine, Spots, TipSpots
from sonarhw_gui.widgets import ElidedLabel, LayoutBarrier, PlainLabel, arranged

# Axes of the trace view. Their height is a level in dB or a signal amplitude.


_ROUNDING = 1e-9
_LIMITS = 0.02, 0.05, 0.1, 0.2, 0.5, 1.0  # of full scale


@dataclass(frozen=True)
class Heights:
    """The height scale of a plot of traces. Names of echoes are above `top`."""

    decibels: bool
    bottom: float
    top: float

    def of(self, level_db: float) -> float:
        """Return the height of a level, dB of full scale."""
        height = level_db if self.decibels else 10 ** (level_db / 20)
        return min(max(height, self.bottom), self.top)

    @property
    def label(self) -> str:
        """The label of the axis with its unit."""
        return "dB of full scale" if self.decibels else "signal (of full scale)"


EMPTY = Heights(True, -52.0, 0.0)


def heights_of(trace: ChosenTrace, rf: bool) -> Heights:
    """Return the scale for a trace: levels from the floor up, or `rf` up to the loudest signal after blanking."""
    if not rf:
        return Heights(True, trace.floor_db, 0.0)
    loudest = max((_loudest(sound, trace.blanking) for sound in (trace.measured, trace.predicted) if sound), default=1)
    # in steps, so that the axis rarely changes between readings
    limit = next(step for step in _LIMITS if step >= min(1.0, loudest))
    return Heights(False, -limit, limit)


def _loudest(sound: TraceCurves, after: float) -> float:
    levels = sound.envelope.values[sound.envelope.times >= after]
    finite = levels[np.isfinite(levels)]
    return float(10 ** (finite.max() / 20)) if len(finite) else 0.0


def signal_curve(sound: TraceCurves) -> Curve:
    """Return the signal with its carrier; without a carrier, the envelope above and below zero."""
    if sound.rf is not None:
        return sound.rf
    times, levels = sound.envelope.times, 10 ** (sound.envelope.values / 20)
    gap = np.array([np.nan])
    return Curve(np.concatenate((times, gap, times)), np.concatenate((levels, gap, -levels)))


class TickAxis(base.PlotAxis):
    """An axis with a unit behind its tick values, which takes less height than a label, or without high tick values."""

    def __init__(self, side: str) -> None:
        super().__init__(side)
        self._unit, self._highest = "", np.inf
        self.heights: Heights | None = None

    def set_unit(self, unit: str, scale: float) -> None:
        """Show tick values in `unit`; `scale` converts from plot coordinates."""
        self.setScale(scale)
        if unit != self._unit:
            self._unit = unit
            self.picture = None

    def set_heights(self, heights: Heights) -> None:
        """Label the axis for a height scale, without tick values above its top, where names are drawn."""
        if heights != self.heights:
            self.heights, self._highest = heights, heights.top + _ROUNDING
            base.label_axis(self, heights.label)

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the tick values with their unit; empty above the highest."""
        texts = zip(super().tickStrings(values, scale, spacing), values, strict=True)
        return [f"{text} {self._unit}".rstrip() if value <= self._highest else "" for text, value in texts]


class GainAxis(base.PlotAxis):
    """Axis in dB for the gain curve, which is scaled to the height range of the traces."""

    def __init__(self) -> None:
        super().__init__("right")
        self._low, self._per_height, self._bottom, self._top = 0.0, 1.0, 0.0, 1.0

    def heights_of_gains(self, gains: FloatArray, heights: Heights) -> FloatArray:
        """Return the heights, (n,) float, of gains (n,) in dB, and scale the axis for them."""
        low, high = float(gains.min()), float(gains.max())
        per_height = max(high - low, 1.0) / (heights.top - heights.bottom)
        written = low, per_height, heights.bottom, heights.top
        if written != (self._low, self._per_height, self._bottom, self._top):
            self._low, self._per_height, self._bottom, self._top = written
            self.picture = None  # redraw the axis
            self.update()
        return np.asarray(heights.bottom + (gains - low) / per_height)

    def tickValues(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, list[float]]]:
        """Return the heights of round dB values."""
        low, high = (self._gain(height) for height in (minVal, min(maxVal, self._top)))
        if not low < high:
            return []
        levels = super().tickValues(low, high, size * (high - low) / max(self._gain(maxVal) - low, 1e-9))
        spacing, gains = levels[0]
        return [(spacing, [self._bottom + (gain - self._low) / self._per_height for gain in gains])]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the gains at these heights, dB."""
        return [f"{round(self._gain(value))}" for value in values]

    def _gain(self, height: float) -> float:
        return self._low + (height - self._bottom) * self._per_height


# Two cursors in the trace that show time, range and their differences. Mouse and keys move them.


_AT = 1 / 3, 2 / 3  # initial positions, shares of the visible trace
_NAMES = "AB"


class TraceCursors:
    """Cursors A and B of one plot."""

    def __init__(self, plot: pg.PlotItem, moved: Callable[[], None]) -> None:
        """`moved` is called when one of them was moved."""
        self._lines = [_line(name) for name in _NAMES]
        self._duration = 0.0
        for line in self._lines:
            line.setVisible(False)
            plot.addItem(line, ignoreBounds=True)
            line.sigPositionChanged.connect(moved)

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        for line in self._lines:
            line.setPen(base.cosmetic_pen(look.palette.chosen, width=1))
            line.setHoverPen(base.cosmetic_pen(look.palette.chosen, width=3))
            line.label.setColor(look.palette.paper)
            line.label.fill = pg.mkBrush(look.palette.chosen)

    def show(self, shown: bool) -> None:
        """Show or hide them."""
        for line in self._lines:
            line.setVisible(shown)

    @property
    def times(self) -> list[float]:
        """The positions, s."""
        return [line.value() for line in self._lines]

    def fit(self, duration: float, seen: float) -> None:
        """Keep the cursors within `duration`, s. The first call places them in the visible part, `seen` s."""
        if self._duration == 0:
            for line, share in zip(self._lines, _AT, strict=True):
                line.setValue(share * seen)
        self._duration = duration
        for line in self._lines:
            line.setBounds((0.0, duration))

    def step(self, which: int, by: float) -> None:
        """Move one cursor by a time, s."""
        self._lines[which].setValue(self._lines[which].value() + by)

    def text(self, trace: ChosenTrace, look: Look) -> str:
        """Return time and range of both cursors and their differences."""
        texts = [f"{name} {_read(trace, time, look)}" for name, time in zip(_NAMES, self.times, strict=True)]
        first, second = self.times
        return "   ".join([*texts, f"B − A {_read(trace, second - first, look)}"])


def _read(trace: ChosenTrace, time: float, look: Look) -> str:
    return f"{time * 1e3:.2f} ms, {look.unit.text(trace.range_at(time))}".replace("-", "−")


def _line(name: str) -> pg.InfiniteLine:
    line = pg.InfiniteLine(angle=90, movable=True, label=name, labelOpts={"position": 0.06, "movable": False})
    line.setCursor(Qt.CursorShape.SizeHorCursor)
    line.setZValue(20)
    return line


# Marks in the trace plot: blanking, threshold, gain, the echoes that the board reported, and the sound played.


_FROM = 3e-4  # s; earlier, the gain of an ideal receiver approaches zero
_BEHIND = -20  # z value


class TraceMarks(base.PlotLayer):
    """The marks of one plot, also of the sound that is played. Its right axis shows the gain."""

    def __init__(self, plot: pg.PlotItem, gain_axis: GainAxis) -> None:
        super().__init__(plot)
        self._gain_axis = gain_axis
        self._drawn = False  # whether there is a trace
        self.blanking = self._add(pg.LinearRegionItem(movable=False), _BEHIND, brush="blanking")
        self._pens += [(line, "blanking", 1.0, Qt.PenStyle.SolidLine) for line in self.blanking.lines]
        self.threshold = self._add(PlotLine(connect="pairs"), None, "threshold", 1, Qt.PenStyle.DashLine)
        self._gain = self._add(PlotLine(), _BEHIND + 1, "faint")
        self.reported = self._add(TipSpots(size=9, symbol="t1", pen=None), 5, brush="measured")
        self.sound = self._add(pg.InfiniteLine(angle=90), None, "chosen", 2)
        self.crossing = self._add(Spots(size=14, symbol="o", brush=None), 6, "measured", 2)  # of the threshold
        self.draw_sound(None, EMPTY)

    def draw_sound(self, sound: SoundState | None, heights: Heights) -> None:
        """Draw a line at the time of the sound, and a ring at the detection once it has happened; None: neither."""
        self.sound.setVisible(sound is not None)
        self.crossing.setVisible(False)
        if sound is None or sound.ping is None:
            return
        self.sound.setValue(sound.time)
        detected = sound.ping.detected
        if detected is not None and sound.time >= detected:
            self.crossing.setVisible(True)
            self.crossing.setData([detected], [heights.of(sound.ping.prediction.board.threshold_db)])

    def draw(self, trace: ChosenTrace | None, heights: Heights, look: Look) -> None:
        """Draw the marks of a trace; None hides them."""
        self._drawn = trace is not None
        if trace is None:
            return
        self.blanking.setRegion((0.0, trace.blanking))
        levels = [heights.of(trace.threshold_db)]
        if not heights.decibels:
            levels.append(-levels[0])
        ends = [(time, level) for level in levels for time in (trace.blanking, trace.duration)]
        self.threshold.setData(*np.array(ends).T)
        begun = trace.gain.times >= _FROM
        placed = self._gain_axis.heights_of_gains(trace.gain.values[begun], heights)
        self._gain.setData(trace.gain.times[begun], placed)
        data = [f"reported: {look.unit.text(trace.range_at(time))}, {time * 1e3:.2f} ms" for time in trace.echo_times]
        self.reported.setData(trace.echo_times, np.full(len(data), levels[0]), data)

    def set_visible(self, shown: Shown) -> None:
        """Show the marks of the layers that `shown` draws; without a trace, none."""
        for item, layer in (
            *((self.blanking, ViewLayer.BLANKING), (self.threshold, ViewLayer.THRESHOLD)),
            *((self._gain, None), (self.reported, ViewLayer.TRACE)),
        ):
            item.setVisible(self._drawn and layer not in shown.hidden)


# The numbers of the predicted echoes in a row above the trace: the first to arrive is 1. Pointing shows the path.


_ROW = 15.0  # pixels at the default text size
_SHARE = 0.4  # of the plot's height, at most
_GAP = 4.0  # pixels between two numbers
_POINTS = 8.0  # font size


class EchoNumbers:
    """Numbers and stems of the echoes of one trace. The row is above the highest level, so it hides no trace.

    Where two numbers would overlap, that of the reported or the louder echo is drawn.
    """

    def __init__(self, view: pg.ViewBox) -> None:
        self._view = view
        self._look = Look()
        self._font = QFont()
        self._metrics = QFontMetricsF(self._font)
        self._echoes: list[tuple[int, NamedEcho]] = []  # the reported one first, then by level
        self._visible = True
        self.heights = EMPTY
        self.items: list[pg.TextItem] = []
        self._stems = PlotLine(connect="pairs")
        # by whether the echo is detectable
        self.heads = {detected: TipSpots(size=7, symbol="t", pen=None) for detected in (False, True)}
        for item in (self._stems, *self.heads.values()):
            view.addItem(item, ignoreBounds=True)
        view.sigXRangeChanged.connect(self._lay_out)
        view.sigResized.connect(self._lay_out)

    def set_look(self, look: Look) -> None:
        """Use the colours and text size of `look`."""
        self._look = look
        self._font.setPointSizeF(_POINTS * look.scale)
        self._metrics = QFontMetricsF(self._font)
        self._stems.setPen(base.cosmetic_pen(look.palette.predicted, width=1, style=Qt.PenStyle.DotLine))
        for detected, heads in self.heads.items():
            heads.setBrush(self._colour(detected))
        for item in self.items:
            item.setFont(self._font)

    def draw(self, echoes: Sequence[NamedEcho], heights: Heights) -> None:
        """Draw the numbers of these echoes and set the height range of the plot."""
        numbered = enumerate(sorted(echoes, key=lambda echo: echo.time), start=1)
        self._echoes = sorted(numbered, key=lambda pair: (not pair[1].first, -pair[1].level_db))
        self.heights = heights
        for detected, heads in self.heads.items():
            some = [(number, echo) for number, echo in self._echoes if echo.detectable is detected]
            tips = [self._tip(number, echo) for number, echo in some]
            heads.setData([echo.time for _, echo in some], [heights.of(echo.level_db) for _, echo in some], tips)
        self._lay_out()

    def set_visible(self, visible: bool) -> None:
        """Show or hide all numbers and stems."""
        if visible is not self._visible:
            self._visible = visible
            self._lay_out()

    def _lay_out(self, *_: object) -> None:
        height = max(self._view.height(), 1.0)
        row = min(_ROW * self._look.scale, _SHARE * height)
        bottom, top = self.heights.bottom, self.heights.top
        per_pixel = (top - bottom) / (height - row)
        self._view.setYRange(bottom, bottom + height * per_pixel, padding=0)
        fitting = self._fitting() if self._visible else []
        for heads in self.heads.values():
            heads.setVisible(self._visible)
        ends = [(echo.time, end) for _, echo in fitting for end in (self.heights.of(echo.level_db), top)]
        self._stems.setData(*np.array(ends).reshape(-1, 2).T)
        while len(self.items) < len(fitting):
            item = pg.TextItem(anchor=(0.5, 0.5))
            item.setFont(self._font)
            item.textItem.document().setDocumentMargin(0)  # the row is low
            self._view.addItem(item, ignoreBounds=True)
            self.items.append(item)
        for item in self.items[len(fitting) :]:
            item.setVisible(False)
        for item, (number, echo) in zip(self.items, fitting, strict=False):
            text, colour = str(number), self._colour(echo.detectable)
            # laying out a text takes long
            if (item.textItem.toPlainText(), item.color.name()) != (text, colour.lower()):
                item.setText(text, color=colour)
            item.setPos(echo.time, top + row * per_pixel / 2)
            item.setVisible(True)

    def _colour(self, detectable: bool) -> str:
        return self._look.palette.predicted if detectable else self._look.palette.ink

    def _fitting(self) -> list[tuple[int, NamedEcho]]:
        """Return the echoes whose numbers fit: first the reported one, then by level."""
        (left, right), whole = self._view.viewRange()[0], self._view.width()
        fitting: list[tuple[int, NamedEcho]] = []
        taken: list[tuple[float, float]] = []
        for number, echo in self._echoes:
            middle = (echo.time - left) * whole / (right - left)
            half = (self._metrics.horizontalAdvance(str(number)) + _GAP) / 2
            free = all(middle + half <= begin or middle - half >= end for begin, end in taken)
            if free and half <= middle <= whole - half:
                taken.append((middle - half, middle + half))
                fitting.append((number, echo))
        return fitting

    def _tip(self, number: int, echo: NamedEcho) -> str:
        state = "reported" if echo.first else "detected later" if echo.detectable else "within blanking"
        place = f"{self._look.unit.text(echo.range)}, {echo.time * 1e3:.2f} ms"
        level = f"{echo.level_db:.1f} dB" + (", sum of all arrivals within one wavelength" if echo.summed else "")
        return f"{number}: {echo.via}\n{place}, {state}\n{level}"


_LOWEST = 120  # pixels, minimum height at the default text size; leaves room for the axis labels
_STEPS = 200  # key presses that move a cursor across the view


class TraceView(QWidget):
    """Draws the trace of the selected reading."""

    entry = base.ViewEntry("Trace", picture_key="Ctrl+Alt+T", menu="Trace", not_drawn=("selected", *base.NOT_IN_PLOTS))

    def __init__(self) -> None:
        super().__init__()
        self.gestures = base.Gestures(self)
        self._shown: Shown | None = None
        self._look = Look()
        self._trace: ChosenTrace | None = None
        self._duration, self.heights = 0.0, EMPTY
        self.envelope = base.view_action(self, "Envelope", "V", "Show the envelope in dB")
        self.rf = base.view_action(self, "RF", "R", "Show the signal with its carrier")
        self.forms = QActionGroup(self)
        for form in (self.envelope, self.rf):
            self.forms.addAction(form)
        self.envelope.setChecked(True)
        self.cursors_shown = base.view_action(self, "Cursors", "C", "Show two cursors for time and range; drag to move")
        self.title, self.readout = ElidedLabel(), PlainLabel()
        self.title.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        gain_axis = GainAxis()
        self._times, self.range_axis, self._levels = (TickAxis(side) for side in ("bottom", "top", "left"))
        axes = {"left": self._levels, "right": gain_axis, "top": self.range_axis, "bottom": self._times}
        self.plot = base.new_plot(axes, zooms_height=False)
        self.canvas = base.Canvas(self.plot)
        self.predicted, self.measured = _curve_item(), _curve_item()
        for item in (self.predicted, self.measured):
            self.plot.addItem(item, ignoreBounds=True)
        self.marks = TraceMarks(self.plot, gain_axis)
        self.numbers = EchoNumbers(self.plot.vb)
        self.cursors = TraceCursors(self.plot, self._read_cursors)
        self.pointer = pg.InfiniteLine(angle=90)
        self.plot.addItem(self.pointer, ignoreBounds=True)
        self._arrange()
        self._connect()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if before is None or before.trace is not shown.trace or _marked(before) != _marked(shown):
            self.canvas.repaint_whole()
        if shown.changed_since(before, lambda new: (new.look,)):
            self._set_look(shown.look)
        if shown.changed_since(before, lambda new: (new.trace, new.look)):
            self._draw(shown.trace)
        self._show_layers(shown)
        if shown.trace is None and not self._duration:
            self._show_board_range(shown.scene)
        self._update_title()
        if before is None or _moved(before, shown):
            self.marks.draw_sound(shown.sound, self.heights)
        self._point(shown.cursor)

    def _arrange(self) -> None:
        title = LayoutBarrier(self.title)
        row = arranged(QHBoxLayout(), title, rest=title, margins=(8, 2, 8, 0), gap=3)
        base.add_buttons(row, (self.envelope, self.rf, self.cursors_shown))
        self.readout.setVisible(False)
        self.readout.setContentsMargins(8, 0, 8, 2)
        arranged(QVBoxLayout(self), row, self.canvas, self.readout, rest=self.canvas)

    def _connect(self) -> None:
        self.forms.triggered.connect(self._redraw)
        self.cursors_shown.toggled.connect(self._show_cursors)
        self.canvas.hovered.connect(self._point_at)
        for which, name in enumerate("AB"):
            for side, by in (("Left", -1), ("Right", 1)):
                key = f"Alt+Shift+{side}" if which else f"Alt+{side}"
                action = base.view_action(
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
        base.label_axis(gain, "gain (dB)")
        for axis in (gain, self.range_axis):
            axis.setGrid(False)
        self.predicted.setPen(base.cosmetic_pen(colours.predicted, width=1, style=Qt.PenStyle.DashLine))
        self.measured.setPen(base.cosmetic_pen(colours.measured, width=1))
        self.pointer.setPen(base.cosmetic_pen(colours.chosen, width=1, style=Qt.PenStyle.DotLine))
        for part in (self.marks, self.numbers, self.cursors):
            part.set_look(look)

    def _draw(self, trace: ChosenTrace | None) -> None:
        self._trace = trace
        rf = self.rf.isChecked()
        self.heights = heights = heights_of(trace, rf) if trace else EMPTY
        self._levels.set_heights(heights)
        unit = self._look.unit
        self.range_axis.set_unit(unit.label, (trace.speed if trace else Air().speed_of_sound) / 2 * unit.per_metre)
        for item, sound in (
            (self.measured, trace.measured if trace else None),
            (self.predicted, trace.predicted if trace else None),
        ):
            curve = None if sound is None else signal_curve(sound) if rf else sound.envelope
            _set_curve(item, curve, heights)
        self.marks.draw(trace, heights, self._look)
        self.numbers.draw(trace.echoes if trace else (), heights)
        self._update_title()
        self.measured.setZValue(1 if rf else -1)
        if trace is not None:
            self._set_time_range(trace)
        self._read_cursors()

    def _show_layers(self, shown: Shown) -> None:
        self.measured.setVisible(shown.draws(ViewLayer.TRACE))
        self.predicted.setVisible(shown.draws(ViewLayer.PREDICTED))
        self.numbers.set_visible(shown.draws(ViewLayer.PREDICTED))
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
        self.pointer.setVisible(cursor is not None and self._trace is not None)
        if cursor is not None and self._trace is not None:
            self.pointer.setValue(self._trace.time_at(cursor.range))


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
    if trace.stepped_gain:
        parts.append("stepped gain")
    return " · ".join(parts)
