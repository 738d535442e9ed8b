"""The predicted scan: the paths at one place, the reading at each heading, and what the board receives there."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import counted
from sonarhw.readings import FloatArray, Table, same_values
from sonarhw_sim.air import Receiver, Unit
from sonarhw_sim.board.beam import (
    ArrivalLevels,
    BoolArray,
    ComplexArray,
    PathsAndBeam,
    Sought,
    Together,
    amplitudes_at,
    arrival_levels,
    beam_table,
    detected,
    every_path,
    loudest_by_separation,
    meeting_face,
    sum_of_arrival,
    sums_of_arrivals,
    together,
)
from sonarhw_sim.board.profile import (
    FACE,
    FACE_REFLECTANCES,
    Board,
    Mount,
    TransducerPose,
    own_range,
    uncompensated_db,
    with_body,
    with_faces,
)
from sonarhw_sim.board.receiver import (
    SHARE,
    ReceivedEchoes,
    Sound,
    counted_time,
    detect_echoes,
    detect_first_echo,
    first_echoes,
    loudest_before,
)
from sonarhw_sim.board.signal import Arrivals, Noise, Patches, Response, Signal, covered_by_burst, received
from sonarhw_sim.compiled import rows_in_parts
from sonarhw_sim.rays.paths import SLACK, Paths
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.space.levels import reflectance_factors

# sound of rough surfaces: phases of patches are random, so their powers add up; one particular surface has a speckle


_PARTS_OF_BURST = 8  # least number of scatterers of a grain along the burst


class Grain(NamedTuple):
    """Scatterers with random phase and strength in place of patches."""

    rows: NDArray[np.intp]  # (g,), their patches
    lengths: FloatArray  # (g,), m
    factors: ComplexArray  # (g,), to multiply the amplitude of their patches with


@dataclass(frozen=True)
class ScatteredSound:
    """The patches that one heading receives, and what the burst covers."""

    patches: Patches  # in order of their lengths
    rows: NDArray[np.intp]  # (k,), of the patches among all paths
    burst: float  # m, by how much the lengths of paths differ that are received at one instant
    grain: Grain | None  # one particular surface; None: the mean power of all

    def at(self, lengths: FloatArray) -> ComplexArray:
        """Return the amplitude received at the instants of these path lengths (m), same shape; real for the mean."""
        if self.grain is None:
            return np.sqrt(self.patches.power_between(lengths - self.burst, lengths)).astype(np.complex128)
        amplitudes = self.patches.amplitudes[self.grain.rows] * self.grain.factors
        return _sums_between(self.grain.lengths, amplitudes, lengths - self.burst, lengths)

    def level_from(self, begin: float) -> float:
        """Return the level that this sound reaches within one burst from the path length `begin` (m) on, dB."""
        lengths = self._changes(begin, begin + self.burst)
        return 20 * math.log10(max(float(np.abs(self.at(lengths)).max()), 1e-300))

    def reaches(self, level_db: float, before: float) -> float:
        """Return the path length (m) at which this sound last came up to a level, `before` another one."""
        lengths = self._changes(before - self.burst, before)
        levels = np.abs(self.at(lengths)) ** 2
        wanted = 10 ** (level_db / 10)
        fainter = np.flatnonzero(levels < wanted)
        if not len(fainter) or fainter[-1] == len(levels) - 1:
            return before
        last = int(fainter[-1])
        if self.grain is not None:
            return float(lengths[last + 1])
        return float(np.interp(wanted, levels[last : last + 2], lengths[last : last + 2]))

    def _changes(self, begin: float, end: float) -> FloatArray:
        """Return the path lengths (m) from `begin` to `end` between which the power of this sound changes evenly."""
        half = self.patches.spreads / 2
        changes = np.concatenate((self.patches.lengths - half, self.patches.lengths + half))
        if self.grain is not None:
            changes = self.grain.lengths
        lengths = np.concatenate((changes, changes + self.burst, [begin, end]))
        return np.sort(lengths[(lengths >= begin) & (lengths <= end)])

    def loudest_at(self, lengths: FloatArray) -> NDArray[np.intp]:
        """Return the row of the loudest patch at these instants, same shape."""
        in_order = np.argsort(np.abs(self.patches.amplitudes), kind="stable")
        ranks = np.empty(len(in_order) + 1, dtype=np.intp)
        ranks[in_order], ranks[-1] = np.arange(len(in_order)), -1
        begins = np.searchsorted(self.patches.lengths, lengths - self.burst)
        ends = np.searchsorted(self.patches.lengths, lengths, side="right")
        best = np.maximum.reduceat(ranks, np.column_stack((begins, ends)).ravel())[::2]
        return np.asarray(self.rows[in_order[best]])

    def added_to(
        self, sums: FloatArray, loudest: NDArray[np.intp], lengths: FloatArray
    ) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return amplitudes and loudest rows of arrivals together with this sound.

        `sums` (n,) are those of the other paths, `loudest` (n,) their rows.
        """
        sound = self.at(lengths)
        both = np.hypot(sums, np.abs(sound)) if self.grain is None else np.abs(sums + sound)
        return both, np.where(np.abs(sound) > sums, self.loudest_at(lengths), loudest)

    def responsible_at(self, length: float, coherent: float) -> int:
        """Return the row of the loudest patch if this sound is louder than `coherent` at that instant, else -1."""
        instant = np.array([length])
        return int(self.loudest_at(instant)[0]) if abs(self.at(instant)[0]) > coherent else -1


