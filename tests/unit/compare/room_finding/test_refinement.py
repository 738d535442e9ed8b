"""Refinement of a found room by its ranges: derivatives, agreement with the true room, and stated uncertainties."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.draft import DraftPost, RoomDraft, draft_of_room
from sonarhw_compare.rooms.evidence import FINE, FOLLOWED, ROUGH, Evidence, evidence_of, scored
from sonarhw_compare.rooms.refinement import (
    Move,
    deviations_of,
    heading_error,
    moves_of,
    range_errors,
    refined,
    threshold_deviation,
    with_threshold,
)
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.readings import Reading

BOARD = load_board("hc-sr04")  # hears only loud echoes, so the search of paths is quick
SENSITIVE = load_board("polaroid-6500")
ROOM = parse_room(
    """name = "L"
[materials.wall]
reflectance = 0.9
[[walls]]
name = "w"
points = [[0.0, 0.0], [3.0, 0.1], [3.0, 1.4], [1.8, 1.4], [1.8, 2.4], [0.0, 2.4]]
closed = true
material = "wall"
[[posts]]
name = "post"
center = [0.9, 1.5]
radius = 0.06
material = "wall"
""",
    "L",
)
PLACES = tuple(Place(name, at) for name, at in (("a", (0.6, 0.7)), ("b", (1.3, 1.9)), ("c", (2.4, 0.6))))
ANGLES = np.arange(0.0, math.tau, math.radians(4))


def scans_of(room: Room, places: Sequence[Place], board: Board, noise: float, seed: int) -> list[PlacedScan]:
    """Return scans with errors of range, m."""
    random = np.random.default_rng(seed)
    speed, scans = room.air.speed_of_sound, []
    for place in places:
        ranges = predict_scan(room, place, board, ANGLES + place.heading, FOLLOWED).ranges
        ranges = ranges + random.normal(0, noise, len(ranges))
        times = [() if math.isnan(one) else (2 * one / speed,) for one in ranges.tolist()]
        readings = [
            Reading(k, 0, 0, angle, 0.1 * k, time, speed)
            for k, (angle, time) in enumerate(zip(ANGLES.tolist(), times, strict=True))
        ]
        scans.append(PlacedScan(readings, place, place.name))
    return scans


def case(
    noise: float = 0.0,
    seed: int = 0,
    spread: PoseSpread | None = None,
    places: Sequence[Place] = PLACES,
    board: Board = BOARD,
) -> tuple[Evidence, RoomDraft]:
    """Return scans as evidence, and the true room as a draft."""
    scans = scans_of(ROOM, PLACES, board, noise, seed)
    given = [replace(scan, place=place) for scan, place in zip(scans, places, strict=True)]
    evidence = evidence_of(given, [spread or PoseSpread()] * len(scans), board, ROOM.air)
    return evidence, replace(draft_of_room(ROOM), places=tuple(places))


def off(draft: RoomDraft, true: RoomDraft, key: int) -> tuple[float, float]:
    """Return how far the middle of a wall is from the true line, m, and how far it is turned, rad."""
    wall, segment = true.walls[key], draft.segment(key)
    middle = (segment[:2] + segment[2:]) / 2
    return float((middle - wall.middle) @ wall.normal), draft.walls[key].angle - wall.angle


def test_derivatives_agree_with_a_new_search_of_paths() -> None:
    # without late detection, by which a range depends on levels too
    evidence, draft = case(spread=PoseSpread(0.1, 0.1), board=replace(BOARD, receiver=Receiver.FIRST_ECHO))
    moves = moves_of(evidence, draft)
    found = range_errors(evidence, draft, moves)
    assert found.of_range > 200
    checked = 0
    for row, move in enumerate(moves):
        by = 1e-4
        other = range_errors(evidence, move.of(draft, by), moves)
        if other.of_range != found.of_range:  # an echo has appeared or disappeared
            continue
        change = (found.errors[: found.of_range] - other.errors[: found.of_range]) * FINE.range / by
        expected = found.slopes[: found.of_range, row] * FINE.range
        # a few headings have another path now
        assert (np.abs(change - expected) < 0.01).mean() > 0.98, move
        checked += int((np.abs(expected) > 0.1).sum())
    assert checked > 500


def test_a_room_that_is_off_returns_to_the_true_one() -> None:
    evidence, true = case(noise=0.01, seed=1)
    start, random = true, np.random.default_rng(2)
    for move in moves_of(evidence, true):
        if move.what == "wall" and move.part < 2:
            start = move.of(start, random.choice([-1, 1]) * (0.02 if move.part == 0 else math.radians(1.5)))
    found = refined(evidence, start, ROUGH, 8)
    assert found.score > evidence.log_likelihood(start, ROUGH) + 50
    for key in true.walls:
        offset, turn = off(found.draft, true, key)
        assert abs(offset) < 0.006, key
        assert abs(turn) < math.radians(1), key


@pytest.mark.parametrize("seed", range(3))
def test_the_last_digits_of_the_algebra_do_not_change_the_result(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    evidence, true = case(0.003)
    moves = moves_of(evidence, true)
    draft = moves[0].of(moves[1].of(true, 0.02), 0.01)
    expected = refined(evidence, draft, ROUGH, 2)
    solve, random = np.linalg.solve, np.random.default_rng(seed)

    def of_another_processor(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
        step = solve(matrix, right)
        return step * (1 + random.normal(0, 1e-13, step.shape))

    monkeypatch.setattr(np.linalg, "solve", of_another_processor)
    other = refined(evidence, draft, ROUGH, 2)
    assert expected.draft != draft.rounded()  # it has moved
    assert (other.draft, other.score) == (expected.draft, expected.score)


def test_a_draft_without_walls_stays_as_it_is() -> None:
    evidence, true = case()
    empty = RoomDraft(true.places)
    assert moves_of(evidence, empty) == []
    assert refined(evidence, empty, ROUGH, 1).draft == empty


def test_stated_deviations_hold_the_truth() -> None:
    held, widest = [], 0.0
    for seed in range(8):
        evidence, true = case(noise=0.01, seed=seed)
        found = refined(evidence, true, ROUGH, 4)
        for move, deviation in deviations_of(evidence, found.draft).items():
            if move.what == "wall" and move.part < 2:
                held.append(abs(off(found.draft, true, move.which)[move.part]) <= 1.96 * deviation)
                widest = max(widest, deviation if move.part == 0 else 0.0)
    assert 0.88 < np.mean(held) <= 1.0  # of 96, of which 95 % are 91
    assert widest < 0.01


def test_what_the_ranges_do_not_determine_is_stated_as_unknown() -> None:
    evidence, true = case()
    hidden = replace(true, posts=(*true.posts, DraftPost((5.0, 5.0), 0.05)))  # outside the room
    deviations = deviations_of(evidence, hidden)
    assert deviations[next(move for move in deviations if (move.what, move.which) == ("post", 1))] > 0.2
    assert deviations[next(move for move in deviations if (move.what, move.which, move.part) == ("wall", 0, 0))] < 0.01


def test_uncertain_places_make_walls_uncertain() -> None:
    exact, rough = (deviations_of(*case(spread=spread)) for spread in (PoseSpread(), PoseSpread(0.03, 0.03)))
    first = [move for move in exact if move.what == "wall" and move.part == 0]
    # three places share their error
    assert min(rough[move] for move in first) > 0.03 / math.sqrt(3) * 0.9
    assert max(exact[move] for move in first) < 0.01


@pytest.mark.parametrize("part", [0, 1, 2])
def test_a_place_that_is_off_returns(part: int) -> None:
    wrong = Move("place", 1, part).of(RoomDraft(PLACES), 0.02 if part < 2 else math.radians(2))
    evidence, draft = case(spread=PoseSpread(0.03, math.radians(3)), places=wrong.places)
    evidence = replace(evidence, spreads=(PoseSpread(), PoseSpread(0.03, math.radians(3)), PoseSpread()))
    found = refined(evidence, draft, ROUGH, 8).draft.places[1]
    assert math.dist(found.position, PLACES[1].position) < 0.006
    assert abs(found.heading) < math.radians(1)


def test_headings_follow_from_where_echoes_begin_and_end() -> None:
    spread, held = PoseSpread(0.05, math.radians(3)), []
    for seed in range(4):
        random = np.random.default_rng((seed, 7))
        turned = [replace(place, heading=float(random.normal(0, spread.heading))) for place in PLACES[1:]]
        evidence, draft = case(noise=0.01, seed=seed, spread=spread, places=(PLACES[0], *turned), board=SENSITIVE)
        evidence = replace(evidence, spreads=(PoseSpread(), spread, spread))
        found = refined(evidence, draft, FINE, 8, with_headings=True).draft
        deviations = deviations_of(evidence, found)
        for move in (Move("place", scan, 2) for scan in (1, 2)):
            heading = found.places[move.which].heading
            # middles of echoes, 4° between readings, have errors of up to 2°
            assert abs(heading) < math.radians(0.4), (seed, move.which)
            held.append(abs(heading) <= 1.96 * deviations[move])
    assert sum(held) >= len(held) - 1


@pytest.mark.parametrize(("deviation", "is_reached"), [(6.0, True), (3.0, False)])
def test_headings_are_searched_as_far_as_they_are_uncertain(deviation: float, is_reached: bool) -> None:
    spread = PoseSpread(0.0, math.radians(deviation))
    turned = [replace(PLACES[1], heading=math.radians(11)), replace(PLACES[2], heading=math.radians(-11))]
    evidence, draft = case(noise=0.01, spread=spread, places=(PLACES[0], *turned))
    errors = [heading_error(evidence, draft, draft.room(ROOM.air), scan)[0] for scan in (1, 2)]
    near = [abs(math.degrees(error) - true) < 1.5 for error, true in zip(errors, (-11, 11), strict=True)]
    assert near == [is_reached, is_reached]


def test_exact_headings_need_no_search_of_headings() -> None:
    exact, uncertain = (
        range_errors(*one, moves_of(*one), with_headings=True) for one in (case(), case(spread=PoseSpread(0.0, 0.02)))
    )
    assert (exact.of_heading, uncertain.of_heading) == (0, len(PLACES))


def test_an_echo_that_a_nearer_one_cuts_off_says_nothing_of_directions() -> None:
    places = (Place("near the wall", (2.6, 0.95)), *PLACES)
    scans = scans_of(ROOM, places, BOARD, 0.0, 0)
    evidence = evidence_of(scans, [PoseSpread()] * len(scans), BOARD, ROOM.air)
    true = replace(draft_of_room(ROOM), places=places)
    found = range_errors(evidence, true, moves_of(evidence, true))
    bearings = found.errors[found.of_range :]
    assert len(bearings) > 10
    assert np.abs(bearings).max() < 1.5  # standard deviations of 2°; headings are 4° apart


def test_a_range_offset_is_found_if_the_board_describes_a_population() -> None:
    of_population, exact = (replace(BOARD, range_sd=spread) for spread in (0.016, 0.0))
    true = replace(draft_of_room(ROOM), places=PLACES)
    scans = scans_of(ROOM, PLACES, replace(BOARD, range_offset=0.015), 0.005, 3)
    errors = []
    for board in (of_population, exact):
        evidence = evidence_of(scans, [PoseSpread()] * len(scans), board, ROOM.air)
        found = refined(evidence, true, ROUGH, 8).draft
        errors.append(max(abs(off(found, true, key)[0]) for key in true.walls))
        assert found.offset == pytest.approx(0.015 if board is of_population else 0.0, abs=0.004)
    assert errors[0] < 0.006
    assert errors[1] > 0.008


@pytest.mark.parametrize("stated", [4.0, 0.0])
def test_a_threshold_is_found_if_the_board_describes_a_population(stated: float) -> None:
    scans = scans_of(ROOM, PLACES, replace(BOARD, threshold_db=BOARD.threshold_db + 8.0), 0.005, 3)
    evidence = evidence_of(scans, [PoseSpread()] * 3, replace(BOARD, threshold_sd_db=stated), ROOM.air)
    draft = replace(draft_of_room(ROOM), places=PLACES)
    for _ in range(3):  # as in growth, which reaches a far threshold step by step
        draft = with_threshold(evidence, scored(evidence, draft)).draft
    deviation = threshold_deviation(evidence, draft)
    if stated == 0.0:
        assert (draft.threshold_db, deviation) == (0.0, None)
    else:
        assert deviation is not None
        assert abs(draft.threshold_db - 8.0) < 1.96 * deviation < 4.0
