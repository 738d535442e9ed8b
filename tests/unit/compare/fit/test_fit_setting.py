"""The setting of a fit: rooms and places that logs lack, and the arrays of their readings."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit.fitting import fit_setting, placed_scans
from sonarhw_compare.fit.objective import scan_arrays
from sonarhw_compare.scans import GivenScan
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw.readings import Reading

SPEED = 340.0


def scan(*echo_times: tuple[float, ...]) -> GivenScan:
    """Return readings 90° apart, without a log, so that their place is unknown."""
    return GivenScan(
        "mine", tuple(Reading(k, 0, 0, k * math.pi / 2, 0.0, times, SPEED) for k, times in enumerate(echo_times))
    )


def test_an_unknown_place_is_searched_from_the_middle_of_the_room_if_the_position_is_free() -> None:
    found = fit_setting([scan((0.01,))], "rooms/arena.toml", [], "lego-nxt", ["position", "heading"], [])
    ends = found.room.walls.reshape(-1, 2)
    (placed,) = found.scans
    assert placed.place.position == pytest.approx((ends.min(axis=0) + ends.max(axis=0)) / 2)


@pytest.mark.parametrize(
    ("free", "fixed"), [(["heading"], "x and y are fixed"), (["x", "heading"], "y is fixed"), (["y"], "x is fixed")]
)
def test_an_unknown_place_is_refused_if_a_coordinate_is_fixed(free: list[str], fixed: str) -> None:
    with pytest.raises(InputError, match=f"mine: its place is unknown, and {fixed}; give a place"):
        fit_setting([scan((0.01,))], "rooms/arena.toml", [], "lego-nxt", free, [])


def test_scans_of_logs_with_the_same_name_have_different_names() -> None:
    scans = [replace(scan((0.01,)), where=where) for where in ("a/scan.mcap", "b/scan.mcap", "b/other.mcap")]
    here = Place("here", (0.0, 0.0))
    placed = placed_scans(scans, [here] * 3)
    assert len({one.name for one in placed}) == 3
    assert [one.file for one in placed] == ["a/scan.mcap", "b/scan.mcap", "b/other.mcap"]
    assert [one.name for one in placed_scans(scans[1:], [here] * 2)] == ["scan", "other"]


def test_readings_have_columns_for_later_echoes_only_if_any_has_a_second_one() -> None:
    one = scan_arrays(scan((0.01,), ()).readings, None, all_echoes=True)
    assert one.ranges == pytest.approx(np.array([[0.01 * SPEED / 2], [math.nan]]), nan_ok=True)
    assert (one.counts.tolist(), one.ends.tolist()) == ([1, 0], [True, False])
    several = scan_arrays(scan((0.01, 0.02), ()).readings, None, all_echoes=True)
    assert several.ranges[0, :2] == pytest.approx([1.7, 3.4])
    assert (several.counts.tolist(), several.ends.tolist()) == ([2, 0], [False, False])
    first = scan_arrays(scan((0.01, 0.02), ()).readings, None, all_echoes=False)
    assert (first.ranges.shape, first.counts.tolist(), first.ends.tolist()) == ((2, 1), [1, 0], [True, False])
