"""Conversion of headings from radians to degrees in [0, 360), as number and as text."""

import math


def in_degrees(heading: float, decimals: int = 9) -> float:
    """Return a heading (rad) in degrees with this number of decimals, in [0, 360)."""
    # rounded first: a value just below zero would become 360
    return round(math.degrees(heading), decimals) % 360


def heading_text(heading: float, decimals: int = 1) -> str:
    """Return a heading (rad) as text: `270.0°`."""
    return f"{in_degrees(heading, decimals):.{decimals}f}°"
