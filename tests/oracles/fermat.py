"""Reflections off walls and posts by Fermat's principle: the length of a path is stationary. No rays, no images."""

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Points = NDArray[np.float64]
CLEAR = 1e-3  # m: paths that pass an end or a rim more closely are doubtful


def reflected_paths(
    source: Points, end: Points, walls: Points, posts: Points, most: int
) -> Iterator[tuple[tuple[int, ...], Points, bool]]:
    """Yield sequence, points and doubt of each path of up to `most` reflections; surfaces are walls, then posts."""
    surfaces = range(len(walls) + len(posts))
    for count in range(1, most + 1):
        for sequence in itertools.product(surfaces, repeat=count):
            if any(one == other for one, other in itertools.pairwise(sequence)):
                continue
            points = _stationary(source, end, sequence, walls, posts)
            margin = min(_margins(points, sequence, walls, posts))
            if margin > -CLEAR:
                yield sequence, points, margin < CLEAR


def _stationary(source: Points, end: Points, sequence: tuple[int, ...], walls: Points, posts: Points) -> Points:
    def points_at(values: Points) -> Points:
        touched = [_point(surface, value, walls, posts) for surface, value in zip(sequence, values, strict=True)]
        return np.array([source, *touched, end])

    def length(values: Points) -> float:
        return float(np.hypot(*np.diff(points_at(values), axis=0).T).sum())

    toward = (source + end) / 2
    start = [
        0.5 if surface < len(walls) else np.arctan2(*(toward - posts[surface - len(walls), :2])[::-1])
        for surface in sequence
    ]
    # twice: the second search starts with an accurate scale
    values = minimize(length, start, method="Nelder-Mead", options={"xatol": 1e-4, "fatol": 1e-8, "maxiter": 4000}).x
    return points_at(minimize(length, values, method="BFGS", options={"gtol": 1e-9}).x)


def _point(surface: int, value: float, walls: Points, posts: Points) -> Points:
    if surface < len(walls):
        return walls[surface, :2] + value * (walls[surface, 2:] - walls[surface, :2])
    x, y, radius = posts[surface - len(walls)]
    return np.array([x + radius * np.cos(value), y + radius * np.sin(value)])


def _margins(points: Points, sequence: tuple[int, ...], walls: Points, posts: Points) -> Iterator[float]:
    """Yield by how much (m) each condition of a real path holds; negative where it does not."""
    for k, surface in enumerate(sequence):
        before, at, after = points[k : k + 3]
        if surface < len(walls):
            along = walls[surface, 2:] - walls[surface, :2]
            size = np.hypot(*along)
            normal = np.array([-along[1], along[0]]) / size
            position = float((at - walls[surface, :2]) @ along / size)
            yield min(position, size - position)
            yield from (np.sign(normal @ (before - at)) * (normal @ (after - at)),)
        else:
            normal = (at - posts[surface - len(walls), :2]) / posts[surface - len(walls), 2]
            yield from (float(normal @ (side - at)) for side in (before, after))
    ends = [-1, *sequence, -1]
    for k in range(len(points) - 1):
        for surface in set(range(len(walls) + len(posts))) - {ends[k], ends[k + 1]}:
            yield _clearance(points[k], points[k + 1], surface, walls, posts)


def _clearance(start: Points, stop: Points, surface: int, walls: Points, posts: Points) -> float:
    """Return the distance (m) of a leg from a surface; negative if it passes through."""
    if surface >= len(walls):
        x, y, radius = posts[surface - len(walls)]
        return _distance(np.array([x, y]), start, stop) - float(radius)
    one, other = walls[surface, :2], walls[surface, 2:]
    apart = min(
        _distance(one, start, stop),
        _distance(other, start, stop),
        _distance(start, one, other),
        _distance(stop, one, other),
    )
    crosses = (
        _side(one, start, stop) * _side(other, start, stop) < 0 > _side(start, one, other) * _side(stop, one, other)
    )
    return -apart if crosses else apart


def _distance(point: Points, start: Points, stop: Points) -> float:
    share = np.clip((point - start) @ (stop - start) / ((stop - start) @ (stop - start)), 0.0, 1.0)
    return float(np.hypot(*(start + share * (stop - start) - point)))


def _side(point: Points, start: Points, stop: Points) -> float:
    (ax, ay), (bx, by) = stop - start, point - start
    return float(ax * by - ay * bx)
