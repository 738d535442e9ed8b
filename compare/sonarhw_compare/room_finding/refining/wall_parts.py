"""Walls on one line, which can be parts of one wall."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np

from sonarhw_compare.room_finding.draft import DraftEnd, DraftWall, RoomDraft
from sonarhw_compare.room_finding.evidence import PRICE, ROUGH, Evidence, Scored
from sonarhw_compare.room_finding.refining.refinement import refined

_BESIDE, _TURNED = 0.15, math.radians(8)  # m, rad: from the line of a wall to another part of it
_STEPS = 4  # of a refinement


def with_parts_joined(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with walls on one line made one wall, where the scans do not contradict."""
    for pair in combinations(list(best.draft.walls), 2):
        if not set(pair) <= best.draft.walls.keys() or evidence.first.walls.keys() & set(pair):
            continue
        longer, other = sorted(pair, key=lambda key: -_length(best.draft, key))
        if not _on_one_line(best.draft, longer, other):
            continue
        joint = _in_one(best.draft, longer, other)
        one = refined(evidence, joint, ROUGH, _STEPS) if joint.is_sound else best
        best = one if one.score > best.score - PRICE else best
    return best


def without_part(draft: RoomDraft, key: int) -> RoomDraft:
    """Return the draft without a wall; if it is a part of another one, that wall reaches as far."""
    others = sorted((other for other in draft.walls if other != key), key=lambda other: -_length(draft, other))
    whole = next((other for other in others if _on_one_line(draft, other, key)), None)
    return draft.without_wall(key) if whole is None else _in_one(draft, whole, key)


def _length(draft: RoomDraft, key: int) -> float:
    first, last = draft.extent(key)
    return last - first


def _on_one_line(draft: RoomDraft, key: int, other: int) -> bool:
    wall = draft.walls[key]
    beside = (draft.segment(other).reshape(2, 2) - wall.middle) @ wall.normal
    turned = math.remainder(draft.walls[other].angle - wall.angle, math.pi)
    return bool((np.abs(beside) < _BESIDE).all()) and abs(turned) < _TURNED


def _in_one(draft: RoomDraft, key: int, other: int) -> RoomDraft:
    """Return the draft with a wall between the outermost ends of two, instead of both."""
    wall = draft.walls[key]
    ends = [(key, 0), (key, 1), (other, 0), (other, 1)]
    points = [draft.segment(of)[2 * which : 2 * which + 2] for of, which in ends]
    ats = [float((point - wall.middle) @ wall.along) for point in points]
    first, last = ats.index(min(ats)), ats.index(max(ats))
    along, (x, y) = points[last] - points[first], ((points[first] + points[last]) / 2).tolist()
    half = math.hypot(*along) / 2
    meets = [draft.walls[of].ends[which].meets for of, which in (ends[first], ends[last])]
    begin, end = (
        DraftEnd(at, None if one in (key, other) else one) for at, one in zip((-half, half), meets, strict=True)
    )
    walls = {**draft.walls, key: DraftWall((x, y), math.atan2(along[1], along[0]), (begin, end))}
    for name, one in walls.items():
        own = [replace(end, meets=key) if end.meets == other else end for end in one.ends]
        walls[name] = replace(one, ends=(own[0], own[1]))
    return replace(draft, walls={name: one for name, one in walls.items() if name != other})
