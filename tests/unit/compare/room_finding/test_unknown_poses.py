"""Scans are placed where the room that follows explains all scans best; the rest is left out."""

import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import UNKNOWN, Pose, PoseSpread
from sonarhw_compare.rooms import search
from sonarhw_compare.rooms.candidates import Touches
from sonarhw_compare.rooms.draft import DraftPost, RoomDraft
from sonarhw_compare.rooms.evidence import Course
from sonarhw_compare.rooms.refinement import Move
from sonarhw_compare.rooms.search import FoundRoom, find_room_and_poses
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw.readings import Reading

BOARD = load_board("polaroid-6500")
NOWHERE = Place("", (0.0, 0.0))
POST = DraftPost((0.5, 0.5), 0.1)
Tick = Callable[[float], None]


def scans(count: int) -> list[PlacedScan]:
    """Return scans with their number as title, and as number of their only reading."""
    return [PlacedScan((Reading(k, 0, 0, 0.0, 0.0, (), 343.0),), NOWHERE, str(k), str(k)) for k in range(count)]


def pose(x: float, probability: float = 1.0) -> Pose:
    return Pose((x, 0.0), 0.1, 0.0, probability, (0.01, 0.01, 0.01))


def with_answers(
    monkeypatch: pytest.MonkeyPatch,
    shares: dict[int, list[float]],
    poses: dict[int, tuple[Pose, ...]] | None = None,
    worth: Callable[[float], float] = lambda _x: 0.0,
    foreign: str = "",
    peaks: dict[int, list[tuple[float, float, float]]] | None = None,
) -> list[list[str]]:
    """Let the room explain these shares of each waiting scan, one after the other; return the scans of each room.

    The room explains 0.8 of each scan that it is made of, or the last of its shares. A scan has one pose, at its
    number, if `poses` has no others, and one improbable pose, there too, if `peaks` has no others. `worth` is that of a
    room, by x of its last scan, plus 20 for each scan. A scan alone is worth 16, but of the foreign ones, each adds
    only 15 to a room.
    """
    rooms: list[list[str]] = []

    def find_room(
        given: list[PlacedScan], _board: object, _air: object, _spreads: object, tick: Tick, course: Course, _: object
    ) -> object:
        rooms.append([scan.title for scan in given])
        explained = [shares.get(int(scan.title), [0.8])[-1] for scan in given]
        touches = Touches({}, (), (100,) * len(given), tuple(round(100 * (1 - share)) for share in explained))
        draft = RoomDraft(tuple(scan.place for scan in given))
        added = sum(15.0 if scan.title in foreign else 20.0 for scan in given)
        tick(0.5)
        course.accept(draft)
        tick(1.0)
        return FoundRoom(draft, {}, touches, worth(given[-1].place.position[0]) + added)

    def locate_scan(readings: list[Reading], *_: object, tick: Tick, **__: object) -> object:
        tick(1.0)
        k = readings[0].number
        share = shares[k].pop(0) if len(shares[k]) > 1 else shares[k][0]
        probable = (poses or {}).get(k, (pose(float(k)),))
        return SimpleNamespace(explained=share, poses=probable, peaks=(peaks or {}).get(k, [(float(k), 0.0, 0.1)]))

    monkeypatch.setattr(search, "find_room", find_room)
    monkeypatch.setattr(search, "locate_scan", locate_scan)
    monkeypatch.setattr(search, "worth_alone", lambda *_: 16.0)
    return rooms


def test_well_explained_scans_come_first_then_the_best_and_foreign_ones_never(monkeypatch: pytest.MonkeyPatch) -> None:
    # the room explains 0.8 of its own scans: 0.72 is enough at once; what explains a scan alone as well never is
    shares = {1: [0.75, 0.8], 2: [0.65, 0.65, 0.8], 3: [0.7], 4: [0.74, 0.8]}
    rooms = with_answers(monkeypatch, shares, foreign="3")
    result = find_room_and_poses(scans(5), BOARD, Air(), [PoseSpread(), *[UNKNOWN] * 4])
    assert rooms[:4] == [["0"], ["0", "1", "4"], ["0", "1", "3", "4"], ["0", "1", "2", "4"]]
    assert [scan.title for scan in result.scans] == ["0", "1", "2", "4"]
    assert [scan.place.position[0] for scan in result.scans] == [0.0, 1.0, 2.0, 4.0]
    assert result.left_out == ("3",)
    assert list(result.poses) == ["1", "2", "4"]


