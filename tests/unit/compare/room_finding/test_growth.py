"""Growth reports its progress, and adds walls before posts."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.room_finding import growth
from sonarhw_compare.room_finding.draft import DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.room_finding.evidence import Course, Evidence, Scored
from sonarhw_compare.room_finding.growth import Gains, grown, with_post


def grow(monkeypatch: pytest.MonkeyPatch, lengths: list[float], post: float) -> tuple[list[str], list[float]]:
    """Return what is added, "w" or "p", and the reported shares, if walls of `lengths` (m) are found one by one.

    Each wall adds 20 to the log-likelihood, the only post adds `post`.
    """

    def with_wall(_evidence: object, best: Scored, *_: object) -> Scored:
        number = len(best.draft.walls)
        if number == len(lengths):
            return best
        half = lengths[number] / 2
        wall = DraftWall((0.0, float(number)), 0.0, (DraftEnd(-half), DraftEnd(half)))
        return Scored(best.draft.with_new_wall(wall)[0], best.score + 20.0)

    def with_post(_evidence: object, best: Scored, *_: object) -> Scored:
        first = not best.draft.posts
        return Scored(replace(best.draft, posts=(DraftPost((0.5, 0.5), 0.1),)), best.score + (post if first else 0.0))

    def refined(_evidence: object, draft: RoomDraft, *_: object) -> Scored:
        return Scored(draft, 20.0 * (len(draft.walls) + len(draft.posts)))

    added: list[str] = []

    def accepted(draft: RoomDraft) -> None:
        added.append("w" if len(draft.walls) > added.count("w") else "p")

    for name, function in (("with_wall", with_wall), ("with_post", with_post), ("refined", refined)):
        monkeypatch.setattr(growth, name, function)
    for name in ("with_better_ends", "pruned"):
        monkeypatch.setattr(growth, name, lambda _evidence, one: one)
    monkeypatch.setattr(growth, "unexplained_readings", lambda *_: [])
    evidence = SimpleNamespace(by_reading=lambda *_: [np.zeros(1)], course=Course(accepted=accepted))
    shares: list[float] = []
    grown(cast(Evidence, evidence), (), Scored(RoomDraft(()), 0.0), shares.append)
    return added, shares


def test_the_share_grows_with_each_wall_and_stays_below_1(monkeypatch: pytest.MonkeyPatch) -> None:
    added, shares = grow(monkeypatch, [1.0] * 12, 0.0)
    assert len(added) == len(shares) == 12
    assert np.diff([0.0, *shares]).min() > 0.0
    assert shares[-1] < 1.0


def test_posts_follow_the_walls_because_a_corner_looks_like_a_post(monkeypatch: pytest.MonkeyPatch) -> None:
    added, _ = grow(monkeypatch, [1.0, 1.0, 1.0], 60.0)
    assert added == ["w", "w", "w", "p"]


def test_a_short_wall_competes_with_a_post(monkeypatch: pytest.MonkeyPatch) -> None:
    assert grow(monkeypatch, [1.0, 0.2, 1.0], 60.0)[0] == ["w", "p", "w", "w"]
    assert grow(monkeypatch, [1.0, 0.2, 1.0], 15.0)[0] == ["w", "w", "w", "p"]


def posts_tried(monkeypatch: pytest.MonkeyPatch, now: list[float], before: list[float]) -> tuple[list[int], int]:
    """Return the numbers of the posts that are tried, and of the one found, if they gain `now` and gained `before`."""
    posts = [DraftPost((float(number), 0.0), 0.1) for number in range(len(now))]
    tried: list[int] = []

    def scored(_evidence: object, draft: RoomDraft, *_: object) -> Scored:
        tried.append(posts.index(draft.posts[-1]))
        return Scored(draft, 100.0 + now[tried[-1]])

    monkeypatch.setattr(growth, "post_candidates", lambda *_: posts)
    monkeypatch.setattr(growth, "scored", scored)
    gains: Gains = dict(zip(posts, before, strict=False))
    evidence = cast(Evidence, SimpleNamespace(refuses=lambda _: False))
    found = with_post(evidence, Scored(RoomDraft(()), 100.0), (), [], gains=gains)
    return sorted(tried), posts.index(found.draft.posts[-1])


def test_what_gained_less_than_another_one_gains_now_is_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    assert posts_tried(monkeypatch, [30.0, 60.0, 40.0], [35.0, 80.0, 50.0]) == ([1], 1)
    assert posts_tried(monkeypatch, [30.0, 20.0, 40.0], [35.0, 80.0, 50.0]) == ([1, 2], 2)
    # a new one is always tried
    assert posts_tried(monkeypatch, [30.0, 60.0, 70.0], [35.0, 80.0]) == ([1, 2], 2)


def test_all_are_tried_again_before_growth_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    # 8 is less than the price, so the one that gained least before is tried too
    assert posts_tried(monkeypatch, [8.0, 5.0, 25.0], [9.0, 7.0, -50.0]) == ([0, 1, 2], 2)
