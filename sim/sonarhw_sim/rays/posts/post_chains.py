"""Chains of walls and posts, up to the last post of a path, and an upper bound of their amplitude."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.path_table import PathTable
from sonarhw_sim.rays.posts.post_ways import MOST_REFLECTIONS, PostSearch, PostWays
from sonarhw_sim.room.grid import IntArray, whole_numbers
from sonarhw_sim.room.model import Room

_LOUDER = 4.0  # 12 dB: thin posts throw more sound forward than rays do
_TOUCHING = 1e-6  # m, between two posts


@dataclass(frozen=True)
class Chains(PathTable):
    """Chains from a place to the centre of their last post; one row each. `lengths` are by all centres."""

    posts: IntArray  # (n,): the last one, a row in the room's posts
    bounces: IntArray  # (n,), with the last post
    surfaces: IntArray  # (n, 3), padded with -1
    saved: FloatArray  # (n,), m: by how much the way by the sides of the posts may be shorter
    widths: FloatArray  # (n,), m: least width of the tube at the last post, per radian of departure
    openings: FloatArray  # (n,): least growth of that width per metre behind it
    amplitudes: FloatArray  # (n,): reflectances
    several: NDArray[np.bool_]  # (n,): whether there are several posts

    @staticmethod
    def none() -> "Chains":
        """Return an empty table."""
        no, whole = np.empty(0), np.empty(0, np.int32)
        surfaces = np.empty((0, MOST_REFLECTIONS), np.int32)
        return Chains(no, whole, whole, surfaces, no, no, no, no, np.empty(0, np.bool_))


def chains_of(search: PostSearch, ways: PostWays, between: PostWays) -> Chains:
    """Return all chains that begin with `ways` and go on by ways `between` posts."""
    if not len(ways):
        return Chains.none()
    chains = [_first(search.room, ways)]
    for _ in range(search.max_bounces - 1):
        chains.append(_longer(search, chains[-1], between))
    return Chains.join(chains)


def may_be_louder(chains: Chains, rows: NDArray[np.intp], onward: FloatArray, faintest: float) -> NDArray[np.bool_]:
    """Return whether these rows (m,) of chains, and `onward` (m,) m from the last centre, may be as loud, (m,) bool."""
    # the diameters saved are those of the last post, too
    behind = np.maximum(onward - chains.saved[rows], 0.0)
    widths = chains.widths[rows] + chains.openings[rows] * behind
    bounds = chains.amplitudes[rows] * np.sqrt((chains.lengths[rows] + onward) / widths)
    return np.asarray(bounds * _LOUDER >= faintest)


def equal_pairs(posts: IntArray, others: IntArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return all pairs of a row of `posts` (n,) and a row of `others` (k,), in order, with the same post, (m,) each."""
    first = np.searchsorted(others, posts)
    return whole_numbers(first, np.searchsorted(others, posts, side="right") - 1)


def joined(one: IntArray, other: IntArray) -> IntArray:
    """Return the surfaces of both tables of rows padded with -1, those of `other` behind, (n, b + c)."""
    both = np.hstack((one, other))
    # moves the padding to the end and keeps the order of the surfaces
    return np.take_along_axis(both, np.argsort(both < 0, axis=1, kind="stable"), axis=1).astype(np.int32)


def _first(room: Room, ways: PostWays) -> Chains:
    radii, surface = room.posts[ways.targets, 2], len(room.walls) + ways.targets
    widths = np.maximum(ways.lengths - radii, _TOUCHING)
    surfaces = joined(ways.surfaces, surface[:, None])
    amplitudes = np.append(room.reflectances, 1.0)[surfaces].prod(axis=1)
    openings, one = 1.0 + 2.0 * widths / radii, np.zeros(len(ways), np.bool_)
    return Chains(ways.lengths, ways.targets, ways.bounces + 1, surfaces, 2 * radii, widths, openings, amplitudes, one)


def _longer(search: PostSearch, chains: Chains, between: PostWays) -> Chains:
    room = search.room
    first, way = equal_pairs(chains.posts, between.starts)
    kept = chains.bounces[first] + between.bounces[way] < search.max_bounces
    first, way = first[kept], way[kept]
    before, posts = chains.select(first), between.targets[way]
    radii = room.posts[posts, 2]
    apart = np.maximum(between.lengths[way] - room.posts[before.posts, 2] - radii, _TOUCHING)
    widths = before.widths + before.openings * apart
    touched = joined(between.surfaces[way], (len(room.walls) + posts)[:, None])
    chains = Chains(
        before.lengths + between.lengths[way],
        posts,
        before.bounces + between.bounces[way] + 1,
        joined(before.surfaces, touched)[:, :MOST_REFLECTIONS],
        before.saved + 2 * radii,
        widths,
        before.openings + 2.0 * widths / radii,
        before.amplitudes * np.append(room.reflectances, 1.0)[touched].prod(axis=1),
        np.ones(len(way), np.bool_),
    )
    # behind a post, sound only gets fainter
    loud = may_be_louder(chains, np.arange(len(chains)), np.zeros(len(chains)), search.faintest)
    return chains.select(np.flatnonzero(loud))
