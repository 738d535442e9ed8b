"""The candidates of a fan, each sequence of surfaces to a target once: growing arrays and a hash table. For kernels."""

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.compiled import compiled_part, inlined
from sonarhw_sim.room.grid import IntArray

FULL = 0.5  # share of a hash table's slots in use at which it grows


@inlined
def longer(candidates: IntArray, misses: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return both arrays with twice the capacity; numba would need a second to compile a concatenation."""
    count = misses.shape[0]
    more, more_misses = np.empty((2 * count, 3), np.int32), np.empty(2 * count)
    for k in range(count):
        more[k, 0], more[k, 1], more[k, 2] = candidates[k, 0], candidates[k, 1], candidates[k, 2]
        more_misses[k] = misses[k]
    return more, more_misses


@compiled_part
def add_last(candidates: IntArray, misses: FloatArray, touched: IntArray, slots: IntArray) -> bool:
    """Enter the last candidate in the hash table, unless an earlier one has the same sequence and target.

    Returns whether it is new. Of equal candidates, the ray that passes nearest in widths of its tube (`misses`) is
    kept: where posts spread the tube, only that ray leads to the exact path.
    """
    last = candidates.shape[0] - 1
    slot = _hash(candidates[last], touched) & (slots.shape[0] - 1)
    while slots[slot] >= 0:
        known = slots[slot]
        if _alike(candidates[known], candidates[last], touched):
            if misses[last] < misses[known]:
                candidates[known, 0], misses[known] = candidates[last, 0], misses[last]
            return False
        slot = (slot + 1) & (slots.shape[0] - 1)
    slots[slot] = last
    return True


@inlined
def grown(slots: IntArray, candidates: IntArray, misses: FloatArray, touched: IntArray) -> IntArray:
    """Return a hash table with four times as many slots and all candidates in it."""
    larger = np.empty(4 * slots.shape[0], np.int32)
    for k in range(larger.shape[0]):
        larger[k] = -1
    for count in range(1, candidates.shape[0] + 1):
        add_last(candidates[:count], misses, touched, larger)
    return larger


@inlined
def _hash(candidate: IntArray, touched: IntArray) -> int:
    ray, bounces, target = candidate
    # targets and surfaces have similar numbers, so the target is scrambled first to avoid collisions
    mixed: int = ((target + 1) * 2654435761) & 0xFFFFFFFF
    mixed ^= mixed >> 15
    for surface in touched[ray, :bounces]:
        # the multiplier of FNV-1a
        mixed = ((mixed ^ (surface + 1)) * 16777619) & 0xFFFFFFFF
        mixed ^= mixed >> 15
    return mixed


@compiled_part
def _alike(one: IntArray, other: IntArray, touched: IntArray) -> bool:
    if one[1] != other[1] or one[2] != other[2]:
        return False
    same = 0
    while same < one[1] and touched[one[0], same] == touched[other[0], same]:
        same += 1
    return bool(same == one[1])
