"""Walls whose direction the scans hardly determine are tried at right angles to the others."""

import math

import numpy as np

from sonarhw_compare.room_finding.draft import DraftWall, RoomDraft
from sonarhw_compare.room_finding.evidence import ROUGH, Evidence, Scored, scored
from sonarhw_compare.room_finding.refining.refinement import centred, refined
from sonarhw_compare.room_finding.right_angles import SPREAD, pulls

_LEAST, _MOST = 2 * SPREAD, math.radians(30)  # rad away from right angles
_STEPS = 4  # of a refinement


def squared(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with walls turned to right angles, where this is more likely.

    A wall that one place faces is turned about this place, which keeps its distance. All places are tried.
    """
    for key in list(best.draft.walls):
        away = _away(best.draft).get(key, 0.0)
        if not _LEAST < abs(away) < _MOST:
            continue
        draft = centred(best.draft)
        turned = [
            scored(evidence, draft.with_wall(key, _turned(draft.walls[key], place.position, -away)))
            for place in draft.places
        ]
        tried = max(turned, key=lambda one: one.score)
        if math.isfinite(tried.score):
            found = refined(evidence, tried.draft, ROUGH, _STEPS)
            best = found if found.score > best.score else best
    return best


def _away(draft: RoomDraft) -> dict[int, float]:
    """Return by wall the angle by which it is away from right angles to the common wall, rad."""
    return {key: away for key, _, away, _ in pulls(draft)}


def _turned(wall: DraftWall, about: tuple[float, float], angle: float) -> DraftWall:
    """Return a wall turned about a point (m) by an angle (rad)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = (np.array([[cosine, -sine], [sine, cosine]]) @ np.subtract(wall.middle, about) + about).tolist()
    return DraftWall((x, y), wall.angle + angle, wall.ends)
