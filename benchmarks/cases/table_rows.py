"""Rows of a table of measurements: measured value, required value, and whether it is met."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    work: str
    required: str
    measured: str
    holds: bool


def at_least(work: str, required: float, measured: float) -> Row:
    """Return a row of a value with a minimum."""
    return Row(work, f"≥ {required:g}", f"{measured:.1f}", measured >= required)


def at_most(work: str, required: float, measured: float) -> Row:
    """Return a row of a value with a maximum."""
    return Row(work, f"≤ {required:g}", f"{measured:.2f}", measured <= required)


def without_limit(work: str, measured: float, digits: int = 0) -> Row:
    """Return a row of a value that is only stated, with so many decimal digits."""
    return Row(work, "-", f"{measured:.{digits}f}", True)
