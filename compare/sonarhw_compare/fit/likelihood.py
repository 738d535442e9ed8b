"""The log-likelihood of readings for given paths, and the paths that follow place and walls during a fit."""

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.beam import FAINT_DB, SAME_LENGTH, amplitudes_at, beam, beam_table
from sonarhw_sim.board.profile import Board, path_loss_db, stepped_gain_db
from sonarhw_sim.board.receiver import echo_times
from sonarhw_sim.board.signal import RATE, Patches, burst_of, covered_by_burst
from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined
from sonarhw_sim.rays.diffraction import amplitudes_at_edges
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.grid import whole_numbers
from sonarhw_sim.room.room import Room

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.free_walls import corner_moves, left_normals
from sonarhw_compare.fit.quantities import REFLECTANCE

# Paths of sound as functions of position, walls and mount, so that a small change needs no new search.
#
# Sound that reflects off walls only runs straight to the image source of the listener in the unfolded room. This
# image moves with the listener, rotated or mirrored. With departure direction u and arrival direction a, the rotated
# or mirrored a is -u. Length and directions at another position are therefore exact as long as the path meets the
# same walls, and the gradient of the length is -(u + a). An image behind a moving wall moves twice as far as the
# wall. With posts, all this holds to first order.


Point = tuple[float, float]

_SAME_DIRECTION = 1e-6  # of unit vectors
_KEPT = 4  # searches

EVEN, ODD, BENT = 0, 1, 2  # number of reflections, or diffraction at an edge


class EchoPaths(NamedTuple):
    """Paths of one place, one row each, shortest first."""

    out: FloatArray  # (k, 2) m, from the sender to the image of the listener or of the edge
    back: FloatArray  # (k, 2) m, from the listener to the image of the edge; 0 without diffraction
    rise: FloatArray  # (k, 2) m, vertical extent of both
    turn: FloatArray  # (k, 2), complex factor from a move of the listener to that of its image
    kind: NDArray[np.int8]  # (k,): EVEN, ODD or BENT
    until: NDArray[np.int64]  # (k,), the row after the last path that a receiver adds to each
    gain_db: FloatArray  # (k,)
    powers: FloatArray  # (k, materials), of the reflectance of each material in the amplitude: number of reflections
    out_by_wall: FloatArray  # (k, 2, walls), derivative of `out` by the shift of each wall to its left
    back_by_wall: FloatArray  # (k, 2, walls), derivative of `back`


def with_reverses(paths: Paths, board: Board) -> Paths:
    """Return the paths without those that are the reverse of an earlier one, which gets twice its gain.

    A path and its reverse take the same time, so one transducer receives both together. Returns all paths if the board
    does not sum arrivals, or has two transducers.
    """
    if not board.sum_arrivals or board.mount.separation:
        return paths
    ends = np.searchsorted(paths.lengths, paths.lengths + SAME_LENGTH, side="right")
    rows = np.arange(len(paths))
    row, second = whole_numbers(rows + 1, ends - 1)
    kept, gains = np.ones(len(paths), np.bool_), paths.gains.copy()
    reverse = _are_alike(paths.leaving[row], paths.arriving[second])
    reverse &= _are_alike(paths.arriving[row], paths.leaving[second])
    for one, other in zip(row[reverse].tolist(), second[reverse].tolist(), strict=True):
        if kept[one] and kept[other]:
            kept[other] = False
            gains[one] *= 2
    return replace(paths, gains=gains).select(np.flatnonzero(kept))


def _are_alike(one: FloatArray, other: FloatArray) -> BoolArray:
    """Return which of the unit vectors (n, 2) have the same direction, (n,)."""
    return np.asarray((np.abs(one - other) < _SAME_DIRECTION).all(axis=1))


