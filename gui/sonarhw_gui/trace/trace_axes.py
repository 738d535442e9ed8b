"""Axes of the trace view: heights that are levels or signals, and axes that write something else than what is drawn.

Takes a chosen trace; hands on a frozen `Heights`, and axes for a plot.
"""

from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg

from sonarhw.readings import FloatArray
from sonarhw_gui.plots.plot_look import label_axis
from sonarhw_gui.work.chosen_trace import ChosenTrace, Curve, TraceCurves

_HAIR = 1e-9
_REACHES = 0.02, 0.05, 0.1, 0.2, 0.5, 1.0  # of full scale


@dataclass(frozen=True)
class Heights:
    """What the height in a plot of traces means; names stand above `top`."""

    decibels: bool
    bottom: float
    top: float

    def of(self, level_db: float) -> float:
        """How high a level lies, dB of full scale."""
        height = level_db if self.decibels else 10 ** (level_db / 20)
        return min(max(height, self.bottom), self.top)

    @property
    def label(self) -> str:
        """The name of the axis with its unit."""
        return "dB of full scale" if self.decibels else "signal (of full scale)"


EMPTY = Heights(True, -52.0, 0.0)


def heights_of(trace: ChosenTrace, rf: bool) -> Heights:
    """Levels from the floor up; a signal as far as the loudest that is heard once blanking is over."""
    if not rf:
        return Heights(True, trace.floor_db, 0.0)
    loudest = max((_loudest(sound, trace.blanking) for sound in (trace.measured, trace.predicted) if sound), default=1)
    # in steps, so that the axis stands still from one reading to the next
    reach = next(step for step in _REACHES if step >= min(1.0, loudest))
    return Heights(False, -reach, reach)


def _loudest(sound: TraceCurves, after: float) -> float:
    heard = sound.envelope.values[sound.envelope.times >= after]
    loud = heard[np.isfinite(heard)]
    return float(10 ** (loud.max() / 20)) if len(loud) else 0.0


def signal_curve(sound: TraceCurves) -> Curve:
    """The signal with its carrier; where only the envelope is known that, above and below zero."""
    if sound.rf is not None:
        return sound.rf
    times, levels = sound.envelope.times, 10 ** (sound.envelope.values / 20)
    gap = np.array([np.nan])
    return Curve(np.concatenate((times, gap, times)), np.concatenate((levels, gap, -levels)))


class UnitAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """Every figure with its unit, which takes less height than a label beside the axis."""

    def __init__(self, side: str) -> None:
        super().__init__(side)
        self.enableAutoSIPrefix(False)
        self.unit = ""

    def write_in(self, unit: str, scale: float) -> None:
        """Write figures in this unit, `scale` of which are 1 of what is drawn."""
        self.setScale(scale)
        if unit != self.unit:
            self.unit = unit
            self.picture = None

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """The figures with their unit."""
        return [f"{text} {self.unit}" for text in super().tickStrings(values, scale, spacing)]


class HeightAxis(pg.AxisItem):  # type: ignore[misc]
    """Figures up to `top`; above it are names, not levels."""

    def __init__(self) -> None:
        super().__init__("left")
        self._heights: Heights | None = None

    def write_for(self, heights: Heights) -> None:
        """Write figures for these heights."""
        if heights != self._heights:
            self._heights = heights
            label_axis(self, heights.label)

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """The figures, empty above the top."""
        told = super().tickStrings(values, scale, spacing)
        top = self._heights.top + _HAIR if self._heights else 0.0
        return [text if value <= top else "" for text, value in zip(told, values, strict=True)]


class GainAxis(pg.AxisItem):  # type: ignore[misc]
    """Decibels of a gain that is drawn between the bottom and the top of other heights."""

    def __init__(self) -> None:
        super().__init__("right")
        self._low, self._per_height, self._bottom, self._top = 0.0, 1.0, 0.0, 1.0

    def place(self, gains: FloatArray, heights: Heights) -> FloatArray:
        """Where gains (n,) dB lie among these heights, (n,) float; the axis is written for them from now on."""
        low, high = float(gains.min()), float(gains.max())
        per_height = max(high - low, 1.0) / (heights.top - heights.bottom)
        written = low, per_height, heights.bottom, heights.top
        if written != (self._low, self._per_height, self._bottom, self._top):
            self._low, self._per_height, self._bottom, self._top = written
            self.picture = None  # it is written anew
            self.update()
        return np.asarray(heights.bottom + (gains - low) / per_height)

    def tickValues(self, minVal: float, maxVal: float, size: float) -> list[tuple[float, list[float]]]:
        """Round decibels, where they lie."""
        low, high = (self._gain(height) for height in (minVal, min(maxVal, self._top)))
        if not low < high:
            return []
        levels = super().tickValues(low, high, size * (high - low) / max(self._gain(maxVal) - low, 1e-9))
        spacing, gains = levels[0]
        return [(spacing, [self._bottom + (gain - self._low) / self._per_height for gain in gains])]

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """What gain lies at those heights, dB."""
        return [f"{round(self._gain(value))}" for value in values]

    def _gain(self, height: float) -> float:
        return self._low + (height - self._bottom) * self._per_height
