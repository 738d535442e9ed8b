"""Walls and posts that might exist, from regions of constant depth, and how scans support them."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations, pairwise, product

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, angle_difference
from sonarhw_compare.arcs import FARTHEST, OTHER_PLACE, POSSIBLE, Arc, common_lines, common_points, direction, table_of
from sonarhw_compare.fit.likelihood import ReadingNoise
from sonarhw_compare.locate import learned
from sonarhw_compare.match import compare_readings
from sonarhw_compare.rooms.draft import (
    DraftEnd,
    DraftPost,
    DraftWall,
    RoomDraft,
    meeting,
    oblique,
    post_name,
    wall_name,
)
from sonarhw_compare.rooms.evidence import (
    CLEARLY,
    FOLLOWED,
    PRICE,
    ROUGH,
    Evidence,
    Scored,
    all_scored,
    as_found,
    scored,
)

# Walls and posts that might exist, from regions of constant depth.
#
# An arc of one place fits a wall perpendicular to its bearing, two arcs fit the lines that touch both and the posts
# on both. Candidates are ranked by the unexplained readings of the arcs that agree.


_BEYOND = 0.1  # m, by which a wall is longer than its outermost touches
_SAME_LINE, _SAME_TURN = 0.03, math.radians(4)  # m, rad, between candidates that count as one
_THROUGH = 0.1  # m, by which an echo is farther than a post before it
_CONTRADICTION = 2.0  # readings, the weight of such an echo against the post
_SAME_POINT = 0.05  # m
RADII = (0.03, 0.09)  # m, of posts that are tried


def wall_candidates(
    arcs: Sequence[Arc], unexplained: Sequence[FloatArray], most: int, common: float | None = None
) -> list[DraftWall]:
    """Return the `most` best supported walls; `unexplained` is the weight of each reading, 0..1, by scan.

    Lines at right angles to a wall at the angle `common` (rad) are among them where they fit an arc.
    """
    table, weights = table_of(arcs, POSSIBLE), _weights(arcs, unexplained)
    squared = () if common is None else _squared_lines(arcs, common)
    lines = np.array([*_lines(tuple(arcs)), *squared], dtype=np.float64).reshape(-1, 2)
    if not len(lines):
        return []
    supports, members = np.empty(len(lines)), np.empty((len(lines), len(arcs)), np.bool_)
    for row, (normal, distance) in enumerate(lines.tolist()):
        misfits = table.misfits(*table.to_line(normal, distance))
        members[row] = misfits < FARTHEST
        supports[row] = _support(weights, misfits)
    walls: list[DraftWall] = []
    taken: list[FloatArray] = []
    for row in np.argsort(-supports, kind="stable").tolist():
        if len(walls) == most or supports[row] < 1.0:
            break
        if not any(_same_line(lines[row], other) for other in taken):
            taken.append(lines[row])
            walls.append(_wall(lines[row], table.centres[members[row]]))
    return walls


def post_candidates(
    arcs: Sequence[Arc], unexplained: Sequence[FloatArray], most: int, radii: Sequence[float] = RADII
) -> list[DraftPost]:
    """Return the `most` best supported posts, each of several radii (m)."""
    table, weights = table_of(arcs, POSSIBLE), _weights(arcs, unexplained)
    posts: list[tuple[float, DraftPost]] = []
    for radius in radii:
        for point in _points(tuple(arcs), radius):
            distances, bearings = table.to_post(*point, radius)
            support = _support(weights, table.misfits(distances, bearings))
            if radius > 0:  # the echo of a corner can be too faint to hide what is behind it
                near = np.abs(angle_difference(table.bearings, bearings)) < table.spreads
                support -= _CONTRADICTION * float(((table.ranges > distances + _THROUGH) & near).sum())
            if support >= 1.0:
                posts.append((support, DraftPost(point, radius)))
    posts.sort(key=lambda ranked: -ranked[0])
    kept: list[DraftPost] = []
    for _, post in posts:
        if len(kept) < most and not any(
            post.radius == other.radius and math.dist(post.center, other.center) < _SAME_POINT for other in kept
        ):
            kept.append(post)
    return kept


def _weights(arcs: Sequence[Arc], unexplained: Sequence[FloatArray]) -> FloatArray:
    """Return the unexplained readings of each arc, (n,)."""
    return np.array([float(unexplained[arc.scan][list(arc.rows)].sum()) for arc in arcs])


def _support(weights: FloatArray, misfits: FloatArray) -> float:
    """Return the weighted number of arcs that agree; those that fit worse count less."""
    return float((weights * np.maximum(1 - (misfits / FARTHEST) ** 2, 0.0)).sum())


@lru_cache(maxsize=4)  # growth asks for the same arcs after each wall
def _lines(arcs: tuple[Arc, ...]) -> tuple[tuple[float, float], ...]:
    """Return normal (rad) and distance from the origin (m) of lines that touch one arc or two."""
    return tuple(_lines_of(arcs))


def _squared_lines(arcs: Sequence[Arc], common: float) -> Iterator[tuple[float, float]]:
    """Yield the lines, as in `_lines`, that touch an arc within its width and are at right angles to a direction (rad).

    An arc is often not centred about the normal of its wall, because a nearer echo ends it on one side.
    """
    quarter = math.pi / 2
    for arc in arcs:
        away = math.remainder(arc.bearing - common, quarter)
        if abs(away) <= arc.spread:
            yield arc.touches(arc.bearing - away)


def _lines_of(arcs: Sequence[Arc]) -> Iterator[tuple[float, float]]:
    for arc in arcs:
        yield arc.touches(arc.bearing)
    for one, other in combinations(arcs, 2):
        yield from (line for line in common_lines(one, other) if one.is_near(line[0]) and other.is_near(line[0]))


@lru_cache(maxsize=8)
def _points(arcs: tuple[Arc, ...], radius: float) -> tuple[tuple[float, float], ...]:
    """Return the centres (m) of posts of this radius on two arcs; behind the middle of each, if all have one place."""
    return tuple(_points_of(arcs, radius))


def _points_of(arcs: Sequence[Arc], radius: float) -> Iterator[tuple[float, float]]:
    if len({arc.scan for arc in arcs}) == 1:
        for arc in arcs:
            x, y = (np.array(arc.centre) + (arc.range + radius) * direction(arc.bearing)).tolist()
            yield x, y
    for one, other in combinations(arcs, 2):
        for x, y in common_points(one, other, radius):
            if all(arc.is_near(math.atan2(y - arc.centre[1], x - arc.centre[0])) for arc in (one, other)):
                yield x, y


def _same_line(one: FloatArray, other: FloatArray) -> bool:
    return bool(abs(one[1] - other[1]) < _SAME_LINE and abs(math.remainder(one[0] - other[0], math.tau)) < _SAME_TURN)


def _wall(line: FloatArray, centres: FloatArray) -> DraftWall:
    """Return the part of a line between the outermost touches from these places, and a little more."""
    normal, along = direction(float(line[0])), direction(float(line[0]) - math.pi / 2)
    touched = centres @ along
    middle = float((touched.min() + touched.max()) / 2)
    half = float(touched.max() - touched.min()) / 2 + _BEYOND
    x, y = (line[1] * normal + middle * along).tolist()
    return DraftWall((x, y), float(line[0]) - math.pi / 2, (DraftEnd(-half), DraftEnd(half)))


# Ends of the walls of a draft: where they meet other walls, and where the scans say nothing of them.


_EXTENDED = 3.0  # m, by which a wall is extended at most to meet another one
_JUNCTION = 0.3  # m: an end that meets another wall farther than this from its ends does not make a corner
_WIDEST_CLOSED = 0.4  # m without a touch; wider, a wall may have a gap
_BESIDE, _AT_END = 0.1, 0.3  # m: from a corner to the line of its wall, and from the end of this wall inwards
_BEGUN = 0.3  # m, length of a wall of which only the corner shows
_AT_TOUCH = 0.02  # m, between an end and a touch of this end
_MOVES = (0.4, 0.2, 0.1, 0.05, 0.025)  # m, in turn, of a free end that is searched
_SHORTER = (0.2, 0.4, 0.6)  # m, of a wall whose free end may be far from its true place
_CLOSED = 1.0  # log-likelihood by which an end at another wall may be worse than one beyond or before it


def joined(draft: RoomDraft, wall: DraftWall) -> Iterator[RoomDraft]:
    """Yield the draft with a new wall whose ends meet its neighbours, in all combinations but that without any."""
    longer, key = draft.with_new_wall(wall)
    choices = [[None, *_neighbours(longer, key, which)] for which in (0, 1)]
    for first, second in product(*choices):
        made = longer
        for which, other in ((0, first), (1, second)):
            made = made if other is None else met(made, key, which, other)
        if made is not longer:
            yield made


def cornered(draft: RoomDraft, points: Sequence[tuple[float, float]]) -> Iterator[RoomDraft]:
    """Yield the draft with a wall that reaches one of `points`, m, and there alone or makes a corner with a new wall.

    The new wall is at right angles, on either side. A corner returns sound to every place, but a wall beside it may
    face none of them. The points of equal range then look like a post at the end of the other wall.
    """
    for point in points:
        for key, wall in draft.walls.items():
            away, (first, last) = np.subtract(point, wall.middle), draft.extent(key)
            along, beside = float(away @ wall.along), abs(float(away @ wall.normal))
            inside = first + _AT_END < along < last - _AT_END
            if beside > _BESIDE or inside or not first - _EXTENDED < along < last + _EXTENDED:
                continue
            nearer = 0 if abs(along - first) < abs(along - last) else 1
            yield draft.with_wall(key, wall.with_end(nearer, DraftEnd(along)))
            x, y = (np.array(wall.middle) + along * wall.along).tolist()
            for side in (1, -1):
                yield from _corner(draft, key, (x, y), side)


def continued(draft: RoomDraft) -> Iterator[RoomDraft]:
    """Yield the draft with a new wall at right angles to another one, at each of its free ends and on either side."""
    for key in draft.walls:
        for which in (0, 1):
            if draft.is_free(key, which):
                x, y = draft.segment(key)[2 * which : 2 * which + 2].tolist()
                for side in (1, -1):
                    yield from _corner(draft, key, (x, y), side)


def _corner(draft: RoomDraft, key: int, point: tuple[float, float], side: int) -> Iterator[RoomDraft]:
    """Yield the draft with the beginning of a wall from `point` (m) to the left (1) or right, and with all of it."""
    corner = DraftWall(point, draft.walls[key].angle + side * math.pi / 2, (DraftEnd(0.0), DraftEnd(_BEGUN)))
    longer, new = draft.with_new_wall(corner)
    longer = met(longer, new, 0, key)
    yield longer
    yield from (met(longer, new, 1, other) for other in _neighbours(longer, new, 1)[:1])


def with_better_ends(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with the ends of its walls moved to other walls where the scans do not contradict."""
    for key in list(best.draft.walls):
        for which in (0, 1):
            for other in _neighbours(best.draft, key, which):
                moved = _better_of(evidence, _meetings(best.draft, key, which, other))
                if moved.score > best.score - _CLOSED:
                    best = moved
                    break
    return best


