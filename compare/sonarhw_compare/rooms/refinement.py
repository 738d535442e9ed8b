"""Values of a draft: its threshold, headings, walls, posts and places, refined to where they explain scans best."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room

from sonarhw.readings import FloatArray, angle_difference
from sonarhw_compare.fit.likelihood import ReadingNoise
from sonarhw_compare.fit.parameters import free_parameters
from sonarhw_compare.match import TOLERANCE
from sonarhw_compare.regions import mean_run
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft, pulls
from sonarhw_compare.rooms.evidence import (
    FINE,
    FOLLOWED,
    ROUGH,
    Evidence,
    Scored,
    all_scored,
    as_found,
)

# The threshold of the sensor of a draft, from the likelihood of the readings: of a population, the scans show one.


_THRESHOLD_STEPS = (2.0, 1.0, 0.5)  # dB, in turn, of the threshold that is searched
_BESIDE = np.arange(-6.0, 7.0)  # dB from the found threshold, at which its probability is computed
_LEAST_THRESHOLD = 0.5  # dB, least standard deviation


def with_threshold(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with the threshold that explains most, up to 3.5 dB from the present one.

    If the profile states no spread of the threshold, it is exact.
    """
    for step in _THRESHOLD_STEPS if evidence.threshold_spread > 0 else ():
        now = best.draft.threshold_db
        tried = [replace(best.draft, threshold_db=now + by) for by in (step, -step)]
        best = max([best, *all_scored(evidence, tried)], key=lambda draft: draft.score)
    return best


def threshold_deviation(evidence: Evidence, draft: RoomDraft) -> float | None:
    """Return the standard deviation of the threshold of a draft, dB; None if the profile states that it is exact.

    Neighbouring readings of one echo count as one.
    """
    if evidence.threshold_spread == 0:
        return None
    drafts = [replace(draft, threshold_db=draft.threshold_db + by) for by in _BESIDE.tolist()]
    likelihoods = np.zeros(len(drafts))
    for row, other in enumerate(drafts):
        for problem, readings in zip(evidence.problems, evidence.by_reading(other, ROUGH), strict=True):
            arrays = problem.scans[0]
            likelihoods[row] += readings.sum() / mean_run(arrays.angles, arrays.ranges[:, 0])
    return _moments(_BESIDE, likelihoods + [evidence.log_prior(other) for other in drafts], _LEAST_THRESHOLD)[1]


def _moments(values: FloatArray, logarithms: FloatArray, least: float) -> tuple[float, float]:
    """Return mean and standard deviation of values (n,) with these logarithms of their probabilities, (n,).

    `least` is a standard deviation from another source, for example the step between the values.
    """
    weights = softmax(logarithms)
    mean = float(weights @ values)
    return mean, math.hypot(math.sqrt(float(weights @ (values - mean) ** 2)), least)


# The error of the heading of a scan in a draft, from the likelihood of its readings at headings near the present one.
#
# An echo begins and ends at headings that depend on its level, so the readings at both sides of all echoes determine
# a heading ten times better than the middles of the echoes do.


_STEP = math.radians(0.25)  # between the headings that are tried
_LEAST_TURN, _MOST_HEADING_TURN = math.radians(6), math.radians(12)  # to each side
_TURN = 2.0  # to each side, standard deviations of the heading; more is reached in several steps of a refinement
_LEAST_HEADING_ERROR = math.radians(0.2)  # least standard deviation


def heading_error(evidence: Evidence, draft: RoomDraft, room: Room, scan: int) -> tuple[float, float]:
    """Return the angle by which the heading of a scan is too small (rad), and its standard deviation.

    `room` is that of the draft. Neighbouring readings of one echo count as one.
    """
    board, place = as_found(evidence.problems[scan].board, draft), draft.places[scan]
    problem = evidence.of_draft(draft, room, scan, free_parameters(("heading",), ("",), room, board))
    turns = _turns(evidence.spreads[scan].heading)
    here = problem.with_noise(np.array([place.heading]), ROUGH)
    values = np.tile(here, (len(turns), 1))
    values[:, 0] += turns
    arrays = problem.scans[0]
    likelihoods = problem.near(here).many(values)
    return _moments(turns, likelihoods / mean_run(arrays.angles, arrays.ranges[:, 0]), _LEAST_HEADING_ERROR)


