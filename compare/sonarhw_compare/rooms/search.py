"""Search for a room: a draft grows by walls and posts, is refined, and loses what the scans do not support."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import TypeVar

import numpy as np
from scipy.special import expit
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from sonarhw_compare.arcs import POSSIBLE, Arc, arcs_of, mappable
from sonarhw_compare.fit.likelihood import ReadingNoise
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import Located, Pose, PoseSpread, locate_scan
from sonarhw_compare.processes import LateProcesses
from sonarhw_compare.rooms import candidates
from sonarhw_compare.rooms.draft import (
    SPREAD,
    DraftEnd,
    DraftPost,
    DraftWall,
    RoomDraft,
    common_angle,
    long_direction,
    oblique,
    pulls,
)
from sonarhw_compare.rooms.effort import Effort
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
from sonarhw_compare.rooms.frame import SOLVED, in_frame, with_solved_headings
from sonarhw_compare.rooms.refinement import Move, centred, deviations_of, refined, threshold_deviation, with_threshold

# Growth of a draft: walls and posts are added while the scans speak for them, and removed where they do not.


_TRIED, _TRIED_QUICKLY = 8, 3  # candidates for walls at a time
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
    is_short = longer.score - best.score < PRICE or _newest_length(longer.draft) < _SHORT
    if is_short and evidence.course.effort is not Effort.QUICK:
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
    is_quick = evidence.course.effort is Effort.QUICK
    most = _TRIED_QUICKLY if is_quick else _TRIED
    found_lines = candidates.wall_candidates(arcs, unexplained, most, common_angle(best.draft))
    walls = [wall for wall in found_lines if not evidence.refuses(wall)]
    alone = all_scored(evidence, (best.draft.with_new_wall(wall)[0] for wall in walls), noise)
    tried = sorted(zip(alone, walls, strict=True), key=lambda scored_wall: -scored_wall[0].score)
    completed = [draft for _, wall in tried[:_COMPLETED] for draft in candidates.joined(best.draft, wall)]
    if not is_quick:
        points = [post.center for post in candidates.post_candidates(arcs, unexplained, _CORNERS, (0.0,))]
        completed += [
            draft
            for draft in (*candidates.cornered(best.draft, points), *candidates.continued(best.draft))
            if not evidence.refuses(draft.walls[max(draft.walls)])
        ]
    drafts = [
        *(alone_best for alone_best, _ in tried[:1]),
        *leading(evidence, completed, _least_explained(unexplained), noise),
    ]
    return max(drafts, key=lambda draft: draft.score, default=best)


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
    tried = max(all_scored(evidence, turned), key=lambda draft: draft.score)
    return refined(evidence, tried.draft, ROUGH, _SQUARING_STEPS) if math.isfinite(tried.score) else None


def squared_together(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with all walls that are almost at right angles exactly so, where this is more likely.

    Several short walls can be wrong by the same angle, of which none is more likely at another one alone.
    """
    draft = centred(best.draft)
    angle = long_direction(draft)
    for key, wall in draft.walls.items():
        away = math.remainder(wall.angle - angle, math.pi / 2)
        if abs(away) < _TOGETHER:
            draft = draft.with_wall(key, wall.moved(0.0, -away))
    if not draft.is_sound:
        return best
    squared_draft = refined(evidence, draft, ROUGH, _SQUARING_STEPS)
    return squared_draft if squared_draft.score > best.score else best


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
    for name, wall in walls.items():
        own = [replace(end, meets=key) if end.meets == other else end for end in wall.ends]
        walls[name] = replace(wall, ends=(own[0], own[1]))
    return replace(draft, walls={name: wall for name, wall in walls.items() if name != other})


# The room that scans show: growth, refinement, and what the scans do not show.


# shares of growth that are done after each of its rounds, the rest is for oblique walls; share of a search after growth
_ROUNDS_DONE, _SEARCHED_DONE = (0.72, 0.83, 0.89), 0.9
_REGROWN = 2  # times that walls grow in place of those that no range determines
LARGE = 1000  # searches of the paths of a scan, some seconds, after which a search is so large that processes pay
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
    unconfirmed: RoomDraft = field(default_factory=lambda: RoomDraft(()))  # walls and posts that were removed
    # by title of the scan: m from where it was stated to be, and the stated deviation, where this is improbable
    displaced: Mapping[str, tuple[float, float]] = field(default_factory=dict)

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
    is_quick = evidence.course.effort is Effort.QUICK
    best = _best(evidence, _glanced if is_quick else _searched, _SEARCHED_DONE)
    evidence.progress.begin(1.0)
    end, deviations = (_glanced_end if is_quick else _finished)(evidence, best)
    if not end.walls:
        raise InputError("no wall found: expected scans from at least two places that face the same walls")
    return _described(evidence, end, deviations)


