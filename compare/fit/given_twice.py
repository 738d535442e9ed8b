"""Whether one recording was given twice: a fit would take it for two, and tell half of how unsure it is.

Takes scans; raises InputError where two hold the same readings. Other scans from the same place are welcome.
"""

from collections.abc import Sequence
from itertools import combinations

from compare.fit.result import PlacedScan
from sonarhw.errors import InputError


def check_given_once(scans: Sequence[PlacedScan]) -> None:
    """Raises InputError where a scan's readings are another's, or their beginning as in a torn copy."""
    for one, other in combinations(scans, 2):
        both = min(len(one.readings), len(other.readings))
        if both and tuple(one.readings[:both]) == tuple(other.readings[:both]):
            names = f"{one.name or 'one scan'} and {other.name or 'another'}"
            raise InputError(f"{names} hold the same readings, one recording given twice; give each log once")