def echo_paths(paths: Paths, room: Room, materials: list[str], walls: list[str], together: float = 0.0) -> EchoPaths:
    """Return the paths of a room in this form; `materials` and `walls` are those that a fit can change.

    A receiver adds paths to one that is up to `together` (m) shorter.
    """
    kind = np.where(paths.edges >= 0, BENT, paths.bounces % 2).astype(np.int8)
    bent = kind == BENT
    to_edge = np.where(bent, _length_to_edge(paths), paths.lengths)
    on = paths.lengths - to_edge
    away, home = -_complex(paths.departures), _complex(paths.arrivals)
    turn = np.where(kind == ODD, away * home, away * home.conj())
    rise = np.column_stack((to_edge, on)) * np.sin(paths.elevations)
    return EchoPaths(
        np.ascontiguousarray(to_edge[:, None] * paths.leaving),
        np.ascontiguousarray(on[:, None] * paths.arriving),
        np.ascontiguousarray(rise),
        np.column_stack((turn.real, turn.imag)),
        kind,
        _until(paths, together),
        20 * np.log10(np.maximum(paths.gains, 1e-12)),
        _touches(paths, room, materials),
        *_image_moves(paths, room, walls),
    )


def _complex(angles: FloatArray) -> NDArray[np.complex128]:
    return np.asarray(np.exp(1j * angles))


def _until(paths: Paths, together: float) -> NDArray[np.int64]:
    # patches of rough surfaces already have the power of their neighbours (`rough_paths`)
    if not together or paths.scattered.any():
        return np.arange(1, len(paths) + 1, dtype=np.int64)
    return np.searchsorted(paths.lengths, paths.lengths + together, side="right").astype(np.int64)


def _length_to_edge(paths: Paths) -> FloatArray:
    """Return the length of each path up to its edge, (k,) m, in proportion to the plan."""
    legs = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), 2, 0))
    whole = np.maximum(np.nansum(legs, axis=1), 1e-300)
    before = np.where(np.arange(legs.shape[1]) <= paths.bends[:, None], np.nan_to_num(legs), 0.0).sum(axis=1)
    return np.asarray(paths.lengths * before / whole)


def _touches(paths: Paths, room: Room, materials: list[str]) -> FloatArray:
    of_surface = np.array([[name == material for material in materials] for name in room.materials], dtype=np.float64)
    # row -1, "no surface", selects the appended zeros
    rows = np.vstack((of_surface.reshape(len(room.materials), len(materials)), np.zeros((1, len(materials)))))
    return np.ascontiguousarray(rows[paths.surfaces].sum(axis=1))


_SAME_POINT = 1e-9  # m