def _turns(spread: float) -> FloatArray:
    """Return the angles (rad) by which a heading with this standard deviation (rad) is turned, (n,)."""
    steps = round(min(max(_LEAST_TURN, _TURN * spread), _MOST_HEADING_TURN) / _STEP)
    return np.asarray(np.arange(-steps, steps + 1) * _STEP)


# Ways to change a draft: parts of its walls, posts and uncertain places.


_LENGTH_STEP, _TURN_STEP = 0.002, math.radians(0.2)  # m, rad: steps of the differences
_THINNEST = 0.005  # m, radius of a post


class Move(NamedTuple):
    """A way to change a draft: a part of a wall, of a post, of the place of a scan, or the range offset."""

    what: str  # "wall", "post", "place" or "offset"
    which: int  # key of the wall, or number of the post or scan
    part: int  # wall: to its left, turned, first and second end along it; post: x, y, radius; place: x, y, heading

    def is_of(self, what: str, which: int) -> bool:
        """Return whether a wall, post or place is changed."""
        return (self.what, self.which) == (what, which)

    @property
    def is_turn(self) -> bool:
        """Whether the change is an angle."""
        return self.part == {"wall": 1, "place": 2}.get(self.what)

    @property
    def step(self) -> float:
        """A small change, m or rad."""
        return _TURN_STEP if self.is_turn else _LENGTH_STEP

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
            case "offset":
                return replace(draft, offset=draft.offset + by)
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
    moves = [Move("wall", key, part) for key in draft.walls for part in (0, 1)]
    moves += [Move("wall", key, 2 + end) for key in draft.walls for end in (0, 1) if draft.is_free(key, end)]
    moves += [Move("post", row, part) for row in range(len(draft.posts)) for part in range(3)]
    for scan, spread in enumerate(evidence.spreads):
        moves += [Move("place", scan, part) for part in (0, 1) if spread.xy > 0]
        moves += [Move("place", scan, 2)] if spread.heading > 0 else []
    return [*moves, Move("offset", 0, 0)] if evidence.offset_spread > 0 else moves


# Errors of the readings that a draft explains, and their derivatives by its walls, posts and places.
#
# If the points that a path touches move, its length changes to first order by the sum of their moves, each times the
# difference of the unit vectors of the legs that meet there (Fermat's principle). No path is therefore searched
# again. A heading follows from bearings only: neighbouring readings of one echo are centred about the direction of
# its path.


BEARING = math.radians(2)  # standard deviation of the mean heading of the readings of one path
_LEAST_READINGS = 3  # of a path, for a bearing
_ON = 1e-6  # m


@dataclass(frozen=True)
class RangeErrors:
    """Errors of n ranges, bearings and headings, in standard deviations, and their derivatives by m moves."""

    errors: FloatArray  # (n,), measured minus predicted; ranges by scan and reading, then bearings, then headings
    slopes: FloatArray  # (n, m), of the predictions, by m or rad
    arcs: NDArray[np.intp]  # (of_range,): number of the scan and path of each range, from 0 on
    of_range: int  # the first so many rows are ranges
    of_heading: int  # the last so many rows are headings


