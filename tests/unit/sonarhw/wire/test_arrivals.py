"""Laws of the books about readings: every number is here, or missing and asked for, or lost, and only one of them."""

from hypothesis import given
from hypothesis import strategies as st

from sonarhw.wire.arrivals import Progress, ReadingArrivals
from sonarhw.wire.limits import KEPT_READINGS


@given(st.integers(1, 300), st.lists(st.tuples(st.booleans(), st.integers(0, 320)), max_size=100))
def test_every_reading_made_is_here_missing_or_lost(total: int, events: list[tuple[bool, int]]) -> None:
    arrivals, here = ReadingArrivals(total), set()
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
            assert 1 <= count <= KEPT_READINGS
            assert first >= arrivals.made - KEPT_READINGS
        assert len(here) + len(arrivals._missing) + arrivals.lost == arrivals.made


def test_what_the_device_no_longer_keeps_is_lost_and_not_asked_for() -> None:
    arrivals = ReadingArrivals(1000)
    arrivals.device_made(100)
    assert arrivals.lost == 36
    assert arrivals.wanted() == (36, 64)
    arrivals.arrived(150)
    assert arrivals.wanted() == (87, 63)
    assert arrivals.lost == 87


def test_a_count_beyond_all_sense_costs_nothing() -> None:
    arrivals = ReadingArrivals(2**32 - 1)
    arrivals.device_made(2**32 - 1)
    assert arrivals.wanted() == (2**32 - 1 - KEPT_READINGS, KEPT_READINGS)


def test_a_reading_beyond_the_order_is_none() -> None:
    assert not ReadingArrivals(10).arrived(10)


@given(st.integers(1, 40), st.lists(st.integers(-2, 45), max_size=80))
def test_progress_knows_what_is_missing_whatever_comes_in_whatever_order(total: int, numbers: list[int]) -> None:
    progress, came = Progress(total), set[int]()
    for number in numbers:
        fresh = number in range(total) and number not in came
        assert progress.take(number) is fresh
        came |= {number} & set(range(total))
        assert progress.received == len(came)
        missing = sorted(set(range(total)) - came)
        stretch = progress.stretch()
        assert progress.complete == (stretch is None) == (not missing)
        if stretch is not None:
            first, count = stretch
            assert first == missing[0]
            # all of it is missing, and what lies behind it is not, or the scan ends there
            assert set(range(first, first + count)) <= set(missing)
            assert first + count == total or first + count in came


def test_readings_before_the_first_of_an_order_belong_to_another() -> None:
    books = ReadingArrivals(10, first=6)
    assert not books.arrived(5)
    assert books.wanted() is None
    assert books.arrived(7)
    assert books.wanted() == (6, 1)
    assert books.arrived(6)
    books.device_made(10)
    assert books.wanted() == (8, 2)


def test_no_more_is_asked_for_than_the_device_keeps() -> None:
    books = ReadingArrivals(100, kept=8)
    books.device_made(30)
    assert books.lost == 22
    assert books.wanted() == (22, 8)
