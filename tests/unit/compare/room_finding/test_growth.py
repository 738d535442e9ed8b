"""Growth adds walls before posts, and can begin with a likely room."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.rooms import candidates, search
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft, draft_of_room
from sonarhw_compare.rooms.evidence import Course, Evidence, Scored
from sonarhw_compare.rooms.search import find_room, grown
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import InputError
from sonarhw.readings import Reading

SPEED = 343.0  # m/s


def grow(monkeypatch: pytest.MonkeyPatch, lengths: list[float], post: float) -> list[str]:
    """Return what is added, "w" or "p", if walls of `lengths` (m) are found one by one.

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
        monkeypatch.setattr(search, name, function)
    for module, name in ((candidates, "with_better_ends"), (search, "pruned")):
        monkeypatch.setattr(module, name, lambda _evidence, draft: draft)
    for name in ("unexplained_readings", "_arcs"):
        monkeypatch.setattr(search, name, lambda *_: [])
    evidence = SimpleNamespace(
        by_reading=lambda *_: [np.zeros(1)], course=Course(accepted=accepted), threshold_spread=0.0, price=10.0
    )
    grown(cast(Evidence, evidence), Scored(RoomDraft(()), 0.0))
    return added


def test_posts_follow_the_walls_because_a_corner_looks_like_a_post(monkeypatch: pytest.MonkeyPatch) -> None:
    assert grow(monkeypatch, [1.0, 1.0, 1.0], 60.0) == ["w", "w", "w", "p"]


def test_a_short_wall_competes_with_a_post(monkeypatch: pytest.MonkeyPatch) -> None:
    assert grow(monkeypatch, [1.0, 0.2, 1.0], 60.0) == ["w", "p", "w", "w"]
    assert grow(monkeypatch, [1.0, 0.2, 1.0], 15.0) == ["w", "w", "w", "p"]


def test_a_search_that_finds_nothing_keeps_a_likely_room_at_its_places(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "grown", lambda _evidence, best: best)
    room, place = load_room("kuc_siegel"), Place("here", (0.8, 0.8))
    board = replace(load_board("polaroid-6500"), receiver="first-echo")
    headings = np.radians(np.arange(0.0, 360.0, 10.0))
    ranges = predict_scan(room, place, board, headings).ranges
    readings = [
        Reading(k, 0, k, angle, angle, () if math.isnan(one) else (2 * one / SPEED,), SPEED)
        for k, (angle, one) in enumerate(zip(headings.tolist(), ranges.tolist(), strict=True))
    ]
    likely = replace(draft_of_room(room), places=(place,))
    far = likely.with_new_wall(DraftWall((0.8, 0.5), 0.0, (DraftEnd(-0.2), DraftEnd(0.2))))[0]  # in front of echoes
    found = find_room([PlacedScan(readings, place)], board, room.air, course=Course(likely=far))
    assert found.draft.segments == pytest.approx(likely.segments, abs=0.05)
    with pytest.raises(InputError, match="no wall found"):
        find_room([PlacedScan(readings, place)], board, room.air)
