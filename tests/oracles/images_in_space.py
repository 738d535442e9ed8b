"""Independent image sources in space: every sequence of flat faces is tried, each a polygon with corners in space.

Reflections are matrices and everything is a vector in space: nothing is split into a plan and heights.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.room.model import Room

Vectors = NDArray[np.float64]
FAR = 100.0  # m: floors, ceilings and endless walls end here
_CLOSE = 1e-9  # m: rounding


@dataclass(frozen=True)
class Face:
    """A convex flat face."""

    corners: Vectors  # (k, 3), m
    reflectance: float

    @property
    def normal(self) -> Vectors:
        across = np.cross(self.corners[1] - self.corners[0], self.corners[2] - self.corners[1])
        return np.asarray(across / np.linalg.norm(across))

    def margin(self, point: Vectors) -> float:
        """Return how far inside of the outline a point of the plane is, m."""
        after = np.roll(self.corners, -1, axis=0)
        inward = np.cross(self.normal, after - self.corners)
        inward /= np.linalg.norm(inward, axis=1)[:, None]
        return float(((point - self.corners) * inward).sum(axis=1).min())

    def crossing(self, start: Vectors, end: Vectors) -> Vectors | None:
        """Return where the straight line between two points crosses the plane, if it does."""
        one, other = (float((point - self.corners[0]) @ self.normal) for point in (start, end))
        if one * other >= 0:
            return None
        return np.asarray(start + one / (one - other) * (end - start))


def faces_of(room: Room) -> list[Face]:
    """Return walls, floor and ceiling of a room."""
    faces = []
    for wall, span, reflectance in zip(room.walls, room.heights, room.reflectances, strict=False):
        low, high = np.clip(span, -FAR, FAR)
        (x0, y0), (x1, y1) = wall[:2], wall[2:]
        corners = np.array([[x0, y0, low], [x1, y1, low], [x1, y1, high], [x0, y0, high]])
        faces.append(Face(corners, float(reflectance)))
    for level in room.levels:
        corners = np.insert(FAR * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]), 2, 0.0, axis=1)
        faces.append(Face(corners + np.array([0.0, 0.0, room.heights[level, 0]]), float(room.reflectances[level])))
    return faces


def images_in_space(
    faces: list[Face], position: tuple[float, float, float], order: int, longest: float
) -> list[tuple[float, ...]]:
    """Return length (m), gain, and unit vectors of departure and arrival of each path, sorted."""
    home, paths = np.array(position), {}
    for count in range(1, order + 1):
        for sequence in itertools.product(faces, repeat=count):
            if any(one is other for one, other in itertools.pairwise(sequence)):
                continue
            points = _path(faces, home, sequence, longest)
            if points is None:
                continue
            length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
            ways = [points[1] - home, points[-2] - home]
            row = (length, *(float(c) for way in ways for c in way / np.linalg.norm(way)))
            gain = float(np.prod([face.reflectance for face in sequence]))
            # through a corner, two sequences are one path
            paths[tuple(round(value, 6) + 0.0 for value in row)] = (length, gain, *row[1:])
    return sorted(paths.values())


def _path(faces: list[Face], home: Vectors, sequence: tuple[Face, ...], longest: float) -> Vectors | None:
    images = [home]
    for face in reversed(sequence):
        images.append(images[-1] - 2 * float((images[-1] - face.corners[0]) @ face.normal) * face.normal)
    if np.linalg.norm(images[-1] - home) > longest:
        return None
    points = [home]
    for face, image in zip(sequence, reversed(images), strict=False):
        in_plane = abs((points[-1] - face.corners[0]) @ face.normal) < _CLOSE
        touch = points[-1] if in_plane else face.crossing(points[-1], image)
        if touch is None or face.margin(touch) < -_CLOSE:
            return None
        points.append(touch)
    points.append(home)
    for k, (start, end) in enumerate(itertools.pairwise(points)):
        own = sequence[max(k - 1, 0) : k + 1]
        if any(_blocks(face, start, end) for face in faces if not any(face is one for one in own)):
            return None
    return np.array(points)


def _blocks(face: Face, start: Vectors, end: Vectors) -> bool:
    crossing = face.crossing(start, end)
    # an end on the face is in a corner
    return (
        crossing is not None
        and min(np.linalg.norm(crossing - start), np.linalg.norm(crossing - end)) > _CLOSE
        and face.margin(crossing) > _CLOSE
    )
