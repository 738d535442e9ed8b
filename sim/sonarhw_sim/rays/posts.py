"""Paths by posts and past thin ones: chains of up to three reflections, and how strongly a thin post scatters."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.beam import ComplexArray
from sonarhw_sim.compiled import compiled, compiled_part, inlined
from sonarhw_sim.rays.fan import Fan, PathTable, Targets, all_rays, direct_candidates, fan, follow_fan
from sonarhw_sim.rays.passing import Passing
from sonarhw_sim.rays.sequences import PartialPaths, solve_candidates, solved_paths
from sonarhw_sim.room.grid import IntArray, Listing, whole_numbers
from sonarhw_sim.room.room import Room

# How strongly a thin post scatters sound: the exact series of a cylinder, where ray optics is wrong.
#
# Far from the cylinder, the scattered wave is -√(2 / (π k r)) exp(jπ/4) f with f = Σ εₙ Jₙ*(ka) / Hₙ*(ka) cos nθ,
# where Z* = Z′ − j β Z, β = (1 − ρ)/(1 + ρ) is the admittance relative to that of air, and θ is the angle by which the
# sound turns plus π (Morse and Ingard, Theoretical Acoustics, ch. 8). Its phase is that of a wave by way of the
# centre. At distances s and s′ nearer than that, the term n of the series is turned by -n² (1/s + 1/s′) / 2k, from the
# next term of the asymptotic series of the Hankel functions.


THIN = 3.66  # wavelengths of radius: of thinner posts, the wave is computed, and sound passes them
_MOST_SITES = 16  # posts beside one straight part of a path; of more, the least far aside
_TURN = 0.14  # rad: sound that turns less at a post belongs to the path past it
_LEAST_TURNS = 3.0  # times the angle at which sound beside the post touches it
_LARGEST_TURN = 0.5  # rad: sound that turns by twice as much never belongs to the path past the post
_LEAST_TERM = 1e-4  # of a series for sound past a post: under 0.001 dB of the smallest sums, which are about 1
_EQUAL = 1e-7  # m, between the points and lengths of a path and those of its reverse


@lru_cache(maxsize=4096)
def _series(ka: float, reflectance: float) -> ComplexArray:
    """Return the factors εₙ Jₙ*(ka) / Hₙ*(ka) of the series, (n,)."""
    from scipy.special import h2vp, hankel2, jv, jvp  # slow to import, and most rooms have no thin posts

    order = np.arange(math.ceil(ka + 6 * ka ** (1 / 3)) + 8)
    admittance = 1j * (1.0 - reflectance) / (1.0 + reflectance)
    returned = (jvp(order, ka) - admittance * jv(order, ka)) / (h2vp(order, ka) - admittance * hankel2(order, ka))
    return np.asarray(np.where(order == 0, 1.0, 2.0) * returned)


def _table_of_series(ka: FloatArray, reflectances: FloatArray) -> ComplexArray:
    """Return the factors of the series of each cylinder, (p, n), padded with 0."""
    rows = [_series(*pair) for pair in zip(ka.tolist(), reflectances.tolist(), strict=True)]
    table = np.zeros((len(rows), max(map(len, rows), default=0)), np.complex128)
    for row, factors in enumerate(rows):
        table[row, : len(factors)] = factors
    return table


@compiled
def _fill_scattered(series: ComplexArray, rows: NDArray[np.intp], turns: FloatArray, scattered: ComplexArray) -> None:
    """Fill in f far from the cylinders `rows` (n,) of `series`, for sound that turns by so many rad, (n,)."""
    for k in range(rows.shape[0]):
        scattered[k] = _scattered(series[rows[k]], turns[k], 0.0)


@compiled_part
def _scattered(factors: ComplexArray, turn: float, near: float) -> complex:
    """Return Σ εₙ Jₙ*/Hₙ* cos(n θ) exp(-j n² near) for sound that turns by θ, rad."""
    cosine, before, now = math.cos(turn), 1.0, math.cos(turn)
    step = complex(math.cos(near), -math.sin(near))
    twice = step * step
    phase = step
    total: complex = factors[0]
    for n in range(1, factors.shape[0]):
        total += factors[n] * now * phase
        before, now = now, 2.0 * cosine * now - before
        step *= twice
        phase *= step
    return total


def cylinder_factor(ka: FloatArray, incidence: FloatArray, reflectances: FloatArray) -> ComplexArray:
    """Return the amplitude of an echo from a cylinder relative to ray optics, (n,) complex.

    `ka` (n,) is the wave number times the radius, `incidence` (n,) rad that of the ray, `reflectances` (n,), over 0,
    those of the surface. Ray optics gives ρ √(a cos i / (2 r)), by way of the side, which is shorter by 2 a cos i.
    """
    return _relative_to_rays(ka, reflectances, np.arange(len(ka)), incidence)


def _relative_to_rays(
    ka: FloatArray, reflectances: FloatArray, rows: NDArray[np.intp], incidence: FloatArray
) -> ComplexArray:
    """Return `cylinder_factor` for some `rows` (n,) of cylinders (p,), whose series are computed once each."""
    total = np.empty(len(rows), np.complex128)
    _fill_scattered(_table_of_series(ka, reflectances), rows, math.pi - 2 * incidence, total)
    cosine, ka = np.cos(incidence), ka[rows]
    by_rays = np.sqrt(math.pi * ka * cosine) * reflectances[rows] * np.exp(2j * ka * cosine - 0.25j * math.pi)
    return np.asarray(-2 * total / by_rays)


def with_thin_posts(room: Room, paths: PartialPaths, wavelength: float, passed: bool) -> PartialPaths:
    """Return paths by rays with the gain and phase that thin posts give them where they touch one.

    With `passed`, sound that hardly turns there belongs to the path past the post (`past_thin_posts`), and is left out.
    """
    thin = np.flatnonzero(room.posts[:, 2] < THIN * wavelength)
    if not len(thin):
        return paths
    factors = np.ones(len(paths), np.complex128)
    # the row of each surface among the thin posts; surface -1, "none", selects the last
    numbers = np.full(len(room.walls) + len(room.posts) + 1, -1)
    numbers[len(room.walls) + thin] = np.arange(len(thin))
    touched = numbers[paths.surfaces]
    row, touch = np.nonzero(touched >= 0)
    if len(row):
        # the edge of a diffracted path is a point between two reflections
        point = touch + 1 + ((paths.edges[row] >= 0) & (touch >= paths.bends[row]))
        before, contact, after = (paths.points[row, point + step] for step in (-1, 0, 1))
        back, onward = _unit(before - contact), _unit(after - contact)
        incidence = np.arccos(np.clip((back * onward).sum(axis=1), -1.0, 1.0)) / 2
        post, radii = touched[row, touch], room.posts[thin, 2]
        reflectances = room.reflectances[len(room.walls) + thin]
        factor = _relative_to_rays(math.tau / wavelength * radii, reflectances, post, incidence)
        if passed:
            legs = np.hypot(*np.moveaxis(np.diff(paths.points, axis=1), -1, 0))[row]
            first = np.nansum(np.where(np.arange(legs.shape[1]) < point[:, None], legs, 0.0), axis=1)
            _leave_out_passing(factor, math.pi - 2 * incidence, radii[post], first, np.nansum(legs, axis=1) - first)
        np.multiply.at(factors, row, factor)
    paths = replace(paths, gains=paths.gains * np.abs(factors), phases=paths.phases + np.angle(factors))
    return paths if (paths.gains > 0.0).all() else paths.select(np.flatnonzero(paths.gains > 0.0))


def with_thin_touched(room: Room, fan_: Fan, passed_below: float) -> Fan:
    """Return those candidates of a fan that touch a post of a radius under `passed_below` (m)."""
    thin = np.append(room.posts[:, 2] < passed_below, False)
    # surface -1, "none", selects the last
    touched = np.append(np.zeros(len(room.walls), np.bool_), thin)[fan_.touched]
    first = np.zeros(len(touched), np.intp)
    if touched.shape[1]:  # else no ray has met anything
        first = np.where(touched.any(axis=1), touched.argmax(axis=1), touched.shape[1])
    rows = np.flatnonzero(first[fan_.candidates[:, 0]] < fan_.candidates[:, 1])
    return fan_._replace(candidates=np.ascontiguousarray(fan_.candidates[rows]))


@compiled
def _leave_out_passing(
    factors: ComplexArray, turns: FloatArray, radii: FloatArray, before: FloatArray, after: FloatArray
) -> None:
    """Multiply factors (n,) by the share of sound that belongs to no path past the post."""
    for k in range(factors.shape[0]):
        factors[k] *= 1.0 - _passing_share(turns[k], radii[k], before[k], after[k])


@compiled_part
def _passing_share(turn: float, radius: float, before: float, after: float) -> float:
    """Return the share, 0..1, of sound turned by `turn` (rad) at a post that belongs to the path past it.

    `before` and `after` are the lengths to and from the post, m.
    """
    reach = min(max(_TURN, _LEAST_TURNS * radius * (1.0 / before + 1.0 / after)), _LARGEST_TURN)
    beyond = min(max(turn / reach - 1.0, 0.0), 1.0)
    share: float = 1.0 - beyond * beyond * (3.0 - 2.0 * beyond)
    return share


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.hypot(vectors[:, 0], vectors[:, 1])[:, None])


# Sound past thin posts: the path itself, and what the posts beside it or in its way scatter forward, on the way out, on
# the way back, and on both.
#
# A straight part of a path lies between places where it turns or spreads: its ends, an edge, a post that it touches.
# Walls only fold it. A post beside it scatters f √(2 D / (π k s s′)) of its sound towards its end, D = s + s′.


def past_thin_posts(room: Room, paths: PartialPaths, wavelength: float, faintest: float) -> PartialPaths:
    """Return paths with what thin posts beside them, and in their way, take from and add to their sound.

    Paths up to 12 dB louder than `faintest` are left as they are, because they are many.
    """
    thin = np.flatnonzero(room.posts[:, 2] < THIN * wavelength)
    if not len(thin) or not len(paths):
        return paths
    wavenumber = math.tau / wavelength
    reflectances = room.reflectances[len(room.walls) + thin]
    series = _table_of_series(wavenumber * room.posts[thin, 2], reflectances)
    needed = np.flatnonzero((np.abs(series) >= _LEAST_TERM).any(axis=0))[-1] + 1
    series = np.ascontiguousarray(series[:, :needed])
    factors = np.ones(len(paths), np.complex128)
    loud = paths.gains >= _LOUDER * faintest
    columns = paths.lengths, paths.points, paths.surfaces, paths.edges, paths.bends
    _fill_passed(*columns, loud, len(room.walls), thin, room.posts[thin], series, wavenumber, factors)
    return replace(paths, gains=paths.gains * np.abs(factors), phases=paths.phases + np.angle(factors))


@compiled
def _fill_passed(
    lengths: FloatArray,
    points: FloatArray,
    surfaces: IntArray,
    edges: IntArray,
    bends: IntArray,
    loud: NDArray[np.bool_],
    walls: int,
    thin: NDArray[np.intp],
    posts: FloatArray,
    series: ComplexArray,
    wavenumber: float,
    factors: ComplexArray,
) -> None:
    """Fill in the factor (n,) by which thin `posts` (t, 3), rows `thin` of those of the room, change each loud path.

    The paths are in order of length. The reverse of a path has the same factor.
    """
    sites, ways = np.empty((_MOST_SITES, 3)), np.empty((_MOST_SITES + 1, _MOST_SITES), np.complex128)
    for row in range(points.shape[0]):
        if not loud[row]:
            continue
        last = 0
        while last + 1 < points.shape[1] and not math.isnan(points[row, last + 1, 0]):
            last += 1
        reverse = row - 1
        while reverse >= 0 and lengths[row] - lengths[reverse] < _EQUAL:
            if loud[reverse] and _is_reverse(points[row], points[reverse], last):
                break
            reverse -= 1
        if reverse >= 0 and lengths[row] - lengths[reverse] < _EQUAL:
            factors[row] = factors[reverse]
            continue
        begin, from_post = 0, -1
        for point in range(1, last + 1):
            touched = _touched_at(point, last, surfaces[row], edges[row], bends[row])
            if 0 <= touched < walls:
                continue
            to_post = touched - walls
            part = points[row, begin : point + 1]
            count, length = _find_sites(part, from_post, to_post, thin, posts, sites)
            if count > 0:
                _sort_sites(count, sites)
                factors[row] *= _past(count, sites, length, posts, series, wavenumber, ways)
            begin, from_post = point, to_post


@compiled_part
def _is_reverse(points: FloatArray, others: FloatArray, last: int) -> bool:
    """Return whether the points (m, 2) of two paths, up to `last`, are the same ones in reverse order."""
    if last + 1 < others.shape[0] and not math.isnan(others[last + 1, 0]):
        return False
    for k in range(last + 1):
        x, y = points[k, 0] - others[last - k, 0], points[k, 1] - others[last - k, 1]
        if not (abs(x) < _EQUAL and abs(y) < _EQUAL):
            return False
    return True


@inlined
def _touched_at(point: int, last: int, surfaces: IntArray, edge: int, bend: int) -> int:
    """Return the surface that a path touches at a point; -1 at an edge and at the end."""
    if point == last:
        return -1
    if edge < 0:
        return int(surfaces[point - 1])
    if point == bend + 1:
        return -1
    return int(surfaces[point - 1 if point <= bend else point - 2])


@compiled_part
def _find_sites(
    part: FloatArray, from_post: int, to_post: int, thin: NDArray[np.intp], posts: FloatArray, sites: FloatArray
) -> tuple[int, float]:
    """Fill in the thin posts beside a straight part (k, 2) of a path, in order; return their number and its length.

    A site is the row of the post, its distance along the part (m), and to its left as at the begin (m).

    The part begins at `from_post` and ends at `to_post`, if they are not negative.
    """
    legs, whole, count = part.shape[0] - 1, 0.0, 0
    for leg in range(legs):
        whole += math.hypot(part[leg + 1, 0] - part[leg, 0], part[leg + 1, 1] - part[leg, 1])
    before, side = 0.0, 1.0
    for leg in range(legs):
        x, y = part[leg, 0], part[leg, 1]
        dx, dy = part[leg + 1, 0] - x, part[leg + 1, 1] - y
        length = math.hypot(dx, dy)
        if length > 0.0:
            dx, dy = dx / length, dy / length
            for k in range(posts.shape[0]):
                cx, cy = posts[k, 0] - x, posts[k, 1] - y
                ahead, aside = cx * dx + cy * dy, cy * dx - cx * dy
                along = before + ahead
                if ahead <= 0.0 or ahead >= length or abs(aside) >= 2.0 * min(along, whole - along):
                    continue
                if (leg == 0 and thin[k] == from_post) or (leg == legs - 1 and thin[k] == to_post):
                    continue
                turn = math.atan(aside / along) + math.atan(aside / (whole - along))
                share = _passing_share(abs(turn), posts[k, 2], along, whole - along)
                if share > 0.0:
                    count = _enter_site(count, k, along, side * aside, sites)
        before, side = before + length, -side
    return count, whole


@compiled_part
def _enter_site(count: int, post: int, along: float, aside: float, sites: FloatArray) -> int:
    """Enter a site, if there is no room instead of the one farthest aside; return the number of sites."""
    row = count
    if count == sites.shape[0]:
        row = 0
        for k in range(1, count):
            if abs(sites[k, 2]) > abs(sites[row, 2]):
                row = k
        if abs(aside) >= abs(sites[row, 2]):
            return count
    sites[row, 0], sites[row, 1], sites[row, 2] = post, along, aside
    return int(min(count + 1, sites.shape[0]))


@compiled_part
def _sort_sites(count: int, sites: FloatArray) -> None:
    """Sort sites by their distance along the part."""
    for k in range(1, count):
        post, along, aside = sites[k, 0], sites[k, 1], sites[k, 2]
        row = k
        while row > 0 and sites[row - 1, 1] > along:
            sites[row, 0], sites[row, 1], sites[row, 2] = sites[row - 1, 0], sites[row - 1, 1], sites[row - 1, 2]
            row -= 1
        sites[row, 0], sites[row, 1], sites[row, 2] = post, along, aside


@compiled_part
def _past(
    count: int,
    sites: FloatArray,
    length: float,
    posts: FloatArray,
    series: ComplexArray,
    wavenumber: float,
    ways: ComplexArray,
) -> complex:
    """Return the factor of sound past posts at `count` sites, rows of `posts`, on a part of a path `length` m long.

    The sum of all ways from its begin to its end by sites in order. `ways` [site + 1, next site] is the sound of those
    that come to the next site from a site, or from the begin in row 0; the column after the last site is the end.
    """
    total = complex(0.0, 0.0)
    for site in range(count):
        ways[0, site] = _leg(sites[site, 1], sites[site, 2], wavenumber)
        for following in range(site + 1, count + 1):
            along, aside = (sites[following, 1], sites[following, 2]) if following < count else (length, 0.0)
            ahead, across = along - sites[site, 1], aside - sites[site, 2]
            sound = complex(0.0, 0.0)
            if ahead > 0.0:
                for earlier in range(-1, site):
                    before, beside = sites[site, 1], sites[site, 2]
                    if earlier >= 0:
                        before, beside = before - sites[earlier, 1], beside - sites[earlier, 2]
                    if before > 0.0:
                        sound += ways[earlier + 1, site] * _sent_on(
                            before,
                            beside,
                            ahead,
                            across,
                            posts[int(sites[site, 0]), 2],
                            series[int(sites[site, 0])],
                            wavenumber,
                        )
                sound *= _leg(ahead, across, wavenumber)
            if following == count:
                total += sound
            else:
                ways[site + 1, following] = sound
    return 1.0 + total * math.sqrt(length)


@compiled_part
def _leg(ahead: float, across: float, wavenumber: float) -> complex:
    """Return the sound that goes so far, with the phase that it has beyond that of the way straight ahead."""
    distance = math.hypot(ahead, across)
    phase = wavenumber * (distance - ahead)
    return complex(math.cos(phase), -math.sin(phase)) / math.sqrt(distance)


@compiled_part
def _sent_on(
    before: float,
    beside: float,
    ahead: float,
    across: float,
    radius: float,
    factors: ComplexArray,
    wavenumber: float,
) -> complex:
    """Return what a post scatters of sound that came `before` m ahead and `beside` m aside, and goes on like that."""
    turn = abs(math.atan(across / ahead) - math.atan(beside / before))
    to_post, from_post = math.hypot(before, beside), math.hypot(ahead, across)
    share = _passing_share(turn, radius, to_post, from_post)
    if share == 0.0:
        return complex(0.0, 0.0)
    size = -share / math.sqrt(math.pi * wavenumber)
    near = (1.0 / to_post + 1.0 / from_post) / (2.0 * wavenumber)
    # the square root of 2, with the phase of exp(jπ/4)
    return size * complex(1.0, 1.0) * _scattered(factors, turn, near)


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
    passed_below: float  # m, the radius of posts that sound passes
    step: int = 1  # of the rays from places, as in `fan.follow_fan`


@dataclass(frozen=True)
class PostWays(PathTable):
    """Ways over walls, straight to the centres of posts; one row each, in order of `starts` and then of `targets`."""

    starts: IntArray  # (n,): row in the room's posts, or of the place
    targets: IntArray  # (n,): row in the room's posts, or of the edges
    bounces: IntArray  # (n,)
    surfaces: IntArray  # (n, 2): walls, padded with -1

    @staticmethod
    def none() -> "PostWays":
        """Return an empty table."""
        whole = np.empty(0, np.int32)
        return PostWays(np.empty(0), whole, whole, whole, np.empty((0, 2), np.int32))


def ways_to_posts(search: PostSearch, places: FloatArray, others: FloatArray, directions: FloatArray) -> PostWays:
    """Return the ways from `places` (n, 2) to posts, of paths that continue to `others` (n, 2).

    `directions` (d,) are those of evenly spaced rays (rad).
    """
    posts, most = search.room.posts, search.max_bounces - 1
    if most < 0 or len(posts) == 0:
        return PostWays.none()
    radii = posts[:, 2]
    longest = search.max_length + radii - np.hypot(*np.moveaxis(posts[:, :2] - others[:, None], -1, 0))
    below, step = search.passed_below, search.step
    return _ways(search.room, places, posts[:, :2], longest, radii, directions, most, search.passing, below, step)


def ways_from_posts(
    search: PostSearch, sources: FloatArray, ends: FloatArray, edges: NDArray[np.intp]
) -> tuple[PostWays, PostWays]:
    """Return the ways from each post to posts and to `edges` (e,), of paths from `sources` to `ends` (n, 2).

    In a search with heights, only the straight ways.
    """
    room, max_length = search.room, search.max_length
    if search.max_bounces < 1 or len(room.posts) == 0:
        return PostWays.none(), PostWays.none()
    # the rays of a fan with slopes begin at the height of the transducer, which sound at a post need not have
    most = search.max_bounces - 1 if search.passing is None else 0
    count, ways = len(room.posts), _ways_of_room(room, max_length, most, search.passed_below)
    targets, radii = _posts_and_edges(room)
    places = np.unique(np.vstack((sources, ends)), axis=0)
    away = np.hypot(*np.moveaxis(targets - places[:, None], -1, 0)).min(axis=0)
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


# the ways are the same for every place, and scans of one room follow each other, at one range or a few
@lru_cache(maxsize=4)
def _ways_of_room(room: Room, max_length: float, most: int, passed_below: float) -> PostWays:
    """Return the ways of up to `most` walls, up to `max_length` (m), from each post to posts and edges."""
    points, radii = _posts_and_edges(room)
    posts = points[: len(room.posts)]
    longest = np.full((len(posts), len(points)), max_length)
    return _ways(room, posts, points, longest, radii, fan(_RAYS), most, None, passed_below, 1)


def _ways(
    room: Room,
    places: FloatArray,
    points: FloatArray,
    longest: FloatArray,
    radii: FloatArray,
    directions: FloatArray,
    most: int,
    passing: Passing | None,
    passed_below: float,
    step: int,
) -> PostWays:
    """Return the ways of up to `most` walls from `places` (n, 2) to points (t, 2) of `radii` (t,).

    `longest` (n, t) m are those of a way to each.
    """
    # the receiver, the first target of each place, is none of them
    count = 1 + len(points)
    to = np.hstack((places[:, None], np.broadcast_to(points, (len(places), *points.shape))))
    targets = Targets(
        to.reshape(-1, 2),
        np.hstack((np.zeros((len(places), 1)), longest)).ravel(),
        np.tile(np.append(0.0, radii), len(places)),
    )
    near = Fan(np.full((1, MOST_REFLECTIONS - 1), -1, np.int32), direct_candidates(len(places), count))
    if most:
        detectable = all_rays(len(directions), len(places), count)
        near = follow_fan(room, places, directions, targets, most, detectable, passing, None, passed_below, step)
    candidates = near.candidates
    touched = np.where(np.arange(near.touched.shape[1]) < candidates[:, 1:2], near.touched[candidates[:, 0]], -1)
    over_walls = (touched < len(room.walls)).all(axis=1) & (candidates[:, 2] % count > 0)
    candidates, touched = candidates[over_walls], touched[over_walls]
    order = np.argsort(candidates[:, 2], kind="stable")
    candidates, touched = candidates[order], touched[order]
    # a way ends within its post, so an empty grid: nothing blocks; the whole path is checked later
    nothing = Listing(np.zeros_like(room.surfaces.listing.starts), room.surfaces.listing.numbers[:0])
    blocking = room.surfaces._replace(listing=nothing)
    near, targets = near._replace(candidates=candidates), targets._replace(longest=np.full(len(places) * count, np.inf))
    # a ray beside the centre touches this wall, so a path to the side of the post may, too
    real, _, lengths, _ = solve_candidates(places, near, targets, blocking, beyond_ends=np.inf)
    _, bounces, target = candidates[real].T
    surfaces = np.full((len(target), MOST_REFLECTIONS - 1), -1, np.int32)
    surfaces[:, : touched.shape[1]] = touched[real]
    start, row = np.divmod(target, count)
    ways = PostWays(lengths, start.astype(np.int32), (row - 1).astype(np.int32), bounces, surfaces)
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
    places: IntArray  # (n,): row of the place where it begins

    @staticmethod
    def none() -> "Chains":
        """Return an empty table."""
        no, whole = np.empty(0), np.empty(0, np.int32)
        surfaces = np.empty((0, MOST_REFLECTIONS), np.int32)
        return Chains(no, whole, whole, surfaces, no, no, no, no, np.empty(0, np.bool_), whole)


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


def equal_pairs(posts: NDArray[np.integer], others: NDArray[np.integer]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return all pairs of a row of `posts` (n,) and a row of `others` (k,), in order, with equal numbers, (m,) each."""
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
        ways.lengths,
        ways.targets,
        ways.bounces + 1,
        surfaces,
        2 * radii,
        widths,
        openings,
        amplitudes,
        first,
        ways.starts,
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
        before.places,
    )
    # behind a post, sound only gets fainter
    loud = may_be_louder(chains, np.arange(len(chains)), np.zeros(len(chains)), search.faintest)
    return chains.select(np.flatnonzero(loud))