@dataclass(frozen=True)
class Shifts:
    """Derivatives of walls and posts by each of m moves."""

    segments: FloatArray  # (w, 4) m, of the draft
    posts: FloatArray  # (p, 3) m
    of_segments: FloatArray  # (m, w, 4)
    of_posts: FloatArray  # (m, p, 3)
    turns: FloatArray  # (m, w), of the direction of each wall

    def of_point(self, point: FloatArray) -> FloatArray | None:
        """Return the derivative of a point of a wall or post, (m, 2); None if it lies on none of them."""
        wall, share = self.wall_at(point)
        if wall is not None:
            moved = self.of_segments[:, wall]
            return np.asarray((1 - share) * moved[:, :2] + share * moved[:, 2:])
        for row, (x, y, radius) in enumerate(self.posts.tolist()):
            away = point - (x, y)
            if abs(math.hypot(*away) - radius) < _ON:
                return np.asarray(self.of_posts[:, row, :2] + self.of_posts[:, row, 2:] * (away / radius))
        return None

    def wall_at(self, point: FloatArray) -> tuple[int | None, float]:
        """Return the wall on which a point lies, and at which share of its length; None if it lies on none."""
        if not len(self.segments):
            return None, 0.0
        along, away = self.segments[:, 2:] - self.segments[:, :2], point - self.segments[:, :2]
        squares = (along**2).sum(axis=1)
        share = (away * along).sum(axis=1) / squares
        beside = np.abs(away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]) / np.sqrt(squares)
        beyond = np.maximum(np.abs(share - 0.5) - 0.5, 0.0) * np.sqrt(squares)
        wall = int(np.argmin(beside + beyond))
        return (wall, float(share[wall])) if beside[wall] + beyond[wall] < _ON else (None, 0.0)

    def of_length(self, outline: FloatArray, ends: tuple[FloatArray, FloatArray] | None = None) -> FloatArray:
        """Return the derivative of the length of a path with these points, (k, 2) m, by each move, (m,).

        `ends` are the derivatives of its ends, (m, 2) each; without them, they do not move.
        """
        legs = np.diff(outline, axis=0)
        # two reflections in a corner are one point, which moves with the corner
        separate = np.append(True, np.hypot(*legs.T) > _ON)
        outline, legs = outline[separate], legs[separate[1:]]
        units = legs / np.hypot(*legs.T)[:, None]
        slope = np.zeros(len(self.turns)) if ends is None else ends[1] @ units[-1] - ends[0] @ units[0]
        for point, before, behind in zip(outline[1:-1], units[:-1], units[1:], strict=True):
            moved = self.of_point(point)
            if moved is not None:
                slope = slope + moved @ (before - behind)
        return np.asarray(slope)


def range_errors(
    evidence: Evidence, draft: RoomDraft, moves: Sequence[Move], with_headings: bool = False
) -> RangeErrors:
    """Return the errors of the readings within 5 cm of their predicted echo, and if wanted those of the headings."""
    with_headings = with_headings and evidence.has_free_headings
    shifts = shifts_of(draft, moves)
    parts = evidence.in_processes(_of_scans, range(len(evidence.problems)), draft, moves, shifts, with_headings)
    ranges = [row for part in parts for row in part.ranges]
    bearings = [row for part in parts for row in part.bearings]
    headings = [row for part in parts for row in part.headings]
    paths = [(scan, path) for scan, part in enumerate(parts) for path in part.paths]
    arcs = np.unique(np.array(paths, dtype=np.intp).reshape(-1, 2), axis=0, return_inverse=True)[1].reshape(-1)
    rows = [*ranges, *bearings, *headings]
    errors = np.array([error for error, _ in rows])
    slopes = np.array([slope for _, slope in rows]).reshape(len(rows), len(moves))
    return RangeErrors(errors, slopes, arcs, len(ranges), len(headings))


Row = tuple[float, FloatArray]  # an error and its derivatives


class _Errors(NamedTuple):
    """Errors of one scan."""

    ranges: list[Row]
    paths: list[int]  # of the ranges
    bearings: list[Row]
    headings: list[Row]


def _of_scans(
    evidence: Evidence,
    scans: Sequence[int],
    draft: RoomDraft,
    moves: Sequence[Move],
    shifts: Shifts,
    with_headings: bool,
) -> list[_Errors]:
    """Return the errors of ranges, of bearings and of the heading of each scan."""
    room, errors = draft.room(evidence.air), []
    for scan in scans:
        ranges, paths, bearings, turns = _of_scan(evidence, draft, scan, room, moves, shifts)
        headings = [_of_heading(heading_error(evidence, draft, room, scan), turns)] if with_headings and turns else []
        errors.append(_Errors(ranges, paths, bearings, headings))
    return errors


