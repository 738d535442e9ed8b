"""Reflectances by angle of incidence and frequency, where the materials of a room have a table of them."""

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Room

_SAME_POINT = 1e-9  # m: in a corner, sound touches both walls at one point


def reflectance_factors(room: Room, paths: Paths, frequencies: FloatArray) -> FloatArray:
    """Return what the gains (n,) of paths are to be multiplied with at each of `frequencies` (m,) Hz, (n, m).

    The gains contain the largest value of each table. An edge has the factor of its louder face, for the angle at which
    this face would reflect the sound into the same direction.
    """
    factors = np.ones((len(paths), len(frequencies)))
    angles, at_edges, faces = _incidence(room, paths), _incidence_at_edges(paths), _louder_faces(room, paths)
    for material, table in room.tables.items():
        if table.largest == 0.0:
            continue
        # row -1, "no surface", selects the appended value
        of_it = np.append(np.array(room.materials) == material, False)
        rows, touches = np.nonzero(of_it[paths.surfaces])
        np.multiply.at(factors, rows, table.at(angles[rows, touches], frequencies) / table.largest)
        bent = np.flatnonzero(of_it[faces])
        factors[bent] *= table.at(at_edges[bent], frequencies) / table.largest
    return factors


def _incidence(room: Room, paths: Paths) -> FloatArray:
    """Return the angle between sound and the perpendicular at each reflection, (n, b) rad; 0 without a reflection."""
    rows, touches = np.nonzero(paths.surfaces >= 0)
    surfaces = paths.surfaces[rows, touches]
    behind_edge = (paths.edges[rows] >= 0) & (touches >= paths.bends[rows])
    at = touches + 1 + behind_edge
    points = paths.points[rows, at]
    leg = points - paths.points[rows, at - 1]
    still = np.hypot(*leg.T) <= _SAME_POINT
    leg[still] = (paths.points[rows, at + 1] - points)[still]
    elevations = np.abs(paths.elevations[rows, behind_edge.astype(np.intp)])
    cosines = np.cos(elevations) * _cosines_in_plan(room, surfaces, points, leg)
    cosines[surfaces >= room.levels.start] = np.sin(elevations)[surfaces >= room.levels.start]
    angles = np.zeros(paths.surfaces.shape)
    angles[rows, touches] = np.arccos(np.clip(cosines, 0.0, 1.0))
    return angles


def _cosines_in_plan(room: Room, surfaces: NDArray[np.int32], points: FloatArray, legs: FloatArray) -> FloatArray:
    """Return the cosine of the angle between each leg and the perpendicular of its surface, in the plan, (k,)."""
    normals = np.ones_like(points)
    flat = surfaces < len(room.walls)
    round_ = ~flat & (surfaces < room.levels.start)
    walls = room.walls[surfaces[flat]]
    normals[flat] = np.column_stack((walls[:, 1] - walls[:, 3], walls[:, 2] - walls[:, 0]))
    normals[round_] = points[round_] - room.posts[surfaces[round_] - len(room.walls), :2]
    sizes = np.hypot(*normals.T) * np.hypot(*legs.T)
    return np.asarray(np.abs((normals * legs).sum(axis=1)) / np.maximum(sizes, 1e-300))


def _incidence_at_edges(paths: Paths) -> FloatArray:
    """Return half the angle by which the edge of each path turns the sound back, (n,) rad; 0 without an edge."""
    rows = np.flatnonzero(paths.edges >= 0)
    at = paths.bends[rows] + 1
    points = paths.points[rows, at]
    come, go = points - paths.points[rows, at - 1], paths.points[rows, at + 1] - points
    sizes = np.maximum(np.hypot(*come.T) * np.hypot(*go.T), 1e-300)
    half = np.arccos(np.clip(-(come * go).sum(axis=1) / sizes, -1.0, 1.0)) / 2
    angles = np.zeros(len(paths))
    angles[rows] = np.arccos(np.cos(half) * np.cos(np.abs(paths.elevations[rows]).max(axis=1, initial=0.0)))
    return angles


def _louder_faces(room: Room, paths: Paths) -> NDArray[np.intp]:
    """Return the face with the larger reflectance of the edge of each path, (n,) numbers of surfaces; -1: no edge."""
    faces = np.full((len(paths), 2), -1, dtype=np.intp)
    upright = (paths.edges >= 0) & (paths.edges < len(room.edges))
    faces[upright] = room.edges.faces[paths.edges[upright]]
    level = paths.edges >= len(room.edges)
    faces[level] = np.column_stack(np.divmod(paths.edges[level] - len(room.edges), max(len(room.names), 1)))
    louder = np.append(room.reflectances, -1.0)[faces].argmax(axis=1)
    return np.asarray(faces[np.arange(len(paths)), louder])
