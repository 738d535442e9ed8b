"""Estimate home angle and range offset of a scanner from a scan of a flat plate at a known distance.

While the plate is in the main lobe of the beam, all headings measure the same range. They form an arc (a region of
constant depth) that is symmetric about the perpendicular of the plate. The range is the median over the middle of the
arc. The direction of the plate is the mean heading of the arc, each heading weighted by the share of its pings that
detected the plate. Echoes of the plate's rims, which are some millimetres farther away, and of the side lobes are
outside the arc.

Echoes that are not plausible for a flat plate at that distance are refused. A plate that is turned by a few degrees, or
a distance that is wrong by a few centimetres, cannot be distinguished from a home angle and a range offset.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import NoPlate, counted
from sonarhw.readings import FloatArray, Reading

GATE = 0.30  # m; ranges further from the stated distance are not from the plate
FEWEST = 5  # smallest number of headings that must detect the plate
MOST_OFFSET = 0.10  # m; the offset of such a board is a few centimetres
MOST_TURN = math.radians(10.0)  # between the perpendicular of the plate and the direction that it should face
MOST_SPREAD = 0.010  # m, standard deviation of the ranges in the middle
MOST_SLOPE = 0.010  # m, change of the range over the middle
_JUMP = 0.015  # m; from one heading to the next, ranges of a plate differ less
_RIM = 0.004  # m; ranges that exceed the median of the arc by more are those of a rim
_SCATTERED = 2  # headings in a row with such ranges are not a rim, but scatter
_MIDDLE = 0.5  # share of the arc in which the echo is strong enough to be detected without delay


@dataclass(frozen=True)
class Calibration:
    """The result of a scan of a plate."""

    range_offset: float  # m, measured minus true, without the delay of the receiver
    range_spread: float  # m, standard deviation of the ranges in the middle of the arc
    home_angle: float  # rad, actual minus intended direction of the turntable's zero, counter-clockwise
    home_uncertainty: float  # rad, standard error; depends on the step only
    arc: float  # rad, width of the arc at which the plate was detected
    headings: int  # number of headings that detected the plate


def calibrate(
    readings: Sequence[Reading],
    distance: float,
    direction: float,
    gate: float = GATE,
    arcs: tuple[float, float] = (0.0, math.tau),
    delay: float = 0.0,
) -> Calibration:
    """Return the calibration from readings of a plate, `distance` m from the transducer.

    The face of the plate is perpendicular to `direction` (rad), the angle that the turntable should have when it points
    at the plate. `arcs` (rad) are the smallest and the largest plausible arc of a plate. `delay` (m) is the part of the
    range that the board's receiver adds and every prediction contains; it is no offset. Raises NoPlate if too few
    headings detect the plate, if the first or last heading detects it, or if the echoes do not fit a flat plate.
    """
    angles, ranges = _by_heading(readings, distance, gate)
    hits = _longest_arc(ranges)
    _check_hits(hits, angles, distance, readings)
    step = float(np.median(np.diff(angles)))
    shares = np.array([len(found) for found in ranges]) / _pings(readings, angles)
    _check_flatness([ranges[k] for k in _central(hits, angles, shares, step)])
    hits = _without_rims(hits, ranges)
    middle, arc = _arc_of(hits, angles, shares, step)
    measured = np.concatenate([ranges[k] for k in _central(hits, angles, shares, step)])
    found = Calibration(
        range_offset=float(np.median(measured)) - distance - delay,
        range_spread=float(np.std(measured)),
        # + 0.0 turns -0.0 into 0.0
        home_angle=math.remainder(direction - middle, math.tau) + 0.0,
        # each end of the arc has a uniform error over one step: standard deviation step / √12; the middle is their mean
        home_uncertainty=step / math.sqrt(12) / math.sqrt(2),
        arc=arc,
        headings=len(hits),
    )
    _check_plate(found, distance, middle, arcs)
    return found


def _longest_arc(ranges: Sequence[FloatArray]) -> NDArray[np.intp]:
    """Return the longest row of consecutive headings whose ranges differ little from one to the next, (n,) int."""
    longest: list[int] = []
    row: list[int] = []
    last = math.nan
    for k, found in enumerate(ranges):
        here = float(np.median(found)) if len(found) else math.nan
        continues = abs(here - last) <= _JUMP
        row = [*row, k] if continues else [k] if len(found) else []
        longest = max(longest, row, key=len)
        last = here
    return np.array(longest, dtype=np.intp)


def _check_hits(hits: NDArray[np.intp], angles: FloatArray, distance: float, readings: Sequence[Reading]) -> None:
    if len(hits) < FEWEST:
        count = counted(len(hits), "heading")
        raise NoPlate(
            f"the plate is detected at {count} in a row, expected at least {FEWEST}; {_found_instead(readings)}; check "
            f"that it is {distance:g} m away and faces the scanner, or use smaller steps or a larger plate"
        )
    if hits[0] == 0 or hits[-1] == len(angles) - 1:
        end = math.degrees(angles[0 if hits[0] == 0 else -1])
        raise NoPlate(
            f"echoes near {distance:g} m reach {end:.4g} degrees, the end of the sector; check that the plate is "
            f"{distance:g} m away; if it is, use a wider sector"
        )


def _found_instead(readings: Sequence[Reading]) -> str:
    ranges = [reading.range for reading in readings if reading.range is not None]
    if not ranges:
        return "no reading has an echo"
    return f"{len(ranges)} of {len(readings)} readings have an echo, with a median of {np.median(ranges):.2f} m"


def _arc_of(hits: NDArray[np.intp], angles: FloatArray, shares: FloatArray, step: float) -> tuple[float, float]:
    """Return the middle and the width of an arc, rad; each heading counts by its share of pings with an echo."""
    weights = shares[hits]
    return float(weights @ angles[hits] / weights.sum()), float(weights.sum()) * step


def _central(hits: NDArray[np.intp], angles: FloatArray, shares: FloatArray, step: float) -> NDArray[np.intp]:
    """Return the headings in the middle of an arc."""
    middle, arc = _arc_of(hits, angles, shares, step)
    return hits[np.abs(angles[hits] - middle) <= _MIDDLE * arc / 2]


def _without_rims(hits: NDArray[np.intp], ranges: Sequence[FloatArray]) -> NDArray[np.intp]:
    """Return the longest row of the consecutive `hits` (n,) without a rim, which may join a side lobe to the arc."""
    medians = np.array([float(np.median(ranges[k])) for k in hits])
    plate = hits[medians <= np.median(medians) + _RIM]
    row = max(np.split(plate, np.flatnonzero(np.diff(plate) > _SCATTERED + 1) + 1), key=len)
    return np.asarray(hits[(hits >= row[0]) & (hits <= row[-1])])


def _check_flatness(central: Sequence[FloatArray]) -> None:
    """Raise NoPlate unless the ranges in the middle of the arc, m by heading, are those of a flat plate."""
    middle, spread = np.array([float(np.median(found)) for found in central]), float(np.std(np.concatenate(central)))
    slope = float(np.polyfit(np.linspace(0, 1, len(middle)), middle, 1)[0]) if len(middle) > 1 else 0.0
    if spread > MOST_SPREAD or abs(slope) > MOST_SLOPE:
        raise NoPlate(
            f"the ranges in the middle of the echo have a standard deviation of {spread * 1000:.1f} mm and "
            f"change by {abs(slope) * 1000:.1f} mm from one side to the other, expected at most {MOST_SPREAD * 1000:g} "
            f"and {MOST_SLOPE * 1000:g} mm for a flat plate; place a flat plate there, and nothing else near it"
        )


def _check_plate(found: Calibration, distance: float, middle: float, arcs: tuple[float, float]) -> None:
    """Raise NoPlate unless distance, direction and strength of the echo are plausible."""
    if abs(found.range_offset) > MOST_OFFSET:
        raise NoPlate(
            f"the echo comes from {distance + found.range_offset:.3f} m, expected {distance:g} m within "
            f"{MOST_OFFSET * 100:g} cm; check that a plate stands there, and measure its distance from the face of the "
            "transducer"
        )
    if abs(found.home_angle) > MOST_TURN:
        intended = math.degrees(middle + found.home_angle)
        raise NoPlate(
            f"the middle of the echo is at {math.degrees(middle):.1f} degrees, expected {intended:.4g} degrees within "
            f"{math.degrees(MOST_TURN):g}; turn the plate so that it faces the scanner, or change the direction"
        )
    if not arcs[0] <= found.arc <= arcs[1]:
        low, high = map(math.degrees, arcs)
        raise NoPlate(
            f"the echo is detected over {math.degrees(found.arc):.1f} degrees, expected {low:.1f} to {high:.1f} for a "
            "flat plate and this board profile; use a flat plate of at least 30 cm, no post or corner; if it is one, "
            "correct threshold_db of the profile"
        )


def _by_heading(readings: Sequence[Reading], distance: float, gate: float) -> tuple[FloatArray, list[FloatArray]]:
    """Return the headings, (n,) rad, and at each the ranges, m, of the pings that detected something in the gate."""
    angles = np.unique([round(reading.angle, 9) for reading in readings]).astype(np.float64)
    ranges: list[list[float]] = [[] for _ in angles]
    for reading in readings:
        near = [value for value in reading.echo_ranges if abs(value - distance) <= gate]
        if near:
            ranges[int(np.searchsorted(angles, round(reading.angle, 9)))].append(near[0])
    return angles, [np.array(found) for found in ranges]


def _pings(readings: Sequence[Reading], angles: FloatArray) -> FloatArray:
    """Return the number of pings at each heading, (n,)."""
    places = np.searchsorted(angles, [round(reading.angle, 9) for reading in readings])
    return np.bincount(places, minlength=len(angles)).astype(np.float64)
