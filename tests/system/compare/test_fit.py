"""Fits of scans with known truth: values, uncertainties and warnings."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import (
    FitOptions,
    FitResult,
    Parameter,
    PlacedScan,
    fit_scans,
    free_parameters,
)
from sonarhw_compare.fit.free_walls import with_shifted_walls
from sonarhw_compare.fit.objective import Problem
from sonarhw_sim.air import Receiver, Unit
from sonarhw_sim.board.profile import Board, Mount, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from benchmarks.cases.synthetic_scan import ERRORS, synthetic_scan
from benchmarks.fit import board_of
from sonarhw.errors import InputError
from sonarhw.readings import Reading, Trace
from tests.fixtures.rooms_for_tests import polygon_room

ARENA = load_room("rooms/arena.toml")
BOARD = load_board("hc-sr04")  # hears only loud echoes, so a fit of its scans is quick
SENSITIVE = board_of(ARENA)
TRUTH = Place("truth", (1.3, 0.55), 2.0)
NOWHERE = Place("nowhere", (1.0, 0.5))
QUICKLY = FitOptions(samples=600, exact=True)
VALUES_ONLY = FitOptions(samples=0, exact=True)


def fitted(
    readings: list[Reading],
    *free: str,
    room: Room = ARENA,
    board: Board = BOARD,
    start: Place = NOWHERE,
    options: FitOptions = QUICKLY,
) -> FitResult:
    parameters = free_parameters(free, ["scan"], room, board)
    return fit_scans([PlacedScan(readings, start)], room, board, parameters, options=options)


@pytest.fixture(scope="module")
def readings() -> list[Reading]:
    return synthetic_scan(ARENA, TRUTH, BOARD, seed=1)


@pytest.fixture(scope="module")
def pose(readings: list[Reading]) -> FitResult:
    return fitted(readings, "position", "heading")


def test_a_pose_is_found_in_the_whole_room(pose: FitResult) -> None:
    x, y = pose.places[0].position
    assert math.dist((x, y), TRUTH.position) < 0.002
    assert abs(math.remainder(pose.places[0].heading - TRUTH.heading, math.tau)) < math.radians(0.25)
    assert pose.warnings == ()
    assert pose.agreement[0].within_5cm is not None
    assert pose.agreement[0].within_5cm > 0.9


def test_a_heading_around_zero_has_its_interval_around_it() -> None:
    place = replace(TRUTH, heading=math.radians(-0.02))
    scan = synthetic_scan(ARENA, place, BOARD, seed=1)
    options = replace(QUICKLY, global_search=False)
    for given in (0.0, math.tau):
        result = fitted(scan, "position", "heading", start=replace(TRUTH, heading=given), options=options)
        heading = result.estimates["heading"]
        assert heading.lower < heading.value < heading.upper
        assert heading.value == pytest.approx(given + place.heading, abs=math.radians(0.5))
        assert result.places[0].heading == heading.value
        assert result.modes[0].values["heading"] == pytest.approx(heading.value, abs=math.radians(0.5))
        assert np.median(result.samples[:, 2]) == pytest.approx(heading.value)


def test_a_room_that_explains_few_echoes_gives_a_warning(readings: list[Reading]) -> None:
    square = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    result = fitted(readings, "position", "heading", room=square, options=VALUES_ONLY)
    assert result.warnings[0].kind == "few explained"


def test_noise_of_readings_is_fitted(pose: FitResult) -> None:
    range_error = ERRORS.timing * ARENA.air.speed_of_sound / 2
    assert pose.noise["range_m"] == pytest.approx(range_error, rel=0.3)
    assert pose.noise["lost"] < 0.12


def test_the_same_seed_gives_the_same_result(readings: list[Reading]) -> None:
    options = FitOptions(samples=100, seed=5, global_search=False, exact=True)
    one, other = (fitted(readings, "position", start=TRUTH, options=options) for _ in range(2))
    assert np.array_equal(one.samples, other.samples)
    assert not np.array_equal(
        one.samples, fitted(readings, "position", start=TRUTH, options=replace(options, seed=6)).samples
    )


def test_deviations_from_curvature_are_similar_to_those_from_samples(pose: FitResult, readings: list[Reading]) -> None:
    quick = fitted(
        readings, "position", "heading", start=TRUTH, options=FitOptions(samples=0, global_search=False, exact=True)
    )
    for name in ("x", "y"):
        assert quick.estimates[name].deviation == pytest.approx(pose.estimates[name].deviation, rel=0.5)
        assert abs(quick.estimates[name].value - pose.estimates[name].value) < 3 * pose.estimates[name].deviation


def test_in_a_symmetric_room_both_solutions_are_reported() -> None:
    room = load_room("rooms/simple.toml")
    board = board_of(room)
    place = Place("", (0.6, 0.35), 0.7)
    scan = PlacedScan(synthetic_scan(room, place, board, 2), place)
    free = free_parameters(("position", "heading"), [""], room, board)
    result = fit_scans([scan], room, board, free, options=VALUES_ONLY)
    assert len(result.modes) == 2
    assert result.warnings[0].kind == "several solutions"
    mirrored = {(round(mode.values["x"], 2), round(mode.values["y"], 2)) for mode in result.modes}
    # rotated by 180° about the middle of 0.928 by 0.742 m
    assert mirrored == {(0.6, 0.35), (0.33, 0.39)}


def test_an_unconstrained_parameter_gives_a_warning() -> None:
    # echoes within 0.6 m do not depend on a wall 1.1 m away
    short_range = replace(BOARD, max_range=0.6)
    scan = synthetic_scan(ARENA, TRUTH, short_range, 6, readings=40)
    free = free_parameters(("wall:north-west",), [""], ARENA, short_range)
    result = fit_scans([PlacedScan(scan, TRUTH)], ARENA, short_range, free, options=QUICKLY)
    (warning,) = (warning for warning in result.warnings if warning.kind == "unconstrained")
    assert "wall:north-west" in str(warning)


def near_the_truth(*free: str) -> list[Parameter]:
    """Return these parameters, with positions bounded to 5 cm around the truth."""
    at = dict(zip("xy", TRUTH.position, strict=True))
    return [
        replace(one, lower=at[one.name] - 0.05, upper=at[one.name] + 0.05) if one.name in at else one
        for one in free_parameters(free, [""], ARENA, BOARD)
    ]


def test_an_offset_of_the_transducer_from_the_axis_is_found_with_the_pose() -> None:
    real = replace(BOARD, mount=Mount(ahead=0.023, aside=-0.01))
    scan = synthetic_scan(ARENA, TRUTH, real, 3, readings=60)
    free = near_the_truth("position", "heading", "axis")
    result = fit_scans([PlacedScan(scan, TRUTH)], ARENA, BOARD, free, options=VALUES_ONLY)
    assert math.dist(result.places[0].position, TRUTH.position) < 0.002
    assert result.board.mount.ahead == pytest.approx(0.023, abs=0.001)
    assert result.board.mount.aside == pytest.approx(-0.01, abs=0.006)


def test_the_offset_is_added_to_measured_ranges(readings: list[Reading]) -> None:
    short = [
        replace(one, echo_times=tuple(time - 0.024 / one.speed_of_sound for time in one.echo_times)) for one in readings
    ]
    free = near_the_truth("position", "heading", "offset")
    result = fit_scans([PlacedScan(short, TRUTH)], ARENA, BOARD, free, options=VALUES_ONLY)
    assert result.estimates["offset"].value == pytest.approx(0.012, abs=0.001)
    assert result.board.range_offset == pytest.approx(-0.012, abs=0.001)


def test_strongly_correlated_parameters_give_a_warning(readings: list[Reading]) -> None:
    # a transducer ahead of the axis and ranges that are too short differ only at oblique incidence
    free = free_parameters(("ahead", "offset"), [""], ARENA, BOARD)
    result = fit_scans([PlacedScan(readings, TRUTH)], ARENA, BOARD, free, options=QUICKLY)
    assert any(warning.kind == "known together" for warning in result.warnings)
    assert result.estimates["offset"].deviation > 0.001
    for name in ("ahead", "offset"):
        assert abs(result.estimates[name].value) < 4 * result.estimates[name].deviation


def test_deviations_along_a_long_ridge_follow_from_its_bounds() -> None:
    # a square room with movable walls: walls that move with the sensor give the same echoes
    room = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    at = Place("", (0.7, 0.9))
    scan = PlacedScan(synthetic_scan(room, at, SENSITIVE, 7, 60), at)
    options = replace(QUICKLY, global_search=False, samples=4000)
    alone = fit_scans([scan], room, SENSITIVE, free_parameters(("position",), [""], room, SENSITIVE), options=options)
    assert not alone.warnings
    freed = free_parameters(("position", "walls"), [""], room, SENSITIVE)
    drawn = fit_scans([scan], room, SENSITIVE, freed, options=options)
    assert not any(warning.kind == "underestimated" for warning in drawn.warnings)
    # walls have bounds at ± 10 cm, and are uniform between them
    for estimate in drawn.estimates.values():
        assert estimate.deviation == pytest.approx(0.1 / math.sqrt(3), rel=0.15)
    assert max(estimate.deviation for estimate in alone.estimates.values()) < 0.01


LEGO = load_board("lego-nxt")  # reports whole centimetres


def lego_scan(place: Place, count: int) -> PlacedScan:
    """Return the predicted scan of a Lego NXT in the arena, as a measured one."""
    angles, speed = np.arange(count) * math.tau / count, ARENA.air.speed_of_sound
    ranges = predict_scan(ARENA, place, LEGO, angles + place.heading).ranges
    readings = [
        Reading(k, 0, 0, float(angle), 0.1 * k, () if math.isnan(distance) else (2 * distance / speed,), speed)
        for k, (angle, distance) in enumerate(zip(angles, ranges, strict=True))
    ]
    return PlacedScan(readings, place)


def test_more_readings_with_equal_rounding_add_little_evidence() -> None:
    def deviation(count: int) -> float:
        free = free_parameters(("position",), [""], ARENA, LEGO)
        options = FitOptions(samples=0, global_search=False)
        return fit_scans([lego_scan(TRUTH, count)], ARENA, LEGO, free, options=options).estimates["x"].deviation

    # independent errors would be halved
    assert deviation(288) > 0.7 * deviation(72)


def test_readings_with_equal_rounding_do_not_exclude_a_similar_solution() -> None:
    # the arena has nearly the same echoes at p1 and, rotated by 90°, at 1.38, 1.80 m
    free = free_parameters(("position", "heading"), [""], ARENA, LEGO)
    result = fit_scans([lego_scan(ARENA.place("p1"), 120)], ARENA, LEGO, free, options=VALUES_ONLY)
    x, y = result.places[0].position
    assert math.dist((x, y), ARENA.place("p1").position) < 0.01
    assert [(round(mode.values["x"], 2), round(mode.values["y"], 2)) for mode in result.modes[1:]] == [(1.38, 1.8)]
    assert result.warnings[0].kind == "several solutions"
    assert str(result.warnings[0]).startswith("2 solutions")


def test_a_wrong_thermometer_does_not_change_the_offset() -> None:
    # one kelvin is 0.17 %: millimetres at the longest ranges, which could be mistaken for an offset
    scan = synthetic_scan(ARENA, TRUTH, BOARD, 8, warmer=1.0)
    free = near_the_truth("position", "heading", "offset")
    result = fit_scans([PlacedScan(scan, TRUTH)], ARENA, BOARD, free, options=VALUES_ONLY)
    stretch = replace(ARENA.air, temperature_c=ARENA.air.temperature_c + 1.0).speed_of_sound / ARENA.air.speed_of_sound
    assert result.noise["stretch"] == pytest.approx(stretch, abs=6e-4)
    for name, true in (("x", TRUTH.position[0]), ("y", TRUTH.position[1]), ("offset", 0.0)):
        estimate = result.estimates[name]
        assert abs(estimate.value - true) < 4 * estimate.deviation


@pytest.mark.parametrize("free", ["temperature", "speed"])
def test_the_temperature_is_found_from_echo_times(free: str) -> None:
    warm = replace(ARENA, air=replace(ARENA.air, temperature_c=27.0))
    scan = [replace(one, speed_of_sound=325.0) for one in synthetic_scan(warm, TRUTH, BOARD, 4)]
    result = fitted(scan, "position", free, start=TRUTH, options=replace(VALUES_ONLY, global_search=False))
    assert result.room.air.temperature_c == pytest.approx(27.0, abs=0.3)
    # although the reported ranges are 7 % too short
    assert result.agreement[0].within_5cm is not None
    assert result.agreement[0].within_5cm > 0.9


def test_walls_are_found_from_two_places() -> None:
    moved = {"divider": 0.02, "east": -0.013}
    real = with_shifted_walls(ARENA, moved)
    places = [Place("", (1.53, 0.24), 2.4), Place("", (1.08, 0.9), 3.6)]
    scans = [PlacedScan(synthetic_scan(real, one, BOARD, k, 60), one, f"s{k}") for k, one in enumerate(places)]
    free = free_parameters([f"wall:{name}" for name in moved], ["s0", "s1"], ARENA, BOARD)
    result = fit_scans(scans, ARENA, BOARD, free, options=VALUES_ONLY)
    for name, by in moved.items():
        assert result.estimates[f"wall:{name}"].value == pytest.approx(by, abs=0.001)
    assert np.abs(result.room.walls - real.walls).max() < 0.001


def test_reflectance_is_found_to_a_hundredth() -> None:
    # with each path weighed alone, and not together with its reverse, it would be 0.82
    assert SENSITIVE.sum_arrivals
    real = replace(ARENA, reflectances=np.full(len(ARENA.names), 0.8))
    scan = synthetic_scan(real, TRUTH, SENSITIVE, 5, echoes=5)
    result = fitted(
        scan, "reflectance", board=SENSITIVE, start=TRUTH, options=replace(VALUES_ONLY, global_search=False)
    )
    assert result.estimates["reflectance:board"].value == pytest.approx(0.8, abs=0.01)


def test_progress_grows_to_one(readings: list[Reading]) -> None:
    shares: list[float] = []
    free = free_parameters(("heading",), [""], ARENA, BOARD)
    scan = PlacedScan(readings, TRUTH)
    options = FitOptions(samples=50, exact=True)
    fit_scans([scan], ARENA, BOARD, free, options=options, progress=lambda share, _: shares.append(share))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_impossible_fits_are_rejected(readings: list[Reading]) -> None:
    scan = PlacedScan(readings, TRUTH, "here")
    free = free_parameters(("heading",), [""], ARENA, BOARD)
    silent = PlacedScan([replace(one, echo_times=()) for one in readings], TRUTH, "here")
    with pytest.raises(InputError, match="nothing is free"):
        fit_scans([scan], ARENA, BOARD, ())
    with pytest.raises(InputError, match="no reading of here has an echo"):
        fit_scans([silent], ARENA, BOARD, free)
    with pytest.raises(InputError, match="unit pass"):
        fit_scans([scan], ARENA, BOARD, free, options=FitOptions(PredictionOptions(unit=Unit.BLOCK)))
    for word, complaint in (("wind", "expected some of x, y"), ("wall:roof", "has west"), ("x:1", "write x")):
        with pytest.raises(InputError, match=complaint):
            free_parameters((word,), [""], ARENA, BOARD)
    with pytest.raises(InputError, match="each determines the other"):
        free_parameters(("temperature", "speed"), [""], ARENA, BOARD)


def test_one_recording_given_twice_is_rejected_even_with_traces(readings: list[Reading]) -> None:
    def read_anew() -> PlacedScan:
        return PlacedScan([replace(one, trace=Trace(np.zeros(3), 1e5, 0.0)) for one in readings], TRUTH)

    free = free_parameters(("position",), ["one", "other"], ARENA, BOARD)
    with pytest.raises(InputError, match="contain the same readings; give each log once"):
        fit_scans([read_anew(), read_anew()], ARENA, BOARD, free)


def test_a_fit_models_the_late_detection_of_the_boards_own_receiver() -> None:
    board = load_board("polaroid-6500")
    options = PredictionOptions(receiver=Receiver.BOARD)
    angles = np.arange(72) * math.tau / 72
    ranges = predict_scan(ARENA, TRUTH, board, angles + TRUTH.heading, options).ranges
    speed = ARENA.air.speed_of_sound
    scan = [
        Reading(k, 0, 0, float(angle), 0.1 * k, () if math.isnan(distance) else (2 * distance / speed,), speed)
        for k, (angle, distance) in enumerate(zip(angles, ranges, strict=True))
    ]
    free = free_parameters(("position", "heading"), [""], ARENA, board)
    found = {
        receiver: fit_scans(
            [PlacedScan(scan, TRUTH)],
            ARENA,
            board,
            free,
            options=FitOptions(PredictionOptions(receiver=receiver), samples=0, global_search=False, exact=True),
        )
        for receiver in Receiver
    }
    assert math.dist(found[Receiver.BOARD].places[0].position, TRUTH.position) < 0.002
    # the paper's receiver does not model 45 mm between a loud and a faint echo
    assert found[Receiver.BOARD].noise["range_m"] < 0.3 * found[Receiver.FIRST_ECHO].noise["range_m"]


@pytest.mark.parametrize("samples", [0, 200])
def test_intervals_of_the_heading_are_wider_with_the_boards_own_receiver(
    monkeypatch: pytest.MonkeyPatch, readings: list[Reading], samples: int
) -> None:
    board = replace(BOARD, receiver=Receiver.BOARD)
    free, options = (
        free_parameters(("position", "heading"), [""], ARENA, board),
        FitOptions(samples=samples, global_search=False, exact=True),
    )

    def deviations() -> list[float]:
        found = fit_scans([PlacedScan(readings, TRUTH)], ARENA, board, free, options=options)
        return [found.estimates[name].deviation for name in ("x", "y", "heading")]

    stated = deviations()
    monkeypatch.setattr(Problem, "widenings", property(lambda problem: np.ones(problem.size)))
    assert stated == pytest.approx(np.array([1.0, 1.0, 1.5]) * deviations())


def test_a_prior_of_a_heading_may_differ_by_a_whole_turn(readings: list[Reading]) -> None:
    (heading,) = free_parameters(("heading",), [""], ARENA, BOARD)
    known = replace(heading, expected=TRUTH.heading - math.tau, deviation=1.0)
    result = fit_scans([PlacedScan(readings, TRUTH)], ARENA, BOARD, [known], options=VALUES_ONLY)
    # still reported near the heading of the given place
    assert result.estimates["heading"].value == pytest.approx(TRUTH.heading, abs=math.radians(0.3))
