"""How well a draft explains scans: the likelihood of a fit, for every echo and every silence, with all reflections."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import Place, Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.fit.likelihood.objective import Problem, make_problem
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.room_finding.draft import RoomDraft

REFLECTANCE = 0.9  # of found walls, assumed
FOLLOWED = PredictionOptions(rays=720, max_bounces=5)  # few rays, because every trial searches all paths
ROUGH = ReadingNoise(0.02, 2.0, 0.08, 0.03, 0.05)  # for walls not yet refined
FINE = ReadingNoise(0.01, 1.5, 0.05, 0.03, 0.03)


@dataclass(frozen=True)
class PoseSpread:
    """Standard deviations of a place; 0 is exact."""

    xy: float = 0.0  # m, of x and of y
    heading: float = 0.0  # rad


@dataclass(frozen=True)
class Evidence:
    """Scans and board, against which drafts are held."""

    problems: tuple[Problem, ...]  # one for each scan; room and place are those of the draft
    spreads: tuple[PoseSpread, ...]  # of the places of the first draft
    first: RoomDraft
    air: Air

    def log_likelihood(self, draft: RoomDraft, noise: ReadingNoise) -> float:
        """Return the log-likelihood of all scans plus the logarithm of the prior of their places."""
        return float(np.concatenate(self.by_reading(draft, noise)).sum()) + self.log_prior(draft)

    def by_reading(self, draft: RoomDraft, noise: ReadingNoise) -> list[FloatArray]:
        """Return the log-likelihood of each reading, (n,) for each scan."""
        room = draft.room(REFLECTANCE, self.air)
        return [self.of_scan(room, draft.places[scan], scan, noise) for scan in range(len(self.problems))]

    def of_scan(self, room: Room, place: Place, scan: int, noise: ReadingNoise) -> FloatArray:
        """Return the log-likelihood of each reading of one scan, (n,)."""
        problem = replace(self.problems[scan], room=room, places=(place,))
        values = problem.with_noise(np.empty(0), noise)
        return problem.near(values).by_reading(values, 0)

    def log_prior(self, draft: RoomDraft) -> float:
        """Return the logarithm of the prior of the places, 0 at those of the first draft."""
        errors = [error for scan in range(len(self.spreads)) for error in self.pose_errors(draft, scan)]
        return -0.5 * sum((away / spread) ** 2 for away, spread in errors if spread > 0)

    def pose_errors(self, draft: RoomDraft, scan: int) -> tuple[tuple[float, float], ...]:
        """Return how far x, y (m) and heading (rad) of a place have moved, each with its standard deviation."""
        spread, now, then = self.spreads[scan], draft.places[scan], self.first.places[scan]
        turned = math.remainder(now.heading - then.heading, math.tau)
        x, y = (at - first for at, first in zip(now.position, then.position, strict=True))
        return (x, spread.xy), (y, spread.xy), (turned, spread.heading)


@dataclass(frozen=True)
class Scored:
    """A draft and its log-likelihood."""

    draft: RoomDraft
    score: float


def scored(evidence: Evidence, draft: RoomDraft, noise: ReadingNoise = ROUGH) -> Scored:
    """Return a draft with its log-likelihood; -inf if a wall has no length."""
    return Scored(draft, evidence.log_likelihood(draft, noise) if draft.is_sound else -np.inf)


def evidence_of(scans: Sequence[PlacedScan], spreads: Sequence[PoseSpread], board: Board, air: Air) -> Evidence:
    """Return scans from places with these spreads as evidence."""
    first = RoomDraft(tuple(scan.place for scan in scans))
    nowhere = first.room(REFLECTANCE, air)
    problems = tuple(make_problem([scan], nowhere, board, [], FOLLOWED, True) for scan in scans)
    return Evidence(problems, tuple(spreads), first, air)
