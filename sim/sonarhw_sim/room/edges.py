"""Edges: the wall ends, corners and crossings that diffract sound, one `Edges` row for each wedge of air at a vertex.

A wedge whose angle divides 180°, such as an inner right angle, reflects and does not diffract: Keller's coefficient
is 0.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.room.grid import IntArray, Listing, cells_at, lay_wall_grid, whole_numbers
from sonarhw_sim.room.room_file import MEETING

_DIVIDES = 1e-6  # largest distance of 180° / angle from a whole number
_FLUSH = 1e-9  # rad
_FEW = 1 << 14  # pairs of vertex and wall that are tested without a grid
_AT_ONCE = 1 << 18  # pairs at a time: all of a large room would need gigabytes
MOST_FACES = 10_000_000  # chained walls have 2 each; overlapping walls have the square of their number


@dataclass(frozen=True)
class Edges:
    """Diffracting wedges, one row each; a vertex may have several."""

    points: FloatArray  # (n, 2), m
    starts: FloatArray  # (n,), rad: direction of the wedge's first face
    openings: FloatArray  # (n,), rad: angle of the air, counter-clockwise from the first face
    faces: IntArray  # (n, 2): walls of the first and of the last face; equal at a free end
    names: tuple[str, ...]  # as in `via`
    # (n, 2), m: how far both faces are bare, from the edge to where the next wall ends, begins or joins on this side;
    # None: unknown, and no wall joins another one midway
    bare: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.names)

    def select(self, rows: NDArray[np.intp]) -> "Edges":
        """Return these rows."""
        bare = None if self.bare is None else self.bare[rows]
        names = tuple(self.names[row] for row in rows.tolist())
        return Edges(self.points[rows], self.starts[rows], self.openings[rows], self.faces[rows], names, bare)


class EdgesByHeight(NamedTuple):
    """The edges of all heights; between two bounds, the same ones exist."""

    bounds: FloatArray  # (b,), m
    edges: Edges
    exist: NDArray[np.bool_]  # (e, b + 1): whether each exists below, between and above the bounds


def inside_wedge(direction: FloatArray, start: FloatArray, opening: FloatArray) -> NDArray[np.bool_]:
    """Return whether directions (rad) lie inside wedges, (n,) bool; sound along a face is not diffracted."""
    turned = np.mod(direction - start, math.tau)
    return np.asarray((turned > _FLUSH) & (turned < opening - _FLUSH))


class _Faces(NamedTuple):
    """The faces of walls at vertices, one row each; a wall that continues beyond a vertex has two there."""

    vertices: IntArray  # (f,), numbers, in order
    directions: FloatArray  # (f,), rad, from the vertex along the wall, 0..2π, in order within a vertex
    walls: IntArray  # (f,), numbers


def find_edges(walls: FloatArray, names: tuple[str, ...]) -> Edges:
    """Return the diffracting wedges of walls (n, 4) whose meeting ends have equal coordinates.

    Wedges are at the ends of walls, and where walls cross. Raises InputError if so many walls overlap that the search
    would take minutes.
    """
    ends = np.unique(walls.reshape(-1, 2), axis=0)
    vertices = np.unique(np.vstack((ends, _crossings(walls, ends))), axis=0)
    faces = _faces_at(vertices, walls)
    following, openings = _wedges(faces)
    rows = np.flatnonzero(_diffracts(openings))
    beside = np.column_stack((faces.walls[rows], faces.walls[following[rows]]))
    return Edges(
        vertices[faces.vertices[rows]],
        faces.directions[rows],
        openings[rows],
        beside,
        tuple(_edge_name(first, second, names) for first, second in beside.tolist()),
        _bare_lengths(faces, following, openings, vertices)[rows],
    )


def _wedges(faces: _Faces) -> tuple[NDArray[np.intp], FloatArray]:
    """Return the face that follows each, and the air between both, rad."""
    following = _following(faces.vertices)
    openings = np.mod(faces.directions[following] - faces.directions, math.tau)
    # a single face has 360° of air
    openings[openings == 0] = math.tau
    return following, openings


def wedges_at(points: FloatArray, walls: FloatArray) -> Iterator[tuple[FloatArray, float, float, int, int]]:
    """Yield all wedges of air at points (p, 2) m on walls (n, 4): point, direction of its first face, opening, walls.

    Unlike edges, these are also the wedges that do not diffract.
    """
    faces = _faces_at(points, walls)
    following, openings = _wedges(faces)
    for row, other in enumerate(following.tolist()):
        first, last = int(faces.walls[row]), int(faces.walls[other])
        yield points[faces.vertices[row]], float(faces.directions[row]), float(openings[row]), first, last


def _bare_lengths(faces: _Faces, following: NDArray[np.intp], openings: FloatArray, vertices: FloatArray) -> FloatArray:
    """Return the distance along both faces of each wedge to the next wedge on the same side of the wall, (f, 2) m.

    It is 0 where the next wedge is not one that ends the wall there.
    """
    # a wall that another one joins on its other side continues here
    wedge = np.flatnonzero(np.abs(openings - math.pi) > _FLUSH)
    wedge, face = np.repeat(wedge, 2), np.tile((0, 1), len(wedge))
    edge = np.where(face == 0, wedge, following[wedge])
    direction, wall = faces.directions[edge], faces.walls[edge]
    # seen along the wall in a direction of 0 to 180°: whether it begins here, and whether its air is on the left
    begins = (direction > MEETING) & (direction < math.pi + MEETING)
    along = direction - np.where(begins, 0.0, math.pi)
    left = (face == 0) == begins
    points = vertices[faces.vertices[wedge]]
    place = points[:, 0] * np.cos(along) + points[:, 1] * np.sin(along)
    order = np.lexsort((begins, np.round(place / MEETING), left, wall))
    first, second = order[:-1], order[1:]
    bare = np.zeros((len(openings), 2))
    joined = (wall[first] == wall[second]) & (left[first] == left[second]) & begins[first] & ~begins[second]
    first, second = first[joined], second[joined]
    lengths = place[second] - place[first]
    bare[wedge[first], face[first]], bare[wedge[second], face[second]] = lengths, lengths
    return bare


def _crossings(walls: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the points (c, 2) where walls (n, 4) cross, away from the ends (e, 2) of all walls."""
    _, (starts, numbers) = lay_wall_grid(walls.reshape(-1, 2), walls)
    if (np.diff(starts).astype(np.int64) ** 2).sum() > len(walls) ** 2:
        # walls share most cells: one cell is enough
        starts, numbers = np.array([0, len(walls)], np.int32), np.arange(len(walls), dtype=np.int32)
    points = np.vstack((ends, *_crossings_in_cells(walls, starts, numbers)))
    # found in several cells, by several pairs, or at an end: with different rounding
    _, first = np.unique(np.round(points / (2 * MEETING)), axis=0, return_index=True)
    return np.asarray(points[first[first >= len(ends)]])


