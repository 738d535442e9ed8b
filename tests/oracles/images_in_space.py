"""Independent image sources in space: every sequence of flat faces is tried, each a polygon with corners in space.

Reflections are matrices and everything is a vector in space: nothing is split into a plan and heights.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from sonarhw_sim.room.room import Room

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
    """Return walls, floor, ceiling and lids of a room; lids must be convex polygons."""
    faces = []
    for wall, span, reflectance in zip(room.walls, room.heights, room.reflectances, strict=False):
        low, high = np.clip(span, -FAR, FAR)
        (x0, y0), (x1, y1) = wall[:2], wall[2:]
        corners = np.array([[x0, y0, low], [x1, y1, low], [x1, y1, high], [x0, y0, high]])
        faces.append(Face(corners, float(reflectance)))
    for level in room.levels:
        lid = room.lid(level)
        if lid is not None:
            corners = np.insert(lid.corners, 2, lid.height, axis=1)
            faces.append(Face(corners, float(room.reflectances[level])))
            continue
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
            if np.linalg.norm(_images(home, sequence)[-1] - home) > longest:
                continue
            points = _path(faces, home, sequence, home)
            if points is None:
                continue
            length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
            ways = [points[1] - home, points[-2] - home]
            row = (length, *(float(c) for way in ways for c in way / np.linalg.norm(way)))
            gain = float(np.prod([face.reflectance for face in sequence]))
            # through a corner, two sequences are one path
            paths[tuple(round(value, 6) + 0.0 for value in row)] = (length, gain, *row[1:])
    return sorted(paths.values())


def bent_in_space(
    faces: list[Face], rim: Vectors, position: tuple[float, float, float], order: int, longest: float
) -> list[tuple[float, ...]]:
    """Return length (m) and unit vectors of departure and arrival of each path bent once by a straight rim (2, 3).

    The point of the rim is found by minimising the length.
    """
    home, paths = np.array(position), []
    sequences = [
        sequence
        for count in range(order + 1)
        for sequence in itertools.product(faces, repeat=count)
        if not any(one is other for one, other in itertools.pairwise(sequence))
    ]
    for there, back in itertools.product(sequences, repeat=2):
        if len(there) + len(back) > order:
            continue
        images = [_images(home, sequence)[-1] for sequence in (there[::-1], back[::-1])]

        def length(share: float, images: list[Vectors] = images) -> float:
            at = rim[0] + share * (rim[1] - rim[0])
            return float(sum(np.linalg.norm(image - at) for image in images))

        best = minimize_scalar(length, bounds=(-1.0, 2.0), method="bounded", options={"xatol": 1e-10})
        if not 0.0 <= best.x <= 1.0 or best.fun > longest:
            continue
        at = rim[0] + best.x * (rim[1] - rim[0])
        out, home_way = _path(faces, home, there, at), _path(faces, home, back, at)
        if out is not None and home_way is not None:
            ways = [points[1] - home for points in (out, home_way)]
            paths.append((float(best.fun), *(float(c) for way in ways for c in way / np.linalg.norm(way))))
    return sorted(paths)


def _images(target: Vectors, sequence: tuple[Face, ...]) -> list[Vectors]:
    """Return a point, and its images in the last face, in the last two, and so on."""
    images = [target]
    for face in reversed(sequence):
        images.append(images[-1] - 2 * float((images[-1] - face.corners[0]) @ face.normal) * face.normal)
    return images


def _path(faces: list[Face], home: Vectors, sequence: tuple[Face, ...], target: Vectors) -> Vectors | None:
    """Return the points of the way from `home` by these faces to a target, if nothing blocks it."""
    images, points = _images(target, sequence), [home]
    for face, image in zip(sequence, reversed(images), strict=False):
        in_plane = abs((points[-1] - face.corners[0]) @ face.normal) < _CLOSE
        touch = points[-1] if in_plane else face.crossing(points[-1], image)
        if touch is None or face.margin(touch) < -_CLOSE:
            return None
        points.append(touch)
    points.append(target)
    for (k, one), (j, other) in itertools.combinations(enumerate(sequence), 2):
        # at one point, sound touches two faces only in an inner corner
        if max(np.linalg.norm(point - points[k + 1]) for point in points[k + 2 : j + 2]) >= _CLOSE:
            continue
        before = next(point for point in points[k::-1] if np.linalg.norm(point - points[k + 1]) >= _CLOSE)
        if not (_faces_towards(one, other, before) and _faces_towards(other, one, before)):
            return None
    for k, (start, end) in enumerate(itertools.pairwise(points)):
        own = sequence[max(k - 1, 0) : k + 1]
        if any(_blocks(face, start, end) for face in faces if not any(face is one for one in own)):
            return None
    return np.array(points)


def _faces_towards(face: Face, other: Face, point: Vectors) -> bool:
    """Return whether a part of another face is on the same side as a point."""
    side = float((point - face.corners[0]) @ face.normal)
    return bool((((other.corners - face.corners[0]) @ face.normal) * side > _CLOSE).any())


def _blocks(face: Face, start: Vectors, end: Vectors) -> bool:
    crossing = face.crossing(start, end)
    # an end on the face is in a corner
    return (
        crossing is not None
        and min(math.dist(crossing, start), math.dist(crossing, end)) > _CLOSE
        and face.margin(crossing) > _CLOSE
    )
