"""Paths that the round rim of a low post bends, straight back in the plan: the ends of the post are level.

Before and behind the rim, sound touches the same walls, so that it meets the rim where it is nearest. The rim is an
outer right angle, and its curvature spreads the sound (Kouyoumjian and Pathak 1974, the caustic distance of an edge).
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import ComplexArray
from sonarhw_sim.rays.diffraction import edge_amplitudes
from sonarhw_sim.rays.paths import SLACK, Paths, PathSearch
from sonarhw_sim.room.grid import IntArray
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_file import MEETING
from sonarhw_sim.vertical.plan import Plan
from sonarhw_sim.vertical.reflecting_levels import Levels
from sonarhw_sim.vertical.rims.approaches import approaches_to, images_of
from sonarhw_sim.vertical.rims.rim_paths import MOST_REFLECTIONS
from sonarhw_sim.vertical.rims.rim_ways import Bends, End, RimSequences, paths_by, sequences_to

_STEPS = 6  # of Newton's method
_RIGHT_ANGLE = 1.5  # air around the rim, over π


def round_rims(room: Room, levels: Levels) -> list[tuple[int, int]]:
    """Return the ends of posts that sound can reach: number of the post, and 0 for the lower or 1 for the upper end."""
    first = len(room.walls)
    rows, ends = np.nonzero(
        (room.heights[first : room.levels.start] > levels.floor + MEETING)
        & (room.heights[first : room.levels.start] < levels.ceiling - MEETING)
    )
    return list(zip((first + rows).tolist(), ends.tolist(), strict=True))


def round_rim_paths(
    plan: Plan,
    levels: Levels,
    rims: list[tuple[int, int]],
    ends: tuple[FloatArray, FloatArray],
    height: float,
    search: PathSearch,
) -> Paths:
    """Return the paths by these rims between `ends`, the positions (2,) of sender and receiver at a height, m."""
    search = replace(search, max_bounces=min(search.max_bounces, MOST_REFLECTIONS))
    room, (sender, receiver) = plan.room, ends
    heights = np.array([room.heights[rim] for rim in rims], dtype=np.float64)
    sequences = sequences_to(levels, heights, height, search)
    climbs = sequences.totals * np.where(sequences.signs[:, 0] < 0, -1.0, 1.0)
    posts = np.unique([post for post, _ in rims]).astype(np.int32)
    approaches = approaches_to(plan, posts, sender, receiver, climbs, search)
    rim, way, first, second = _combined(rims, approaches.walls, sequences)
    bounces = 2 * approaches.bounces[way] + (sequences.levels >= 0).sum(axis=1)[np.array([first, second])].sum(axis=0)
    few = np.flatnonzero(bounces <= search.max_bounces)
    rim, way, first, second = rim[few], way[few], first[few], second[few]
    images = approaches.images, images_of(receiver, approaches.surfaces, room.walls)
    circles = room.posts[np.array([post for post, _ in rims]) - len(room.walls)][rim]
    rises = [sequences.totals[chosen] * sequences.signs[chosen, 1] for chosen in (first, second)]
    one, other = (np.column_stack((image[way], heights[rim] + rise)) for image, rise in zip(images, rises, strict=True))
    points, lengths, amplitudes = _bent(room, rims, rim, circles, one, other, heights[rim], search)
    of_levels = np.append(room.reflectances[levels.surfaces], 1.0)[sequences.levels].prod(axis=1)
    gains = approaches.gains[way] ** 2 * of_levels[first] * of_levels[second] * np.abs(amplitudes)
    bends = Bends(_edges(room, rims)[rim], points, lengths, gains, np.angle(amplitudes))
    loud = np.flatnonzero((lengths <= search.max_length + SLACK) & (gains >= search.faintest_diffraction))
    bends = Bends._make(column[loud] for column in bends)
    both = End(sender, approaches, way[loud], first[loud]), End(receiver, approaches, way[loud], second[loud])
    return paths_by(plan, levels, sequences, both, bends, search)


def _combined(
    rims: list[tuple[int, int]], posts: IntArray, sequences: RimSequences
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return rim, approach, and the sequences of levels before and behind, for all that fit together, (m,) each."""
    parts = []
    for row, (begin, behind) in enumerate(sequences.of_rims.tolist()):
        grid = np.meshgrid(np.flatnonzero(posts == rims[row][0]), *[np.arange(begin, behind)] * 2, indexing="ij")
        parts.append((np.full(grid[0].size, row), *(axis.ravel() for axis in grid)))
    rim, way, first, second = (np.concatenate(column) for column in zip(*parts, strict=True))
    return rim, way, first, second