# Every path of up to three reflections with posts among them, also where the rays of a fan pass a thin post.
#
# A fan finds the ways over walls to the centre of each post, and from there to other posts and to edges. Ways that
# follow one another make one sequence of surfaces, which is solved exactly.


def post_paths(
    search: PostSearch, sources: FloatArray, ends: FloatArray, chains: Chains, back: PostWays, longest: float
) -> PartialPaths:
    """Return the paths by posts from `sources` to `ends`, (n, 2) each, up to `longest` (m).

    `chains` are those from `sources`, `back` the ways from `ends` to posts.
    """
    if not len(chains):
        return PartialPaths.none()
    count = len(search.room.posts)
    first, second = equal_pairs(chains.places * count + chains.posts, back.starts * count + back.targets)
    kept = chains.bounces[first] + back.bounces[second] <= search.max_bounces
    kept &= chains.lengths[first] + back.lengths[second] - chains.saved[first] <= longest
    first, second = first[kept], second[kept]
    loud = ~chains.several[first] | may_be_louder(chains, first, back.lengths[second], search.faintest)
    first, second = first[loud], second[loud]
    sequences = joined(chains.surfaces[first], back.surfaces[second][:, ::-1])
    targets = Targets.at(ends, np.full(len(ends), longest))
    return _solved(search, sources, sequences, chains.places[first], targets, np.full(len(ends), -1, np.int32))


