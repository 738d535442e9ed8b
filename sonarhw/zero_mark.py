"""What the zero mark of a turntable proves: which readings stand at right angles, and how to see it once more.

Takes the angles of readings, in the order in which they were made; hands on from which of them on steps may have been
lost unseen. The mark comes by once a turn. A device looks at it whenever it turns counter-clockwise over it, and has
noticed by BEHIND that it was out of its place or did not come.
"""

import math

import numpy as np

from sonarhw.readings import FloatArray

BEFORE = math.radians(3)  # and the play of the gear: where to come from, so that the table has begun to move
BEHIND = math.radians(6)
_PLAY = math.radians(3)  # of a gear that is not known
_EXACT = 1e-6  # rad; less than a microstep


def nearest_mark(angle: float, lowest: float, highest: float) -> float | None:
    """The angle of the mark nearest to `angle`, rad; None where the cable lets no mark be between two angles."""
    first, last = math.ceil(lowest / math.tau), math.floor(highest / math.tau)
    return None if first > last else min(max(round(angle / math.tau), first), last) * math.tau


def first_in_doubt(angles: FloatArray) -> int:
    """Index of the first of readings at `angles`, (n,) rad, after which the mark was not seen in its place.

    Before the first of them the zero had just been found. Nothing is known of marks that were turned over clockwise.
    """
    run = doubt = 0  # `run`: where it began to turn counter-clockwise
    seen = -math.inf
    for index, angle in enumerate(angles):
        if index and angle < angles[index - 1]:
            run, seen = index, -math.inf
        mark = math.floor((angle - BEHIND) / math.tau) * math.tau
        if mark > seen and mark >= angles[run] + BEFORE + _PLAY:
            seen, doubt = mark, run + int(np.searchsorted(angles[run:index], mark - _EXACT))
    return doubt


def doubt(angles: FloatArray) -> str:
    """A clause about readings at `angles`, (n,) rad, n > 0, where the mark was found out of its place after them."""
    first = first_in_doubt(angles)
    these = f"the last {len(angles) - first} of {len(angles)}" if first else f"all {len(angles)}"
    return f"{these} angles may be off, from {math.degrees(angles[first]):.6g}° on"
