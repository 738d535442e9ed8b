"""All paths of sound from a place back to it, or to a separate receiver, and scattering by rough surfaces."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.rays.clusters import bounded, by_clusters, numbered, past_clusters
from sonarhw_sim.rays.diffraction import EdgeDiffraction, diffracted_paths
from sonarhw_sim.rays.fan import PathTable, Targets, TransducerAxes, all_rays, fan, first_hit, follow_fan
from sonarhw_sim.rays.passing import Passing, at_heights
from sonarhw_sim.rays.posts import (
    MOST_REFLECTIONS,
    THIN,
    Chains,
    PostSearch,
    PostWays,
    chains_of,
    past_thin_posts,
    post_paths,
    post_paths_to_edges,
    ways_from_posts,
    ways_to_posts,
    with_thin_posts,
    with_thin_touched,
)
from sonarhw_sim.rays.sequences import (
    PartialPaths,
    first_of_equal,
    last_points,
    leg_is_free,
    missing_reverses,
    sequences_once,
    shortest_first,
    solved_paths,
)
from sonarhw_sim.rays.shadows import with_shadows
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.small_things import Followed, followed, near_clusters

# All paths of sound from a place back to it, or to a separate receiver.
#
# Paths do not depend on the heading of the transducer, so one search serves a whole scan.


# 1/16° apart finds 99.3 % of all paths up to 21.4 m in the simple room, where 0.25° finds 94 %
RAYS = 5760
MAX_BOUNCES = 64
_AMPLITUDES = 33  # steps from 0 to 1
_LOUDEST_EDGE = 2.0  # amplitude: more than the uniform theory gives of any edge
_MOST_FOLLOWED = 16  # thin posts that rays meet; of more, the paths would be too many
SLACK = 1e-9  # m: a path longer than the limit by rounding only is kept


@dataclass(frozen=True)
class PathSearch:
    """Which paths to search for."""

    max_length: float  # m, there and back
    wavelength: float  # m; edges diffract by it
    max_bounces: int = MAX_BOUNCES
    diffraction: bool = True
    rays: int = RAYS
    edge_strength: EdgeStrength = EdgeStrength.UNIFORM
    faintest_diffraction: float = 1e-3  # gain; fainter diffracted paths are omitted, because their number is infinite
    axes: TransducerAxes | None = None  # where sender and receiver point, to list only paths that they can detect
    ka: float | None = None  # of a transducer at any heading, to list only diffracted paths that it can detect
    shadows: bool = True  # whether sound bends past obstacles on the way out and back, and past thin posts
    step: int = 1  # every so many rays are followed, and the others where two of these meet different surfaces
    leaving: FloatArray | None = None  # (n, rays): the most amplitude of rays of each place at departure; None: 1
    until: float = math.inf  # m: only the paths up to this length are listed, as in a search without this limit
    small: bool = True  # whether small walls are one thing, in the plan: joined on a line, and solved by the wave

    @property
    def solves(self) -> bool:
        """Whether clusters of small walls are solved by the wave."""
        return self.small and self.diffraction and self.edge_strength is EdgeStrength.UNIFORM

    @property
    def directions(self) -> FloatArray:
        """Those of the rays, (n,) rad: all round, or in front of the sender."""
        one = self.axes is not None and len(self.axes.leaving) == 1
        return fan(self.rays, float(self.axes.leaving[0]) if self.axes is not None and one else None)

    @property
    def listed(self) -> float:
        """The greatest length of a path, m."""
        return min(self.max_length, self.until) + SLACK

    @property
    def reversed(self) -> "PathSearch":
        """The search for reversed paths."""
        return self if self.axes is None else replace(self, axes=self.axes.reversed)

    @property
    def edge_diffraction(self) -> EdgeDiffraction:
        """The part of the search that concerns edges."""
        ka = None if self.axes else self.ka
        return EdgeDiffraction(self.wavelength, self.faintest_diffraction, self.edge_strength, ka)

    @property
    def loudest_by_elevation(self) -> FloatArray:
        """The most that both beams leave at any heading, for elevations from 0 to π/2.

        No heading is nearer to a direction than its elevation.
        """
        return np.ones(1) if self.ka is None or self.axes is not None else _loudest_by_elevation(self.ka)

    @property
    def steepest_bent(self) -> FloatArray:
        """The slopes in space beyond which no sound past an upright edge is loud enough, (33,); inf: none.

        For sound of amplitudes from 0 to 1 before the edge.
        """
        table = self.loudest_by_elevation
        least = self.faintest_diffraction / (_LOUDEST_EDGE * np.maximum(np.linspace(0, 1, _AMPLITUDES), 1e-300))
        loud = np.searchsorted(-table, -least, side="right")
        # the last value of the table is that of upright sound only
        slopes = np.tan(math.pi / 2 * np.minimum(loud, len(table) - 1) / max(len(table) - 1, 1))
        return np.where(loud < len(table) - 1, slopes, math.inf)


@lru_cache(maxsize=16)
def _loudest_by_elevation(ka: float) -> FloatArray:
    """Return `PathSearch.loudest_by_elevation` of transducers with this ka, (901,)."""
    angles = np.linspace(0, math.pi / 2, 901)
    loudest = np.maximum.accumulate(beam_gain(angles, ka)[::-1])[::-1] ** 2
    loudest.flags.writeable = False
    return np.asarray(loudest)


@dataclass(frozen=True)
class Paths(PathTable):
    """Paths from a source to a receiver, usually the same transducer, shortest first; one row each."""

    departures: FloatArray  # (n,), rad in -π..π
    arrivals: FloatArray  # (n,), rad: direction from which the sound arrives
    gains: FloatArray  # (n,): reflectances, edge factor and curvature; no directivity, spreading, absorption
    phases: FloatArray  # (n,), rad, beyond that of the length: of uniform edges; NaN: random, the sound adds by power
    spreads: FloatArray  # (n,), m: by how much the ways over a patch of a rough surface differ; 0 for other paths
    surfaces: IntArray  # (n, b): reflecting surfaces, in order, padded with -1
    edges: IntArray  # (n,): diffracting edge, a row of the room's edges; -1: none
    bends: IntArray  # (n,): number of reflections before that edge; without an edge, of all
    elevations: FloatArray  # (n, 2), rad: elevation of departure and of arrival
    points: FloatArray  # (n, b + 3, 2), m: source, reflections and edge in order of travel, receiver, then NaN

    @cached_property
    def bounces(self) -> IntArray:
        """Number of reflections of each path, (n,) int."""
        return np.asarray((self.surfaces >= 0).sum(axis=1), dtype=np.int32)

    @cached_property
    def scattered(self) -> NDArray[np.bool_]:
        """Which paths are patches of rough surfaces, (n,) bool: their sound adds by power."""
        return np.isnan(self.phases)

    @cached_property
    def leaving(self) -> FloatArray:
        """Horizontal part of the unit vector along which each path departs, (n, 2) float."""
        return _horizontal(self.departures, self.elevations[:, 0])

    @cached_property
    def arriving(self) -> FloatArray:
        """Horizontal part of the unit vector from which each path arrives, (n, 2) float."""
        return _horizontal(self.arrivals, self.elevations[:, 1])

    def via(self, path: int, room: Room) -> tuple[str, ...]:
        """Return the names of surfaces and edge of a path, in order; an edge has the names of its two walls."""
        touched = tuple(room.names[surface] for surface in self.surfaces[path] if surface >= 0)
        edge, bend = int(self.edges[path]), int(self.bends[path])
        return touched if edge < 0 else (*touched[:bend], room.edge_name(edge), *touched[bend:])

    @property
    def known(self) -> "Paths":
        """The paths that are known without a search: all, or the first ones."""
        return self

    def outline(self, path: int) -> FloatArray:
        """Return the points of a path from source to receiver, (k, 2) float, m."""
        points = self.points[path]
        return np.asarray(points[~np.isnan(points[:, 0])])


def _horizontal(directions: FloatArray, elevations: FloatArray) -> FloatArray:
    vectors = np.column_stack((np.cos(directions), np.sin(directions)))
    # in the plan, every elevation is 0
    return np.asarray(vectors * np.cos(elevations)[:, None]) if elevations.any() else vectors


def find_paths(
    room: Room,
    position: tuple[float, float],
    search: PathSearch,
    receiver: tuple[float, float] | None = None,
    passing: Passing | None = None,
) -> Paths:
    """Return every path of `search` from `position` back to it, or to `receiver`, shortest first.

    Sound may pass the low surfaces of `passing` as well as touch them; then paths that differ only by the surfaces that
    they touch at one point are all listed. There are no paths to or from the inside of a post that sound cannot pass.
    """
    sources = np.array([position], dtype=np.float64)
    ends = sources if receiver is None else np.array([receiver], dtype=np.float64)
    return _paths_of(_paths_between(room, sources, search, ends, passing))


def find_paths_of_places(
    room: Room, positions: FloatArray, search: PathSearch, receivers: FloatArray | None = None
) -> tuple[Paths, NDArray[np.intp]]:
    """Return the paths of `find_paths` from each position (n, 2) m, one place after the other, and where they begin.

    The paths of place k are the rows from `begins[k]` up to `begins[k + 1]`, (n + 1,). `search.axes` are those of each
    place. Raises InputError if the paths of all places need too much memory.
    """
    partial = _paths_between(room, positions, search, positions if receivers is None else receivers, None)
    begins = np.searchsorted(partial.places, np.arange(len(positions) + 1))
    return _paths_of(partial), begins


def paths_of_few_rays(room: Room, position: tuple[float, float], search: PathSearch) -> Paths:
    """Return the paths by walls and posts that the rays of a search in the plan find, from `position` back to it."""
    sources, leads_to = np.array([position], dtype=np.float64), np.array([-1], np.int32)
    targets, below = Targets.at(sources, np.array([search.listed])), THIN * search.wavelength
    detectable = all_rays(search.rays, 1, 1)
    rays = follow_fan(room, sources, search.directions, targets, search.max_bounces, detectable, passed_below=below)
    return _paths_of(shortest_first(solved_paths(room, sources, rays, targets, leads_to, None, below)))


def _paths_between(
    room: Room, sources: FloatArray, search: PathSearch, ends: FloatArray, passing: Passing | None
) -> PartialPaths:
    """Return the paths from each of `sources` to the one of `ends` in the same row, (n, 2) each, in order of place.

    With `passing` there is one source. The receivers are the senders if `ends` is `sources`.
    """
    if not search.small or passing is not None:
        return _by_rays(room, sources, search, ends, passing)
    near = np.zeros(len(sources), np.bool_)
    if search.solves:
        near = near_clusters(room, search.wavelength, sources)
        if ends is not sources:
            near |= near_clusters(room, search.wavelength, ends)
    groups = [
        _of_rows(np.flatnonzero(near == beside), sources, search, ends, partial(_with_clusters, room, beside))
        for beside in (False, True)
        if (near == beside).any()
    ]
    if len(groups) == 1:
        return groups[0]
    paths = PartialPaths.join(groups)
    return paths.select(np.argsort(paths.places, kind="stable"))


def _with_clusters(room: Room, near: bool, sources: FloatArray, search: PathSearch, ends: FloatArray) -> PartialPaths:
    """Return the paths of `_paths_between` of places `near` clusters of small walls, or not."""
    small = followed(room, search.wavelength, search.solves, near)
    if small is None:
        return _by_rays(room, sources, search, ends, None)
    paths = numbered(_by_rays(small.room, sources, search, ends, None, small.faces), small, room)
    if small.clusters:
        paths = past_clusters(paths, small, room)
        paths = shortest_first(PartialPaths.join([paths, _paths_by_clusters(room, small, sources, search, ends)]))
    return bounded(paths, small, room, search.wavelength) if small.guessed else paths


def _paths_by_clusters(
    room: Room, small: Followed, sources: FloatArray, search: PathSearch, ends: FloatArray
) -> PartialPaths:
    """Return the paths by clusters of small walls, as `_paths_between`."""
    bare, longest, bounces = small.bare, search.max_length + SLACK, search.max_bounces
    edges = np.arange(len(bare.edges))
    passed_below = THIN * search.wavelength if search.shadows else 0.0
    posts = PostSearch(
        bare, longest, min(bounces, MOST_REFLECTIONS), search.faintest_diffraction, None, passed_below, search.step
    )

    def ways(places: FloatArray, others: FloatArray, half: PathSearch) -> PartialPaths:
        to_posts = ways_to_posts(posts, places, others, half.directions)
        between, from_posts = ways_from_posts(posts, places, others, edges)
        by_posts = chains_of(posts, to_posts, between), from_posts
        to_centres = np.clip(longest - np.hypot(*np.moveaxis(bare.edges.points - others[:, None], -1, 0)), 0.0, None)
        return _partial_paths_from(half, posts, places, others, edges, to_centres, 0.0, by_posts)

    out = ways(sources, ends, search)
    back = out if ends is sources else ways(ends, sources, search.reversed)
    return by_clusters(out, back, small, room, search.edge_diffraction, (search.listed, bounces))


def _by_rays(
    room: Room,
    sources: FloatArray,
    search: PathSearch,
    ends: FloatArray,
    passing: Passing | None,
    faces: FloatArray | None = None,
) -> PartialPaths:
    """Return the paths of `_paths_between` by rays. `faces` (e, 2) are reflectances at edges; None: of the walls."""
    both_ways = ends is sources
    outside = ~(_inside_post(room, sources, passing) | _inside_post(room, ends, passing))
    if not outside.all():
        by_rays = partial(_by_rays, room, passing=passing, faces=faces)
        return _of_rows(np.flatnonzero(outside), sources, search, ends, by_rays)
    diffracting = _diffracting_edges(room, sources, ends, search)
    edges = np.flatnonzero(diffracting.any(axis=0))
    to_edges = np.where(diffracting, _longest_partial(room, ends, search), -math.inf)[:, edges]
    longest, bounces = search.max_length + SLACK, search.max_bounces
    most, shadows = min(bounces, MOST_REFLECTIONS), search.shadows and passing is None
    passed_below = THIN * search.wavelength if shadows else 0.0
    posts = PostSearch(room, longest, most, search.faintest_diffraction, passing, passed_below, search.step)
    out_ways = ways_to_posts(posts, sources, ends, search.directions)
    between, edge_ways = ways_from_posts(posts, sources, ends, edges)
    chains = chains_of(posts, out_ways, between)
    out = _partial_paths_from(search, posts, sources, ends, edges, to_edges, longest, (chains, edge_ways))
    back, back_ways = out, out_ways
    if not both_ways:
        back_ways = ways_to_posts(posts, ends, sources, search.reversed.directions)
    # paths back are only used at edges
    if not both_ways and len(edges):
        by_posts = chains_of(posts, back_ways, between), edge_ways
        to_edges = np.where(diffracting, _longest_partial(room, sources, search), -math.inf)[:, edges]
        back = _partial_paths_from(search.reversed, posts, ends, sources, edges, to_edges, 0.0, by_posts)
    faces = room.reflectances[room.edges.faces] if faces is None else faces
    diffracted = diffracted_paths(room, out, back, search.edge_diffraction, search.listed, bounces, faces)
    straight = out.select(np.flatnonzero(out.edges < 0)) if len(edges) else out
    del out, back  # a small room with posts has a million points
    if passing is not None:
        columns = diffracted.points, diffracted.surfaces, diffracted.bends, diffracted.lengths
        diffracted = diffracted.select(np.flatnonzero(at_heights(*columns, passing.to_receiver)))
    touching = post_paths(posts, sources, ends, chains, back_ways, search.listed)
    reflected = PartialPaths.join([straight, with_thin_posts(room, touching, search.wavelength, shadows)])
    if passing is not None:
        return sequences_once(PartialPaths.join([reflected, diffracted]), both_ways)
    if shadows and search.diffraction and search.edge_strength is EdgeStrength.UNIFORM:
        limits = search.wavelength, search.faintest_diffraction
        reflected = with_shadows(room, reflected, sources, ends, search.listed, bounces, limits)
    # rays leave gaps, which are seldom the same for a path and its reverse
    reverses = missing_reverses(reflected) if both_ways else PartialPaths.none()
    parts = [reflected, reverses, diffracted]
    del straight, touching, reflected, reverses, diffracted
    paths = PartialPaths.join(parts)
    parts.clear()
    paths = shortest_first(paths)
    return past_thin_posts(room, paths, search.wavelength, search.faintest_diffraction) if shadows else paths


def _of_rows(
    rows: NDArray[np.intp],
    sources: FloatArray,
    search: PathSearch,
    ends: FloatArray,
    between: Callable[[FloatArray, PathSearch, FloatArray], PartialPaths],
) -> PartialPaths:
    """Return the paths `between` these rows of the places only."""
    if not len(rows):
        return PartialPaths.none()
    if len(rows) == len(sources):
        return between(sources, search, ends)
    chosen = sources[rows]
    some = search if search.axes is None else replace(search, axes=search.axes.select(rows))
    some = some if some.leaving is None else replace(some, leaving=some.leaving[rows])
    paths = between(chosen, some, chosen if ends is sources else ends[rows])
    return replace(paths, places=rows.astype(np.int32)[paths.places])


def _partial_paths_from(
    search: PathSearch,
    posts: PostSearch,
    places: FloatArray,
    others: FloatArray,
    edges: NDArray[np.intp],
    to_edges: FloatArray,
    to_other: float,
    by_posts: tuple[Chains, PostWays],
) -> PartialPaths:
    """Return the paths from `places` (n, 2) to these edges (e,) and, up to `to_other` (m), to the other ends (n, 2).

    `to_edges` (n, e) m are the longest ones to each edge. `by_posts` are the chains from `places` to posts and the ways
    from posts to these edges.
    """
    room, axes, directions = posts.room, search.axes, search.directions
    count, each = len(places), 1 + len(edges)
    points = np.empty((count, each, 2))
    points[:, 0], points[:, 1:] = others, room.edges.points[edges]
    longest = np.hstack((np.full((count, 1), to_other), to_edges))
    targets = Targets.at(points.reshape(-1, 2), longest.ravel())
    if axes is None:
        detectable = all_rays(len(directions), count, each, search.faintest_diffraction, search.leaving)
    else:
        distances, onward = (np.hypot(*(points[:, 1:] - end[:, None]).reshape(-1, 2).T) for end in (places, others))
        gains = search.edge_diffraction.loudest(distances, onward).reshape(count, -1)
        detectable = axes.detectable(directions, np.hstack((np.ones((count, 1)), gains)).ravel())
    bounces, passing = search.max_bounces, posts.passing
    steepest, leads_to = search.steepest_bent, np.tile(np.append(-1, edges).astype(np.int32), count)
    below = posts.passed_below
    step = search.step
    # Fans are those of the whole search, without the ends of their rays. Where a ray meets a post, its way on may be
    # longer than that of the path which it finds. The way on from an edge is `straight`.
    until = search.listed + 2 * float(room.posts[:, 2].max(initial=0.0))
    straight = np.hypot(*np.moveaxis(points - others[:, None], -1, 0))
    near = targets._replace(longest=np.minimum(targets.longest, (search.listed - straight).ravel()))
    fans = [follow_fan(room, places, directions, targets, bounces, detectable, passing, steepest, below, step, until)]
    if 0 < (room.posts[:, 2] < below).sum() <= _MOST_FOLLOWED:
        # rays pass thin posts: others meet them, and find paths by them with more reflections than those of chains
        meeting = follow_fan(room, places, directions, targets, bounces, detectable, step=step, until=until)
        fans.append(with_thin_touched(room, meeting, below))
    partial = PartialPaths.join([solved_paths(room, places, fan_, near, leads_to, passing, below) for fan_ in fans])
    touching = post_paths_to_edges(posts, places, *by_posts, edges, near.longest.reshape(count, each)[:, 1:])
    if len(touching):
        partial = PartialPaths.join([partial, _new(touching, partial)])
    partial = with_thin_posts(room, partial, search.wavelength, posts.passed_below > 0.0)
    return partial if axes is None else partial.select(_departing(partial, axes, edges, detectable.least))


def _departing(
    paths: PartialPaths, axes: TransducerAxes, edges: NDArray[np.intp], least: FloatArray
) -> NDArray[np.intp]:
    """Return the rows of paths that leave loud enough for their target: row 0 of `least` or one of these edges."""
    away = paths.points[:, 1] - paths.points[:, 0]
    target = np.where(paths.edges < 0, 0, np.searchsorted(edges, paths.edges) + 1) + paths.places * (1 + len(edges))
    headings = axes.leaving[paths.places]
    amplitudes = axes.departing(np.arctan2(away[:, 1], away[:, 0]), headings) * paths.gains
    return np.flatnonzero(amplitudes >= least[target])


def _new(paths: PartialPaths, earlier: PartialPaths) -> PartialPaths:
    """Return the paths to edges whose surfaces are not those of a known path to the same edge."""
    most = paths.surfaces.shape[1]
    short = earlier.select(np.flatnonzero((earlier.bends <= most) & (earlier.edges >= 0)))
    both = PartialPaths.join([short, paths])
    kept = first_of_equal(np.column_stack((both.places, both.edges, both.surfaces)))
    return paths.select(kept[kept >= len(short)] - len(short))


def _inside_post(room: Room, places: FloatArray, passing: Passing | None) -> NDArray[np.bool_]:
    """Return which places (n, 2) are inside of a post, (n,)."""
    posts = room.posts if passing is None else room.posts[~passing.low[len(room.walls) :]]
    away = np.hypot(*np.moveaxis(posts[:, :2] - places[:, None], -1, 0))
    return np.asarray((away < posts[:, 2]).any(axis=1))


def _diffracting_edges(room: Room, sources: FloatArray, ends: FloatArray, search: PathSearch) -> NDArray[np.bool_]:
    """Return which edges (e,) are near enough for a diffracted path that is not too long and not too faint, (n, e)."""
    if not search.diffraction:
        return np.zeros((len(sources), len(room.edges)), np.bool_)
    longest = np.minimum(_longest_partial(room, ends, search), search.max_length)
    near = np.hypot(*np.moveaxis(room.edges.points - sources[:, None], -1, 0)) <= longest
    return np.asarray(near & ~room.enclosures.separated_from(sources))


def _longest_partial(room: Room, ends: FloatArray, search: PathSearch) -> FloatArray:
    """Return the greatest length of a path to each edge that may continue to `ends` (n, 2), (n, edges) m; 0: none."""
    straight = np.hypot(*np.moveaxis(room.edges.points - ends[:, None], -1, 0))
    loud = search.edge_diffraction.longest_partial(straight)
    return np.asarray(np.clip(np.minimum(loud, search.max_length + SLACK - straight), 0.0, None))


def _paths_of(paths: PartialPaths) -> Paths:
    rows = np.arange(len(paths.lengths))
    last = last_points(paths.points)
    before, end = paths.points[rows, last - 1], paths.points[rows, last]
    away, home = paths.points[:, 1] - paths.points[:, 0], before - end
    return Paths(
        paths.lengths,
        np.arctan2(away[:, 1], away[:, 0]),
        np.arctan2(home[:, 1], home[:, 0]),
        paths.gains,
        paths.phases,
        np.zeros(len(rows)),
        paths.surfaces,
        paths.edges,
        paths.bends,
        np.zeros((len(rows), 2)),
        paths.points,
    )


# Diffuse scatter: the direct return of every visible patch of a rough surface, one path each.
#
# The specular part of a rough surface is in `Room.reflectances`. Smooth surfaces have no patches and cost nothing.
# Receivers add the power of all patches that the burst and the beam cover (`sonarhw_sim.predict.predicted_scan`).


PATCHES = 720
PATCH = math.tau / PATCHES  # rad, widest patch as seen from the sensor: a small part of every beam
_RAYS = 1440  # that find the rough surfaces; narrower ones may be missed
_HALVINGS = 20  # of the angle between two rays, to find the end of a surface
_SHORTEST = 1e-4  # m: least `spreads` of a patch
_Sector = tuple[float, float, int]  # rad, begin and end, and the surface that is visible between them


def scattered_paths(
    room: Room,
    position: tuple[float, float],
    search: PathSearch,
    receiver: tuple[float, float] | None = None,
    patch: float = PATCH,
) -> Paths:
    """Return the direct returns of rough surfaces to `position`, or to a separate `receiver`, shortest first.

    No patch is wider than `patch`, rad as seen from `position`.
    """
    source = np.array(position, dtype=np.float64)
    target = source if receiver is None else np.array(receiver, dtype=np.float64)
    begins, widths, surfaces = _patches(room, source, patch)
    across = begins[:, None] + widths[:, None] * np.array([0.0, 0.5, 1.0])
    touches = source + _distances(room, source, across, surfaces)[:, :, None] * _unit(across)
    out, back = (np.hypot(*np.moveaxis(touches - end, 2, 0)) for end in (source, target))
    lengths = (out + back)[:, 1]
    middles = touches[:, 1]
    cosines = _cosines(room, surfaces, middles, source, target)
    gains = room.scattered[surfaces] * patch_gain(cosines, out[:, 1], back[:, 1], widths)
    kept = (gains > 0) & (lengths <= search.max_length + SLACK) & (search.max_bounces > 0)
    kept[kept] = [leg_is_free(touch, target, room.surfaces) for touch in middles[kept]]
    rows = np.flatnonzero(kept)[np.argsort(lengths[kept], kind="stable")]
    count = len(rows)
    return Paths(
        lengths=lengths[rows],
        departures=np.arctan2(*(middles - source)[rows].T[::-1]),
        arrivals=np.arctan2(*(middles - target)[rows].T[::-1]),
        gains=gains[rows],
        phases=np.full(count, np.nan),
        spreads=np.maximum(np.ptp(out + back, axis=1), _SHORTEST)[rows],
        surfaces=surfaces[rows, None].astype(np.int32),
        edges=np.full(count, -1, dtype=np.int32),
        bends=np.ones(count, dtype=np.int32),
        elevations=np.zeros((count, 2)),
        points=np.stack((np.tile(source, (count, 1)), middles[rows], np.tile(target, (count, 1))), axis=1),
    )


def patch_gain(cosines: FloatArray, out: FloatArray, back: FloatArray, widths: FloatArray) -> FloatArray:
    """Return the amplitude of fully diffuse, perfect patches relative to a perfect mirror at that length, 0..1.

    In two dimensions a source of power P lights a patch, dφ wide as the source sees it (`widths`), with P dφ/(2π),
    whatever its distance and slant. Lambert's law in two dimensions sends cos(e)/2 of that into each radian at an angle
    e from the normal (its integral over ±90° is 1), which at a distance s′ (`back`) is the intensity
    P dφ cos(e)/(4π s′). The intensity from a mirror at the same length s + s′ is P/(2π (s + s′)). The ratio is
    dφ cos(e) (s + s′)/(2 s′): dφ cos(i) straight back at incidence i. The amplitude is its root, limited
    to that of a mirror.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        power = widths * np.maximum(cosines, 0.0) * (out + back) / (2 * back)
    return np.asarray(np.sqrt(np.clip(np.nan_to_num(power), 0.0, 1.0)))


