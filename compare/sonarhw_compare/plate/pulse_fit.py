"""Fit of the swelling to the shape of plate echoes in traces, and of the ring-down to the beginning of the traces."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.stats import t as student
from sonarhw_sim.board.burst import RATE
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.traces import own_burst

from sonarhw.readings import FloatArray
from sonarhw_compare.plate.plate_readings import EchoPulse, PlateReadings, peak_of
from sonarhw_compare.plate.plate_signal import plate_envelopes

MOST_PULSES = 32  # whose shape is fitted
FEWEST_PULSES = 5
_LIMITED = 0.9  # of the largest sample; louder ones may be limited
_FAINT = 0.1  # of the largest sample; the shape of fainter echoes is rough
_RING_FAINT = 0.03  # amplitude; fainter samples of the ring-down may be noise
_FEWEST_SAMPLES = 4  # of a ring-down
_SWELLINGS = (0.5, 40.0)  # cycles, limits of the fit
_LATEST = 0.15e-3  # s, between the expected and the fitted time of an echo
_LEAST_SHARE = 0.02  # least relative deviation of the swelling: pulses have a model, too
_LEAST_RING_DB = 0.3  # least deviation of the own burst, likewise
_MOST_SLOPE = 1.5  # ratio of ring-down to swelling, from which on they differ


@dataclass(frozen=True)
class Measured:
    """A value with its standard deviation."""

    value: float
    deviation: float


def swelling(board: Board, scans: Sequence[PlateReadings], turns: FloatArray) -> Measured | None:
    """Return `rise_cycles`: the mean of fits to single echoes; None if too few are suitable.

    `turns` (s,) rad are the turntable angles of the perpendiculars of the plates.
    """
    found = []
    for scan, turn in zip(scans, turns.tolist(), strict=True):
        suitable = [one for one in scan.pulses if _FAINT <= peak_of(one.samples) / scan.largest <= _LIMITED]
        # of each log, those nearest to the perpendicular, where the beam delays least
        suitable.sort(key=lambda one: abs(one.angle - turn))
        found += [_swelling_of(board, scan, one, turn) for one in suitable[: math.ceil(MOST_PULSES / len(scans))]]
    values = np.array(found)
    if len(values) < FEWEST_PULSES:
        return None
    # as an interval of a normal distribution
    spread = float(np.std(values, ddof=1)) / math.sqrt(len(values)) * float(student.ppf(0.975, len(values) - 1)) / 1.96
    value = float(np.median(values))
    return Measured(value, math.hypot(spread, _LEAST_SHARE * value))


def _swelling_of(board: Board, scan: PlateReadings, pulse: EchoPulse, turn: float) -> float:
    """Return the swelling, cycles, with which an echo of the plate fits best; its amplitude and time are free."""
    angles = np.array([pulse.angle - turn])

    def residuals(values: FloatArray) -> FloatArray:
        swelling, amplitude, later = values.tolist()
        model = plate_envelopes(replace(board, rise_cycles=swelling), scan.speed_of_sound, scan.distance, angles)
        expected = np.interp(pulse.times - later * _LATEST, model.times[0], model.samples[0], left=0.0, right=0.0)
        return np.asarray(amplitude * expected - pulse.samples)

    model = plate_envelopes(board, scan.speed_of_sound, scan.distance, angles)
    amplitude = peak_of(pulse.samples) / float(model.samples.max())
    low, high = _SWELLINGS
    start = [float(np.clip(board.rise_cycles, 1.01 * low, 0.99 * high)), amplitude, 0.0]
    fitted = least_squares(
        residuals, start, bounds=([low, 0.0, -1.0], [high, math.inf, 1.0]), diff_step=[1e-3, 1e-3, 1e-3], max_nfev=40
    )
    return float(fitted.x[0])


@dataclass(frozen=True)
class RingDown:
    """The ring-down of the transmit burst."""

    level: Measured  # dB over full scale, by which a profile states it
    cycles: float  # time constant of the ring-down itself, which the swelling should explain

    def explained_by(self, swelling: float) -> bool:
        """Return whether the ring-down decays as fast as echoes swell."""
        return 1 / _MOST_SLOPE <= self.cycles / swelling <= _MOST_SLOPE


def ring_down(board: Board, deviation: float, scans: Sequence[PlateReadings], trace_level_db: float) -> RingDown | None:
    """Return the ring-down in the traces of all scans; None if they do not show it.

    The board has the measured swelling, whose standard `deviation` (cycles) widens that of the level.
    `trace_level_db` is the level of a perfect wall in the traces.
    """
    begins = [(scan, scan.begin) for scan in scans if scan.begin is not None]
    shown = [(scan, _decaying(one, scan.largest)) for scan, one in begins]
    shown = [(scan, one) for scan, one in shown if len(one.times) >= _FEWEST_SAMPLES]
    if not shown:
        return None

    def levels(cycles: float) -> FloatArray:
        changed = replace(board, rise_cycles=cycles, own_burst_db=0.0)
        return np.concatenate([_excess(changed, scan.speed_of_sound, one) for scan, one in shown])

    here = levels(board.rise_cycles)
    slower, faster = (float(levels(max(board.rise_cycles + by, 0.5)).mean()) for by in (deviation, -deviation))
    spread = math.hypot(float(here.std()) / math.sqrt(len(shown)), (slower - faster) / 2, _LEAST_RING_DB)
    best = minimize_scalar(lambda cycles: float(levels(cycles).var()), bounds=_SWELLINGS, method="bounded")
    return RingDown(Measured(float(here.mean()) - trace_level_db, spread), float(best.x))


def _decaying(begin: EchoPulse, largest: float) -> EchoPulse:
    """Return the samples after the last limited one, until they are faint."""
    limited = np.flatnonzero(begin.samples > 0.8 * largest)
    first = int(limited[-1]) + 1 if len(limited) else len(begin.samples)
    faint = np.flatnonzero(begin.samples[first:] < _RING_FAINT)
    last = first + (int(faint[0]) if len(faint) else 0)
    return EchoPulse(begin.angle, begin.times[first:last], begin.samples[first:last])


def _excess(board: Board, speed_of_sound: float, ring: EchoPulse) -> FloatArray:
    """Return the levels of a ring-down over the board's own burst, dB, at each of its samples."""
    burst = np.abs(own_burst(board, speed_of_sound))
    expected = np.interp(ring.times, np.arange(len(burst)) / RATE, burst, right=float(burst[-1]))
    return np.asarray(20 * np.log10(ring.samples / np.maximum(expected, 1e-12)))
