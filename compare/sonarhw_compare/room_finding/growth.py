"""Growth of a draft: walls and posts are added while the scans speak for them, and removed where they do not."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from scipy.special import expit

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import ReadingNoise
from sonarhw_compare.map.arcs import Arc
from sonarhw_compare.room_finding.draft import DraftPost, RoomDraft
from sonarhw_compare.room_finding.evidence import (
    PRICE,
    ROUGH,
    Evidence,
    Scored,
    all_scored,
    as_found,
    leading,
    scored_if_near,
)
from sonarhw_compare.room_finding.refining.refinement import refined
from sonarhw_compare.room_finding.refining.threshold_search import with_threshold
from sonarhw_compare.room_finding.right_angles import common_angle
from sonarhw_compare.room_finding.surface_candidates import arcs_of_scans, post_candidates, wall_candidates
from sonarhw_compare.room_finding.wall_ends import continued, cornered, joined, with_better_ends

_TRIED = 8  # candidates for walls at a time
_SHORT = 0.5  # m: a new wall that is shorter could be a post
_POSTS = 6  # candidates for posts at a time; each takes more time than a wall
_COMPLETED = 2  # best walls, whose ends are tried at other walls
_CORNERS = 4  # points at which a corner is tried
_STEPS = 2  # of the refinement after each addition
_UNEXPLAINED = 2.0  # log-likelihood over that of a false echo at which a reading counts as half explained

_Part = TypeVar("_Part", int, DraftPost)  # the key of a wall, or a post


def grown(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft to which no wall and no post can be added that is worth its price.

    What is no longer worth its price is removed on the way.
    """
    arcs, nothing = _arcs(evidence, best.draft), evidence.by_reading(RoomDraft(best.draft.places), ROUGH)
    while True:
        unexplained = unexplained_readings(evidence, best.draft, ROUGH, nothing)
        longer = with_wall(evidence, best, arcs, unexplained)
        # a post looks like short walls; a corner looks like a post until its walls are known
        if longer.score - best.score < PRICE or _newest_length(longer.draft) < _SHORT:
            tried = longer, with_post(evidence, best, arcs, unexplained)
            longer = max(tried, key=lambda one: one.score)
        if longer.score - best.score < PRICE:
            return best
        longer = refined(evidence, with_better_ends(evidence, longer).draft, ROUGH, _STEPS)
        longer = with_threshold(evidence, longer)
        best, before = pruned(evidence, longer), best
        if worth(best) <= worth(before):
            return before
        evidence.course.accept(best.draft)


def _arcs(evidence: Evidence, draft: RoomDraft) -> tuple[Arc, ...]:
    """Return the arcs of all scans at the places of a draft."""
    placed = [replace(scan, place=place) for scan, place in zip(evidence.scans, draft.places, strict=True)]
    return arcs_of_scans(placed, as_found(evidence.board, draft))


def _newest_length(draft: RoomDraft) -> float:
    """Return the length of the last wall of a draft, m; 0 without walls."""
    return float(np.hypot(*np.diff(draft.segments[-1].reshape(2, 2), axis=0)[0])) if draft.walls else 0.0


def worth(one: Scored) -> float:
    """Return the log-likelihood less the price of all walls and posts."""
    return one.score - PRICE * (len(one.draft.walls) + len(one.draft.posts))


def pruned(evidence: Evidence, best: Scored, price: float = PRICE) -> Scored:
    """Return the draft without walls and posts that are not worth their price; those of the first draft stay."""
    keys = sorted(best.draft.walls.keys() - evidence.first.walls.keys())
    best = _without_worthless(evidence, best, keys, RoomDraft.without_wall, price)
    posts = best.draft.posts[len(evidence.first.posts) :]
    return _without_worthless(evidence, best, posts, _without_post, price)


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
        row = next((row for row, one in enumerate(tried) if best.score - one.score < price), None)
        if row is None:
            return best
        best, parts = tried[row], parts[row + 1 :]
    return best


def _without_post(draft: RoomDraft, post: DraftPost) -> RoomDraft:
    return replace(draft, posts=tuple(other for other in draft.posts if other is not post))


def unexplained_readings(
    evidence: Evidence, draft: RoomDraft, noise: ReadingNoise, nothing: list[FloatArray] | None = None
) -> list[FloatArray]:
    """Return a weight of each reading, 0 explained .. 1 like a false echo, by scan.

    `nothing` is the log-likelihood of the readings in an empty room, if known.
    """
    now = evidence.by_reading(draft, noise)
    nothing = evidence.by_reading(RoomDraft(draft.places), noise) if nothing is None else nothing
    return [expit(_UNEXPLAINED + none - one) for none, one in zip(nothing, now, strict=True)]


def with_wall(
    evidence: Evidence,
    best: Scored,
    arcs: tuple[Arc, ...],
    unexplained: list[FloatArray],
    noise: ReadingNoise = ROUGH,
) -> Scored:
    """Return the draft with the wall that explains most; the draft itself without a candidate."""
    found_lines = wall_candidates(arcs, unexplained, _TRIED, common_angle(best.draft))
    walls = [wall for wall in found_lines if not evidence.refuses(wall)]
    alone = all_scored(evidence, (best.draft.with_new_wall(wall)[0] for wall in walls), noise)
    tried = sorted(zip(alone, walls, strict=True), key=lambda one: -one[0].score)
    completed = [draft for _, wall in tried[:_COMPLETED] for draft in joined(best.draft, wall)]
    points = [post.center for post in post_candidates(arcs, unexplained, _CORNERS, (0.0,))]
    completed += [
        draft
        for draft in (*cornered(best.draft, points), *continued(best.draft))
        if not evidence.refuses(draft.walls[max(draft.walls)])
    ]
    found = [*(one for one, _ in tried[:1]), *leading(evidence, completed, _least_explained(unexplained), noise)]
    return max(found, key=lambda one: one.score, default=best)


def with_post(
    evidence: Evidence,
    best: Scored,
    arcs: tuple[Arc, ...],
    unexplained: list[FloatArray],
    noise: ReadingNoise = ROUGH,
) -> Scored:
    """Return the draft with the post that explains most; the draft itself without a candidate."""
    posts = [post for post in post_candidates(arcs, unexplained, _POSTS) if not evidence.refuses(post)]
    drafts = (replace(best.draft, posts=(*best.draft.posts, post)) for post in posts)
    found = leading(evidence, drafts, _least_explained(unexplained), noise)
    return max(found, key=lambda one: one.score, default=best)


def _least_explained(unexplained: list[FloatArray]) -> list[int]:
    """Return the scans in order, that of which most is unexplained first."""
    return sorted(range(len(unexplained)), key=lambda scan: -float(unexplained[scan].sum()))