def _patches(room: Room, source: FloatArray, patch: float) -> tuple[FloatArray, FloatArray, NDArray[np.intp]]:
    """Return where the visible patches begin and how wide they are (rad), and their surfaces, (k,) each."""
    sectors = [] if room.posts_at((float(source[0]), float(source[1]))) else _rough_sectors(room, source)
    begins, ends = (np.array([sector[k] for sector in sectors], dtype=np.float64) for k in (0, 1))
    counts = np.ceil((ends - begins) / patch).astype(np.intp)
    widths = np.repeat((ends - begins) / np.maximum(counts, 1), counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    surfaces = np.repeat(np.array([sector[2] for sector in sectors], dtype=np.intp), counts)
    return np.repeat(begins, counts) + within * widths, widths, surfaces


def _rough_sectors(room: Room, source: FloatArray) -> list[_Sector]:
    """Return the sectors in which a rough surface is visible from `source`."""
    x, y = source

    def seen(angle: float) -> int:
        return int(first_hit(x, y, math.cos(angle), math.sin(angle), -1, room.surfaces)[1])

    rough = {-1: False} | dict(enumerate((room.scattered[: room.levels.start] > 0).tolist()))
    directions = fan(_RAYS).tolist()
    directions.append(directions[0] + math.tau)
    surfaces = [seen(angle) for angle in directions]
    begin, sectors = directions[0], []
    for k in range(_RAYS):
        if surfaces[k] == surfaces[k + 1]:
            continue
        ends, begins = directions[k], directions[k + 1]
        if rough[surfaces[k]]:
            sectors.append((begin, _last_seen(seen, ends, begins), surfaces[k]))
        begin = _last_seen(seen, begins, ends) if rough[surfaces[k + 1]] else begins
    if rough[surfaces[-1]]:
        sectors.append((begin, directions[-1], surfaces[-1]))
    return [sector for sector in sectors if sector[1] > sector[0]]


def _last_seen(seen: Callable[[float], int], here: float, beyond: float) -> float:
    """Return the angle nearest to `beyond` at which the surface at the angle `here` is still seen, rad."""
    surface = seen(here)
    for _ in range(_HALVINGS):
        middle = (here + beyond) / 2
        here, beyond = (middle, beyond) if seen(middle) == surface else (here, middle)
    return here


def _distances(room: Room, source: FloatArray, angles: FloatArray, surfaces: NDArray[np.intp]) -> FloatArray:
    """Return the distance from `source` to the surface of each patch, in the directions `angles` (k, 3), same shape."""
    towards, distances = _unit(angles), np.empty(angles.shape)
    flat = surfaces < len(room.walls)
    walls, posts = room.walls[surfaces[flat]], room.posts[surfaces[~flat] - len(room.walls)]
    normals = np.column_stack((walls[:, 1] - walls[:, 3], walls[:, 2] - walls[:, 0]))[:, None]
    aside = ((walls[:, None, :2] - source) * normals).sum(axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances[flat] = np.nan_to_num(aside / (towards[flat] * normals).sum(axis=2))
    to_centre = posts[:, None, :2] - source
    ahead = (to_centre * towards[~flat]).sum(axis=2)
    within = posts[:, None, 2] ** 2 - (to_centre**2).sum(axis=2) + ahead**2
    distances[~flat] = ahead - np.sqrt(np.maximum(within, 0.0))
    return distances


def _cosines(
    room: Room, surfaces: NDArray[np.intp], touches: FloatArray, source: FloatArray, target: FloatArray
) -> FloatArray:
    """Return the cosine of the angle between each surface's normal, on the side of `source`, and `target`, (k,)."""
    normals = np.empty_like(touches)
    flat = surfaces < len(room.walls)
    walls, posts = room.walls[surfaces[flat]], room.posts[surfaces[~flat] - len(room.walls)]
    normals[flat] = np.column_stack((walls[:, 1] - walls[:, 3], walls[:, 2] - walls[:, 0]))
    normals[~flat] = touches[~flat] - posts[:, :2]
    lit, away = ((normals * (point - touches)).sum(axis=1) for point in (source, target))
    with np.errstate(divide="ignore", invalid="ignore"):
        cosines = np.sign(lit) * away / np.hypot(*normals.T) / np.hypot(*(target - touches).T)
    return np.asarray(np.nan_to_num(cosines))


def _unit(directions: FloatArray) -> FloatArray:
    return np.stack((np.cos(directions), np.sin(directions)), axis=-1)