def _image_moves(paths: Paths, room: Room, walls: list[str]) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of `out` and `back` by the shift of each wall to its left, both (k, 2, walls)."""
    if not walls:
        return np.zeros((len(paths), 2, 0)), np.zeros((len(paths), 2, 0))
    columns = {room.names.index(name): column for column, name in enumerate(walls)}
    after, bent = _after_bend(paths), paths.edges >= 0
    # floor, ceiling and lids mirror nothing in the plan
    upright = (paths.surfaces >= 0) & (paths.surfaces < len(room.walls) + len(room.posts))
    corners = np.zeros((len(paths), len(walls)), np.complex128)
    for edge in np.unique(paths.edges[_in_plan(paths, room)]).tolist():
        x, y = corner_moves(room, room.edges.points[edge], columns)
        corners[paths.edges == edge] = x + 1j * y
    normals = _touched_normals(paths, left_normals(room.walls), upright)
    by_touch = np.zeros((*paths.surfaces.shape, len(walls)))
    for surface, column in columns.items():
        by_touch[..., column] = paths.surfaces == surface
    out = _image_move(normals, upright & ~after, by_touch, corners)
    back = _image_move(normals[:, ::-1], (upright & after)[:, ::-1], by_touch[:, ::-1], corners)
    return _as_vectors(out), _as_vectors(np.where(bent[:, None], back, 0.0))


def _in_plan(paths: Paths, room: Room) -> BoolArray:
    """Return which paths (k,) bend at an edge of the plan. Others bend at a rim, or at an edge of a section only.

    Those keep their place and level until the next search.
    """
    return np.asarray((paths.edges >= 0) & (paths.edges < len(room.edges.points)))


def _after_bend(paths: Paths) -> BoolArray:
    """Return which touches of surfaces (k, t) come after the edge of their path."""
    touched = paths.surfaces >= 0
    number = np.cumsum(touched, axis=1) - 1
    return np.asarray(touched & (paths.edges >= 0)[:, None] & (number >= paths.bends[:, None]))


def _touched_normals(paths: Paths, walls: FloatArray, upright: BoolArray) -> NDArray[np.complex128]:
    """Return the unit normal of the surface at each touch (k, t) as a complex number; at a post, of the reflection.

    `walls` (n, 2) are the normals of the walls, and `upright` (k, t) are touches of walls and posts.
    """
    surfaces, after = paths.surfaces, _after_bend(paths)
    normals = (walls[:, 0] + 1j * walls[:, 1])[np.minimum(surfaces, len(walls) - 1)]
    for path, touch in np.argwhere(upright & (surfaces >= len(walls))).tolist():
        # after the bend, the edge is one more point
        at = int((surfaces[path, : touch + 1] >= 0).sum()) + int(after[path, touch])
        normals[path, touch] = complex(*_reflection_normal(paths.outline(path), at))
    return normals


def _reflection_normal(outline: FloatArray, at: int) -> FloatArray:
    """Return the unit normal at one of the points (n, 2) of a path that is reflected there.

    At the foot of a post, the floor is touched at the same point of the plan.
    """
    apart = np.hypot(*(outline - outline[at]).T) > _SAME_POINT
    legs = outline[at] - outline[:at][apart[:at]][-1], outline[at + 1 :][apart[at + 1 :]][0] - outline[at]
    come, go = (leg / np.hypot(*leg) for leg in legs)
    return np.asarray((go - come) / np.hypot(*(go - come)))


def _image_move(
    normals: NDArray[np.complex128], mirrors: BoolArray, by_touch: FloatArray, end: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return how images of points behind mirrors move if the points move by `end`; both (k, walls), complex.

    `normals` (k, t) are those of the touches in order, `mirrors` (k, t) is True for those to count, and `by_touch`
    (k, t, walls) is 1 where a touch is on a movable wall. A mirror with normal n maps a vector z to -n² z*.
    """
    moves = np.zeros(end.shape, np.complex128)
    factor, flipped = np.ones(len(normals), np.complex128), np.zeros(len(normals), np.bool_)
    for touch in range(normals.shape[1]):
        normal, counts = np.where(flipped, normals[:, touch].conj(), normals[:, touch]), mirrors[:, touch]
        moves += np.where(counts, 2 * factor * normal, 0.0)[:, None] * by_touch[:, touch]
        factor = np.where(counts, -factor * normal**2, factor)
        flipped ^= counts
    return np.asarray(moves + factor[:, None] * np.where(flipped[:, None], end.conj(), end))


def _as_vectors(moves: NDArray[np.complex128]) -> FloatArray:
    """Return complex numbers (k, walls) as vectors, (k, 2, walls)."""
    return np.ascontiguousarray(np.stack((moves.real, moves.imag), axis=1))


def growth_by_wall(paths: EchoPaths) -> FloatArray:
    """Return the derivative of path lengths by the shift of each wall to its left, (k, walls)."""
    return np.asarray(
        sum(
            np.einsum("ki,kiw->kw", _unit(vectors, rise), moves)
            for vectors, rise, moves in zip(
                (paths.out, paths.back), paths.rise.T, (paths.out_by_wall, paths.back_by_wall), strict=True
            )
        )
    )


def _unit(vectors: FloatArray, rise: FloatArray) -> FloatArray:
    lengths = np.sqrt((vectors**2).sum(axis=1) + rise**2)
    return np.asarray(vectors / np.maximum(lengths, 1e-300)[:, None])


@compiled
def displaced(
    out: FloatArray, back: FloatArray, turn: FloatArray, kind: int, sender: Point, listener: Point
) -> tuple[float, float, float, float]:
    """Return `out` and `back` of one path, as x, y, x, y, after sender and listener have moved by these vectors, m."""
    if kind == BENT:
        return out[0] - sender[0], out[1] - sender[1], back[0] - listener[0], back[1] - listener[1]
    y = -listener[1] if kind == ODD else listener[1]
    x_image, y_image = turn[0] * listener[0] - turn[1] * y, turn[0] * y + turn[1] * listener[0]
    return out[0] + x_image - sender[0], out[1] + y_image - sender[1], 0.0, 0.0


