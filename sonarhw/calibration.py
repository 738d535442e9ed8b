"""Estimate home angle and range offset of a scanner from a scan of a flat plate at a known distance.

While the plate is in the beam, all headings measure the same range. They form an arc (a region of constant depth) that
is symmetric about the perpendicular of the plate. The range is the median over the middle of the arc. The direction of
the plate is the mean heading, each heading weighted by the share of its pings that detected the plate.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonarhw.errors import NoPlate
from sonarhw.readings import FloatArray, Reading

GATE = 0.30  # m; ranges further from the stated distance are not from the plate
FEWEST = 5  # smallest number of headings that must detect the plate
_MIDDLE = 0.5  # share of the arc in which the echo is strong enough to be detected without delay


@dataclass(frozen=True)
class Calibration:
    """The result of a scan of a plate."""

    range_offset: float  # m, measured minus true
    range_spread: float  # m, standard deviation of the ranges in the middle of the arc
    home_angle: float  # rad, actual minus intended direction of the turntable's zero, counter-clockwise
    home_uncertainty: float  # rad, standard error; depends on the step only
    arc: float  # rad, width of the arc at which the plate was detected
    headings: int  # number of headings that detected the plate


def calibrate(readings: Sequence[Reading], distance: float, direction: float, gate: float = GATE) -> Calibration:
    """Return the calibration from readings of a plate, `distance` m from the transducer.

    The face of the plate is perpendicular to `direction` (rad), the angle that the turntable should have when it points
    at the plate. Raises NoPlate if too few headings detect the plate, or if the first or last heading detects it.
    """
    angles, detections, ranges = _by_heading(readings, distance, gate)
    weights = detections / np.maximum(1, _pings(readings, angles))
    hits = np.flatnonzero(weights)
    if len(hits) < FEWEST:
        raise NoPlate(
            f"the plate is detected at {len(hits)} heading{'' if len(hits) == 1 else 's'}, expected at least {FEWEST}; "
            f"check that it is {distance:g} m away and faces the scanner, or use smaller steps or a larger plate"
        )
    if weights[0] or weights[-1]:
        end = math.degrees(angles[0 if weights[0] else -1])
        raise NoPlate(f"the plate is detected up to {end:.4g} degrees, the end of the sector; use a wider sector")
    middle = float(weights @ angles / weights.sum())
    step = float(np.median(np.diff(angles)))
    arc = float(weights.sum()) * step
    central = np.abs(angles - middle) <= _MIDDLE * arc / 2
    measured = np.concatenate([ranges[index] for index in np.flatnonzero(central & (weights > 0))])
    # each end of the arc has a uniform error over one step: standard deviation step / √12; the middle is their mean
    uncertainty = step / math.sqrt(12) / math.sqrt(2)
    return Calibration(
        range_offset=float(np.median(measured)) - distance,
        range_spread=float(np.std(measured)),
        # + 0.0 turns -0.0 into 0.0
        home_angle=math.remainder(direction - middle, math.tau) + 0.0,
        home_uncertainty=uncertainty,
        arc=arc,
        headings=len(hits),
    )


def _by_heading(
    readings: Sequence[Reading], distance: float, gate: float
) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Return the headings, (n,) rad, with the number and the ranges, m, of the pings that detected the plate."""
    angles = np.unique([round(reading.angle, 9) for reading in readings]).astype(np.float64)
    ranges: list[list[float]] = [[] for _ in angles]
    for reading in readings:
        near = [value for value in reading.echo_ranges if abs(value - distance) <= gate]
        if near:
            ranges[int(np.searchsorted(angles, round(reading.angle, 9)))].append(near[0])
    return angles, np.array([len(found) for found in ranges], dtype=np.float64), [np.array(found) for found in ranges]


def _pings(readings: Sequence[Reading], angles: FloatArray) -> FloatArray:
    """Return the number of pings at each heading, (n,)."""
    places = np.searchsorted(angles, [round(reading.angle, 9) for reading in readings])
    return np.bincount(places, minlength=len(angles)).astype(np.float64)
