"""What a file of another program contains as surfaces, before it is a room: outlines, round objects and places.

`room_text` removes what no sound can reach or what is drawn twice, and writes the room file.
"""

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from sonarhw_sim.room.room import Place
from sonarhw_sim.room.room_file import MAX_COORDINATE, MOST_NAME, MOST_SURFACES

from sonarhw.errors import InputError, counted, harmless
from sonarhw.readings import BoolArray, FloatArray

Span = tuple[float, float]  # lower and upper end, m

MATERIAL = "unknown"
_DIGITS = 6  # of metres
_JOINED = 1e-3  # m; ends of walls that are nearer are one corner
_ASIDE = 3e-4  # m; a point so far beside a wall is inside or outside a solid
_SAME = 1e-4  # m
_MOST_COMPARED = 20_000  # walls, each of which is compared with all others


@dataclass(frozen=True)
class WallChain:
    """A chain of walls."""

    name: str
    points: FloatArray  # (n, 2) m
    closed: bool = False
    span: Span | None = None
    solid: bool = False  # the inside of the closed chain is a body

    @property
    def segments(self) -> FloatArray:
        """Start and end of each wall, (n, 4) m."""
        ends = np.roll(self.points, -1, axis=0) if self.closed else self.points[1:]
        return np.column_stack((self.points[: len(ends)], ends))


@dataclass(frozen=True)
class RoundObject:
    """An upright cylinder or a sphere."""

    name: str
    center: tuple[float, float]  # m
    radius: float  # m
    span: Span | None = None


@dataclass
class ForeignPlan:
    """The surfaces and places in a file, and how they were read."""

    outlines: list[WallChain] = field(default_factory=list)
    rounds: list[RoundObject] = field(default_factory=list)
    places: list[Place] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    floor: float | None = None  # height, m

    def at_height(self, height: float) -> "ForeignPlan":
        """Return the plan of what exists at a height, m, without heights."""

        def exists(shape: WallChain | RoundObject) -> bool:
            return shape.span is None or shape.span[0] <= height <= shape.span[1]

        outlines = [replace(shape, span=None) for shape in self.outlines if exists(shape)]
        rounds = [replace(shape, span=None) for shape in self.rounds if exists(shape)]
        left_out = len(self.outlines) + len(self.rounds) - len(outlines) - len(rounds)
        notes = [
            *self.notes,
            f"plan at a height of {height:g} m; {counted(left_out, 'object')} above or below left out",
        ]
        places = [Place(place.name, place.position, place.heading) for place in self.places]
        return ForeignPlan(outlines, rounds, places, notes)


def room_text(plan: ForeignPlan, title: str, reflectance: float, source: str) -> tuple[str, list[str]]:
    """Return the text of a room file, and the notes on how it was made. Raises InputError without any wall."""
    _check_coordinates(plan, source)
    outlines, gap = _with_joined_ends(plan.outlines)
    plan = replace(plan, notes=[*plan.notes], outlines=outlines)
    if gap > _SAME:
        plan.notes.append(f"ends of walls that nearly meet were joined; the largest gap was {gap * 1000:.2g} mm")
    outlines = _without_hidden(plan)
    if outlines is not plan.outlines and outlines:  # cuts that nearly meet have become corners, so again
        outlines = _with_ends_on_walls(
            _without_hidden(replace(plan, outlines=_with_joined_ends(outlines)[0], notes=[]))
        )
    plan.outlines = outlines
    if not plan.outlines:
        raise InputError(f"{source}: contains no wall; {'; '.join(plan.notes) or 'expected walls, boxes or lines'}")
    plan.notes.append(
        f"material {MATERIAL!r}: reflectance {reflectance:g} assumed; `sonarhw fit --free reflectances` finds it"
    )
    count = sum(len(outline.segments) for outline in plan.outlines) + len(plan.rounds)
    if count > MOST_SURFACES:
        raise InputError(f"{source}: {count} walls and posts; a room has at most {MOST_SURFACES}")
    names = _Names()
    lines = [f"# Imported from {harmless(source)}.", *(f"# {harmless(note)}" for note in plan.notes)]
    lines += [
        f"name = {json.dumps(title[:MOST_NAME])}",
        "",
        f"[materials.{MATERIAL}]",
        f"reflectance = {reflectance!r}",
    ]
    for outline in plan.outlines:
        lines += ["", "[[walls]]", *_wall_lines(outline, names)]
    for post in plan.rounds:
        center = [round(float(value), _DIGITS) + 0.0 for value in post.center]
        lines += ["", "[[posts]]", f"name = {json.dumps(names.unused(post.name, 0))}", f"center = {center}"]
        lines += [f"radius = {max(round(post.radius, _DIGITS), 10.0**-_DIGITS)!r}", f'material = "{MATERIAL}"']
        lines += [*_height_lines(post.span)]
    heights = [place.height for place in plan.places if place.height is not None]
    if plan.floor is not None and all(height > plan.floor for height in heights):
        lines += ["", "[floor]", f"height = {plan.floor!r}", f'material = "{MATERIAL}"']
    for place in plan.places:
        lines += ["", *_place_lines(place, names)]
    return "\n".join(lines) + "\n", plan.notes


