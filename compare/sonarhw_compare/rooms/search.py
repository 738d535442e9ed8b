"""Search for a room: a draft grows by walls and posts, is refined, and loses what the scans do not support."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, softmax
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, angle_difference
from sonarhw_compare.arcs import POSSIBLE, Arc, arcs_of, mappable
from sonarhw_compare.fit.likelihood import ReadingNoise
from sonarhw_compare.fit.parameters import free_parameters
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import Located, Pose, PoseSpread, locate_scan
from sonarhw_compare.match import TOLERANCE
from sonarhw_compare.processes import LateProcesses
from sonarhw_compare.regions import mean_run
from sonarhw_compare.rooms import candidates
from sonarhw_compare.rooms.draft import SPREAD, DraftEnd, DraftPost, DraftWall, RoomDraft, common_angle, oblique, pulls
from sonarhw_compare.rooms.evidence import (
    FINE,
    FOLLOWED,
    PRICE,
    ROUGH,
    Course,
    Evidence,
    Scored,
    SearchProgress,
    all_scored,
    as_found,
    evidence_of,
    leading,
    scored,
    scored_if_near,
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
    for row, one in enumerate(drafts):
        for problem, readings in zip(evidence.problems, evidence.by_reading(one, ROUGH), strict=True):
            arrays = problem.scans[0]
            likelihoods[row] += readings.sum() / mean_run(arrays.angles, arrays.ranges[:, 0])
    return _moments(_BESIDE, likelihoods + [evidence.log_prior(one) for one in drafts], _LEAST_THRESHOLD)[1]


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
    ranges, bearings, headings = ([row for part in parts for row in part[kind]] for kind in range(3))
    rows = [*ranges, *bearings, *headings]
    errors = np.array([error for error, _ in rows])
    slopes = np.array([slope for _, slope in rows]).reshape(len(rows), len(moves))
    return RangeErrors(errors, slopes, len(ranges), len(headings))


Row = tuple[float, FloatArray]  # an error and its derivatives


def _of_scans(
    evidence: Evidence,
    scans: Sequence[int],
    draft: RoomDraft,
    moves: Sequence[Move],
    shifts: Shifts,
    with_headings: bool,
) -> list[tuple[list[Row], list[Row], list[Row]]]:
    """Return the errors of ranges, of bearings and of the heading of each scan."""
    room, errors = draft.room(evidence.air), []
    for scan in scans:
        ranges, bearings, turns = _of_scan(evidence, draft, scan, room, moves, shifts)
        headings = [_of_heading(heading_error(evidence, draft, room, scan), turns)] if with_headings and turns else []
        errors.append((ranges, bearings, headings))
    return errors


def _of_scan(
    evidence: Evidence, draft: RoomDraft, scan: int, room: Room, moves: Sequence[Move], shifts: Shifts
) -> tuple[list[Row], list[Row], list[FloatArray]]:
    """Return the errors of ranges, those of bearings, and the derivatives of the bearing of each reading."""
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
    ranges = [(float(residuals[row]) / FINE.range, slopes[int(predicted.winners[row])]) for row in rows]
    return ranges, bearings, turns


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
# deviations by those of the least squares: for wrong paths; chosen in ten rooms (docs/explanation/room_search.md)
_WIDER = 1.2
_TUNING = 2.385  # of Cauchy weights: 95 % efficient for normal errors
_HALVINGS = 3  # of a step that makes a wall too short
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
        score = evidence.log_likelihood(draft, noise)
        if score > best.score:
            best = Scored(draft, score)
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
    """Return the information matrix (m, m) of the values, and the slope of the log-posterior, (m,)."""
    residuals = range_errors(evidence, draft, moves, with_headings)
    ranges = residuals.errors[: residuals.of_range]
    # larger than assumed if the errors are
    scale = max(1.0, 1.4826 * float(np.median(np.abs(ranges)))) if len(ranges) else 1.0
    errors, slopes = residuals.errors / scale, residuals.slopes / scale
    weights = 1 / (1 + (errors / _TUNING) ** 2)
    weights[len(errors) - residuals.of_heading :] = 1.0  # a wrong first heading is no false echo
    weighted = weights[:, None] * slopes
    information = weighted.T @ slopes + np.diag([_known(move) for move in moves])
    ascent = weighted.T @ errors
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


# Growth of a draft: walls and posts are added while the scans speak for them, and removed where they do not.


_TRIED = 8  # candidates for walls at a time
_SHORT = 0.5  # m: a new wall that is shorter could be a post
_POSTS = 6  # candidates for posts at a time; each takes more time than a wall
_COMPLETED = 2  # best walls, whose ends are tried at other walls
_CORNERS = 4  # points at which a corner is tried
_STEPS = 2  # of the refinement after each addition
_UNEXPLAINED = 2.0  # log-likelihood over that of a false echo at which a reading counts as half explained

_Part = TypeVar("_Part", int, DraftPost)  # the key of a wall, or a post
_State = TypeVar("_State")  # a draft, or the changes of a known room


def edited(first: _State, changed: Callable[[_State], _State | None], accept: Callable[[_State], None]) -> _State:
    """Return the last of states of a room, each with the best change of the one before.

    `changed` returns the next state, or None if no change is worth its price; `accept` receives it.
    """
    best = first
    while (longer := changed(best)) is not None:
        best = longer
        accept(best)
    return best


def grown(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft to which no wall and no post can be added that is worth its price.

    What is no longer worth its price is removed on the way.
    """
    arcs, nothing = _arcs(evidence, best.draft), evidence.by_reading(RoomDraft(best.draft.places), ROUGH)

    def longer(now: Scored) -> Scored | None:
        return _with_part(evidence, now, arcs, unexplained_readings(evidence, now.draft, ROUGH, nothing))

    return edited(best, longer, lambda now: evidence.course.accept(now.draft))


