"""Scans of a flat plate: the signal that a board receives from it, and what the readings of a scan contain about it.

A scan at a known distance shows where the plate is heard, how loud, and the beginning of each trace. If the plate also
faces the scanner in a known direction, it shows the range offset and the zero of the turntable (`faced_plate`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Board, uncompensated_db
from sonarhw_sim.board.receiver import charge_of_burst, kept_charge
from sonarhw_sim.board.signal import RATE, Arrivals, before_gain, burst_of, covered_by_burst, gain_at_samples, pulses
from sonarhw_sim.predict.room_echoes import ARC_MIDDLE, RIM

from sonarhw.errors import NoPlate, counted
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.pictures import envelope_of, in_db

# The signal that a board receives from a large flat plate, by the angle between transducer and plate.
#
# The plate is perfect and endless, so that its echo is a single arrival: the image of the receiver in the plate.


WIDEST = math.radians(45.0)  # between transducer and plate; beyond, echoes are not used
_STEP = math.radians(0.25)
_ANGLES = np.arange(-round(WIDEST / _STEP), round(WIDEST / _STEP) + 1, dtype=np.float64) * _STEP
FAINTEST_DB = -80.0  # lower end of levels; the nulls of a beam have none
_KEPT = 64  # plates whose levels are cached


@dataclass(frozen=True)
class PlateLevels:
    """Levels of a plate's echo by angle; 0 dB is a perfect wall straight ahead after the ideal gain."""

    angles: FloatArray  # (n,), rad, increasing; from the perpendicular of the plate to the heading
    peaks: FloatArray  # (n,), dB, of the envelope after the gain
    detected: FloatArray  # (n,), dB, as the detector compares it with the threshold

    def peaks_at(self, angles: FloatArray) -> FloatArray:
        """Return the levels of the peak at `angles` (rad), dB, same shape."""
        return np.asarray(np.interp(angles, self.angles, self.peaks))

    def detected_at(self, angles: FloatArray) -> FloatArray:
        """Return the levels at the detector at `angles` (rad), dB, same shape."""
        return np.asarray(np.interp(angles, self.angles, self.detected))

    def slopes_at(self, angles: FloatArray) -> FloatArray:
        """Return the change of `detected_at` with the angle, dB/rad, same shape."""
        return np.asarray(np.interp(angles, self.angles, np.gradient(self.detected, self.angles)))


@dataclass(frozen=True)
class PlateEnvelopes:
    """Envelopes of a plate's echo, one row for each angle."""

    rows: NDArray[np.intp]  # (n, k), numbers of the samples
    samples: FloatArray  # (n, k); after the gain, 1 is a perfect wall straight ahead after the ideal gain

    @property
    def times(self) -> FloatArray:
        """Times of the samples, s since the start of transmission, (n, k)."""
        return self.rows / RATE

    def after_gain(self, board: Board) -> "PlateEnvelopes":
        """Return the envelopes after the gain of a board."""
        gains = gain_at_samples(int(self.rows.max()) + 1, board, board.receiver)
        return replace(self, samples=self.samples * gains[self.rows])


def plate_levels(board: Board, speed_of_sound: float, distance: float) -> PlateLevels:
    """Return the levels of a plate at `distance` m from the face when it points straight at the plate."""
    # a fit tries many thresholds, on which no level depends
    return _levels(replace(board, threshold_db=0.0), speed_of_sound, distance)


