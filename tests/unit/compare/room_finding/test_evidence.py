"""The likelihood of scans is computed once for each room."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit.objective import Problem
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.draft import REFLECTANCE, DraftEnd, DraftWall, RoomDraft, draft_of_room
from sonarhw_compare.rooms.evidence import (
    PRICE,
    ROUGH,
    all_scored,
    evidence_of,
    leading,
    scored,
    scored_if_near,
)
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading

AIR, HERE = Air(), Place("here", (0.0, 0.0))
READING = Reading(0, 0, 0, 0.0, 0.0, (6.0 / AIR.speed_of_sound,), AIR.speed_of_sound)
EVIDENCE = evidence_of([PlacedScan([READING], HERE)], [PoseSpread()], load_board("polaroid-6500"), AIR)
EAST = RoomDraft((HERE,), {0: DraftWall((3.0, 0.0), math.pi / 2, (DraftEnd(-1.0), DraftEnd(1.0)))})


def known_room(reflectance: float) -> RoomDraft:
    """Return a draft that adds nothing to a known room with one wall."""
    room = EAST.room(AIR)
    return RoomDraft((HERE,), base=replace(room, reflectances=np.full_like(room.reflectances, reflectance)))


def test_a_draft_is_searched_for_paths_once(monkeypatch: pytest.MonkeyPatch) -> None:
    before = replace(EVIDENCE, known={}).log_likelihood(EAST, ROUGH)
    fresh, searched = replace(EVIDENCE, known={}), []
    near = Problem.near
    monkeypatch.setattr(Problem, "near", lambda problem, values: searched.append(1) or near(problem, values))
    assert [fresh.log_likelihood(EAST, ROUGH) for _ in range(3)] == [before] * 3
    assert len(searched) == 1


@pytest.mark.parametrize(
    "other",
    [
        EAST.with_wall(0, EAST.walls[0].moved(-0.01, 0.0)),
        replace(EAST, offset=0.01),
        replace(EAST, places=(replace(HERE, heading=math.radians(6)),)),
        replace(EAST, places=(replace(HERE, position=(0.01, 0.0)),)),
        known_room(0.001),
    ],
    ids=["wall", "offset", "heading", "position", "reflectance"],
)
def test_a_change_of_the_room_or_the_pose_changes_the_likelihood(other: RoomDraft) -> None:
    evidence = replace(EVIDENCE, known={})
    first = evidence.log_likelihood(EAST, ROUGH)
    assert evidence.log_likelihood(known_room(REFLECTANCE), ROUGH) == first
    assert evidence.log_likelihood(other, ROUGH) != first


def east_wall(distance: float) -> RoomDraft:
    """Return the only wall of `BESIDE`, this far away."""
    wall = DraftWall((distance, 0.0), math.pi / 2, (DraftEnd(-3.0), DraftEnd(3.0)))
    return RoomDraft(tuple(PLACES), {0: wall})


PLACES = [Place(f"p{k}", (0.0, 0.2 * k)) for k in range(6)]
# 40 readings of a wall 3 m away from each place
BESIDE = evidence_of(
    [PlacedScan([READING] * 40, place, place.name) for place in PLACES],
    [PoseSpread()] * 6,
    load_board("polaroid-6500"),
    AIR,
)


def test_the_best_of_many_drafts_is_found_without_all_scans_of_the_others() -> None:
    evidence = replace(BESIDE, known={})
    drafts = [east_wall(2.0 + 0.1 * k).rounded() for k in range(20)]
    found = leading(evidence, drafts, [3, 1, 0, 2, 4, 5])
    best = max(found, key=lambda one: one.score)
    assert best == scored(BESIDE, drafts[10])
    assert [one.draft for one in found] == [draft for draft in drafts if any(draft is one.draft for one in found)]
    assert (
        len(evidence.known) == 20 * 2 + 10 * 1 + 5 * 3
    )  # two scans of all, one more of the better half, the rest of the best quarter


def test_a_draft_that_some_scans_show_to_be_far_worse_needs_no_others() -> None:
    evidence, best = replace(BESIDE, known={}), scored(BESIDE, east_wall(3.0))
    near, far = east_wall(3.01).rounded(), east_wall(2.0).rounded()
    assert scored_if_near(evidence, [far, near], best) == [
        replace(best, draft=far, score=-math.inf),
        scored(BESIDE, near),
    ]
    assert len(evidence.known) == 6 + 2 + 3  # of the near one, of the far one, and of the best one, for comparison
    assert all_scored(BESIDE, [far])[0].score < best.score - 100


def test_all_echoes_of_a_room_are_more_likely_in_it_than_in_one_with_a_gap() -> None:
    arena, board = load_room("arena"), load_board("polaroid-6500")
    angles, speed = np.radians(np.arange(0.0, 360.0, 10.0)), arena.air.speed_of_sound
    scans = []
    for place in (arena.places[name] for name in ("p2", "p4")):
        predicted = predict_scan(arena, place, board, angles)
        times = [tuple(predicted.ping(k).echo_times().tolist()) for k in range(len(angles))]
        readings = [Reading(k, 0, 0, angle, 0.1 * k, times[k], speed) for k, angle in enumerate(angles.tolist())]
        scans.append(PlacedScan(tuple(readings), place))
    evidence = evidence_of(scans, [PoseSpread()] * 2, board, arena.air)
    true = replace(draft_of_room(arena), places=evidence.first.places)
    key = arena.names.index("divider")
    shorter = true.walls[key].with_end(1, DraftEnd(true.extent(key)[1] - 0.06))
    assert scored(evidence, true).score > scored(evidence, true.with_wall(key, shorter)).score + PRICE