def _with_part(evidence: Evidence, best: Scored, arcs: tuple[Arc, ...], unexplained: list[FloatArray]) -> Scored | None:
    """Return the draft with the wall or post that explains most, refined and pruned; None if it is not worth more."""
    longer = with_wall(evidence, best, arcs, unexplained)
    # a post looks like short walls; a corner looks like a post until its walls are known
    if longer.score - best.score < PRICE or _newest_length(longer.draft) < _SHORT:
        longer = max((longer, with_post(evidence, best, arcs, unexplained)), key=lambda draft: draft.score)
    if longer.score - best.score < PRICE:
        return None
    longer = refined(evidence, candidates.with_better_ends(evidence, longer).draft, ROUGH, _STEPS)
    longer = pruned(evidence, with_threshold(evidence, longer))
    return longer if worth(longer) > worth(best) else None


def _arcs(evidence: Evidence, draft: RoomDraft) -> tuple[Arc, ...]:
    """Return the arcs of all scans at the places of a draft."""
    placed = [replace(scan, place=place) for scan, place in zip(evidence.scans, draft.places, strict=True)]
    return arcs_of(placed, as_found(evidence.board, draft), POSSIBLE)


def _newest_length(draft: RoomDraft) -> float:
    """Return the length of the last wall of a draft, m; 0 without walls."""
    return float(np.hypot(*np.diff(draft.segments[-1].reshape(2, 2), axis=0)[0])) if draft.walls else 0.0


def worth(draft: Scored) -> float:
    """Return the log-likelihood less the price of all walls and posts."""
    return draft.score - PRICE * (len(draft.draft.walls) + len(draft.draft.posts))


def pruned(evidence: Evidence, best: Scored, price: float = PRICE) -> Scored:
    """Return the draft without walls and posts that are not worth their price; those of the first draft stay."""
    keys = sorted(best.draft.walls.keys() - evidence.first.walls.keys())
    best = _without_worthless(evidence, best, keys, RoomDraft.without_wall, price)
    posts = best.draft.posts[len(evidence.first.posts) :]
    return _without_worthless(evidence, best, posts, RoomDraft.without_post, price)


def _without_worthless(
    evidence: Evidence,
    best: Scored,
    parts: Sequence[_Part],
    without: Callable[[RoomDraft, _Part], RoomDraft],
    price: float,
) -> Scored:
    """Return the draft without those of its parts that are not worth their price, tried in order."""
    while parts:
        # all at once, because processes divide many drafts better; most rooms keep all
        tried = scored_if_near(evidence, [without(best.draft, part) for part in parts], best)
        row = next((row for row, draft in enumerate(tried) if best.score - draft.score < price), None)
        if row is None:
            return best
        best, parts = tried[row], parts[row + 1 :]
    return best


def unexplained_readings(
    evidence: Evidence, draft: RoomDraft, noise: ReadingNoise, nothing: list[FloatArray] | None = None
) -> list[FloatArray]:
    """Return a weight of each reading, 0 explained .. 1 like a false echo, by scan.

    `nothing` is the log-likelihood of the readings in an empty room, if known.
    """
    now = evidence.by_reading(draft, noise)
    nothing = evidence.by_reading(RoomDraft(draft.places), noise) if nothing is None else nothing
    return [expit(_UNEXPLAINED + none - with_draft) for none, with_draft in zip(nothing, now, strict=True)]