def _check_coordinates(plan: ForeignPlan, source: str) -> None:
    """Raise InputError for coordinates that no room file can have."""
    points = [outline.points.ravel() for outline in plan.outlines]
    points += [np.array([*post.center, post.radius]) for post in plan.rounds]
    points += [np.array(outline.span) for outline in plan.outlines if outline.span is not None]
    points += [np.array(post.span) for post in plan.rounds if post.span is not None]
    every = np.concatenate([*points, np.zeros(1)])
    if not (np.abs(every) <= MAX_COORDINATE).all():  # also NaN
        worst = every[~(np.abs(every) <= MAX_COORDINATE)][0]
        raise InputError(f"{source}: a coordinate of {worst:g} m; expected at most {MAX_COORDINATE:g} m")


def _wall_lines(outline: WallChain, names: "_Names") -> Iterator[str]:
    points = [[x + 0.0, y + 0.0] for x, y in np.round(outline.points, _DIGITS).tolist()]
    yield f"name = {json.dumps(names.unused(outline.name, len(outline.segments)))}"
    yield f"points = {points}"
    if outline.closed:
        yield "closed = true"
    yield f'material = "{MATERIAL}"'
    yield from _height_lines(outline.span)
    if outline.closed and outline.solid and outline.span is not None:
        yield "lids = true"


def _height_lines(span: Span | None) -> Iterator[str]:
    if span is not None:
        yield f"height = {[round(float(value), _DIGITS) + 0.0 for value in span]}"


def _place_lines(place: Place, names: "_Names") -> Iterator[str]:
    yield f"[places.{json.dumps(names.unused(place.name, 0))}]"
    yield f"position = {[round(float(value), _DIGITS) + 0.0 for value in place.position]}"
    yield f"heading_deg = {round(math.degrees(place.heading), _DIGITS) + 0.0!r}"
    if place.height is not None:
        yield f"height = {round(place.height, _DIGITS) + 0.0!r}"


class _Names:
    """Names of surfaces and places, each given once."""

    def __init__(self) -> None:
        self._used = {"floor", "ceiling"}

    def unused(self, wanted: str, segments: int) -> str:
        """Return the name, or one with a number, so that it and the names of its segments are new."""
        plain = "".join("_" if char in ">/\\" or not char.isprintable() else char for char in wanted).strip()
        plain = plain[: MOST_NAME - 20] or "wall"
        name, number = plain, 1
        while not self._used.isdisjoint(self._of(name, segments)):
            number += 1
            name = f"{plain} {number}"
        self._used.update(self._of(name, segments))
        return name

    @staticmethod
    def _of(name: str, segments: int) -> list[str]:
        return [name, f"{name} lid", f"{name} underside", *(f"{name}[{k}]" for k in range(segments))]


# Ends of walls that nearly meet become one corner: drawings often have gaps of rounding, through which sound passes.


def _with_joined_ends(outlines: Sequence[WallChain]) -> tuple[list[WallChain], float]:
    """Return the chains with joined ends, and the largest distance that was closed, m."""
    from scipy.spatial import cKDTree

    if not outlines:
        return [], 0.0
    points = np.vstack([outline.points for outline in outlines])
    corner = np.arange(len(points))
    for first, second in sorted(cKDTree(points).query_pairs(_JOINED)):
        if corner[first] == first and corner[second] == second:
            corner[second] = first
    joined = points[corner]
    parts = np.split(joined, np.cumsum([len(outline.points) for outline in outlines])[:-1])
    chains = (_distinct(replace(one, points=part)) for one, part in zip(outlines, parts, strict=True))
    return [chain for chain in chains if chain is not None], float(np.hypot(*(joined - points).T).max())


