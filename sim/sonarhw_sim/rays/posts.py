"""Paths by posts: every chain of up to three reflections, and how strongly a thin post reflects."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.rays.fan import Fan, PathTable, Targets, all_rays, direct_candidates, fan, follow_fan
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.sequences import PartialPaths, solve_candidates, solved_paths
from sonarhw_sim.room.grid import IntArray, Listing, whole_numbers
from sonarhw_sim.room.room import Room

# How strongly a thin post reflects: the exact series of a cylinder, where ray optics is wrong.


THIN = 0.005  # m: ray optics is good enough for posts from this radius on
_TERMS = 24  # more than enough for ka up to 8, or 86 kHz


def cylinder_factor(ka: FloatArray, incidence: FloatArray, reflectances: FloatArray) -> ComplexArray:
    """Return the amplitude of an echo from a cylinder relative to ray optics, (n,) complex.

    `ka` (n,) is the wave number times the radius, `incidence` (n,) rad that of the ray, `reflectances` (n,), over 0,
    those of the surface. Far from the cylinder, the scattered wave is -√(2 / (π k r)) exp(jπ/4) f with
    f = Σ εₙ Jₙ*(ka) / Hₙ*(ka) cos n(π − 2i), where Z* = Z′ − j β Z and β = (1 − ρ)/(1 + ρ) is the admittance relative
    to that of air (Morse and Ingard, Theoretical Acoustics, ch. 8). Its phase is that of a wave by way of the centre.
    Ray optics gives ρ √(a cos i / (2 r)), by way of the side, which is shorter by 2 a cos i.
    """
    from scipy.special import h2vp, hankel2, jv, jvp  # slow to import, and most rooms have no thin posts

    order = np.arange(_TERMS)[:, None]
    weight = np.where(order == 0, 1.0, 2.0)
    admittance = 1j * (1.0 - reflectances) / (1.0 + reflectances)
    returned = (jvp(order, ka) - admittance * jv(order, ka)) / (h2vp(order, ka) - admittance * hankel2(order, ka))
    total = (weight * returned * np.cos(order * (math.pi - 2 * incidence))).sum(axis=0)
    cosine = np.cos(incidence)
    by_rays = np.sqrt(math.pi * ka * cosine) * reflectances * np.exp(2j * ka * cosine - 0.25j * math.pi)
    return np.asarray(-2 * total / by_rays)


def with_thin_posts(room: Room, paths: PartialPaths, wavelength: float) -> PartialPaths:
    """Return paths by rays with the gain and phase that thin posts give them."""
    if not (room.posts[:, 2] < THIN).any():
        return paths
    factors = np.ones(len(paths), np.complex128)
    # surface -1, "none", selects the last
    radii = np.concatenate((np.full(len(room.walls), np.inf), room.posts[:, 2], [np.inf]))[paths.surfaces]
    row, touch = np.nonzero(radii < THIN)
    if len(row):
        # the edge of a diffracted path is a point between two reflections
        point = touch + 1 + ((paths.edges[row] >= 0) & (touch >= paths.bends[row]))
        before, contact, after = (paths.points[row, point + step] for step in (-1, 0, 1))
        back, onward = _unit(before - contact), _unit(after - contact)
        incidence = np.arccos(np.clip((back * onward).sum(axis=1), -1.0, 1.0)) / 2
        ka = math.tau / wavelength * radii[row, touch]
        np.multiply.at(factors, row, cylinder_factor(ka, incidence, room.reflectances[paths.surfaces[row, touch]]))
    return replace(paths, gains=paths.gains * np.abs(factors), phases=paths.phases + np.angle(factors))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.hypot(vectors[:, 0], vectors[:, 1])[:, None])


# Ways over walls from a place or a post to the centres of posts and to edges, found by a fan of rays.


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


# Chains of walls and posts, up to the last post of a path, and an upper bound of their amplitude.


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


def joined(first: IntArray, other: IntArray) -> IntArray:
    """Return the surfaces of both tables of rows padded with -1, those of `other` behind, (n, b + c)."""
    both = np.hstack((first, other))
    # moves the padding to the end and keeps the order of the surfaces
    return np.take_along_axis(both, np.argsort(both < 0, axis=1, kind="stable"), axis=1).astype(np.int32)


def _first(room: Room, ways: PostWays) -> Chains:
    radii, surface = room.posts[ways.targets, 2], len(room.walls) + ways.targets
    widths = np.maximum(ways.lengths - radii, _TOUCHING)
    surfaces = joined(ways.surfaces, surface[:, None])
    amplitudes = np.append(room.reflectances, 1.0)[surfaces].prod(axis=1)
    openings, first = 1.0 + 2.0 * widths / radii, np.zeros(len(ways), np.bool_)
    return Chains(
        ways.lengths, ways.targets, ways.bounces + 1, surfaces, 2 * radii, widths, openings, amplitudes, first
    )


def _longer(search: PostSearch, chains: Chains, between: PostWays) -> Chains:
    room = search.room
    first, way = equal_pairs(chains.posts, between.starts)
    kept = chains.bounces[first] + between.bounces[way] < search.max_bounces
    first, way = first[kept], way[kept]
    before, posts = chains.select(first), between.targets[way]
    radii = room.posts[posts, 2]
    gaps = np.maximum(between.lengths[way] - room.posts[before.posts, 2] - radii, _TOUCHING)
    widths = before.widths + before.openings * gaps
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


# Every path of up to three reflections with posts among them, also where the rays of a fan pass a thin post.
#
# A fan finds the ways over walls to the centre of each post, and from there to other posts and to edges. Ways that
# follow one another make one sequence of surfaces, which is solved exactly.


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
