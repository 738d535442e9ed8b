"""How the paths of a place change as the place, the room and the board change a little, without another search.

Takes `Paths` found at one position; hands on `EchoPaths`, which know what every path would be from a few centimetres
away. Sound that leaves by walls alone runs in the unfolded room straight to the listener's image, and that image moves
as the listener does, turned or mirrored: with departure u and arrival direction a, known from the path itself, the
mirrored or turned a is -u. So a path's length and directions at another position are exact as long as it meets
the same walls; its gradient there is -(u + a). A wall that moves takes the images behind it along by twice as much.
Past a post all this is right to first order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.compiled import compiled
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.free_walls import corner_moves, left_normals

Point = tuple[float, float]

EVEN, ODD, BENT = 0, 1, 2  # reflections, or an edge on the way


class EchoPaths(NamedTuple):
    """Paths of one place, shortest first; one row each."""

    out: FloatArray  # (k, 2), m: from the sender to the listener's image, or to the edge's image
    back: FloatArray  # (k, 2), m: from the listener to the edge's image; 0 where no edge bends the path
    rise: FloatArray  # (k, 2), m: how far either climbs out of the plane
    turn: FloatArray  # (k, 2): complex factor by which the listener's image moves
    kind: NDArray[np.int8]  # (k,): EVEN, ODD or BENT
    gain_db: FloatArray  # (k,)
    touches: FloatArray  # (k, materials): how often each material reflects it
    out_by_wall: FloatArray  # (k, 2, walls): by how much `out` changes for every metre that a wall moves to its left
    back_by_wall: FloatArray  # (k, 2, walls): and `back`


def echo_paths(paths: Paths, room: Room, materials: list[str], walls: list[str]) -> EchoPaths:
    """Those paths of a room, ready to be moved; `materials` and `walls` are those that a fit may change."""
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
        20 * np.log10(np.maximum(paths.gains, 1e-12)),
        _touches(paths, room, materials),
        *_image_moves(paths, room, walls),
    )


def _complex(angles: FloatArray) -> NDArray[np.complex128]:
    return np.asarray(np.exp(1j * angles))


def _length_to_edge(paths: Paths) -> FloatArray:
    """How far each path has come at its edge, (k,) m, by its corners in the plan."""
    legs = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), 2, 0))
    whole = np.maximum(np.nansum(legs, axis=1), 1e-300)
    before = np.where(np.arange(legs.shape[1]) <= paths.bends[:, None], np.nan_to_num(legs), 0.0).sum(axis=1)
    return np.asarray(paths.lengths * before / whole)


def _touches(paths: Paths, room: Room, materials: list[str]) -> FloatArray:
    of_surface = np.array([[name == material for material in materials] for name in room.materials], dtype=np.float64)
    # row -1, "no surface", picks what is appended
    rows = np.vstack((of_surface.reshape(len(room.materials), -1), np.zeros((1, len(materials)))))
    return np.ascontiguousarray(rows[paths.surfaces].sum(axis=1))


def _image_moves(paths: Paths, room: Room, walls: list[str]) -> tuple[FloatArray, FloatArray]:
    """By how much `out` and `back` change for every metre that a wall moves to its left, both (k, 2, walls)."""
    out, back = np.zeros((2, len(paths), 2, len(walls)))
    if not walls:
        return out, back
    columns, normals = {room.names.index(name): column for column, name in enumerate(walls)}, left_normals(room.walls)
    for path, edge in enumerate(paths.edges.tolist()):
        mirrors = _mirrors(paths, path, normals)
        if edge < 0:
            out[path] = _image_move(mirrors, columns, np.zeros((2, len(walls))))
        else:
            bend, corner = int(paths.bends[path]), corner_moves(room, room.edges.points[edge], columns)
            out[path] = _image_move(mirrors[:bend], columns, corner)
            back[path] = _image_move(mirrors[bend:][::-1], columns, corner)
    return out, back


def _mirrors(paths: Paths, path: int, normals: FloatArray) -> list[tuple[int, FloatArray]]:
    """The surfaces that a path reflects off, in order, each with its normal there."""
    surfaces, bent = paths.surfaces[path][paths.surfaces[path] >= 0].tolist(), paths.edges[path] >= 0
    mirrors = []
    for touch, surface in enumerate(surfaces):
        at = 1 + touch + int(bent and touch >= paths.bends[path])
        post = surface >= len(normals)
        mirrors.append((surface, _halving(paths.points[path, at - 1 : at + 2]) if post else normals[surface]))
    return mirrors


def _halving(points: FloatArray) -> FloatArray:
    """The unit normal at the second of three points (3, 2) of a reflection."""
    come, go = np.diff(points, axis=0) / np.hypot(*np.diff(points, axis=0).T)[:, None]
    return np.asarray((go - come) / np.hypot(*(go - come)))


def _image_move(mirrors: list[tuple[int, FloatArray]], columns: dict[int, int], end: FloatArray) -> FloatArray:
    """How a point's image behind mirrors moves, first to last, where the point moves by `end`; both (2, walls)."""
    moves, unfolded = np.zeros(end.shape), np.eye(2)
    for surface, normal in mirrors:
        if surface in columns:
            moves[:, columns[surface]] += 2 * unfolded @ normal
        unfolded = unfolded @ (np.eye(2) - 2 * np.outer(normal, normal))
    return np.asarray(moves + unfolded @ end)


def growth_by_wall(paths: EchoPaths) -> FloatArray:
    """By how much paths grow for every metre that a wall moves to its left, (k, walls)."""
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
    """`out` and `back` of one path, as x, y, x, y, when sender and listener have moved by so many m."""
    if kind == BENT:
        return out[0] - sender[0], out[1] - sender[1], back[0] - listener[0], back[1] - listener[1]
    y = -listener[1] if kind == ODD else listener[1]
    x_image, y_image = turn[0] * listener[0] - turn[1] * y, turn[0] * y + turn[1] * listener[0]
    return out[0] + x_image - sender[0], out[1] + y_image - sender[1], 0.0, 0.0


@compiled
def moved(
    out: FloatArray, back: FloatArray, turn: FloatArray, kind: NDArray[np.int8], by: Point
) -> tuple[FloatArray, FloatArray]:
    """`out` and `back` (k, 2) of paths from a place `by` m away."""
    new_out, new_back = np.empty_like(out), np.empty_like(back)
    for k in range(out.shape[0]):
        new_out[k, 0], new_out[k, 1], new_back[k, 0], new_back[k, 1] = displaced(
            out[k], back[k], turn[k], kind[k], by, by
        )
    return new_out, new_back
