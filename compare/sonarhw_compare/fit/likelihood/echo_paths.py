"""Paths of sound as functions of position, walls and mount, so that a small change needs no new search.

Sound that reflects off walls only runs straight to the image source of the listener in the unfolded room. This image
moves with the listener, rotated or mirrored. With departure direction u and arrival direction a, the rotated or
mirrored a is -u. Length and directions at another position are therefore exact as long as the path meets the same
walls, and the gradient of the length is -(u + a). An image behind a moving wall moves twice as far as the wall. With
posts, all this holds to first order.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.beam import SAME_LENGTH
from sonarhw_sim.board.profile import Board
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.grid import whole_numbers
from sonarhw_sim.room.room import Room

from sonarhw.readings import BoolArray, FloatArray
from sonarhw_compare.fit.values.free_walls import corner_moves, left_normals

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


def _image_moves(paths: Paths, room: Room, walls: list[str]) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of `out` and `back` by the shift of each wall to its left, both (k, 2, walls)."""
    if not walls:
        return np.zeros((len(paths), 2, 0)), np.zeros((len(paths), 2, 0))
    columns = {room.names.index(name): column for column, name in enumerate(walls)}
    touched, after, bent = paths.surfaces >= 0, _after_bend(paths), paths.edges >= 0
    corners = np.zeros((len(paths), len(walls)), np.complex128)
    for edge in np.unique(paths.edges[bent]).tolist():
        x, y = corner_moves(room, room.edges.points[edge], columns)
        corners[paths.edges == edge] = x + 1j * y
    normals = _touched_normals(paths, left_normals(room.walls))
    by_touch = np.zeros((*paths.surfaces.shape, len(walls)))
    for surface, column in columns.items():
        by_touch[..., column] = paths.surfaces == surface
    out = _image_move(normals, touched & ~after, by_touch, corners)
    back = _image_move(normals[:, ::-1], after[:, ::-1], by_touch[:, ::-1], corners)
    return _as_vectors(out), _as_vectors(np.where(bent[:, None], back, 0.0))


def _after_bend(paths: Paths) -> BoolArray:
    """Return which touches of surfaces (k, t) come after the edge of their path."""
    touched = paths.surfaces >= 0
    number = np.cumsum(touched, axis=1) - 1
    return np.asarray(touched & (paths.edges >= 0)[:, None] & (number >= paths.bends[:, None]))


def _touched_normals(paths: Paths, walls: FloatArray) -> NDArray[np.complex128]:
    """Return the unit normal of the surface at each touch (k, t) as a complex number; at a post, of the reflection.

    `walls` (n, 2) are the normals of the walls.
    """
    surfaces, after = paths.surfaces, _after_bend(paths)
    normals = _complex_vectors(walls)[np.minimum(surfaces, len(walls) - 1)]
    for path, touch in np.argwhere(surfaces >= len(walls)).tolist():
        # after the bend, the edge is one more point
        at = int((surfaces[path, : touch + 1] >= 0).sum()) + int(after[path, touch])
        normals[path, touch] = complex(*_reflection_normal(paths.points[path, at - 1 : at + 2]))
    return normals


def _reflection_normal(points: FloatArray) -> FloatArray:
    """Return the unit normal at the second of three points (3, 2) of a reflection."""
    come, go = np.diff(points, axis=0) / np.hypot(*np.diff(points, axis=0).T)[:, None]
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


def _complex_vectors(vectors: FloatArray) -> NDArray[np.complex128]:
    return np.asarray(vectors[:, 0] + 1j * vectors[:, 1])


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
        for there, its_key, found in tuple(self._searches):
            if there is room and its_key == key:
                return found
        found = search()
        self._searches.append((room, key, found))
        return found