def scattered_sound(
    lengths: FloatArray,
    spreads: FloatArray,
    amplitudes: FloatArray,
    rows: NDArray[np.intp],
    burst: float,
    seed: tuple[int, ...],
) -> ScatteredSound:
    """Return the sound of patches (k,), in order of length; `rows` are theirs among all paths.

    An empty `seed` selects the mean power.
    """
    grain = _grain_of(lengths, spreads, burst, seed) if seed else None
    return ScatteredSound(Patches(lengths, spreads, amplitudes), rows, burst, grain)


def _grain_of(lengths: FloatArray, spreads: FloatArray, burst: float, seed: tuple[int, ...]) -> Grain:
    """Return scatterers that have the mean power of the patches (k,); `burst` is the result of `covered_by_burst`.

    Each has a complex normal amplitude. Sums of several are then such amplitudes too, for patches of any size.
    """
    counts = np.ceil(spreads / burst * _PARTS_OF_BURST).astype(np.intp)
    rows = np.repeat(np.arange(len(lengths)), counts)
    within = np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)
    shares = (within + 0.5) / counts[rows] - 0.5
    normal = np.random.default_rng(seed).standard_normal((len(rows), 2)).view(np.complex128)[:, 0]
    return Grain(rows, lengths[rows] + shares * spreads[rows], normal / np.sqrt(2.0 * counts[rows]))


def _sums_between(lengths: FloatArray, amplitudes: ComplexArray, begins: FloatArray, ends: FloatArray) -> ComplexArray:
    """Return the sum of the amplitudes (g,) of lengths over `begins` and up to `ends`, same shape as these."""
    order = np.argsort(lengths, kind="stable")
    until = np.append(0.0, np.cumsum(amplitudes[order]))
    first, last = (np.searchsorted(lengths[order], limits, side="right") for limits in (begins, ends))
    return np.asarray(until[last] - until[first])


# amplitudes of paths for a board, relative to a perfect wall straight ahead, and which paths to keep


# dB. Paths farther below the threshold are dropped. Several that arrive together change a sum close to the threshold:
# with 24 dB, those dropped change 4 of 100 000 readings of the paper's receiver in random rooms, with 36 dB none
# (`python -m benchmarks.brute_force`). Whole signals with so many paths would take twice as long.
KEPT_BELOW_THRESHOLD = {Receiver.FIRST_ECHO: 36.0, Receiver.BOARD: 24.0}
FAINTEST_PATCH = 0.01  # share of the faintest amplitude of other paths: the power of many patches adds up