def _described(evidence: Evidence, draft: RoomDraft, deviations: dict[Move, float]) -> FoundRoom:
    touches, of_threshold = candidates.touches_of(evidence, draft), threshold_deviation(evidence, draft)
    return FoundRoom(draft, deviations, touches, worth(scored(evidence, draft)), of_threshold)


def _best(evidence: Evidence, search: Callable[[Evidence, RoomDraft], RoomDraft], done: float) -> Scored:
    """Return the better result of searches from no walls and from a likely room; `done` is the share afterwards.

    A search that begins without walls can miss a better room. Without a likely room, or quickly, there is one search.
    """
    likely = evidence.course.likely
    begins = [evidence.first, *([] if likely is None else [likely])]
    if evidence.course.effort is Effort.QUICK:
        begins = begins[-1:]
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
        best = scored(evidence, in_frame(evidence, refined(evidence, longer.draft, ROUGH, _ROOM_STEPS).draft))
        best = squared(evidence, best)
        best = with_parts_joined(evidence, pruned(evidence, best))
        best = _cut_back(evidence, candidates.with_better_ends(evidence, best))
        best = candidates.with_free_ends_moved(evidence, best)
    evidence.progress.begin(1.0)
    return rebuilt(evidence, best).draft


def _glanced(evidence: Evidence, begin: RoomDraft) -> RoomDraft:
    """Return the draft after one round of growth and refinement, from a first one."""
    longer = pruned(evidence, grown(evidence, scored(evidence, begin)))
    return in_frame(evidence, refined(evidence, longer.draft, ROUGH, _ROOM_STEPS).draft)


