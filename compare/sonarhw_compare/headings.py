"""Headings as people and files have them: in degrees, from 0 up to but never 360.

Takes radians; hands on numbers and text.
"""

import math


def in_degrees(heading: float, decimals: int = 9) -> float:
    """A heading (rad) in degrees with so many decimals, 0 up to but never 360."""
    # rounded first: a hair below zero would become 360
    return round(math.degrees(heading), decimals) % 360


def heading_text(heading: float, decimals: int = 1) -> str:
    """A heading (rad) as a person reads it: `270.0°`."""
    return f"{in_degrees(heading, decimals):.{decimals}f}°"
