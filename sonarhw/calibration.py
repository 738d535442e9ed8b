"""Where a scanner's zero points and what it adds to a range, from a scan of a flat plate at a known distance.

Takes readings of a sector round the plate; hands on the range offset and the home angle. Over the width of the beam a
flat plate is heard at one range, that of the perpendicular (a region of constant depth), and as far to one side of
the perpendicular as to the other: so the range is the median over the middle of what is heard, and the direction
of the plate is the middle itself, each heading weighted by the share of its pings that heard the plate.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sonarhw.errors import NoPlate
from sonarhw.readings import FloatArray, Reading

GATE = 0.30  # m either side of the distance told: what is further off is not the plate
FEWEST = 5  # headings that hear the plate
_MIDDLE = 0.5  # share of the arc in which the echo is strong enough to be told on time


@dataclass(frozen=True)
class Calibration:
    """What a scan of a plate has shown."""

    range_offset: float  # m, measured minus true
    range_spread: float  # m, standard deviation of the ranges in the middle of the arc
    home_angle: float  # rad, where the turntable's zero points, counter-clockwise from where it should
    home_uncertainty: float  # rad, standard error from the step and the pings at the rims of the arc
    arc: float  # rad, over which the plate was heard
    headings: int  # that heard it


def calibrate(readings: Sequence[Reading], distance: float, direction: float, gate: float = GATE) -> Calibration:
    """What readings of a plate show whose face is perpendicular to `direction` (rad), `distance` m from the transducer.

    `direction` is where the turntable's angle should be when it points at the plate. Raises NoPlate where the plate
    is not heard, or is heard up to the end of the sector.
    """
    angles, heard, ranges = _by_heading(readings, distance, gate)
    weights = heard / np.maximum(1, _pings(readings, angles))
    hits = np.flatnonzero(weights)
    if len(hits) < FEWEST:
        raise NoPlate(
            f"the plate is heard at {len(hits)} heading{'' if len(hits) == 1 else 's'}, at least {FEWEST} are needed: "
            f"is it {distance:g} m away and does it face the scanner? Take smaller steps or a larger plate"
        )
    if weights[0] or weights[-1]:
        end = math.degrees(angles[0 if weights[0] else -1])
        raise NoPlate(f"the plate is heard up to {end:.4g} degrees, the end of the sector; widen the sector")
    middle = float(weights @ angles / weights.sum())
    step = float(np.median(np.diff(angles)))
    arc = float(weights.sum()) * step
    central = np.abs(angles - middle) <= _MIDDLE * arc / 2
    told = np.concatenate([ranges[index] for index in np.flatnonzero(central & (weights > 0))])
    # each rim lies within a step, and an even spread over one has a standard deviation of step / √12
    rims = step / math.sqrt(12) / math.sqrt(2)
    return Calibration(
        range_offset=float(np.median(told)) - distance,
        range_spread=float(np.std(told)),
        # so that -0.0 is told as 0.0
        home_angle=math.remainder(direction - middle, math.tau) + 0.0,
        home_uncertainty=rims,
        arc=arc,
        headings=len(hits),
    )


def _by_heading(
    readings: Sequence[Reading], distance: float, gate: float
) -> tuple[FloatArray, FloatArray, list[FloatArray]]:
    """Headings in order, (n,) rad; how many pings of each heard the plate, (n,); and its ranges at each, m."""
    angles = np.unique([round(reading.angle, 9) for reading in readings]).astype(np.float64)
    ranges: list[list[float]] = [[] for _ in angles]
    for reading in readings:
        near = [value for value in reading.echo_ranges if abs(value - distance) <= gate]
        if near:
            ranges[int(np.searchsorted(angles, round(reading.angle, 9)))].append(near[0])
    return angles, np.array([len(told) for told in ranges], dtype=np.float64), [np.array(told) for told in ranges]


def _pings(readings: Sequence[Reading], angles: FloatArray) -> FloatArray:
    """How many pings were made at each heading, (n,)."""
    places = np.searchsorted(angles, [round(reading.angle, 9) for reading in readings])
    return np.bincount(places, minlength=len(angles)).astype(np.float64)
