"""How the paths of a place change as the place, the room and the board change a little, without another search.

Takes `Paths` found at one position; hands on `EchoPaths`, which know what every path would be from a few centimetres
away. Sound that leaves by walls alone runs in the unfolded room straight to the listener's image, and that image moves
as the listener does, turned or mirrored: with departure u and arrival direction a, known from the path itself, the
mirrored or turned a is -u. So a path's length and directions at another position are exact as long as it meets
the same walls; its gradient there is -(u + a). Past a post it is right to first order.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from compare.fit.walls import left_normals
from sim.compiled import compiled
from sim.paths import Paths
from sim.room import Room
from sonarhw.readings import FloatArray

Point = tuple[float, float]

_NO_LEG = 1e-7  # m

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
    by_wall: FloatArray  # (k, walls): by how much it grows for every metre that a wall moves to its left


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
        _by_wall(paths, room, walls),
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


def _by_wall(paths: Paths, room: Room, walls: list[str]) -> FloatArray:
    """2 × (unit way in) · normal, summed over a path's touches of each wall."""
    grown = np.zeros((len(paths), len(walls)))
    if not walls:
        return grown
    normals, columns = left_normals(room.walls), {room.names.index(name): column for column, name in enumerate(walls)}
    for path in range(len(paths)):
        for surface, way in _touched_walls(paths, path, normals):
            if surface in columns:
                grown[path, columns[surface]] += 2 * way @ normals[surface]
    return grown


def _touched_walls(paths: Paths, path: int, normals: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """The walls that a path reflects off, and the unit vector along which it comes to each."""
    legs = np.diff(paths.outline(path), axis=0)
    lengths = np.hypot(*legs.T)
    bend = int(paths.bends[path]) if paths.edges[path] >= 0 else -1
    way, leg = legs[0] / max(float(lengths[0]), 1e-300), 0
    for bounce, surface in enumerate(paths.surfaces[path][paths.surfaces[path] >= 0].tolist()):
        for at in range(leg, leg + 1 + (bounce == bend)):
            # through a vertex two touches are one point, and there is no leg between them
            way = legs[at] / lengths[at] if lengths[at] > _NO_LEG else way
        leg += 1 + (bounce == bend)
        if surface < len(normals):
            yield surface, way
            way = way - 2 * (way @ normals[surface]) * normals[surface]


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
    out: FloatArray, back: FloatArray, turn: FloatArray, kind: NDArray[np.int8], by: Point, stretch: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`out` and `back` (k, 2) of paths from a place `by` m away, each stretched by a factor (k,)."""
    new_out, new_back = np.empty_like(out), np.empty_like(back)
    for k in range(out.shape[0]):
        x, y, bx, by_ = displaced(out[k], back[k], turn[k], kind[k], by, by)
        new_out[k, 0], new_out[k, 1] = x * stretch[k], y * stretch[k]
        new_back[k, 0], new_back[k, 1] = bx * stretch[k], by_ * stretch[k]
    return new_out, new_back
