"""Walls whose direction the scans hardly determine are tried at right angles to the others, one by one and together."""

import math

import numpy as np

from sonarhw_compare.room_finding.draft import DraftWall, RoomDraft
from sonarhw_compare.room_finding.evidence import ROUGH, Evidence, Scored, all_scored
from sonarhw_compare.room_finding.refining.refinement import centred, refined
from sonarhw_compare.room_finding.right_angles import SPREAD, pulls

_LEAST, _MOST = 2 * SPREAD, math.radians(30)  # rad away from right angles
_TOGETHER = 3 * SPREAD  # rad away from right angles
_STEPS = 4  # of a refinement


def squared(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with walls turned to right angles, where this is more likely.

    A wall that one place faces is turned about this place, which keeps its distance. All places are tried.
    """
    for key in list(best.draft.walls):
        found = turned_square(evidence, best.draft, key)
        best = found if found is not None and found.score > best.score else best
    return best


def turned_square(evidence: Evidence, draft: RoomDraft, key: int) -> Scored | None:
    """Return the draft with a wall at right angles; None if it is there already, or oblique by more than 30°."""
    away = _away(draft).get(key, 0.0)
    if not _LEAST < abs(away) < _MOST:
        return None
    draft = centred(draft)
    wall = draft.walls[key]
    turned = (draft.with_wall(key, _turned(wall, place.position, -away)) for place in draft.places)
    tried = max(all_scored(evidence, turned), key=lambda one: one.score)
    return refined(evidence, tried.draft, ROUGH, _STEPS) if math.isfinite(tried.score) else None


def squared_together(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with all walls that are almost at right angles exactly so, where this is more likely.

    Several short walls can be wrong by the same angle, of which none is more likely at another one alone.
    """
    draft = centred(best.draft)
    angle = _long_direction(draft)
    for key, wall in draft.walls.items():
        away = math.remainder(wall.angle - angle, math.pi / 2)
        if abs(away) < _TOGETHER:
            draft = draft.with_wall(key, wall.moved(0.0, -away))
    if not draft.is_sound:
        return best
    found = refined(evidence, draft, ROUGH, _STEPS)
    return found if found.score > best.score else best


def _long_direction(draft: RoomDraft) -> float:
    """Return the mean direction of all walls, rad, where those at right angles have the same.

    Each counts by the cube of its length, to which the information of touches along it is proportional.
    """
    angles = np.array([wall.angle for wall in draft.walls.values()])
    lengths = np.array([last - first for first, last in map(draft.extent, draft.walls)])
    return float(np.angle((lengths**3 * np.exp(4j * angles)).sum())) / 4


def _away(draft: RoomDraft) -> dict[int, float]:
    """Return by wall the angle by which it is away from right angles to the common wall, rad."""
    return {key: away for key, _, away, _ in pulls(draft)}


def _turned(wall: DraftWall, about: tuple[float, float], angle: float) -> DraftWall:
    """Return a wall turned about a point (m) by an angle (rad)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = (np.array([[cosine, -sine], [sine, cosine]]) @ np.subtract(wall.middle, about) + about).tolist()
    return DraftWall((x, y), wall.angle + angle, wall.ends)