def _edges(room: Room, rims: list[tuple[int, int]]) -> IntArray:
    return np.array([room.edge_between(post, _lid_of(room, post, end)) for post, end in rims], dtype=np.int32)


def _lid_of(room: Room, post: int, end: int) -> int:
    """Return the lid at the lower or upper end (0 or 1) of a post; the post itself if there is none."""
    centre = room.posts[post - len(room.walls), :2]
    for surface in room.levels:
        lid = room.lid(surface)
        if lid is None or lid.radius == 0.0 or lid.upper != bool(end):
            continue
        if (lid.corners[0] == centre).all() and lid.height == room.heights[post, end]:
            return surface
    return post


def _bent(
    room: Room,
    rims: list[tuple[int, int]],
    rim: NDArray[np.intp],
    circles: FloatArray,
    one: FloatArray,
    other: FloatArray,
    heights: FloatArray,
    search: PathSearch,
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return points (m, 2) m, lengths (m,) m and amplitudes (m,) of bends between points in space (m, 3).

    `circles` (m, 3) and `heights` (m,) m are those of the rims.
    """
    centres, radii = circles[:, :2], circles[:, 2]
    angles = _nearest(one, other, circles, heights)
    outward = np.column_stack((np.cos(angles), np.sin(angles)))
    points = centres + radii[:, None] * outward
    at = np.column_stack((points, heights))
    (aside, up, there), (other_aside, other_up, on) = (
        (((end[:, :2] - points) * outward).sum(axis=1), end[:, 2] - heights, np.sqrt(((end - at) ** 2).sum(axis=1)))
        for end in (one, other)
    )
    near, far = np.hypot(aside, up), np.hypot(other_aside, other_up)
    there, on = np.maximum(there, 1e-12), np.maximum(on, 1e-12)
    lengths = there + on
    cone = np.clip((near + far) / lengths, 1e-6, 1.0)
    upper = np.array([end for _, end in rims], dtype=np.bool_)[rim]
    # the first face is the side of the post below an upper end, or the end itself at a lower one
    begin = np.where(upper, 1.5 * math.pi, math.pi)
    turned = [np.mod(np.arctan2(rise, away) - begin, math.tau) for away, rise in ((aside, up), (other_aside, other_up))]
    faces = np.array([_reflectances(room, post, end) for post, end in rims])[rim]
    wedges = np.full(len(rim), _RIGHT_ANGLE)
    # from the side of the axis, the rim is not visible
    outside = (aside > 0.0) & (other_aside > 0.0)
    wave = search.wavelength / cone
    amplitudes = edge_amplitudes(turned[0], turned[1], wedges, faces, near, far, wave, search.edge_strength)
    curvature = (np.maximum(aside, 0.0) / there + np.maximum(other_aside, 0.0) / on) / (radii * cone**2)
    caustic = 1 / (1 / there + curvature)
    spread = np.sqrt(np.where(outside, caustic * lengths / (there * (caustic + on)), 0.0))
    return points, lengths, amplitudes * spread


def _reflectances(room: Room, post: int, end: int) -> tuple[float, float]:
    """Return the reflectances of the first and last face at an end of a post; its ends are silent without lids."""
    lid = _lid_of(room, post, end)
    of_end = 0.0 if lid == post else float(room.reflectances[lid])
    side = float(room.reflectances[post])
    return (side, of_end) if end else (of_end, side)


def _nearest(one: FloatArray, other: FloatArray, circles: FloatArray, heights: FloatArray) -> FloatArray:
    """Return the angles (m,) rad of the points of circles with the shortest way between two points (m, 3)."""
    away = [end[:, :2] - circles[:, :2] for end in (one, other)]
    sum_of = sum(step / np.maximum(np.hypot(*step.T), 1e-300)[:, None] for step in away)
    angles = np.arctan2(*np.asarray(sum_of).T[::-1])
    radii = circles[:, 2]
    for _ in range(_STEPS):
        cosine, sine = np.cos(angles), np.sin(angles)
        slope, bend = np.zeros((2, len(angles)))
        for end, (x, y) in zip((one, other), (step.T for step in away), strict=True):
            u, v = radii * cosine - x, radii * sine - y
            distance = np.sqrt(u**2 + v**2 + (end[:, 2] - heights) ** 2)
            along = radii * (v * cosine - u * sine) / distance
            slope += along
            bend += (radii**2 - radii * (u * cosine + v * sine) - along**2) / distance
        angles = angles - slope / np.where(bend > 0.0, bend, np.inf)
    return np.asarray(angles)
