"""The predicted scan: what a board would report at each heading, and everything that it could hear there.

Takes paths already weighed (`predict.prediction`); hands on ranges, and for any one heading levels, echoes, the receive
signal and the echo times that a receiver finds in it.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import ReceivedEchoes, counted_time, detect_echoes, detect_first_echo
from sonarhw_sim.board.traces import Arrivals, Noise, Signal, received
from sonarhw_sim.board.weighing import BoolArray, all_meeting_face
from sonarhw_sim.choices import Receiver, Unit
from sonarhw_sim.predict.by_heading import standpoints
from sonarhw_sim.predict.levels import is_blanked, leg_amplitudes, path_amplitudes, strengths
from sonarhw_sim.rays.paths import SLACK, Paths
from sonarhw_sim.room.model import Place, Room


@dataclass(frozen=True)
class Echo:
    """One audible arrival at one heading."""

    path: int  # row in the scan's paths
    range: float  # m, as the board would report it
    level_db: float  # at the threshold's input, relative to a perfect wall straight ahead


@dataclass(frozen=True)
class PredictedScan:
    """What a board would report from one place."""

    room: Room
    place: Place
    board: Board
    headings: FloatArray  # (n,), rad in the room
    paths: Paths  # (p,), shortest first
    unit: Unit
    winners: NDArray[np.intp]  # (n,): row of the path that is reported; -1: no echo
    distances: FloatArray  # (n,), m: what the receiver found, before rounding; NaN: no echo
    only_at: NDArray[np.intp] | None = None  # (p,): the one heading at which a path exists; None: all do at every one
    sender_headings: FloatArray | None = (
        None  # (p,), rad: where each one's sender points; None: where the listener does
    )
    lateness: FloatArray | None = None  # (p,), m: by how much each seems longer than it is; None: by nothing
    receiver: Receiver = Receiver.FIRST_ECHO
    noise: float = 0.0  # in every signal, root mean square; 1 is full scale
    seed: int = 0  # of the noise

    @property
    def ranges(self) -> FloatArray:
        """Reported range at each heading, (n,) float, m; NaN where there is no echo."""
        return self.board.reported(self.distances)

    @cached_property
    def apparent_lengths(self) -> FloatArray:
        """How long each path is by the time that the board counts, (p,) m: its length, but for `lateness`."""
        return self.paths.lengths if self.lateness is None else self.paths.lengths + self.lateness

    @cached_property
    def standpoints(self) -> FloatArray:
        """Where the listening transducer stands at each heading, (n, 2) m."""
        return standpoints(self.board, self.place, self.headings)

    @cached_property
    def blanked(self) -> BoolArray:
        """Which paths arrive while the board cannot detect_echoes, (p,) bool."""
        return is_blanked(self.apparent_lengths, self.board, self.room)

    def levels_at(self, index: int) -> FloatArray:
        """Level of every path at heading `index`, (p,) dB relative to a perfect wall straight ahead.

        -inf where nothing arrives.
        """
        heading = float(self.headings[index])
        if self.only_at is None:
            amplitudes = path_amplitudes(self.room, self.place, self.board, heading, self.paths, self.unit)
        else:
            here = np.flatnonzero(self.only_at == index)
            sender_headings = None if self.sender_headings is None else self.sender_headings[here]
            amplitudes = np.zeros(len(self.paths))
            amplitudes[here] = leg_amplitudes(self.room, self.board, heading, self.paths.select(here), sender_headings)
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(amplitudes))

    @cached_property
    def over_threshold(self) -> FloatArray:
        """Level over the threshold of the loudest path that the board listens for at each heading, (n,) dB.

        Below 0 nothing is heard; -inf where nothing arrives, beyond the beam or outside the time of listening. The
        higher, the surer is an echo, whatever its range.
        """
        listened = ~self.blanked & (self.apparent_lengths <= 2 * self.board.max_range + SLACK)
        loudest = [self.levels_at(k)[listened].max(initial=-np.inf) for k in range(len(self.headings))]
        return np.array(loudest, dtype=np.float64) - self.board.threshold_db

    def signal_at(self, index: int, duration: float) -> Signal:
        """The receive signal at heading `index` for `duration` s from the start of transmission."""
        speed, noise = self.room.air.speed_of_sound, self._noise_at(index)
        return received(self._arrivals_at(index), self.board, speed, duration, self.receiver, noise)

    def echo_times_at(self, index: int) -> FloatArray:
        """Every echo that would be reported at heading `index`, earliest first, (k,) s by the board's clock.

        The first gave the range. The paper's receiver reports one, the board's own as many as it can re-arm for.
        """
        if self.receiver is Receiver.BOARD:
            speed = self.room.air.speed_of_sound
            heard = detect_echoes(self._arrivals_at(index), self.board, speed, self._noise_at(index))
            return counted_time(heard.times, self.board)
        distance = self.distances[index : index + 1]
        return np.asarray(2 * distance[~np.isnan(distance)] / self.room.air.speed_of_sound)

    def first_detected_at(self, index: int) -> ReceivedEchoes:
        """The first echo that the board's own receiver finds at heading `index`; the winner is a row of `paths`."""
        heard = detect_first_echo(
            self._arrivals_at(index), self.board, self.room.air.speed_of_sound, self._noise_at(index)
        )
        # row -1, "no path", picks what is appended
        return replace(heard, winner=int(np.append(self._present_at(index), -1)[heard.winner]))

    def _present_at(self, index: int) -> NDArray[np.intp]:
        return np.arange(len(self.paths)) if self.only_at is None else np.flatnonzero(self.only_at == index)

    def _arrivals_at(self, index: int) -> Arrivals:
        here, heading = self._present_at(index), float(self.headings[index])
        paths = self.paths if self.only_at is None else self.paths.select(here)
        amplitudes = strengths(self.room, self.board, paths)
        if self.only_at is None and self.unit is Unit.BLOCK:
            corners = paths.points - np.array(self.place.position)
            amplitudes[all_meeting_face(corners, heading, self.board.aperture_radius)] = 0.0
        sender_headings = heading if self.sender_headings is None else self.sender_headings[here]
        leaving = paths.leaving[:, 0] * np.cos(sender_headings) + paths.leaving[:, 1] * np.sin(sender_headings)
        arriving = paths.arriving[:, 0] * np.cos(heading) + paths.arriving[:, 1] * np.sin(heading)
        times = self.apparent_lengths[here] / self.room.air.speed_of_sound
        return Arrivals(times, amplitudes, leaving, arriving)

    def _noise_at(self, index: int) -> Noise:
        # a function of the heading, not of which headings are asked about
        microdegrees = round(math.degrees(self.headings[index]) * 1e6) % 360_000_000
        return Noise(self.noise, (self.seed, microdegrees))

    def echoes(self, index: int) -> tuple[Echo, ...]:
        """Everything the board could hear at heading `index`, earliest first."""
        return self._loud(index, ~self.blanked)

    def blanked_echoes(self, index: int) -> tuple[Echo, ...]:
        """What would be loud enough at heading `index` but arrives within blanking, earliest first."""
        return self._loud(index, self.blanked)

    def _loud(self, index: int, among: BoolArray) -> tuple[Echo, ...]:
        levels = self.levels_at(index)
        within = self.apparent_lengths <= 2 * self.board.max_range + SLACK
        loud = np.flatnonzero((levels >= self.board.threshold_db) & np.isfinite(levels) & within & among)
        ranges = self.board.reported(self.apparent_lengths[loud] / 2)
        return tuple(
            Echo(int(path), float(distance), float(levels[path])) for path, distance in zip(loud, ranges, strict=True)
        )


def silent_scan(
    room: Room,
    place: Place,
    board: Board,
    headings: FloatArray,
    paths: Paths,
    only_at: NDArray[np.intp],
    unit: Unit = Unit.PASS,
) -> PredictedScan:
    """A scan of paths that exist at one heading each, before anyone has listened."""
    winners, distances = np.full(len(headings), -1, dtype=np.intp), np.full(len(headings), np.nan)
    return PredictedScan(room, place, board, headings, paths, unit, winners, distances, only_at)


def with_first_echoes(scan: PredictedScan) -> PredictedScan:
    """The scan with the first of its echoes as the one that is reported at each heading."""
    firsts = [scan.echoes(k)[:1] for k in range(len(scan.headings))]
    winners = np.array([first[0].path if first else -1 for first in firsts], dtype=np.intp)
    return replace(scan, winners=winners, distances=np.append(scan.apparent_lengths, np.nan)[winners] / 2)
