"""The prediction: what the board would report at each heading, and by which path.

Takes the paths of a place, a board and headings; hands on a `PredictedScan`, which still knows every echo. Paths are
found once for a whole scan; here they are only weighed by the transducer and held against blanking, threshold, range.
Where more than the beam turns with the head, every heading has paths of its own (`sim.by_heading`).
"""

import math
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.bends import EdgeStrength
from sim.board import Board, Receiver
from sim.by_heading import HeadingPaths, Leg, find_by_heading, standpoints
from sim.mount import CARRIER_REFLECTANCE
from sim.paths import MAX_BOUNCES, RAYS, SLACK, Paths, PathSearch
from sim.receiver import Heard, counted_time, hear, hear_first
from sim.room import Place, Room
from sim.sections import paths_from
from sim.traces import Arrivals, Noise, Signal, received
from sim.weighing import (
    BoolArray,
    all_meeting_face,
    amplitudes_at,
    beam_table,
    first_heard,
    loudest_by_separation,
)
from sonarhw.readings import FloatArray

# Fainter than this under the threshold, a path is not noticed: of those a room has, nine in ten never are. dB
NOTICED_BELOW_THRESHOLD = 20.0
# Of paths bent by an edge there is no end; only those are sought that could be heard if they were a little louder. dB
BENT_BELOW_THRESHOLD = 3.0


class Unit(StrEnum):
    """What the transducer's own body does to sound that passes it."""

    PASS = "pass"  # nothing: it is small, the front closes round it
    BLOCK = "block"  # sound that meets its face ends there
    REFLECT = "reflect"  # its face, from both sides, is one more wall: appendix A as printed


FACE_REFLECTANCES = {Unit.PASS: None, Unit.BLOCK: 0.0, Unit.REFLECT: CARRIER_REFLECTANCE}


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
    sent_at: FloatArray | None = None  # (p,), rad: where each one's sender points; None: where the listener does
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
        """Which paths arrive while the board cannot hear, (p,) bool."""
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
            sent_at = None if self.sent_at is None else self.sent_at[here]
            amplitudes = np.zeros(len(self.paths))
            amplitudes[here] = leg_amplitudes(self.room, self.board, heading, self.paths.select(here), sent_at)
        with np.errstate(divide="ignore"):
            return np.asarray(20 * np.log10(amplitudes))

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
            heard = hear(self._arrivals_at(index), self.board, speed, self._noise_at(index))
            return counted_time(heard.times, self.board)
        distance = self.distances[index : index + 1]
        return np.asarray(2 * distance[~np.isnan(distance)] / self.room.air.speed_of_sound)

    def first_heard_at(self, index: int) -> Heard:
        """The first echo that the board's own receiver finds at heading `index`; the winner is a row of `paths`."""
        heard = hear_first(self._arrivals_at(index), self.board, self.room.air.speed_of_sound, self._noise_at(index))
        # row -1, "no path", picks what is appended
        return replace(heard, winner=int(np.append(self._present_at(index), -1)[heard.winner]))

    def _present_at(self, index: int) -> NDArray[np.intp]:
        return np.arange(len(self.paths)) if self.only_at is None else np.flatnonzero(self.only_at == index)

    def _arrivals_at(self, index: int) -> Arrivals:
        here, heading = self._present_at(index), float(self.headings[index])
        paths = self.paths if self.only_at is None else self.paths.select(here)
        amplitudes = _strengths(self.room, self.board, paths)
        if self.only_at is None and self.unit is Unit.BLOCK:
            corners = paths.points - np.array(self.place.position)
            amplitudes[all_meeting_face(corners, heading, self.board.aperture_radius)] = 0.0
        sent_at = heading if self.sent_at is None else self.sent_at[here]
        leaving = paths.leaving[:, 0] * np.cos(sent_at) + paths.leaving[:, 1] * np.sin(sent_at)
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


