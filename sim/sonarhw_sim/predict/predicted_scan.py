"""The predicted scan: the paths at one place, the reading at each heading, and what the board receives there.

`sonarhw_sim.predict.board_readings` makes the readings.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.burst import covered_by_burst
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import (
    SHARE,
    ReceivedEchoes,
    counted_time,
    detect_echoes,
    detect_first_echo,
    loudest_before,
)
from sonarhw_sim.board.traces import Arrivals, Noise, Response, Signal, received
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.board.weighing import BoolArray, Together, meeting_face, sum_of_arrival, sums_of_arrivals, together
from sonarhw_sim.choices import Receiver, Unit
from sonarhw_sim.predict.by_heading import standpoints
from sonarhw_sim.predict.levels import is_blanked, path_amplitudes, strengths
from sonarhw_sim.predict.scattered import ScatteredSound, scattered_sound
from sonarhw_sim.rays.paths import SLACK, Paths
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.incidence import reflectance_factors

_FREQUENCIES = 25  # at which the reflections of a path are multiplied


@dataclass(frozen=True)
class PredictedScan:
    """The readings that a board is predicted to report at one place."""

    room: Room
    place: Place
    board: Board
    headings: FloatArray  # (n,), rad in the room
    paths: Paths  # (p,), shortest first
    unit: Unit
    winners: NDArray[np.intp]  # (n,): row of the reported path; -1: no echo
    distances: FloatArray  # (n,), m: range at detection, without clock error, offset and rounding; NaN: no echo
    only_at: NDArray[np.intp] | None = None  # (p,): row of the only heading of each path; None: all paths exist at all
    sender_headings: FloatArray | None = None  # (p,), rad, of the senders; None: as of the receiver
    lateness: FloatArray | None = None  # (p,), m: apparent extra length of each path; None: 0
    receiver: Receiver = Receiver.FIRST_ECHO
    noise: float = 0.0  # of every signal, root mean square; 1 is full scale
    seed: int = 0  # of the noise
    grain: int | None = None  # seed of the speckle of rough surfaces; None: their mean power
    of_own_body: BoolArray | None = None  # (n,): which readings are of the carrier's own body; None: none

    @property
    def ranges(self) -> FloatArray:
        """Reported range at each heading, (n,) float, m; NaN where there is no echo."""
        return self.board.reported(self.distances)

    @cached_property
    def apparent_lengths(self) -> FloatArray:
        """Length of each path by the time that the board counts, (p,) m: true length plus `lateness`."""
        return self.paths.lengths if self.lateness is None else self.paths.lengths + self.lateness

    @cached_property
    def standpoints(self) -> FloatArray:
        """Position of the receiving transducer at each heading, (n, 2) m."""
        return standpoints(self.board, self.place, self.headings)

    @cached_property
    def blanked(self) -> BoolArray:
        """Which paths arrive while the board is blanked, (p,) bool."""
        return is_blanked(self.apparent_lengths, self.board, self.room)

    @cached_property
    def in_range(self) -> BoolArray:
        """Which paths arrive within range, (p,) bool."""
        return np.asarray(self.apparent_lengths <= 2 * self.board.max_range + SLACK)

    @cached_property
    def in_time(self) -> BoolArray:
        """Which paths arrive after blanking and within range, (p,) bool."""
        return ~self.blanked & self.in_range

    def ping(self, index: int) -> "PredictedPing":
        """Return what the board receives at heading `index`."""
        return PredictedPing(self, index)

    @cached_property
    def over_threshold(self) -> FloatArray:
        """Level of the loudest arrival after blanking and within range over the threshold, at each heading, (n,) dB.

        Below 0 there is no echo; -inf where nothing arrives within the beam and in time. The higher the level, the more
        certain is an echo at any range.
        """
        levels = (self.ping(k).levels for k in range(len(self.headings)))
        loudest = [of_heading[self.in_time].max(initial=-np.inf) for of_heading in levels]
        return np.array(loudest, dtype=np.float64) - self.board.threshold_db

    @cached_property
    def burst_length(self) -> float:
        """By how much the lengths of paths differ that are received at one instant, m."""
        return covered_by_burst(self.board, self.room.air.speed_of_sound)

    @property
    def unheard_amplitude(self) -> float:
        """Amplitude below which sound does not cause a detection."""
        return SHARE * 10 ** (self.board.threshold_db / 20)

    def rows_at(self, index: int) -> NDArray[np.intp]:
        """Return the rows of the paths that exist at heading `index`, (k,)."""
        return np.arange(len(self.paths)) if self.only_at is None else np.flatnonzero(self.only_at == index)

    def amplitudes_at(self, index: int, rows: NDArray[np.intp], paths: Paths) -> FloatArray:
        """Return the signed amplitudes of `paths`, which are `rows` of all, at heading `index`, (k,)."""
        senders = None if self.sender_headings is None else self.sender_headings[rows]
        heading = float(self.headings[index])
        amplitudes = path_amplitudes(self.room, self.board, heading, paths, self._strengths[rows], senders)
        amplitudes[self.blocked_at(index, paths)] = 0.0
        return amplitudes

    @cached_property
    def _strengths(self) -> FloatArray:
        """Amplitude of each path without the beam, (p,)."""
        return strengths(self.room, self.board, self.paths)

    def phasors_of(self, paths: Paths) -> ComplexArray:
        """Return the amplitudes of `paths` (p,) without the beam, with their phases; patches of rough surfaces: 0."""
        phases = np.where(paths.scattered, 0.0, np.exp(1j * np.nan_to_num(paths.phases)))
        return np.asarray(strengths(self.room, self.board, paths) * phases)

    @cached_property
    def all_together(self) -> Together:
        """Which of all paths arrive together."""
        return self.together_in(np.arange(len(self.paths)))

    def together_in(self, rows: NDArray[np.intp]) -> Together:
        """Return which of these paths arrive together."""
        lengths, wavelength = self.apparent_lengths[rows], self.board.wavelength(self.room.air)
        return together(lengths, np.nan_to_num(self.paths.phases[rows]), wavelength, self.board)

    def blocked_by_face(self, paths: Paths, headings: FloatArray) -> BoolArray:
        """Return the paths that end at the face of a unit that blocks, (n, p) bool for headings (n,); (0, 0): none."""
        if self.only_at is not None or self.unit is not Unit.BLOCK:
            return np.empty((0, 0), dtype=np.bool_)
        return meeting_face(
            paths.points - np.array(self.board.at_axis(self.place).position), headings, self.board.aperture_radius
        )

    def blocked_at(self, index: int, paths: Paths) -> BoolArray:
        """Return the paths that end at the face of a unit that blocks, at heading `index`, (p,) bool."""
        blocked = self.blocked_by_face(paths, self.headings[index : index + 1])
        return blocked[0] if len(blocked) else np.zeros(len(paths), dtype=np.bool_)

    @cached_property
    def response(self) -> Response | None:
        """Amplitude of each path by frequency, relative to the carrier; None if it does not depend on frequency."""
        knots = [table.frequencies for table in self.room.tables.values() if len(table.frequencies) > 1]
        if not knots:
            return None
        ends = np.concatenate(knots)
        # several reflections are a product, which is not straight between the frequencies of a table
        frequencies = np.unique(np.concatenate((ends, np.linspace(ends.min(), ends.max(), _FREQUENCIES))))
        factors = reflectance_factors(self.room, self.paths, np.append(self.board.frequency, frequencies))
        audible = np.where(factors[:, :1] > 0, factors[:, :1], np.inf)
        return Response(frequencies - self.board.frequency, factors[:, 1:] / audible)


@dataclass(frozen=True)
class Echo:
    """One detectable arrival at one heading: one path, or several within one wavelength."""

    path: int  # row in the scan's paths, of the loudest
    range: float  # m, as the board reports it
    level_db: float  # of their sum, at the detector, relative to a perfect wall straight ahead
    length: float  # m, apparent length of its path; of scattered sound, when it is loud enough


@dataclass(frozen=True)
class PredictedPing:
    """What the board of a scan receives at one of its headings.

    An arrival begins with a path, and contains the paths up to one wavelength longer (unless the board does not sum
    arrivals). Arrays of arrivals have a row for each path of the scan.
    """

    scan: PredictedScan
    index: int  # of the heading

    @property
    def heading(self) -> float:
        """Heading of the receiver in the room, rad."""
        return float(self.scan.headings[self.index])

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """Rows of the scan's paths that exist at this heading, (k,)."""
        return self.scan.rows_at(self.index)

    @cached_property
    def _paths(self) -> Paths:
        return self.scan.paths if self.scan.only_at is None else self.scan.paths.select(self.rows)

    @property
    def _lengths(self) -> FloatArray:
        return self.scan.apparent_lengths[self.rows]

    @cached_property
    def _amplitudes(self) -> FloatArray:
        return self.scan.amplitudes_at(self.index, self.rows, self._paths)

    @property
    def _coherent(self) -> FloatArray:
        """Amplitude of each path (k,), 0 for patches of rough surfaces."""
        return np.where(self._paths.scattered, 0.0, self._amplitudes)

    @property
    def _together(self) -> Together:
        return self.scan.all_together if self.scan.only_at is None else self.scan.together_in(self.rows)

    @cached_property
    def _scattered(self) -> ScatteredSound | None:
        """The sound of rough surfaces; rows are those of the paths that exist here."""
        grain, rough = self.scan.grain, np.flatnonzero(self._paths.scattered)
        seed: tuple[int, ...] = () if grain is None else (grain, 5)
        # patches that exist at one heading only have a grain of their own
        if seed and self.scan.only_at is not None:
            seed += (whole_microdegrees(self.heading),)
        if not len(rough):
            return None
        spreads = self._paths.spreads[rough]
        return scattered_sound(
            self._lengths[rough], spreads, self._amplitudes[rough], rough, self.scan.burst_length, seed
        )

    @cached_property
    def _arrivals(self) -> tuple[FloatArray, NDArray[np.intp]]:
        sums, loudest = sums_of_arrivals(self._coherent, self._together)
        if self._scattered is not None:
            sums, loudest = self._scattered.added_to(sums, loudest, self._lengths)
        amplitudes, members = np.zeros(len(self.scan.paths)), np.arange(len(self.scan.paths))
        amplitudes[self.rows], members[self.rows] = sums, self.rows[loudest]
        return _decibels(amplitudes), members

    @property
    def levels(self) -> FloatArray:
        """Level of each arrival, (p,) dB relative to a perfect wall straight ahead; -inf where nothing arrives."""
        return self._arrivals[0]

    @property
    def loudest(self) -> NDArray[np.intp]:
        """Loudest path of each arrival, (p,) rows of the scan's paths."""
        return self._arrivals[1]

    @property
    def arrival_lengths(self) -> FloatArray:
        """Apparent path length of each arrival, (p,) m.

        It is that of the loudest path, or for scattered sound, which builds up while the burst passes, that of the path
        with which the arrival begins.
        """
        lengths = self.scan.apparent_lengths
        return np.where(self.scan.paths.scattered[self.loudest], lengths, lengths[self.loudest])

    @property
    def level_of_reading(self) -> float:
        """Level of the arrival that gave the reading, dB; expects a winner.

        For the board's own receiver, it is the arrival that begins with the winner.
        """
        scan, winner = self.scan, int(self.scan.winners[self.index])
        if scan.paths.scattered[winner]:
            assert self._scattered is not None
            # the board's own receiver detects sound while it arrives, the paper's at its begin
            begin = 2 * float(scan.distances[self.index]) - (
                scan.burst_length if scan.receiver is Receiver.BOARD else 0.0
            )
            return self._scattered.level_from(begin)
        if scan.receiver is Receiver.BOARD:
            row = int(np.searchsorted(self.rows, winner))
            return float(_decibels(sum_of_arrival(self._coherent, self._together, row)))
        levels, loud_enough = self.levels, self.levels >= scan.board.threshold_db
        detected = np.flatnonzero((self.loudest == winner) & scan.in_time & loud_enough)
        return float(levels[detected[0] if len(detected) else winner])

    def signal(self, duration: float) -> Signal:
        """Return the receive signal for `duration` s from the start of transmission."""
        scan = self.scan
        return received(self.sound, scan.board, scan.room.air.speed_of_sound, duration, scan.receiver, self._noise)

    def echo_times(self) -> FloatArray:
        """Return all echoes that the board reports, earliest first, (k,) s by its clock.

        The first gives the range. The paper's receiver reports one, the board's own as many as re-arming allows.
        """
        scan, speed = self.scan, self.scan.room.air.speed_of_sound
        if scan.receiver is Receiver.BOARD:
            return counted_time(detect_echoes(self.sound, scan.board, speed, self._noise).times, scan.board)
        distance = scan.distances[self.index : self.index + 1]
        return counted_time(2 * distance[~np.isnan(distance)] / speed, scan.board)

    def first_detected(self) -> ReceivedEchoes:
        """Return the first echo of the board's own receiver, in its noise; `winner` is a row of the scan's paths."""
        scan = self.scan
        detected = detect_first_echo(self.sound, scan.board, scan.room.air.speed_of_sound, self._noise)
        if not len(detected.times):
            return detected
        return replace(detected, winner=self._responsible(float(detected.times[0]), detected.winner))

    def path_detected(self, time: float, signal: Signal) -> int:
        """Return the path that the board's own receiver detects in this `signal` at `time` (s); -1: none."""
        speed = self.scan.room.air.speed_of_sound
        return self._responsible(time, loudest_before(time, signal.samples, self.sound, self.scan.board, speed))

    def _responsible(self, time: float, loudest: int) -> int:
        """Return the path detected at `time` (s): the loudest arrival, or a rough surface that is louder; -1: none."""
        # rows beyond the paths are scatterers of a grain
        winner = loudest if loudest < len(self.rows) else -1
        if self._scattered is not None:
            coherent = abs(float(self._amplitudes[winner])) if winner >= 0 else 0.0
            length = time * self.scan.room.air.speed_of_sound
            patch = self._scattered.responsible_at(length, max(coherent, self.scan.unheard_amplitude))
            winner = patch if patch >= 0 else winner
        # winner -1, "no path", selects the appended -1
        return int(np.append(self.rows, -1)[winner])

    @cached_property
    def sound(self) -> Arrivals:
        """All sound that arrives, before the effect of the transducer."""
        scan, paths = self.scan, self._paths
        amplitudes, blocked = scan.phasors_of(paths), scan.blocked_at(self.index, paths)
        amplitudes[blocked] = 0.0
        senders = self.heading if scan.sender_headings is None else scan.sender_headings[self.rows]
        leaving = paths.leaving[:, 0] * np.cos(senders) + paths.leaving[:, 1] * np.sin(senders)
        arriving = paths.arriving[:, 0] * np.cos(self.heading) + paths.arriving[:, 1] * np.sin(self.heading)
        speed, response = scan.room.air.speed_of_sound, scan.response
        if response is not None:
            response = replace(response, factors=response.factors[self.rows])
        arrivals = Arrivals(self._lengths / speed, amplitudes, leaving, arriving, response=response)
        if self._scattered is None:
            return arrivals
        if self._scattered.grain is None:
            return replace(arrivals, patches=self._scattered.patches)
        return self._with_grain(arrivals, self._scattered, blocked)

    def _with_grain(self, arrivals: Arrivals, scattered: ScatteredSound, blocked: BoolArray) -> Arrivals:
        """Return the arrivals and the scatterers of a grain."""
        assert scattered.grain is not None
        grain, rows, response = scattered.grain, scattered.rows[scattered.grain.rows], arrivals.response
        amplitudes = strengths(self.scan.room, self.scan.board, self._paths)[rows] * grain.factors
        amplitudes[blocked[rows]] = 0.0
        return Arrivals(
            np.concatenate((arrivals.times, grain.lengths / self.scan.room.air.speed_of_sound)),
            np.asarray(np.concatenate((arrivals.amplitudes, amplitudes)), dtype=np.complex128),
            np.concatenate((arrivals.leaving, arrivals.leaving[rows])),
            np.concatenate((arrivals.arriving, arrivals.arriving[rows])),
            response=response and replace(response, factors=np.vstack((response.factors, response.factors[rows]))),
        )

    @property
    def _noise(self) -> Noise:
        # a function of the heading, independent of the other headings
        return Noise(self.scan.noise, (self.scan.seed, whole_microdegrees(self.heading)))

    @cached_property
    def echoes(self) -> tuple[Echo, ...]:
        """All arrivals after blanking that are loud enough, earliest first."""
        return self._as_echoes(self._loud(self.scan.in_time))

    @cached_property
    def blanked_echoes(self) -> tuple[Echo, ...]:
        """All arrivals within blanking that are loud enough, earliest first."""
        return self._as_echoes(self._loud(self.scan.blanked & self.scan.in_range))

    @property
    def first_echo(self) -> Echo | None:
        """The first of `echoes`, or None without any."""
        return next(iter(self._as_echoes(islice(self._loud(self.scan.in_time), 1))), None)

    def _as_echoes(self, arrivals: Iterable[tuple[int, float, float]]) -> tuple[Echo, ...]:
        """Return the echoes of these arrivals, each with its path, level (dB) and apparent length (m)."""
        found = tuple(arrivals)
        ranges = self.scan.board.reported(np.array([length / 2 for _, _, length in found], dtype=np.float64))
        return tuple(
            Echo(path, reported, level, length)
            for (path, level, length), reported in zip(found, ranges.tolist(), strict=True)
        )

    def _loud(self, among: BoolArray) -> Iterator[tuple[int, float, float]]:
        """Yield path, level (dB) and apparent length (m) of each arrival that is loud enough."""
        scan, levels = self.scan, self.levels
        scattered, board = self._scattered, self.scan.board
        loud = np.flatnonzero((levels >= board.threshold_db) & np.isfinite(levels) & among)
        span = board.wavelength(scan.room.air) if board.sum_arrivals else -1.0
        until, until_scattered = -math.inf, -math.inf  # ends of the last arrivals
        columns = (scan.apparent_lengths, self.loudest, levels, self.arrival_lengths)
        for begin, path, level, length in zip(*(column[loud].tolist() for column in columns), strict=True):
            # paths within an arrival begin no other one
            if begin <= until:
                continue
            if scattered is None or not scan.paths.scattered[path]:
                until = until_scattered = begin + span
            elif begin <= until_scattered:
                continue
            else:
                length = scattered.reaches(board.threshold_db, begin)
                level, until_scattered = scattered.level_from(length), length + scan.burst_length
            yield path, level, length


def silent_scan(
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    paths: Paths,
    only_at: NDArray[np.intp] | None = None,
    unit: Unit = Unit.PASS,
) -> PredictedScan:
    """Return a scan without readings."""
    winners, distances = np.full(len(headings), -1, dtype=np.intp), np.full(len(headings), np.nan)
    return PredictedScan(room, place, board, headings, paths, unit, winners, distances, only_at)


def _decibels(amplitudes: float | FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(amplitudes))


def whole_microdegrees(heading: float) -> int:
    """Return a heading or angle (rad) in whole microdegrees, 0 to 360 million, as part of a seed."""
    return round(math.degrees(heading) * 1e6) % 360_000_000
