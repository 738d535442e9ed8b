"""Find the readings whose angles may be wrong because the turntable lost steps.

The turntable passes its zero mark once a turn. A device checks the mark whenever it turns counter-clockwise over it. It
has reported a misplaced or missing mark at the latest when it is MARK_OVERRUN past the mark. After a reset, or after a
long silence of the host, a device homes again. The error of the turntable before that homing is then unknown.
"""

import math
from collections.abc import Sequence

import numpy as np

from sonarhw.readings import FloatArray

MARK_APPROACH = math.radians(3)  # plus the backlash; enough for the table to move when the mark comes
MARK_OVERRUN = math.radians(6)
_BACKLASH = math.radians(3)  # of a gear whose backlash is unknown
_EXACT = 1e-6  # rad; less than a microstep


def nearest_mark(angle: float, lowest: float, highest: float) -> float | None:
    """Return the angle of the mark nearest to `angle`, rad. None if no mark lies between `lowest` and `highest`."""
    first, last = math.ceil(lowest / math.tau), math.floor(highest / math.tau)
    return None if first > last else min(max(round(angle / math.tau), first), last) * math.tau


def first_unverified(angles: FloatArray) -> int:
    """Return the index of the first reading after which the mark was not seen in its place.

    `angles`, (n,) rad, are those of the readings in the order in which they were made. The turntable was homed just
    before the first of them. Marks that are passed clockwise verify nothing.
    """
    run = unverified = 0  # `run`: index where the latest counter-clockwise movement began
    seen = -math.inf
    for index, angle in enumerate(angles):
        if index and angle < angles[index - 1]:
            run, seen = index, -math.inf
        mark = math.floor((angle - MARK_OVERRUN) / math.tau) * math.tau
        if mark > seen and mark >= angles[run] + MARK_APPROACH + _BACKLASH:
            seen, unverified = mark, run + int(np.searchsorted(angles[run:index], mark - _EXACT))
    return unverified


def split_at_homings(times: Sequence[float], angles: Sequence[float], homings: Sequence[float]) -> list[FloatArray]:
    """Return the angles (rad) of the readings made at `times` (s) in the order of time, split at each homing.

    `homings` are the times of the newest reading before each homing, in ascending order. The result has one (n,) array
    more than `homings` has values.
    """
    order = np.argsort(times, kind="stable")
    made, turned = np.array(times, dtype=np.float64)[order], np.array(angles, dtype=np.float64)[order]
    return np.split(turned, np.searchsorted(made, homings, side="right"))


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
    return f"{these} angles may be off, from {math.degrees(run[first]):.6g}° on"


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