@dataclass(frozen=True)
class PathMemory:
    """The last searches of a fit, because several of its steps begin where the one before has ended."""

    _searches: deque[tuple[Room, object, tuple[EchoPaths, ...]]] = field(default_factory=lambda: deque(maxlen=_KEPT))

    def paths(self, room: Room, key: object, search: Callable[[], tuple[EchoPaths, ...]]) -> tuple[EchoPaths, ...]:
        """Return the paths of an earlier search in this very room with an equal key, or else those of `search`."""
        for there, its_key, paths in tuple(self._searches):
            if there is room and its_key == key:
                return paths
        paths = search()
        self._searches.append((room, key, paths))
        return paths


# The log-likelihood of readings for given paths: detected echoes, undetected echoes, and no echo.
#
# Path k is detected with probability d = (1 - missed) Φ((level - threshold) / σ_level), at its range ± σ_range. If
# the receiver adds later paths to it, d is the mean over all differences of phase, which no plan of a room states.
# False echoes (strays) are uniform in range. The board listens until its first echo or, if it reports several, in all
# intervals between them. The log-likelihood is
#
#     Σ over echoes  ln(stray + Σ over paths  d N(r - ρ) / (1 - d m))  +  Σ over paths  ln(1 - d m)  -  stray · listened
#
# with N the normal density and m the share of a path's normal distribution inside the intervals of listening. For one
# echo, this is exactly the density of the first of independent arrivals. With probability `lost`, a ping receives
# nothing from the room and reports only strays, if anything. docs/explanation/fit_method.md derives this.


LATENESS_STEP = 0.5  # dB, between nodes of a lateness table
_FAR = 6.0  # standard deviations beyond which a normal distribution is 0
_HOPELESS = -40.0  # log-likelihood of silence to which further paths add nothing, because a ping can be lost
_ASIDE = 0.05  # cosine of the largest angle from the axis at which echoes are detected
_FAINT = 10 ** (-FAINT_DB / 20)  # amplitude by that of the threshold; fainter paths begin no arrival
_NEGLIGIBLE = 0.03  # amplitude of later paths by that of the first; less changes a level by 0.3 dB at most
_PHASES = np.cos((np.arange(6) + 0.5) * math.pi / 6)  # cosines of equally probable phase differences
_PER_DB = math.log(10.0) / 20.0  # the logarithm of an amplitude by its level
_ROOT_2 = math.sqrt(2.0)
_ROOT_2PI = math.sqrt(2.0 * math.pi)


class ScanArrays(NamedTuple):
    """The n readings of a scan, as arrays for the kernel."""

    angles: FloatArray  # (n,) rad, turntable angles
    ranges: FloatArray  # (n, e) m, of the echoes, padded with NaN
    counts: NDArray[np.int64]  # (n,), number of echoes
    ends: NDArray[np.bool_]  # (n,), whether the board stopped listening at the last of them


class BoardValues(NamedTuple):
    """Heading, detection and geometry of the board, for the kernel."""

    heading: float  # rad, actual one of the turntable's step 0
    scale: float  # true turn of the turntable by turntable angle
    ka: float  # wavenumber times aperture radius
    threshold_db: float
    opens: float  # m, shortest reported range
    closes: float  # m, longest reported range
    dead: float  # m, dead zone after an echo
    stretch: float  # reported range by true range
    offset: float  # m, added to the stretched range
    sender: Point  # m, ahead and to the left of the turning axis
    listener: Point


class ReadingNoise(NamedTuple):
    """Errors of readings."""

    range: float  # m
    level: float  # dB
    missed: float  # probability that a loud echo is not detected
    lost: float  # probability that a ping receives nothing from the room
    stray: float  # false echoes per metre of range
    stretch: float = 1.0  # reported range by true range; differs from 1 if the assumed speed of sound is wrong


class PathArrays(NamedTuple):
    """The k paths of a place, about shortest first."""

    out: FloatArray  # this and the next four as in `EchoPaths`
    back: FloatArray
    rise: FloatArray
    turn: FloatArray
    kind: NDArray[np.int8]
    until: NDArray[np.int64]  # (k,), the row after the last path that a receiver adds to each
    level_db: FloatArray  # (k,), before the beam


