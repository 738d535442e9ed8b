"""The candidates of a fan and their sequences of surfaces, numbered in order of their first appearance. For kernels.

A sequence of surfaces is the number of the sequence without its last surface, and that surface; a candidate of a fan is
the number of its sequence, and its target. So both are found without a comparison of whole sequences. Pairs of numbers
are found by a hash table.
"""

from typing import NamedTuple

import numpy as np

from sonarhw_sim.compiled import array_part, compiled, compiled_part, inlined
from sonarhw_sim.rays import path_table
from sonarhw_sim.room.grid import IntArray

_ROOM = 4096  # rows at first
_SLOTS = 4  # for each row, at first, a power of two


class CandidateTable(NamedTuple):
    """Room for candidates and sequences."""

    candidates: IntArray  # (c, 3): number of the sequence, reflections before the target, row of the target
    keys: IntArray  # (c, 2): sequence and target
    slots: IntArray  # hash table of the keys, -1 where empty
    sequences: IntArray  # (s, 2): number of the sequence without the last surface, 0 for none, and that surface
    sequence_slots: IntArray


class Fan(NamedTuple):
    """What the rays of a fan come near to, and what they touched before."""

    touched: IntArray  # (r, b): sequences of surfaces, in order, padded with -1
    candidates: IntArray  # (c, 3): row of `touched`, reflections before the target, row of the target


def no_candidates() -> CandidateTable:
    """Return an empty table."""
    keys, sequences = np.empty((2, _ROOM, 2), np.int32)
    slots, sequence_slots = np.full((2, _SLOTS * _ROOM), -1, np.int32)
    return CandidateTable(np.empty((_ROOM, 3), np.int32), keys, slots, sequences, sequence_slots)


@inlined
def is_full(table: CandidateTable, found: int, known: int) -> bool:
    """Return whether there is no room for more than `found` candidates or `known` sequences."""
    full: bool = (found == table.candidates.shape[0]) | (known == table.sequences.shape[0])
    return full


@array_part
def with_room(table: CandidateTable, found: int, known: int) -> CandidateTable:
    """Return the same table with room for twice as many of what is full."""
    candidates, keys, slots, sequences, sequence_slots = table
    if found == candidates.shape[0]:
        candidates = _longer(candidates)
        keys, slots = _grown(keys, slots)
    if known == sequences.shape[0]:
        sequences, sequence_slots = _grown(sequences, sequence_slots)
    return CandidateTable(candidates, keys, slots, sequences, sequence_slots)


@compiled
def with_other(
    table: CandidateTable, found: int, known: int, other: CandidateTable, other_found: int, other_known: int
) -> tuple[CandidateTable, int, int]:
    """Return a table with those of another one behind its own, each once, and its numbers of candidates and sequences.

    The tables have so many `found` candidates and `known` sequences.
    """
    numbers = np.empty(other_known + 1, np.int32)  # in this table, of the sequences of the other
    numbers[0] = 0
    for k in range(other_known):
        if known == table.sequences.shape[0]:
            table = with_room(table, found, known)
        before, last = numbers[other.sequences[k, 0]], other.sequences[k, 1]
        numbers[k + 1] = number_of(before, last, table.sequences, known, table.sequence_slots) + 1
        known = max(known, numbers[k + 1])
    for k in range(other_found):
        if found == table.candidates.shape[0]:
            table = with_room(table, found, known)
        sequence, target = numbers[other.keys[k, 0]], other.keys[k, 1]
        if number_of(sequence, target, table.keys, found, table.slots) == found:
            table.candidates[found, 0], table.candidates[found, 1] = sequence, other.candidates[k, 1]
            table.candidates[found, 2] = target
            found += 1
    return table, found, known


def fan_of(table: CandidateTable, found: int, known: int, targets: int) -> Fan:
    """Return the candidates with their sequences, and the direct path to every target, which rays may miss.

    The table has so many `found` candidates and `known` sequences. Raises InputError if they need too much memory.
    """
    candidates = table.candidates[:found]
    deepest = int(candidates[:, 1].max(initial=0))
    path_table.check_size(found, deepest + 2)
    touched = _touched_before(table, found, known, deepest)
    by_rays = candidates[(candidates[:, 1] > 0) | (candidates[:, 2] == 0)]
    return Fan(touched, np.vstack((direct_candidates(targets), by_rays)))


def direct_candidates(targets: int) -> IntArray:
    """Return the candidates without reflections to every target but the receiver, which is row 0, (targets - 1, 3)."""
    direct = np.zeros((targets - 1, 3), dtype=np.int32)
    direct[:, 2] = np.arange(1, targets)
    return direct


@compiled
def _touched_before(table: CandidateTable, found: int, known: int, deepest: int) -> IntArray:
    """Return each sequence of the candidates, (r, deepest), padded with -1, and replace its number by its row.

    The table has so many `found` candidates and `known` sequences; `deepest` are the most reflections of a candidate.
    """
    rows, count = np.empty(known + 1, np.int32), 0
    for k in range(known + 1):
        rows[k] = -1
    touched = np.empty((max(found, 1), deepest), np.int32)  # the system gives memory only to rows that are filled
    for k in range(found):
        sequence, bounces = table.candidates[k, 0], table.candidates[k, 1]
        if rows[sequence] < 0:
            rows[sequence] = count
            for step in range(bounces, deepest):
                touched[count, step] = -1
            before = sequence
            for step in range(bounces - 1, -1, -1):
                touched[count, step] = table.sequences[before - 1, 1]
                before = table.sequences[before - 1, 0]
            count += 1
        table.candidates[k, 0] = rows[sequence]
    return touched[: max(count, 1)]


@compiled_part
def number_of(first: int, second: int, pairs: IntArray, count: int, slots: IntArray) -> int:
    """Return the number of a pair among the first `count` of `pairs` (p, 2); if it is new, `count`, and enter it."""
    slot = _hash(first, second) & (slots.shape[0] - 1)
    while slots[slot] >= 0:
        known = int(slots[slot])
        if pairs[known, 0] == first and pairs[known, 1] == second:
            return known
        slot = (slot + 1) & (slots.shape[0] - 1)
    slots[slot] = count
    pairs[count, 0], pairs[count, 1] = first, second
    return count


@array_part
def _grown(pairs: IntArray, slots: IntArray) -> tuple[IntArray, IntArray]:
    """Return twice as many rows for pairs, and a hash table with twice as many slots; all of `pairs` are entered."""
    count = pairs.shape[0]
    more, larger = np.empty((2 * count, 2), np.int32), np.empty(2 * slots.shape[0], np.int32)
    for k in range(larger.shape[0]):
        larger[k] = -1
    for k in range(count):
        number_of(pairs[k, 0], pairs[k, 1], more, k, larger)
    return more, larger


@inlined
def _longer(candidates: IntArray) -> IntArray:
    """Return the rows with twice the capacity; numba would need a second to compile a concatenation."""
    count = candidates.shape[0]
    more = np.empty((2 * count, 3), np.int32)
    for k in range(count):
        more[k, 0], more[k, 1], more[k, 2] = candidates[k, 0], candidates[k, 1], candidates[k, 2]
    return more


@inlined
def _hash(first: int, second: int) -> int:
    mixed: int = ((first + 1) * 2654435761 ^ (second + 1) * 2246822519) & 0xFFFFFFFF
    mixed ^= mixed >> 15
    return mixed
