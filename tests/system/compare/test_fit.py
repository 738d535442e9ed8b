"""Fits of scans with known truth: they find it, say how sure they are, and say what they cannot tell."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import FitOptions, FitResult, Parameter, PlacedScan, fit_scans, free_parameters
from sonarhw_compare.fit.values.free_walls import with_shifted_walls
from sonarhw_sim.board.mount import Mount
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.choices import Receiver, Unit
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.model import Place, Room, load_room

from benchmarks.cases.synthetic_scan import ERRORS, synthetic_scan
from benchmarks.fit import board_of
from sonarhw.errors import Cancelled, InputError
from sonarhw.readings import Reading, Trace
from tests.fixtures.rooms_for_tests import polygon_room

ARENA = load_room("rooms/arena.toml")
BOARD = board_of(ARENA)
TRUTH = Place("truth", (1.3, 0.55), 2.0)
NOWHERE = Place("nowhere", (1.0, 0.5))
QUICKLY = FitOptions(samples=600)


def fitted(
    readings: list[Reading], *free: str, room: Room = ARENA, start: Place = NOWHERE, options: FitOptions = QUICKLY
) -> FitResult:
    parameters = free_parameters(free, ["scan"], room, BOARD)
    return fit_scans([PlacedScan(readings, start)], room, BOARD, parameters, options=options)


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


def test_a_room_that_explains_few_of_the_echoes_is_doubted(readings: list[Reading]) -> None:
    square = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    result = fitted(readings, "position", "heading", room=square, options=FitOptions(samples=0))
    assert "check the room and the board" in result.warnings[0]


def test_how_readings_err_is_found_along_the_way(pose: FitResult) -> None:
    range_error = ERRORS.timing * ARENA.air.speed_of_sound / 2
    assert pose.noise["range_m"] == pytest.approx(range_error, rel=0.3)
    assert pose.noise["lost"] < 0.12


def test_same_seed_same_result(readings: list[Reading]) -> None:
    options = FitOptions(samples=100, seed=5, global_search=False)
    one, other = (fitted(readings, "position", start=TRUTH, options=options) for _ in range(2))
    assert np.array_equal(one.samples, other.samples)
    assert not np.array_equal(
        one.samples, fitted(readings, "position", start=TRUTH, options=replace(options, seed=6)).samples
    )


def test_without_samples_curvature_states_about_the_same_deviations(pose: FitResult, readings: list[Reading]) -> None:
    quick = fitted(readings, "position", "heading", start=TRUTH, options=FitOptions(samples=0, global_search=False))
    for name in ("x", "y"):
        assert quick.estimates[name].deviation == pytest.approx(pose.estimates[name].deviation, rel=0.5)
        assert abs(quick.estimates[name].value - pose.estimates[name].value) < 3 * pose.estimates[name].deviation


def test_in_a_symmetric_room_both_answers_are_told() -> None:
    room = load_room("rooms/simple.toml")
    board = board_of(room)
    place = Place("", (0.6, 0.35), 0.7)
    scan = PlacedScan(synthetic_scan(room, place, board, 2), place)
    free = free_parameters(("position", "heading"), [""], room, board)
    result = fit_scans([scan], room, board, free, options=FitOptions(samples=0))
    assert len(result.modes) == 2
    assert "symmetric" in result.warnings[0]
    mirrored = {(round(mode.values["x"], 2), round(mode.values["y"], 2)) for mode in result.modes}
    # turned by half a circle about the middle of 0.928 by 0.742 m
    assert mirrored == {(0.6, 0.35), (0.33, 0.39)}


def test_what_the_scan_does_not_tell_is_warned_of() -> None:
    # with echoes from within 0.6 m only, nothing is known of a wall 1.1 m away
    deaf = replace(BOARD, max_range=0.6)
    scan = synthetic_scan(ARENA, TRUTH, deaf, 6, readings=40)
    free = free_parameters(("wall:north-west",), [""], ARENA, deaf)
    result = fit_scans([PlacedScan(scan, TRUTH)], ARENA, deaf, free, options=QUICKLY)
    assert any("hardly constrains wall:north-west" in warning for warning in result.warnings)


def near_the_truth(*free: str) -> list[Parameter]:
    """Those parameters, positions within 5 cm of the truth."""
    at = dict(zip("xy", TRUTH.position, strict=True))
    return [
        replace(one, lower=at[one.name] - 0.05, upper=at[one.name] + 0.05) if one.name in at else one
        for one in free_parameters(free, [""], ARENA, BOARD)
    ]


def test_a_turning_axis_is_found_with_the_pose() -> None:
    real = replace(BOARD, mount=Mount(ahead=0.023, aside=-0.01))
    scan = synthetic_scan(ARENA, TRUTH, real, 3, readings=60)
    free = near_the_truth("position", "heading", "axis")
    result = fit_scans([PlacedScan(scan, TRUTH)], ARENA, BOARD, free, options=QUICKLY)
    assert math.dist(result.places[0].position, TRUTH.position) < 0.002
    assert result.board.mount.ahead == pytest.approx(0.023, abs=0.001)
    assert result.board.mount.aside == pytest.approx(-0.01, abs=0.006)


def test_an_offset_is_what_is_added_to_measured_ranges(readings: list[Reading]) -> None:
    short = [
        replace(one, echo_times=tuple(time - 0.024 / one.speed_of_sound for time in one.echo_times)) for one in readings
    ]
    free = near_the_truth("position", "heading", "offset")
    result = fit_scans([PlacedScan(short, TRUTH)], ARENA, BOARD, free, options=FitOptions(samples=0))
    assert result.estimates["offset"].value == pytest.approx(0.012, abs=0.001)
    assert result.board.range_offset == pytest.approx(-0.012, abs=0.001)


def test_what_is_only_known_together_is_told_so(readings: list[Reading]) -> None:
    # a face ahead of the axis and ranges told too short differ only where sound meets walls aslant
    free = free_parameters(("ahead", "offset"), [""], ARENA, BOARD)
    result = fit_scans([PlacedScan(readings, TRUTH)], ARENA, BOARD, free, options=QUICKLY)
    assert any("only known together" in warning for warning in result.warnings)
    assert result.estimates["offset"].deviation > 0.001
    for name in ("ahead", "offset"):
        assert abs(result.estimates[name].value) < 4 * result.estimates[name].deviation


def test_deviations_along_a_ridge_without_an_end_are_not_to_be_trusted() -> None:
    # a square room all of whose walls may move: moved with the sensor, they sound the same
    room = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    at = Place("", (0.7, 0.9))
    scan = PlacedScan(synthetic_scan(room, at, BOARD, 7, 60), at)
    options = replace(QUICKLY, global_search=False)
    free = {
        word: fit_scans([scan], room, BOARD, free_parameters((word,), [""], room, BOARD), options=options).warnings
        for word in ("position", "walls")
    }
    assert not free["position"]
    freed = free_parameters(("position", "walls"), [""], room, BOARD)
    warnings = fit_scans([scan], room, BOARD, freed, options=options).warnings
    (told,) = (warning for warning in warnings if "cannot be trusted" in warning)
    assert {"x", "y"} & set(told.replace(",", "").split())
    assert not any("cannot be trusted" in warning for warning in free["walls"])
    # drawn for long enough the ± are those of the bounds: uniform from -10 to 10 cm
    drawn = fit_scans([scan], room, BOARD, freed, options=replace(options, samples=4000))
    assert not any("cannot be trusted" in warning for warning in drawn.warnings)
    for estimate in drawn.estimates.values():
        assert estimate.deviation == pytest.approx(0.1 / math.sqrt(3), rel=0.15)


LEGO = load_board("lego-nxt")  # tells whole centimetres


def lego_scan(place: Place, count: int) -> PlacedScan:
    """What a Lego NXT in the arena is predicted to tell, as if it had been measured."""
    angles, speed = np.arange(count) * math.tau / count, ARENA.air.speed_of_sound
    ranges = predict_scan(ARENA, place, LEGO, angles + place.heading).ranges
    readings = [
        Reading(k, 0, 0, float(angle), 0.1 * k, () if math.isnan(told) else (2 * told / speed,), speed)
        for k, (angle, told) in enumerate(zip(angles, ranges, strict=True))
    ]
    return PlacedScan(readings, place)


def test_readings_rounded_alike_are_no_more_evidence_the_more_of_them_there_are() -> None:
    def deviation(count: int) -> float:
        free = free_parameters(("position",), [""], ARENA, LEGO)
        options = FitOptions(samples=0, global_search=False)
        return fit_scans([lego_scan(TRUTH, count)], ARENA, LEGO, free, options=options).estimates["x"].deviation

    # independent errors would be halved
    assert deviation(288) > 0.7 * deviation(72)


def test_readings_rounded_alike_do_not_tell_one_answer_from_another_by_their_number() -> None:
    # from p1 and from 1.38, 1.80 m a quarter turn on, the arena sounds nearly the same
    free = free_parameters(("position", "heading"), [""], ARENA, LEGO)
    result = fit_scans([lego_scan(ARENA.place("p1"), 120)], ARENA, LEGO, free, options=FitOptions(samples=0))
    x, y = result.places[0].position
    assert math.dist((x, y), ARENA.place("p1").position) < 0.01
    assert [(round(mode.values["x"], 2), round(mode.values["y"], 2)) for mode in result.modes[1:]] == [(1.38, 1.8)]
    assert "2 solutions explain the scan about equally well" in result.warnings[0]


def test_a_thermometer_that_errs_makes_no_offset() -> None:
    # one kelvin is 0.17 %: millimetres on the longest ranges, which would be taken for an offset
    scan = synthetic_scan(ARENA, TRUTH, BOARD, 8, warmer=1.0)
    free = near_the_truth("position", "heading", "offset")
    result = fit_scans([PlacedScan(scan, TRUTH)], ARENA, BOARD, free, options=FitOptions(samples=0))
    told = replace(ARENA.air, temperature_c=ARENA.air.temperature_c + 1.0).speed_of_sound / ARENA.air.speed_of_sound
    assert result.noise["stretch"] == pytest.approx(told, abs=6e-4)
    for name, true in (("x", TRUTH.position[0]), ("y", TRUTH.position[1]), ("offset", 0.0)):
        estimate = result.estimates[name]
        assert abs(estimate.value - true) < 4 * estimate.deviation


@pytest.mark.parametrize("free", ["temperature", "speed"])
def test_warm_air_is_told_from_echo_times(free: str) -> None:
    warm = replace(ARENA, air=replace(ARENA.air, temperature_c=27.0))
    told = [replace(one, speed_of_sound=325.0) for one in synthetic_scan(warm, TRUTH, BOARD, 4)]
    result = fitted(told, "position", free, start=TRUTH, options=replace(QUICKLY, global_search=False))
    assert result.room.air.temperature_c == pytest.approx(27.0, abs=0.3)
    # though the ranges that were told are 7 % too short
    assert result.agreement[0].within_5cm is not None
    assert result.agreement[0].within_5cm > 0.9


def test_walls_are_found_from_two_places_at_once() -> None:
    moved = {"divider": 0.02, "east": -0.013}
    real = with_shifted_walls(ARENA, moved)
    places = [Place("", (1.53, 0.24), 2.4), Place("", (1.08, 0.9), 3.6)]
    scans = [PlacedScan(synthetic_scan(real, one, BOARD, k, 60), one, f"s{k}") for k, one in enumerate(places)]
    free = free_parameters([f"wall:{name}" for name in moved], ["s0", "s1"], ARENA, BOARD)
    result = fit_scans(scans, ARENA, BOARD, free, options=FitOptions(samples=400))
    for name, by in moved.items():
        assert result.estimates[f"wall:{name}"].value == pytest.approx(by, abs=0.001)
    assert np.abs(result.room.walls - real.walls).max() < 0.001


def test_reflectance_is_found_to_two_hundredths() -> None:
    real = replace(ARENA, reflectances=np.full(len(ARENA.names), 0.8))
    scan = synthetic_scan(real, TRUTH, BOARD, 5, echoes=5)
    result = fitted(scan, "reflectance", start=TRUTH, options=FitOptions(samples=300))
    assert result.estimates["reflectance:board"].value == pytest.approx(0.8, abs=0.02)


def test_progress_grows_to_the_end_and_a_cancelled_fit_has_no_result(readings: list[Reading]) -> None:
    shares: list[float] = []
    free = free_parameters(("heading",), [""], ARENA, BOARD)
    scan = PlacedScan(readings, TRUTH)
    options = FitOptions(samples=50)
    fit_scans([scan], ARENA, BOARD, free, options=options, progress=lambda share, _: shares.append(share))
    assert shares == sorted(shares)
    assert shares[-1] == 1.0
    with pytest.raises(Cancelled):
        fit_scans([scan], ARENA, BOARD, free, options=options, cancelled=lambda: True)


def test_what_cannot_be_fitted_is_refused(readings: list[Reading]) -> None:
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


def test_one_recording_given_twice_is_refused_though_it_has_traces(readings: list[Reading]) -> None:
    def read_anew() -> PlacedScan:
        return PlacedScan([replace(one, trace=Trace(np.zeros(3), 1e5, 0.0)) for one in readings], TRUTH)

    free = free_parameters(("position",), ["one", "other"], ARENA, BOARD)
    with pytest.raises(InputError, match="one recording given twice"):
        fit_scans([read_anew(), read_anew()], ARENA, BOARD, free)


def test_the_boards_own_receiver_is_fitted_with_its_own_lateness() -> None:
    board = load_board("polaroid-6500")
    options = PredictionOptions(receiver=Receiver.BOARD)
    angles = np.arange(72) * math.tau / 72
    ranges = predict_scan(ARENA, TRUTH, board, angles + TRUTH.heading, options).ranges
    speed = ARENA.air.speed_of_sound
    scan = [
        Reading(k, 0, 0, float(angle), 0.1 * k, () if math.isnan(told) else (2 * told / speed,), speed)
        for k, (angle, told) in enumerate(zip(angles, ranges, strict=True))
    ]
    free = free_parameters(("position", "heading"), [""], ARENA, board)
    found = {
        receiver: fit_scans(
            [PlacedScan(scan, TRUTH)],
            ARENA,
            board,
            free,
            options=FitOptions(PredictionOptions(receiver=receiver), samples=0, global_search=False),
        )
        for receiver in Receiver
    }
    assert math.dist(found[Receiver.BOARD].places[0].position, TRUTH.position) < 0.002
    assert any("± is too small for heading" in warning for warning in found[Receiver.BOARD].warnings)
    assert not any("± is too small" in warning for warning in found[Receiver.FIRST_ECHO].warnings)
    # the paper's receiver has no name for 45 mm between a loud and a faint echo
    assert found[Receiver.BOARD].noise["range_m"] < 0.3 * found[Receiver.FIRST_ECHO].noise["range_m"]


def test_a_heading_known_beforehand_is_told_from_its_turn_by_a_circle(readings: list[Reading]) -> None:
    (heading,) = free_parameters(("heading",), [""], ARENA, BOARD)
    known = replace(heading, expected=TRUTH.heading - math.tau, deviation=1.0)
    result = fit_scans([PlacedScan(readings, TRUTH)], ARENA, BOARD, [known], options=FitOptions(samples=0))
    # told between 0 and 360° all the same
    assert result.estimates["heading"].value == pytest.approx(TRUTH.heading, abs=math.radians(0.3))
