"""What the zero mark of a turntable proves: which readings stand at right angles, and how to see it once more.

Takes the angles of readings, in the order in which they were made; hands on from which of them on steps may have been
lost unseen. The mark comes by once a turn. A device looks at it whenever it turns counter-clockwise over it, and has
noticed by BEHIND that it was out of its place or did not come. A device that was reset, or left alone, finds its zero
anew: then nobody knows any more where the table stood before.
"""

import math
from collections.abc import Sequence

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


def legs(times: Sequence[float], angles: Sequence[float], homed: Sequence[float]) -> list[FloatArray]:
    """The angles (rad) of readings made at `times` (s), in their order, apart where the zero was found anew.

    That was behind each time of `homed`, which rise. One (n,) array more than those.
    """
    order = np.argsort(times, kind="stable")
    made, turned = np.array(times, dtype=np.float64)[order], np.array(angles, dtype=np.float64)[order]
    return np.split(turned, np.searchsorted(made, homed, side="right"))


def lost(legs: Sequence[FloatArray]) -> str | None:
    """A clause about readings, where the mark was out of its place behind the last of `legs`; None without any."""
    leg, total = legs[-1], sum(map(len, legs))
    if not len(leg):
        return None
    first = first_in_doubt(leg)
    doubtful = len(leg) - first
    these = f"all {total}" if doubtful == total else f"the last {doubtful} of {total}"
    return f"{these} angles may be off, from {math.degrees(leg[first]):.6g}° on"


def unchecked(legs: Sequence[FloatArray]) -> str | None:
    """A clause about the readings behind which the zero was found anew before the mark was seen; None without any."""
    doubtful = [leg[first_in_doubt(leg)] for leg in legs[:-1] if len(leg)]
    if not doubtful:
        return None
    count, total = sum(len(leg) - first_in_doubt(leg) for leg in legs[:-1]), sum(map(len, legs))
    return (
        f"{count} of {total} angles, from {math.degrees(doubtful[0]):.6g}° on, could not be checked for lost steps: "
        "the turntable had to find its zero anew"
    )