def path_amplitudes(
    room: Room,
    board: Board,
    heading: float,
    paths: Paths,
    without_beam: FloatArray,
    sender_headings: FloatArray | None = None,
) -> FloatArray:
    """Return the signed amplitude of every path at a heading (rad), (p,) float; 1 is a perfect wall straight ahead.

    It includes reflectances, edges and curvature, the beam at departure and arrival, and absorption beyond the ideal
    gain, but no other path. `without_beam` (p,) are the `strengths` of the paths, which are the same at every heading.
    `sender_headings` (p,) rad are the headings of the senders; None: that of the receiver.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    # as if the sender had pointed along `heading`
    leaving = paths.leaving if sender_headings is None else turned(paths.leaving, heading - sender_headings)
    return np.asarray(amplitudes_at(heading, leaving, paths.arriving, without_beam, ka, beam_table(ka)))


def turned(vectors: FloatArray, angles: FloatArray) -> FloatArray:
    """Return vectors (p, 2) turned counter-clockwise by `angles` (p,) rad, same shape."""
    (x, y), cosines, sines = vectors.T, np.cos(angles), np.sin(angles)
    return np.column_stack((x * cosines - y * sines, x * sines + y * cosines))


def is_blanked(lengths: FloatArray, board: Board, room: Room) -> BoolArray:
    """Return which paths of these lengths (m) arrive within blanking, same shape."""
    return np.asarray(lengths / 2 < board.blanked_range(room.air))


def is_in_range(lengths: FloatArray, board: Board) -> BoolArray:
    """Return which paths of these lengths (m) arrive within range, same shape."""
    return np.asarray(lengths <= 2 * board.max_range + SLACK)


def strengths(room: Room, board: Board, paths: Paths) -> FloatArray:
    """Return the amplitude of every path without the beam, (p,) float."""
    return np.asarray(paths.gains * 10 ** (-uncompensated_db(paths.lengths, board, room.air) / 20))


def faintest_kept(board: Board, below: float) -> float:
    """Return the amplitude `below` dB below the threshold."""
    return float(10 ** ((board.threshold_db - below) / 20))


def loud_enough(room: Room, board: Board, paths: Paths, below: float) -> NDArray[np.intp]:
    """Return the rows of the paths that are at most `below` dB below the threshold at their best heading, (k,) int.

    Patches of rough surfaces are always among them, because many faint ones are loud together.
    """
    loudest = loudest_by_separation(board.wavenumber(room.air) * board.aperture_radius)
    cosines = np.cos(paths.departures - paths.arrivals) * np.cos(paths.elevations).prod(axis=1)
    # the next smaller separation, so that the bound is never too low
    rows = (np.arccos(cosines) / math.pi * (len(loudest) - 1)).astype(np.intp)
    loud = strengths(room, board, paths) * loudest[rows] >= faintest_kept(board, below)
    return np.flatnonzero(loud | paths.scattered)


# paths heading by heading, for bodies and faces that move when the head turns


_ON_OWN_FACE = 1e-9  # m: longest leg between a transducer and its own face


@dataclass(frozen=True)
class SensorPair:
    """One sender and one receiver, and the greatest length of paths between them."""

    sender: TransducerPose
    listener: TransducerPose
    lateness: float  # m
    max_length: float  # m


Find = Callable[[Room, SensorPair], Paths]  # returns the paths of a pair in the room that are worth keeping


def find_by_heading(
    room: Room, place: Place, board: Board, headings: FloatArray, find: Find, unit: Unit
) -> "PredictedScan":
    """Return a scan without readings, with the paths received at `headings` (n,) rad, at least one.

    They are within range by the receiver's own time, and up to twice that range long. The room of the scan has the
    body, and the faces as they are at the first heading.
    """
    mounting, speed, face_reflectance = board.mounting, room.air.speed_of_sound, FACE_REFLECTANCES[unit]
    axis = board.at_axis(place)
    room = with_body(room, axis, mounting.body_radius)
    shown: Room = room
    parts: list[tuple[Paths, int, SensorPair]] = []
    for k, heading in enumerate(headings):
        listener, senders = mounting.pose(axis, float(heading)), mounting.senders(axis, float(heading))
        room_with_faces = room
        if face_reflectance is not None:
            room_with_faces = with_faces(room, senders, board.aperture_radius, face_reflectance, axis.height)
        shown = shown if k else room_with_faces
        pairs = pairs_heard(listener, senders, 2 * board.max_range, speed)
        parts += [(_without_own_face(find(room_with_faces, pair), room_with_faces), k, pair) for pair in pairs]
    counts = [len(paths) for paths, _, _ in parts]
    paths = Paths.join([paths for paths, _, _ in parts])
    lateness = np.repeat(np.array([pair.lateness for _, _, pair in parts], dtype=np.float64), counts)
    order = np.argsort(paths.lengths + lateness, kind="stable")
    only_at = np.repeat(np.array([k for _, k, _ in parts], dtype=np.intp), counts)[order]
    sender_headings = np.repeat(np.array([pair.sender.heading for _, _, pair in parts], dtype=np.float64), counts)
    scan = silent_scan(shown, place, board, headings, paths.select(order), only_at, unit)
    return replace(scan, sender_headings=sender_headings[order], lateness=lateness[order])


def standpoints(board: Board, place: Place | FloatArray, headings: FloatArray) -> FloatArray:
    """Return the position of the receiving transducer at `headings` (n,) rad in the room, (n, 2) float, m.

    `place` is that of all headings, or the pose of each, (n, 3). For a ring, this is the position of a sensor with that
    heading.
    """
    poses = np.array([[*place.position, place.heading]]) if isinstance(place, Place) else place
    axis, arm_ahead = np.array([board.axis_x, board.axis_y]), np.array(arm(board))
    return np.asarray(poses[:, :2] + _turned_by(poses[:, 2], axis) + _turned_by(headings, arm_ahead))


def _turned_by(angles: FloatArray, vector: FloatArray) -> FloatArray:
    """Return a vector (2,) turned by each of the angles (n,) rad, (n, 2)."""
    (ahead, left), cosines, sines = vector, np.cos(angles), np.sin(angles)
    return np.column_stack((ahead * cosines - left * sines, ahead * sines + left * cosines))


def arm(board: Board) -> tuple[float, float]:
    """Return how far the receiving transducer is ahead of the turning axis, and to its left, m."""
    mount = board.mount if board.ring is None else Mount(ahead=board.ring.radius)
    return mount.ahead, mount.aside - mount.separation / 2


def pairs_heard(
    listener: TransducerPose, senders: tuple[TransducerPose, ...], max_length: float, speed: float
) -> Iterator[SensorPair]:
    """Yield the listener with each sender whose sound it may receive within range."""
    for sender in senders:
        lateness = (sender.ping_time - listener.ping_time) * speed
        longest = min(max_length, max_length - lateness)
        # otherwise all sound arrives before the receiver's own ping or after its range
        if longest > max(0.0, -lateness):
            yield SensorPair(sender, listener, lateness, longest)


def _without_own_face(paths: Paths, room: Room) -> Paths:
    """Return the paths without reflections at a face where they start or end, because that sound is counted already."""
    is_face = np.append(np.array(room.names) == FACE, False)[paths.surfaces].any(axis=1)
    at_own_face = (_first_legs(paths) <= _ON_OWN_FACE) | (_last_legs(paths) <= _ON_OWN_FACE)
    return paths.select(np.flatnonzero(~(at_own_face & is_face)))


def _first_legs(paths: Paths) -> FloatArray:
    return np.asarray(np.hypot(*(paths.points[:, 1] - paths.points[:, 0]).T))


def _last_legs(paths: Paths) -> FloatArray:
    rows, last = np.arange(len(paths)), (~np.isnan(paths.points[:, :, 0])).sum(axis=1) - 1
    return np.asarray(np.hypot(*(paths.points[rows, last] - paths.points[rows, last - 1]).T))


# the predicted scan and its pings


_SAME_PLACE = 1e-4  # m and rad, more than the rounding of a room file
_FREQUENCIES = 25  # at which the reflections of a path are multiplied


class ReportedPaths(NamedTuple):
    """The paths that gave readings, in the shape of the readings."""

    lengths: FloatArray  # m, of each path; NaN: no echo
    levels: FloatArray  # dB, of the arrival that gave each reading; NaN: no echo
    surfaces: NDArray[np.int32]  # (..., b): reflecting walls and posts, in order, rows of `room.names`, padded with -1
    edges: NDArray[np.int32]  # diffracting edge, a row of the room's edges; -1: none

    @classmethod
    def empty(cls, shape: tuple[int, ...], most_bounces: int) -> "ReportedPaths":
        """Return those of readings without an echo."""
        return cls(
            np.full(shape, np.nan),
            np.full(shape, np.nan),
            np.full((*shape, most_bounces), -1, dtype=np.int32),
            np.full(shape, -1, dtype=np.int32),
        )

    def fill(self, rows: tuple[Any, ...], other: "ReportedPaths") -> None:
        """Set the paths in `rows` to others, which may have fewer reflections."""
        self.lengths[rows], self.levels[rows], self.edges[rows] = other.lengths, other.levels, other.edges
        self.surfaces[(*rows, ..., slice(other.surfaces.shape[-1]))] = other.surfaces

    @property
    def bounces(self) -> NDArray[np.int32]:
        """Number of reflections of each path; 0 without an echo."""
        return np.asarray((self.surfaces >= 0).sum(axis=-1), dtype=np.int32)

    def trimmed(self) -> "ReportedPaths":
        """Return the same with as many columns of `surfaces` as the most reflections."""
        return self._replace(surfaces=self.surfaces[..., : self.bounces.max(initial=0)].copy())


def paths_of_readings(paths: Paths, winners: NDArray[np.intp], levels: FloatArray) -> ReportedPaths:
    """Return the paths in rows `winners` (n,), -1 without an echo, with these levels (n,) dB of their arrivals."""
    echo = winners >= 0
    reported = ReportedPaths.empty((len(winners),), paths.surfaces.shape[1])
    rows = winners[echo]
    reported.fill((echo,), ReportedPaths(paths.lengths[rows], levels[echo], paths.surfaces[rows], paths.edges[rows]))
    return reported


@dataclass(frozen=True, eq=False)
class PredictedScan(Table):
    """The readings that a board is predicted to report. Scans are equal if all their values are equal."""

    room: Room
    place: Place  # of a sensor that moves: the first
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
    poses: FloatArray | None = None  # (n, 3): x, y (m) and heading (rad) of the place of each reading; None: `place`

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, PredictedScan):
            return NotImplemented
        return len(self.paths) == len(other.paths) and same_values(self, other)

    def __hash__(self) -> int:
        return hash((self.room, self.place, self.board, len(self.headings), len(self.paths)))

    def __repr__(self) -> str:
        x, y = self.place.position
        echoes = f"{np.isfinite(self.distances).sum()} of {counted(len(self.headings), 'heading')} with an echo"
        return f"PredictedScan({self.board.name!r} at {x:g}, {y:g} m in {self.room.name!r}, {echoes})"

    @property
    def near(self) -> "PredictedScan":
        """The same scan without paths that are not known yet, which its readings do not need."""
        return replace(self, paths=self.paths.known)

    @property
    def ranges(self) -> FloatArray:
        """Reported range at each heading, (n,) float, m; NaN where there is no echo."""
        return self.board.reported(self.distances)

    def columns(self) -> dict[str, Any]:
        """Return headings (degrees), ranges and lengths of paths (m, NaN: no echo), their reflections and surfaces."""
        echo, names, paths = self.winners >= 0, np.full(len(self.headings), "", dtype=object), self.paths.known
        names[echo] = [">".join(paths.via(path, self.room)) for path in self.winners[echo].tolist()]
        # row -1, "no echo", selects the appended value
        lengths, bounces = np.append(paths.lengths, np.nan), np.append(paths.bounces, 0)
        return {
            "heading_deg": np.degrees(self.headings),
            "range_m": self.ranges,
            "path_m": lengths[self.winners],
            "bounces": bounces[self.winners],
            "via": names,
        }

    @cached_property
    def reported_paths(self) -> ReportedPaths:
        """The paths that gave the readings, (n,) each."""
        if self.paths.known is not self.paths:
            return self.near.reported_paths
        echo = self.winners >= 0
        if self.weighed_at_once:
            levels = np.where(echo, decibels(self._levels(all_arrivals=False).of_readings), np.nan)
        else:
            levels = np.full(len(echo), np.nan)
            levels[echo] = [self.ping(k).level_of_reading for k in np.flatnonzero(echo).tolist()]
        return paths_of_readings(self.paths, self.winners, levels)

    @cached_property
    def apparent_lengths(self) -> FloatArray:
        """Length of each path by the time that the board counts, (p,) m: true length plus `lateness`."""
        return self.paths.lengths if self.lateness is None else self.paths.lengths + self.lateness

    @property
    def where(self) -> str:
        """The place in titles: `place bench` of the room, `at 1.9, 0.35 m, step 0 at 95.5°` elsewhere, or `6 poses`."""
        if self.poses is None:
            named = self.room.places.get(self.place.name)
            if named is not None and _same_pose(self.board.faced(named), self.place):
                return f"place {self.place.name}"
            x, y = self.place.position
            heading = math.degrees(self.place.heading)
            return f"at {round(x, 3) + 0.0:g}, {round(y, 3) + 0.0:g} m, step 0 at {heading:z.1f}°"
        return counted(1 + int((np.diff(self.poses, axis=0) != 0).any(axis=1).sum()), "pose")

    @property
    def places(self) -> list[Place] | None:
        """The place of each reading of a sensor that moves, with the actual heading of step 0; None of one place."""
        if self.poses is None:
            return None
        return [replace(self.place, position=(x, y), heading=turn) for x, y, turn in self.poses.tolist()]

    @cached_property
    def standpoints(self) -> FloatArray:
        """Position of the receiving transducer at each heading, (n, 2) m."""
        return standpoints(self.board, self.place if self.poses is None else self.poses, self.headings)

    @cached_property
    def blanked(self) -> BoolArray:
        """Which paths arrive while the board is blanked, (p,) bool."""
        return is_blanked(self.apparent_lengths, self.board, self.room)

    @cached_property
    def in_range(self) -> BoolArray:
        """Which paths arrive within range, (p,) bool."""
        return is_in_range(self.apparent_lengths, self.board)

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
        if self.weighed_at_once:
            return decibels(self._levels(all_arrivals=True).loudest) - self.board.threshold_db
        levels = (self.ping(k).levels for k in range(len(self.headings)))
        loudest = [of_heading[self.in_time].max(initial=-np.inf) for of_heading in levels]
        return np.array(loudest, dtype=np.float64) - self.board.threshold_db

    @property
    def weighed_at_once(self) -> bool:
        """Whether one call weighs the paths at all headings: all exist at all of them, and no surface is rough."""
        return self.only_at is None and not self.paths.scattered.any()

    def _levels(self, all_arrivals: bool) -> ArrivalLevels:
        """Return the result of `arrival_levels` if paths are `weighed_at_once`."""
        weighed = paths_and_beam(self, self.headings, slice(None), self.all_together)
        rows = every_path(len(self.headings), len(self.paths))
        by_board = self.receiver is Receiver.BOARD
        return arrival_levels(self.headings, rows, weighed, self.in_time, self.winners, by_board, all_arrivals)

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


def _same_pose(one: Place, other: Place) -> bool:
    """Return whether two places differ by no more than rounding."""
    turn = math.remainder(one.heading - other.heading, math.tau)
    return math.dist(one.position, other.position) <= _SAME_PLACE and abs(turn) <= _SAME_PLACE


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
        return decibels(amplitudes), members

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
            return float(decibels(sum_of_arrival(self._coherent, self._together, row)))
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
        rows = tuple(arrivals)
        ranges = self.scan.board.reported(np.array([length / 2 for _, _, length in rows], dtype=np.float64))
        return tuple(
            Echo(path, reported, level, length)
            for (path, level, length), reported in zip(rows, ranges.tolist(), strict=True)
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


def joined(scans: Sequence[PredictedScan]) -> PredictedScan:
    """Return the readings of scans from several places, at least one, as one scan.

    Each path exists at one heading, at which it is not much too faint. Room and place are those of the first scan.
    """
    parts = [part for scan in scans for part in _by_heading(scan)]
    counts = [len(rows) for _, _, rows in parts]
    begins = np.cumsum([0, *counts[:-1]])
    paths = Paths.join([scan.paths.select(rows) for scan, _, rows in parts])
    lateness = np.concatenate([scan.apparent_lengths[rows] - scan.paths.lengths[rows] for scan, _, rows in parts])
    senders = np.concatenate([_senders(scan, k)[rows] for scan, k, rows in parts])
    winners = [
        begin + int(np.flatnonzero(rows == scan.winners[k])[0]) if scan.winners[k] >= 0 else -1
        for (scan, k, rows), begin in zip(parts, begins.tolist(), strict=True)
    ]
    order = np.argsort(paths.lengths + lateness, kind="stable")
    places = np.empty(len(order) + 1, dtype=np.intp)
    places[order], places[-1] = np.arange(len(order)), -1
    of_own_body = [
        np.zeros(len(scan.headings), np.bool_) if scan.of_own_body is None else scan.of_own_body for scan in scans
    ]
    return replace(
        scans[0],
        headings=np.concatenate([scan.headings for scan in scans]),
        paths=paths.select(order),
        winners=places[winners],
        distances=np.concatenate([scan.distances for scan in scans]),
        only_at=np.repeat(np.arange(len(parts)), counts)[order],
        sender_headings=senders[order],
        lateness=lateness[order],
        of_own_body=np.concatenate(of_own_body) if scans[0].of_own_body is not None else None,
        poses=np.array([(*scan.place.position, scan.place.heading) for scan, _, _ in parts]),
    )


def _by_heading(scan: PredictedScan) -> Iterator[tuple[PredictedScan, int, NDArray[np.intp]]]:
    """Yield each heading of a scan, with the rows of the paths that may matter there."""
    least = faintest_kept(scan.board, KEPT_BELOW_THRESHOLD[scan.receiver])
    for k in range(len(scan.headings)):
        rows = scan.rows_at(k)
        if scan.only_at is None:
            paths = scan.paths.select(rows)
            weak = np.where(paths.scattered, FAINTEST_PATCH, 1.0) * least
            loud = np.abs(scan.amplitudes_at(k, rows, paths)) >= weak
            rows = rows[loud | (rows == scan.winners[k])]
        yield scan, k, rows


def _senders(scan: PredictedScan, index: int) -> FloatArray:
    """Return the heading of the sender of each path, (p,) rad, at heading `index`."""
    if scan.sender_headings is not None:
        return scan.sender_headings
    return np.full(len(scan.paths), scan.headings[index])


def decibels(amplitudes: float | FloatArray) -> FloatArray:
    """Return the levels of amplitudes, dB, same shape; -inf for 0."""
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(amplitudes))


def whole_microdegrees(heading: float) -> int:
    """Return a heading or angle (rad) in whole microdegrees, 0 to 360 million, as part of a seed."""
    return round(math.degrees(heading) * 1e6) % 360_000_000


# readings: by the paper's receiver, by the board's own, and of the carrier's own body


_LEAST_PART = 120  # headings: fewer take about as long as a thread needs to begin


def with_readings(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the readings of its receiver."""
    if scan.receiver is Receiver.BOARD:
        return with_first_detected(scan)
    return with_first_arrivals(scan) if scan.only_at is None else with_first_echoes(scan)


