"""Numbers in texts: headings of readings in [0, 360)°, those of estimates near a known one, values and deviations."""

import math

_MOST_DECIMALS = 6


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
    difference = math.remainder(heading - around, math.tau)
    return around + (math.pi if difference <= -math.pi else difference)


def estimate_degrees(heading: float, around: float = 0.0, decimals: int = 9) -> float:
    """Return an estimated heading (rad) in degrees, within (-180, 180] of `around` (rad), never -0."""
    return round(math.degrees(turned_near(heading, around)), decimals) + 0.0


def estimate_text(value: float, deviation: float) -> str:
    """Return a value with the decimals of two significant digits of its standard deviation, never -0."""
    return f"{value:z.{_decimals(deviation)}f}"


def deviation_text(deviation: float, unit: str) -> str:
    """Return a standard deviation with two significant digits and its unit; metres as millimetres."""
    if unit == "m":
        return deviation_text(deviation * 1000, "mm")
    return with_unit(f"{deviation:.{_decimals(deviation)}f}", unit)


def with_unit(text: str, unit: str) -> str:
    """Return a number with its unit: `1.5 mm`, `90°`, `0.9`."""
    return text + unit if unit in ("", "°") else f"{text} {unit}"


def _decimals(deviation: float) -> int:
    # rounding may need one decimal less: 0.0996 is 0.10
    rounded = float(f"{deviation:.1e}")
    return min(_MOST_DECIMALS, max(0, 1 - math.floor(math.log10(rounded)))) if rounded > 0 else _MOST_DECIMALS


def rounded_point(point: tuple[float, float]) -> list[float]:
    """Return x and y rounded to µm."""
    return [round(coordinate, 6) + 0.0 for coordinate in point]
