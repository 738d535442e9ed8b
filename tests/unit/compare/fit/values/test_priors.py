"""Priors in text: bounds and normal distributions in the units of the command line."""

import math

import pytest
from sonarhw_compare.fit.parameters import Parameter, check_words, free_parameters, with_priors
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.errors import InputError

ROOM, BOARD = load_room("rooms/simple.toml"), load_board("paper")
FREE = ("x", "heading", "temperature")


def with_prior(*priors: str, scans: tuple[str, ...] = ("",)) -> dict[str, Parameter]:
    return {one.name: one for one in with_priors(free_parameters(FREE, scans, ROOM, BOARD), priors)}


@pytest.mark.parametrize(
    ("text", "lower", "upper"),
    [("0.2..1.4", 0.2, 1.4), ("-1..+1.5", -1.0, 1.5), (".5 .. 2e0", 0.5, 2.0), ("-1e6..1e6", -1e6, 1e6)],
)
def test_a_range_sets_the_bounds(text: str, lower: float, upper: float) -> None:
    found = with_prior(f"x={text}")["x"]
    assert (found.lower, found.upper, found.expected, found.deviation) == (lower, upper, None, None)


@pytest.mark.parametrize(
    ("text", "expected", "deviation"),
    [("21+-1", 21.0, 1.0), ("-3.5±0.25", -3.5, 0.25), ("2e1 +- 1e-6", 20.0, 1e-6), ("45+-1e6", 45.0, 1e6)],
)
def test_a_value_with_a_deviation_is_a_normal_distribution_within_the_bounds(
    text: str, expected: float, deviation: float
) -> None:
    found, before = with_prior(f"temperature={text}")["temperature"], with_prior()["temperature"]
    assert (found.expected, found.deviation) == (expected, deviation)
    assert (found.lower, found.upper) == (before.lower, before.upper) == (-10.0, 45.0)


def test_headings_are_given_in_degrees() -> None:
    normal, bounded = with_prior("heading=90+-5")["heading"], with_prior("heading=-10..20")["heading"]
    assert (normal.expected, normal.deviation) == pytest.approx((math.pi / 2, math.radians(5.0)))
    assert (bounded.lower, bounded.upper) == pytest.approx((math.radians(-10.0), math.radians(20.0)))


def test_a_prior_of_a_quantity_is_for_all_scans_and_one_of_a_parameter_for_its_scan() -> None:
    every = with_prior("x=0.1..0.5", scans=("A", "B"))
    assert (every["x@A"].upper, every["x@B"].upper, every["temperature"].upper) == (0.5, 0.5, 45.0)
    one = with_prior("x=0.1..0.5", "x@B=0.2..0.3", scans=("A", "B"))
    assert (one["x@A"].upper, one["x@B"].upper) == (0.5, 0.3)


@pytest.mark.parametrize(
    "text", ["", "1", "2..1", "1..1", "1..", "..1", "-1.1e6..0", "0..1.1e6", "1.1e6+-1", "-1.1e6+-1", "1+-1.1e6", "1+-"]
)
def test_malformed_priors_are_rejected_before_and_with_the_parameters(text: str) -> None:
    expected = "expected NAME=VALUE\\+-DEVIATION, or NAME=LOW..HIGH with LOW below HIGH, and numbers from -1e\\+06"
    with pytest.raises(InputError, match=expected):
        check_words(FREE, [f"x={text}"])
    with pytest.raises(InputError, match=expected):
        with_prior(f"x={text}")


@pytest.mark.parametrize("text", ["20+-9e-7", "46+-1", "-11+-1"])
def test_a_deviation_too_small_and_a_value_out_of_bounds_are_rejected(text: str) -> None:
    with pytest.raises(InputError, match="expected a deviation of at least 1e-06 and a value from -10 to 45"):
        with_prior(f"temperature={text}")
    with pytest.raises(InputError, match=r"expected a deviation of at least 1e-06$"):
        with_prior("heading=20+-1e-7")


def test_a_prior_of_what_is_not_free_is_rejected() -> None:
    check_words(FREE, ["x=1..2", "x@B=1..2", "temperature=20+-1"])
    check_words(("reflectance:board",), ["reflectance:board=0.5..0.9"])
    check_words((), ["offset=0+-1"])
    with pytest.raises(
        InputError, match=r"prior y=1\.\.2: y is not free; free it too, or use one of x, heading, temperat"
    ):
        check_words(FREE, ["y=1..2"])
    with pytest.raises(
        InputError, match=r"prior y=1\.\.2: expected NAME=… with a free quantity: x, heading, temperature"
    ):
        with_prior("y=1..2")
