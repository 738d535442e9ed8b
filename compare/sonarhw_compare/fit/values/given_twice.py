"""Check for recordings that are given twice. They would count as independent, and intervals would be too narrow."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from sonarhw.errors import InputError
from sonarhw.readings import Reading
from sonarhw_compare.fit.values.fit_result import PlacedScan


def check_given_once(scans: Sequence[PlacedScan]) -> None:
    """Raise InputError if two scans have the same readings, or one starts with those of the other (a torn copy).

    Different scans from the same place are allowed.
    """
    for one, other in combinations(scans, 2):
        alike = (_same(here, there) for here, there in zip(one.readings, other.readings, strict=False))
        if one.readings and other.readings and all(alike):
            names = f"{one.title or 'one scan'} and {other.title or 'another'}"
            raise InputError(f"{names} contain the same readings; give each log once")


def _same(one: Reading, other: Reading) -> bool:
    """Report whether two readings are equal apart from their traces, which are arrays."""
    return replace(one, trace=None) == replace(other, trace=None)