@lru_cache(maxsize=_KEPT)
def _levels(board: Board, speed_of_sound: float, distance: float) -> PlateLevels:
    computed = _computed_angles(board)
    # likewise, the gain acts on pulses that do not depend on its steps
    envelopes = _kept_pulses(replace(board, gain_step_db=0.0), speed_of_sound, distance).after_gain(board).samples
    peaks = in_db(envelopes.max(axis=1), FAINTEST_DB)
    if board.receiver is Receiver.BOARD:
        kept = kept_charge(board)
        charges = lfilter([1.0 - kept], [1.0, -kept], envelopes, axis=1).max(axis=1)
        detected = in_db(charges / charge_of_burst(board, speed_of_sound), FAINTEST_DB)
    else:
        detected = _carrier_levels(board, speed_of_sound, distance, computed)
    if len(computed) < len(_ANGLES):
        peaks, detected = (np.concatenate((half[:0:-1], half)) for half in (peaks, detected))
    return PlateLevels(_ANGLES, peaks, detected)


def _computed_angles(board: Board) -> FloatArray:
    """Return the angles to compute, rad: from 0 on if those to the left have the same levels, else all."""
    return _ANGLES if board.mount.aside else _ANGLES[len(_ANGLES) // 2 :]


def plate_envelopes(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> PlateEnvelopes:
    """Return the envelopes at `angles` (n,) rad from the perpendicular of the plate to the heading."""
    return _before_gain(board, speed_of_sound, distance, angles).after_gain(board)


@lru_cache(maxsize=_KEPT // 2)
def _kept_pulses(board: Board, speed_of_sound: float, distance: float) -> PlateEnvelopes:
    return _before_gain(board, speed_of_sound, distance, _computed_angles(board))


def _before_gain(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> PlateEnvelopes:
    arrivals = before_gain(_arrivals(board, speed_of_sound, distance, angles), board, speed_of_sound, board.receiver)
    signals, first = pulses(arrivals, board, burst_of(board, speed_of_sound), speed_of_sound)
    return PlateEnvelopes(np.maximum(first[:, None] + np.arange(signals.shape[1]), 0), np.abs(signals))


def _arrivals(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> Arrivals:
    """Return the arrival at each angle: the straight line from the sender to the image of the receiver."""
    senders, receivers = board.mount.positions(angles)
    images = np.column_stack((2 * (distance + board.mount.ahead) - receivers[:, 0], receivers[:, 1]))
    ways = images - senders
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    headings = np.column_stack((np.cos(angles), np.sin(angles)))
    leaving = (ways * headings).sum(axis=1) / lengths
    # the way back, seen from the receiver, is the way there reflected in the plate
    arriving = (ways * (1.0, -1.0) * headings).sum(axis=1) / lengths
    air = air_of(speed_of_sound)
    return Arrivals(lengths / speed_of_sound, 10 ** (-uncompensated_db(lengths, board, air) / 20), leaving, arriving)


def _carrier_levels(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> FloatArray:
    """Return the levels at the detector of the paper's receiver, which weighs the carrier alone, (n,) dB."""
    arrivals, air = _arrivals(board, speed_of_sound, distance, angles), air_of(speed_of_sound)
    ka = board.wavenumber(air) * board.aperture_radius
    beams = [beam_gain(np.arccos(np.clip(cosines, -1, 1)), ka) for cosines in (arrivals.leaving, arrivals.arriving)]
    return in_db(np.abs(arrivals.amplitudes) * beams[0] * beams[1], FAINTEST_DB)


def air_of(speed_of_sound: float) -> Air:
    """Return air of 50 % humidity with this speed of sound; 20 °C if no temperature has it."""
    temperature = Air().temperature_at(speed_of_sound)
    return Air() if temperature is None else Air(temperature)


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
    near = [reading for reading in readings if abs(math.remainder(reading.angle - direction, math.tau)) <= WIDEST]
    turned = np.array([direction + math.remainder(reading.angle - direction, math.tau) for reading in near])
    angles, rows = np.unique(np.round(turned, 9), return_inverse=True)
    pings = np.bincount(rows, minlength=len(angles))
    heard = _heard(near, rows, len(angles), distance - NEARER, distance + FARTHER)
    pulses = _pulses(near, turned, distance, board)
    plate = PlateReadings(
        name,
        distance,
        direction,
        float(np.median([reading.speed_of_sound for reading in readings])),
        angles,
        pings,
        heard,
        _mean_peaks(pulses, angles),
        np.array([reading.echo_times[0] for reading in readings if reading.echo_times]),
        blanked_until,
        pulses,
        _begin(near, distance),
        max((float(np.nanmax(pulse.samples)) for pulse in pulses), default=0.0),
    )
    plate = replace(plate, middle=_middle(plate, board))
    _check(plate)
    central = [reading for reading, angle in zip(near, turned, strict=True) if abs(angle - plate.middle) < _CENTRAL]
    within = [[echo for echo in reading.echo_ranges if abs(echo - distance) <= NEARER] for reading in central]
    # a long burst is reported again once the board has re-armed, so only the first echo counts
    ranges = [echoes[0] for echoes in within if echoes]
    if not ranges:
        return plate
    first, latest = float(np.median(ranges)), covered_by_burst(board, plate.speed_of_sound) / 2
    return replace(plate, heard=_heard(near, rows, len(angles), first - _SPREAD, first + latest + _SPREAD))


def _heard(
    readings: Sequence[Reading], rows: NDArray[np.intp], count: int, nearest: float, farthest: float
) -> NDArray[np.intp]:
    """Return how many pings at each heading have an echo from `nearest` to `farthest` m, (count,)."""
    heard = [any(nearest <= echo <= farthest for echo in reading.echo_ranges) for reading in readings]
    return np.bincount(rows[np.array(heard, dtype=np.bool_)], minlength=count)


def _pulses(readings: Sequence[Reading], angles: FloatArray, distance: float, board: Board) -> tuple[EchoPulse, ...]:
    """Return the part of each trace with the echo of the plate."""
    burst = sum(tone.cycles / tone.frequency for tone in board.burst)
    pulses = []
    for reading, angle in zip(readings, angles.tolist(), strict=True):
        if reading.trace is None:
            continue
        time, times = 2 * distance / reading.speed_of_sound, reading.trace.times
        rows = np.flatnonzero((times >= time - _BEFORE) & (times <= time + burst + _AFTER))
        samples = _without_short_gaps(envelope_of(reading.trace))[rows]
        if len(rows) > 2 and not np.isnan(samples).any():
            pulses.append(EchoPulse(angle, times[rows], samples))
    return tuple(pulses)


def _without_short_gaps(envelope: FloatArray) -> FloatArray:
    """Return an envelope with gaps of at most _SHORT_GAP samples filled by interpolation.

    A board loses a sample when it times an echo, so most echoes have such a gap.
    """
    lost = np.isnan(envelope)
    if not lost.any() or lost.all():
        return envelope
    rows, measured = np.arange(len(envelope)), np.flatnonzero(~lost)
    after = measured[np.minimum(np.searchsorted(measured, rows), len(measured) - 1)]
    before = measured[np.maximum(np.searchsorted(measured, rows, side="right") - 1, 0)]
    short = lost & (after - before - 1 <= _SHORT_GAP) & (before < rows) & (rows < after)
    return np.where(short, np.interp(rows, measured, envelope[measured]), envelope)


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
    traces = [reading for reading in readings if reading.trace is not None]
    parts = []
    for trace in traces:
        assert trace.trace is not None
        times = trace.trace.times
        parts.append((times, envelope_of(trace.trace)[times < 2 * distance / trace.speed_of_sound - _BEFORE]))
    length = min((len(samples) for _, samples in parts), default=0)
    if length == 0:
        return None
    return EchoPulse(0.0, parts[0][0][:length], np.nanmean([samples[:length] for _, samples in parts], axis=0))


def _middle(plate: PlateReadings, board: Board) -> float:
    """Return the turntable angle of the perpendicular, rad, with which the levels of the board differ least.

    The sum of absolute differences, so that objects beside the plate have little effect.
    """
    levels = plate_levels(board, plate.speed_of_sound, plate.distance)
    traces = not np.isnan(plate.peaks).all()
    if traces:
        measured = np.clip(np.nan_to_num(plate.peaks, nan=_FLOOR_DB), _FLOOR_DB, 20 * math.log10(plate.largest))
    else:
        measured = plate.heard / plate.pings

    def difference(middle: float) -> float:
        angles = plate.angles - middle
        if traces:
            expected = np.clip(levels.peaks_at(angles), _FLOOR_DB, 20 * math.log10(plate.largest))
        else:
            expected = (levels.detected_at(angles) > board.threshold_db).astype(np.float64)
        return float(np.abs(measured - expected).sum())

    middles = plate.direction + np.arange(-MOST_TURN, MOST_TURN + _TURN_STEP, _TURN_STEP)
    differences = np.array([difference(middle) for middle in middles.tolist()])
    # several are equal where headings are far apart
    return float(middles[differences <= differences.min() * (1 + 1e-9)].mean())


def _check(plate: PlateReadings) -> None:
    loud = int((plate.heard > 0).sum())
    if loud < FEWEST and not (plate.peaks > _LOUD_DB).sum() >= FEWEST:
        raise NoPlate(
            f"{plate.name}: the plate is detected at {loud} headings, expected at least {FEWEST}; check that it is "
            f"{plate.distance:g} m away and in the stated direction, or scan in smaller steps"
        )
    central = np.abs(plate.angles - plate.middle) <= max(_MIDDLE, plate.step)
    faces = bool(plate.heard[central].any()) or bool((plate.peaks[central] > _LOUD_DB).any())
    if abs(plate.middle - plate.direction) > MOST_TURN - _TURN_STEP or not faces:
        raise NoPlate(
            f"{plate.name}: the echo is not symmetric about any angle within {math.degrees(MOST_TURN):g} degrees of "
            f"{math.degrees(plate.direction):g}; give the turntable angle that faces the plate as the direction"
        )


# Estimate home angle and range offset of a scanner from a scan of a flat plate at a known distance.
#
# While the plate is in the main lobe of the beam, all headings measure the same range. They form an arc (a region of
# constant depth) that is symmetric about the perpendicular of the plate. The range is the median over the middle of
# the arc. The direction of the plate is the mean heading of the arc, each heading weighted by the share of its pings
# that detected the plate. Echoes of the plate's rims, which are some millimetres farther away, and of the side lobes
# are outside the arc.
#
# Echoes that are not plausible for a flat plate at that distance are refused. A plate that is turned by a few
# degrees, or a distance that is wrong by a few centimetres, cannot be distinguished from a home angle and a range
# offset.


_GATE = 0.30  # m; ranges further from the stated distance are not from the plate
MOST_OFFSET = 0.10  # m; the offset of such a board is a few centimetres
MOST_HOME_ANGLE = math.radians(10.0)  # between the perpendicular of the plate and the direction that it should face
MOST_SPREAD = 0.010  # m, standard deviation of the ranges in the middle
MOST_SLOPE = 0.010  # m, change of the range over the middle
_JUMP = 0.015  # m; from one heading to the next, ranges of a plate differ less
_SCATTERED = 2  # headings in a row with such ranges are not a rim, but scatter


@dataclass(frozen=True)
class FacedPlate:
    """What a scan shows of a plate that faces the scanner in a stated direction."""

    distance: float  # m, stated
    range_offset: float  # m, measured minus true, without the delay of the receiver
    range_spread: float  # m, standard deviation of the ranges in the middle of the arc
    home_angle: float  # rad, actual minus intended direction of the turntable's zero, counter-clockwise
    home_uncertainty: float  # rad, standard error; depends on the step only
    arc: float  # rad, width of the arc at which the plate was detected
    headings: int  # number of headings that detected the plate

    @property
    def line(self) -> str:
        """The same in words."""
        return (
            f"plate at {self.distance:g} m: range offset {self.range_offset * 1000:+.1f} mm "
            f"(spread {self.range_spread * 1000:.1f} mm), home angle {math.degrees(self.home_angle):+.2f} degrees "
            f"(± {math.degrees(self.home_uncertainty):.2f}); echo over {math.degrees(self.arc):.1f} degrees, "
            f"{counted(self.headings, 'heading')}"
        )


def faced_plate(
    readings: Sequence[Reading],
    distance: float,
    direction: float,
    arcs: tuple[float, float] = (0.0, math.tau),
    delay: float = 0.0,
) -> FacedPlate:
    """Return what readings show of a plate, `distance` m from the transducer.

    The face of the plate is perpendicular to `direction` (rad), the angle that the turntable should have when it points
    at the plate. `arcs` (rad) are the smallest and the largest plausible arc, to which the step of the scan is added.
    `delay` (m) is the part of the range that the board's receiver adds and every prediction contains; it is no offset.
    Raises NoPlate if too few headings detect the plate, if the first or last heading detects it, or if the echoes do
    not fit a flat plate.
    """
    angles, rows = np.unique(np.round([reading.angle for reading in readings], 9), return_inverse=True)
    near = [[echo for echo in reading.echo_ranges if abs(echo - distance) <= _GATE] for reading in readings]
    ranges = [np.array([near[k][0] for k in np.flatnonzero(rows == row) if near[k]]) for row in range(len(angles))]
    hits = _longest_arc(ranges)
    _check_hits(hits, angles, distance, readings)
    step = float(np.median(np.diff(angles)))
    shares = np.array([len(plate) for plate in ranges]) / np.bincount(rows)
    _check_flatness([ranges[k] for k in _central(hits, angles, shares, step)])
    hits = _without_rims(hits, ranges)
    middle, arc = _arc_of(hits, angles, shares, step)
    measured = np.concatenate([ranges[k] for k in _central(hits, angles, shares, step)])
    plate = FacedPlate(
        distance=distance,
        range_offset=float(np.median(measured)) - distance - delay,
        range_spread=float(np.std(measured)),
        # + 0.0 turns -0.0 into 0.0
        home_angle=math.remainder(direction - middle, math.tau) + 0.0,
        # each end of the arc has a uniform error over one step: standard deviation step / √12; the middle is their mean
        home_uncertainty=step / math.sqrt(12) / math.sqrt(2),
        arc=arc,
        headings=len(hits),
    )
    # the ends of an arc are known within a step
    _check_plate(plate, middle, (arcs[0] - step, arcs[1] + step))
    return plate


def _longest_arc(ranges: Sequence[FloatArray]) -> NDArray[np.intp]:
    """Return the longest row of consecutive headings whose ranges differ little from one to the next, (n,) int."""
    longest: list[int] = []
    row: list[int] = []
    last = math.nan
    for k, echoes in enumerate(ranges):
        here = float(np.median(echoes)) if len(echoes) else math.nan
        continues = abs(here - last) <= _JUMP
        row = [*row, k] if continues else [k] if len(echoes) else []
        longest = max(longest, row, key=len)
        last = here
    return np.array(longest, dtype=np.intp)


def _check_hits(hits: NDArray[np.intp], angles: FloatArray, distance: float, readings: Sequence[Reading]) -> None:
    if len(hits) < FEWEST:
        count = counted(len(hits), "heading")
        raise NoPlate(
            f"the plate is detected at {count} in a row, expected at least {FEWEST}; {_found_instead(readings)}; check "
            f"that it is {distance:g} m away and faces the scanner, or use smaller steps or a larger plate"
        )
    if hits[0] == 0 or hits[-1] == len(angles) - 1:
        end = math.degrees(angles[0 if hits[0] == 0 else -1])
        raise NoPlate(
            f"echoes near {distance:g} m reach {end:.4g} degrees, the end of the sector; check that the plate is "
            f"{distance:g} m away; if it is, use a wider sector"
        )


def _found_instead(readings: Sequence[Reading]) -> str:
    ranges = [reading.range for reading in readings if reading.range is not None]
    if not ranges:
        return "no reading has an echo"
    return f"{len(ranges)} of {len(readings)} readings have an echo, with a median of {np.median(ranges):.2f} m"


def _arc_of(hits: NDArray[np.intp], angles: FloatArray, shares: FloatArray, step: float) -> tuple[float, float]:
    """Return the middle and the width of an arc, rad; each heading counts by its share of pings with an echo."""
    weights = shares[hits]
    return float(weights @ angles[hits] / weights.sum()), float(weights.sum()) * step


def _central(hits: NDArray[np.intp], angles: FloatArray, shares: FloatArray, step: float) -> NDArray[np.intp]:
    """Return the headings in the middle of an arc."""
    middle, arc = _arc_of(hits, angles, shares, step)
    return hits[np.abs(angles[hits] - middle) <= ARC_MIDDLE * arc / 2]


def _without_rims(hits: NDArray[np.intp], ranges: Sequence[FloatArray]) -> NDArray[np.intp]:
    """Return the longest row of the consecutive `hits` (n,) without a rim, which may join a side lobe to the arc."""
    medians = np.array([float(np.median(ranges[k])) for k in hits])
    plate = hits[medians <= np.median(medians) + RIM]
    row = max(np.split(plate, np.flatnonzero(np.diff(plate) > _SCATTERED + 1) + 1), key=len)
    return np.asarray(hits[(hits >= row[0]) & (hits <= row[-1])])


def _check_flatness(central: Sequence[FloatArray]) -> None:
    """Raise NoPlate unless the ranges in the middle of the arc, m by heading, are those of a flat plate."""
    middle, spread = np.array([float(np.median(echoes)) for echoes in central]), float(np.std(np.concatenate(central)))
    slope = float(np.polyfit(np.linspace(0, 1, len(middle)), middle, 1)[0]) if len(middle) > 1 else 0.0
    if spread > MOST_SPREAD or abs(slope) > MOST_SLOPE:
        raise NoPlate(
            f"the ranges in the middle of the echo have a standard deviation of {spread * 1000:.1f} mm and "
            f"change by {abs(slope) * 1000:.1f} mm from one side to the other, expected at most {MOST_SPREAD * 1000:g} "
            f"and {MOST_SLOPE * 1000:g} mm for a flat plate; place a flat plate there, and nothing else near it"
        )


def _check_plate(plate: FacedPlate, middle: float, arcs: tuple[float, float]) -> None:
    """Raise NoPlate unless distance, direction and strength of the echo are plausible."""
    if abs(plate.range_offset) > MOST_OFFSET:
        raise NoPlate(
            f"the echo comes from {plate.distance + plate.range_offset:.3f} m, expected {plate.distance:g} m within "
            f"{MOST_OFFSET * 100:g} cm; check that a plate stands there, and measure its distance from the face of the "
            "transducer"
        )
    if abs(plate.home_angle) > MOST_HOME_ANGLE:
        intended = math.degrees(middle + plate.home_angle)
        raise NoPlate(
            f"the middle of the echo is at {math.degrees(middle):.1f} degrees, expected {intended:.4g} degrees within "
            f"{math.degrees(MOST_HOME_ANGLE):g}; turn the plate so that it faces the scanner, or change the direction"
        )
    if not arcs[0] <= plate.arc <= arcs[1]:
        low, high = map(math.degrees, arcs)
        raise NoPlate(
            f"the echo is detected over {math.degrees(plate.arc):.1f} degrees, expected {low:.1f} to {high:.1f} for a "
            "flat plate and this board profile; use a flat plate of at least 30 cm, no post or corner; if it is one, "
            "correct threshold_db of the profile"
        )
