"""Ways over walls from a place or a post to the centres of posts and to edges, found by a fan of rays."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.rays.candidate_table import Fan, direct_candidates
from sonarhw_sim.rays.detectable import all_rays
from sonarhw_sim.rays.kernel import Targets, fan, follow_fan
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.path_table import PathTable
from sonarhw_sim.rays.sequences import solve_candidates
from sonarhw_sim.room.grid import IntArray, Listing
from sonarhw_sim.room.model import Room

MOST_REFLECTIONS = 3  # of a path by posts
_RAYS = 1440  # from a post, over two walls at most


@dataclass(frozen=True)
class PostSearch:
    """Which paths by posts to search for."""

    room: Room
    max_length: float  # m, of the whole path
    max_bounces: int  # at most MOST_REFLECTIONS
    faintest: float  # gain; fainter paths by several posts, or by posts to edges, may be omitted
    passing: Passing | None  # low surfaces that sound may pass; None: a search in the plan


@dataclass(frozen=True)
class PostWays(PathTable):
    """Ways over walls, straight to the centres of posts; one row each, in order of `starts`."""

    starts: IntArray  # (n,): row in the room's posts; -1: the place
    targets: IntArray  # (n,): row in the room's posts, or of the edges
    bounces: IntArray  # (n,)
    surfaces: IntArray  # (n, 2): walls, padded with -1

    @staticmethod
    def none() -> "PostWays":
        """Return an empty table."""
        whole = np.empty(0, np.int32)
        return PostWays(np.empty(0), whole, whole, whole, np.empty((0, 2), np.int32))


def ways_to_posts(search: PostSearch, place: FloatArray, other: FloatArray, directions: FloatArray) -> PostWays:
    """Return the ways from `place` (2,) to posts, of paths that continue to `other` (2,).

    They are in order of post. `directions` (n,) are those of evenly spaced rays (rad).
    """
    posts, most = search.room.posts, search.max_bounces - 1
    if most < 0 or len(posts) == 0:
        return PostWays.none()
    radii = posts[:, 2]
    longest = search.max_length + radii - np.hypot(*(posts[:, :2] - other).T)
    targets = Targets(posts[:, :2], longest, radii)
    return _ways(search.room, place, -1, targets, directions, most, search.passing)


def ways_from_posts(
    search: PostSearch, source: FloatArray, end: FloatArray, edges: NDArray[np.intp]
) -> tuple[PostWays, PostWays]:
    """Return the ways from each post to posts and to `edges` (e,), of paths from `source` (2,) to `end` (2,).

    In a search with heights, only the straight ways.
    """
    room, max_length = search.room, search.max_length
    if search.max_bounces < 1 or len(room.posts) == 0:
        return PostWays.none(), PostWays.none()
    # the rays of a fan with slopes begin at the height of the transducer, which sound at a post need not have
    most = search.max_bounces - 1 if search.passing is None else 0
    count, ways = len(room.posts), _ways_of_room(room, max_length, most)
    targets, radii = _posts_and_edges(room)
    away = np.minimum(*(np.hypot(*(targets - place).T) for place in (source, end)))
    listed = np.append(np.ones(count, np.bool_), np.isin(np.arange(len(room.edges)), edges))
    short = ways.lengths <= max_length - away[ways.starts] - away[ways.targets] + 2 * (
        radii[ways.starts] + radii[ways.targets]
    )
    ways = ways.select(np.flatnonzero(short & listed[ways.targets]))
    to_edges = ways.select(np.flatnonzero(ways.targets >= count))
    between = ways.select(np.flatnonzero((ways.targets < count) & (ways.bounces < max(most, 1))))
    rows = np.searchsorted(edges, to_edges.targets - count).astype(np.int32)
    return between, replace(to_edges, targets=rows)


def _posts_and_edges(room: Room) -> tuple[FloatArray, FloatArray]:
    """Return the centres of posts, then the edges, (t, 2) m, and their radii, (t,) m; 0 for edges."""
    points = np.vstack((room.posts[:, :2], room.edges.points))
    return points, np.append(room.posts[:, 2], np.zeros(len(room.edges)))


# the ways are the same for every place, and scans of one room follow each other
@lru_cache(maxsize=1)
def _ways_of_room(room: Room, max_length: float, most: int) -> PostWays:
    """Return the ways of up to `most` walls, up to `max_length` (m), from each post to posts and edges."""
    points, radii = _posts_and_edges(room)
    targets, directions = Targets(points, np.full(len(points), max_length), radii), fan(_RAYS)
    return PostWays.join(
        [_ways(room, points[post], post, targets, directions, most, None) for post in range(len(room.posts))]
    )


def _ways(
    room: Room,
    place: FloatArray,
    start: int,
    targets: Targets,
    directions: FloatArray,
    most: int,
    passing: Passing | None,
) -> PostWays:
    """Return the ways of up to `most` walls from `place` (2,), the post `start`, to targets."""
    # the receiver, target 0, is none of them
    targets = Targets(np.vstack((place, targets.points)), *(np.append(0.0, column) for column in targets[1:]))
    count = len(targets.points)
    near = Fan(np.full((1, MOST_REFLECTIONS - 1), -1, np.int32), direct_candidates(count))
    if most:
        near = follow_fan(room, place, directions, targets, most, all_rays(len(directions), count), passing)
    candidates = near.candidates
    touched = np.where(np.arange(near.touched.shape[1]) < candidates[:, 1:2], near.touched[candidates[:, 0]], -1)
    over_walls = (touched < len(room.walls)).all(axis=1) & (candidates[:, 2] > 0)
    candidates, touched = candidates[over_walls], touched[over_walls]
    order = np.argsort(candidates[:, 2], kind="stable")
    candidates, touched = candidates[order], touched[order]
    # a way ends within its post, so an empty grid: nothing blocks; the whole path is checked later
    nothing = Listing(np.zeros_like(room.surfaces.listing.starts), room.surfaces.listing.numbers[:0])
    blocking = room.surfaces._replace(listing=nothing)
    near, targets = near._replace(candidates=candidates), targets._replace(longest=np.full(count, np.inf))
    # a ray beside the centre touches this wall, so a path to the side of the post may, too
    real, _, lengths, _ = solve_candidates(place, near, targets, blocking, beyond_ends=np.inf)
    _, bounces, target = candidates[real].T
    surfaces = np.full((len(target), MOST_REFLECTIONS - 1), -1, np.int32)
    surfaces[:, : touched.shape[1]] = touched[real]
    ways = PostWays(lengths, np.full(len(target), start, np.int32), (target - 1).astype(np.int32), bounces, surfaces)
    # a place above a low post is no way to it, nor is a post to itself
    return ways.select(np.flatnonzero(lengths > 0.0))
