"""Rows of the table of figures: what is measured, what is wanted, and whether it holds."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    work: str
    wanted: str
    measured: str
    holds: bool


def at_least(work: str, wanted: float, measured: float) -> Row:
    """A row of what should be large."""
    return Row(work, f"≥ {wanted:g}", f"{measured:.1f}", measured >= wanted)


def at_most(work: str, wanted: float, measured: float) -> Row:
    """A row of what should be small."""
    return Row(work, f"≤ {wanted:g}", f"{measured:.2f}", measured <= wanted)
