"""Values of messages are the nearest whole numbers of their units."""

import math
from collections.abc import Callable

import pytest

from sonarhw.wire import messages


@pytest.mark.parametrize(
    ("convert", "unit"),
    [
        (messages.microseconds_of, 1e-6),
        (messages.nanoseconds_of, 1e-9),
        (messages.microdegrees_of, math.radians(1e-6)),
        (messages.millimetres_per_second_of, 1e-3),
        (messages.centidegrees_of, 1e-2),
    ],
)
def test_a_value_is_rounded_to_the_nearest_whole_number(convert: Callable[[float], int], unit: float) -> None:
    for whole in (-3, 0, 7, 21_370):
        for part in (-0.4, 0.0, 0.4):
            assert convert((whole + part) * unit) == whole