@compiled
def log_likelihoods(
    scan: ScanArrays,
    paths: PathArrays,
    by: Point,
    board: BoardValues,
    noise: ReadingNoise,
    table: FloatArray,
    lateness: FloatArray,
) -> FloatArray:
    """Return the log-likelihood of each reading, (n,); `table` is the beam table (`sonarhw_sim.board.beam`).

    The place has moved by the vector `by` (m) since `paths` were searched.
    `lateness` (l,) m is the error in range of late detection at 0, 0.5, 1, ... dB over the threshold; empty for none.
    """
    angles, echoes, counts, ended = scan.angles, scan.ranges, scan.counts, scan.ends
    reported, nearest, leaving, arriving = _on_axis(paths, by, board)
    aside = board.sender != (0.0, 0.0) or board.listener != (0.0, 0.0)
    reach = _reach(board) * board.stretch
    # amplitudes are relative to the threshold
    strengths = np.exp((paths.level_db - board.threshold_db) * _PER_DB)
    needed = _needed(strengths, paths.until, noise)
    likelihoods, densities = np.empty(angles.shape[0]), np.empty(echoes.shape[1])
    for i in range(angles.shape[0]):
        count, ranges = counts[i], echoes[i]
        ends = ended[i] and count > 0
        last = ranges[count - 1] if ends else board.closes
        farthest = last + _FAR * noise.range + reach
        heading = board.heading + board.scale * angles[i]
        hx, hy = math.cos(heading), math.sin(heading)
        sender, listener = _turned(board.sender, by, hx, hy), _turned(board.listener, by, hx, hy)
        densities[:] = noise.stray
        undetected = 0.0
        for k in range(reported.shape[0]):
            # leave out what arrives too late or is too faint at every heading
            if reported[k] > farthest or needed[k] > 1.0:
                if nearest[k] > farthest:
                    break
                continue
            # the direction decides first, because it excludes most paths
            ahead, home = _cosine(leaving, k, hx, hy), _cosine(arriving, k, hx, hy)
            if ahead < _ASIDE or home < _ASIDE:
                continue
            found = reported[k]
            if aside:
                found, ahead, home = _beside_axis(paths, k, sender, listener, hx, hy, board)
            amplitude = beam(ahead, board.ka, table)
            if amplitude < needed[k]:
                continue
            amplitude *= beam(home, board.ka, table)
            if amplitude < needed[k]:
                continue
            amplitude *= strengths[k]
            power = 0.0
            for j in range(k + 1, paths.until[k]):
                there, on = _cosine(leaving, j, hx, hy), _cosine(arriving, j, hx, hy)
                power += _power(strengths[j], there, on, board.ka, table)
            chance, late = _detection(amplitude, power, noise, lateness)
            if chance == 0.0:
                continue
            # count it as an echo at each reported range, and as no echo
            found += late
            silence = 1.0 - chance * _mass(found, ranges, count, ends, board, noise.range)
            undetected += math.log(silence)
            if count == 0 and undetected < _HOPELESS:
                break  # the ping was lost
            _add_densities(densities, ranges, count, found, chance / silence, noise.range)
        likelihoods[i] = _of_reading(undetected, densities, count, max(0.0, last - board.opens), noise)
    return likelihoods


@compiled
def sum_likelihoods(
    scan: ScanArrays,
    paths: PathArrays,
    moves: FloatArray,
    headings: FloatArray,
    board: BoardValues,
    noise: ReadingNoise,
    table: FloatArray,
    lateness: FloatArray,
    totals: FloatArray,
) -> None:
    """Fill in the sums of `log_likelihoods` at places moved by `moves` (m, 2) m, with these headings (m,) rad, (m,)."""
    for k in range(headings.shape[0]):
        turned = BoardValues(
            headings[k],
            board.scale,
            board.ka,
            board.threshold_db,
            board.opens,
            board.closes,
            board.dead,
            board.stretch,
            board.offset,
            board.sender,
            board.listener,
        )
        by = moves[k, 0], moves[k, 1]
        totals[k] = 0.0
        for of_reading in log_likelihoods(scan, paths, by, turned, noise, table, lateness):
            totals[k] += of_reading


@inlined
def _cosine(directions: FloatArray, row: int, x: float, y: float) -> float:
    """Return the cosine of the angle between a row of directions (k, 2) and the direction x, y."""
    cosine: float = directions[row, 0] * x + directions[row, 1] * y
    return cosine


