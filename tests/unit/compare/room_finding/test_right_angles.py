"""Walls are expected at right angles, unless the scans contradict."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.arcs import Arc
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms import draft as right_angles
from sonarhw_compare.rooms import search
from sonarhw_compare.rooms.candidates import wall_candidates, with_gaps
from sonarhw_compare.rooms.draft import DraftEnd, DraftWall, RoomDraft, draft_of_room
from sonarhw_compare.rooms.evidence import FOLLOWED, Course, Evidence, Scored, SearchProgress, evidence_of, scored
from sonarhw_compare.rooms.refinement import Move
from sonarhw_compare.rooms.search import determined, rebuilt, squared, squared_together
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.readings import Reading

BOARD = load_board("polaroid-6500")
ANGLES = np.arange(0.0, math.tau, math.radians(4))


def walls(*degrees: float) -> RoomDraft:
    """Return a draft of separate walls with these directions."""
    ends = (DraftEnd(-0.5), DraftEnd(0.5))
    made = {key: DraftWall((2.0 * key, 0.0), math.radians(one), ends) for key, one in enumerate(degrees)}
    return RoomDraft((), made)


def room_of(points: Sequence[tuple[float, float]]) -> Room:
    corners = [list(point) for point in points]
    return parse_room(
        f'name = "r"\n[materials.w]\nreflectance = 0.9\n[[walls]]\nname = "w"\npoints = {corners}\nclosed = true\n'
        'material = "w"\n',
        "r",
    )


def scans_of(room: Room, *places: tuple[float, float]) -> list[PlacedScan]:
    """Return exact scans of a room."""
    scans, speed = [], room.air.speed_of_sound
    for number, at in enumerate(places):
        place = Place(str(number), at)
        ranges = predict_scan(room, place, BOARD, ANGLES, FOLLOWED).ranges.tolist()
        readings = [
            Reading(k, 0, 0, angle, 0.1 * k, () if math.isnan(one) else (2 * one / speed,), speed)
            for k, (angle, one) in enumerate(zip(ANGLES.tolist(), ranges, strict=True))
        ]
        scans.append(PlacedScan(readings, place, place.name))
    return scans


def case(points: Sequence[tuple[float, float]], *places: tuple[float, float]) -> tuple[Evidence, RoomDraft]:
    """Return exact scans of a room as evidence, and the room as a draft."""
    room = room_of(points)
    scans = scans_of(room, *places)
    evidence = evidence_of(scans, [PoseSpread()] * len(scans), BOARD, room.air)
    return evidence, replace(draft_of_room(room), places=tuple(scan.place for scan in scans))


def test_directions_are_as_probable_as_they_are_near_right_angles() -> None:
    square, near, oblique = (right_angles.log_prior(walls(10.0, 100.0, -80.0, one)) for one in (190.0, 192.0, 220.0))
    assert square == pytest.approx(0.0, abs=1e-9)
    assert square > near > oblique > -10.0  # any direction remains possible


def test_a_wall_near_right_angles_is_pulled_and_an_oblique_one_is_left_alone() -> None:
    pulled = {key: (away, weight) for key, _, away, weight in right_angles.pulls(walls(10.0, 100.0, 191.0, 220.0))}
    assert math.degrees(pulled[2][0]) == pytest.approx(1.0)
    assert pulled[2][1] == pytest.approx(1 / right_angles.SPREAD**2, rel=0.1)
    assert pulled[3][1] < 1e-6 * pulled[2][1]
    assert right_angles.at_right_angles(walls(10.0, 100.0, 191.0, 220.0)) == 3


def test_a_wall_that_is_added_to_a_known_room_can_have_any_direction() -> None:
    known = room_of([(0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (0.0, 3.0)])
    one, two = (replace(walls(*angles), base=known) for angles in ((30.0,), (30.0, 123.0)))
    assert right_angles.log_prior(one) == 0.0
    assert right_angles.oblique(one) == []
    # the sides of one object are expected at right angles to each other
    assert right_angles.common_angle(two) in (math.radians(30.0), math.radians(123.0))
    assert right_angles.log_prior(two) == right_angles.log_prior(walls(30.0, 123.0)) < 0.0


def test_a_wall_that_one_place_faces_is_turned_to_right_angles() -> None:
    evidence, true = case([(0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (0.0, 3.0)], (0.5, 1.0))
    # the east wall alone, turned about the place by 15°: its range is the same
    turned = DraftWall((0.5 + 1.5 * math.cos(0.26), 1.0 + 1.5 * math.sin(0.26)), math.pi / 2 + 0.26, WIDE)
    draft = true.without_only(1).with_wall(1, turned)
    found = squared(evidence, scored(evidence, draft)).draft
    assert math.degrees(math.remainder(found.walls[1].angle, math.pi / 2)) == pytest.approx(0.0, abs=1.0)
    assert abs(found.segment(1)[[0, 2]] - 2.0).max() < 0.02


WIDE = (DraftEnd(-0.9), DraftEnd(0.9))


def test_an_oblique_wall_that_several_places_face_stays_oblique() -> None:
    evidence, true = case([(0.0, 0.0), (2.4, 0.0), (1.8, 3.0), (0.0, 3.0)], (0.5, 1.0), (1.0, 1.8), (1.4, 0.6))
    assert math.degrees(right_angles.SPREAD) * 10 < math.degrees(math.atan2(0.6, 3.0)) < 30  # it is tried
    found = squared(evidence, scored(evidence, true)).draft
    assert found.walls[1].angle == pytest.approx(true.walls[1].angle, abs=math.radians(0.3))


ALCOVE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.1), (3.4, 1.1), (3.4, 1.5), (3.0, 1.5), (3.0, 2.2), (0.0, 2.2)]


def directions(draft: RoomDraft) -> np.ndarray:
    """Return the angle of each wall from right angles, degrees."""
    return np.array([math.degrees(math.remainder(wall.angle, math.pi / 2)) for wall in draft.walls.values()])


def test_short_walls_that_are_all_turned_are_turned_back_together() -> None:
    evidence, true = case(ALCOVE, (1.0, 1.2), (2.3, 0.8))
    draft = true
    for key in (2, 3, 4):  # the alcove, as a whole
        draft = draft.with_wall(key, draft.walls[key].moved(0.0, math.radians(2.0)))
    found = squared_together(evidence, scored(evidence, draft)).draft
    assert np.abs(directions(found)).max() < 0.3


def test_walls_that_are_not_at_right_angles_are_not_turned_together() -> None:
    evidence, true = case([(0.0, 0.0), (3.0, 0.0), (2.9, 2.2), (0.0, 2.1)], (1.0, 1.2), (2.3, 0.8), (1.4, 1.6))
    found = squared_together(evidence, scored(evidence, true)).draft
    np.testing.assert_allclose(directions(found), directions(true), atol=0.3)
    assert np.abs(directions(true)).max() > 1.5


def test_a_free_end_of_which_nothing_is_touched_but_the_end_itself_is_cut_back() -> None:
    evidence, true = case([(0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (0.0, 3.0)], (0.5, 1.0), (1.4, 2.0))
    # the south wall reaches 1 m beyond the east wall, out of sight
    draft = true.with_wall(0, true.walls[0].with_end(1, DraftEnd(2.0)))
    touched = {0: np.array([-0.9, 0.0, 1.0, 2.0])}
    assert with_gaps(evidence, scored(evidence, draft), touched).draft.extent(0)[1] == pytest.approx(1.0)
    near = {0: np.array([-0.9, 0.9, 1.7, 2.0])}  # touched every 80 cm at most: no gap at the end
    assert with_gaps(evidence, scored(evidence, draft), near).draft.extent(0)[1] == pytest.approx(2.0)


def test_two_walls_at_right_angles_replace_an_oblique_one() -> None:
    notched = [(0.0, 0.0), (2.1, 0.0), (2.1, 0.84), (1.68, 0.84), (1.68, 2.1), (0.0, 2.1)]
    places = (1.5, 0.3), (1.1, 1.4), (0.6, 0.5)
    evidence, true = case(notched, *places)
    # in place of the two walls of the notch, one from the end of the wall before it to that of the wall behind it
    draft = true.without_only(2).without_only(3)
    start, end = (2.1, 0.84), (1.68, 2.1)
    angle, half = math.atan2(end[1] - start[1], end[0] - start[0]), math.dist(start, end) / 2
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
    draft, oblique = draft.with_new_wall(DraftWall(middle, angle, (DraftEnd(-half), DraftEnd(half))))
    assert right_angles.oblique(draft) == [oblique]
    evidence, seen, shares = followed(evidence)
    found = rebuilt(evidence, scored(evidence, draft)).draft
    assert seen == [found]
    assert np.diff(shares).min() >= 0.0
    assert len(set(shares)) > 20  # it moves during growth
    assert right_angles.oblique(found) == []
    for x, y, x2, y2 in found.segments.tolist():
        assert min(abs(x - x2), abs(y - y2)) < 0.02
    assert any(abs(x - 1.68) < 0.02 and abs(x2 - 1.68) < 0.02 for x, _, x2, _ in found.segments.tolist())


def test_drafts_without_a_true_oblique_wall_are_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    def grown(evidence: Evidence, best: Scored) -> Scored:
        evidence.course.accept(best.draft)
        return best

    monkeypatch.setattr(search, "grown", grown)
    cut, places = [(0.0, 0.0), (2.4, 0.0), (1.8, 3.0), (0.0, 3.0)], ((0.5, 1.0), (1.0, 1.8), (1.4, 0.6))
    evidence, true = case(cut, *places)
    assert right_angles.oblique(true) == [1]
    evidence, seen, _ = followed(evidence)
    best = scored(evidence, true)
    assert rebuilt(evidence, best) == best
    assert seen == []


def followed(evidence: Evidence) -> tuple[Evidence, list[RoomDraft], list[float]]:
    """Return evidence whose accepted drafts, and shares of progress, are put into the lists."""
    seen: list[RoomDraft] = []
    shares: list[float] = []
    followed = replace(evidence, course=Course(accepted=seen.append), progress=SearchProgress(shares.append))
    followed.progress.begin(1.0)
    return followed, seen, shares


def test_walls_grow_in_place_of_one_that_no_range_determines(monkeypatch: pytest.MonkeyPatch) -> None:
    rectangle, places = [(0.0, 0.0), (2.0, 0.0), (2.0, 3.0), (0.0, 3.0)], ((0.7, 1.0), (1.2, 2.0))
    evidence, true = case(rectangle, *places)
    draft, oblique = true.without_only(1).with_new_wall(DraftWall((2.2, 1.5), 1.2, WIDE))
    usual = search.deviations_of

    def unsure(evidence: Evidence, draft: RoomDraft) -> dict[Move, float]:
        return {
            move: 1.0 if move.is_of("wall", oblique) and move.part < 2 and draft.walls[oblique].angle == 1.2 else one
            for move, one in usual(evidence, draft).items()
        }

    monkeypatch.setattr(search, "deviations_of", unsure)
    found, _ = determined(evidence, draft)
    assert any(abs(x - 2.0) < 0.02 and abs(x2 - 2.0) < 0.02 for x, _, x2, _ in found.segments.tolist())


# a wall at x = 1.5 m seen from (1.2, 0.5) m, of which a nearer echo hides the lower half
CUT_OFF = Arc(0, tuple(range(20)), (1.2, 0.5), 0.3, math.radians(22), math.radians(32))
UNEXPLAINED = [np.ones(20)]


def normals(common: float | None) -> list[float]:
    """Return the bearing of each candidate's normal, degrees."""
    found = wall_candidates([CUT_OFF], UNEXPLAINED, 8, common)
    return sorted(math.degrees(math.remainder(wall.angle + math.pi / 2, math.tau)) for wall in found)


def test_a_wall_of_which_one_side_is_hidden_is_tried_at_right_angles_to_the_others() -> None:
    assert normals(None) == pytest.approx([22.0])
    assert normals(math.radians(90.0)) == pytest.approx([0.0, 22.0])
    (square,) = (wall for wall in wall_candidates([CUT_OFF], UNEXPLAINED, 8, math.pi) if abs(wall.along[0]) < 1e-9)
    assert square.middle == pytest.approx((1.5, 0.5))


def test_no_wall_is_tried_at_right_angles_outside_the_arc() -> None:
    # the nearest right angle is 40° from the middle of the arc, which is 32° wide to each side
    assert normals(math.radians(62.0)) == pytest.approx([22.0])