def with_first_arrivals(scan: PredictedScan) -> PredictedScan:
    """Return what `with_first_echoes` returns, if all paths exist at all headings."""
    board, paths = scan.board, scan.paths
    in_time = np.flatnonzero(scan.in_time & ~paths.scattered)
    sets = together(paths.lengths[in_time], paths.phases[in_time], board.wavelength(scan.room.air), board)
    weighed = paths_and_beam(scan, scan.headings, in_time, sets)
    lengths, from_here = paths.lengths[in_time], np.zeros(len(scan.headings))
    sought = Sought(True, from_here, np.inf, lengths, lengths / 2, np.ones(len(in_time), np.bool_), -1.0)

    def heard(begin: int, end: int) -> tuple[NDArray[np.intp]]:
        hidden = weighed.blocked[begin:end]
        headings = scan.headings[begin:end]
        return (detected(headings, every_path(len(headings), len(in_time)), weighed._replace(blocked=hidden), sought),)

    (first,) = rows_in_parts(heard, len(scan.headings), _LEAST_PART)
    # row -1, "no echo", selects the appended value
    winners = np.append(in_time, -1)[first]
    heard_scan = replace(scan, winners=winners, distances=np.append(scan.apparent_lengths, np.nan)[winners] / 2)
    return with_first_echoes(heard_scan, with_scattered_sound(scan))


