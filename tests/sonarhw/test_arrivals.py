"""Laws of the books about readings: every number is here, or missing and asked for, or lost, and only one of them."""

from hypothesis import given
from hypothesis import strategies as st

from sonarhw.arrivals import KEPT, Arrivals


@given(st.integers(1, 300), st.lists(st.tuples(st.booleans(), st.integers(0, 320)), max_size=100))
def test_every_reading_made_is_here_missing_or_lost(total: int, events: list[tuple[bool, int]]) -> None:
    arrivals, here = Arrivals(total), set()
    for arrives, number in events:
        if not arrives:
            arrivals.device_made(number)
        elif arrivals.arrived(number):
            assert number not in here
            here.add(number)
        wanted = arrivals.wanted()
        if wanted:
            first, count = wanted
            assert first not in here
            assert 1 <= count <= KEPT
            assert first >= arrivals.made - KEPT
        assert len(here) + len(arrivals._missing) + arrivals.lost == arrivals.made


def test_what_the_device_no_longer_keeps_is_lost_and_not_asked_for() -> None:
    arrivals = Arrivals(1000)
    arrivals.device_made(100)
    assert arrivals.lost == 36
    assert arrivals.wanted() == (36, 64)
    arrivals.arrived(150)
    assert arrivals.wanted() == (87, 63)
    assert arrivals.lost == 87


def test_a_count_beyond_all_sense_costs_nothing() -> None:
    arrivals = Arrivals(2**32 - 1)
    arrivals.device_made(2**32 - 1)
    assert arrivals.wanted() == (2**32 - 1 - KEPT, KEPT)


def test_a_reading_beyond_the_order_is_none() -> None:
    assert not Arrivals(10).arrived(10)