@inlined
def _power(strength: float, ahead: float, home: float, ka: float, table: FloatArray) -> float:
    """Return the square of an amplitude after the beam, departing and arriving."""
    return (strength * beam(ahead, ka, table) * beam(home, ka, table)) ** 2


@inlined
def _beside_axis(
    paths: PathArrays, k: int, sender: Point, listener: Point, hx: float, hy: float, board: BoardValues
) -> tuple[float, float, float]:
    """Return the reported range of a path (m) and its cosines from the axis of the beam, departing and arriving."""
    one = displaced(paths.out[k], paths.back[k], paths.turn[k], paths.kind[k], sender, listener)
    there, on, back_x, back_y = _legs(one, paths.rise[k], paths.turn[k], paths.kind[k])
    ahead, home = (one[0] * hx + one[1] * hy) / there, back_x * hx + back_y * hy
    return (there + on) / 2 * board.stretch + board.offset, ahead, home


@inlined
def _detection(amplitude: float, power: float, noise: ReadingNoise, lateness: FloatArray) -> tuple[float, float]:
    """Return the probability that an arrival is detected, and by how much too far (m).

    `power` is that of the later paths which the receiver adds to it.
    """
    over, late = 20.0 * math.log10(amplitude), 0.0
    if power > (_NEGLIGIBLE * amplitude) ** 2:
        # smooth in the level: a limit at which whole arrivals come and go would trap the sampler
        begins = _normal((over + FAINT_DB) / noise.level)
        chance = (1.0 - noise.missed) * begins * _chance_of_sum(amplitude, math.sqrt(power), noise.level)
    else:
        late = _late(over, lateness)
        chance = (1.0 - noise.missed) * _normal(over / noise.level)
    return chance, late


@inlined
def _add_densities(
    densities: FloatArray, ranges: FloatArray, count: int, found: float, weight: float, spread: float
) -> None:
    """Add to the density (1/m) at each of `count` echoes what a path with the range `found` ± `spread` (m) gives."""
    for e in range(count):
        away = (ranges[e] - found) / spread
        if abs(away) < _FAR:
            densities[e] += weight * math.exp(-0.5 * away * away) / (spread * _ROOT_2PI)


@inlined
def _of_reading(undetected: float, densities: FloatArray, count: int, listened: float, noise: ReadingNoise) -> float:
    """Return the log-likelihood of a reading: of a ping that receives something, or nothing, from the room.

    `undetected` is that of the paths without an echo; the board has `listened` to this length of range (m).
    """
    strays = -noise.stray * listened
    likelihood = undetected + strays
    for e in range(count):
        likelihood += math.log(densities[e])
    strays += count * math.log(noise.stray)
    whole: float = np.logaddexp(math.log(1.0 - noise.lost) + likelihood, math.log(noise.lost) + strays)
    return whole


