"""Fit of swelling and ring-down to the shape of plate echoes in traces, and of the own burst to their beginning."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.stats import t as student
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.signal import RATE, own_burst

from sonarhw.readings import FloatArray
from sonarhw_compare.plate.plate_readings import EchoPulse, PlateReadings, peak_of
from sonarhw_compare.plate.plate_signal import plate_envelopes

MOST_PULSES = 32  # whose shape is fitted
FEWEST_PULSES = 5
_LIMITED = 0.9  # of the largest sample; louder ones may be limited
_FAINT = 0.1  # of the largest sample; the shape of fainter echoes is rough
_RING_FAINT = 0.03  # amplitude; fainter samples of the ring-down may be noise
_FEWEST_SAMPLES = 4  # of a ring-down
_CYCLES = (0.5, 40.0)  # limits of the fit
_OTHER_RING = 1.1  # times the swelling, where the fit of the ring-down begins
_LATEST = 0.15e-3  # s, between the expected and the fitted time of an echo
_LEAST_SHARE = 0.02  # least relative deviation of a time constant: pulses have a model, too
_LEAST_RING_DB = 0.3  # least deviation of the own burst, likewise
_MOST_SLOPE = 1.5  # ratio of ring-down to swelling, from which on they differ


@dataclass(frozen=True)
class Measured:
    """A value with its standard deviation."""

    value: float
    deviation: float


@dataclass(frozen=True)
class PulseShape:
    """Time constants of the echo of a plate, cycles."""

    rise: Measured  # `rise_cycles`
    ring: Measured | None  # `ring_cycles`; None: the ring-down does not differ from the swelling


def pulse_shape(board: Board, scans: Sequence[PlateReadings], turns: FloatArray) -> PulseShape | None:
    """Return the medians of fits to single echoes; None if too few are suitable.

    `turns` (s,) rad are the turntable angles of the perpendiculars of the plates. If swelling and ring-down are alike,
    one value for both is fitted, which is more accurate.
    """
    suitable = [one for scan, turn in zip(scans, turns.tolist(), strict=True) for one in _suitable(scan, turn, scans)]
    if len(suitable) < FEWEST_PULSES:
        return None
    rises, rings = np.array([_shape_of(board, *one, own_ring=True) for one in suitable]).T
    if 1 / _MOST_SLOPE <= float(np.median(rings / rises)) <= _MOST_SLOPE:
        rises, _ = np.array([_shape_of(board, *one, own_ring=False) for one in suitable]).T
        return PulseShape(_median(rises), None)
    return PulseShape(_median(rises), _median(rings))


def _suitable(
    scan: PlateReadings, turn: float, scans: Sequence[PlateReadings]
) -> list[tuple[PlateReadings, EchoPulse, float]]:
    """Return echoes of a scan that are loud and not limited; those nearest to the perpendicular."""
    loud = [one for one in scan.pulses if _FAINT <= peak_of(one.samples) / scan.largest <= _LIMITED]
    # there, the beam delays least
    loud.sort(key=lambda one: abs(one.angle - turn))
    return [(scan, one, turn) for one in loud[: math.ceil(MOST_PULSES / len(scans))]]


def _median(values: FloatArray) -> Measured:
    # as an interval of a normal distribution
    spread = float(np.std(values, ddof=1)) / math.sqrt(len(values)) * float(student.ppf(0.975, len(values) - 1)) / 1.96
    value = float(np.median(values))
    return Measured(value, math.hypot(spread, _LEAST_SHARE * value))


def _shape_of(
    board: Board, scan: PlateReadings, pulse: EchoPulse, turn: float, *, own_ring: bool
) -> tuple[float, float]:
    """Return swelling and ring-down, cycles, with which an echo of the plate fits best; amplitude and time are free."""
    angles = np.array([pulse.angle - turn])

    def residuals(values: FloatArray) -> FloatArray:
        amplitude, later, rise, *ring = values.tolist()
        changed = replace(board, rise_cycles=rise, ring_cycles=ring[0] if ring else None)
        model = plate_envelopes(changed, scan.speed_of_sound, scan.distance, angles)
        expected = np.interp(pulse.times - later * _LATEST, model.times[0], model.samples[0], left=0.0, right=0.0)
        return np.asarray(amplitude * expected - pulse.samples)

    model = plate_envelopes(board, scan.speed_of_sound, scan.distance, angles)
    low, high = _CYCLES
    rise = float(np.clip(board.rise_cycles, 1.01 * low, 0.99 * high))
    start = [peak_of(pulse.samples) / float(model.samples.max()), 0.0, rise]
    bounds = [0.0, -1.0, low], [math.inf, 1.0, high]
    if own_ring:
        start.append(float(np.clip(board.ring_cycles or _OTHER_RING * rise, 1.01 * low, 0.99 * high)))
        bounds = [*bounds[0], low], [*bounds[1], high]
    fitted = least_squares(residuals, start, bounds=bounds, diff_step=[1e-3] * len(start), max_nfev=40)
    return float(fitted.x[2]), float(fitted.x[-1])


@dataclass(frozen=True)
class RingDown:
    """The ring-down of the transmit burst."""

    level: Measured  # dB over full scale, by which a profile states it
    cycles: float  # time constant of this ring-down, which that of echoes should explain

    def explained_by(self, cycles: float) -> bool:
        """Return whether the burst decays as fast as echoes do."""
        return 1 / _MOST_SLOPE <= self.cycles / cycles <= _MOST_SLOPE


def ring_down(board: Board, deviation: float, scans: Sequence[PlateReadings], trace_level_db: float) -> RingDown | None:
    """Return the ring-down in the traces of all scans; None if they do not show it.

    The board has the measured time constants. The standard `deviation` (cycles) of that of the decay widens that of
    the level.
    `trace_level_db` is the level of a perfect wall in the traces.
    """
    begins = [(scan, scan.begin) for scan in scans if scan.begin is not None]
    shown = [(scan, _decaying(one, scan.largest)) for scan, one in begins]
    shown = [(scan, one) for scan, one in shown if len(one.times) >= _FEWEST_SAMPLES]
    if not shown:
        return None

    decay = "rise_cycles" if board.ring_cycles is None else "ring_cycles"
    measured = float(getattr(board, decay))

    def levels(cycles: float) -> FloatArray:
        changed = board.with_numbers({decay: cycles, "own_burst_db": 0.0})
        return np.concatenate([_excess(changed, scan.speed_of_sound, one) for scan, one in shown])

    here = levels(measured)
    slower, faster = (float(levels(max(measured + by, _CYCLES[0])).mean()) for by in (deviation, -deviation))
    spread = math.hypot(float(here.std()) / math.sqrt(len(shown)), (slower - faster) / 2, _LEAST_RING_DB)
    best = minimize_scalar(lambda cycles: float(levels(cycles).var()), bounds=_CYCLES, method="bounded")
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
