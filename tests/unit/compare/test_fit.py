"""Fits: words, priors and setting; searches of distributions with known moments; shifted walls; the plain fit."""

import math
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from sonarhw_compare.fit import FitOptions, PlacedScan, fit_scans, fitting, free_parameters, quantities
from sonarhw_compare.fit.free_walls import corner_moves, with_shifted_walls
from sonarhw_compare.fit.objective import LEVELS, PROBABILITIES, Objective, tolerance_prior
from sonarhw_compare.fit.parameters import Parameter, tolerated_parameters, with_priors
from sonarhw_compare.fit.search import averaged
from sonarhw_compare.fit.starting import fit_scan, likely_fit
from sonarhw_compare.scans import GivenScan
from sonarhw_sim.air import Air, Model
from sonarhw_sim.board.profile import Mount, load_board
from sonarhw_sim.room.room import Place, load_room, parse_room

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from tests.fixtures.predicted_readings import predicted_readings, readings_of
from tests.fixtures.rooms_for_tests import polygon_room, room_of

BOARD = replace(load_board("polaroid-6500"), mount=Mount(ahead=0.05, aside=-0.01), range_offset=0.02)
ROOM = room_of([(-1.0, 0.0, 2.0, 0.5), (2.0, 0.5, 2.0, 3.0)], [(0.0, 4.0, 0.1)], [0.9, 0.8, 0.7])
ARENA, SIMPLE, PAPER = load_room("arena"), load_room("simple"), load_board("paper")
FIGURE_9 = SIMPLE.places["figure9"]


# Words, bounds and priors.


@pytest.mark.parametrize(
    ("free", "scans", "names"),
    [
        ("position heading", [""], "x y heading"),
        ("position", ["A", "B"], "x@A x@B y@A y@B"),
        ("axis", [""], "ahead aside"),
        ("reflectances", [""], "reflectance:m0 reflectance:m1 reflectance:m2"),
        ("reflectance:m1 x x", [""], "reflectance:m1 x"),
        ("walls", [""], "wall:w0 wall:w1"),
    ],
)
def test_a_word_frees_its_group_and_a_part_only_itself(free: str, scans: list[str], names: str) -> None:
    assert [one.name for one in free_parameters(free.split(), scans, ROOM, BOARD)] == names.split()
    assert quantities.words_of(quantities.PlaceQuantity) == "position (x, y), heading"
    assert all(word.partition("[")[0] in quantities.words_of() for word in quantities.WORDS)


FREE = ("x", "heading", "temperature")


def with_prior(*priors: str, scans: tuple[str, ...] = ("",)) -> dict[str, Parameter]:
    return {one.name: one for one in with_priors(free_parameters(FREE, scans, SIMPLE, PAPER), priors)}


@pytest.mark.parametrize(
    ("text", "prior"),
    [
        ("x=0.2..1.4", (0.2, 1.4, None, None)),
        ("x=-1..+1.5", (-1.0, 1.5, None, None)),
        ("x=.5 .. 2e0", (0.5, 2.0, None, None)),
        ("heading=-10..20", (math.radians(-10), math.radians(20), None, None)),
        ("heading=90+-5", (-math.inf, math.inf, math.pi / 2, math.radians(5))),
        ("temperature=21+-1", (-10.0, 45.0, 21.0, 1.0)),
        ("temperature=-3.5±0.25", (-10.0, 45.0, -3.5, 0.25)),
        ("temperature=2e1 +- 1e-6", (-10.0, 45.0, 20.0, 1e-6)),
    ],
)
def test_a_prior_is_a_range_or_a_normal_distribution(text: str, prior: tuple[float | None, ...]) -> None:
    found = with_prior(text)[text.split("=")[0]]
    for value, expected in zip((found.lower, found.upper, found.expected, found.deviation), prior, strict=True):
        assert value == (expected if expected is None else pytest.approx(expected))


# The setting of a fit, and what is reported of it.


def given(*ranges: float) -> GivenScan:
    """Return readings 90° apart, without a log, so that their place is unknown."""
    return GivenScan("mine", tuple(readings_of(np.arange(len(ranges)) * math.pi / 2, ranges)))


def test_an_unknown_place_is_searched_from_the_middle_of_the_room_if_its_position_is_free() -> None:
    ends = ARENA.walls.reshape(-1, 2)
    (placed,) = fitting.fit_setting([given(1.7)], "arena", [], "lego-nxt", ["position", "heading"], []).scans
    assert placed.place.position == pytest.approx((ends.min(axis=0) + ends.max(axis=0)) / 2)
    for free, fixed in ((["heading"], "x and y are fixed"), (["x"], "y is fixed"), (["y"], "x is fixed")):
        with pytest.raises(InputError, match=f"mine: its place is unknown, and {fixed}; give a place"):
            fitting.fit_setting([given(1.7)], "arena", [], "lego-nxt", free, [])