def with_wall(
    evidence: Evidence,
    best: Scored,
    arcs: tuple[Arc, ...],
    unexplained: list[FloatArray],
    noise: ReadingNoise = ROUGH,
) -> Scored:
    """Return the draft with the wall that explains most; the draft itself without a candidate."""
    found_lines = candidates.wall_candidates(arcs, unexplained, _TRIED, common_angle(best.draft))
    walls = [wall for wall in found_lines if not evidence.refuses(wall)]
    alone = all_scored(evidence, (best.draft.with_new_wall(wall)[0] for wall in walls), noise)
    tried = sorted(zip(alone, walls, strict=True), key=lambda one: -one[0].score)
    completed = [draft for _, wall in tried[:_COMPLETED] for draft in candidates.joined(best.draft, wall)]
    points = [post.center for post in candidates.post_candidates(arcs, unexplained, _CORNERS, (0.0,))]
    completed += [
        draft
        for draft in (*candidates.cornered(best.draft, points), *candidates.continued(best.draft))
        if not evidence.refuses(draft.walls[max(draft.walls)])
    ]
    drafts = [*(one for one, _ in tried[:1]), *leading(evidence, completed, _least_explained(unexplained), noise)]
    return max(drafts, key=lambda one: one.score, default=best)


def with_post(
    evidence: Evidence,
    best: Scored,
    arcs: tuple[Arc, ...],
    unexplained: list[FloatArray],
    noise: ReadingNoise = ROUGH,
) -> Scored:
    """Return the draft with the post that explains most; the draft itself without a candidate."""
    posts = [post for post in candidates.post_candidates(arcs, unexplained, _POSTS) if not evidence.refuses(post)]
    drafts = (replace(best.draft, posts=(*best.draft.posts, post)) for post in posts)
    leaders = leading(evidence, drafts, _least_explained(unexplained), noise)
    return max(leaders, key=lambda draft: draft.score, default=best)


def _least_explained(unexplained: list[FloatArray]) -> list[int]:
    """Return the scans in order, that of which most is unexplained first."""
    return sorted(range(len(unexplained)), key=lambda scan: -float(unexplained[scan].sum()))


# Walls whose direction the scans hardly determine are tried at right angles to the others, one by one and together.


_LEAST_SQUARING, _MOST_SQUARING = 2 * SPREAD, math.radians(30)  # rad away from right angles
_TOGETHER = 3 * SPREAD  # rad away from right angles
_SQUARING_STEPS = 4  # of a refinement


