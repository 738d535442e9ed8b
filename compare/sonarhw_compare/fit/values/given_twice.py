"""Whether one recording was given twice: a fit would take it for two, and tell half of how unsure it is.

Takes scans; raises InputError where two hold the same readings. Other scans from the same place are welcome.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

from sonarhw.errors import InputError
from sonarhw.readings import Reading
from sonarhw_compare.fit.values.fit_result import PlacedScan


def check_given_once(scans: Sequence[PlacedScan]) -> None:
    """Raises InputError where a scan's readings are another's, or their beginning as in a torn copy."""
    for one, other in combinations(scans, 2):
        alike = (_same(here, there) for here, there in zip(one.readings, other.readings, strict=False))
        if one.readings and other.readings and all(alike):
            names = f"{one.name or 'one scan'} and {other.name or 'another'}"
            raise InputError(f"{names} hold the same readings, one recording given twice; give each log once")


def _same(one: Reading, other: Reading) -> bool:
    """Whether all but the traces, which are arrays, is equal."""
    return replace(one, trace=None) == replace(other, trace=None)