def test_a_room_gets_the_fitted_place_temperature_and_reflectance() -> None:
    free = ("position", "heading", "temperature", f"reflectance:{SIMPLE.materials[0]}")
    parameters = free_parameters(free, ("scan",), SIMPLE, PAPER)
    values = dict(zip(parameters, (0.7, 0.1, 0.0, 23.456, 0.81), strict=True))
    found = fitting.fitted_room(SIMPLE, values, [Place("found", (0.7123456, 0.1), math.radians(-90.0))])
    for room in (found, parse_room(found.text, "again")):
        assert room.air.temperature_c == pytest.approx(23.456, abs=0.06)
        assert room.reflectances[0] == pytest.approx(0.81)
        assert room.places["found"].position == pytest.approx((0.7123456, 0.1), abs=1e-4)
        assert math.degrees(room.places["found"].heading) % 360 == pytest.approx(270.0)
        assert set(room.places) == {*SIMPLE.places, "found"}
    listed = fitting.with_listed_findings(SIMPLE, SIMPLE.name, ["reflectance:a\nname = 'other' 0.9"], ["scan"])
    assert listed.name == SIMPLE.name
    assert listed.text.splitlines()[1] == r"#   reflectance:a\nname = 'other' 0.9"
    # without a fitted position the room keeps its places
    warm = {parameters[3]: 20.0}
    assert set(fitting.fitted_room(SIMPLE, warm, [Place("found", (0.7, 0.1))]).places) == set(SIMPLE.places)


# Searches and samples of distributions that are known.


# x, two walls with a tolerance of 5 mm, and the turntable's scale with one of 1 %
TOLERATED = (
    Parameter(quantities.X),
    *(Parameter(quantities.WALL, name, expected=0.0, deviation=0.005, is_tolerated=True) for name in ("west", "east")),
    Parameter(quantities.SCALE, expected=1.0, deviation=0.01, is_tolerated=True),
)


def test_what_is_neither_free_nor_exact_is_tolerated() -> None:
    levels = {"scale", "threshold", "aperture", "reflectance:board"}
    for free, tolerance, expected in (
        (["position"], 0.005, levels | {"wall:west", "wall:east"}),
        (["position", "wall:east", "aperture"], 0.005, levels - {"aperture"} | {"wall:west"}),
        (["position"], 0.0, levels),
    ):
        parameters = free_parameters(free, [""], ARENA, BOARD)
        found = tolerated_parameters(parameters, ARENA, BOARD, tolerance, ("west", "east"))
        assert {one.name for one in found} == expected