@dataclass(frozen=True)
class PredictionOptions:
    """How to follow the sound; the defaults are those of every command."""

    unit: Unit = Unit.PASS
    max_bounces: int = MAX_BOUNCES
    diffraction: bool = True
    rays: int = RAYS
    edge_strength: EdgeStrength = EdgeStrength.PAPER
    receiver: Receiver = Receiver.FIRST_ECHO
    noise: float = 0.0  # of the receiver, root mean square, 1 is full scale; the board's own hears it, the paper's not
    seed: int | None = None  # of whatever is random; None: 0 for `noise`, and a model that errs at random does not
    single: bool = False  # only what one surface or one edge sends straight back
    sections: int = 1  # horizontal ones, one above the other across the face, where a place has a height


def predict_scan(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions | None = None
) -> PredictedScan:
    """What `board` would report from `place` at `headings` (n,) rad in the room.

    Raises InputError where the board is a ring and no sensor of it points along one of the headings.
    """
    options = options or PredictionOptions()
    if len(headings) and not paths_serve_all_headings(board, options.unit):
        return received_by(_predict_by_heading(room, place, board, headings, options), options)
    paths = _paths(room, place, board, search_for(room, board, options), options)
    return received_by(weigh_paths(room, place, board, headings, paths, options.unit), options)


def received_by(scan: PredictedScan, options: PredictionOptions) -> PredictedScan:
    """A scan of the paper's receiver as the one of `options` reports it, with their noise."""
    scan = replace(scan, receiver=options.receiver, noise=options.noise, seed=options.seed or 0)
    if options.receiver is Receiver.FIRST_ECHO:
        return scan
    winners = np.full(len(scan.headings), -1, dtype=np.intp)
    distances = np.full(len(scan.headings), np.nan)
    for k in range(len(scan.headings)):
        heard = scan.first_heard_at(k)
        if len(heard.times):
            winners[k] = heard.winner
            distances[k] = counted_time(heard.times[0], scan.board) * scan.room.air.speed_of_sound / 2
    return replace(scan, winners=winners, distances=distances)


def paths_serve_all_headings(board: Board, unit: Unit) -> bool:
    """Whether sound goes the same ways at every heading, so that one search is enough for a scan."""
    return board.carrier.turns_about_face and unit is not Unit.REFLECT


def search_for(room: Room, board: Board, options: PredictionOptions) -> PathSearch:
    """Which paths `board` could hear."""
    return PathSearch(
        2 * board.max_range,
        board.wavelength(room.air),
        options.max_bounces,
        options.diffraction,
        options.rays,
        options.edge_strength,
        10 ** ((board.threshold_db - BENT_BELOW_THRESHOLD) / 20),
    )


def _paths(
    room: Room,
    place: Place,
    board: Board,
    search: PathSearch,
    options: PredictionOptions,
    receiver: tuple[float, float] | None = None,
) -> Paths:
    paths = paths_from(room, place, search, receiver, board.aperture_radius, options.sections)
    return paths.select(np.flatnonzero(paths.bounces + (paths.edges >= 0) <= 1)) if options.single else paths


def _predict_by_heading(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions
) -> PredictedScan:
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    search = search_for(room, board, options)
    faintest = 10 ** ((board.threshold_db - NOTICED_BELOW_THRESHOLD) / 20)

    def find(crowded: Room, leg: Leg) -> Paths:
        start, end = replace(place, position=leg.sender.sender), leg.listener.receiver
        front = leg.sender.heading, leg.listener.heading
        search_leg = replace(search, max_length=leg.max_length, front=front)
        # one point for both lets a search use every way twice
        paths = _paths(crowded, start, board, search_leg, options, None if start.position == end else end)
        sent_at = np.full(len(paths), leg.sender.heading)
        amplitudes = leg_amplitudes(room, board, leg.listener.heading, paths, sent_at)
        return paths.select(np.flatnonzero(amplitudes >= faintest))

    found = find_by_heading(room, place, board, headings, find, FACE_REFLECTANCES[options.unit])
    return _scan_of(found, place, board, headings, options.unit)


def _scan_of(found: HeadingPaths, place: Place, board: Board, headings: FloatArray, unit: Unit) -> PredictedScan:
    scan = silent_scan(found.room, place, board, headings, found.paths, found.only_at, unit)
    return with_first_echoes(replace(scan, sent_at=found.sent_at, lateness=found.lateness))


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


