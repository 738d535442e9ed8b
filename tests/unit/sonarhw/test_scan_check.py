"""`check_scan` names what is wrong in the readings of a scan, and nothing in scans that are as they should be."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from sonarhw.readings import FloatArray, Reading
from sonarhw.scan_check import ANY_BOARD, Doubt, Reach, check_scan

SPEED = 343.0  # m/s
BOARD = Reach("b", 0.2, 6.0)
HEADINGS = np.arange(0.0, 360.0, 5.0)  # degrees


def scan(degrees: Sequence[float] | FloatArray, ranges: Sequence[float] | FloatArray, sweep: int = 0) -> list[Reading]:
    return [
        Reading(k, sweep, 0, math.radians(angle), 0.1 * k, () if math.isnan(one) else (2 * one / SPEED,), SPEED)
        for k, (angle, one) in enumerate(zip(degrees, ranges, strict=True))
    ]


def box(degrees: FloatArray, x: float = 1.9, y: float = 1.3) -> FloatArray:
    """Return the range of the nearest of four walls around a place that is not in the middle, m."""
    along, across = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    with np.errstate(divide="ignore"):
        walls = [np.where(along > 0, x / along, -1.1 / along), np.where(across > 0, y / across, -0.9 / across)]
    return np.asarray(np.min(walls, axis=0))


def with_hole(ranges: FloatArray, distance: float, place: int) -> FloatArray:
    """Return ranges with another one at a place of a flat wall."""
    changed = ranges.copy()
    changed[place - 1 : place + 2] = 1.5, distance, 1.5
    return changed


ROOM = box(HEADINGS)
RANDOM = np.random.default_rng(1)
THIRD = RANDOM.random(len(HEADINGS)) < 1 / 3
FINE = np.arange(0.0, 360.0, 2.0)
NOISY = box(FINE) * np.where(np.arange(len(FINE)) % 3, 1.0, np.random.default_rng(2).uniform(0.3, 0.85, len(FINE)))
REFLECTED = np.where(np.arange(len(FINE)) % 3, 1.0, 1.6) * box(FINE)
ALIKE = np.round(np.where(HEADINGS % 180 < 20, 1.2, ROOM), 2)
MANY = [reading for sweep in range(6) for reading in scan(HEADINGS, ALIKE, sweep)]
SIDE = np.arange(0.0, 180.0, 6.0)  # a sweep of a servo
# in whole centimetres: a far corner, and a sign for no echo that also stands between readings of one wall
CORNER = np.round(np.where(np.abs(HEADINGS - 40) <= 25, 3.28 + 0.01 * (HEADINGS % 15 == 0), 1.2), 2)
BLOCK = np.where((HEADINGS > 300) & (HEADINGS < 340), 4.0, box(HEADINGS))
HOLES = [reading for sweep in range(3) for reading in scan(HEADINGS, with_hole(BLOCK, 4.0, 10 + 9 * sweep), sweep)]
# two sensors on one servo, a reading of each after the other
BOTH = scan(np.ravel((SIDE, SIDE + 180), "F"), box(np.ravel((SIDE, SIDE + 180), "F")))
BACK = scan(SIDE, box(SIDE)) + scan(SIDE, box(SIDE)[::-1], sweep=1)


@pytest.mark.parametrize(
    ("readings", "expected"),
    [
        (scan(HEADINGS, ROOM), []),
        (scan(HEADINGS, np.round(ROOM, 2)), []),
        (scan(HEADINGS, np.where(THIRD, np.nan, ROOM)), []),
        (scan(np.tile([0.0, 180.0, 90.0, 270.0, 45.0], 12), np.tile([1.0, 2.0, 3.0, 1.5, 2.5], 12)), []),
        (scan(SIDE, box(SIDE)) + scan(SIDE[::-1], box(SIDE[::-1]), sweep=1), []),
        (scan(HEADINGS, 100 * ROOM), ["beyond reach"]),
        (scan(HEADINGS, ROOM / 100), ["too near"]),
        (scan(HEADINGS, np.full(len(HEADINGS), np.nan)), ["no echo"]),
        (scan(HEADINGS, np.where(THIRD, 0.47, ROOM)), ["one range"]),
        (scan(HEADINGS, np.full(len(HEADINGS), 0.47) + 0.001 * RANDOM.random(len(HEADINGS))), ["one range"]),
        (MANY, []),  # a wall in each of several sweeps
        (scan(FINE, NOISY), ["scattered"]),
        (scan(FINE, box(FINE)), []),
        (scan(FINE, REFLECTED), []),
        (scan(HEADINGS, np.where(THIRD, 4.0, ROOM)), ["largest range"]),
        (scan(HEADINGS, np.where(THIRD, 0.0, ROOM)), ["largest range"]),
        (HOLES, ["largest range"]),
        (scan(HEADINGS, BLOCK), []),  # far walls that all look the same
        (scan(HEADINGS, CORNER), []),
        (scan(np.round(np.radians(HEADINGS), 4), ROOM), ["angles"]),
        (scan(np.degrees(HEADINGS), ROOM), ["angles"]),
        (scan(HEADINGS / 0.9, ROOM), ["angles"]),
        (scan(np.full(60, 90.0), 1 + 0.01 * RANDOM.random(60)), []),  # pings without a turntable
        (scan(RANDOM.permutation(HEADINGS), ROOM), ["jumping"]),
        (BACK, ["sweeps"]),
        (BOTH, []),
    ],
)
def test_what_is_wrong_in_a_scan_is_named_and_nothing_else(readings: list[Reading], expected: list[str]) -> None:
    doubts = check_scan(readings, BOARD)
    assert [doubt.kind for doubt in doubts] == expected
    assert all(doubt.problem and doubt.correction for doubt in doubts)


@pytest.mark.parametrize(
    ("scale", "reach", "correction"),
    [
        (100.0, ANY_BOARD, "if they are centimetres, times 0.01"),
        (1000.0, BOARD, "millimetres, times 0.001"),
        (1 / 0.3048 * 2, BOARD, "feet, times 0.3048"),
        (1.2, Reach("short", 0.6, 1.0), "check the board"),
    ],
)
def test_the_unit_that_would_fit_is_named(scale: float, reach: Reach, correction: str) -> None:
    (doubt,) = check_scan(scan(HEADINGS, scale * ROOM), reach)
    assert isinstance(doubt, Doubt)
    assert correction in str(doubt)
