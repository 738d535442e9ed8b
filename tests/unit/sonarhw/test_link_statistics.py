"""The counters of a link add up over connections, and the round trip is smoothed."""

import dataclasses

import pytest

from sonarhw.link import LinkStatistics, smoothed

COUNTERS = [field.name for field in dataclasses.fields(LinkStatistics) if field.name != "round_trip"]


def test_a_new_link_has_counted_nothing() -> None:
    assert {getattr(LinkStatistics(), name) for name in COUNTERS} == {0}
    assert LinkStatistics().round_trip is None


def test_the_counters_of_two_connections_add_up() -> None:
    first = LinkStatistics(**dict(zip(COUNTERS, range(1, 100), strict=False)), round_trip=0.010)
    second = LinkStatistics().more(**dict.fromkeys(COUNTERS, 100))
    both = first + second
    assert [getattr(both, name) for name in COUNTERS] == [101 + k for k in range(len(COUNTERS))]
    assert both.round_trip == 0.010
    assert (both + LinkStatistics(round_trip=0.020)).round_trip == 0.020


def test_the_round_trip_begins_with_the_first_and_approaches_the_newest() -> None:
    assert smoothed(None, 0.010) == 0.010
    assert smoothed(0.010, 0.020) == pytest.approx(0.012)
    average = 0.010
    for _ in range(40):
        average = smoothed(average, 0.020)
    assert average == pytest.approx(0.020, rel=1e-3)