def weigh_paths(
    room: Room, place: Place, board: Board, headings: FloatArray, paths: Paths, unit: Unit = Unit.PASS
) -> PredictedScan:
    """The scan that known paths give at `headings` (n,) rad; those too faint to notice at any heading are left out."""
    headings = np.ascontiguousarray(headings, dtype=np.float64)
    paths = paths.select(_noticed(room, board, paths))
    heard = np.flatnonzero(~is_blanked(paths.lengths, board, room) & (paths.lengths <= 2 * board.max_range + SLACK))
    ka = board.wavenumber(room.air) * board.aperture_radius
    first = first_heard(
        headings,
        paths.leaving[heard],
        paths.arriving[heard],
        _strengths(room, board, paths)[heard],
        paths.points[heard] - np.array(place.position),
        board.aperture_radius if unit is Unit.BLOCK else 0.0,
        10 ** (board.threshold_db / 20),
        ka,
        beam_table(ka),
    )
    # row -1, "no echo", picks what is appended
    winners = np.append(heard, -1)[first]
    distances = np.append(paths.lengths, np.nan)[winners] / 2
    return PredictedScan(room, place, board, headings, paths, unit, winners, distances)


def path_amplitudes(
    room: Room, place: Place, board: Board, heading: float, paths: Paths, unit: Unit = Unit.PASS
) -> FloatArray:
    """Amplitude of every path at a heading (rad) relative to a perfect wall straight ahead, (p,) float.

    Reflectances, edges and curvature, the beam on departure and arrival, and what air takes beyond the ideal gain.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    strengths = _strengths(room, board, paths)
    amplitudes = amplitudes_at(heading, paths.leaving, paths.arriving, strengths, ka, beam_table(ka))
    if unit is Unit.BLOCK:
        amplitudes[all_meeting_face(paths.points - np.array(place.position), heading, board.aperture_radius)] = 0.0
    return np.asarray(amplitudes)


def leg_amplitudes(
    room: Room, board: Board, heading: float, paths: Paths, sent_at: FloatArray | None = None
) -> FloatArray:
    """Amplitude of every path as `path_amplitudes` has it, (p,) float, heard at a heading (rad) by one transducer.

    `sent_at` (p,) rad is where the one that sent each points; None: where the listener does.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    # as if the sender had pointed along `heading`
    leaving = paths.leaving if sent_at is None else turned(paths.leaving, heading - sent_at)
    return np.asarray(
        amplitudes_at(heading, leaving, paths.arriving, _strengths(room, board, paths), ka, beam_table(ka))
    )


def turned(vectors: FloatArray, angles: FloatArray) -> FloatArray:
    """Vectors (p, 2) turned counter-clockwise by `angles` (p,) rad, same shape."""
    (x, y), cosines, sines = vectors.T, np.cos(angles), np.sin(angles)
    return np.column_stack((x * cosines - y * sines, x * sines + y * cosines))


def is_blanked(lengths: FloatArray, board: Board, room: Room) -> BoolArray:
    """Which paths of those lengths (m) arrive while the board cannot hear, same shape."""
    return np.asarray(lengths / 2 < board.blanked_range(room.air))


def _strengths(room: Room, board: Board, paths: Paths) -> FloatArray:
    return np.asarray(paths.gains * 10 ** (-board.excess_absorption(room.air) * paths.lengths / 20))


def _noticed(room: Room, board: Board, paths: Paths) -> NDArray[np.intp]:
    """The paths that at their best heading come within 20 dB of the threshold."""
    loudest = loudest_by_separation(board.wavenumber(room.air) * board.aperture_radius)
    together = np.clip((paths.leaving * paths.arriving).sum(axis=1), -1, 1)
    # the next smaller separation: never too strict
    apart = (np.arccos(together) / math.pi * (len(loudest) - 1)).astype(np.intp)
    faintest = 10 ** ((board.threshold_db - NOTICED_BELOW_THRESHOLD) / 20)
    return np.flatnonzero(_strengths(room, board, paths) * loudest[apart] >= faintest)
