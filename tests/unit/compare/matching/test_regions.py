"""Regions of constant depth are found, also across heading 0, and only where they exist."""

import math

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_compare.regions import mean_run, regions_of
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place

from tests.fixtures.rooms_for_tests import polygon_room

HEADINGS = np.radians(np.arange(0.0, 360.0, 3.0))


def test_a_region_across_heading_0_is_one() -> None:
    ranges = np.full(120, np.nan)
    ranges[-4:], ranges[:5] = 1.0, 1.01
    (region,) = regions_of(HEADINGS, ranges)
    assert region.rows == (116, 117, 118, 119, 0, 1, 2, 3, 4)
    assert region.bearing == pytest.approx(0.0, abs=1e-9)
    assert math.degrees(region.width) == pytest.approx(24)


def test_slowly_changing_ranges_are_split_at_the_tolerance() -> None:
    ranges = np.full(120, np.nan)
    ranges[10:30] = 1.0 + 0.004 * np.arange(20)
    regions = regions_of(HEADINGS, ranges, tolerance=0.0201, least_width=0.0)
    assert [region.rows[0] for region in regions] == [10, 16, 22, 28]
    assert regions_of(HEADINGS, ranges, tolerance=0.003) == ()


@pytest.mark.parametrize("step", [1.0, 2.0, 2.5, 5.0])
def test_whether_a_region_is_found_does_not_depend_on_its_heading(step: float) -> None:
    count = round(360 / step)
    headings, wide = np.radians(step * np.arange(count)), round(10 / step) + 1
    for first in range(count):
        rows = (first + np.arange(wide)) % count
        ranges, narrower = np.full(count, np.nan), np.full(count, np.nan)
        ranges[rows] = narrower[rows[1:]] = 2.0
        assert [len(region) for region in regions_of(headings, ranges)] == [wide]
        assert regions_of(headings, narrower) == ()


def test_a_gap_between_headings_ends_a_region() -> None:
    headings = np.radians(np.concatenate((np.arange(0.0, 30.0, 3.0), np.arange(60.0, 90.0, 3.0))))
    assert [len(region) for region in regions_of(headings, np.full(20, 2.0))] == [10, 10]


def test_order_and_whole_turns_of_readings_do_not_matter() -> None:
    random = np.random.default_rng(3)
    ranges = np.repeat(random.uniform(0.5, 3.0, 12), 10)
    order = random.permutation(120)
    straight = regions_of(HEADINGS, ranges)
    shuffled = regions_of(HEADINGS[order] + math.tau * random.integers(-2, 3, 120), ranges[order])
    assert len(straight) == 12
    assert [sorted(order[list(region.rows)].tolist()) for region in shuffled] == [sorted(r.rows) for r in straight]


def test_repeated_pings_do_not_widen_a_region() -> None:
    ranges = np.repeat([1.0, 2.0, np.nan], 40)
    once, thrice = regions_of(HEADINGS, ranges), regions_of(np.repeat(HEADINGS, 3), np.repeat(ranges, 3))
    assert [(region.bearing, region.width) for region in thrice] == [(region.bearing, region.width) for region in once]
    assert [len(region) for region in thrice] == [120, 120]
    assert mean_run(np.repeat(HEADINGS, 3), np.repeat(ranges, 3)) == 3 * mean_run(HEADINGS, ranges)


def test_neighbours_with_one_range_count_as_one_reading() -> None:
    ranges = np.repeat([1.0, np.nan, 2.0, 3.0], 30)
    assert mean_run(HEADINGS, ranges) == pytest.approx(30)
    assert mean_run(HEADINGS, np.arange(120.0)) == 1


def test_the_width_of_a_region_follows_from_the_beam() -> None:
    """The two-way beam falls below the threshold at a known angle from the normal of a single wall."""
    room = polygon_room([(2.0, -3.0), (2.0, 3.0)], closed=False)
    board = load_board("paper")
    headings = np.radians(np.arange(-60.0, 60.0, 0.25))
    scan = predict_scan(room, Place("here", (0.0, 0.0)), board, headings)
    ka = board.wavenumber(room.air) * board.aperture_radius
    angles = np.linspace(0, math.radians(12), 20_001)[1:]
    x = ka * np.sin(angles)
    both_ways = 0.9 * (2 * j1(x) / x * np.cos(angles)) ** 2
    reach = angles[np.flatnonzero(both_ways >= 10 ** (board.threshold_db / 20))[-1]]
    widest = max(regions_of(headings, scan.ranges), key=len)
    assert widest.range == pytest.approx(2.0, abs=1e-9)
    assert widest.bearing % math.tau == pytest.approx(0.0, abs=1e-9)
    assert math.degrees(widest.width) == pytest.approx(2 * math.degrees(reach), abs=0.5)


def test_only_wide_silence_ends_a_region() -> None:
    ranges = np.full(120, 1.0)
    ranges[60:70] = ranges[90] = ranges[0] = np.nan
    assert [(len(region), region.rows[0]) for region in regions_of(HEADINGS, ranges)] == [(108, 70)]
    ranges[80] = 2.0
    assert [(len(region), region.rows[0]) for region in regions_of(HEADINGS, ranges)] == [(97, 81), (10, 70)]
    assert regions_of(HEADINGS, np.full(120, np.nan)) == ()


def test_a_region_ends_where_a_heading_was_left_out_but_not_where_steps_vary() -> None:
    steps = np.full(20, 3.0)
    steps[5::6] = 4.2
    assert [len(one) for one in regions_of(np.radians(np.cumsum(steps)), np.full(20, 2.0))] == [20]
    without = np.delete(np.arange(0.0, 63.0, 3.0), 10)
    assert [len(one) for one in regions_of(np.radians(without), np.full(20, 2.0))] == [10, 10]


def test_a_region_across_heading_0_between_other_echoes_is_one() -> None:
    ranges = np.full(120, 2.0)
    ranges[-4:], ranges[:5] = 1.0, 1.0
    assert [(region.range, len(region)) for region in regions_of(HEADINGS, ranges)] == [(1.0, 9), (2.0, 111)]
