"""The layer of the plan that draws sound on its paths, what the board does not detect yet, and what it would report."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from sonarhw_compare.sound import Pulse, counted_position, moment_at

from sonarhw.readings import FloatArray
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, Spots
from sonarhw_gui.shown.shown import Shown

_NOTHING = np.empty((0, 2))
_GAP = np.full((1, 2), np.nan)
_CIRCLE = np.linspace(0, 2 * np.pi, 73)


class SoundLayer:
    """The burst of each path with its wavefront, the disc of blanking, and the range counted so far."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._deaf = PlotLine(filled=True)
        self._ways = PlotLine(connect="finite")
        self._others, self._winner = (PlotLine(connect="finite") for _ in range(2))
        self._fronts = PlotLine(connect="finite")
        self._counting = PlotLine()
        self.counted = Spots(size=12, symbol="o")
        items: tuple[pg.GraphicsObject, ...] = (
            *(self._deaf, self._ways, self._others, self._winner, self._fronts),
            *(self._counting, self.counted),
        )
        for z, item in zip((-12, 26, 27, 28, 28, 26, 29), items, strict=True):
            item.setZValue(z)
            item.setVisible(False)
            plot.addItem(item, ignoreBounds=True)
        self._items, self._look = items, Look()

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        colours, self._look = look.palette, look
        self._deaf.setBrush(colours.blanking)
        self._deaf.setPen(cosmetic_pen(colours.faint, width=1, style=Qt.PenStyle.DashLine))
        self._ways.setPen(cosmetic_pen(colours.faint, width=1))
        self._others.setPen(cosmetic_pen(colours.faint, width=4))
        self._winner.setPen(cosmetic_pen(colours.predicted, width=5))
        self._fronts.setPen(cosmetic_pen(colours.predicted, width=1.5))
        self._counting.setPen(cosmetic_pen(colours.measured, width=1, style=Qt.PenStyle.DotLine))
        self.counted.setPen(cosmetic_pen(colours.measured, width=2))

    def draw(self, shown: Shown) -> None:
        """Draw one moment, or hide everything."""
        sound = shown.sound
        for item in self._items:
            item.setVisible(sound is not None)
        if sound is None:
            return
        ping, pulses = sound.ping, moment_at(sound.ping, sound.time)
        sensor = ping.prediction.standpoints[ping.index]
        deaf = ping.prediction.board.blanked_range(ping.prediction.room.air)
        self._deaf.setData(*(sensor + deaf * np.column_stack((np.cos(_CIRCLE), np.sin(_CIRCLE)))).T)
        self._deaf.setOpacity(1.0 if sound.time < ping.blanking else 0.45)
        self._ways.setData(*_with_gaps([way.points for way in ping.ways]).T)
        self._others.setData(*_trails(pulses, wins=False).T)
        self._winner.setData(*_trails(pulses, wins=True).T)
        self._fronts.setData(*_with_gaps([pulse.front for pulse in pulses]).T)
        here = counted_position(ping, sound.time)
        self._counting.setData(*np.array([sensor, here]).T)
        reported = ping.detected is not None and sound.time >= ping.detected
        self.counted.setBrush(pg.mkBrush(self._look.palette.measured if reported else None))
        self.counted.setData(*here[:, None])


def _trails(pulses: tuple[Pulse, ...], wins: bool) -> FloatArray:
    return _with_gaps([pulse.trail for pulse in pulses if pulse.way.echo.wins is wins])


def _with_gaps(lines: list[FloatArray]) -> FloatArray:
    """Return lines as one array of points, (n, 2), with NaN between them."""
    parts = [part for line in lines if len(line) for part in (line, _GAP)]
    return np.vstack(parts) if parts else _NOTHING
