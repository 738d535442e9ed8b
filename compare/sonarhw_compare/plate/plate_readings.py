"""What the readings of one log contain about a plate: where it was heard, how loud, and the beginning of each trace."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.signal import covered_by_burst

from sonarhw.errors import NoPlate
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.pictures.trace_levels import envelope_of
from sonarhw_compare.plate.plate_signal import WIDEST, plate_levels

NEARER, FARTHER = 0.10, 0.12  # m from the stated distance; echoes in between are those of the plate
_CENTRAL = math.radians(5.0)  # from the perpendicular; the range there is that of the plate
_SPREAD = 0.015  # m, of the ranges of a plate; a faint echo is also later, by up to the length of the burst
MOST_TURN = math.radians(15.0)  # between the stated direction and the plate's perpendicular
FEWEST = 5  # smallest number of headings at which the plate is heard
_BEFORE, _AFTER = 0.15e-3, 0.35e-3  # s, before the echo and after its burst, in which its peak is searched
_SHORT_GAP = 3  # samples; shorter than a burst
_QUIET = 1e-3  # amplitude, in place of 0
_FLOOR_DB = -35.0  # of full scale; fainter peaks are equal
_LOUD_DB = -20.0  # of full scale: peaks that are certainly those of an echo
_MIDDLE = math.radians(2.0)  # to each side of the perpendicular, where the plate is loudest
_TURN_STEP = math.radians(0.25)


@dataclass(frozen=True)
class EchoPulse:
    """The part of a trace with the echo of the plate."""

    angle: float  # rad, turntable
    times: FloatArray  # (k,), s
    samples: FloatArray  # (k,), envelope


@dataclass(frozen=True)
class PlateReadings:
    """The readings of one log in front of a plate, by heading."""

    name: str  # of the log
    distance: float  # m, from the face to the plate
    direction: float  # rad, turntable angle that should face the plate
    speed_of_sound: float  # m/s
    angles: FloatArray  # (n,), rad, turntable angles, increasing
    pings: NDArray[np.intp]  # (n,)
    heard: NDArray[np.intp]  # (n,), pings with an echo of the plate
    peaks: FloatArray  # (n,), dB, mean peak of the plate's echo in the traces; NaN without traces
    first_times: FloatArray  # (m,), s, first echo of each reading that has one, by the board's clock
    blanked_until: float  # s, blanking in the settings of the scanner; 0 if unknown
    pulses: tuple[EchoPulse, ...]  # one for each trace
    begin: EchoPulse | None  # mean of all traces before the echo of the plate; None without traces
    largest: float  # largest sample of all traces
    middle: float = 0.0  # rad, turntable angle about which the echo is symmetric, roughly

    @property
    def step(self) -> float:
        """Step from one heading to the next, rad."""
        return float(np.median(np.diff(self.angles)))


def plate_readings(
    name: str,
    readings: Sequence[Reading],
    distance: float,
    direction: float,
    board: Board,
    blanked_until: float = 0.0,
) -> PlateReadings:
    """Return the readings of a log, `distance` m from a plate in `direction` (rad, turntable angle).

    Raises NoPlate if the plate is heard at too few headings, or far from the stated direction.
    """
    near = [one for one in readings if abs(math.remainder(one.angle - direction, math.tau)) <= WIDEST]
    turned = np.array([direction + math.remainder(one.angle - direction, math.tau) for one in near])
    angles, rows = np.unique(np.round(turned, 9), return_inverse=True)
    pings = np.bincount(rows, minlength=len(angles))
    heard = _heard(near, rows, len(angles), distance - NEARER, distance + FARTHER)
    pulses = _pulses(near, turned, distance, board)
    found = PlateReadings(
        name,
        distance,
        direction,
        float(np.median([one.speed_of_sound for one in readings])),
        angles,
        pings,
        heard,
        _mean_peaks(pulses, angles),
        np.array([one.echo_times[0] for one in readings if one.echo_times]),
        blanked_until,
        pulses,
        _begin(near, distance),
        max((float(np.nanmax(one.samples)) for one in pulses), default=0.0),
    )
    found = replace(found, middle=_middle(found, board))
    _check(found)
    central = [one for one, angle in zip(near, turned, strict=True) if abs(angle - found.middle) < _CENTRAL]
    within = [[echo for echo in one.echo_ranges if abs(echo - distance) <= NEARER] for one in central]
    # a long burst is reported again once the board has re-armed, so only the first echo counts
    ranges = [echoes[0] for echoes in within if echoes]
    if not ranges:
        return found
    first, latest = float(np.median(ranges)), covered_by_burst(board, found.speed_of_sound) / 2
    return replace(found, heard=_heard(near, rows, len(angles), first - _SPREAD, first + latest + _SPREAD))


def _heard(
    readings: Sequence[Reading], rows: NDArray[np.intp], count: int, nearest: float, farthest: float
) -> NDArray[np.intp]:
    """Return how many pings at each heading have an echo from `nearest` to `farthest` m, (count,)."""
    heard = [any(nearest <= echo <= farthest for echo in one.echo_ranges) for one in readings]
    return np.bincount(rows[np.array(heard, dtype=np.bool_)], minlength=count)


def _pulses(readings: Sequence[Reading], angles: FloatArray, distance: float, board: Board) -> tuple[EchoPulse, ...]:
    """Return the part of each trace with the echo of the plate."""
    burst = sum(tone.cycles / tone.frequency for tone in board.burst)
    found = []
    for reading, angle in zip(readings, angles.tolist(), strict=True):
        if reading.trace is None:
            continue
        time, times = 2 * distance / reading.speed_of_sound, reading.trace.times
        rows = np.flatnonzero((times >= time - _BEFORE) & (times <= time + burst + _AFTER))
        samples = _without_short_gaps(envelope_of(reading.trace))[rows]
        if len(rows) > 2 and not np.isnan(samples).any():
            found.append(EchoPulse(angle, times[rows], samples))
    return tuple(found)


def _without_short_gaps(envelope: FloatArray) -> FloatArray:
    """Return an envelope with gaps of at most _SHORT_GAP samples filled by interpolation.

    A board loses a sample when it times an echo, so most echoes have such a gap.
    """
    lost = np.isnan(envelope)
    if not lost.any() or lost.all():
        return envelope
    rows, known = np.arange(len(envelope)), np.flatnonzero(~lost)
    after = known[np.minimum(np.searchsorted(known, rows), len(known) - 1)]
    before = known[np.maximum(np.searchsorted(known, rows, side="right") - 1, 0)]
    short = lost & (after - before - 1 <= _SHORT_GAP) & (before < rows) & (rows < after)
    return np.where(short, np.interp(rows, known, envelope[known]), envelope)


def peak_of(samples: FloatArray) -> float:
    """Return the peak of an envelope, by a parabola through the largest sample and its neighbours."""
    row = int(samples.argmax())
    if not 0 < row < len(samples) - 1:
        return float(samples[row])
    before, here, after = samples[row - 1 : row + 2]
    bend = before - 2 * here + after
    return float(here if bend == 0 else here - (after - before) ** 2 / (8 * bend))


def _mean_peaks(pulses: Sequence[EchoPulse], angles: FloatArray) -> FloatArray:
    """Return the mean level of the peaks at each heading, dB, NaN without traces, (n,)."""
    sums, counts = np.zeros(len(angles)), np.zeros(len(angles))
    for pulse in pulses:
        row = int(np.searchsorted(angles, round(pulse.angle, 9) - 1e-10))
        sums[row] += 20 * math.log10(max(peak_of(pulse.samples), _QUIET))
        counts[row] += 1
    means = np.full(len(angles), np.nan)
    np.divide(sums, counts, out=means, where=counts > 0)
    return means


def _begin(readings: Sequence[Reading], distance: float) -> EchoPulse | None:
    """Return the mean of all traces from the start of transmission to the echo of the plate."""
    traces = [one for one in readings if one.trace is not None]
    parts = []
    for one in traces:
        assert one.trace is not None
        times = one.trace.times
        parts.append((times, envelope_of(one.trace)[times < 2 * distance / one.speed_of_sound - _BEFORE]))
    length = min((len(samples) for _, samples in parts), default=0)
    if length == 0:
        return None
    return EchoPulse(0.0, parts[0][0][:length], np.nanmean([samples[:length] for _, samples in parts], axis=0))


def _middle(found: PlateReadings, board: Board) -> float:
    """Return the turntable angle of the perpendicular, rad, with which the levels of the board differ least.

    The sum of absolute differences, so that objects beside the plate have little effect.
    """
    levels = plate_levels(board, found.speed_of_sound, found.distance)
    traces = not np.isnan(found.peaks).all()
    if traces:
        measured = np.clip(np.nan_to_num(found.peaks, nan=_FLOOR_DB), _FLOOR_DB, 20 * math.log10(found.largest))
    else:
        measured = found.heard / found.pings

    def difference(middle: float) -> float:
        angles = found.angles - middle
        if traces:
            expected = np.clip(levels.peaks_at(angles), _FLOOR_DB, 20 * math.log10(found.largest))
        else:
            expected = (levels.detected_at(angles) > board.threshold_db).astype(np.float64)
        return float(np.abs(measured - expected).sum())

    middles = found.direction + np.arange(-MOST_TURN, MOST_TURN + _TURN_STEP, _TURN_STEP)
    differences = np.array([difference(middle) for middle in middles.tolist()])
    # several are equal where headings are far apart
    return float(middles[differences <= differences.min() * (1 + 1e-9)].mean())


def _check(found: PlateReadings) -> None:
    loud = int((found.heard > 0).sum())
    if loud < FEWEST and not (found.peaks > _LOUD_DB).sum() >= FEWEST:
        raise NoPlate(
            f"{found.name}: the plate is detected at {loud} headings, expected at least {FEWEST}; check that it is "
            f"{found.distance:g} m away and in the stated direction, or scan in smaller steps"
        )
    central = np.abs(found.angles - found.middle) <= max(_MIDDLE, found.step)
    faces = bool(found.heard[central].any()) or bool((found.peaks[central] > _LOUD_DB).any())
    if abs(found.middle - found.direction) > MOST_TURN - _TURN_STEP or not faces:
        raise NoPlate(
            f"{found.name}: the echo is not symmetric about any angle within {math.degrees(MOST_TURN):g} degrees of "
            f"{math.degrees(found.direction):g}; give the turntable angle that faces the plate as the direction"
        )