def _with_ends_on_walls(outlines: Sequence[WallChain]) -> list[WallChain]:
    """Return the chains with ends that nearly touch the middle of a wall moved to it."""
    rows = np.vstack([outline.segments for outline in outlines])
    result = []
    for outline in outlines:
        points = outline.points.copy()
        for k in () if outline.closed else (0, -1):
            along = rows[:, 2:] - rows[:, :2]
            share = np.clip(((points[k] - rows[:, :2]) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
            feet = rows[:, :2] + share[:, None] * along
            distances = np.hypot(*(feet - points[k]).T)
            distances[(rows.reshape(-1, 2, 2) == points[k]).all(axis=2).any(axis=1)] = math.inf
            if distances.min() < _JOINED and not (points == feet[distances.argmin()]).all(axis=1).any():
                points[k] = feet[distances.argmin()]
        result.append(replace(outline, points=points))
    return result


def _distinct(outline: WallChain) -> WallChain | None:
    """Return a chain without repeated points; None if nothing is left."""
    points = outline.points[np.r_[True, (np.diff(outline.points, axis=0) != 0).any(axis=1)]]
    closed = outline.closed
    if len(points) > 2 and (points[0] == points[-1]).all():
        points, closed = points[:-1], True
    if len(points) < 2:
        return None
    return replace(outline, points=points, closed=closed and len(points) > 2)


# Walls inside solids, and walls that are there twice, are removed.
#
# Each wall is cut where it enters or leaves a solid, and where another wall begins or ends on it. A piece of the
# outline of a solid is kept if there is a solid at one side only.


def _without_hidden(plan: ForeignPlan) -> list[WallChain]:
    from scipy.spatial import cKDTree

    outlines = plan.outlines
    if not outlines:
        return outlines
    rows = np.vstack([outline.segments for outline in outlines])
    owners = np.repeat(np.arange(len(outlines)), [len(outline.segments) for outline in outlines])
    if len(rows) > _MOST_COMPARED:
        plan.notes.append(f"{len(rows)} walls: overlaps were not looked for; `sonarhw room check` lists them")
        return outlines
    is_solid = np.array([outline.solid for outline in outlines], np.bool_)[owners]
    spans = np.array([outline.span or (-math.inf, math.inf) for outline in outlines]).reshape(-1, 2)[owners]
    corners = cKDTree(rows.reshape(-1, 2))
    pieces: dict[int, FloatArray] = {}
    kept: dict[int, BoolArray] = {}
    seen: dict[tuple[float, ...], list[int]] = {}
    for k in np.argsort(spans[:, 0] - spans[:, 1], kind="stable").tolist():  # of two equal pieces, the higher one stays
        row = rows[k]
        cuts = _cuts(row, rows, is_solid, np.arange(len(rows)) != k)
        ends = row[:2] + cuts[:, None] * (row[2:] - row[:2])
        apart, nearest = corners.query(ends, distance_upper_bound=2 * _SAME)
        ends[np.isfinite(apart)] = corners.data[np.asarray(nearest)[np.isfinite(apart)]]
        parts = np.column_stack((ends[:-1], ends[1:]))
        is_kept = _reached(parts, outlines, owners[k])
        for number, part in enumerate(np.round(parts, _DIGITS).tolist()):
            key = tuple(part) if part[:2] < part[2:] else (*part[2:], *part[:2])
            others = seen.setdefault(key, [])
            is_kept[number] &= not any(_within(spans[k], spans[other]) for other in others)
            others += [k] if is_kept[number] else []
        pieces[k], kept[k] = parts, is_kept
    removed = sum(int((~part).sum()) for part in kept.values())
    if not removed:
        return outlines
    plan.notes.append(f"{counted(removed, 'piece')} of walls left out, inside solids or drawn twice")
    result = []
    for number, outline in enumerate(outlines):
        of_outline = np.flatnonzero(owners == number).tolist()
        whole = all(kept[k].all() for k in of_outline)
        result += [outline] if whole else _remaining(outline, [(pieces[k], kept[k]) for k in of_outline])
    return result


def _within(span: FloatArray, other: FloatArray) -> bool:
    return bool(other[0] <= span[0] and span[1] <= other[1])


def _cuts(row: FloatArray, rows: FloatArray, is_solid: BoolArray, foreign: BoolArray) -> FloatArray:
    """Return the shares of a wall at which it is cut, 0 and 1 included, in order."""
    along = row[2:] - row[:2]
    length = float(np.hypot(*along))
    low, high = np.minimum(row[:2], row[2:]) - _SAME, np.maximum(row[:2], row[2:]) + _SAME
    near = (np.minimum(rows[:, :2], rows[:, 2:]) <= high).all(axis=1)
    near &= (np.maximum(rows[:, :2], rows[:, 2:]) >= low).all(axis=1) & foreign
    ends = rows[near].reshape(-1, 2, 2) - row[:2]
    shares = ends @ along / length**2
    aside = (ends[..., 1] * along[0] - ends[..., 0] * along[1]) / length
    level = (np.abs(aside) < _SAME).all(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = shares[:, 0] + (shares[:, 1] - shares[:, 0]) * aside[:, 0] / (aside[:, 0] - aside[:, 1])
    touching = (aside.min(axis=1) < _SAME) & (aside.max(axis=1) > -_SAME) & ~level & is_solid[near]
    cuts = np.concatenate((shares[level].ravel(), share[touching], [0.0, 1.0]))
    cuts = np.unique(np.clip(cuts[np.isfinite(cuts)], 0.0, 1.0))
    inner = cuts[(cuts * length > _SAME) & ((1 - cuts) * length > _SAME)]
    inner = inner[np.r_[True, np.diff(inner) * length > _SAME]] if len(inner) else inner
    return np.concatenate(([0.0], inner, [1.0]))


def _reached(parts: FloatArray, outlines: Sequence[WallChain], own: int) -> BoolArray:
    """Return which pieces of walls of an outline have no solid at one side, (n,)."""
    outline = outlines[own]
    span = outline.span or (-math.inf, math.inf)
    along = parts[:, 2:] - parts[:, :2]
    normal = np.column_stack((-along[:, 1], along[:, 0])) / np.maximum(np.hypot(*along.T), _SAME)[:, None] * _ASIDE
    middles = (parts[:, :2] + parts[:, 2:]) / 2
    sides = np.stack((middles + normal, middles - normal))
    covered = np.zeros(sides.shape[:2], np.bool_)
    for number, other in enumerate(outlines):
        low, high = other.span or (-math.inf, math.inf)
        if other.solid and low <= span[0] and span[1] <= high and (number != own or outline.solid):
            box = other.points.min(axis=0) - 1, other.points.max(axis=0) + 1
            if ((middles > box[0]) & (middles < box[1])).all(axis=1).any():
                covered |= np.stack([_inside(side, other.segments) for side in sides])
    return np.asarray(covered[0] != covered[1] if outline.solid else ~covered.all(axis=0))


def _inside(points: FloatArray, walls: FloatArray) -> BoolArray:
    """Return which points are inside a closed chain of walls, by crossings of a ray, (n,)."""
    (x, y), (x1, y1, x2, y2) = points.T[:, :, None], walls.T
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed = ((y1 > y) != (y2 > y)) & (x < x1 + (y - y1) * (x2 - x1) / (y2 - y1))
    return np.asarray(crossed.sum(axis=1) % 2 == 1)


def _remaining(outline: WallChain, walls: Sequence[tuple[FloatArray, BoolArray]]) -> list[WallChain]:
    """Return the chains of the pieces that are kept; neighbouring pieces of one wall are one again."""
    runs: list[list[FloatArray]] = [[]]
    for parts, is_kept in walls:
        for number, (part, keep) in enumerate(zip(parts, is_kept, strict=True)):
            if not keep:
                runs.append([])
            elif runs[-1] and number and is_kept[number - 1]:
                runs[-1][-1] = np.r_[runs[-1][-1][:2], part[2:]]
            else:
                runs[-1].append(part)
    if outline.closed and len(runs) > 1 and runs[-1] and runs[0]:
        runs[0] = runs.pop() + runs[0]
    chains = [np.vstack([run[0][:2], *(part[2:] for part in run)]) for run in runs if run]
    names = [outline.name] if len(chains) == 1 else [f"{outline.name} {k}" for k in range(1, len(chains) + 1)]
    return [
        replace(outline, name=name, points=points, closed=False, solid=False)
        for name, points in zip(names, chains, strict=True)
    ]