def _glanced_end(evidence: Evidence, best: Scored) -> tuple[RoomDraft, dict[Move, float]]:
    """Return the best draft of a quick search, without walls that no range determines, and its deviations."""
    draft = refined(evidence, pruned(evidence, best).draft, FINE, _ROOM_STEPS, with_headings=True).draft
    for key in sorted(_undetermined(deviations_of(evidence, draft)) - evidence.first.walls.keys()):
        draft = without_part(draft, key)
    draft = in_frame(evidence, draft)
    return draft, deviations_of(evidence, draft)


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
    kept = in_frame(evidence, pruned(evidence, best).draft)
    draft = squared_together(evidence, refined(evidence, kept, ROUGH, _ROOM_STEPS)).draft
    draft = in_frame(evidence, refined(evidence, draft, FINE, _LAST_STEPS, with_headings=True).draft)
    draft, deviations = _clear(evidence, *determined(evidence, draft))
    return in_frame(evidence, draft), deviations


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
_HEADINGS_DONE = 0.03  # share of a search after headings are solved
_LOCATING, _TRYING = 0.02, 0.25  # of what is left of a part of the progress, for a scan and for a room or a scan alone
_TURNED_AGAIN = 2  # times that solved headings are determined in the room, and the room is found from these
_DISPLACED = 3.7  # standard deviations of a position, which one of 1000 right ones exceeds
_FEWEST_SCANS = 2  # scans, of which a room is found without one of them
_OTHER_HEADING = math.radians(1.5)  # rad, by which a heading in the room of the other scans is another one
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
    progress = SearchProgress(tick)
    progress.begin(_HEADINGS_DONE)
    scans, spreads = with_solved_headings(scans, spreads, board, _NARROW.heading, progress.inner(1.0))
    with LateProcesses(len(scans), LARGE) as processes:
        search = _Search(tuple(scans), tuple(spreads), board, air, progress, course or Course(), processes)
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
        # once more, because the last scans began at located positions, which are not refined
        if any(math.isinf(spreads[k].xy) for k in poses):
            search.progress.begin(1.0)
            again = search.room_with(stage, {}, 1.0, search.course.unseen)
            stage = max(again, stage, key=lambda candidate: candidate.found.worth)
        if search.course.effort is not Effort.QUICK:
            search, stage = search.turned_again(stage)
        if search.course.effort is Effort.THOROUGH:
            stage = search.found_without_each(stage)
        stage = search.confirmed(stage)
    tick(1.0)
    return replace(
        stage.found,
        scans=tuple(stage.refined.values()),
        poses={scans[k].title: found_here for k, found_here in sorted(poses.items())},
        left_out=tuple(scan.title for k, scan in enumerate(scans) if k not in stage.placed),
        displaced={
            scans[k].title: (away, spreads[k].xy)
            for k, scan in stage.refined.items()
            for away in [math.dist(scan.place.position, scans[k].place.position)]
            if away > _DISPLACED * spreads[k].xy
        },
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
        return self.spreads[k].xy <= _NARROW.xy and self.spreads[k].heading <= SOLVED

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
                rightly=True,
                tick=self.progress.inner(_LOCATING),
            )
            for k, scan in enumerate(self.scans)
            if (k not in stage.placed if numbers is None else k in numbers)
        }

    def turned_again(self, stage: _Stage) -> "tuple[_Search, _Stage]":
        """Return the search and its room after solved headings were determined in the room, while that is better."""
        search = self
        for _ in range(_TURNED_AGAIN):
            turned = search.turned(stage)
            if turned is None:
                break
            again = turned.room_with(stage, {}, 1.0, search.course.unseen)
            if again.found.worth <= stage.found.worth:
                break
            search, stage = turned, again
        return search, stage

    def found_without_each(self, stage: _Stage) -> _Stage:
        """Return the best room of those that begin with the room without one of the scans.

        A wall that one scan alone shows wrongly can keep the right walls from growing.
        """
        for k in stage.placed if len(stage.placed) > _FEWEST_SCANS else ():
            others = {other: scan for other, scan in stage.placed.items() if other != k}
            without = self.room_of(others, _TRYING, replace(self.course.unseen, likely=None))
            pose = stage.refined[k].place
            again = self.room_with(without, {k: pose}, _TRYING, self.course.unseen)
            stage = max(stage, again, key=lambda candidate: candidate.found.worth)
        return stage

    def confirmed(self, stage: _Stage) -> _Stage:
        """Return the room without the walls and posts that no two places confirm, refined again.

        If the profile states no spread, its sensor makes no errors that such walls explain, and all of them stay.
        """
        if not self.board.states_spread or len(stage.placed) < _FEWEST_SCANS:
            return stage
        scans, course = stage.placed, replace(self.course, effort=Effort.NORMAL)
        spreads = [self._spread(k, scan.place) for k, scan in scans.items()]
        evidence = evidence_of(
            list(scans.values()), spreads, self.board, self.air, course, self.processes, self.progress
        )
        before = stage.found.draft
        draft = candidates.confirmed(evidence, before)
        if draft == before or not draft.walls:  # without any wall, most scans do not fit, so the verdict says enough
            return stage
        removed = RoomDraft(
            (),
            {key: before.alone(key) for key in before.walls if key not in draft.walls},
            tuple(post for post in before.posts if post not in draft.posts),
        )
        draft = in_frame(evidence, refined(evidence, draft, FINE, _ROOM_STEPS, with_headings=True).draft)
        found = _described(evidence, draft, deviations_of(evidence, draft))
        return replace(stage, found=replace(found, unconfirmed=removed))

    def turned(self, stage: _Stage) -> "_Search | None":
        """Return the search from the headings that the room of the other scans shows; None if all are as they were.

        Headings are solved without a room. A wrong one has walls of its own in the room, by which it stays wrong.
        """
        scans, spreads = list(self.scans), list(self.spreads)
        for row, (k, now) in enumerate(stage.refined.items()):
            if self.spreads[k].heading < SOLVED:
                continue
            pose = self._among_others(stage, row, k)
            if pose is None or abs(math.remainder(pose.heading - now.place.heading, math.tau)) < _OTHER_HEADING:
                continue
            expected = replace(self.scans[k].place, heading=pose.heading)
            scans[k] = replace(self.scans[k], place=replace(expected, position=pose.position))
            spreads[k] = replace(self.spreads[k], around=expected)
        return None if scans == list(self.scans) else replace(self, scans=tuple(scans), spreads=tuple(spreads))

    def _among_others(self, stage: _Stage, row: int, k: int) -> Pose | None:
        """Return the most probable pose of a placed scan in the room without the walls that it alone has touched."""
        draft, expected = stage.found.draft, self.spreads[k].around or self.scans[k].place
        for key, seen in stage.found.touches.seen.items():
            draft = draft.without_only(key) if seen == {row} else draft
        try:
            return locate_scan(
                self.scans[k].readings,
                draft.room(self.air),
                stage.sensor(self.board),
                prediction=FOLLOWED,
                expected=expected,
                spread=PoseSpread(self.spreads[k].xy, math.inf),
                rightly=True,
                tick=self.progress.inner(_LOCATING),
            ).poses[0]
        except InputError:  # the other scans show no wall that this one can have seen
            return None

    def extended(self, stage: _Stage, located: Mapping[int, Located]) -> _Stage | None:
        """Return the room of one more scan, or of all that are sure; None if none of them can be placed.

        A quick search takes the most probable pose of each.
        """
        own = stage.explained(list(stage.placed))
        sure = [
            k
            for k, poses in located.items()
            if self.course.effort is Effort.QUICK
            or (poses.explained >= _AS_GOOD * own and poses.poses[0].probability >= _PROBABLE)
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

    def room_with(self, stage: _Stage, poses: Mapping[int, Pose | Place], part: float, course: Course) -> _Stage:
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
