"""Fits of scans with known truth: values, uncertainties and warnings."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import FitOptions, FitResult, Parameter, PlacedScan, fit_scans, fitting, free_parameters
from sonarhw_compare.fit.free_walls import with_shifted_walls
from sonarhw_compare.fit.objective import Problem
from sonarhw_compare.fit.search import Peak
from sonarhw_sim.air import Receiver, Unit
from sonarhw_sim.board.profile import Board, Mount, load_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room, load_room

from benchmarks.cases.synthetic_scan import ERRORS, synthetic_scan
from benchmarks.fit import board_of
from sonarhw.errors import Cancelled, InputError
from sonarhw.readings import FloatArray, Reading, Trace
from tests.fixtures.predicted_readings import predicted_scan
from tests.fixtures.rooms_for_tests import polygon_room

ARENA = load_room("arena")
BOARD = load_board("hc-sr04")  # hears only loud echoes, so a fit of its scans is quick
SENSITIVE = board_of(ARENA)
TRUTH = Place("truth", (1.3, 0.55), 2.0)
NEARBY = FitOptions(samples=0, exact=True, global_search=False)
SQUARE = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])


def fitted(
    given: Sequence[PlacedScan] | Sequence[Reading],
    *free: str,
    room: Room = ARENA,
    board: Board = BOARD,
    options: FitOptions = NEARBY,
) -> FitResult:
    """Return the fit of scans, or of readings at the true place; nearby, positions are bounded to 5 cm around it."""
    scans = [one for one in given if isinstance(one, PlacedScan)] or [PlacedScan(given, TRUTH)]  # type: ignore[arg-type]
    names = [one.name for one in scans] if len(scans) > 1 else [""]
    at = {} if options.global_search else dict(zip("xy", scans[0].place.position, strict=True))
    near = [
        replace(one, lower=at[one.name] - 0.05, upper=at[one.name] + 0.05) if one.name in at else one
        for one in free_parameters(free, names, room, board)
    ]
    return fit_scans(scans, room, board, near, options=options)


@pytest.fixture(scope="module")
def readings() -> list[Reading]:
    return synthetic_scan(ARENA, TRUTH, BOARD, seed=1)


@pytest.fixture(scope="module")
def pose(readings: list[Reading]) -> FitResult:
    nowhere = PlacedScan(readings, Place("nowhere", (1.0, 0.5)))
    return fitted([nowhere], "position", "heading", options=FitOptions(samples=600, exact=True))


def test_a_pose_and_the_noise_of_readings_are_found_in_the_whole_room(pose: FitResult, readings: list[Reading]) -> None:
    assert math.dist(pose.places[0].position, TRUTH.position) < 0.002
    assert abs(math.remainder(pose.places[0].heading - TRUTH.heading, math.tau)) < math.radians(0.25)
    assert pose.warnings == ()
    assert (pose.agreement[0].within_5cm or 0.0) > 0.9
    assert pose.noise["range_m"] == pytest.approx(ERRORS.timing * ARENA.air.speed_of_sound / 2, rel=0.3)
    assert pose.noise["lost"] < 0.12
    # deviations from curvature are similar to those from samples, and intervals are symmetric
    quick = fitted(readings, "position", "heading")
    for name in ("x", "y"):
        estimate, drawn = quick.estimates[name], pose.estimates[name]
        assert estimate.deviation == pytest.approx(drawn.deviation, rel=0.5)
        assert abs(estimate.value - drawn.value) < 3 * drawn.deviation
        assert estimate.upper - estimate.value == pytest.approx(1.96 * estimate.deviation)
    assert quick.correlations == pytest.approx(quick.correlations.T)
    assert quick.samples.shape == (0, 3)


WARM = replace(ARENA, air=replace(ARENA.air, temperature_c=27.0))
DULL = replace(ARENA, reflectances=np.full(len(ARENA.names), 0.8))
MOUNTED = replace(BOARD, mount=Mount(ahead=0.023, aside=-0.01))


@pytest.mark.parametrize(
    ("free", "room", "board", "truth"),
    [
        ("axis", ARENA, MOUNTED, {"ahead": (0.023, 0.001), "aside": (-0.01, 0.006)}),
        ("offset", ARENA, replace(BOARD, range_offset=-0.012), {"offset": (0.012, 0.001)}),
        ("temperature", WARM, BOARD, {"temperature": (27.0, 0.3)}),
        ("speed", WARM, BOARD, {"speed": (WARM.air.speed_of_sound, 0.2)}),
    ],
)
def test_a_fit_finds_the_value(free: str, room: Room, board: Board, truth: dict[str, tuple[float, float]]) -> None:
    scan = synthetic_scan(room, TRUTH, board, 4, readings=60)
    if room is WARM:
        scan = [replace(one, speed_of_sound=325.0) for one in scan]  # the reported ranges are 7 % too short
    result = fitted(scan, "position", "heading", free)
    for name, (value, error) in truth.items():
        assert result.estimates[name].value == pytest.approx(value, abs=error)
    assert math.dist(result.places[0].position, TRUTH.position) < 0.004
    assert (result.agreement[0].within_5cm or 0.0) > 0.9


def test_reflectance_is_found_to_a_hundredth() -> None:
    # with each path weighed alone, and not together with its reverse, it would be 0.82
    assert SENSITIVE.sum_arrivals
    scan = synthetic_scan(DULL, TRUTH, SENSITIVE, 5, echoes=5)
    result = fitted(scan, "reflectance", board=SENSITIVE)
    assert result.estimates["reflectance:board"].value == pytest.approx(0.8, abs=0.01)


def test_walls_are_found_from_two_places() -> None:
    moved = {"divider": 0.02, "east": -0.013}
    real = with_shifted_walls(ARENA, moved)
    places = [Place("", (1.53, 0.24), 2.4), Place("", (1.08, 0.9), 3.6)]
    scans = [PlacedScan(synthetic_scan(real, one, BOARD, k, 60), one, f"s{k}") for k, one in enumerate(places)]
    result = fitted(scans, *(f"wall:{name}" for name in moved))
    for name, by in moved.items():
        assert result.estimates[f"wall:{name}"].value == pytest.approx(by, abs=0.001)
    assert np.abs(result.room.walls - real.walls).max() < 0.001


def test_a_wrong_thermometer_does_not_change_the_offset() -> None:
    # one kelvin is 0.17 %: millimetres at the longest ranges, which could be mistaken for an offset
    result = fitted(synthetic_scan(ARENA, TRUTH, BOARD, 8, warmer=1.0), "position", "heading", "offset")
    stretch = replace(ARENA.air, temperature_c=ARENA.air.temperature_c + 1.0).speed_of_sound / ARENA.air.speed_of_sound
    assert result.noise["stretch"] == pytest.approx(stretch, abs=6e-4)
    for name, true in (("x", TRUTH.position[0]), ("y", TRUTH.position[1]), ("offset", 0.0)):
        assert abs(result.estimates[name].value - true) < 4 * result.estimates[name].deviation


def test_a_heading_around_zero_has_its_interval_around_it() -> None:
    place = replace(TRUTH, heading=math.radians(-0.02))
    scan = synthetic_scan(ARENA, place, BOARD, seed=1)
    for given in (0.0, math.tau):
        placed = PlacedScan(scan, replace(TRUTH, heading=given))
        result = fitted([placed], "position", "heading", options=replace(NEARBY, samples=200))
        heading = result.estimates["heading"]
        assert heading.lower < heading.value < heading.upper
        assert heading.value == pytest.approx(given + place.heading, abs=math.radians(0.5))
        assert result.places[0].heading == heading.value
        assert np.median(result.samples[:, 2]) == pytest.approx(heading.value)


def test_a_prior_of_a_heading_may_differ_by_a_whole_turn(readings: list[Reading]) -> None:
    (heading,) = free_parameters(("heading",), [""], ARENA, BOARD)
    far = replace(heading, expected=TRUTH.heading - math.tau, deviation=1.0)
    result = fit_scans([PlacedScan(readings, TRUTH)], ARENA, BOARD, [far], options=replace(NEARBY, global_search=True))
    # still reported near the heading of the given place
    assert result.estimates["heading"].value == pytest.approx(TRUTH.heading, abs=math.radians(0.3))


@pytest.mark.parametrize("stated", [(0.6, 0.35), (0.33, 0.39)])
def test_in_a_symmetric_room_both_solutions_are_reported(stated: tuple[float, float]) -> None:
    """Rotated by 180° about the middle of 0.928 by 0.742 m."""
    room, place = load_room("simple"), Place("", (0.6, 0.35), 0.7)
    board = board_of(room)
    scan = PlacedScan(synthetic_scan(room, place, board, 2), Place("scanner", stated))
    result = fitted([scan], "position", "heading", room=room, board=board, options=replace(NEARBY, global_search=True))
    assert result.warnings[0].kind == "several solutions"
    poses = {(round(mode.values["x"], 2), round(mode.values["y"], 2)) for mode in result.modes}
    assert (len(result.modes), poses) == (2, {(0.6, 0.35), (0.33, 0.39)})
    assert math.dist(result.places[0].position, stated) < 0.02
    assert max(mode.score for mode in result.modes) == 0
    assert ("the first is that at the stated place" in result.warnings[0].text) == (result.modes[0].score < 0)


def test_a_worse_refinement_keeps_its_start(monkeypatch: pytest.MonkeyPatch, readings: list[Reading]) -> None:
    def lost(problem: Problem, values: FloatArray, *_: object) -> Peak:
        return Peak(-math.inf, np.full_like(values, math.nan), problem.near(values))

    monkeypatch.setattr(fitting, "highest", lost)
    result = fitted(readings, "position")
    assert math.dist(result.places[0].position, TRUTH.position) < 0.02
    monkeypatch.setattr(fitting, "peak_at", lambda problem, values: lost(problem, values))
    with pytest.raises(InputError, match="from no pose in this room can this board have an echo as near"):
        fitted(readings, "position")


LEGO = load_board("lego-nxt")  # reports whole centimetres


def test_readings_with_equal_rounding_add_little_evidence_and_exclude_no_similar_solution() -> None:
    def deviation(step: float) -> float:
        options = FitOptions(samples=0, global_search=False)
        scan = predicted_scan(ARENA, TRUTH, LEGO, step)
        return fitted([scan], "position", board=LEGO, options=options).estimates["x"].deviation

    # independent errors would be halved
    assert deviation(2.5) > 0.85 * deviation(10.0)
    # the arena has nearly the same echoes at p1 and, rotated by 90°, at 1.38, 1.80 m
    scan = predicted_scan(ARENA, ARENA.place("p1"), LEGO, 4.0)
    result = fitted([scan], "position", "heading", board=LEGO, options=replace(NEARBY, global_search=True))
    assert math.dist(result.places[0].position, ARENA.place("p1").position) < 0.01
    assert [(round(mode.values["x"], 2), round(mode.values["y"], 2)) for mode in result.modes[1:]] == [(1.38, 1.8)]


def test_what_a_scan_does_not_determine_gives_a_warning(readings: list[Reading]) -> None:
    # echoes within 0.6 m do not depend on a wall 1.1 m away
    short = replace(BOARD, max_range=0.6)
    scan = synthetic_scan(ARENA, TRUTH, short, 6, readings=40)
    result = fitted(scan, "wall:north-west", board=short, options=replace(NEARBY, samples=100))
    (warning,) = (one for one in result.warnings if one.kind == "unconstrained")
    assert "wall:north-west" in str(warning)
    # a transducer ahead of the axis and ranges that are too short differ only at oblique incidence
    together = fitted(readings, "ahead", "offset", options=replace(NEARBY, samples=200))
    assert any(one.kind == "known together" for one in together.warnings)
    assert together.estimates["offset"].deviation > 0.001
    for name in ("ahead", "offset"):
        assert abs(together.estimates[name].value) < 4 * together.estimates[name].deviation
    elsewhere = fitted(readings, "position", "heading", room=SQUARE)
    assert elsewhere.warnings[0].kind == "few explained"


def test_deviations_along_a_long_ridge_follow_from_its_bounds() -> None:
    # a square room with movable walls: walls that move with the sensor give the same echoes
    scan = PlacedScan(synthetic_scan(SQUARE, Place("", (0.7, 0.9)), SENSITIVE, 7, 60), Place("", (0.7, 0.9)))
    options = replace(NEARBY, samples=2000)
    free = free_parameters(("position", "walls"), [""], SQUARE, SENSITIVE)
    drawn = fit_scans([scan], SQUARE, SENSITIVE, free, options=options)
    assert not any(warning.kind == "underestimated" for warning in drawn.warnings)
    # walls have bounds at ± 10 cm, and are uniform between them
    for estimate in drawn.estimates.values():
        assert estimate.deviation == pytest.approx(0.1 / math.sqrt(3), rel=0.15)


def test_a_fit_models_the_late_detection_of_the_boards_own_receiver() -> None:
    board, options = load_board("polaroid-6500"), PredictionOptions(receiver=Receiver.BOARD)
    scan = predicted_scan(ARENA, TRUTH, board, options=options)
    paper, own = (
        fitted(
            [scan],
            "position",
            "heading",
            board=board,
            options=replace(NEARBY, prediction=PredictionOptions(receiver=receiver)),
        )
        for receiver in (Receiver.FIRST_ECHO, Receiver.BOARD)
    )
    assert math.dist(own.places[0].position, TRUTH.position) < 0.002
    # the paper's receiver does not model 45 mm between a loud and a faint echo
    assert own.noise["range_m"] < 0.3 * paper.noise["range_m"]


def test_the_same_seed_gives_the_same_result_and_progress_grows_to_one(readings: list[Reading]) -> None:
    shares: list[float] = []
    free, scan = free_parameters(("heading",), [""], ARENA, BOARD), PlacedScan(readings, TRUTH)
    one, other, third = (
        fit_scans(
            [scan],
            ARENA,
            BOARD,
            free,
            options=FitOptions(samples=100, seed=seed, global_search=seed == 6, exact=True),
            progress=lambda share, _, seed=seed: shares.append(share) if seed == 6 else None,
        )
        for seed in (5, 5, 6)
    )
    assert np.array_equal(one.samples, other.samples)
    assert not np.array_equal(one.samples, third.samples)
    assert (shares, shares[-1]) == (sorted(shares), 1.0)

    def progress(share: float, _step: str) -> None:
        raise Cancelled(f"no longer wanted at {share}")

    with pytest.raises(Cancelled, match="no longer wanted at 0"):
        fit_scans([scan], ARENA, BOARD, free, progress=progress)


def test_impossible_fits_are_refused(readings: list[Reading]) -> None:
    scan = PlacedScan(readings, TRUTH, "here")
    silent = replace(scan, readings=[replace(one, echo_times=()) for one in readings])
    # read anew, with traces
    again = [replace(scan, readings=[replace(one, trace=Trace(np.zeros(3), 1e5, 0.0)) for one in readings])] * 2
    block = FitOptions(PredictionOptions(unit=Unit.BLOCK))
    free: list[Parameter] = [*free_parameters(("heading",), [""], ARENA, BOARD)]
    twice: list[Parameter] = [*free_parameters(("position",), ["one", "other"], ARENA, BOARD)]
    for scans, parameters, options, message in (
        ([scan], [], NEARBY, "nothing is free"),
        ([silent], free, NEARBY, "no reading of here has an echo"),
        ([scan], free, block, "unit pass"),
        (again, twice, NEARBY, "contain the same readings; give each log once"),
    ):
        with pytest.raises(InputError, match=message):
            fit_scans(scans, ARENA, BOARD, parameters, options=options)