def _of_scan(
    evidence: Evidence, draft: RoomDraft, scan: int, room: Room, moves: Sequence[Move], shifts: Shifts
) -> tuple[list[Row], list[int], list[Row], list[FloatArray]]:
    """Return the errors of ranges with their paths, those of bearings, and the derivatives of each bearing."""
    board, arrays = as_found(evidence.problems[scan].board, draft), evidence.problems[scan].scans[0]
    place = board.faced(draft.places[scan])
    headings = np.asarray(place.heading + board.turned(arrays.angles))
    predicted = predict_scan(room, place, board, headings, FOLLOWED)
    measured = np.where(arrays.counts > 0, arrays.ranges[:, 0], np.nan)
    residuals = measured - predicted.ranges
    of_offset = np.array([float(move.what == "offset") for move in moves])
    explained = np.abs(residuals) <= TOLERANCE  # False where there is no echo
    slopes: dict[int, FloatArray] = {}
    bearings: list[Row] = []
    of_heading = np.array([float(move.is_of("place", scan) and move.part == 2) for move in moves])
    turns: list[FloatArray] = []
    for path in np.unique(predicted.winners[explained]).tolist():
        outline = predicted.paths.outline(path)
        ends = _end_shifts(draft, scan, moves, outline)
        slopes[path] = (shifts.of_length(outline, ends) / 2 + of_offset) / FINE.range
        turned = _bearing_slope(predicted, path, ends[0], shifts)
        away = angle_difference(headings, predicted.paths.departures[path])
        own = explained & (predicted.winners == path)
        mean = None if turned is None else _middle(away, own, measured)
        if turned is not None:
            turned = turned - of_heading
            turns += [turned] * int(own.sum())
            bearings += [] if mean is None else [(mean / BEARING, turned / BEARING)]
    rows = np.flatnonzero(explained)
    paths = predicted.winners[rows].tolist()
    ranges = [(float(residuals[row]) / FINE.range, slopes[path]) for row, path in zip(rows, paths, strict=True)]
    return ranges, paths, bearings, turns


def _of_heading(error: tuple[float, float], turns: Sequence[FloatArray]) -> Row:
    """Return the error of a heading, whose deviation is known, with the mean derivative of its bearings."""
    away, deviation = error
    return -away / deviation, np.asarray(np.mean(turns, axis=0) / deviation)


def _middle(away: FloatArray, own: NDArray[np.bool_], measured: FloatArray) -> float | None:
    """Return the mean angle (rad) between the `own` readings and the direction of their path, from -π..π `away` (n,).

    Where a nearer echo ends these readings, they are not centred about that direction: the answer is None.
    """
    if own.sum() < _LEAST_READINGS:
        return None
    order = np.argsort(away, kind="stable")
    rows = np.flatnonzero(own[order])
    beside = order[[rows[0] - 1, (rows[-1] + 1) % len(order)]]
    if (measured[beside] < np.median(measured[own]) + TOLERANCE).any():  # False where there is no echo
        return None
    return float(away[own].mean())


def _bearing_slope(predicted: PredictedScan, path: int, start: FloatArray, shifts: Shifts) -> FloatArray | None:
    """Return the derivative of the departure of a path by each move, (m,); None if it touches more than one point."""
    outline, paths = predicted.paths.outline(path), predicted.paths
    if len(outline) != 3:
        return None
    source, point = outline[0], outline[1]
    wall, _ = shifts.wall_at(point)
    if wall is not None and paths.edges[path] < 0:
        return shifts.turns[:, wall]
    moved = shifts.of_point(point)
    if moved is None:
        return None
    away = point - source
    if wall is None:  # the centre of a post, in the same direction
        row = int(np.argmin(np.abs(np.hypot(*(shifts.posts[:, :2] - point).T) - shifts.posts[:, 2])))
        moved, away = shifts.of_posts[:, row, :2], shifts.posts[row, :2] - source
    return np.asarray((moved - start) @ np.array([-away[1], away[0]]) / float(away @ away))