@pytest.mark.parametrize("right", [5.0, 7.0])
def test_of_similar_poses_that_whose_room_explains_all_scans_best_is_taken(
    monkeypatch: pytest.MonkeyPatch, right: float
) -> None:
    rooms = with_answers(
        monkeypatch, {1: [0.8]}, {1: (pose(5.0, 0.6), pose(7.0, 0.4))}, lambda x: 100.0 if x == right else 0.0
    )
    result = find_room_and_poses(scans(2), BOARD, Air(), [PoseSpread(), UNKNOWN])
    assert [scan.place.position[0] for scan in result.scans] == [0.0, right]
    assert [found.probability for found in result.poses["1"]] == [0.6, 0.4]
    assert rooms == [["0"], ["0", "1"], ["0", "1"], ["0", "1"]]  # the last one from the refined places


def test_the_share_never_decreases_where_a_scan_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with_answers(monkeypatch, {1: [0.8], 2: [0.7], 3: [0.65]}, {2: (pose(5.0, 0.6), pose(7.0, 0.4))}, foreign="2")
    shares: list[float] = []
    result = find_room_and_poses(scans(4), BOARD, Air(), [PoseSpread(), *[UNKNOWN] * 3], shares.append)
    assert result.left_out == ("2",)
    assert np.diff(shares).min() >= 0.0
    assert shares[-1] == 1.0
    assert len(set(shares)) > 20  # it moves in each room, also in those that are rejected


def test_rooms_of_tried_poses_are_reported_only_if_they_are_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with_answers(monkeypatch, {1: [0.7], 2: [0.65]}, {1: (pose(5.0, 0.6), pose(7.0, 0.4))}, foreign="2")
    seen: list[list[float]] = []
    course = Course(accepted=lambda draft: seen.append([place.position[0] for place in draft.places]))
    find_room_and_poses(scans(3), BOARD, Air(), [PoseSpread(), *[UNKNOWN] * 2], course=course)
    assert seen == [[0.0], [0.0, 5.0]]  # of the better of two equal poses; not with scan 2, nor at 7 m


def test_a_scan_that_no_probable_pose_places_is_placed_at_an_improbable_one(monkeypatch: pytest.MonkeyPatch) -> None:
    # at its probable pose, scan 2 adds less to the room than it is worth alone; scan 3 does so everywhere
    def worth(x: float) -> float:
        return {9.0: 0.0, 1.0: 0.0, 0.0: 0.0}.get(x, -10.0)

    peaks = {2: [(8.0, 0.0, 0.2), (9.0, 0.0, 0.3)], 3: [(7.0, 0.0, 0.0)]}
    rooms = with_answers(monkeypatch, {1: [0.8], 2: [0.4], 3: [0.5]}, None, worth, peaks=peaks)
    result = find_room_and_poses(scans(4), BOARD, Air(), [PoseSpread(), *[UNKNOWN] * 3])
    assert [scan.place for scan in result.scans][2] == Place("", (9.0, 0.0), 0.3)
    assert result.left_out == ("3",)
    assert list(result.poses) == ["1", "2"]
    assert rooms[2:7] == [["0", "1", "3"], ["0", "1", "2"], ["0", "1", "3"], ["0", "1", "2"], ["0", "1", "2"]]


def test_one_sensor_made_all_scans(monkeypatch: pytest.MonkeyPatch) -> None:
    with_answers(monkeypatch, {1: [0.4]})
    used: list[Board] = []
    found, located = search.find_room, search.locate_scan

    def find_room(*given: Any) -> FoundRoom:
        one = found(*given)
        of_offset = {Move("offset", 0, 0): 0.004}
        draft = replace(one.draft, offset=-0.012, threshold_db=2.5)
        return replace(one, draft=draft, deviations=of_offset, threshold_deviation=0.7)

    monkeypatch.setattr(search, "find_room", find_room)
    monkeypatch.setattr(
        search, "locate_scan", lambda *given, **more: (used.append(given[2]), located(*given, **more))[1]
    )
    monkeypatch.setattr(search, "worth_alone", lambda _, board, *__: (used.append(board), 16.0)[1])
    board = load_board("lego-nxt")
    find_room_and_poses(scans(2), board, Air(), [PoseSpread(), UNKNOWN])
    sensor = replace(
        board, range_offset=-0.012, threshold_db=board.threshold_db + 2.5, range_sd=0.004, threshold_sd_db=0.7
    )
    assert used == [sensor, sensor]  # the scan is located, and judged by itself


