"""Facets: closed chains of walls that draw a circle, where somebody may have meant a post.

Takes a room; hands on its `Facets`. A flat wall sends sound back only to who stands squarely before it, so a pillar of
many is all but silent from most places, where a round one is heard from each.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.room.model import Room

_FEWEST = 12  # walls; what has fewer may be meant as it is
_ROUND = 1.02  # times the least distance from the middle that the farthest corner may have


@dataclass(frozen=True)
class Facets:
    """A closed chain of walls that draws a circle."""

    walls: range  # their numbers
    middle: tuple[float, float]  # m
    radius: float  # m


def facets_of(room: Room) -> tuple[Facets, ...]:
    """The circles of walls that are things in the room, not the room: something stands outside, no place inside."""
    places = np.array([place.position for place in room.places.values()], dtype=np.float64).reshape(-1, 2)
    things = np.vstack((room.walls.reshape(-1, 2), room.posts[:, :2], places))

    def is_thing(circle: Facets) -> bool:
        beyond = np.hypot(*(things - circle.middle).T) > _ROUND * circle.radius
        return bool(beyond.any()) and bool(beyond[len(things) - len(places) :].all())

    return tuple(circle for circle in _circles(room.walls) if is_thing(circle))


def _circles(walls: FloatArray) -> Iterator[Facets]:
    """The closed chains among walls (n, 4) whose corners lie on a circle."""
    goes_on = (walls[:-1, 2:] == walls[1:, :2]).all(axis=1)
    bounds = [0, *(np.flatnonzero(~goes_on) + 1).tolist(), len(walls)]
    for first, behind in pairwise(bounds):
        chain = walls[first:behind]
        if len(chain) >= _FEWEST and (chain[-1, 2:] == chain[0, :2]).all():
            middle = chain[:, :2].mean(axis=0)
            away = np.hypot(*(chain[:, :2] - middle).T)
            if _winds_once(chain, middle) and away.max() <= _ROUND * away.min():
                yield Facets(range(first, behind), (float(middle[0]), float(middle[1])), float(away.mean()))


def _winds_once(chain: FloatArray, middle: FloatArray) -> bool:
    """Whether walls go round a point once, all one way."""
    start, end = chain[:, :2] - middle, chain[:, 2:] - middle
    turns = np.arctan2(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0], (start * end).sum(axis=1))
    one_way = bool((turns > 0).all() or (turns < 0).all())
    return one_way and round(abs(turns.sum()) / math.tau) == 1
