"""Marks in the trace plot: blanking, threshold, gain, and the echoes that the board reported."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import ViewLayer
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, TipSpots
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.trace.trace_axes import GainAxis, Heights
from sonarhw_gui.work.chosen_trace import ChosenTrace

_FROM = 3e-4  # s; earlier, the gain of an ideal receiver approaches zero
_BEHIND = -20  # z value


class TraceMarks:
    """The marks of one plot. Its right axis shows the gain."""

    def __init__(self, plot: pg.PlotItem, gain_axis: GainAxis) -> None:
        self._gain_axis = gain_axis
        self._drawn = False  # whether there is a trace
        self._blanking = pg.LinearRegionItem(movable=False)
        self._blanking.setZValue(_BEHIND)
        self._threshold = PlotLine(connect="pairs")
        self._gain = PlotLine()
        self._gain.setZValue(_BEHIND + 1)
        self._reported = TipSpots(size=9, symbol="t1", pen=None)
        self._reported.setZValue(5)
        self._items = (self._blanking, self._threshold, self._gain, self._reported)
        for item in self._items:
            plot.addItem(item, ignoreBounds=True)

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        colours = look.palette
        self._blanking.setBrush(colours.blanking)
        for line in self._blanking.lines:
            line.setPen(cosmetic_pen(colours.blanking))
        self._threshold.setPen(cosmetic_pen(colours.threshold, width=1, style=Qt.PenStyle.DashLine))
        self._gain.setPen(cosmetic_pen(colours.faint, width=1))
        self._reported.setBrush(colours.measured)

    def draw(self, trace: ChosenTrace | None, heights: Heights, look: Look) -> None:
        """Draw the marks of a trace; None hides them."""
        self._drawn = trace is not None
        if trace is None:
            return
        self._blanking.setRegion((0.0, trace.blanking))
        levels = [heights.of(trace.threshold_db)]
        if not heights.decibels:
            levels.append(-levels[0])
        ends = [(time, level) for level in levels for time in (trace.blanking, trace.duration)]
        self._threshold.setData(*np.array(ends).T)
        begun = trace.gain.curve.times >= _FROM
        placed = self._gain_axis.heights_of_gains(trace.gain.curve.values[begun], heights)
        self._gain.setData(trace.gain.curve.times[begun], placed)
        data = [f"reported: {look.unit.text(trace.range_at(time))}, {time * 1e3:.2f} ms" for time in trace.echo_times]
        self._reported.setData(trace.echo_times, np.full(len(data), levels[0]), data)

    def set_visible(self, shown: Shown) -> None:
        """Show the marks of the layers that `shown` draws; without a trace, none."""
        for item, layer in (
            *((self._blanking, ViewLayer.BLANKING), (self._threshold, ViewLayer.THRESHOLD)),
            *((self._gain, None), (self._reported, ViewLayer.TRACE)),
        ):
            item.setVisible(self._drawn and layer not in shown.hidden)
