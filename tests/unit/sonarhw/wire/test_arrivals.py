"""Properties of the arrival records: each reading is either received, missing and requested, or lost."""

from hypothesis import given
from hypothesis import strategies as st

from sonarhw.wire.limits import KEPT_READINGS
from sonarhw.wire.readings_of_frames import Progress, ReadingArrivals


@given(st.integers(1, 300), st.lists(st.tuples(st.booleans(), st.integers(0, 320)), max_size=100))
def test_every_reading_made_is_received_missing_or_lost(total: int, events: list[tuple[bool, int]]) -> None:
    arrivals, received = ReadingArrivals(total), set()
    for arrives, number in events:
        if not arrives:
            arrivals.device_made(number)
        elif arrivals.arrived(number):
            assert number not in received
            received.add(number)
        wanted = arrivals.next_resend()
        if wanted:
            first, count = wanted
            assert first not in received
            assert 1 <= count <= KEPT_READINGS
            assert first >= arrivals.made - KEPT_READINGS
        assert len(received) + len(arrivals._missing) + arrivals.lost == arrivals.made


def test_readings_no_longer_kept_are_lost_and_not_requested() -> None:
    arrivals = ReadingArrivals(1000)
    arrivals.device_made(100)
    assert arrivals.lost == 36
    assert arrivals.next_resend() == (36, 64)
    arrivals.arrived(150)
    assert arrivals.next_resend() == (87, 63)
    assert arrivals.lost == 87


def test_an_absurd_count_needs_no_memory() -> None:
    arrivals = ReadingArrivals(2**32 - 1)
    arrivals.device_made(2**32 - 1)
    assert arrivals.next_resend() == (2**32 - 1 - KEPT_READINGS, KEPT_READINGS)


def test_a_number_beyond_the_scan_is_rejected() -> None:
    assert not ReadingArrivals(10).arrived(10)


@given(st.integers(1, 40), st.lists(st.integers(-2, 45), max_size=80))
def test_progress_finds_missing_readings_in_any_order_of_arrival(total: int, numbers: list[int]) -> None:
    progress, arrived = Progress(total), set[int]()
    for number in numbers:
        fresh = number in range(total) and number not in arrived
        assert progress.take(number) is fresh
        arrived |= {number} & set(range(total))
        assert progress.received == len(arrived)
        missing = sorted(set(range(total)) - arrived)
        stretch = progress.next_missing()
        assert progress.complete == (stretch is None) == (not missing)
        if stretch is not None:
            first, count = stretch
            assert first == missing[0]
            # all of the stretch is missing, and it ends at a received reading or at the end of the scan
            assert set(range(first, first + count)) <= set(missing)
            assert first + count == total or first + count in arrived


def test_readings_before_the_first_are_rejected() -> None:
    arrivals = ReadingArrivals(10, first=6)
    assert not arrivals.arrived(5)
    assert arrivals.next_resend() is None
    assert arrivals.arrived(7)
    assert arrivals.next_resend() == (6, 1)
    assert arrivals.arrived(6)
    arrivals.device_made(10)
    assert arrivals.next_resend() == (8, 2)


def test_requests_never_exceed_what_the_device_keeps() -> None:
    arrivals = ReadingArrivals(100, kept=8)
    arrivals.device_made(30)
    assert arrivals.lost == 22
    assert arrivals.next_resend() == (22, 8)