def paths_and_beam(
    scan: PredictedScan, headings: FloatArray, rows: NDArray[np.intp] | slice, sets: Together
) -> PathsAndBeam:
    """Return the paths in `rows`, which form these sets, as what the board may detect at `headings` (n,) rad."""
    room, board, paths = scan.room, scan.board, scan.paths
    ka, blocked = board.wavenumber(room.air) * board.aperture_radius, scan.blocked_by_face(paths, headings)
    return PathsAndBeam(
        paths.leaving[rows],
        paths.arriving[rows],
        strengths(room, board, paths)[rows],
        sets,
        np.ascontiguousarray(blocked[:, rows]) if len(blocked) else blocked,  # numba would compile a second layout
        10 ** (board.threshold_db / 20),
        ka,
        beam_table(ka),
    )


def with_first_echoes(scan: PredictedScan, rows: NDArray[np.intp] | None = None) -> PredictedScan:
    """Return the scan with the first of its `echoes` as its readings, at the headings in `rows`; None: at all."""
    winners, distances = scan.winners.copy(), scan.distances.copy()
    for k in range(len(scan.headings)) if rows is None else rows.tolist():
        first = scan.ping(k).first_echo
        winners[k], distances[k] = (first.path, first.length / 2) if first else (-1, np.nan)
    return replace(scan, winners=winners, distances=distances)


