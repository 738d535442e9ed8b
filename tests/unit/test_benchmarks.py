"""The table of speeds, which no test prints, fits the code that it measures."""

from benchmarks.cases.office import office_floor
from benchmarks.speed import kernel_arrivals, numpy_arrivals


def test_numpy_finds_every_arrival_of_the_kernel_whose_time_is_compared() -> None:
    floor = office_floor(64)
    arrivals = kernel_arrivals(floor)
    assert len(arrivals) > 10
    assert arrivals <= numpy_arrivals(floor)