@array_part
def _on_axis(paths: PathArrays, by: Point, board: BoardValues) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return reported ranges (k,), the smallest one from each row on (k,), and directions, for a sensor on the axis.

    The directions of departure and towards the arriving sound, (k, 2) each, are horizontal parts of unit vectors.
    """
    out, back, rise, turn, kinds = paths.out, paths.back, paths.rise, paths.turn, paths.kind
    count = out.shape[0]
    reported, nearest, leaving, arriving = np.empty(count), np.empty(count), np.empty((count, 2)), np.empty((count, 2))
    for k in range(count):
        one = displaced(out[k], back[k], turn[k], kinds[k], by, by)
        there, on, arriving[k, 0], arriving[k, 1] = _legs(one, rise[k], turn[k], kinds[k])
        leaving[k, 0], leaving[k, 1] = one[0] / there, one[1] / there
        reported[k] = (there + on) / 2 * board.stretch + board.offset
    least = np.inf
    for k in range(count - 1, -1, -1):
        least = min(least, reported[k])
        nearest[k] = least
    return reported, nearest, leaving, arriving


@compiled_part
def _legs(
    one: tuple[float, float, float, float], rise: FloatArray, turn: FloatArray, kind: int
) -> tuple[float, float, float, float]:
    """Return the lengths of `out` and `back` of a path, m, and the unit vector (x, y) towards the arriving sound."""
    ox, oy, bx, by = one
    there = max(math.sqrt(ox * ox + oy * oy + rise[0] ** 2), 1e-12)
    if kind == BENT:
        on = max(math.sqrt(bx * bx + by * by + rise[1] ** 2), 1e-12)
        return there, on, bx / on, by / on
    # back along the image's axes: R⁻¹(-u)
    across = (turn[0] * oy - turn[1] * ox) / there
    return there, 0.0, -(turn[0] * ox + turn[1] * oy) / there, across if kind == ODD else -across


@array_part
def _needed(strengths: FloatArray, until: NDArray[np.int64], noise: ReadingNoise) -> FloatArray:
    """Return the least factor by the beam at which each path, or the sum that it begins, can be detected, (k,)."""
    least = math.exp(-_FAR * noise.level * _PER_DB)
    needed = np.empty(strengths.shape[0])
    for k in range(strengths.shape[0]):
        whole = strengths[k]
        for j in range(k + 1, until[k]):
            whole += strengths[j]
        amplitude = least * _FAINT if whole > strengths[k] else least
        needed[k] = amplitude / strengths[k] if whole > least else np.inf
    return needed


@compiled_part
def _chance_of_sum(first: float, others: float, spread: float) -> float:
    """Return the probability that the sum of two amplitudes of unknown phases exceeds 1; `spread` (dB) is its error."""
    far = math.exp(_FAR * spread * _PER_DB)
    if abs(first - others) > far:
        return 1.0
    if (first + others) * far < 1.0:
        return 0.0
    chance = 0.0
    for cosine in _PHASES:
        power = first * first + others * others + 2.0 * first * others * cosine
        chance += _normal(10.0 * math.log10(power) / spread)
    return chance / len(_PHASES)


@compiled_part
def _turned(from_axis: Point, axis: Point, x: float, y: float) -> Point:
    """Return a point given ahead and to the left of the axis, m, in room coordinates; the head points along x, y."""
    return axis[0] + from_axis[0] * x - from_axis[1] * y, axis[1] + from_axis[0] * y + from_axis[1] * x


@compiled_part
def _reach(board: BoardValues) -> float:
    """Return the larger distance of sender and listener from the axis, m."""
    return max(math.hypot(board.sender[0], board.sender[1]), math.hypot(board.listener[0], board.listener[1]))


@compiled_part
def _normal(x: float) -> float:
    """Return the share of a normal distribution below x standard deviations."""
    if abs(x) > _FAR:
        return 1.0 if x > 0.0 else 0.0
    share: float = 0.5 * math.erfc(-x / _ROOT_2)
    return share


@compiled_part
def _mass(reported: float, ranges: FloatArray, count: int, ends: bool, board: BoardValues, spread: float) -> float:
    """Return the share of an echo's normal distribution about `reported` inside the intervals of listening."""
    mass, begin = 0.0, board.opens
    for e in range(count):
        if ranges[e] > begin:
            mass += _normal((ranges[e] - reported) / spread) - _normal((begin - reported) / spread)
        begin = ranges[e] + board.dead
    if not ends and board.closes > begin:
        mass += _normal((board.closes - reported) / spread) - _normal((begin - reported) / spread)
    return mass


@compiled_part
def _late(over: float, lateness: FloatArray) -> float:
    """Return the error in range, m, of the late detection of an echo `over` dB over the threshold."""
    if lateness.shape[0] == 0:
        return 0.0
    at = min(max(over / LATENESS_STEP, 0.0), lateness.shape[0] - 1.001)
    node = int(at)
    late: float = lateness[node] + (at - node) * (lateness[node + 1] - lateness[node])
    return late


# Late detection and gain of single echoes in the model of the board's own receiver (`board.receiver`).
#
# A faint echo is detected later than a loud one. Tables for single echoes save a fit from simulating whole pings.


_MOST_OVER = 40.0  # dB over the threshold; louder echoes are not detected earlier


