"""The frame of a room: headings of scans solved together at written positions, and the room turned onto these.

A region of constant depth in a scan is a wall at right angles to its bearing, at the distance of its range. Scans at
known positions see the same walls if their headings are right. The agreement of two scans at all pairs of headings is
a sum over the directions of walls, so it needs no search. The headings of all scans are then those with the largest
sum of agreements.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board

from sonarhw.readings import FloatArray, angle_difference
from sonarhw_compare.arcs import OTHER_PLACE, POSSIBLE, Arc, arcs_of
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import WRITTEN, PoseSpread, determine_headings
from sonarhw_compare.rooms.draft import RoomDraft, long_direction
from sonarhw_compare.rooms.evidence import Evidence

# Headings of all scans together.


SOLVED = math.radians(7)  # standard deviation of a solved heading; in real scans, errors up to 20°
_SURE = 0.03  # of the agreement with each other scan, by which a heading is better than those over 30° away
_COUNT = 120  # headings, 3° apart
_CELL, _BLUR = 0.03, 0.04  # m: step of distances, and standard deviation of a range
_FARTHEST = 6.0  # m, of a range
_NARROWEST, _WIDE = math.radians(4), math.radians(10)  # of a bearing; width of an arc that counts in full
_STARTS = 4  # pairs of headings of two scans, from which all headings are solved
_AGREEMENT = 15.0  # log-likelihood of one scan that agrees with another one entirely
_ROUNDS = 30
_ELSEWHERE = math.radians(30)  # from a heading to another solution
_HEADINGS: FloatArray = np.linspace(0.0, math.tau, _COUNT, endpoint=False)


def with_solved_headings(
    scans: Sequence[PlacedScan],
    spreads: Sequence[PoseSpread],
    board: Board,
    rough: float,
    tick: Callable[[float], None] = lambda _share: None,
) -> tuple[tuple[PlacedScan, ...], tuple[PoseSpread, ...]]:
    """Return scans and spreads with headings that are not known within `rough` (rad) solved from all scans together.

    Only scans at known positions take part. What is known of a heading is its prior. A heading stays as it is if
    another one agrees almost as well with the other scans. `tick` receives the completed share, 0..1. Nothing changes
    if all headings are known, or fewer than three positions are.
    """
    rows = [row for row, spread in enumerate(spreads) if spread.xy <= WRITTEN]
    wide = [row for row in rows if spreads[row].heading > rough]
    if not wide or not determine_headings(spreads):
        return tuple(scans), tuple(spreads)
    agreement = _Agreement(
        tuple(replace(scans[row], place=replace(scans[row].place, heading=0.0)) for row in rows),
        tuple(_heading_prior(scans[row].place.heading, spreads[row].heading) for row in rows),
        board,
    )
    solved = agreement.best(tick)
    if sum(is_sure for _, is_sure in solved) < 2:
        solved = [(heading, True) for heading, _ in solved]
    placed, narrowed = list(scans), list(spreads)
    for row, (heading, is_sure) in zip(rows, solved, strict=True):
        if row in wide and is_sure:
            placed[row] = replace(scans[row], place=replace(scans[row].place, heading=heading))
            narrowed[row] = replace(spreads[row], heading=SOLVED)
    return tuple(placed), tuple(narrowed)


def _heading_prior(heading: float, deviation: float) -> FloatArray:
    """Return the log-prior of each of the headings, (h,), in units of agreement."""
    if not math.isfinite(deviation):
        return np.zeros(_COUNT)
    away = angle_difference(_HEADINGS, heading) / math.hypot(deviation, math.tau / _COUNT)
    return np.asarray(-0.5 * away**2 / _AGREEMENT)


@dataclass(frozen=True)
class _Agreement:
    """How well scans agree at each combination of headings."""

    scans: tuple[PlacedScan, ...]  # at heading 0
    priors: tuple[FloatArray, ...]  # (h,) each
    board: Board

    @cached_property
    def _evidence(self) -> list[NDArray[np.float32]]:
        """Evidence of a wall by turntable angle and distance, (h, d), for each scan; its squares add up to 1."""
        farthest = max((arc.range for arc in self._arcs), default=0.0) + 4 * _BLUR
        distances = np.arange(0.0, min(farthest, _FARTHEST), _CELL)
        by_scan = [[arc for arc in self._arcs if arc.scan == row] for row in range(len(self.scans))]
        several = [_wall_evidence(arcs, distances) for arcs in by_scan]
        return [(evidence / max(float(np.sqrt((evidence**2).sum())), 1e-9)).astype(np.float32) for evidence in several]

    @cached_property
    def _arcs(self) -> tuple[Arc, ...]:
        return arcs_of(self.scans, self.board, POSSIBLE)

    def best(self, tick: Callable[[float], None]) -> list[tuple[float, bool]]:
        """Return the headings (rad) with which the scans agree best, and whether each is clearly better than others."""
        count = len(self.scans)
        pairs: dict[tuple[int, int], FloatArray] = {}
        several = [(one, other) for one in range(count) for other in range(one + 1, count)]
        for done, (one, other) in enumerate(several):
            tick(done / len(several))
            by_heading = self._of_pair(one, other)
            pairs[one, other], pairs[other, one] = by_heading, by_heading.T
        results = [
            self._climbed(pairs, {one: first, other: second})
            for one, other in several
            for first, second in _tops(pairs[one, other] + self.priors[one][:, None] + self.priors[other])
        ]
        _, rows = max(results, key=lambda result: result[0])
        return [
            (float(angle_difference(_HEADINGS[row], 0.0)), self._is_sure(pairs, rows, scan))
            for scan, row in enumerate(rows)
        ]

    def _is_sure(self, pairs: dict[tuple[int, int], FloatArray], rows: Sequence[int], scan: int) -> bool:
        others = [other for other in range(len(rows)) if other != scan]
        by_heading = self.priors[scan] + sum(pairs[scan, other][:, rows[other]] for other in others)
        far = np.abs(angle_difference(_HEADINGS, _HEADINGS[rows[scan]])) > _ELSEWHERE
        return bool(by_heading[rows[scan]] - by_heading[far].max() >= _SURE * len(others))

    def _of_pair(self, one: int, other: int) -> FloatArray:
        """Return the agreement of two scans at each pair of their headings, (h, h)."""
        evidence, of_other = self._evidence[one], self._evidence[other]
        between = np.subtract(self.scans[other].place.position, self.scans[one].place.position)
        agreement, rows = np.zeros((_COUNT, _COUNT), np.float32), np.arange(_COUNT)
        if float(np.hypot(*between)) < OTHER_PLACE:  # at one place, both see all surfaces at the same distances
            between = np.zeros(2)
        normals = np.column_stack((np.cos(_HEADINGS), np.sin(_HEADINGS)))
        shifted = np.concatenate([_shifted(of_other, nearer) for nearer in (normals @ between / _CELL).tolist()])
        # in one product: many small ones take ten times as long on several cores
        by_angle = (evidence @ shifted.T).reshape(_COUNT, _COUNT, _COUNT)
        for towards in range(_COUNT):
            angles = (towards - rows) % _COUNT
            agreement += by_angle[:, towards][np.ix_(angles, angles)]
        return agreement.astype(np.float64)

    def _climbed(
        self, pairs: dict[tuple[int, int], FloatArray], fixed: dict[int, int]
    ) -> tuple[float, tuple[int, ...]]:
        """Return the sum of all agreements, and rows of headings, from those of some scans on."""
        rows = dict(fixed)

        def of_scan(scan: int) -> FloatArray:
            return self.priors[scan] + sum(pairs[scan, other][:, row] for other, row in rows.items() if other != scan)

        for _ in range(_ROUNDS):
            before = dict(rows)
            for scan in range(len(self.scans)):
                rows[scan] = int(of_scan(scan).argmax())
            if rows == before:
                break
        found = tuple(rows[scan] for scan in range(len(self.scans)))
        prior = sum(float(prior[row]) for prior, row in zip(self.priors, found, strict=True))
        total = sum(float(pairs[one, other][found[one], found[other]]) for one, other in pairs) / 2
        return total + prior, found


def _wall_evidence(arcs: Sequence[Arc], distances: FloatArray) -> FloatArray:
    """Return the evidence of a wall at each bearing and distance (d,) m, (h, d), of arcs of one scan."""
    evidence = np.zeros((_COUNT, len(distances)))
    for arc in arcs:
        away = angle_difference(_HEADINGS, arc.bearing) / max(_NARROWEST, 0.7 * arc.half_width)
        weight = min(1.0, 2 * arc.half_width / _WIDE)
        near = (distances - arc.range) / _BLUR
        evidence = np.maximum(evidence, weight * np.exp(-0.5 * away[:, None] ** 2 - 0.5 * near**2))
    return evidence


def _shifted(evidence: NDArray[np.float32], cells: float) -> NDArray[np.float32]:
    """Return evidence with distances that are larger by some cells; between whole cells, the mean of both."""
    whole = math.floor(cells)
    share = cells - whole
    return (1 - share) * _shifted_whole(evidence, whole) + share * _shifted_whole(evidence, whole + 1)


def _shifted_whole(evidence: NDArray[np.float32], cells: int) -> NDArray[np.float32]:
    moved, count = np.zeros_like(evidence), evidence.shape[1]
    if abs(cells) < count:
        moved[:, max(cells, 0) : count + min(cells, 0)] = evidence[:, max(-cells, 0) : count - max(cells, 0)]
    return moved


def _tops(agreement: FloatArray) -> list[tuple[int, int]]:
    """Return the pairs of rows with the largest agreement, none near another one."""
    left, tops = agreement.copy(), []
    near = np.arange(-_COUNT // 18, _COUNT // 18 + 1)
    for _ in range(_STARTS):
        one, other = np.unravel_index(int(left.argmax()), left.shape)
        tops.append((int(one), int(other)))
        left[np.ix_((one + near) % _COUNT, (other + near) % _COUNT)] = -math.inf
    return tops


# The room turned and moved as a whole: no range shows this, so only what is known of the poses decides it. Positions
# are mostly measured along walls, so walls are expected along the axes. This is an assumption.


_TURNS = np.radians(np.arange(-30.0, 30.01, 0.05))
_ALONG_AXES, _AXIS_SD = 0.8, math.radians(0.7)  # probability, and standard deviation of the walls from the axes


def in_frame(evidence: Evidence, draft: RoomDraft) -> RoomDraft:
    """Return the draft turned and moved as a whole to where its places and the directions of walls are most probable.

    A pose of which position or heading is exact fixes the draft, and so do walls of a first draft.
    """
    spreads = evidence.spreads
    if evidence.first.walls or any(spread.xy == 0 or spread.heading == 0 for spread in spreads):
        return draft
    errors = [evidence.pose_errors(draft, scan) for scan in range(len(spreads))]
    found = np.array([place.position for place in draft.places])
    written = found - np.array([[error for error, _ in of_scan[:2]] for of_scan in errors])
    weights = np.array([1 / spread.xy**2 for spread in spreads])
    turned, by_turn = np.array([of_scan[2] for of_scan in errors]).T
    if not weights.any():
        return draft
    middle, target = (weights @ points / weights.sum() for points in (found, written))
    rotations = np.array([[[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]] for turn in _TURNS])
    away = np.einsum("tij,sj->tsi", rotations, found - middle) - (written - target)
    losses = (away**2).sum(axis=2) @ weights + (((_TURNS[:, None] + turned) / by_turn) ** 2).sum(axis=1)
    if draft.walls:
        losses -= 2 * _log_along_axes(long_direction(draft) + _TURNS)
    turn = float(_TURNS[int(losses.argmin())])
    return draft.turned(turn, (float(middle[0]), float(middle[1])), (float(target[0]), float(target[1])))


def _log_along_axes(directions: FloatArray) -> FloatArray:
    """Return the logarithm of the prior of the direction of the walls of a room (rad), (n,)."""
    away = np.remainder(directions + math.pi / 4, math.pi / 2) - math.pi / 4
    along = np.exp(-0.5 * (away / _AXIS_SD) ** 2) / (_AXIS_SD * math.sqrt(math.tau))
    return np.asarray(np.log(_ALONG_AXES * along + (1 - _ALONG_AXES) / (math.pi / 2)))
