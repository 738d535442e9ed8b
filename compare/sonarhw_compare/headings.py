"""Conversion of headings from radians to degrees: of readings in [0, 360), of estimates near a known heading."""

import math


def in_degrees(heading: float, decimals: int = 9) -> float:
    """Return a heading (rad) in degrees with this number of decimals, in [0, 360)."""
    # rounded first: a value just below zero would become 360
    return round(math.degrees(heading), decimals) % 360


def heading_text(heading: float, decimals: int = 1) -> str:
    """Return a heading (rad) as text: `270.0°`."""
    return f"{in_degrees(heading, decimals):.{decimals}f}°"


def turned_near(heading: float, around: float = 0.0) -> float:
    """Return the same heading (rad), by full turns, within (-π, π] of `around` (rad).

    An estimate and its interval then read as one: -0.02 ± 0.07, not 359.98 ± 0.07.
    """
    # remainder gives -π for half a turn backwards
    apart = math.remainder(heading - around, math.tau)
    return around + (math.pi if apart <= -math.pi else apart)


def estimate_degrees(heading: float, around: float = 0.0, decimals: int = 9) -> float:
    """Return an estimated heading (rad) in degrees, within (-180, 180] of `around` (rad), never -0."""
    return round(math.degrees(turned_near(heading, around)), decimals) + 0.0
