"""Every path of up to three reflections with posts among them, also where the rays of a fan pass a thin post.

A fan finds the ways over walls to the centre of each post, and from there to other posts and to edges. Ways that follow
one another make one sequence of surfaces, which is solved exactly.
"""

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.kernel import Fan
from sonarhw_sim.rays.partial_paths import PartialPaths, solved_paths
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.posts.post_chains import Chains, equal_pairs, joined, may_be_louder
from sonarhw_sim.rays.posts.post_ways import MOST_REFLECTIONS, PostWays
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room


def post_paths(
    room: Room,
    source: FloatArray,
    end: FloatArray,
    chains: Chains,
    back: PostWays,
    max_length: float,
    max_bounces: int,
    faintest: float,
    passing: Passing | None,
) -> PartialPaths:
    """Return the paths by posts, up to `max_length` (m), from `source` (2,) to `end` (2,).

    `chains` are those from `source`, `back` the ways from `end` to posts. Paths by several posts that are fainter than
    `faintest` (gain) may be omitted.
    """
    if not len(chains):
        return PartialPaths.none()
    most = min(max_bounces, MOST_REFLECTIONS)
    first, second = equal_pairs(chains.posts, back.targets)
    kept = chains.bounces[first] + back.bounces[second] <= most
    kept &= chains.lengths[first] + back.lengths[second] - chains.saved[first] <= max_length
    first, second = first[kept], second[kept]
    loud = ~chains.several[first] | may_be_louder(chains, first, back.lengths[second], faintest)
    first, second = first[loud], second[loud]
    sequences = joined(chains.surfaces[first], back.surfaces[second][:, ::-1])
    target, no_edge = np.zeros(len(first), np.int32), np.array([-1], np.int32)
    return _solved(room, source, sequences, end[None], target, np.array([max_length]), no_edge, passing)


def post_paths_to_edges(
    room: Room,
    place: FloatArray,
    chains: Chains,
    to_edges: PostWays,
    edges: NDArray[np.intp],
    longest: FloatArray,
    max_bounces: int,
    faintest: float,
    passing: Passing | None,
) -> PartialPaths:
    """Return the paths from `place` (2,) by posts to `edges` (k,), up to `longest` (k,) m and not fainter.

    `chains` are those from `place`, `to_edges` the ways from posts to these edges.
    """
    if not len(chains):
        return PartialPaths.none()
    first, second = equal_pairs(chains.posts, to_edges.starts)
    edge, onward = to_edges.targets[second], to_edges.lengths[second]
    kept = chains.bounces[first] + to_edges.bounces[second] <= min(max_bounces, MOST_REFLECTIONS)
    kept &= chains.lengths[first] + onward - chains.saved[first] <= longest[edge]
    # an edge within the post
    kept &= (onward > room.posts[chains.posts[first], 2]) | (to_edges.bounces[second] > 0)
    first, second, edge = first[kept], second[kept], edge[kept]
    loud = may_be_louder(chains, first, to_edges.lengths[second], faintest)
    first, second, edge = first[loud], second[loud], edge[loud]
    sequences = joined(chains.surfaces[first], to_edges.surfaces[second])
    points = room.edges.points[edges]
    return _solved(room, place, sequences, points, edge, longest, edges.astype(np.int32), passing)


def _solved(
    room: Room,
    source: FloatArray,
    sequences: IntArray,
    targets: FloatArray,
    target: IntArray,
    longest: FloatArray,
    leads_to: IntArray,
    passing: Passing | None,
) -> PartialPaths:
    """Return the real ones of the paths by `sequences` (n, b) to these rows `target` (n,) of `targets`."""
    if not len(sequences):
        return PartialPaths.none()
    bounces = (sequences >= 0).sum(axis=1)
    sequences = np.ascontiguousarray(sequences[:, : bounces.max()])
    candidates = np.column_stack((np.arange(len(sequences)), bounces, target)).astype(np.int32)
    return solved_paths(room, source, Fan(sequences, candidates), targets, longest, leads_to, passing)
