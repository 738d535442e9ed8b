"""Ends of the walls of a draft: where they meet other walls, and where the scans say nothing of them."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise, product

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.room_finding.draft import DraftEnd, DraftWall, RoomDraft, meeting
from sonarhw_compare.room_finding.evidence import PRICE, Evidence, Scored, all_scored, scored

_FARTHEST = 3.0  # m, by which a wall is extended at most to meet another one
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
            at, beside = float(away @ wall.along), abs(float(away @ wall.normal))
            inside = first + _AT_END < at < last - _AT_END
            if beside > _BESIDE or inside or not first - _FARTHEST < at < last + _FARTHEST:
                continue
            nearer = 0 if abs(at - first) < abs(at - last) else 1
            yield draft.with_wall(key, wall.with_end(nearer, DraftEnd(at)))
            x, y = (np.array(wall.middle) + at * wall.along).tolist()
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
        wall, at = best.draft.walls[key], best.draft.extent(key)[which]
        tried = [best.draft.with_wall(key, wall.with_end(which, DraftEnd(at + by))) for by in (move, -move)]
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
    return max(all_scored(evidence, drafts), key=lambda one: one.score)


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
        at = None if other in (key, wall.ends[which].meets) else meeting(wall, neighbour)
        if at is None:
            continue
        first, last = draft.extent(other)
        hit = meeting(neighbour, wall)
        if 0 < at * sign <= end * sign and hit is not None and first - _JUNCTION < hit < last + _JUNCTION:
            crossed.append((at * sign, other))
        elif wall.ends[which].meets is None and 0 <= (at - end) * sign <= _FARTHEST:
            beyond.append((at * sign, other))
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
    if abs(at - (first, last)[nearer]) > _FARTHEST or neighbour.ends[nearer].meets is not None:
        return moved
    return moved.with_wall(other, neighbour.with_end(nearer, DraftEnd(neighbour.ends[nearer].at, key)))


def with_gaps(evidence: Evidence, best: Scored, touched: dict[int, FloatArray]) -> Scored:
    """Return the draft with walls opened where sound does not touch them, if a gap, as for a door, is worth a wall.

    `touched` has the touches of each wall, m along it.
    """
    for key, at in touched.items():
        best = _without_lone_ends(evidence, best, key, np.sort(at))
        for before, behind in pairwise(np.sort(at).tolist() if key in best.draft.walls else []):
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


def _without_lone_ends(evidence: Evidence, best: Scored, key: int, at: FloatArray) -> Scored:
    """Return the draft with a free end moved to the next of the sorted touches `at`, if all between is untouched.

    The end alone then returns sound. It stays if it is worth as much as a wall.
    """
    for which, (outer, inner) in ((0, at[:2]), (1, at[-2:][::-1])) if len(at) > 1 and key in best.draft.walls else ():
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
