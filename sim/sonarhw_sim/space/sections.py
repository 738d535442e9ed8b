"""All paths of a place: in the plan, and out of it if the height of the transducer is known.

A place without a height uses the plan only. A place with a height uses a horizontal section with the walls and posts
that span this height, the paths that floor, ceiling and lids turn out of it (`vertical.in_space`), and those that the
upper and lower ends of walls bend (`vertical.rims`). All are merged here.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths, find_paths_of_places, scattered_paths
from sonarhw_sim.room.edges import find_edges
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.space.folding import edge_numbers, plan_of, raised_paths, straight_paths
from sonarhw_sim.space.levels import Levels, level_sequences, levels_of, reflectance_factors, rough_level_paths
from sonarhw_sim.space.rim_paths import rim_paths, round_rim_paths, round_rims
from sonarhw_sim.space.rims import find_rims

Receiver = tuple[float, float] | None  # position of the receiver, m; None: as the sender

# m: sender and receiver up to this distance use patches of rough levels seen from midway between them. At a distance s,
# a path of length L is then too short by s²/2L, 0.2 mm for 26 mm at 2 m. Farther apart, rough levels return no sound.
SIDE_BY_SIDE = 0.1
# Paths bent by an edge and by levels, in a room that sound can pass at several heights, are many and faint: they are
# listed 20 dB less far down than the others.
_LOUDER = 10.0
_FIRST, _FEWEST, _MOST = 16, 2, 128  # places of one search
_CACHED = 4000  # paths that fit into the cache of a processor with those that lead to them
_MOST_SURFACES = 46_000  # with more, the number of an edge in sections exceeds 32 bits


def paths_from(
    room: Room, place: Place, search: PathSearch, receiver: Receiver = None, face: float = 0.0, sections: int = 1
) -> Paths:
    """Return every path of `search` from a place back to it, or to `receiver`, shortest first.

    Gains are those at the frequency of the search. `sections` parallel horizontal sections share the transducer's face
    of radius `face` (m). Raises InputError if the place has a height and the room too many surfaces, and for more paths
    than fit into memory.
    """
    try:
        paths = _all_paths(room, place, search, receiver, face, sections)
    except MemoryError as error:
        raise InputError(
            f"room {room.name!r}: too many paths for the free memory; choose a shorter range or fewer reflections"
        ) from error
    return _at_frequency(room, paths, search)


def paths_from_each(
    room: Room, places: Sequence[Place], search: PathSearch, face: float = 0.0, sections: int = 1
) -> Iterator[Paths]:
    """Yield the paths of `paths_from` of each place. In the plan, those of many places are searched together."""
    planar = all(place.height is None for place in places) and not room.scattered[: room.levels.start].any()
    if not planar:
        yield from (paths_from(room, place, search, None, face, sections) for place in places)
        return
    begin, count = 0, _FIRST
    while begin < len(places):
        total = 0
        for paths in _from_many(room, places[begin : begin + count], search):
            total += len(paths)
            yield paths
        begin, count = begin + count, min(max(_CACHED * count // max(total, 1), _FEWEST), _MOST)


def _from_many(room: Room, places: Sequence[Place], search: PathSearch) -> Iterator[Paths]:
    """Yield the paths from each place in the plan."""
    if len(places) == 1:
        yield paths_from(room, places[0], search)
        return
    try:
        paths, begins = find_paths_of_places(room, np.array([place.position for place in places]), search)
    except (InputError, MemoryError):
        # too many paths at once
        half = len(places) // 2
        yield from _from_many(room, places[:half], search)
        yield from _from_many(room, places[half:], search)
        return
    paths = _at_frequency(room, paths, search)
    for begin, end in pairwise(begins.tolist()):
        yield paths.select(np.arange(begin, end))


def _at_frequency(room: Room, paths: Paths, search: PathSearch) -> Paths:
    """Return the paths with the reflectances that tables of materials have at the frequency of the search."""
    if not room.tables:
        return paths
    frequency = np.array([room.air.speed_of_sound / search.wavelength])
    return replace(paths, gains=paths.gains * reflectance_factors(room, paths, frequency)[:, 0])


def _all_paths(room: Room, place: Place, search: PathSearch, receiver: Receiver, face: float, sections: int) -> Paths:
    """Return the paths of `paths_from` with the largest values of the tables of materials."""
    if place.height is None:
        return _planar_paths(room, place, search, receiver)
    # paths out of the plan are derived from those in it, by walls and edges
    search = replace(search, small=False)
    if len(room.names) > _MOST_SURFACES:
        raise InputError(f"room {room.name!r}: heights take up to {_MOST_SURFACES} surfaces, got {len(room.names)}")
    strips = _strips(place.height, face, sections)
    flat = _horizontal_paths(room, place, search, receiver, strips)
    levels = levels_of(room, place, place.height)
    parts = [flat, *_raised_paths(room, place, levels, search, receiver, flat)]
    parts += _rim_paths(room, place, levels, search, receiver)
    if receiver is None:
        parts += straight_paths(room, place, levels, place.height, search)
        parts += rough_level_paths(room, place, place.height, search)
    elif math.dist(place.position, receiver) <= SIDE_BY_SIDE:
        (x, y), (other_x, other_y) = place.position, receiver
        middle = replace(place, position=((x + other_x) / 2, (y + other_y) / 2))
        parts += rough_level_paths(room, middle, place.height, search)
    return _by_length(Paths.join(parts))


def _raised_paths(
    room: Room, place: Place, levels: Levels, search: PathSearch, receiver: Receiver, flat: Paths
) -> list[Paths]:
    """Return the paths by floor, ceiling and lids; `flat` are those of the horizontal section."""
    if not len(levels.surfaces):
        return []
    height = place.height or 0.0
    sequences = level_sequences(levels, height, height, search.max_length, search.max_bounces, 1)
    climbs = np.array([sequence.climb * sequence.signs[0] for sequence in sequences])
    ends = levels.kernel.heights
    reach = min(height, float(ends.min())), max(height, float(ends.max()))
    plan = plan_of(room, height, levels, reach, climbs, search)
    if plan.passing is None:
        paths = flat.select(np.flatnonzero(~flat.scattered))
    else:
        search = replace(search, faintest_diffraction=_LOUDER * search.faintest_diffraction)
        paths = find_paths(plan.room, place.position, search, receiver, plan.passing)
    raised = raised_paths(plan, levels, paths, height, search)
    return [replace(raised, edges=plan.edges[raised.edges])]


def _rim_paths(room: Room, place: Place, levels: Levels, search: PathSearch, receiver: Receiver) -> list[Paths]:
    """Return the paths by upper and lower ends of walls and posts."""
    rims, round_ = find_rims(room, levels), round_rims(room, levels)
    if not search.diffraction or not (len(rims) or round_):
        return []
    height, sender = place.height or 0.0, np.array(place.position, dtype=np.float64)
    ends = sender, sender if receiver is None else np.array(receiver, dtype=np.float64)
    plan = plan_of(room, height, levels, (levels.floor, levels.ceiling), np.empty(0), search)
    parts = [rim_paths(plan, levels, rims, ends, height, search)] if len(rims) else []
    return [*parts, round_rim_paths(plan, levels, round_, ends, height, search)] if round_ else parts


def _planar_paths(room: Room, place: Place, search: PathSearch, receiver: Receiver) -> Paths:
    paths = find_paths(room, place.position, search, receiver)
    if not room.scattered[: room.levels.start].any():
        return paths
    return _by_length(Paths.join([paths, scattered_paths(room, place.position, search, receiver)]))


def _by_length(paths: Paths) -> Paths:
    # rounded to a nanometre, as in the core: paths that differ less keep their order
    return paths.select(np.argsort(np.round(paths.lengths, 9), kind="stable"))


def _strips(height: float, face: float, sections: int) -> list[tuple[float, float]]:
    """Return heights (m) of strips of equal width across a round face, and their shares of its area."""
    middles = (2 * np.arange(sections) + 1) / sections - 1  # in radii
    widths = np.sqrt(1 - middles**2)
    return [(height + face * float(y), float(w)) for y, w in zip(middles, widths / widths.sum(), strict=True)]


def _horizontal_paths(
    room: Room, place: Place, search: PathSearch, receiver: Receiver, strips: list[tuple[float, float]]
) -> Paths:
    shares: dict[tuple[int, ...], float] = {}  # by the surfaces at a height
    for height, share in strips:
        spanning = spanning_at(room, height)
        shares[spanning] = shares.get(spanning, 0.0) + share
    parts = []
    for spanning, share in shares.items():
        section = cut(room, spanning)
        paths = _in_room(_planar_paths(section, place, search, receiver), section, room, spanning)
        parts.append(paths if len(shares) == 1 else replace(paths, gains=paths.gains * share))
    return parts[0] if len(parts) == 1 else _summed(parts)


def spanning_at(room: Room, height: float | None) -> tuple[int, ...]:
    """Return the numbers of the walls and posts that span a height (m); for None, of all."""
    lower, upper = room.heights[: room.levels.start].T
    if height is None:
        return tuple(range(len(lower)))
    return tuple(np.flatnonzero((lower <= height) & (height <= upper)).tolist())


def cut(room: Room, spanning: tuple[int, ...]) -> Room:
    """Return the room with only these walls and posts and their edges; the room itself if they are all."""
    if len(spanning) == room.levels.start:
        return room
    rows = np.array(spanning, dtype=np.intp)
    walls = room.walls[rows[rows < len(room.walls)]]
    names = tuple(room.names[k] for k in spanning)
    return replace(
        room,
        walls=walls,
        posts=room.posts[rows[rows >= len(room.walls)] - len(room.walls)],
        reflectances=room.reflectances[rows],
        scattered=room.scattered[rows],
        heights=room.heights[rows],
        names=names,
        lids=(),
        materials=tuple(room.materials[k] for k in spanning),
        edges=room.edges if len(walls) == len(room.walls) else find_edges(walls, names[: len(walls)]),
    )


def _in_room(paths: Paths, section: Room, room: Room, spanning: tuple[int, ...]) -> Paths:
    """Return the paths of a section with surfaces and edges numbered as in the room."""
    edges = paths.edges if section.edges is room.edges else edge_numbers(section.edges, room, spanning)[paths.edges]
    surfaces = np.array([*spanning, -1], dtype=np.int32)[paths.surfaces]
    return replace(paths, surfaces=surfaces, edges=edges)


def _summed(parts: list[Paths]) -> Paths:
    """Return the paths of sections that share one face, each once, with the sum of its gains."""
    paths = _by_length(Paths.join(parts))
    # equal paths have the same surfaces, and directions that differ only by rounding
    keys = np.column_stack(
        (paths.edges, paths.bends, _rounded(paths.leaving), _rounded(paths.arriving), paths.surfaces)
    )
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    gains = np.bincount(which.ravel(), paths.gains).astype(np.float64)
    order = np.argsort(first)
    return replace(paths.select(first[order]), gains=gains[order])


def _rounded(directions: FloatArray) -> NDArray[np.int64]:
    return np.asarray(np.round(directions * 1e6), dtype=np.int64)
