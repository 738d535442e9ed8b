"""How well a draft explains scans: every echo and every silence, with all reflections."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import groupby, pairwise
from typing import Any, TypeVar

import numpy as np
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood import PathMemory, ReadingNoise
from sonarhw_compare.fit.objective import Problem, make_problem, near_together
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.processes import LateProcesses
from sonarhw_compare.regions import mean_run
from sonarhw_compare.rooms import draft as right_angles
from sonarhw_compare.rooms.draft import DraftPost, DraftWall, RoomDraft
from sonarhw_compare.rooms.effort import Effort

# Progress of a search whose number of steps is unknown.


_STEP = 0.01  # of what is left of a part


class SearchProgress:
    """The completed share of a search, 0..1, which never decreases.

    A search has parts that end at known shares. Each step of a part takes the same share of what is left of it.
    """

    def __init__(self, tick: Callable[[float], None] | None = None) -> None:
        """`tick` receives the share at each step; it can end the search by an exception."""
        self._tick, self._share, self._end = tick, 0.0, 0.0

    def begin(self, end: float) -> None:
        """Begin the part that ends at this share of the search, where the part before it ends."""
        self._share, self._end = self._end, end
        self.repeat()

    def step(self) -> None:
        """Report one more step."""
        self._share += _STEP * (self._end - self._share)
        self.repeat()

    def repeat(self) -> None:
        """Report the share again."""
        if self._tick is not None:
            self._tick(self._share)

    def inner(self, part: float) -> Callable[[float], None]:
        """Return the `tick` of a search that is a step of this one, and takes this part of what is left."""
        begin, width = self._share, part * (self._end - self._share)

        def tick(share: float) -> None:
            self._share = begin + width * share
            self.repeat()

        return tick


# How well a draft explains scans: the likelihood of a fit, for every echo and every silence, with all reflections.


# few rays, because every trial searches all paths; the small walls of each would have to be solved anew
FOLLOWED = PredictionOptions(rays=720, max_bounces=5, small=False)
FOLLOWED_QUICKLY = PredictionOptions(rays=360, max_bounces=2, small=False)
# later echoes come by more reflections; without their paths, a wrong room can be more likely than the true one
FOLLOWED_LATER = PredictionOptions(rays=720, max_bounces=8, small=False)
# in a known room: an echo that it explains by many reflections would else speak for objects that do not exist
FOLLOWED_ALL = PredictionOptions(rays=720)
PRICE = 10.0  # log-likelihood that a wall or post must add
PRICE_OF_NUMBER = 7.0  # likewise, for another position or reflectance of what exists
CLEARLY = 1.0  # change of the log-likelihood of a reading that clearly speaks for or against a change
_ALIKE, _ALIKE_TURNED = 0.1, math.radians(8)  # m, rad, between a candidate and a refused wall or post
ROUGH = ReadingNoise(0.02, 2.0, 0.08, 0.03, 0.05)  # for walls not yet refined
FINE = ReadingNoise(0.01, 1.5, 0.05, 0.03, 0.03)
_DIGITS = 9  # of a log-likelihood; further ones differ between processors, and must not decide between equal drafts
_AT_ONCE = 8  # drafts between two checks whether the search is cancelled
_FIRST_SCANS = 2  # by which many drafts are compared at first
_LEAST_KEPT = 4  # drafts, at least, that are compared by all scans
_HOPELESS = 100.0  # log-likelihood: in no room so far, a draft worse by so much in some scans was the better one in all

_Result = TypeVar("_Result")


@dataclass(frozen=True)
class Course:
    """Where a search begins, what it leaves out, and the function that receives what it accepts."""

    start: RoomDraft | None = None  # its walls and posts move, but stay in the room; its places are not used
    refused: tuple[DraftWall | DraftPost, ...] = ()  # not found again
    accepted: Callable[[RoomDraft], None] | None = None  # receives each draft with which the search goes on
    likely: RoomDraft | None = None  # where the search begins a second time, with the places of these scans
    effort: Effort = Effort.NORMAL

    def refusing(self, wall: DraftWall) -> "Course":
        """Return the course of a search that does not find this wall again."""
        return replace(self, refused=(*self.refused, wall))

    @property
    def unseen(self) -> "Course":
        """The course of a part of the search whose result can be rejected."""
        return replace(self, accepted=None)

    def accept(self, draft: RoomDraft) -> None:
        """Report a draft with which the search goes on."""
        if self.accepted is not None:
            self.accepted(draft)


@dataclass(frozen=True)
class Evidence:
    """Scans and board, with which drafts are compared."""

    scans: tuple[PlacedScan, ...]
    problems: tuple[Problem, ...]  # one for each scan; room and place are those of the draft
    spreads: tuple[PoseSpread, ...]  # of the places; each is expected where the search begins, unless it says where
    first: RoomDraft  # with the walls and posts at which the search begins
    air: Air
    course: Course = field(default_factory=Course)
    # log-likelihoods of the readings of a scan, by all that they depend on: one draft in ten was scored before
    known: dict[bytes, FloatArray] = field(default_factory=dict, compare=False, repr=False)
    # compute the scans of a large search at once; None: this process computes all
    processes: LateProcesses | None = field(default=None, compare=False, repr=False)
    progress: SearchProgress = field(default_factory=SearchProgress, compare=False, repr=False)

    def log_likelihood(self, draft: RoomDraft, noise: ReadingNoise) -> float:
        """Return the log-likelihood of all scans plus the logarithm of the prior of their places."""
        return self.log_likelihoods([draft], noise)[0]

    def log_likelihoods(
        self, drafts: Sequence[RoomDraft], noise: ReadingNoise, scans: Sequence[int] | None = None
    ) -> list[float]:
        """Return `log_likelihood` of several drafts, of all scans or these. Many drafts at once use all processes."""
        by_scan = [
            of_draft
            for begin in range(0, len(drafts), _AT_ONCE)
            for of_draft in self._by_reading(drafts[begin : begin + _AT_ONCE], noise, scans)
        ]
        return [
            float(np.concatenate(of_draft).sum()) + self.log_prior(draft)
            for draft, of_draft in zip(drafts, by_scan, strict=True)
        ]

    def by_reading(self, draft: RoomDraft, noise: ReadingNoise) -> list[FloatArray]:
        """Return the log-likelihood of each reading, (n,) for each scan."""
        return self._by_reading([draft], noise)[0]

    def gains(self, before: RoomDraft, after: RoomDraft, noise: ReadingNoise) -> list[FloatArray]:
        """Return the log-likelihood of each reading in a draft minus that in another one, (n,) for each scan."""
        pairs = zip(self.by_reading(before, noise), self.by_reading(after, noise), strict=True)
        return [now - then for then, now in pairs]

    def _by_reading(
        self, drafts: Sequence[RoomDraft], noise: ReadingNoise, scans: Sequence[int] | None = None
    ) -> list[list[FloatArray]]:
        """Return `by_reading` of several drafts, of all scans or these."""
        self.progress.step()
        scans = range(len(self.problems)) if scans is None else scans
        rooms = [draft.room(self.air) for draft in drafts]
        keys = [[_key(draft, room, scan, noise) for scan in scans] for draft, room in zip(drafts, rooms, strict=True)]
        missing = {
            key: (draft, room, scan)
            for draft, room, of_draft in zip(drafts, rooms, keys, strict=True)
            for scan, key in zip(scans, of_draft, strict=True)
            if key not in self.known
        }
        self.known.update(zip(missing, self.in_processes(_of_scans, [*missing.values()], noise), strict=True))
        return [[self.known[key] for key in of_draft] for of_draft in keys]

    def in_processes(self, function: Callable[..., list[_Result]], items: Sequence[Any], *others: Any) -> list[_Result]:
        """Return `function(evidence, items, *others)`, a result for each item; a large search divides the items.

        The function is one of a module. An item takes about as long as the search for the paths of one scan.
        """
        processes = None if self.processes is None else self.processes.for_work(len(items), self, self._to_send)
        if processes is None or len(items) < 2:
            return function(self, items, *others)
        bounds = _bounds(len(items), len(processes))
        parts = processes.results(
            function, [(items[begin:end], *others) for begin, end in pairwise(bounds)], self.progress.repeat
        )
        return [result for part in parts for result in part]

    def of_first_echoes(self) -> "Evidence | None":
        """Return the evidence of the first echo of each reading; None if no reading has another one."""
        if all(len(reading.echo_times) < 2 for scan in self.scans for reading in scan.readings):
            return None
        problems = tuple(
            make_problem([scan], problem.room, problem.board, problem.parameters, problem.prediction, all_echoes=False)
            for scan, problem in zip(self.scans, self.problems, strict=True)
        )
        return replace(self, problems=problems, known={})

    def _to_send(self) -> "Evidence":
        """Return what other processes need of it."""
        problems = tuple(replace(problem, memory=PathMemory()) for problem in self.problems)
        return Evidence((), problems, self.spreads, RoomDraft(self.first.places), self.air)

    def of_draft(self, draft: RoomDraft, room: Room, scan: int, free: tuple[Parameter, ...] = ()) -> Problem:
        """Return the problem of one scan with `free` parameters; `room` is that of the draft."""
        board, places = as_found(self.problems[scan].board, draft), (draft.places[scan],)
        return replace(self.problems[scan], room=room, places=places, board=board, parameters=free)

    @property
    def board(self) -> Board:
        """The board of all scans, as its profile states it."""
        return self.problems[0].board

    @property
    def has_free_headings(self) -> bool:
        """Whether the heading of any scan is uncertain."""
        return any(spread.heading > 0 for spread in self.spreads)

    @cached_property
    def redundancy(self) -> float:
        """How many neighbouring readings have their error in common, if the profile states spreads; else 1.

        The readings of a real sensor on one wall are all too long or too short, those of a random error are not.
        """
        if not self.board.states_spread:
            return 1.0
        arrays = [problem.scans[0] for problem in self.problems]
        return float(np.mean([mean_run(of_scan.angles, of_scan.ranges[:, 0]) for of_scan in arrays]))

    def log_prior(self, draft: RoomDraft) -> float:
        """Return the logarithm of the prior of directions, places and sensor; 0 where they are as expected."""
        errors = [error for scan in range(len(self.spreads)) for error in self.pose_errors(draft, scan)]
        errors += [(draft.offset, self.offset_spread), (draft.threshold_db, self.threshold_spread)]
        return right_angles.log_prior(draft) - 0.5 * sum((away / sd) ** 2 for away, sd in errors if sd > 0)

    @property
    def offset_spread(self) -> float:
        """Standard deviation of the range offset, m: the spread of ranges that the profile states, 0 if it states none.

        A profile with a spread describes a population, of which the scans show one sensor.
        """
        return self.board.range_sd

    @property
    def threshold_spread(self) -> float:
        """Standard deviation of the threshold, dB: the one that the profile states, likewise."""
        return self.board.threshold_sd_db

    def refuses(self, surface: DraftWall | DraftPost) -> bool:
        """Return whether a wall or post is almost one that was refused."""
        return any(_alike(surface, other) for other in self.course.refused)

    def pose_errors(self, draft: RoomDraft, scan: int) -> tuple[tuple[float, float], ...]:
        """Return how far x, y (m) and heading (rad) of a place are from the expected ones, each with its deviation."""
        spread, now = self.spreads[scan], draft.places[scan]
        then = spread.around or self.first.places[scan]
        turned = math.remainder(now.heading - then.heading, math.tau)
        x, y = (coordinate - first for coordinate, first in zip(now.position, then.position, strict=True))
        return (x, spread.xy), (y, spread.xy), (turned, spread.heading)


@dataclass(frozen=True)
class Scored:
    """A draft and its log-likelihood."""

    draft: RoomDraft
    score: float


def as_found(board: Board, draft: RoomDraft) -> Board:
    """Return a board with the range offset and the threshold of a draft."""
    if not draft.offset and not draft.threshold_db:
        return board
    offset, threshold = board.range_offset + draft.offset, board.threshold_db + draft.threshold_db
    return replace(board, range_offset=offset, threshold_db=threshold)


def all_scored(evidence: Evidence, drafts: Iterable[RoomDraft], noise: ReadingNoise = ROUGH) -> list[Scored]:
    """Return drafts with their log-likelihoods; -inf if a wall has no length."""
    drafts = [draft.rounded() for draft in drafts]
    sound = [draft for draft in drafts if draft.is_sound]
    scores = iter(evidence.log_likelihoods(sound, noise))
    return [Scored(draft, next(scores) if draft.is_sound else -np.inf) for draft in drafts]


def scored(evidence: Evidence, draft: RoomDraft, noise: ReadingNoise = ROUGH) -> Scored:
    """Return a draft with its log-likelihood; -inf if a wall has no length."""
    return all_scored(evidence, [draft], noise)[0]


def leading(
    evidence: Evidence, drafts: Iterable[RoomDraft], scans: Sequence[int], noise: ReadingNoise = ROUGH
) -> list[Scored]:
    """Return the drafts that explain most, in their order, with the log-likelihoods of all scans.

    `scans` are all, in the order of their use: the first two select the better half of the drafts, the first half the
    better quarter, but not fewer than four (successive halving). So a scan should be early if more is unexplained.
    """
    left = [draft.rounded() for draft in drafts if draft.is_sound]
    total = len(left)
    for some, share in zip(_stages(scans), (2, 4), strict=True):
        kept = max(_LEAST_KEPT, -(-total // share))
        if kept < len(left) and len(some) < len(scans):
            scores = evidence.log_likelihoods(left, noise, some)
            best = sorted(range(len(left)), key=lambda row: -scores[row])[:kept]
            left = [left[row] for row in sorted(best)]
    return all_scored(evidence, left, noise)


def scored_if_near(evidence: Evidence, drafts: Sequence[RoomDraft], best: Scored) -> list[Scored]:
    """Return drafts with their log-likelihoods; -inf if some scans show that one is far worse than the best draft."""
    drafts = [draft.rounded() for draft in drafts]
    left, scans = [draft for draft in drafts if draft.is_sound], range(len(evidence.problems))
    for some in _stages(scans):
        if len(some) < len(scans):
            least = evidence.log_likelihoods([best.draft], ROUGH, some)[0] - _HOPELESS
            scores = evidence.log_likelihoods(left, ROUGH, some)
            left = [draft for draft, score in zip(left, scores, strict=True) if score > least]
    near = {id(candidate.draft): candidate for candidate in all_scored(evidence, left)}
    return [near.get(id(draft), Scored(draft, -np.inf)) for draft in drafts]


def _stages(scans: Sequence[int]) -> tuple[Sequence[int], Sequence[int]]:
    """Return the first scans, and the first half of all, but at least one more than these."""
    return scans[:_FIRST_SCANS], scans[: max(_FIRST_SCANS + 1, -(-len(scans) // 2))]


def _bounds(items: int, processes: int) -> list[int]:
    """Return where the parts of items begin and end that processes take in turn: large ones first, small ones last.

    Single ones would take longer, because the paths of several scans are searched together.
    """
    bounds, least = [0], -(-items // (4 * processes))
    while bounds[-1] < items:
        left = items - bounds[-1]
        bounds.append(bounds[-1] + min(left, max(least, left // (2 * processes))))
    return bounds


def _key(draft: RoomDraft, room: Room, scan: int, noise: ReadingNoise) -> bytes:
    """Return all that the log-likelihoods of the readings of a scan depend on; `room` is that of the draft."""
    place = draft.places[scan]
    others = np.array([*place.position, place.heading, draft.offset, draft.threshold_db, scan, *noise])
    surfaces = room.walls, room.posts, room.reflectances, room.scattered, room.heights
    return b"|".join(array.tobytes() for array in (others, *surfaces))


def _of_scans(
    evidence: Evidence, items: Sequence[tuple[RoomDraft, Room, int]], noise: ReadingNoise
) -> list[FloatArray]:
    """Return the log-likelihood of each reading of scans, (n,) each; items are a draft, its room, and a scan.

    The paths of the scans of one draft are searched together.
    """
    logarithms = []
    for _, of_draft in groupby(items, key=lambda item: id(item[1])):
        for objective in near_together([evidence.of_draft(*item) for item in of_draft]):
            values = objective.problem.with_noise(np.empty(0), noise)
            logarithms.append(np.round(objective.by_reading(values, 0), _DIGITS))
    return logarithms


def _alike(one: DraftWall | DraftPost, other: DraftWall | DraftPost) -> bool:
    if isinstance(one, DraftPost) and isinstance(other, DraftPost):
        return math.dist(one.center, other.center) < _ALIKE
    if not isinstance(one, DraftWall) or not isinstance(other, DraftWall):
        return False
    away, turned = np.array(one.middle) - other.middle, math.remainder(one.angle - other.angle, math.pi)
    ends = sorted(float((away + end.at * one.along) @ other.along) for end in one.ends)
    overlap = ends[0] < other.ends[1].at and ends[1] > other.ends[0].at
    return overlap and abs(float(away @ other.normal)) < _ALIKE and abs(turned) < _ALIKE_TURNED


def evidence_of(
    scans: Sequence[PlacedScan],
    spreads: Sequence[PoseSpread],
    board: Board,
    air: Air,
    course: Course | None = None,
    processes: LateProcesses | None = None,
    progress: SearchProgress | None = None,
    prediction: PredictionOptions | None = None,
) -> Evidence:
    """Return scans from places with these spreads as evidence, without readings of the carrier's own body.

    Likelihoods are those of this prediction, by default of one that follows more reflections if readings have several
    echoes, and few in a quick search.
    """
    course, progress = course or Course(), progress or SearchProgress()
    scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    several = any(len(reading.echo_times) > 1 for scan in scans for reading in scan.readings)
    if prediction is None:
        is_quick = course.effort is Effort.QUICK
        prediction = FOLLOWED_QUICKLY if is_quick else FOLLOWED_LATER if several else FOLLOWED
    first = RoomDraft(tuple(scan.place for scan in scans))
    nowhere = first.room(air)
    problems = tuple(make_problem([scan], nowhere, board, [], prediction, all_echoes=True) for scan in scans)
    first = first if course.start is None else replace(course.start, places=first.places)
    return Evidence(tuple(scans), problems, tuple(spreads), first, air, course, processes=processes, progress=progress)
