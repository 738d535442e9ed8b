"""Two walls on one line are made one wall where the scans allow it."""

import math

import numpy as np
import pytest
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.candidates import with_end_moved, with_gaps
from sonarhw_compare.rooms.draft import DraftEnd, DraftWall, RoomDraft
from sonarhw_compare.rooms.evidence import Evidence, evidence_of, scored
from sonarhw_compare.rooms.search import with_parts_joined, without_part
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, parse_room

from sonarhw.readings import Reading

BOARD = load_board("polaroid-6500")
PLACES = tuple(Place("", (x, 1.0)) for x in (0.5, 1.5, 2.5))
WEST = DraftWall((0.6, 0.005), 0.01, (DraftEnd(-0.6), DraftEnd(0.6)))
EAST = DraftWall((2.4, -0.005), -0.01, (DraftEnd(-0.5), DraftEnd(0.6)))


def scans_of(walls: list[list[list[float]]]) -> Evidence:
    """Return predicted scans of a room from all places as evidence."""
    text = 'name = "r"\n[materials.m]\nreflectance = 0.9\n'
    for number, points in enumerate(walls):
        text += f'[[walls]]\nname = "w{number}"\npoints = {points}\nmaterial = "m"\n'
    room, angles = parse_room(text, "r"), np.radians(np.arange(0.0, 360.0, 3.0))
    scans = []
    for number, place in enumerate(PLACES):
        ranges = predict_scan(room, place, BOARD, angles).ranges
        speed = room.air.speed_of_sound
        times = [() if math.isnan(one) else (2 * one / speed,) for one in ranges.tolist()]
        readings = [
            Reading(k, 0, 0, angle, 0.1 * k, echo, speed)
            for k, (angle, echo) in enumerate(zip(angles.tolist(), times, strict=True))
        ]
        scans.append(PlacedScan(readings, place, str(number), str(number)))
    return evidence_of(scans, [PoseSpread()] * 3, BOARD, Air())


def test_two_parts_of_one_wall_become_one() -> None:
    evidence = scans_of([[[0.0, 0.0], [3.0, 0.0]]])
    joined = with_parts_joined(evidence, scored(evidence, RoomDraft(PLACES, {0: WEST, 1: EAST})))
    (wall,) = joined.draft.segments
    np.testing.assert_allclose(wall, [0.0, 0.0, 3.0, 0.0], atol=0.02)


def test_two_walls_with_an_open_door_between_them_stay_two() -> None:
    # the places are before the gap too, so that its silence is heard
    evidence = scans_of([[[0.0, 0.0], [1.0, 0.0]], [[2.0, 0.0], [3.0, 0.0]]])
    walls = {0: WEST.with_end(1, DraftEnd(0.4)), 1: EAST.with_end(0, DraftEnd(-0.4))}
    joined = with_parts_joined(evidence, scored(evidence, RoomDraft(PLACES, walls)))
    assert len(joined.draft.walls) == 2


def test_a_part_that_goes_leaves_its_corner_to_the_rest_of_the_wall() -> None:
    side = DraftWall((3.0, 0.5), math.pi / 2, (DraftEnd(-0.5, 1), DraftEnd(0.5)))
    draft = RoomDraft(PLACES, {0: WEST, 1: EAST.with_end(1, DraftEnd(0.6, 2)), 2: side})
    left = without_part(draft, 1)
    assert list(left.walls) == [0, 2]
    assert left.segment(0)[2:] == pytest.approx([3.0, 0.0], abs=0.02)
    assert not left.is_free(0, 1)
    assert not left.is_free(2, 0)


def test_a_gap_ends_where_the_wall_does_though_the_next_touch_is_farther() -> None:
    evidence = scans_of([[[0.0, 0.0], [1.0, 0.0]], [[2.0, 0.0], [3.0, 0.0]]])
    whole = DraftWall((1.5, 0.0), 0.0, (DraftEnd(-1.5), DraftEnd(1.5)))
    touched = {0: np.array([-1.0, -0.8, -0.5, 0.8, 1.0])}  # up to x = 1 m, and from x = 2.3 m on
    opened = with_gaps(evidence, scored(evidence, RoomDraft(PLACES, {0: whole})), touched)
    first, second = opened.draft.segments
    assert first[2] == pytest.approx(1.0, abs=0.03)
    assert second[0] == pytest.approx(2.0, abs=0.03)


@pytest.mark.parametrize("end", [1.4, 2.5])
def test_a_free_end_is_found_from_afar(end: float) -> None:
    evidence = scans_of([[[0.0, 0.0], [2.0, 0.0]]])
    wall = DraftWall((0.0, 0.0), 0.0, (DraftEnd(0.0), DraftEnd(end)))
    found = with_end_moved(evidence, scored(evidence, RoomDraft(PLACES, {0: wall})), 0, 1)
    assert found.draft.segment(0)[2] == pytest.approx(2.0, abs=0.03)
