"""The predicted scan: the reading at each heading, and all levels, echoes and receive signals there."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.burst import covered_by_burst
from sonarhw_sim.board.first_echo import Sound, first_echoes
from sonarhw_sim.board.mount import own_range
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
from sonarhw_sim.board.weighing import (
    BoolArray,
    Together,
    beam_table,
    first_detected,
    meeting_face,
    sum_of_arrival,
    sums_of_arrivals,
    together,
)
from sonarhw_sim.choices import Receiver, Unit
from sonarhw_sim.predict.by_heading import standpoints
from sonarhw_sim.predict.levels import is_blanked, path_amplitudes, strengths, turned
from sonarhw_sim.predict.scattered import ScatteredSound, scattered_sound
from sonarhw_sim.rays.paths import SLACK, Paths
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.incidence import reflectance_factors

_FREQUENCIES = 25  # at which the reflections of a path are multiplied


@dataclass(frozen=True)
class Echo:
    """One detectable arrival at one heading: one path, or several within one wavelength."""

    path: int  # row in the scan's paths, of the loudest
    range: float  # m, as the board reports it
    level_db: float  # of their sum, at the detector, relative to a perfect wall straight ahead
    length: float  # m, apparent length of its path; of scattered sound, when it is loud enough


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

    def levels_at(self, index: int) -> FloatArray:
        """Return the level of the arrival that begins with each path at heading `index`, (p,) dB.

        It is the level of the sum of this path and of those up to one wavelength longer (unless the board does not sum
        arrivals), relative to a perfect wall straight ahead, and -inf where nothing arrives.
        """
        return self.arrivals_at(index)[0]

    def arrivals_at(self, index: int) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return `levels_at`, and the loudest path of each arrival, (p,) rows of `paths`."""
        here, amplitudes, sets = self._arriving_at(index)
        sums, loudest = sums_of_arrivals(amplitudes, sets)
        scattered = self._scattered_at(index)
        if scattered is not None:
            sums, loudest = scattered.added_to(sums, loudest, self.apparent_lengths[here])
        amplitudes, members = np.zeros(len(self.paths)), np.arange(len(self.paths))
        amplitudes[here], members[here] = sums, here[loudest]
        return _decibels(amplitudes), members

    def _arriving_at(self, index: int) -> tuple[NDArray[np.intp], FloatArray, Together]:
        """Return the rows of the paths at heading `index`, their amplitudes, and which arrive together.

        Patches of rough surfaces have an amplitude of 0 here.
        """
        here, paths = self._present_at(index)
        amplitudes = np.where(paths.scattered, 0.0, self._amplitudes_at(index, here, paths))
        return here, amplitudes, self._together if self.only_at is None else self._together_in(here)

    @cached_property
    def _together(self) -> Together:
        return self._together_in(np.arange(len(self.paths)))

    def _together_in(self, rows: NDArray[np.intp]) -> Together:
        lengths, wavelength = self.apparent_lengths[rows], self.board.wavelength(self.room.air)
        return together(lengths, np.nan_to_num(self.paths.phases[rows]), wavelength, self.board)

    def level_of_reading(self, index: int) -> float:
        """Return the level of the arrival that gave the reading at heading `index`, dB; expects a winner.

        For the board's own receiver, it is the arrival that begins with the winner.
        """
        winner = int(self.winners[index])
        if self.paths.scattered[winner]:
            scattered = self._scattered_at(index)
            assert scattered is not None
            # the board's own receiver detects sound while it arrives, the paper's at its begin
            begin = 2 * float(self.distances[index]) - (self._burst if self.receiver is Receiver.BOARD else 0.0)
            return scattered.level_from(begin)
        if self.receiver is Receiver.BOARD:
            here, amplitudes, sets = self._arriving_at(index)
            return float(_decibels(sum_of_arrival(amplitudes, sets, int(np.searchsorted(here, winner)))))
        levels, loudest = self.arrivals_at(index)
        detected = np.flatnonzero((loudest == winner) & self.in_time & (levels >= self.board.threshold_db))
        return float(levels[detected[0] if len(detected) else winner])

    def lengths_of_arrivals(self, loudest: NDArray[np.intp]) -> FloatArray:
        """Return the apparent path length of the arrival that begins with each path, (p,) m.

        It is that of the loudest path of the arrival (`arrivals_at`), or for scattered sound, which builds up while the
        burst passes, that of the path itself.
        """
        return np.where(self.paths.scattered[loudest], self.apparent_lengths, self.apparent_lengths[loudest])

    @cached_property
    def _burst(self) -> float:
        return covered_by_burst(self.board, self.room.air.speed_of_sound)

    def _amplitudes_at(self, index: int, here: NDArray[np.intp], paths: Paths) -> FloatArray:
        """Return the signed amplitude of each of the paths at heading `index`, (k,)."""
        heading, senders = float(self.headings[index]), self.sender_headings
        present = path_amplitudes(self.room, self.board, heading, paths, None if senders is None else senders[here])
        present[self._blocked_at(index, paths)] = 0.0
        return present

    def _scattered_at(self, index: int) -> ScatteredSound | None:
        """Return the sound of rough surfaces at heading `index`; rows are those of the paths that exist there."""
        here, paths = self._present_at(index)
        seed: tuple[int, ...] = () if self.grain is None else (self.grain, 5)
        # patches that exist at one heading only have a grain of their own
        if seed and self.only_at is not None:
            seed += (_microdegrees(self.headings[index]),)
        rough = np.flatnonzero(paths.scattered)
        if not len(rough):
            return None
        amplitudes = self._amplitudes_at(index, here[rough], paths.select(rough))
        return scattered_sound(
            self.apparent_lengths[here[rough]], paths.spreads[rough], amplitudes, rough, self._burst, seed
        )

    @cached_property
    def over_threshold(self) -> FloatArray:
        """Level of the loudest arrival after blanking and within range over the threshold, at each heading, (n,) dB.

        Below 0 there is no echo; -inf where nothing arrives within the beam and in time. The higher the level, the more
        certain is an echo at any range.
        """
        loudest = [self.levels_at(k)[self.in_time].max(initial=-np.inf) for k in range(len(self.headings))]
        return np.array(loudest, dtype=np.float64) - self.board.threshold_db

    def signal_at(self, index: int, duration: float) -> Signal:
        """Return the receive signal at heading `index` for `duration` s from the start of transmission."""
        speed, noise = self.room.air.speed_of_sound, self._noise_at(index)
        return received(self.sound_at(index), self.board, speed, duration, self.receiver, noise)

    def echo_times_at(self, index: int) -> FloatArray:
        """Return all echoes reported at heading `index`, earliest first, (k,) s by the board's clock.

        The first gives the range. The paper's receiver reports one, the board's own as many as re-arming allows.
        """
        if self.receiver is Receiver.BOARD:
            speed = self.room.air.speed_of_sound
            detected = detect_echoes(self.sound_at(index), self.board, speed, self._noise_at(index))
            return counted_time(detected.times, self.board)
        distance = self.distances[index : index + 1]
        return counted_time(2 * distance[~np.isnan(distance)] / self.room.air.speed_of_sound, self.board)

    def first_detected(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return time, (n,) s, NaN without an echo, and path, (n,), of the first echo of the board's own receiver."""
        times, winners = np.full(len(self.headings), np.nan), np.full(len(self.headings), -1, dtype=np.intp)
        one_by_one = np.arange(len(self.headings))
        if not self.noise and self._response is None:
            one_by_one = self.with_scattered_sound
            if len(one_by_one) < len(self.headings):
                times, winners = self._first_at_once()
        for k in one_by_one.tolist():
            found = self.first_detected_at(k)
            times[k], winners[k] = found.times[0] if len(found.times) else np.nan, found.winner
        return times, winners

    @cached_property
    def with_scattered_sound(self) -> NDArray[np.intp]:
        """Rows of the headings at which sound of rough surfaces is at most 20 dB below the threshold, (k,)."""
        rough = np.flatnonzero(self.paths.scattered)
        if not len(rough):
            return np.empty(0, dtype=np.intp)
        if self.only_at is not None:
            return np.unique(self.only_at[rough])
        patches = self.paths.select(rough)
        powers = [(self._amplitudes_at(k, rough, patches) ** 2).sum() for k in range(len(self.headings))]
        return np.flatnonzero(np.array(powers) >= self._unheard**2)

    def _first_at_once(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return `first_detected` without noise, and without sound of rough surfaces."""
        speed = self.room.air.speed_of_sound
        if self.only_at is None:
            sound = self._sound(self.paths, self.apparent_lengths, self.paths.leaving)
            return first_echoes(self.headings, sound, self.board, speed)
        times, winners = np.full(len(self.headings), np.nan), np.full(len(self.headings), -1, dtype=np.intp)
        for k, heading in enumerate(self.headings):
            here = np.flatnonzero(self.only_at == k)
            here = here[np.argsort(self.apparent_lengths[here], kind="stable")]
            paths, senders = self.paths.select(here), heading
            if self.sender_headings is not None:
                senders = self.sender_headings[here]
            sound = self._sound(paths, self.apparent_lengths[here], turned(paths.leaving, heading - senders))
            times[k : k + 1], row = first_echoes(self.headings[k : k + 1], sound, self.board, speed)
            winners[k] = np.append(here, -1)[row[0]]
        return times, winners

    def _sound(self, paths: Paths, lengths: FloatArray, leaving: FloatArray) -> Sound:
        """Return the sound along `paths` (p,), in order of their apparent lengths (p,) m, departing along `leaving`."""
        return Sound(
            lengths / self.room.air.speed_of_sound,
            self._phased(paths),
            leaving,
            paths.arriving,
            self.blocked_by_face(paths, self.headings),
        )

    def _phased(self, paths: Paths) -> ComplexArray:
        phasors = np.where(paths.scattered, 0.0, np.exp(1j * np.nan_to_num(paths.phases)))
        return np.asarray(strengths(self.room, self.board, paths) * phasors)

    def first_detected_at(self, index: int) -> ReceivedEchoes:
        """Return the first echo of the board's own receiver, in its noise; `winner` is a row of `paths`."""
        speed, noise = self.room.air.speed_of_sound, self._noise_at(index)
        detected = detect_first_echo(self.sound_at(index), self.board, speed, noise)
        if not len(detected.times):
            return detected
        return replace(detected, winner=self._responsible_at(index, float(detected.times[0]), detected.winner))

    def path_detected_at(self, index: int, time: float, signal: Signal) -> int:
        """Return the path that the board's own receiver detects in this `signal` at `time` (s); -1: none."""
        speed = self.room.air.speed_of_sound
        loudest = loudest_before(time, signal.samples, self.sound_at(index), self.board, speed)
        return self._responsible_at(index, time, loudest)

    def _responsible_at(self, index: int, time: float, loudest: int) -> int:
        """Return the path detected at `time` (s): the loudest arrival, or a rough surface that is louder; -1: none."""
        here, paths = self._present_at(index)
        # rows beyond the paths are scatterers of a grain
        winner = loudest if loudest < len(here) else -1
        scattered = self._scattered_at(index)
        if scattered is not None:
            coherent = float(np.abs(self._amplitudes_at(index, here, paths)[winner])) if winner >= 0 else 0.0
            length = time * self.room.air.speed_of_sound
            patch = scattered.responsible_at(length, max(coherent, self._unheard))
            winner = patch if patch >= 0 else winner
        # winner -1, "no path", selects the appended -1
        return int(np.append(here, -1)[winner])

    @property
    def _unheard(self) -> float:
        """Amplitude below which sound does not cause a detection."""
        return SHARE * 10 ** (self.board.threshold_db / 20)

    def _present_at(self, index: int) -> tuple[NDArray[np.intp], Paths]:
        """Return the rows of the paths that exist at heading `index`, and the paths."""
        if self.only_at is None:
            return np.arange(len(self.paths)), self.paths
        here = np.flatnonzero(self.only_at == index)
        return here, self.paths.select(here)

    def blocked_by_face(self, paths: Paths, headings: FloatArray) -> BoolArray:
        """Return the paths that end at the face of a unit that blocks, (n, p) bool for headings (n,); (0, 0): none."""
        if self.only_at is not None or self.unit is not Unit.BLOCK:
            return np.empty((0, 0), dtype=np.bool_)
        return meeting_face(
            paths.points - np.array(self.board.at_axis(self.place).position), headings, self.board.aperture_radius
        )

    def _blocked_at(self, index: int, paths: Paths) -> BoolArray:
        blocked = self.blocked_by_face(paths, self.headings[index : index + 1])
        return blocked[0] if len(blocked) else np.zeros(len(paths), dtype=np.bool_)

    def sound_at(self, index: int) -> Arrivals:
        """Return all sound that arrives at heading `index`, before the effect of the transducer."""
        heading, (here, paths) = float(self.headings[index]), self._present_at(index)
        amplitudes, lengths, blocked = self._phased(paths), self.apparent_lengths[here], self._blocked_at(index, paths)
        amplitudes[blocked] = 0.0
        sender_headings = heading if self.sender_headings is None else self.sender_headings[here]
        leaving = paths.leaving[:, 0] * np.cos(sender_headings) + paths.leaving[:, 1] * np.sin(sender_headings)
        arriving = paths.arriving[:, 0] * np.cos(heading) + paths.arriving[:, 1] * np.sin(heading)
        speed = self.room.air.speed_of_sound
        response = self._response
        if response is not None:
            response = replace(response, factors=response.factors[here])
        arrivals = Arrivals(lengths / speed, amplitudes, leaving, arriving, response=response)
        scattered = self._scattered_at(index)
        if scattered is None:
            return arrivals
        if scattered.grain is None:
            return replace(arrivals, patches=scattered.patches)
        rows = scattered.rows[scattered.grain.rows]
        grain = strengths(self.room, self.board, paths)[rows] * scattered.grain.factors
        grain[blocked[rows]] = 0.0
        return Arrivals(
            np.concatenate((arrivals.times, scattered.grain.lengths / speed)),
            np.concatenate((amplitudes, grain)),
            np.concatenate((leaving, leaving[rows])),
            np.concatenate((arriving, arriving[rows])),
            response=response and replace(response, factors=np.vstack((response.factors, response.factors[rows]))),
        )

    @cached_property
    def _response(self) -> Response | None:
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

    def _noise_at(self, index: int) -> Noise:
        # a function of the heading, independent of the other headings
        return Noise(self.noise, (self.seed, _microdegrees(self.headings[index])))

    def echoes(self, index: int) -> tuple[Echo, ...]:
        """Return all arrivals after blanking that are loud enough at heading `index`, earliest first."""
        return tuple(self._loud(index, ~self.blanked))

    def blanked_echoes(self, index: int) -> tuple[Echo, ...]:
        """Return all arrivals within blanking that are loud enough at heading `index`, earliest first."""
        return tuple(self._loud(index, self.blanked))

    def first_echo(self, index: int) -> Echo | None:
        """Return the first of `echoes`, or None without any."""
        return next(self._loud(index, ~self.blanked), None)

    def _loud(self, index: int, among: BoolArray) -> Iterator[Echo]:
        levels, loudest = self.arrivals_at(index)
        lengths, scattered = self.lengths_of_arrivals(loudest), self._scattered_at(index)
        within = self.apparent_lengths <= 2 * self.board.max_range + SLACK
        loud = np.flatnonzero((levels >= self.board.threshold_db) & np.isfinite(levels) & within & among)
        span = self.board.wavelength(self.room.air) if self.board.sum_arrivals else -1.0
        until, until_scattered = -math.inf, -math.inf  # ends of the last arrivals
        for first in loud.tolist():
            begin, path = float(self.apparent_lengths[first]), int(loudest[first])
            length, level = float(lengths[first]), float(levels[first])
            # paths within an arrival begin no other one
            if begin <= until:
                continue
            if scattered is None or not self.paths.scattered[path]:
                until = until_scattered = begin + span
            elif begin <= until_scattered:
                continue
            else:
                length = scattered.reaches(self.board.threshold_db, begin)
                level, until_scattered = scattered.level_from(length), length + self._burst
            yield Echo(path, float(self.board.reported(np.array([length / 2]))[0]), level, length)

    @property
    def in_time(self) -> BoolArray:
        """Which paths arrive after blanking and within range, (p,) bool."""
        return ~self.blanked & (self.apparent_lengths <= 2 * self.board.max_range + SLACK)


def _decibels(amplitudes: float | FloatArray) -> FloatArray:
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(amplitudes))


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


def with_first_arrivals(scan: PredictedScan) -> PredictedScan:
    """Return what `with_first_echoes` returns, if all paths exist at all headings."""
    room, board, paths = scan.room, scan.board, scan.paths
    in_time = np.flatnonzero(scan.in_time & ~paths.scattered)
    ka, blocked = board.wavenumber(room.air) * board.aperture_radius, scan.blocked_by_face(paths, scan.headings)
    first = first_detected(
        scan.headings,
        paths.leaving[in_time],
        paths.arriving[in_time],
        strengths(room, board, paths)[in_time],
        together(paths.lengths[in_time], paths.phases[in_time], board.wavelength(room.air), board),
        blocked[:, in_time] if len(blocked) else blocked,
        10 ** (board.threshold_db / 20),
        ka,
        beam_table(ka),
    )
    # row -1, "no echo", selects the appended value
    winners = np.append(in_time, -1)[first]
    found = replace(scan, winners=winners, distances=np.append(scan.apparent_lengths, np.nan)[winners] / 2)
    return with_first_echoes(found, scan.with_scattered_sound)


def with_first_echoes(scan: PredictedScan, rows: NDArray[np.intp] | None = None) -> PredictedScan:
    """Return the scan with the first of its `echoes` as its readings, at the headings in `rows`; None: at all."""
    winners, distances = scan.winners.copy(), scan.distances.copy()
    for k in range(len(scan.headings)) if rows is None else rows.tolist():
        first = scan.first_echo(k)
        winners[k], distances[k] = (first.path, first.length / 2) if first else (-1, np.nan)
    return replace(scan, winners=winners, distances=distances)


def with_own_body(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the echo of the carrier's own body as reading, wherever it is the nearest; without a path.

    The heading of the scan's place is the actual one of the turntable's zero.
    """
    board, zero = scan.board, scan.place.heading
    owned = [own_range(board.own_body, board.angle_at(heading, zero)) for heading in scan.headings.tolist()]
    own = board.true_ranges(np.array([np.nan if found is None else found for found in owned]))
    nearest = np.fmin(own, scan.distances)
    is_own = nearest == own
    return replace(scan, winners=np.where(is_own, -1, scan.winners), distances=nearest, of_own_body=is_own)


def _microdegrees(heading: float) -> int:
    return round(math.degrees(heading) * 1e6) % 360_000_000
