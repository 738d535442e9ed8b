"""The room that scans show: growth, refinement, and what the scans do not show."""

import math
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace

from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, without_own_body

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.fit.values.given_twice import check_given_once
from sonarhw_compare.locate.pose_spread import PoseSpread
from sonarhw_compare.processes.late_processes import LateProcesses
from sonarhw_compare.room_finding.draft import RoomDraft
from sonarhw_compare.room_finding.evidence import (
    FINE,
    PRICE,
    ROUGH,
    Course,
    Evidence,
    Scored,
    evidence_of,
    scored,
)
from sonarhw_compare.room_finding.growth import grown, pruned, worth
from sonarhw_compare.room_finding.refining.moves import Move
from sonarhw_compare.room_finding.refining.refinement import deviations_of, refined
from sonarhw_compare.room_finding.refining.squaring import squared, squared_together, turned_square
from sonarhw_compare.room_finding.refining.threshold_search import threshold_deviation
from sonarhw_compare.room_finding.refining.wall_parts import with_parts_joined, without_part
from sonarhw_compare.room_finding.right_angles import oblique
from sonarhw_compare.room_finding.touches import Touches, touches_of, trimmed
from sonarhw_compare.room_finding.wall_ends import with_better_ends, with_free_ends_moved, with_gaps
from sonarhw_compare.search_progress import SearchProgress

# shares of growth that are done after each of its rounds, the rest is for oblique walls; share of a search after growth
_ROUNDS_DONE, _SEARCHED_DONE = (0.72, 0.83, 0.89), 0.9
_REGROWN = 2  # times that walls grow in place of those that no range determines
LARGE = 500  # searches of the paths of a scan, some seconds, after which a search is so large that processes pay
_STEPS, _LAST_STEPS = 4, 8  # of a refinement
_CLEAR_PRICE = 25.0  # log-likelihood: in real scans, false walls and posts added 11 to 24, true ones 32 and more
_UNKNOWN, _UNKNOWN_TURN = 0.06, math.radians(5.4)  # m, rad: standard deviations of a wall that is not reported


@dataclass(frozen=True)
class FoundRoom:
    """A room found from scans."""

    draft: RoomDraft
    deviations: dict[Move, float]  # m or rad: standard deviations
    touches: Touches
    worth: float  # log-likelihood of all scans, less the price of all walls and posts
    threshold_deviation: float | None = None  # dB: standard deviation; None if the board states that it is exact

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
    scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    if board.ring is not None:
        raise InputError(f"board {board.name!r} is a ring of sensors; a map needs a turntable")
    if all(reading.range is None for scan in scans for reading in scan.readings):
        raise InputError("nothing to map: no reading has an echo")
    check_given_once(scans)
    own = LateProcesses(len(scans), LARGE) if processes is None else nullcontext(processes)
    with own as used:
        spreads, progress = spreads or [PoseSpread()] * len(scans), SearchProgress(tick)
        found = _found(evidence_of(scans, spreads, board, air, course, used, progress))
    tick(1.0)
    return found


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
    touches, of_threshold = touches_of(evidence, end), threshold_deviation(evidence, end)
    return FoundRoom(end, deviations, touches, worth(scored(evidence, end)), of_threshold)


def _best(evidence: Evidence, search: Callable[[Evidence, RoomDraft], RoomDraft], done: float) -> Scored:
    """Return the better result of searches from no walls and from a likely room; `done` is the share afterwards.

    A search that begins without walls can miss a better room. Without a likely room, there is one search.
    """
    likely = evidence.course.likely
    begins = [evidence.first, *([] if likely is None else [likely])]
    found: list[Scored] = []
    for number, begin in enumerate(begins):
        evidence.progress.begin(done * (number + 1) / len(begins))
        course = evidence.course if number == 0 else evidence.course.unseen
        way = replace(evidence, course=course, progress=SearchProgress(evidence.progress.inner(1.0)))
        found.append(scored(evidence, _in_turn(way, search, begin)))
    best = max(found, key=worth)
    if best is not found[0]:
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
        best = scored(evidence, refined(evidence, longer.draft, ROUGH, _STEPS).draft)
        best = squared(evidence, best)
        best = with_parts_joined(evidence, pruned(evidence, best))
        best = _cut_back(evidence, with_better_ends(evidence, best))
        best = with_free_ends_moved(evidence, best)
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
            other = _regrown(trial, scored(trial, best.draft.without_wall(key)))
            if worth(other) > worth(best):
                best = other
                evidence.course.accept(best.draft)
    return best


def _regrown(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft after more growth."""
    longer = grown(evidence, best)
    return squared(evidence, scored(evidence, refined(evidence, longer.draft, ROUGH, _STEPS).draft))


def _finished(evidence: Evidence, best: Scored) -> tuple[RoomDraft, dict[Move, float]]:
    """Return the best draft, refined without haste, and its deviations."""
    kept = pruned(evidence, best).draft
    draft = squared_together(evidence, refined(evidence, kept, ROUGH, _STEPS)).draft
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
    touches = touches_of(evidence, best.draft)
    least = best.score - PRICE
    cut = scored(evidence, trimmed(best.draft, touches, evidence.first))
    if cut.score <= least:
        cut = best
        for key in touches.walls:
            tried = scored(evidence, trimmed(cut.draft, touches, evidence.first, key))
            cut = tried if tried.score > least else cut
    return with_gaps(evidence, cut, touches.walls)