def squared(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with walls turned to right angles, where this is more likely.

    A wall that one place faces is turned about this place, which keeps its distance. All places are tried.
    """
    for key in list(best.draft.walls):
        turned = turned_square(evidence, best.draft, key)
        best = turned if turned is not None and turned.score > best.score else best
    return best


def turned_square(evidence: Evidence, draft: RoomDraft, key: int) -> Scored | None:
    """Return the draft with a wall at right angles; None if it is there already, or oblique by more than 30°."""
    away = next((away for other, _, away, _ in pulls(draft) if other == key), 0.0)
    if not _LEAST_SQUARING < abs(away) < _MOST_SQUARING:
        return None
    draft = centred(draft)
    wall = draft.walls[key]
    turned = (draft.with_wall(key, _turned(wall, place.position, -away)) for place in draft.places)
    tried = max(all_scored(evidence, turned), key=lambda one: one.score)
    return refined(evidence, tried.draft, ROUGH, _SQUARING_STEPS) if math.isfinite(tried.score) else None


def squared_together(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with all walls that are almost at right angles exactly so, where this is more likely.

    Several short walls can be wrong by the same angle, of which none is more likely at another one alone.
    """
    draft = centred(best.draft)
    angle = _long_direction(draft)
    for key, wall in draft.walls.items():
        away = math.remainder(wall.angle - angle, math.pi / 2)
        if abs(away) < _TOGETHER:
            draft = draft.with_wall(key, wall.moved(0.0, -away))
    if not draft.is_sound:
        return best
    squared_draft = refined(evidence, draft, ROUGH, _SQUARING_STEPS)
    return squared_draft if squared_draft.score > best.score else best


def _long_direction(draft: RoomDraft) -> float:
    """Return the mean direction of all walls, rad, where those at right angles have the same.

    Each counts by the cube of its length, to which the information of touches along it is proportional.
    """
    angles = np.array([wall.angle for wall in draft.walls.values()])
    lengths = np.array([last - first for first, last in map(draft.extent, draft.walls)])
    return float(np.angle((lengths**3 * np.exp(4j * angles)).sum())) / 4


def _turned(wall: DraftWall, about: tuple[float, float], angle: float) -> DraftWall:
    """Return a wall turned about a point (m) by an angle (rad)."""
    cosine, sine = math.cos(angle), math.sin(angle)
    x, y = (np.array([[cosine, -sine], [sine, cosine]]) @ np.subtract(wall.middle, about) + about).tolist()
    return DraftWall((x, y), wall.angle + angle, wall.ends)


# Walls on one line, which can be parts of one wall.


_BESIDE_PART, _TURNED = 0.15, math.radians(8)  # m, rad: from the line of a wall to another part of it
_PART_STEPS = 4  # of a refinement


def with_parts_joined(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with walls on one line made one wall, where the scans do not contradict."""
    for pair in combinations(list(best.draft.walls), 2):
        if not set(pair) <= best.draft.walls.keys() or evidence.first.walls.keys() & set(pair):
            continue
        longer, other = sorted(pair, key=lambda key: -_length(best.draft, key))
        if not _on_one_line(best.draft, longer, other):
            continue
        joint = _in_one(best.draft, longer, other)
        joined = refined(evidence, joint, ROUGH, _PART_STEPS) if joint.is_sound else best
        best = joined if joined.score > best.score - PRICE else best
    return best


def without_part(draft: RoomDraft, key: int) -> RoomDraft:
    """Return the draft without a wall; if it is a part of another one, that wall reaches as far."""
    others = sorted((other for other in draft.walls if other != key), key=lambda other: -_length(draft, other))
    whole = next((other for other in others if _on_one_line(draft, other, key)), None)
    return draft.without_wall(key) if whole is None else _in_one(draft, whole, key)


def _length(draft: RoomDraft, key: int) -> float:
    first, last = draft.extent(key)
    return last - first


def _on_one_line(draft: RoomDraft, key: int, other: int) -> bool:
    wall = draft.walls[key]
    beside = (draft.segment(other).reshape(2, 2) - wall.middle) @ wall.normal
    turned = math.remainder(draft.walls[other].angle - wall.angle, math.pi)
    return bool((np.abs(beside) < _BESIDE_PART).all()) and abs(turned) < _TURNED


def _in_one(draft: RoomDraft, key: int, other: int) -> RoomDraft:
    """Return the draft with a wall between the outermost ends of two, instead of both."""
    wall = draft.walls[key]
    ends = [(key, 0), (key, 1), (other, 0), (other, 1)]
    points = [draft.segment(of)[2 * which : 2 * which + 2] for of, which in ends]
    ats = [float((point - wall.middle) @ wall.along) for point in points]
    first, last = ats.index(min(ats)), ats.index(max(ats))
    along, (x, y) = points[last] - points[first], ((points[first] + points[last]) / 2).tolist()
    half = math.hypot(*along) / 2
    meets = [draft.walls[of].ends[which].meets for of, which in (ends[first], ends[last])]
    begin, end = (
        DraftEnd(at, None if meet in (key, other) else meet) for at, meet in zip((-half, half), meets, strict=True)
    )
    walls = {**draft.walls, key: DraftWall((x, y), math.atan2(along[1], along[0]), (begin, end))}
    for name, one in walls.items():
        own = [replace(end, meets=key) if end.meets == other else end for end in one.ends]
        walls[name] = replace(one, ends=(own[0], own[1]))
    return replace(draft, walls={name: one for name, one in walls.items() if name != other})


# The room that scans show: growth, refinement, and what the scans do not show.


# shares of growth that are done after each of its rounds, the rest is for oblique walls; share of a search after growth
_ROUNDS_DONE, _SEARCHED_DONE = (0.72, 0.83, 0.89), 0.9
_REGROWN = 2  # times that walls grow in place of those that no range determines
LARGE = 500  # searches of the paths of a scan, some seconds, after which a search is so large that processes pay
_ROOM_STEPS, _LAST_STEPS = 4, 8  # of a refinement
_CLEAR_PRICE = 25.0  # log-likelihood: in real scans, false walls and posts added 11 to 24, true ones 32 and more
_UNKNOWN, _UNKNOWN_TURN = 0.06, math.radians(5.4)  # m, rad: standard deviations of a wall that is not reported


@dataclass(frozen=True)
class FoundRoom:
    """A room found from scans."""

    draft: RoomDraft
    deviations: dict[Move, float]  # m or rad: standard deviations
    touches: candidates.Touches
    worth: float  # log-likelihood of all scans, less the price of all walls and posts
    threshold_deviation: float | None = None  # dB: standard deviation; None if the board states that it is exact
    scans: tuple[PlacedScan, ...] = ()  # those of the room, at their refined places
    # possible poses of each located scan, by its title, in the room of the scans before it
    poses: Mapping[str, tuple[Pose, ...]] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()  # titles of the scans that could not be located

    @property
    def echoes(self) -> int:
        """The number of echoes of all scans."""
        return sum(self.touches.echoes)

    @property
    def offset_deviation(self) -> float | None:
        """Standard deviation of the range offset, m; None if the board states none, so that it is exact."""
        return next((deviation for move, deviation in self.deviations.items() if move.what == "offset"), None)

    @property
    def explained(self) -> int:
        """The number of echoes within 5 cm of one that the room predicts."""
        return self.echoes - sum(self.touches.unexplained)


def find_room(
    scans: Sequence[PlacedScan],
    board: Board,
    air: Air,
    spreads: Sequence[PoseSpread] = (),
    tick: Callable[[float], None] = lambda _share: None,
    course: Course | None = None,
    processes: LateProcesses | None = None,
) -> FoundRoom:
    """Return the walls and posts that explain scans. Readings of the carrier's own body are left out.

    `spreads` are the standard deviations of the places, by default exact. `tick` receives the completed share, 0..1;
    it can end the search by an exception. `course` continues a search. `processes` are those of several searches, by
    default started and ended by this one. Raises InputError if no reading has an echo, no wall is found, a scan
    is given twice, or the board is a ring.
    """
    scans = mappable(scans, board)
    own = LateProcesses(len(scans), LARGE) if processes is None else nullcontext(processes)
    with own as used:
        spreads, progress = spreads or [PoseSpread()] * len(scans), SearchProgress(tick)
        result = _found(evidence_of(scans, spreads, board, air, course, used, progress))
    tick(1.0)
    return result


def worth_alone(scan: PlacedScan, board: Board, air: Air, tick: Callable[[float], None]) -> float:
    """Return the worth of the walls and posts that explain one scan by itself, before they are refined together.

    `tick` receives the completed share, 0..1.
    """
    evidence = evidence_of([scan], [PoseSpread()], board, air, progress=SearchProgress(tick))
    return worth(_best(evidence, lambda way, begin: grown(way, scored(way, begin)).draft, 1.0))


def _found(evidence: Evidence) -> FoundRoom:
    """Return the room of `find_room`. Raises InputError if no wall is found."""
    best = _best(evidence, _searched, _SEARCHED_DONE)
    evidence.progress.begin(1.0)
    end, deviations = _finished(evidence, best)
    if not end.walls:
        raise InputError("no wall found: expected scans from at least two places that face the same walls")
    touches, of_threshold = candidates.touches_of(evidence, end), threshold_deviation(evidence, end)
    return FoundRoom(end, deviations, touches, worth(scored(evidence, end)), of_threshold)


def _best(evidence: Evidence, search: Callable[[Evidence, RoomDraft], RoomDraft], done: float) -> Scored:
    """Return the better result of searches from no walls and from a likely room; `done` is the share afterwards.

    A search that begins without walls can miss a better room. Without a likely room, there is one search.
    """
    likely = evidence.course.likely
    begins = [evidence.first, *([] if likely is None else [likely])]
    results: list[Scored] = []
    for number, begin in enumerate(begins):
        evidence.progress.begin(done * (number + 1) / len(begins))
        course = evidence.course if number == 0 else evidence.course.unseen
        way = replace(evidence, course=course, progress=SearchProgress(evidence.progress.inner(1.0)))
        results.append(scored(evidence, _in_turn(way, search, begin)))
    best = max(results, key=worth)
    if best is not results[0]:
        evidence.course.accept(best.draft)
    return best


def _in_turn(evidence: Evidence, search: Callable[[Evidence, RoomDraft], RoomDraft], begin: RoomDraft) -> RoomDraft:
    """Return the result of a search by the first echoes that goes on by all.

    Later echoes have passed most of the room, so they show more of it than the first ones. But while walls are missing,
    most of them have no path, and one wrong wall can explain more of them than each of the missing ones. Without later
    echoes, there is one search.
    """
    first, draft = evidence.of_first_echoes(), begin
    ways = [evidence] if first is None else [first, evidence]
    for number, way in enumerate(ways):
        evidence.progress.begin((number + 1) / len(ways))
        draft = search(replace(way, progress=SearchProgress(evidence.progress.inner(1.0))), draft)
    return draft


def _searched(evidence: Evidence, begin: RoomDraft) -> RoomDraft:
    """Return the draft after all rounds of growth and refinement, from a first one."""
    best = scored(evidence, begin)
    for done in _ROUNDS_DONE:
        evidence.progress.begin(done)
        longer = pruned(evidence, grown(evidence, best))
        if longer.draft == best.draft:
            break
        best = scored(evidence, refined(evidence, longer.draft, ROUGH, _ROOM_STEPS).draft)
        best = squared(evidence, best)
        best = with_parts_joined(evidence, pruned(evidence, best))
        best = _cut_back(evidence, candidates.with_better_ends(evidence, best))
        best = candidates.with_free_ends_moved(evidence, best)
    evidence.progress.begin(1.0)
    return rebuilt(evidence, best).draft


def rebuilt(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with oblique walls replaced by what grows without them, where that is worth more.

    One oblique wall can explain a part of what two walls at right angles explain. Once it stands, neither of these is
    worth its price alone.
    """
    for key in oblique(best.draft):
        if key in best.draft.walls and key not in evidence.first.walls:
            course = evidence.course.refusing(best.draft.alone(key))
            trial = replace(evidence, course=course.unseen)
            shorter = best.draft.without_wall(key)
            if not shorter.is_sound:  # an end that moved to another wall would turn its own wall round
                shorter = best.draft.without_only(key)
            other = _regrown(trial, scored(trial, shorter))
            if worth(other) > worth(best):
                best = other
                evidence.course.accept(best.draft)
    return best


def _regrown(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft after more growth."""
    longer = grown(evidence, best)
    return squared(evidence, scored(evidence, refined(evidence, longer.draft, ROUGH, _ROOM_STEPS).draft))


def _finished(evidence: Evidence, best: Scored) -> tuple[RoomDraft, dict[Move, float]]:
    """Return the best draft, refined without haste, and its deviations."""
    kept = pruned(evidence, best).draft
    draft = squared_together(evidence, refined(evidence, kept, ROUGH, _ROOM_STEPS)).draft
    draft = refined(evidence, draft, FINE, _LAST_STEPS, with_headings=True).draft
    return _clear(evidence, *determined(evidence, draft))


def _clear(evidence: Evidence, draft: RoomDraft, deviations: dict[Move, float]) -> tuple[RoomDraft, dict[Move, float]]:
    """Return a refined draft and its deviations; if the profile states spreads, without what is hardly worth its price.

    The readings of a sensor of a population have errors in common, so a wall that does not exist can explain some of
    them. Until the room is complete, a wall that exists can add as little.
    """
    if not evidence.board.states_spread:
        return draft, deviations
    kept = pruned(evidence, scored(evidence, draft), _CLEAR_PRICE).draft
    if kept == draft:
        return draft, deviations
    kept = refined(evidence, kept, FINE, _LAST_STEPS, with_headings=True).draft
    return kept, deviations_of(evidence, kept)


def determined(evidence: Evidence, draft: RoomDraft) -> tuple[RoomDraft, dict[Move, float]]:
    """Return a refined draft without walls that no range determines, and its deviations; walls of the first draft stay.

    Such a wall is added because it changes the sound at the end of another one. If it is a part of another one, that
    wall becomes longer. Other walls may grow in its place. If it is worth its price at right angles, it stays there.
    """
    deviations = deviations_of(evidence, draft)
    for again in range(_REGROWN + 1):
        unknown = _undetermined(deviations) - evidence.first.walls.keys()
        if not unknown:
            break
        for key in sorted(unknown):
            square, without = turned_square(evidence, draft, key), without_part(draft, key)
            if square is not None and square.score >= scored(evidence, without).score + PRICE:
                draft = square.draft
            else:
                course = evidence.course.refusing(draft.alone(key))
                evidence, draft = replace(evidence, course=course), without
        if again < _REGROWN:
            draft = _regrown(evidence, scored(evidence, draft)).draft
        draft = refined(evidence, draft, FINE, _LAST_STEPS, with_headings=True).draft
        deviations = deviations_of(evidence, draft)
    return draft, deviations


def _undetermined(deviations: dict[Move, float]) -> set[int]:
    """Return the walls whose position or direction no range determines."""
    return {
        move.which
        for move, deviation in deviations.items()
        if move.what == "wall" and move.part < 2 and deviation > (_UNKNOWN_TURN if move.is_turn else _UNKNOWN)
    }


def _cut_back(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft without the parts of walls that sound has not touched, unless they matter to the scans."""
    touches = candidates.touches_of(evidence, best.draft)
    least = best.score - PRICE
    cut = scored(evidence, candidates.trimmed(best.draft, touches, evidence.first))
    if cut.score <= least:
        cut = best
        for key in touches.walls:
            tried = scored(evidence, candidates.trimmed(cut.draft, touches, evidence.first, key))
            cut = tried if tried.score > least else cut
    return candidates.with_gaps(evidence, cut, touches.walls)


# The room and the poses of scans of which only some poses are known: simultaneous localisation and mapping.
#
# The scans with known poses give a first room, in which the others are located. Those that it explains well are
# placed at once. If there are none, the one that it explains best is placed at each of its possible poses in turn:
# each gives another room, and the one that explains all scans best is kept, if it is worth more than the room without
# this scan and a room of this scan alone. One scan in a part of a room often has several poses that are almost as
# probable, but the walls that it then needs contradict the other scans at the wrong ones. If no scan can be placed
# so, improbable poses are tried, too: while the walls about a scan are missing, its right pose can be one of them.


# m, rad: of what is unknown of the pose of a located scan; wide, because the scan itself gives it
_LOCATED = PoseSpread(0.05, 0.06)
_WIDTHS = (_LOCATED.xy, _LOCATED.xy, _LOCATED.heading)
_AS_GOOD = 0.9  # of the share that the room explains of its own scans, at which a scan is placed at once
_PROBABLE = 0.8  # least probability of a pose at which its scan is placed at once
_TRIED_POSES = 3  # poses of a scan, each of which needs a room
_LOCATING, _TRYING = 0.02, 0.25  # of what is left of a part of the progress, for a scan and for a room or a scan alone
_NARROW = PoseSpread(0.1, math.radians(6))  # up to this spread, a scan is placed where it is given, else it is located
_UNLIKELY = 0.05  # probability of a pose, by that of the most probable one, below which it is not tried


@dataclass(frozen=True)
class _Stage:
    """A room of some scans at the places with which its search began."""

    placed: dict[int, PlacedScan]  # by number, in order
    found: FoundRoom

    @cached_property
    def refined(self) -> dict[int, PlacedScan]:
        """The scans at their refined places."""
        places = self.found.draft.places
        return {k: replace(scan, place=place) for (k, scan), place in zip(self.placed.items(), places, strict=True)}

    def sensor(self, board: Board) -> Board:
        """Return the board with range offset and threshold as these scans show them, and with what is left of spreads.

        One sensor made all scans, so others are expected to show the same.
        """
        range_sd, threshold_sd = self.found.offset_deviation or 0.0, self.found.threshold_deviation or 0.0
        return replace(as_found(board, self.found.draft), range_sd=range_sd, threshold_sd_db=threshold_sd)

    def explained(self, numbers: Sequence[int]) -> float:
        """Return the share of the echoes of some of the scans that the room explains."""
        touches, rows = self.found.touches, [list(self.placed).index(k) for k in numbers]
        echoes = sum(touches.echoes[row] for row in rows)
        return 1 - sum(touches.unexplained[row] for row in rows) / max(1, echoes)


def find_room_and_poses(
    scans: Sequence[PlacedScan],
    board: Board,
    air: Air,
    spreads: Sequence[PoseSpread] = (),
    tick: Callable[[float], None] = lambda _share: None,
    course: Course | None = None,
) -> FoundRoom:
    """Return the room and the poses that explain scans.

    `spreads` are the standard deviations of the places of the scans, by default exact; positions, headings or both may
    be unknown. Scans known within 10 cm and 6° give the first room; if there are none, the first one with a whole pose
    gives it. `tick` receives the completed share, 0..1; `course` continues a search. Raises InputError as `find_room`
    does, and if no whole pose is known.
    """
    spreads = spreads or [PoseSpread()] * len(scans)
    with LateProcesses(len(scans), LARGE) as processes:
        search = _Search(tuple(scans), tuple(spreads), board, air, SearchProgress(tick), course or Course(), processes)
        if not search.known:
            raise InputError("no pose is known; give that of the first log")
        search.progress.begin(1 / search.parts)
        stage = search.room_of(search.known, 1.0, search.course)
        poses: dict[int, tuple[Pose, ...]] = {}
        while len(stage.placed) < len(scans):
            search.progress.begin((len(stage.placed) - len(search.known) + 2) / search.parts)
            located = search.located(stage)
            longer = search.extended(stage, located)
            if longer is None:
                longer = search.extended_elsewhere(stage, located)
                if longer is None:
                    break
                located = search.located(longer, longer.placed.keys() - stage.placed.keys())
            poses |= {k: located[k].poses for k in longer.placed.keys() - stage.placed.keys()}
            stage = longer
        if poses:  # once more, because the last scans began at located places, which are not refined
            search.progress.begin(1.0)
            again = search.room_with(stage, {}, 1.0, search.course.unseen)
            stage = max(again, stage, key=lambda candidate: candidate.found.worth)
    tick(1.0)
    return replace(
        stage.found,
        scans=tuple(stage.refined.values()),
        poses={scans[k].title: found_here for k, found_here in sorted(poses.items())},
        left_out=tuple(scan.title for k, scan in enumerate(scans) if k not in stage.placed),
    )


@dataclass(frozen=True)
class _Search:
    """The scans, how well their poses are known, and what the search for a room needs."""

    scans: tuple[PlacedScan, ...]
    spreads: tuple[PoseSpread, ...]  # of their places
    board: Board
    air: Air
    progress: SearchProgress
    course: Course
    processes: LateProcesses
    # worth of the walls that one scan of a sensor needs by itself
    alone: dict[tuple[int, Board], float] = field(default_factory=dict)

    @cached_property
    def known(self) -> dict[int, PlacedScan]:
        """The scans of which the pose is known well, by number; if there are none, the first with a whole pose."""
        whole = {k: scan for k, scan in enumerate(self.scans) if self.spreads[k].is_whole}
        return {k: scan for k, scan in whole.items() if self._is_narrow(k)} or dict(list(whole.items())[:1])

    def _is_narrow(self, k: int) -> bool:
        return self.spreads[k].xy <= _NARROW.xy and self.spreads[k].heading <= _NARROW.heading

    @property
    def parts(self) -> int:
        """The number of parts of the progress: the first room, each scan of unknown pose, and the room of all."""
        unknown = len(self.scans) - len(self.known)
        return unknown + 2 if unknown else 1

    def room_of(self, placed: dict[int, PlacedScan], part: float, course: Course) -> _Stage:
        """Return the room of some scans; it takes a `part` of what is left of the part of the progress."""
        spreads = [self._spread(k, scan.place) for k, scan in placed.items()]
        tick = self.progress.inner(part)
        result = find_room(list(placed.values()), self.board, self.air, spreads, tick, course, self.processes)
        return _Stage(placed, result)

    def _spread(self, k: int, begins: Place) -> PoseSpread:
        """Return the spread of the pose of a scan: what is known of it, and for the rest that of a located scan."""
        if k in self.known:
            return self.spreads[k]
        given, spread = self.scans[k].place, self.spreads[k].with_width
        has_position, has_heading = math.isfinite(spread.xy), math.isfinite(spread.heading)
        return PoseSpread(
            spread.xy if has_position else _LOCATED.xy,
            spread.heading if has_heading else _LOCATED.heading,
            replace(
                begins,
                position=given.position if has_position else begins.position,
                heading=given.heading if has_heading else begins.heading,
            ),
        )

    def located(self, stage: _Stage, numbers: Iterable[int] | None = None) -> dict[int, Located]:
        """Return the possible poses in a room of these scans, by default of all that are not placed."""
        room, sensor = stage.found.draft.room(self.air), stage.sensor(self.board)
        return {
            k: locate_scan(
                scan.readings,
                room,
                sensor,
                prediction=FOLLOWED,
                expected=scan.place,
                spread=self.spreads[k],
                tick=self.progress.inner(_LOCATING),
            )
            for k, scan in enumerate(self.scans)
            if (k not in stage.placed if numbers is None else k in numbers)
        }

    def extended(self, stage: _Stage, located: Mapping[int, Located]) -> _Stage | None:
        """Return the room of one more scan, or of all that are sure; None if none of them can be placed."""
        own = stage.explained(list(stage.placed))
        sure = [
            k
            for k, poses in located.items()
            if poses.explained >= _AS_GOOD * own and poses.poses[0].probability >= _PROBABLE
        ]
        if sure:
            return self.room_with(stage, {k: located[k].poses[0] for k in sure}, 1.0, self.course)
        return self._with_first(stage, {k: _probable(located[k].poses) for k in _best_explained(located)})

    def extended_elsewhere(self, stage: _Stage, located: Mapping[int, Located]) -> _Stage | None:
        """Return the room of one more scan at a pose that is improbable in the room without it; None if there is none.

        A room that lacks the walls of the scan can explain more of it at a wrong pose than at the right one.
        """
        peaks = {
            k: [Pose((x, y), heading, 0.0, 0.0, _WIDTHS) for x, y, heading in located[k].peaks]
            for k in _best_explained(located)
        }
        return self._with_first(stage, peaks)

    def _with_first(self, stage: _Stage, poses: Mapping[int, Sequence[Pose]]) -> _Stage | None:
        """Return the best room with the first scan that shares walls with the others at one of its poses, or None."""
        for k, tried in poses.items():
            rooms = [self.room_with(stage, {k: pose}, _TRYING, self.course.unseen) for pose in tried]
            longer = max(rooms, key=lambda candidate: candidate.found.worth)
            if longer.found.worth >= stage.found.worth + self._alone(k, stage):  # else they share no walls at this pose
                self.course.accept(longer.found.draft)
                return longer
        return None

    def _alone(self, k: int, stage: _Stage) -> float:
        """Return the worth of the walls that explain one scan by itself, made by the sensor of the other scans."""
        sensor = stage.sensor(self.board)
        if (k, sensor) not in self.alone:
            self.alone[k, sensor] = worth_alone(self.scans[k], sensor, self.air, self.progress.inner(_TRYING))
        return self.alone[k, sensor]

    def room_with(self, stage: _Stage, poses: Mapping[int, Pose], part: float, course: Course) -> _Stage:
        """Return the room with more scans at their poses; scans of known poses begin where they are given.

        It is also searched from the room of the stage, because a search from nothing can miss a better one.
        """
        before = stage.refined | self.known
        more = {
            k: replace(self.scans[k], place=replace(self.scans[k].place, position=pose.position, heading=pose.heading))
            for k, pose in poses.items()
        }
        placed = dict(sorted((before | more).items()))
        refined = stage.refined | more
        likely = replace(stage.found.draft, places=tuple(refined[k].place for k in placed))
        return self.room_of(placed, part, replace(course, likely=likely))


def _best_explained(located: Mapping[int, Located]) -> list[int]:
    """Return the numbers of scans, first those of which the room explains most."""
    return sorted(located, key=lambda k: -located[k].explained)


def _probable(poses: Sequence[Pose]) -> list[Pose]:
    """Return the poses of a scan that are tried first."""
    return [pose for pose in poses[:_TRIED_POSES] if pose.probability >= _UNLIKELY * poses[0].probability]