def _crossings_in_cells(walls: FloatArray, starts: IntArray, numbers: IntArray) -> Iterator[FloatArray]:
    """Yield where walls that are listed in one cell cross, (c, 2) m, some several times and some at a time."""
    ends = np.repeat(starts[1:], np.diff(starts)).astype(np.intp)
    after = np.arange(1, len(numbers) + 1)
    for some in _at_once(ends - after):
        first, second = whole_numbers(after[some], ends[some] - 1)
        crossed, crossing = walls[numbers[some[first]]], walls[numbers[second]]
        along = _crossing(crossed, crossing)[:, None]
        yield np.asarray((crossed[:, :2] + along * (crossed[:, 2:] - crossed[:, :2]))[along[:, 0] > 0.0])


def _at_once(counts: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Return the rows of `counts` in parts with about `_AT_ONCE` objects each; `counts` are the objects of each row."""
    return np.split(np.arange(len(counts)), np.flatnonzero(np.diff(np.cumsum(counts) // _AT_ONCE)) + 1)


def _crossing(wall: FloatArray, other: FloatArray) -> FloatArray:
    """Return where walls (p, 4) cross others, as a share of their length; 0 if they do not, or only at an end."""
    e, f, r = wall[:, 2:] - wall[:, :2], other[:, 2:] - other[:, :2], other[:, :2] - wall[:, :2]
    area, share, other_share = _cross(e, f), _cross(r, f), _cross(r, e)
    side = np.where(area < 0.0, -1.0, 1.0)
    area, share, other_share = side * area, side * share, side * other_share
    length, other_length = np.hypot(*e.T), np.hypot(*f.T)
    # nearer to an end, that end is the vertex
    margin, other_margin = 2.0 * MEETING / length * area, 2.0 * MEETING / other_length * area
    crosses = (area > _FLUSH * length * other_length) & (margin < share) & (share < area - margin)
    crosses &= (other_margin < other_share) & (other_share < area - other_margin)
    return np.divide(share, area, out=np.zeros(len(area)), where=crosses)


def _cross(vectors: FloatArray, other: FloatArray) -> FloatArray:
    return np.asarray(vectors[:, 0] * other[:, 1] - vectors[:, 1] * other[:, 0])


def edges_on_walls(edges: Edges, walls: FloatArray) -> Listing:
    """Return, for each wall (n, 4), the edges that lie on it."""
    faces = _faces_at(edges.points, walls)
    wall, edge = np.unique(np.column_stack((faces.walls, faces.vertices)), axis=0).T
    starts = np.searchsorted(wall, np.arange(len(walls) + 1)).astype(np.int32)
    return Listing(starts, np.ascontiguousarray(edge))


def _faces_at(vertices: FloatArray, walls: FloatArray) -> _Faces:
    parts, count = [], 0
    for vertex, wall in _pairs_near(np.arange(len(vertices)), np.arange(len(walls), dtype=np.int32), vertices, walls):
        faces = _list_faces(vertex, wall, vertices, walls)
        count += len(faces[0])
        if count > MOST_FACES:
            raise _overlap(faces[0], vertices)
        parts.append(_first_of_flush(*faces))
    vertex, direction, wall = _first_of_flush(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return _Faces(vertex.astype(np.int32), direction, wall)


def _overlap(crowded: NDArray[np.intp], vertices: FloatArray) -> InputError:
    """Return the error for walls that overlap at these vertices, given once for each face there."""
    x, y = vertices[np.bincount(crowded).argmax()]
    return InputError(
        f"walls: too many overlap, for example at x = {x:g} m, y = {y:g} m: expected at most {MOST_FACES} directions "
        "of walls at ends of walls (about 2000 walls that overlap on one line); replace walls on one line by one wall"
    )


def _first_of_flush(
    vertex: NDArray[np.intp], direction: FloatArray, wall: IntArray
) -> tuple[NDArray[np.intp], FloatArray, IntArray]:
    """Return faces in order of vertex and direction; of flush walls, the first is the face."""
    order = np.lexsort((wall, np.round(direction / _FLUSH), vertex))
    vertex, direction, wall = vertex[order], direction[order], wall[order]
    own = np.ones(len(order), dtype=np.bool_)
    own[1:] = (vertex[1:] != vertex[:-1]) | (direction[1:] - direction[:-1] > _FLUSH)
    return vertex[own], direction[own], wall[own]


def _pairs_near(
    rows: NDArray[np.intp], numbers: IntArray, vertices: FloatArray, walls: FloatArray
) -> Iterator[tuple[NDArray[np.intp], IntArray]]:
    """Yield the vertices in these rows, and the walls with these numbers near each, (k,) each, some at a time.

    All walls near a vertex are yielded together.
    """
    if len(rows) * len(numbers) <= _FEW:
        yield np.repeat(rows, len(numbers)), np.tile(numbers, len(rows))
        return
    cells, listing = lay_wall_grid(vertices[rows], walls[numbers])
    cell_of_vertex = cells_at(cells, vertices[rows])
    near, beside = np.diff(listing.starts)[cell_of_vertex].astype(np.intp), np.bincount(cell_of_vertex)[cell_of_vertex]
    # a cell with many vertices and many walls is divided again, if that makes a difference
    crowded = (near * beside > _FEW) & ((near < len(numbers)) | (beside < len(rows)))
    for cell in np.unique(cell_of_vertex[crowded]):
        inside = listing.numbers[listing.starts[cell] : listing.starts[cell + 1]]
        yield from _pairs_near(rows[cell_of_vertex == cell], numbers[inside], vertices, walls)
    alone = np.flatnonzero(~crowded)
    for part in _at_once(near[alone]):
        some = alone[part]
        first = listing.starts[cell_of_vertex[some]].astype(np.intp)
        row, place = whole_numbers(first, first + near[some] - 1)
        yield rows[some[row]], numbers[listing.numbers[place]]


def _list_faces(
    vertex: NDArray[np.intp], wall: IntArray, vertices: FloatArray, walls: FloatArray
) -> tuple[NDArray[np.intp], FloatArray, IntArray]:
    """Return the faces among pairs of vertex and wall, in any order: vertex, direction (rad) and wall."""
    start, end = walls[wall, :2], walls[wall, 2:]
    along, away = end - start, vertices[vertex] - start
    length = np.hypot(along[:, 0], along[:, 1])
    distance = (away[:, 0] * along[:, 0] + away[:, 1] * along[:, 1]) / length
    aside = (along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]) / length
    is_on = (np.abs(aside) <= MEETING) & (distance >= -MEETING) & (distance <= length + MEETING)
    ahead, back = np.flatnonzero(is_on & (distance < length - MEETING)), np.flatnonzero(is_on & (distance > MEETING))
    rows = np.concatenate((ahead, back))
    forward = np.arctan2(along[rows, 1], along[rows, 0])
    forward[len(ahead) :] += math.pi
    return vertex[rows], np.mod(forward, math.tau), wall[rows]


def _following(vertices: IntArray) -> NDArray[np.intp]:
    """Return, for each face, the next one around its vertex, (f,)."""
    following = np.arange(1, len(vertices) + 1)
    last = np.flatnonzero(np.append(vertices[1:] != vertices[:-1], True)[: len(vertices)])
    # the last face of a vertex is followed by its first one, which is listed after the last of the vertex before
    following[last] = np.append(0, last + 1)[: len(last)]
    return following


def _diffracts(openings: FloatArray) -> NDArray[np.bool_]:
    times = math.pi / openings
    return np.asarray((openings > 1e-6) & (np.abs(times - np.round(times)) > _DIVIDES))


def _edge_name(first: int, second: int, names: tuple[str, ...]) -> str:
    if first == second:
        return f"{names[first]}/"
    lower, upper = sorted((first, second))
    return f"{names[lower]}/{names[upper]}"


def find_edges_by_height(walls: FloatArray, names: tuple[str, ...], spans: FloatArray) -> EdgesByHeight:
    """Return the edges of walls (n, 4) that exist at any height.

    `spans` (s, 2) m are the lower and upper ends of the walls, then those of posts.
    """
    bounds = np.unique(spans[np.isfinite(spans)])
    kinds: dict[tuple[object, ...], tuple[Edges, int]] = {}
    bands: dict[tuple[object, ...], list[int]] = {}
    middles = np.concatenate((bounds[:1] - 1, (bounds[:-1] + bounds[1:]) / 2, bounds[-1:] + 1))
    for band, height in enumerate(middles.tolist()):
        present = np.flatnonzero((spans[: len(walls), 0] < height) & (height < spans[: len(walls), 1]))
        here = find_edges(walls[present], tuple(names[wall] for wall in present.tolist()))
        here = replace(here, faces=present[here.faces].astype(np.int32))
        for row, bare in enumerate(_bare(here).tolist()):
            key = (*here.points[row].tolist(), here.starts[row], here.openings[row], *here.faces[row].tolist(), *bare)
            kinds.setdefault(key, (here, row))
            bands.setdefault(key, []).append(band)
    exist = np.zeros((len(kinds), len(middles)), np.bool_)
    for row, of_edge in enumerate(bands.values()):
        exist[row, of_edge] = True
    return EdgesByHeight(bounds, _joined(list(kinds.values())), exist)


def _joined(rows: list[tuple[Edges, int]]) -> Edges:
    return Edges(
        np.array([edges.points[row] for edges, row in rows]).reshape(-1, 2),
        np.array([edges.starts[row] for edges, row in rows]),
        np.array([edges.openings[row] for edges, row in rows]),
        np.array([edges.faces[row] for edges, row in rows], dtype=np.int32).reshape(-1, 2),
        tuple(edges.names[row] for edges, row in rows),
        np.array([_bare(edges)[row] for edges, row in rows]).reshape(-1, 2),
    )


def _bare(edges: Edges) -> FloatArray:
    return np.full((len(edges), 2), np.inf) if edges.bare is None else edges.bare
