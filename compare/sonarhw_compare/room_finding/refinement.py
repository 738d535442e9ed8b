"""Refinement of a draft: walls, posts and uncertain places move to where the scans are most likely.

Each step solves the normal equations of the gradients of all readings (Berndt, Hall, Hall and Hausman, Estimation and
Inference in Nonlinear Structural Models, 1974). The inverse of their matrix is the covariance.
"""

import math
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from sonarhw_sim.room.model import Place

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.room_finding.draft import DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.room_finding.evidence import REFLECTANCE, Evidence

_LENGTH, _TURN = 0.002, math.radians(0.2)  # m, rad: steps of the differences
_DAMPING = 1e-3  # of the normal equations in steps, for values that no reading determines
_MOST = 5.0  # steps by which a value moves at once
_HALVINGS = 4
_ENOUGH = 0.2  # log-likelihood; a smaller gain ends the refinement
_THINNEST = 0.005  # m, radius of a post


@dataclass(frozen=True)
class Move:
    """A way to change a draft: a part of a wall, of a post, or of the place of a scan."""

    what: str  # "wall", "post" or "place"
    which: int  # key of the wall, or number of the post or scan
    part: int  # wall: to its left, turned, first and second end along it; post: x, y, radius; place: x, y, heading
    step: float  # m or rad, changes the likelihood clearly

    def of(self, draft: RoomDraft, by: float) -> RoomDraft:
        """Return the draft changed by `by` (m or rad)."""
        match self.what:
            case "wall":
                return draft.with_wall(self.which, _moved_wall(draft, self.which, self.part, by))
            case "post":
                posts = list(draft.posts)
                values = [*posts[self.which].center, posts[self.which].radius]
                values[self.part] += by
                posts[self.which] = DraftPost((values[0], values[1]), max(values[2], _THINNEST))
                return replace(draft, posts=tuple(posts))
            case _:
                places = list(draft.places)
                places[self.which] = _moved_place(places[self.which], self.part, by)
                return replace(draft, places=tuple(places))


def _moved_wall(draft: RoomDraft, key: int, part: int, by: float) -> DraftWall:
    wall = draft.walls[key]
    if part < 2:
        return wall.moved(by, 0.0) if part == 0 else wall.moved(0.0, by)
    return wall.with_end(part - 2, DraftEnd(draft.extent(key)[part - 2] + by))


def _moved_place(place: Place, part: int, by: float) -> Place:
    if part == 2:
        return replace(place, heading=place.heading + by)
    x, y = place.position
    return replace(place, position=(x + by, y) if part == 0 else (x, y + by))


def moves_of(evidence: Evidence, draft: RoomDraft) -> list[Move]:
    """Return all ways to change a draft: walls, posts, then the uncertain places."""
    moves = [Move("wall", key, part, step) for key in draft.walls for part, step in ((0, _LENGTH), (1, _TURN))]
    moves += [Move("wall", key, 2 + end, _LENGTH) for key in draft.walls for end in (0, 1) if draft.is_free(key, end)]
    moves += [Move("post", row, part, _LENGTH) for row in range(len(draft.posts)) for part in range(3)]
    for scan, spread in enumerate(evidence.spreads):
        moves += [Move("place", scan, part, _LENGTH) for part in (0, 1) if spread.xy > 0]
        moves += [Move("place", scan, 2, _TURN)] if spread.heading > 0 else []
    return moves


@dataclass(frozen=True)
class Refined:
    """A refined draft with its uncertainties."""

    draft: RoomDraft
    score: float
    deviations: dict[Move, float]  # standard deviation by each move, m or rad


def refined(evidence: Evidence, draft: RoomDraft, noise: ReadingNoise, steps: int, by_parts: bool = False) -> Refined:
    """Return the draft after at most `steps` steps; with `by_parts`, single walls, posts and places move, too.

    The likelihood is rough, so a step of all values at once can fail where one of a single wall or place climbs.
    """
    moves = moves_of(evidence, draft)
    sizes = np.array([move.step for move in moves])
    score, information = evidence.log_likelihood(draft, noise), np.eye(len(moves)) * _DAMPING
    for _ in range(steps):
        information, slopes = _normal_equations(evidence, draft, moves, noise)
        before = score
        for part in [moves, *(_parts(moves) if by_parts else [])]:
            rows = [moves.index(move) for move in part]
            ascent = np.linalg.solve(information[np.ix_(rows, rows)], slopes[rows])
            ascent = np.clip(ascent, -_MOST, _MOST) * sizes[rows]
            draft, score = _climbed(evidence, draft, part, ascent, score, noise)
            if part is moves and score - before >= _ENOUGH:
                break
        if score - before < _ENOUGH:
            break
    deviations = np.sqrt(np.diag(np.linalg.inv(information))) * sizes
    return Refined(draft, score, dict(zip(moves, deviations.tolist(), strict=True)))


def _parts(moves: list[Move]) -> list[list[Move]]:
    """Return the moves of each wall, post and place."""
    return [list(part) for _, part in groupby(moves, lambda move: (move.what, move.which))]


def _normal_equations(
    evidence: Evidence, draft: RoomDraft, moves: list[Move], noise: ReadingNoise
) -> tuple[FloatArray, FloatArray]:
    """Return the information matrix and the slope of the log-posterior, for steps of each move."""
    changes = np.array([_changes(evidence, draft, move, noise) for move in moves])
    information, slopes = changes @ changes.T + _DAMPING * np.eye(len(moves)), changes.sum(axis=1)
    for row, move in enumerate(moves):
        if move.what == "place":
            away, spread = evidence.pose_errors(draft, move.which)[move.part]
            information[row, row] += (move.step / spread) ** 2
            slopes[row] -= away * move.step / spread**2
    return information, slopes


def _changes(evidence: Evidence, draft: RoomDraft, move: Move, noise: ReadingNoise) -> FloatArray:
    """Return the change of the log-likelihood of each reading by one step, (n,)."""
    ahead, behind = (move.of(draft, by) for by in (move.step, -move.step))
    if move.what != "place":
        differences = zip(evidence.by_reading(ahead, noise), evidence.by_reading(behind, noise), strict=True)
        return np.concatenate([(one - other) / 2 for one, other in differences])
    room = draft.room(REFLECTANCE, evidence.air)
    parts = [np.zeros(len(problem.scans[0].angles)) for problem in evidence.problems]
    one, other = (evidence.of_scan(room, at.places[move.which], move.which, noise) for at in (ahead, behind))
    parts[move.which] = (one - other) / 2
    return np.concatenate(parts)


def _climbed(
    evidence: Evidence, draft: RoomDraft, moves: list[Move], ascent: FloatArray, score: float, noise: ReadingNoise
) -> tuple[RoomDraft, float]:
    """Return the draft after a step that increases the log-posterior, or as it is, and its log-posterior."""
    for halving in range(_HALVINGS):
        moved = draft
        for move, by in zip(moves, (ascent / 2**halving).tolist(), strict=True):
            moved = move.of(moved, by)
        found = evidence.log_likelihood(moved, noise) if moved.is_sound else -np.inf
        if found > score:
            return moved, found
    return draft, score
