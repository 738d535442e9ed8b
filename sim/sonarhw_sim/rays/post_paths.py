"""Every path of up to three reflections with a post among them, also where the rays of a fan pass a thin post.

A fan finds the ways to the centre of each post. Two ways to the same post make one sequence of surfaces, which is
solved exactly. So does a way to a post together with the straight line from there to an edge.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.detectable import all_rays
from sonarhw_sim.rays.kernel import Fan, follow_fan
from sonarhw_sim.rays.partial_paths import PartialPaths, solved_paths, with_direct_paths
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.sequences import solve_candidates
from sonarhw_sim.room.grid import IntArray, Listing, whole_numbers
from sonarhw_sim.room.model import Room

MOST_REFLECTIONS = 3  # a post, and two reflections before or after it


@dataclass(frozen=True)
class PostWays:
    """Ways from a place to the centres of posts, in order of post; one row each."""

    posts: IntArray  # (n,): row in the room's posts
    directions: FloatArray  # (n,), rad: departure
    bounces: IntArray  # (n,)
    surfaces: IntArray  # (n, 2), padded with -1
    lengths: FloatArray  # (n,), m
    courses: FloatArray  # (n, 2): unit vector of the last leg
    shifts: FloatArray  # (n,), m/rad: how far the end moves to the left when the departure turns to the left

    @staticmethod
    def none() -> "PostWays":
        """Return an empty table."""
        no, whole = np.empty(0), np.empty(0, np.int32)
        return PostWays(whole, no, whole, np.empty((0, 0), np.int32), no, np.empty((0, 2)), no)


def post_paths(
    room: Room,
    source: FloatArray,
    end: FloatArray,
    out: PostWays,
    back: PostWays,
    max_length: float,
    max_bounces: int,
    passing: Passing | None,
) -> PartialPaths:
    """Return the paths by posts, up to `max_length` (m), from `source` (2,) to `end` (2,).

    `out` and `back` are the ways to posts from both.
    """
    most = min(max_bounces, MOST_REFLECTIONS)
    first, second = _pairs(out, back)
    bounces = out.bounces[first] + 1 + back.bounces[second]
    # a path is shorter than the two ways to the centre by up to the diameter
    lengths = out.lengths[first] + back.lengths[second] - 2 * room.posts[out.posts[first], 2]
    kept = (bounces <= most) & (lengths <= max_length)
    first, second, bounces = first[kept], second[kept], bounces[kept]
    if not len(first):
        return PartialPaths.none()
    candidates = np.column_stack((np.arange(len(first)), bounces, np.zeros_like(bounces))).astype(np.int32)
    sequences = _sequences(out, first, back.surfaces[second][:, ::-1], len(room.walls))
    longest, no_edge = np.array([max_length]), np.array([-1], np.int32)
    found = Fan(sequences, candidates, _aimed(room, out, first, -back.courses[second]))
    return solved_paths(room, source, found, end[None], longest, no_edge, passing)


def post_paths_to_edges(
    room: Room,
    place: FloatArray,
    ways: PostWays,
    edges: NDArray[np.intp],
    longest: FloatArray,
    max_bounces: int,
    passing: Passing | None,
) -> PartialPaths:
    """Return the paths from `place` (2,) to `edges` (k,), up to `longest` (k,) m, that a post reflects last."""
    way, edge = (column.ravel() for column in np.indices((len(ways.posts), len(edges))))
    posts, points = room.posts[ways.posts[way]], room.edges.points[edges[edge]]
    onward = points - posts[:, :2]
    distances = np.hypot(*onward.T)
    kept = (ways.bounces[way] < min(max_bounces, MOST_REFLECTIONS)) & (distances > posts[:, 2])
    kept &= ways.lengths[way] + distances - 2 * posts[:, 2] <= longest[edge]
    way, edge, onward = way[kept], edge[kept], onward[kept] / distances[kept, None]
    if not len(way):
        return PartialPaths.none()
    candidates = np.column_stack((np.arange(len(way)), ways.bounces[way] + 1, edge)).astype(np.int32)
    sequences = _sequences(ways, way, np.empty((len(way), 0), np.int32), len(room.walls))
    found = Fan(sequences, candidates, _aimed(room, ways, way, onward))
    return solved_paths(room, place, found, room.edges.points[edges], longest, edges.astype(np.int32), passing)


def ways_to_posts(
    room: Room,
    place: FloatArray,
    other: FloatArray,
    directions: FloatArray,
    max_length: float,
    max_bounces: int,
    passing: Passing | None,
) -> PostWays:
    """Return the ways from `place` (2,) to posts, of paths up to `max_length` (m) that continue to `other` (2,).

    `directions` (n,) are those of evenly spaced rays (rad).
    """
    most = min(max_bounces, MOST_REFLECTIONS) - 1
    if most < 0 or len(room.posts) == 0:
        return PostWays.none()
    targets, radii = np.vstack((other, room.posts[:, :2])), np.append(0.0, room.posts[:, 2])
    # the receiver is not a target
    longest = np.append(0.0, max_length + radii[1:] - np.hypot(*(targets[1:] - other).T))
    no_limits = all_rays(len(directions), len(targets))
    found = follow_fan(
        place, directions, room.surfaces, room.reflectances, targets, longest, max(most, 1), no_limits, radii, passing
    )
    candidates = with_direct_paths(found.candidates, len(targets))
    candidates = candidates[(candidates[:, 1] <= most) & (candidates[:, 2] > 0)]
    candidates = candidates[np.argsort(candidates[:, 2], kind="stable")]
    return _solved_ways(room, place, found._replace(candidates=candidates), targets)


def _solved_ways(room: Room, place: FloatArray, fan: Fan, targets: FloatArray) -> PostWays:
    # a way ends within its post, so an empty grid: nothing blocks; the whole path is checked later
    surfaces = room.surfaces
    nothing = Listing(np.zeros_like(surfaces.listing.starts), surfaces.listing.numbers[:0])
    real, points, lengths, divergences = solve_candidates(
        place,
        fan.directions,
        fan.touched,
        fan.candidates,
        targets,
        np.full(len(targets), np.inf),
        surfaces._replace(listing=nothing),
    )
    # a place above a low post is no way to it
    away_from_post = lengths > 0.0
    points, lengths, divergences = points[away_from_post], lengths[away_from_post], divergences[away_from_post]
    ray, bounces, target = fan.candidates[real][away_from_post].T
    row = np.arange(len(ray))
    away, last = points[:, 1] - place, points[row, bounces + 1] - points[row, bounces]
    # every reflection swaps left and right
    shifts = np.where(bounces % 2, -1.0, 1.0) * lengths * divergences
    touched = fan.touched[ray]
    rows = np.where(np.arange(touched.shape[1]) < bounces[:, None], touched, -1).astype(np.int32)
    directions = np.arctan2(away[:, 1], away[:, 0])
    # a way that reflects off a wall at the centre of a post has no last leg
    ahead = last / np.maximum(np.hypot(*last.T), 1e-300)[:, None]
    return PostWays(target - 1, directions, bounces, rows, lengths, ahead, shifts)


def _aimed(room: Room, ways: PostWays, rows: NDArray[np.intp], onward: FloatArray) -> FloatArray:
    """Return directions in which rays meet each post about midway between a way and its course onward (k, 2), rad."""
    to = ways.courses[rows]
    midway = onward - to
    midway /= np.maximum(np.hypot(*midway.T), 1e-12)[:, None]
    left = room.posts[ways.posts[rows], 2] * (to[:, 0] * midway[:, 1] - to[:, 1] * midway[:, 0])
    return np.asarray(ways.directions[rows] + left / ways.shifts[rows])


def _pairs(out: PostWays, back: PostWays) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return all pairs of a row of `out` and a row of `back` with the same post, (k,) each."""
    start = np.searchsorted(back.posts, out.posts)
    return whole_numbers(start, np.searchsorted(back.posts, out.posts, side="right") - 1)


def _sequences(ways: PostWays, rows: NDArray[np.intp], behind: IntArray, walls: int) -> IntArray:
    """Return the surfaces of each way, its post, and those `behind` (k, b), (k, w + 1 + b), padded with -1."""
    whole = np.hstack((ways.surfaces[rows], (walls + ways.posts[rows])[:, None], behind))
    # moves the padding to the end and keeps the order of the surfaces
    return np.take_along_axis(whole, np.argsort(whole < 0, axis=1, kind="stable"), axis=1).astype(np.int32)
