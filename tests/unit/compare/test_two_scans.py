"""Two scans whose differences are known: what noise explains is not reported, and what is more is."""

import math

import numpy as np
import pytest
from sonarhw_compare.two_scans import HeadingSeries, ScanChange, ScanDifference, scan_difference

from sonarhw.errors import InputError

STEP = math.radians(3)


NOISE = 0.004  # m


def walls(headings: np.ndarray) -> np.ndarray:
    """Return the ranges of four walls, each with an echo over a sector of its own, m."""
    return np.choose((np.degrees(headings) // 90).astype(int) % 4, (1.0, 2.2, 1.6, 3.0))


def scan(seed: int, pings: int = 1, step: float = STEP) -> HeadingSeries:
    headings = np.repeat(np.arange(0.0, math.tau - step / 2, step), pings)
    noise = np.random.default_rng(seed).normal(0.0, NOISE, len(headings))
    return HeadingSeries(headings, walls(headings) + noise)


def changed(series: HeadingSeries, first_deg: float, last_deg: float, to: float) -> HeadingSeries:
    """Return a scan with another range in a sector."""
    degrees = np.degrees(series.headings)
    inside = (degrees > first_deg - 0.01) & (degrees < last_deg + 0.01)
    return HeadingSeries(series.headings, np.where(inside, to, series.ranges), series.rounding)


def counts(found: ScanDifference) -> dict[ScanChange, int]:
    return {change: count for change, count in found.changes.items() if count}


@pytest.mark.parametrize("pings", [1, 5])
def test_nothing_is_reported_of_a_room_that_is_the_same(pings: int) -> None:
    for seed in range(8):
        found = scan_difference(scan(seed, pings), scan(100 + seed, pings))
        assert found.changes[ScanChange.SAME] >= 119  # one in 16 000 by chance, and the estimate of noise has an error
        assert np.allclose(found.noises, NOISE, rtol=0.35)


def test_what_moved_fell_silent_or_appeared_is_reported_with_its_headings() -> None:
    before = changed(scan(1), 300, 306, math.nan)
    after = changed(changed(changed(scan(2), 30, 42, 0.7), 120, 126, 2.23), 210, 213, math.nan)
    found = scan_difference(before, after)
    assert counts(found) == {
        ScanChange.SAME: 120 - 5 - 3 - 2 - 3,
        ScanChange.NEARER: 5,
        ScanChange.FARTHER: 3,
        ScanChange.FELL_SILENT: 2,
        ScanChange.APPEARED: 3,
    }
    ends = [[round(math.degrees(row.heading)) for row in (run[0], run[-1])] for run in found.stretches]
    assert ends == [[30, 42], [120, 126], [210, 213], [300, 306]]


def test_several_pings_show_a_change_that_one_ping_does_not() -> None:
    shift = 0.012  # m, three standard deviations of one ping
    one, many = (scan_difference(scan(3, n), changed(scan(4, n), 30, 60, 1.0 - shift)) for n in (1, 9))
    assert one.changes[ScanChange.NEARER] == 0
    assert many.changes[ScanChange.NEARER] == 11


def test_a_whole_room_that_is_farther_is_not_taken_for_noise() -> None:
    after = scan(8, 5)
    found = scan_difference(scan(7, 5), HeadingSeries(after.headings, after.ranges + 0.03))
    assert found.changes[ScanChange.FARTHER] == 120
    assert found.median == pytest.approx(0.03, abs=0.001)


def test_a_stretch_continues_over_heading_0() -> None:
    after = changed(changed(scan(14), 354, 357, 0.5), 0, 3, 0.5)
    (run,) = scan_difference(scan(13), after).stretches
    assert [round(math.degrees(row.heading)) for row in run] == [354, 357, 0, 3]


def test_scans_of_different_sectors_are_refused() -> None:
    east, west = (HeadingSeries(np.array(at), np.array([1.0, 1.0])) for at in ([0.0, 0.1], [3.0, 3.1]))
    with pytest.raises(InputError, match="no heading in common"):
        scan_difference(east, west)


def test_a_scan_without_a_reading_is_refused() -> None:
    # a new scan has none when the window first compares it
    empty = HeadingSeries(np.empty(0), np.empty(0))
    with pytest.raises(InputError, match="the second scan has no reading"):
        scan_difference(scan(15), empty)
    with pytest.raises(InputError, match="the first scan has no reading"):
        scan_difference(empty, empty)
