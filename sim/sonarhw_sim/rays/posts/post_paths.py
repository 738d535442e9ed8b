"""Every path of up to three reflections with posts among them, also where the rays of a fan pass a thin post.

A fan finds the ways over walls to the centre of each post, and from there to other posts and to edges. Ways that follow
one another make one sequence of surfaces, which is solved exactly.
"""

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.candidate_table import Fan
from sonarhw_sim.rays.kernel import Targets
from sonarhw_sim.rays.partial_paths import PartialPaths, solved_paths
from sonarhw_sim.rays.posts.post_chains import Chains, equal_pairs, joined, may_be_louder
from sonarhw_sim.rays.posts.post_ways import PostSearch, PostWays
from sonarhw_sim.room.grid import IntArray


def post_paths(search: PostSearch, source: FloatArray, end: FloatArray, chains: Chains, back: PostWays) -> PartialPaths:
    """Return the paths by posts from `source` (2,) to `end` (2,).

    `chains` are those from `source`, `back` the ways from `end` to posts.
    """
    if not len(chains):
        return PartialPaths.none()
    first, second = equal_pairs(chains.posts, back.targets)
    kept = chains.bounces[first] + back.bounces[second] <= search.max_bounces
    kept &= chains.lengths[first] + back.lengths[second] - chains.saved[first] <= search.max_length
    first, second = first[kept], second[kept]
    loud = ~chains.several[first] | may_be_louder(chains, first, back.lengths[second], search.faintest)
    first, second = first[loud], second[loud]
    sequences = joined(chains.surfaces[first], back.surfaces[second][:, ::-1])
    target, no_edge = np.zeros(len(first), np.int32), np.array([-1], np.int32)
    return _solved(search, source, sequences, target, Targets.at(end[None], np.array([search.max_length])), no_edge)


def post_paths_to_edges(
    search: PostSearch,
    place: FloatArray,
    chains: Chains,
    to_edges: PostWays,
    edges: NDArray[np.intp],
    longest: FloatArray,
) -> PartialPaths:
    """Return the paths from `place` (2,) by posts to `edges` (k,), up to `longest` (k,) m.

    `chains` are those from `place`, `to_edges` the ways from posts to these edges.
    """
    if not len(chains):
        return PartialPaths.none()
    room = search.room
    first, second = equal_pairs(chains.posts, to_edges.starts)
    edge, onward = to_edges.targets[second], to_edges.lengths[second]
    kept = chains.bounces[first] + to_edges.bounces[second] <= search.max_bounces
    kept &= chains.lengths[first] + onward - chains.saved[first] <= longest[edge]
    # an edge within the post
    kept &= (onward > room.posts[chains.posts[first], 2]) | (to_edges.bounces[second] > 0)
    first, second, edge = first[kept], second[kept], edge[kept]
    loud = may_be_louder(chains, first, to_edges.lengths[second], search.faintest)
    first, second, edge = first[loud], second[loud], edge[loud]
    sequences = joined(chains.surfaces[first], to_edges.surfaces[second])
    return _solved(
        search, place, sequences, edge, Targets.at(room.edges.points[edges], longest), edges.astype(np.int32)
    )


def _solved(
    search: PostSearch,
    source: FloatArray,
    sequences: IntArray,
    target: IntArray,
    targets: Targets,
    leads_to: IntArray,
) -> PartialPaths:
    """Return the real ones of the paths by `sequences` (n, b) to these rows `target` (n,) of `targets`.

    `leads_to` (t,) is the edge at each target or -1.
    """
    if not len(sequences):
        return PartialPaths.none()
    bounces = (sequences >= 0).sum(axis=1)
    sequences = np.ascontiguousarray(sequences[:, : bounces.max()])
    candidates = np.column_stack((np.arange(len(sequences)), bounces, target)).astype(np.int32)
    return solved_paths(search.room, source, Fan(sequences, candidates), targets, leads_to, search.passing)
