"""The cursor of the trace that is in step with the sound in the plan, and the point where the threshold is crossed."""

import numpy as np
import pyqtgraph as pg

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import Spots
from sonarhw_gui.shown.shown import SoundMoment
from sonarhw_gui.trace.trace_axes import Heights


class TraceSound:
    """A line at the time of the sound, and a ring at the detection once it has happened."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.line = pg.InfiniteLine(angle=90)
        self.crossing = Spots(size=14, symbol="o", brush=None)
        self.crossing.setZValue(6)
        for item in (self.line, self.crossing):
            item.setVisible(False)
            plot.addItem(item, ignoreBounds=True)

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        self.line.setPen(cosmetic_pen(look.palette.chosen, width=2))
        self.crossing.setPen(cosmetic_pen(look.palette.measured, width=2))

    def draw(self, sound: SoundMoment | None, heights: Heights) -> None:
        """Draw one moment, or hide it."""
        self.line.setVisible(sound is not None)
        detected = None if sound is None else sound.ping.detected
        crossed = sound is not None and detected is not None and sound.time >= detected
        self.crossing.setVisible(crossed)
        if sound is not None:
            self.line.setValue(sound.time)
        if sound is not None and crossed and detected is not None:
            level = heights.of(sound.ping.prediction.board.threshold_db)
            self.crossing.setData(np.array([detected]), np.array([level]))