def test_a_room_with_more_scans_is_searched_from_the_room_before_too(monkeypatch: pytest.MonkeyPatch) -> None:
    with_answers(monkeypatch, {1: [0.8]})
    found = search.find_room
    likely: list[RoomDraft | None] = []

    def find_room(*given: Any) -> FoundRoom:
        likely.append(given[5].likely)
        one = found(*given)
        moved = tuple(replace(place, position=(place.position[0] + 0.25, 0.0)) for place in one.draft.places)
        return replace(one, draft=replace(one.draft, posts=(POST,), offset=0.01, places=moved))

    monkeypatch.setattr(search, "find_room", find_room)
    find_room_and_poses(scans(2), BOARD, Air(), [PoseSpread(0.1, 0.1), UNKNOWN])
    first, second, third = likely
    assert first is None
    # from the places as refined, also where a search from nothing begins where they are given
    assert second is not None
    assert [place.position[0] for place in second.places] == [0.25, 1.0]
    assert third is not None
    assert [place.position[0] for place in third.places] == [0.25, 1.25]
    assert (second.posts, second.offset) == ((POST,), 0.01)


def test_a_known_heading_or_position_stays_expected_of_a_located_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    with_answers(monkeypatch, {1: [0.8], 2: [0.8]})
    given: list[tuple[PoseSpread, ...]] = []
    found = search.find_room
    monkeypatch.setattr(search, "find_room", lambda *all: (given.append(tuple(all[3])), found(*all))[1])
    nowhere, turned, moved = scans(3)
    turned = replace(turned, place=replace(NOWHERE, heading=0.3))
    moved = replace(moved, place=replace(NOWHERE, position=(2.2, 0.1)))
    known = [PoseSpread(), PoseSpread(math.inf, 0.05), PoseSpread(0.0, math.inf)]
    find_room_and_poses([nowhere, turned, moved], BOARD, Air(), known)
    first, second, third = given[-1]
    assert first == PoseSpread()
    # located at (1, 0) and (2, 0), heading 0.1: what is not known is expected there
    assert (second.heading, second.around) == (0.05, Place("", (1.0, 0.0), 0.3))
    assert (third.xy, third.around) == (0.001, Place("", (2.2, 0.1), 0.1))
    assert (second.xy, third.heading) == (0.05, 0.06)


def test_poses_that_are_known_worse_than_10_cm_or_6_degrees_are_located(monkeypatch: pytest.MonkeyPatch) -> None:
    rooms = with_answers(monkeypatch, {1: [0.8], 2: [0.8], 3: [0.8]})
    wide = [PoseSpread(0.5, 0.05), PoseSpread(0.05, 0.5), PoseSpread(0.05, 0.05)]
    result = find_room_and_poses(scans(4), BOARD, Air(), [PoseSpread(), *wide])
    assert rooms[0] == ["0", "3"]
    assert list(result.poses) == ["1", "2"]
    # one has to be placed where it is given
    find_room_and_poses(scans(2), BOARD, Air(), [wide[0], wide[1]])
    assert rooms[-3:] == [["0"], ["0", "1"], ["0", "1"]]


def test_known_poses_need_one_room(monkeypatch: pytest.MonkeyPatch) -> None:
    rooms = with_answers(monkeypatch, {})
    ticks: list[float] = []
    result = find_room_and_poses(scans(2), BOARD, Air(), (), ticks.append)
    assert rooms == [["0", "1"]]
    assert (result.left_out, result.poses) == ((), {})
    assert ticks[-1] == 1.0
    assert np.diff(ticks).min(initial=0.0) >= 0.0


def test_without_a_known_pose_nothing_is_found() -> None:
    with pytest.raises(InputError, match="no pose is known"):
        find_room_and_poses(scans(2), BOARD, Air(), [UNKNOWN, UNKNOWN])
