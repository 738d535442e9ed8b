"""Facets: closed chains of walls that approximate a circle, where a post may be meant.

A flat wall returns sound only at normal incidence, so a pillar of many walls is almost silent from most places. A round
one returns sound to all places.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.room.model import Room

_FEWEST = 12  # walls; a chain with fewer may be intended
_ROUND = 1.02  # largest ratio of the distances of corners from the middle


@dataclass(frozen=True)
class Facets:
    """A closed chain of walls that approximates a circle."""

    walls: range  # their numbers
    middle: tuple[float, float]  # m
    radius: float  # m


def facets_of(room: Room) -> tuple[Facets, ...]:
    """Return the circles of walls that are objects in the room: with another object outside, and no place inside."""
    places = np.array([place.position for place in room.places.values()], dtype=np.float64).reshape(-1, 2)
    objects = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2], places))

    def is_object(circle: Facets) -> bool:
        beyond = np.hypot(*(objects - circle.middle).T) > _ROUND * circle.radius
        return bool(beyond.any()) and bool(beyond[len(objects) - len(places) :].all())

    return tuple(circle for circle in _circles(room.walls) if is_object(circle))


def _circles(walls: FloatArray) -> Iterator[Facets]:
    """Yield the closed chains of walls (n, 4) whose corners lie on a circle."""
    continues = (walls[:-1, 2:] == walls[1:, :2]).all(axis=1)
    bounds = [0, *(np.flatnonzero(~continues) + 1).tolist(), len(walls)]
    for first, behind in pairwise(bounds):
        chain = walls[first:behind]
        if len(chain) >= _FEWEST and (chain[-1, 2:] == chain[0, :2]).all():
            middle = chain[:, :2].mean(axis=0)
            away = np.hypot(*(chain[:, :2] - middle).T)
            if _winds_once(chain, middle) and away.max() <= _ROUND * away.min():
                yield Facets(range(first, behind), (float(middle[0]), float(middle[1])), float(away.mean()))


def _winds_once(chain: FloatArray, middle: FloatArray) -> bool:
    """Return whether walls wind around a point once, all in one direction."""
    start, end = chain[:, :2] - middle, chain[:, 2:] - middle
    turns = np.arctan2(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0], (start * end).sum(axis=1))
    one_way = bool((turns > 0).all() or (turns < 0).all())
    return one_way and round(abs(turns.sum()) / math.tau) == 1