def test_the_average_over_deviations_has_the_moments_of_a_direct_calculation() -> None:
    """The likelihood is normal: two measurements of x plus or minus a wall, and one of the scale."""
    rows = np.array([[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    measured, errors = np.array([0.5, 0.503, 1.0002]), np.array([2e-4, 2e-4, 1e-3])
    widest, prior = np.array([0.005, 0.005, 0.01]), np.array([0.0, 0.0, 0.0, 1.0])

    def posterior(levels: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        among = np.diag([0.01, *(widest * levels[[0, 0, 1]]) ** 2])  # a wide prior of x
        of_data = rows @ among @ rows.T + np.diag(errors**2)
        gain = among @ rows.T @ np.linalg.inv(of_data)
        evidence = multivariate_normal(rows @ prior, of_data).pdf(measured)
        return prior + gain @ (measured - rows @ prior), among - gain @ rows @ among, float(evidence)

    top, covariance, _ = posterior(np.ones(2))
    found = averaged(top, covariance, tolerance_prior(TOLERATED))
    several = [posterior(np.array(levels)) for levels in product(LEVELS, repeat=2)]
    weights = np.array([one[2] for one in several]) * np.outer(PROBABILITIES, PROBABILITIES).ravel()
    weights /= weights.sum()
    mean = sum(weight * one[0] for weight, one in zip(weights, several, strict=True))
    spread = sum(w * (c + np.outer(m - mean, m - mean)) for w, (m, c, _) in zip(weights, several, strict=True))
    assert found.weights == pytest.approx(weights, abs=1e-4)
    assert found.mean == pytest.approx(mean, rel=1e-5)
    assert np.diag(found.covariance) == pytest.approx(np.diag(spread), rel=1e-3)


# Results do not depend on the rounding of a processor.


@pytest.mark.parametrize("samples", [0, 200])
def test_values_without_effect_have_their_prior(samples: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """No sound reaches the walls of carpet and felt. Last digits and equal eigenvalues differ between processors."""
    text = Path("rooms/arena.toml").read_text(encoding="utf-8")
    for name, x, reflectance in (("carpet", -1.0, 0.7), ("felt", -2.0, 0.4)):
        text += f'[[walls]]\nname = "{name}"\nmaterial = "{name}"\npoints = [[{x}, 0.0], [{x}, 1.68]]\n'
        text += f"[materials.{name}]\nreflectance = {reflectance}\n"
    room, board = parse_room(text, "arena"), replace(load_board("polaroid-6500"), max_range=0.9)
    readings = predicted_readings(room, room.place("p3"), board, 15.0)
    random, many, eigh = np.random.default_rng(1), Objective.many, np.linalg.eigh

    def noisy(objective: Objective, values: FloatArray) -> FloatArray:
        exact = many(objective, values)
        return exact * (1 + 1e-13 * random.uniform(-1, 1, exact.shape))

    def other(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
        values, vectors = eigh(matrix)
        for value in values if matrix.ndim == 2 else ():
            same = np.abs(values - value) < 1e-6
            turn = np.linalg.qr(random.normal(size=(same.sum(), same.sum())))[0]
            vectors[..., same] = vectors[..., same] @ turn
        return values, vectors * (1 + 1e-12 * random.uniform(-1, 1, vectors.shape))

    monkeypatch.setattr(Objective, "many", noisy)
    monkeypatch.setattr(np.linalg, "eigh", other)
    free = free_parameters(["offset", "reflectance"], [""], room, board)
    options = FitOptions(samples=samples, global_search=False, exact=True)
    result = fit_scans([PlacedScan(readings, room.place("p3"))], room, board, free, options=options)
    determined = [one.name for one in free if not fitting.is_unconstrained(one, result.estimates[one.name])]
    assert determined == ["offset", "reflectance:board"]
    for name, value in (("carpet", 0.7), ("felt", 0.4)):
        found = result.estimates[f"reflectance:{name}"]
        assert (found.value, found.deviation) == (value, pytest.approx(0.8 / math.sqrt(12)))
        assert (found.lower, found.upper) == pytest.approx((0.22, 0.98))
    assert result.correlations[2:, :2].tolist() == [[0.0, 0.0], [0.0, 0.0]]


# Walls that are moved, against the corners of rectangles and triangles, and finite differences.


@pytest.mark.parametrize("by", [0.01, -0.01])
def test_a_wall_that_ends_on_another_one_still_ends_on_it(by: float) -> None:
    """Otherwise its end is free, and diffracts: the arena had an edge more for a divider that was off."""
    text = Path("rooms/arena.toml").read_text(encoding="utf-8")
    moved = with_shifted_walls(ARENA, {"divider": by})  # by the left, towards smaller x
    drawn_text = text.replace("0.84, 1.26], [0.84, 2.10", f"{0.84 - by}, 1.26], [{0.84 - by}, 2.10")
    drawn_room = parse_room(drawn_text.replace("[0.84, 1.68]", f"[{0.84 - by}, 1.68]"), "drawn")
    assert moved.walls == pytest.approx(drawn_room.walls)
    assert moved.edges.names == drawn_room.edges.names


# The plain fit on a grid.


def test_the_plain_fit_finds_heading_offset_and_a_position_nearby() -> None:
    true = replace(FIGURE_9, heading=math.radians(37.5))
    readings = predicted_readings(SIMPLE, true, replace(PAPER, range_offset=-0.02), 6.0)
    believed = replace(FIGURE_9, position=(FIGURE_9.position[0] + 0.02, FIGURE_9.position[1] - 0.01))
    shares: list[float] = []
    free = frozenset({"heading", "offset", "position"})
    fit = fit_scan(readings, SIMPLE, believed, PAPER, free, tick=shares.append)
    assert math.degrees(fit.heading) == pytest.approx(37.5, abs=0.5 + 1e-9)
    assert fit.offset == pytest.approx(0.02, abs=0.005)
    assert fit.place.position == pytest.approx(FIGURE_9.position, abs=1e-9)
    assert (shares, shares[0], shares[-1], len(shares) > 20) == (sorted(shares), 0.0, 1.0, True)
    only = fit_scan(readings, SIMPLE, FIGURE_9, PAPER, frozenset({"heading"}))
    assert (only.offset, only.place.position) == (0.0, FIGURE_9.position)
    with pytest.raises(InputError, match="wind"):
        fit_scan(readings, SIMPLE, FIGURE_9, PAPER, frozenset({"wind"}))


def heard_by_a_wide_beam(
    size: tuple[float, float], position: tuple[float, float], degrees: FloatArray, heading: float
) -> FloatArray:
    """Return ranges (m, whole centimetres, NaN beyond 4 m) of a sensor in a rectangle, as no part of the model does.

    It hears a wall up to 25° beside its normal and a corner up to 20° beside it, the nearest first.
    """
    (x, y), (width, depth) = position, size
    corners = [(a, b) for a in (0.0, width) for b in (0.0, depth)]
    echoes = [(width - x, 0.0, 25.0), (depth - y, 90.0, 25.0), (x, 180.0, 25.0), (y, 270.0, 25.0)]
    echoes += [(math.hypot(a - x, b - y), math.degrees(math.atan2(b - y, a - x)), 20.0) for a, b in corners]
    ranges = []
    for angle in degrees + heading:
        near = [one for one, bearing, aside in echoes if abs(math.remainder(angle - bearing, 360)) <= aside]
        ranges.append(round(min(near), 2) if near and min(near) <= 4.0 else math.nan)
    return np.array(ranges)


# as many echoes are explained over 10 to 20 degrees; the most of them near an end
@pytest.mark.parametrize(
    ("size", "position", "degrees", "heading"),
    [
        ((3.2, 2.4), (1.6, 0.3), np.arange(15.0, 166.0), 7.0),
        ((3.0, 2.5), (2.7, 1.2), np.arange(10.0, 171.0, 2.0), 96.0),
        ((5.0, 3.5), (2.0, 3.2), np.arange(0.0, 181.0, 2.0), 172.0),
        ((4.0, 3.0), (0.4, 1.5), np.arange(0.0, 181.0, 2.0), -95.0),
    ],
)
def test_of_headings_that_explain_as_many_echoes_the_likely_one_is_chosen(
    size: tuple[float, float], position: tuple[float, float], degrees: FloatArray, heading: float
) -> None:
    width, depth = size
    room = polygon_room([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
    readings = readings_of(np.radians(degrees), heard_by_a_wide_beam(size, position, degrees, heading))
    board, here = load_board("hc-sr04"), Place("", position)
    for free in ({"heading"}, {"heading", "offset", "position"}):
        fit = likely_fit(readings, room, here, board, frozenset(free))
        assert math.degrees(math.remainder(fit.heading - math.radians(heading), math.tau)) == pytest.approx(0, abs=1.25)
        ((begin, end),) = fit.spans_deg
        assert begin - 1 <= heading <= end + 1
        assert f"with step 0 at {begin:.1f}° to {end:.1f}°" in "".join(fit.lines())
    # a model without a likelihood takes the middle
    cone = likely_fit(readings, room, here, board, frozenset({"heading"}), model=Model.CONE)
    assert min(abs(cone.heading - (begin + end) / 2) for begin, end in cone.spans) < 1e-9


@pytest.mark.parametrize(
    ("word", "bounds"),
    [
        ("x", (-1.0, 2.0)),
        ("y", (0.0, 4.0)),
        ("heading", (-math.inf, math.inf)),
        ("temperature", (-10.0, 45.0)),
        ("speed", (Air(-10.0).speed_of_sound, Air(45.0).speed_of_sound)),
        ("threshold", (BOARD.threshold_db - 20.0, min(0.0, BOARD.threshold_db + 20.0))),
        ("aperture", (BOARD.aperture_radius / 2.5, BOARD.aperture_radius * 2.5)),
        ("ahead", (0.05 - 0.06, 0.05 + 0.06)),
        ("aside", (-0.01 - 0.06, -0.01 + 0.06)),
        ("offset", (-0.06, 0.06)),
        ("reflectance:m0", (0.2, 1.0)),
        ("wall:w1", (-0.1, 0.1)),
    ],
)
def test_bounds_are_those_of_the_room_and_the_board(word: str, bounds: tuple[float, float]) -> None:
    (found,) = free_parameters([word], [""], ROOM, BOARD)
    assert (found.lower, found.upper) == pytest.approx(bounds)
    # no threshold is over the echo of a perfect wall
    (loud,) = free_parameters(["threshold"], [""], ROOM, replace(BOARD, threshold_db=-12.0))
    assert (loud.lower, loud.upper) == (-32.0, 0.0)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (2.0, 0.5), (1.5, 2.0), (-0.3, 1.6)])
def test_derivatives_of_corners_are_those_of_finite_differences(corner: tuple[float, float]) -> None:
    room = polygon_room([(0.0, 0.0), (2.0, 0.5), (1.5, 2.0), (-0.3, 1.6)])
    columns = {0: 0, 1: 1, 3: 2}  # the third wall is fixed
    (row,) = np.flatnonzero((room.walls[:, :2] == corner).all(axis=1))
    found = corner_moves(room, np.array(corner), columns)
    for wall, column in columns.items():
        moved = with_shifted_walls(room, {room.names[wall]: 1e-6}).walls[row, :2]
        assert found[:, column] == pytest.approx((moved - corner) / 1e-6, abs=1e-5)