def _end_shifts(
    draft: RoomDraft, scan: int, moves: Sequence[Move], outline: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of both ends of a path, of which the transducer has one or two, (m, 2) each."""
    ends = []
    for point in (outline[0], outline[-1]):
        away = point - draft.places[scan].position
        own = np.array([[1.0, 0.0], [0.0, 1.0], [-away[1], away[0]]])
        ends.append(np.array([own[move.part] if move.is_of("place", scan) else np.zeros(2) for move in moves]))
    return ends[0], ends[1]


def shifts_of(draft: RoomDraft, moves: Sequence[Move]) -> Shifts:
    """Return the derivatives of walls and posts of a draft by each move."""
    of_segments, of_posts = [], []
    for move in moves:
        ahead, behind = (
            draft if move.what in ("place", "offset") else move.of(draft, by) for by in (move.step, -move.step)
        )
        moved = np.zeros((len(draft.walls), 4))
        for row, key in enumerate(draft.walls):
            if _moves_with(draft, key, move):
                moved[row] = (ahead.segment(key) - behind.segment(key)) / (2 * move.step)
        of_segments.append(moved)
        of_posts.append((ahead.round_surfaces - behind.round_surfaces) / (2 * move.step))
    turns = [[float(move.is_of("wall", key) and move.part == 1) for key in draft.walls] for move in moves]
    shape = len(moves), len(draft.walls)
    return Shifts(
        draft.segments,
        draft.round_surfaces,
        np.array(of_segments).reshape(*shape, 4),
        np.array(of_posts).reshape(len(moves), len(draft.posts), 3),
        np.array(turns).reshape(shape),
    )


def _moves_with(draft: RoomDraft, key: int, move: Move) -> bool:
    """Return whether a move changes an end of a wall: it is of this wall, or of one that an end meets."""
    return move.what == "wall" and move.which in (key, *(end.meets for end in draft.walls[key].ends))


# Refinement of a draft: walls, posts and uncertain places move to where they explain the ranges best.
#
# Each step is one of least squares with Cauchy weights (Holland and Welsch 1977), so that false echoes and wrong
# paths count little. The likelihood is too rough for its gradients: it decides between the drafts on the way.


UNKNOWN, UNKNOWN_TURN = 0.3, math.radians(5)  # m, rad: standard deviations of what no range determines
_MOST, _MOST_TURN = 0.03, math.radians(3)  # m, rad: by which a value moves at once
# deviations by those of the least squares: for wrong paths; chosen in ten rooms (docs/explanation/fit_method.md)
_WIDER = 1.2
_TUNING = 2.385  # of Cauchy weights: 95 % efficient for normal errors
_HALVINGS = 3  # of a step that makes a wall too short
_COMMON_ROUNDS = 3  # of the estimate of the common error of arcs
_LEAST_SHARE = 0.25  # of the arcs: those whose errors the values do not follow
_SETTLED = 0.1  # standard deviations; smaller steps end the refinement


def refined(
    evidence: Evidence, draft: RoomDraft, noise: ReadingNoise, steps: int, with_headings: bool = False
) -> Scored:
    """Return the most likely draft of those after up to `steps` steps; walls turn about their middles.

    `with_headings`: the likelihood at other headings counts, too. The room has to be almost complete for this.
    """
    draft = centred(draft)
    best = Scored(draft, evidence.log_likelihood(draft, noise))
    moves = moves_of(evidence, draft)
    for _ in range(steps):
        information, slopes = _normal_equations(evidence, draft, moves, with_headings)
        step = np.linalg.solve(information, slopes)
        if (np.abs(step) < _SETTLED / np.sqrt(np.diag(information))).all():
            break
        moved = _moved(draft, moves, np.asarray(step, dtype=np.float64))
        if moved is None:
            break
        draft = moved
        now = Scored(draft, evidence.log_likelihood(draft, noise))
        # what is known without the scans counts by the redundancy, as in the steps
        more_probable = evidence.log_prior(draft) - evidence.log_prior(best.draft)
        if now.score - best.score + (evidence.redundancy - 1) * more_probable > 0:
            best = now
    return replace(best, draft=centred(best.draft))


def deviations_of(evidence: Evidence, draft: RoomDraft) -> dict[Move, float]:
    """Return the standard deviation of each value of a draft, m or rad; all other values are unknown, too."""
    moves = moves_of(evidence, draft)
    information, _ = _normal_equations(evidence, draft, moves, True)
    deviations = _WIDER * np.sqrt(np.diag(np.linalg.inv(information)))
    return dict(zip(moves, deviations.tolist(), strict=True))


def centred(draft: RoomDraft) -> RoomDraft:
    """Return the same draft with the point about which each wall turns at its middle."""
    walls = {}
    for key, wall in draft.walls.items():
        middle = sum(draft.extent(key)) / 2
        x, y = (np.array(wall.middle) + middle * wall.along).tolist()
        ends = [DraftEnd(end.at - middle, end.meets) for end in wall.ends]
        walls[key] = replace(wall, middle=(x, y), ends=(ends[0], ends[1]))
    return replace(draft, walls=walls).rounded()


def _normal_equations(
    evidence: Evidence, draft: RoomDraft, moves: Sequence[Move], with_headings: bool
) -> tuple[FloatArray, FloatArray]:
    """Return the information matrix (m, m) of the values, and the slope of the log-posterior, (m,).

    With headings, the error that readings of one arc have in common is estimated. Before, too many walls are wrong.
    """
    residuals = range_errors(evidence, draft, moves, with_headings)
    known, ascent = _priors(evidence, draft, moves)
    weights = _by_arc(residuals, known) if with_headings else _by_reading(residuals) / evidence.redundancy
    weighted = weights[:, None] * residuals.slopes
    return weighted.T @ residuals.slopes + known, weighted.T @ residuals.errors + ascent


def _by_reading(residuals: RangeErrors) -> FloatArray:
    """Return the weight of each error, (n,), by Cauchy; the deviations of all are larger than assumed if ranges are."""
    errors, scale = residuals.errors, max(1.0, _spread(residuals.errors[: residuals.of_range]))
    weights = 1 / (1 + (errors / scale / _TUNING) ** 2)
    weights[len(errors) - residuals.of_heading :] = 1.0  # a wrong first heading is no false echo
    return np.asarray(weights / scale**2)


def _spread(errors: FloatArray) -> float:
    """Return the standard deviation of normal errors of which some are false; 0 without errors."""
    return 1.4826 * float(np.median(np.abs(errors))) if len(errors) else 0.0


def _by_arc(residuals: RangeErrors, known: FloatArray) -> FloatArray:
    """Return the weight of each error, (n,); `known` is the information without the scans, (m, m).

    Walls are not straight to the millimetre, and sensors are not points: the readings of one arc have an error in
    common. Its variance follows from the scatter of the means of arcs, of which the values explain a part.
    """
    count, weights = residuals.of_range, _by_reading(residuals)
    if not count:
        return weights
    ranges, slopes, arcs = residuals.errors[:count], residuals.slopes[:count], residuals.arcs
    robust = weights[:count] * max(1.0, _spread(ranges)) ** 2
    sums = np.bincount(arcs, robust)
    means = np.bincount(arcs, robust * ranges) / sums
    within = max(1.0, _spread(ranges - means[arcs])) ** 2
    beyond = weights[count:, None] * residuals.slopes[count:]
    others = beyond.T @ residuals.slopes[count:] + known
    common = 0.0
    for _ in range(_COMMON_ROUNDS):
        of_ranges = (robust / (within + sums[arcs] * common))[:, None] * slopes
        information = of_ranges.T @ slopes
        followed = float(np.trace(np.linalg.solve(information + others, information)))
        left = max(len(means) - followed, len(means) * _LEAST_SHARE)
        common = max(0.0, _spread(means) ** 2 * len(means) / left - within * float(np.median(1 / sums)))
    weights[:count] = robust / (within + sums[arcs] * common)
    return weights


def _priors(evidence: Evidence, draft: RoomDraft, moves: Sequence[Move]) -> tuple[FloatArray, FloatArray]:
    """Return information (m, m) and slope (m,) of what is known without the scans."""
    information, ascent = np.diag([_known(move) for move in moves]), np.zeros(len(moves))
    for row, move in enumerate(moves):
        if move.what == "place":
            away, spread = evidence.pose_errors(draft, move.which)[move.part]
            information[row, row] += 1 / spread**2
            ascent[row] -= away / spread**2
        elif move.what == "offset":
            information[row, row] += 1 / evidence.offset_spread**2
            ascent[row] -= draft.offset / evidence.offset_spread**2
    rows = {move.which: row for row, move in enumerate(moves) if move.what == "wall" and move.is_turn}
    for key, common, away, weight in pulls(draft):
        turned = np.zeros(len(moves))
        turned[rows[key]], turned[rows[common]] = 1.0, -1.0
        information += weight * np.outer(turned, turned)
        ascent -= weight * away * turned
    return information, ascent


def _known(move: Move) -> float:
    """Return the information about a value that no range determines."""
    return 1 / (UNKNOWN_TURN if move.is_turn else UNKNOWN) ** 2


def _moved(draft: RoomDraft, moves: Sequence[Move], step: FloatArray) -> RoomDraft | None:
    """Return the draft after a step, or a part of it; None if a wall would be too short."""
    most = np.array([_MOST_TURN if move.is_turn else _MOST for move in moves])
    for halving in range(_HALVINGS):
        moved = draft
        for move, by in zip(moves, (np.clip(step, -most, most) / 2**halving).tolist(), strict=True):
            moved = move.of(moved, by)
        if moved.is_sound:
            return moved.rounded()
    return None