@lru_cache(maxsize=16)
def lateness_by_level(board: Board, speed_of_sound: float) -> FloatArray:
    """Return the error in range of late detection at 0, 0.5, 1, ... dB over the threshold, (l,) m."""
    burst = burst_of(board, speed_of_sound)
    lone = np.abs(burst.samples)
    listening = replace(board, blanking=0.0, blanking_inhibit=None, max_range=speed_of_sound * len(lone) / RATE)
    levels = np.arange(0.0, _MOST_OVER + LATENESS_STEP, LATENESS_STEP)
    # slightly over, so that an echo at the threshold is detected
    times = [
        _found(lone * 10 ** ((board.threshold_db + over + 1e-6) / 20), listening, speed_of_sound) for over in levels
    ]
    return np.asarray((np.array(times) - burst.lead / RATE) * speed_of_sound / 2)


def _found(samples: FloatArray, board: Board, speed_of_sound: float) -> float:
    times = echo_times(samples.astype(np.complex128), board, speed_of_sound)
    return float(times[0]) if len(times) else math.nan


def level_offset_db(lengths: FloatArray, board: Board, speed_of_sound: float) -> FloatArray:
    """Return the gain of the board relative to the ideal gain for paths of these lengths (m), dB, same shape."""
    if not board.gain_steps:
        return np.zeros(len(lengths))
    return stepped_gain_db(lengths / speed_of_sound, board) - path_loss_db(np.maximum(lengths, 1e-3), board)


# Rough surfaces in a likelihood: each kept patch has the power of all that are received together with it.


_EVERY = 4  # patch is kept: they are then 2° apart, and the beam is wider
_IN_BEAM = 0.3  # least amplitude by the beam of a transducer that points at a patch in the plan


def with_summed_patches(paths: Paths, room: Room, board: Board) -> Paths:
    """Return the paths with few patches of rough surfaces, each as loud as all are if the transducer points at it.

    A likelihood weighs each path alone, while a receiver adds the power of all patches that burst and beam cover.
    """
    rows = np.flatnonzero(paths.scattered)
    if not len(rows):
        return paths
    ka, speed = board.wavenumber(room.air) * board.aperture_radius, room.air.speed_of_sound
    burst, patches = covered_by_burst(board, speed), paths.select(rows)
    gains, phases = paths.gains.copy(), np.nan_to_num(paths.phases)
    kept = ~paths.scattered
    for k in np.argsort(patches.departures, kind="stable")[::_EVERY].tolist():
        beams = amplitudes_at(
            float(patches.departures[k]), patches.leaving, patches.arriving, np.ones(len(rows)), ka, beam_table(ka)
        )
        together = Patches(patches.lengths, patches.spreads, patches.gains * beams)
        until = patches.lengths[k : k + 1]
        kept[rows[k]] = beams[k] >= _IN_BEAM
        gains[rows[k]] = np.sqrt(together.power_between(until - burst, until)[0]) / max(beams[k], _IN_BEAM)
    return replace(paths, gains=gains, phases=phases).select(np.flatnonzero(kept))


# How the level of a diffracted path depends on the reflectances of the two faces of its edge.


_LOWER = 0.9  # factor of a reflectance at the other end of the difference
# Largest power. Terms of an edge have those of one face, of both, or of none, so it is about 0 to 2; but where they
# cancel each other, a power describes only a small change.
_MOST = 4.0


def edge_powers(paths: Paths, room: Room, materials: Sequence[str], search: PathSearch) -> FloatArray:
    """Return the power with which the reflectance of each material changes the amplitude of an edge, (k, materials).

    It is 0 for paths without an edge of the plan. Each reflection of a path adds 1 to it.
    """
    powers, bent = np.zeros((len(paths), len(materials))), np.flatnonzero(_in_plan(paths, room))
    if not len(bent) or not materials:
        return powers
    where = paths.edges[bent], paths.bends[bent], paths.points[bent]

    def amplitudes(changed: Room) -> FloatArray:
        waves = np.full(len(bent), search.wavelength)
        return np.maximum(np.abs(amplitudes_at_edges(changed, *where, waves, search.edge_strength)), 1e-12)

    present = amplitudes(room)
    for column, material in enumerate(materials):
        lower = _LOWER * REFLECTANCE.value(room, material)
        ratios = amplitudes(REFLECTANCE.put(room, {material: lower})) / present
        powers[bent, column] = np.clip(np.log(ratios) / np.log(_LOWER), -_MOST, _MOST)
    return powers