def with_first_detected(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the first echoes of the board's own receiver as its readings."""
    times, winners = np.full(len(scan.headings), np.nan), np.full(len(scan.headings), -1, dtype=np.intp)
    one_by_one = np.arange(len(scan.headings))
    if not scan.noise and scan.response is None:
        one_by_one = with_scattered_sound(scan)
        if len(one_by_one) < len(scan.headings):
            times, winners = _first_at_once(scan)
    for k in one_by_one.tolist():
        received_echoes = scan.ping(k).first_detected()
        times[k] = received_echoes.times[0] if len(received_echoes.times) else np.nan
        winners[k] = received_echoes.winner
    return replace(scan, winners=winners, distances=times * scan.room.air.speed_of_sound / 2)


def with_scattered_sound(scan: PredictedScan) -> NDArray[np.intp]:
    """Return the headings at which sound of rough surfaces is at most 20 dB below the threshold, (k,) rows."""
    rough = np.flatnonzero(scan.paths.scattered)
    if not len(rough):
        return np.empty(0, dtype=np.intp)
    if scan.only_at is not None:
        return np.unique(scan.only_at[rough])
    patches = scan.paths.select(rough)
    powers = [(scan.amplitudes_at(k, rough, patches) ** 2).sum() for k in range(len(scan.headings))]
    return np.flatnonzero(np.array(powers) >= scan.unheard_amplitude**2)


def _first_at_once(scan: PredictedScan) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return time, (n,) s, NaN without an echo, and path, (n,), without noise and sound of rough surfaces."""
    speed = scan.room.air.speed_of_sound
    if scan.only_at is None:
        sound = _sound(scan, scan.paths, scan.apparent_lengths, scan.paths.leaving)
        return first_echoes(scan.headings, sound, scan.board, speed)
    times, winners = np.full(len(scan.headings), np.nan), np.full(len(scan.headings), -1, dtype=np.intp)
    for k, heading in enumerate(scan.headings):
        here = scan.rows_at(k)
        here = here[np.argsort(scan.apparent_lengths[here], kind="stable")]
        paths, senders = scan.paths.select(here), heading
        if scan.sender_headings is not None:
            senders = scan.sender_headings[here]
        sound = _sound(scan, paths, scan.apparent_lengths[here], turned(paths.leaving, heading - senders))
        times[k : k + 1], row = first_echoes(scan.headings[k : k + 1], sound, scan.board, speed)
        winners[k] = np.append(here, -1)[row[0]]
    return times, winners


def _sound(scan: PredictedScan, paths: Paths, lengths: FloatArray, leaving: FloatArray) -> Sound:
    """Return the sound along `paths` (p,), in order of their apparent lengths (p,) m, departing along `leaving`."""
    return Sound(
        lengths / scan.room.air.speed_of_sound,
        scan.phasors_of(paths),
        leaving,
        paths.arriving,
        scan.blocked_by_face(paths, scan.headings),
    )


def with_own_body(scan: PredictedScan) -> PredictedScan:
    """Return the scan with the echo of the carrier's own body as reading, wherever it is the nearest; without a path.

    The heading of the scan's place is the actual one of the turntable's zero.
    """
    board, zero = scan.board, scan.place.heading  # before scans of several places are joined
    owned = [own_range(board.own_body, board.angle_at(heading, zero)) for heading in scan.headings.tolist()]
    own = board.true_ranges(np.array([np.nan if distance is None else distance for distance in owned]))
    nearest = np.fmin(own, scan.distances)
    is_own = nearest == own
    return replace(scan, winners=np.where(is_own, -1, scan.winners), distances=nearest, of_own_body=is_own)


# the echo nearest to a measured range


IntArray = NDArray[np.intp]


def nearest_paths(scan: PredictedScan, rows: IntArray, measured: FloatArray, reach: float) -> IntArray:
    """Return the path of the echo that is nearest to each measured range, (k,) int; -1: none within `reach` (m).

    `rows` (k,) are headings of the scan, and `measured` (k,) the ranges there, m. The echoes are those of
    `PredictedPing.echoes`.
    """
    if not scan.weighed_at_once:
        return _one_by_one(scan, rows, measured, reach)
    board, lengths = scan.board, scan.apparent_lengths
    span = board.wavelength(scan.room.air) if board.sum_arrivals else -1.0
    sought = Sought(False, measured, reach, lengths, board.reported(lengths / 2), scan.in_time, span)
    headings = scan.headings[rows]
    weighed = paths_and_beam(scan, headings, slice(None), scan.all_together)
    return np.asarray(detected(headings, every_path(len(headings), len(lengths)), weighed, sought))


def _one_by_one(scan: PredictedScan, rows: IntArray, measured: FloatArray, reach: float) -> IntArray:
    """Return `nearest_paths` where rough surfaces, or paths of one heading only, need the sound of every heading."""
    nearest_rows = np.full(len(rows), -1, dtype=np.intp)
    for k, (row, distance) in enumerate(zip(rows.tolist(), measured.tolist(), strict=True)):
        echoes = scan.ping(row).echoes
        nearest = min(echoes, key=lambda echo: abs(echo.range - distance), default=None)
        if nearest is not None and abs(nearest.range - distance) <= reach:
            nearest_rows[k] = nearest.path
    return nearest_rows