def post_paths_to_edges(
    search: PostSearch,
    places: FloatArray,
    chains: Chains,
    to_edges: PostWays,
    edges: NDArray[np.intp],
    longest: FloatArray,
) -> PartialPaths:
    """Return the paths from `places` (n, 2) by posts to `edges` (k,), up to `longest` (n, k) m.

    `chains` are those from `places`, `to_edges` the ways from posts to these edges.
    """
    if not len(chains):
        return PartialPaths.none()
    room = search.room
    first, second = equal_pairs(chains.posts, to_edges.starts)
    edge, onward = to_edges.targets[second], to_edges.lengths[second]
    kept = chains.bounces[first] + to_edges.bounces[second] <= search.max_bounces
    kept &= chains.lengths[first] + onward - chains.saved[first] <= longest[chains.places[first], edge]
    # an edge within the post
    kept &= (onward > room.posts[chains.posts[first], 2]) | (to_edges.bounces[second] > 0)
    first, second, edge = first[kept], second[kept], edge[kept]
    loud = may_be_louder(chains, first, to_edges.lengths[second], search.faintest)
    first, second, edge = first[loud], second[loud], edge[loud]
    sequences = joined(chains.surfaces[first], to_edges.surfaces[second])
    target = chains.places[first] * len(edges) + edge
    targets = Targets.at(np.tile(room.edges.points[edges], (len(places), 1)), longest.ravel())
    return _solved(search, places, sequences, target, targets, np.tile(edges.astype(np.int32), len(places)))


def _solved(
    search: PostSearch,
    sources: FloatArray,
    sequences: IntArray,
    target: IntArray,
    targets: Targets,
    leads_to: IntArray,
) -> PartialPaths:
    """Return the real ones of the paths by `sequences` (k, b) to these rows `target` (k,) of `targets`.

    `leads_to` (t,) is the edge at each target or -1.
    """
    if not len(sequences):
        return PartialPaths.none()
    bounces = (sequences >= 0).sum(axis=1)
    sequences = np.ascontiguousarray(sequences[:, : bounces.max()])
    candidates = np.column_stack((np.arange(len(sequences)), bounces, target)).astype(np.int32)
    return solved_paths(
        search.room, sources, Fan(sequences, candidates), targets, leads_to, search.passing, search.passed_below
    )
