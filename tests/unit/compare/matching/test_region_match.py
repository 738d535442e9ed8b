"""Regions of a scan are matched to those of a scan that is rotated, shifted or incomplete."""

import math

import numpy as np
import pytest
from sonarhw_compare.explain import region_details
from sonarhw_compare.match import compare_readings
from sonarhw_compare.regions import Region, regions_of
from sonarhw_compare.score import compare_regions, match_regions
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Reading

ROOM, BOARD = load_room("rooms/arena.toml"), load_board("lego-nxt")
PLACE = ROOM.places["p3"]
ANGLES = np.radians(np.arange(0.0, 360.0, 3.0))
SPEED = 340.0


def scan(turned: float, farther: float, silent: slice) -> list[Reading]:
    ranges = predict_scan(ROOM, PLACE, BOARD, ANGLES + turned).ranges + farther
    ranges[silent] = math.nan
    times = [() if math.isnan(r) else (2 * float(r) / SPEED,) for r in ranges]
    return [Reading(k, 0, 0, float(a), 0.1 * k, times[k], SPEED) for k, a in enumerate(ANGLES)]


def test_a_predicted_scan_has_the_predicted_regions() -> None:
    found = compare_regions(compare_readings(scan(0.0, 0.0, slice(0, 0)), ROOM, PLACE, BOARD))
    assert len(found.pairs) >= 4
    assert (found.only_measured, found.only_predicted) == ((), ())
    for measured, predicted in found.pairs:
        assert (measured.range, measured.bearing, measured.width) == (
            predicted.range,
            predicted.bearing,
            predicted.width,
        )


def test_regions_show_rotation_and_offset_of_a_scan() -> None:
    readings = scan(math.radians(6), 0.02, slice(0, 0))
    pairs = region_details(compare_readings(readings, ROOM, PLACE, BOARD))["pairs"]
    assert np.median([pair["farther_m"] for pair in pairs]) == pytest.approx(0.02, abs=1e-6)
    assert np.median([pair["turned_deg"] for pair in pairs]) == pytest.approx(-6, abs=1.6)


def test_a_silent_region_is_only_predicted() -> None:
    whole = regions_of(ANGLES, predict_scan(ROOM, PLACE, BOARD, ANGLES).ranges)
    lost = next(region for region in whole if max(region.rows) - min(region.rows) == len(region) - 1)
    silent = slice(min(lost.rows), max(lost.rows) + 1)
    found = compare_regions(compare_readings(scan(0.0, 0.0, silent), ROOM, PLACE, BOARD))
    assert found.only_predicted == (lost,)
    assert len(found.pairs) == len(whole) - 1


def test_empty_scans_have_no_pairs() -> None:
    some = regions_of(ANGLES, np.ones(120))
    assert match_regions((), some).only_predicted == some
    assert match_regions(some, ()).only_measured == some
    assert match_regions((), ()).pairs == ()


def test_two_walls_at_equal_range_are_two_regions() -> None:
    place = ROOM.places["p1"]  # 30 cm from two walls
    ranges = predict_scan(ROOM, place, BOARD, ANGLES).ranges
    times = [() if math.isnan(r) else (2 * float(r) / SPEED,) for r in ranges]
    readings = [Reading(k, 0, 0, float(a), 0.1 * k, times[k], SPEED) for k, a in enumerate(ANGLES)]
    found = compare_regions(compare_readings(readings, ROOM, place, BOARD))
    near = sorted(math.degrees(region.bearing) for region, _ in found.pairs if abs(region.range - 0.3) < 0.01)
    assert len(near) == 2
    assert (found.parts, found.only_measured, found.only_predicted) == ((), (), ())


def test_a_reflector_detected_in_pieces_is_one_region_and_its_parts() -> None:
    whole = regions_of(ANGLES, np.where(ANGLES < 2, 1.0, np.nan))
    pieces = regions_of(ANGLES, np.where((ANGLES < 2) & (np.abs(ANGLES - 0.8) > 0.12), 1.0, np.nan))
    found = match_regions(pieces, whole)
    assert (len(found.pairs), len(found.parts)) == (1, 1)
    assert (found.only_measured, found.only_predicted) == ((), ())
    assert match_regions(whole, pieces).parts[0][0] == whole[0]


def arc(begin: float, end: float, distance: float = 1.0) -> Region:
    """Return a region from one heading to another, degrees."""
    return Region((0,), distance, math.radians((begin + end) / 2) % math.tau, math.radians(end - begin))


def test_regions_without_a_common_heading_are_not_paired() -> None:
    for one, other in ((arc(0, 20), arc(21, 45)), (arc(-30, -1), arc(1, 30)), (arc(0, 30), arc(0, 30, 1.06))):
        found = match_regions((one,), (other,))
        assert (found.pairs, found.parts) == ((), ())
        assert (found.only_measured, found.only_predicted) == ((one,), (other,))
    # across heading 0
    assert len(match_regions((arc(-20, 10),), (arc(5, 40),)).pairs) == 1
    assert len(match_regions((arc(0, 30),), (arc(0, 30, 1.04),)).pairs) == 1


def test_a_region_is_paired_with_the_one_that_has_most_headings_in_common() -> None:
    # 12° and 16° in common
    measured, first, second = arc(0, 30), arc(-10, 12), arc(14, 34)
    found = match_regions((measured,), (first, second))
    assert [predicted for _, predicted in found.pairs] == [second]
    assert [predicted for _, predicted in found.parts] == [first]
