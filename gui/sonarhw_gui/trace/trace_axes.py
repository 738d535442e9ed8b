"""Axes of the trace view. Their height is a level in dB or a signal amplitude."""

from dataclasses import dataclass

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_gui.plots.plot_look import PlotAxis, label_axis
from sonarhw_gui.work.chosen_trace import ChosenTrace, Curve, TraceCurves

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
    known = levels[np.isfinite(levels)]
    return float(10 ** (known.max() / 20)) if len(known) else 0.0


def signal_curve(sound: TraceCurves) -> Curve:
    """Return the signal with its carrier; without a carrier, the envelope above and below zero."""
    if sound.rf is not None:
        return sound.rf
    times, levels = sound.envelope.times, 10 ** (sound.envelope.values / 20)
    gap = np.array([np.nan])
    return Curve(np.concatenate((times, gap, times)), np.concatenate((levels, gap, -levels)))


class UnitAxis(PlotAxis):
    """An axis whose tick values include the unit, which takes less height than a label."""

    def __init__(self, side: str) -> None:
        super().__init__(side)
        self.unit = ""

    def set_unit(self, unit: str, scale: float) -> None:
        """Show tick values in `unit`; `scale` converts from plot coordinates."""
        self.setScale(scale)
        if unit != self.unit:
            self.unit = unit
            self.picture = None

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the tick values with their unit."""
        return [f"{text} {self.unit}" for text in super().tickStrings(values, scale, spacing)]


class HeightAxis(PlotAxis):
    """Axis without tick values above `top`, where names are drawn."""

    def __init__(self) -> None:
        super().__init__("left")
        self._heights: Heights | None = None

    def set_heights(self, heights: Heights) -> None:
        """Set the height scale."""
        if heights != self._heights:
            self._heights = heights
            label_axis(self, heights.label)

    def tickStrings(self, values: list[float], scale: float, spacing: float) -> list[str]:
        """Return the tick values, empty above the top."""
        texts = super().tickStrings(values, scale, spacing)
        top = self._heights.top + _ROUNDING if self._heights else 0.0
        return [text if value <= top else "" for text, value in zip(texts, values, strict=True)]


class GainAxis(PlotAxis):
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