def with_end_moved(evidence: Evidence, best: Scored, key: int, which: int) -> Scored:
    """Return the draft with an end of a wall where it explains most, free, up to 0.8 m from where it is.

    Echoes of a free end determine it, but they have no part in the refinement before it is almost there.
    """
    for move in _MOVES:
        wall, end = best.draft.walls[key], best.draft.extent(key)[which]
        tried = [best.draft.with_wall(key, wall.with_end(which, DraftEnd(end + by))) for by in (move, -move)]
        moved = _better_of(evidence, tried)
        best = moved if moved.score > best.score else best
    return best


def with_free_ends_moved(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with shorter walls whose free ends explain more there, if this is worth a wall.

    A wall that is joined to a far one early, when this explains more than a short wall, ends there for good otherwise:
    once the far wall is divided, the end is free, touched by the sound that it bends, and too far from its true place
    for the refinement.
    """
    for key in sorted(best.draft.walls.keys() - evidence.first.walls.keys()):
        for which in (0, 1):
            if best.draft.is_free(key, which):
                wall, at, inwards = best.draft.walls[key], best.draft.extent(key)[which], -1 if which else 1
                ends = [DraftEnd(at + inwards * by) for by in _SHORTER]
                shorter = _better_of(evidence, [best.draft.with_wall(key, wall.with_end(which, end)) for end in ends])
                if shorter.score > best.score + PRICE:
                    best = with_end_moved(evidence, shorter, key, which)
    return best


def _better_of(evidence: Evidence, drafts: Sequence[RoomDraft]) -> Scored:
    return max(all_scored(evidence, drafts), key=lambda draft: draft.score)


def _meetings(draft: RoomDraft, key: int, which: int, other: int) -> list[RoomDraft]:
    """Return the draft with an end of a wall at another one, whose nearer end moves there too, or stays."""
    corner, wall = met(draft, key, which, other), draft.walls[key]
    alone = draft.with_wall(key, wall.with_end(which, DraftEnd(wall.ends[which].at, other)))
    return [corner] if corner.walls == alone.walls else [corner, alone]


def _neighbours(draft: RoomDraft, key: int, which: int) -> list[int]:
    """Return the walls that an end could meet: at most two that cross the wall on this side, and two beyond it."""
    wall, end, sign = draft.walls[key], draft.extent(key)[which], 1 if which else -1
    crossed, beyond = [], []
    for other, neighbour in draft.walls.items():
        meeting_at = None if other in (key, wall.ends[which].meets) else meeting(wall, neighbour)
        if meeting_at is None:
            continue
        first, last = draft.extent(other)
        hit = meeting(neighbour, wall)
        if 0 < meeting_at * sign <= end * sign and hit is not None and first - _JUNCTION < hit < last + _JUNCTION:
            crossed.append((meeting_at * sign, other))
        elif wall.ends[which].meets is None and 0 <= (meeting_at - end) * sign <= _EXTENDED:
            beyond.append((meeting_at * sign, other))
    return [other for _, other in (*sorted(crossed)[:2], *sorted(beyond)[:2])]


def met(draft: RoomDraft, key: int, which: int, other: int) -> RoomDraft:
    """Return the draft with an end of a wall at another wall, whose nearer end moves there too if it makes a corner."""
    wall, neighbour = draft.walls[key], draft.walls[other]
    moved = draft.with_wall(key, wall.with_end(which, DraftEnd(wall.ends[which].at, other)))
    at = meeting(neighbour, wall)
    first, last = draft.extent(other)
    if at is None or first + _JUNCTION < at < last - _JUNCTION:
        return moved
    nearer = 0 if abs(at - first) < abs(at - last) else 1
    if abs(at - (first, last)[nearer]) > _EXTENDED or neighbour.ends[nearer].meets is not None:
        return moved
    return moved.with_wall(other, neighbour.with_end(nearer, DraftEnd(neighbour.ends[nearer].at, key)))


def with_gaps(evidence: Evidence, best: Scored, touched: dict[int, FloatArray]) -> Scored:
    """Return the draft with walls opened where sound does not touch them, if a gap, as for a door, is worth a wall.

    `touched` has the touches of each wall, m along it.
    """
    for key, points in touched.items():
        best = _without_lone_ends(evidence, best, key, np.sort(points))
        for before, behind in pairwise(np.sort(points).tolist() if key in best.draft.walls else []):
            if behind - before > _WIDEST_CLOSED:
                opened = _best_gap(evidence, best, key, (before, behind))
                best = opened if opened.score > best.score + PRICE else best
                if key not in best.draft.walls or opened is best:
                    break
    return best


def _best_gap(evidence: Evidence, closed: Scored, key: int, between: tuple[float, float]) -> Scored:
    """Return the draft with a gap in a wall between these points, m along it, or less if that explains more."""
    opened = scored(evidence, _opened(closed.draft, key, *between))
    if opened.score > closed.score - PRICE:  # else no gap is there
        for wall, which in ((key, 1), (max(opened.draft.walls), 0)):
            opened = with_end_moved(evidence, opened, wall, which)
    return opened


def _without_lone_ends(evidence: Evidence, best: Scored, key: int, touched: FloatArray) -> Scored:
    """Return the draft with a free end moved to the next of the sorted touches `touched`, if all between is untouched.

    The end alone then returns sound. It stays if it is worth as much as a wall.
    """
    for which, (outer, inner) in (
        ((0, touched[:2]), (1, touched[-2:][::-1])) if len(touched) > 1 and key in best.draft.walls else ()
    ):
        at_end = abs(best.draft.extent(key)[which] - outer) < _AT_TOUCH and best.draft.is_free(key, which)
        if at_end and abs(outer - inner) > _WIDEST_CLOSED:
            wall = best.draft.walls[key].with_end(which, DraftEnd(float(inner)))
            cut = scored(evidence, best.draft.with_wall(key, wall))
            best = cut if cut.score > best.score - PRICE else best
    return best


def _opened(draft: RoomDraft, key: int, before: float, behind: float) -> RoomDraft:
    """Return the draft with a wall divided in two, with a gap between these points, m along it."""
    wall = draft.walls[key]
    first, last = wall.with_end(1, DraftEnd(before)), wall.with_end(0, DraftEnd(behind))
    divided, second = draft.with_wall(key, first).with_new_wall(last)
    return divided.with_meeting_moved(key, second, behind)


# Where the paths that explain the readings touch the walls and posts of a draft.


_BEFORE = 0.99  # share of the way to a corner, before which a wall hides it


@dataclass(frozen=True)
class Touches:
    """The points at which sound has touched each surface on its way to a recorded echo."""

    walls: dict[int, FloatArray]  # by key: m along the wall from its middle
    posts: tuple[int, ...]  # number of touches of each post
    echoes: tuple[int, ...]  # by scan: their number
    unexplained: tuple[int, ...]  # by scan: number of echoes without a path
    seen: dict[int, frozenset[int]] = field(default_factory=dict)  # by key: scans with an echo of the wall


def touches_of(evidence: Evidence, draft: RoomDraft) -> Touches:
    """Return the touches of the paths that explain readings within 5 cm, reflected or diffracted there."""
    room, board = draft.room(evidence.air), as_found(evidence.board, draft)
    walls: dict[int, list[float]] = {key: [] for key in draft.walls}
    posts, echoes, unexplained = [0] * len(draft.posts), [], []
    seen: dict[int, set[int]] = {key: set() for key in draft.walls}
    for number, (scan, place) in enumerate(zip(evidence.scans, draft.places, strict=True)):
        comparison = compare_readings(scan.readings, room, board.faced(place), board, FOLLOWED)
        paths = comparison.prediction.paths
        sounding = ~np.isnan(comparison.measured)
        echoes.append(int(sounding.sum()))
        unexplained.append(int((sounding & (comparison.paths < 0)).sum()))
        for row in comparison.rows:
            if row.path is None:
                continue
            outline = paths.outline(row.path)[1:-1]
            for point in outline:
                for key in draft.walls:
                    along = _on(draft, key, point)
                    if along is not None:
                        walls[key].append(along)
                        seen[key].add(number)
                for which, post in enumerate(draft.posts):
                    posts[which] += bool(abs(np.hypot(*(point - post.center)) - post.radius) < 1e-6)
    return Touches(
        {key: np.array(along) for key, along in walls.items()},
        tuple(posts),
        tuple(echoes),
        tuple(unexplained),
        {key: frozenset(scans) for key, scans in seen.items()},
    )


def _on(draft: RoomDraft, key: int, point: FloatArray) -> float | None:
    """Return where a point lies on a wall, m along it from its middle; None if it is elsewhere."""
    wall = draft.walls[key]
    away = point - wall.middle
    along = float(away @ wall.along)
    first, last = draft.extent(key)
    return along if abs(float(away @ wall.normal)) < 1e-6 and first - 1e-6 <= along <= last + 1e-6 else None


def _is_hidden(draft: RoomDraft, key: int, which: int) -> bool:
    """Return whether other walls are between an end of a wall and every place."""
    point = draft.segment(key)[2 * which : 2 * which + 2]
    starts, along = draft.segments[:, :2], draft.segments[:, 2:] - draft.segments[:, :2]
    for place in draft.places:
        sight = point - place.position
        away = starts - place.position
        across = sight[0] * along[:, 1] - sight[1] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):  # walls along the line of sight
            on_sight = (away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]) / across
            on_wall = (away[:, 0] * sight[1] - away[:, 1] * sight[0]) / across
        before = (on_sight > 0) & (on_sight < _BEFORE) & (on_wall >= 0) & (on_wall <= 1)
        if not before.any():
            return False
    return True


def trimmed(draft: RoomDraft, touches: Touches, first: RoomDraft, only: int | None = None) -> RoomDraft:
    """Return the draft with free ends moved back to the outermost touches; what has no touches is removed.

    A corner that no place sees counts as a free end.
    The walls and posts of `first` stay as they are. `only`: the key of the one wall that is changed.
    """
    for key in sorted(draft.walls.keys() - first.walls.keys()):
        if only not in (None, key):
            continue
        at = touches.walls[key]
        if not len(at):
            draft = draft.without_wall(key)
            continue
        wall = draft.walls[key]
        for which, outermost in ((0, float(at.min())), (1, float(at.max()))):
            if draft.is_free(key, which) or _is_hidden(draft, key, which):
                wall = wall.with_end(which, DraftEnd(outermost))
        draft = draft.with_wall(key, wall)
    if only is not None:
        return draft
    kept = len(first.posts)
    touched = zip(draft.posts[kept:], touches.posts[kept:], strict=True)
    return replace(draft, posts=(*draft.posts[:kept], *(post for post, count in touched if count)))


# Which readings speak for and against each wall and post of a draft.


@dataclass(frozen=True, eq=False)
class Support:
    """The readings that speak for and against one wall or post."""

    name: str  # in the room of the draft
    gains: tuple[FloatArray, ...]  # log-likelihood of each reading with it minus without it, (n,) for each scan

    def speaking(self, sign: int) -> tuple[NDArray[np.bool_], ...]:
        """Return which readings clearly speak for it (1) or against it (-1), (n,) for each scan."""
        return tuple(sign * gains > CLEARLY for gains in self.gains)


def support_of(evidence: Evidence, draft: RoomDraft, noise: ReadingNoise) -> tuple[Support, ...]:
    """Return the support of each wall and post of a draft, in the order of its room."""
    without = [(wall_name(number), draft.without_only(key)) for number, key in enumerate(draft.walls)]
    without += [(post_name(number), draft.without_post(post)) for number, post in enumerate(draft.posts)]
    return tuple(Support(name, tuple(evidence.gains(rest, draft, noise))) for name, rest in without)


# Which walls and posts the scans confirm.


_MISFIT_SDS = 3.0  # standard deviations below the usual share, at which a scan does not fit


def fitting(touches: Touches, scan: int) -> bool:
    """Return whether a room explains nearly as many of the echoes of a scan as right rooms do of real scans."""
    by_sensors, echoes = learned(), touches.echoes[scan]
    least = by_sensors.usual_explained - _MISFIT_SDS * by_sensors.usual_explained_sd
    return not echoes or 1 - touches.unexplained[scan] / echoes >= least


def confirmed(evidence: Evidence, draft: RoomDraft) -> RoomDraft:
    """Return the draft without walls and posts that no two places confirm; what the search began with stays.

    Two places confirm what is worth its price without the place that speaks most for it. A scan at a wrong pose has
    walls of its own, so what one place shows alone stays only if the room fits its scans, and as a wall at right angles
    to the others.
    """
    touches, spots, turned = touches_of(evidence, draft), _spots(draft), oblique(draft)
    supports, walls, kept = support_of(evidence, draft, ROUGH), list(draft.walls), draft
    for key, support in zip(walls, supports, strict=False):
        spot = _only_spot(support, spots, evidence.redundancy)
        if spot is None or key in evidence.first.walls:
            continue
        fits = all(fitting(touches, scan) for scan in np.flatnonzero(spots == spot).tolist())
        kept = kept if fits and key not in turned else kept.without_only(key)
    fixed = len(evidence.first.posts)
    for post, support in zip(draft.posts[fixed:], supports[len(walls) + fixed :], strict=True):
        kept = kept if _only_spot(support, spots, evidence.redundancy) is None else kept.without_post(post)
    return kept


def _only_spot(support: Support, spots: NDArray[np.intp], redundancy: float) -> int | None:
    """Return the place without which something is not worth its price; None if two places confirm it."""
    gains = np.bincount(spots, [float(of_scan.sum()) for of_scan in support.gains]) / redundancy
    return None if gains.sum() - gains.max() >= PRICE else int(gains.argmax())


def _spots(draft: RoomDraft) -> NDArray[np.intp]:
    """Return a number for each scan, (n,): scans at one place have the same."""
    positions = np.array([place.position for place in draft.places])
    near = np.hypot(*(positions[:, None] - positions).transpose(2, 0, 1)) < OTHER_PLACE
    return np.asarray(near.argmax(axis=1))  # the first one there
