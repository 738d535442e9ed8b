"""Find the readings whose angles may be wrong because the turntable lost steps.

The turntable passes its zero mark once a turn. A device checks the mark whenever it turns counter-clockwise over it. It
reports a misplaced or missing mark before it has turned MARK_OVERRUN past the position of the mark. After a reset, or
after a long silence of the host, a device homes again. Its angle error before that homing is unknown.
"""

import math
from collections.abc import Sequence

import numpy as np

from sonarhw.readings import FloatArray

MARK_APPROACH = math.radians(3)  # before the mark, plus the backlash: the table then moves when it reaches the mark
MARK_OVERRUN = math.radians(6)
_BACKLASH = math.radians(3)  # assumed backlash of every gear
_TOLERANCE = 1e-6  # rad; less than a microstep


def nearest_mark(angle: float, lowest: float, highest: float) -> float | None:
    """Return the angle of the mark nearest to `angle`, rad. None if no mark lies between `lowest` and `highest`."""
    first, last = math.ceil(lowest / math.tau), math.floor(highest / math.tau)
    return None if first > last else min(max(round(angle / math.tau), first), last) * math.tau


def first_unverified(angles: FloatArray) -> int:
    """Return the index of the first reading that was made after the last check of the mark.

    `angles`, (n,) rad, are the angles of the readings in order of time. The turntable was homed just before the first
    reading. A device does not check marks that it passes clockwise.
    """
    run = unverified = 0  # `run`: index of the reading where the latest counter-clockwise movement began
    seen = -math.inf
    for index, angle in enumerate(angles):
        if index and angle < angles[index - 1]:
            run, seen = index, -math.inf
        mark = math.floor((angle - MARK_OVERRUN) / math.tau) * math.tau
        if mark > seen and mark >= angles[run] + MARK_APPROACH + _BACKLASH:
            seen, unverified = mark, run + int(np.searchsorted(angles[run:index], mark - _TOLERANCE))
    return unverified


def split_at_homings(times: Sequence[float], angles: Sequence[float], homings: Sequence[float]) -> list[FloatArray]:
    """Return the angles (rad) of the readings in order of their times (s), split at each homing.

    `homings` are the times of the newest reading before each homing, in ascending order. The result has one (n,) array
    more than `homings` has values.
    """
    order = np.argsort(times, kind="stable")
    in_order, angles_in_order = np.array(times, dtype=np.float64)[order], np.array(angles, dtype=np.float64)[order]
    return np.split(angles_in_order, np.searchsorted(in_order, homings, side="right"))


def lost_steps_clause(runs: Sequence[FloatArray]) -> str | None:
    """Return a clause that names the angles that may be wrong after steps were lost in the last of `runs`.

    `runs` are the angles of `split_at_homings`. None if the last run has no reading.
    """
    run, total = runs[-1], sum(map(len, runs))
    if not len(run):
        return None
    first = first_unverified(run)
    doubtful = len(run) - first
    these = f"all {total}" if doubtful == total else f"the last {doubtful} of {total}"
    return f"{these} angles may be wrong, from {math.degrees(run[first]):.6g}° on"


def unverified_clause(runs: Sequence[FloatArray]) -> str | None:
    """Return a clause that names the angles before a homing that no mark verified. None if there are none.

    `runs` are the angles of `split_at_homings`.
    """
    doubtful = [run[first_unverified(run)] for run in runs[:-1] if len(run)]
    if not doubtful:
        return None
    count, total = sum(len(run) - first_unverified(run) for run in runs[:-1]), sum(map(len, runs))
    return (
        f"{count} of {total} angles, from {math.degrees(doubtful[0]):.6g}° on, could not be checked for lost steps: "
        "the turntable had to home again"
    )
