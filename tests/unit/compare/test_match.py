"""A scan beside its prediction: classes, figures, echoes, regions and probabilities, on scans with known truth."""

import math
import sys
from dataclasses import replace
from itertools import permutations
from statistics import NormalDist

import numpy as np
import pytest
from scipy.stats import norm
from sonarhw_compare.arcs import POSSIBLE, arcs_of
from sonarhw_compare.explain import reading_details
from sonarhw_compare.fit.objective import make_problem
from sonarhw_compare.fit.parameters import free_parameters
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.map import map_scans
from sonarhw_compare.match import KINDS, TOLERANCE, Comparison, Kind, classify, compare_readings, roc_area
from sonarhw_compare.regions import Region, regions_of, shares_of_readings
from sonarhw_compare.rooms.evidence import evidence_of
from sonarhw_compare.score import assigned, compare_regions, echo_statistics, match_regions, score_comparison
from sonarhw_sim.board.profile import Board, Mount, OwnBodyPart, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import MissingExtra
from sonarhw.readings import Ping, Reading
from tests.fixtures.predicted_readings import readings_of
from tests.fixtures.rooms_for_tests import polygon_room

ROOM, ARENA = load_room("simple"), load_room("arena")
PLACE = ROOM.places["figure9"]
PAPER, NXT = load_board("paper"), load_board("lego-nxt")


def test_every_reading_has_one_class() -> None:
    cases = [
        (1.00, 1.05, Kind.MATCH),
        (1.0, 1.051, Kind.SHORT),
        (1.051, 1.0, Kind.LONG),
        (math.nan, 1.0, Kind.MISSED),
        (1.0, math.nan, Kind.EXTRA),
        (math.nan, math.nan, Kind.BOTH_SILENT),
    ]
    measured, predicted, kinds = zip(*cases, strict=True)
    assert [KINDS[code] for code in classify(np.array(measured), np.array(predicted))] == [*kinds]


def test_the_area_under_the_curve_of_silence_is_the_share_of_correctly_ordered_pairs() -> None:
    random = np.random.default_rng(3)
    scores, sounding = random.integers(0, 6, 60).astype(np.float64), random.random(60) < 0.7
    scores[:5] = -math.inf
    pairs = [(a > b) + 0.5 * (a == b) for a in scores[sounding] for b in scores[~sounding]]
    assert roc_area(scores, sounding.tolist()) == pytest.approx(np.mean(pairs))
    assert roc_area(scores, [True] * 60) is roc_area(scores, [False] * 60) is None


# Echoes of one reading.


def test_assignment_has_the_least_cost_of_all_one_to_one_assignments() -> None:
    random = np.random.default_rng(2)
    for _ in range(50):
        measured, predicted = np.sort(random.uniform(0, 0.5, 4)), np.sort(random.uniform(0, 0.5, 5))
        costs = [
            sum(min(abs(m - predicted[k]), 2 * TOLERANCE) for m, k in zip(measured, order, strict=False))
            for order in permutations(range(5), 4)
        ]
        chosen = assigned(measured, predicted)
        taken = [k for k in chosen if k is not None]
        cost = sum(2 * TOLERANCE if k is None else abs(m - predicted[k]) for m, k in zip(measured, chosen, strict=True))
        assert len(set(taken)) == len(taken)
        # pairs between one and two gates are not assigned and cost two gates
        assert cost == pytest.approx(min(costs), abs=TOLERANCE * (len(chosen) - len(taken)) + 1e-12)
    assert (assigned(np.empty(0), np.ones(1)), assigned(np.ones(1), np.empty(0))) == ([], [None])


@pytest.mark.parametrize(("bias", "deviation"), [(0.0, 0.002), (0.005, 0.004)])
def test_bias_and_spread_of_normal_residuals_are_their_mean_and_deviation(bias: float, deviation: float) -> None:
    predicted = predict_scan(ROOM, PLACE, PAPER, np.array([1.0])).ping(0).echoes[0].range
    # one residual that is far off hardly changes either
    residuals = np.append(bias + deviation * norm.ppf((np.arange(200) + 0.5) / 200), 0.04)
    readings = readings_of(np.zeros(201), predicted + residuals)
    statistics = echo_statistics(compare_readings(readings, ROOM, replace(PLACE, heading=1.0), PAPER))
    assert statistics.bias_m == pytest.approx(bias, abs=1e-4)
    assert statistics.spread_m == pytest.approx(deviation, rel=0.02)


# Regions of constant depth.


HEADINGS = np.radians(np.arange(0.0, 360.0, 3.0))
NOTHING = np.full(120, np.nan)


def ranges_with(*parts: tuple[int, int, float], other: float = math.nan) -> np.ndarray:
    """Return 120 ranges with these values from one row to before another, which may be after the last."""
    ranges = np.full(120, other)
    for first, end, range_ in parts:
        ranges[np.arange(first, end) % 120] = range_
    return ranges


@pytest.mark.parametrize(
    ("ranges", "found"),
    [
        (ranges_with((116, 125, 1.0)), [(1.0, 9, 116)]),  # across heading 0
        (ranges_with((116, 125, 1.0), other=2.0), [(1.0, 9, 116), (2.0, 111, 5)]),
        (ranges_with((60, 70, math.nan), (90, 91, math.nan), (0, 1, math.nan), other=1.0), [(1.0, 108, 70)]),
        (ranges_with((60, 70, math.nan), (80, 81, 2.0), other=1.0), [(1.0, 99, 81), (1.0, 10, 70)]),
        (NOTHING, []),
    ],
)
def test_regions_end_at_wide_silence_only(ranges: np.ndarray, found: list[tuple[float, int, int]]) -> None:
    regions = regions_of(HEADINGS, ranges)
    assert sorted((one.range, len(one), one.rows[0]) for one in regions) == sorted(found)


def test_neighbours_with_one_range_and_readings_near_each_other_count_less() -> None:
    headings = np.radians([0.0, 5.0, 10.0, 90.0, 91.0, 180.0, 270.0])
    ranges = np.array([math.nan, math.nan, math.nan, 1.0, 1.0, 1.5, 2.0])
    run, near = 3 / (1 + 2 * 0.5) / 3, 1.2 / (1 + 0.2 * 0.5) / 2
    assert shares_of_readings(headings, ranges, 0.5) == pytest.approx([run, run, run, near, near, 1.0, 1.0])
    twice = shares_of_readings(np.repeat(headings, 2), np.repeat(ranges, 2), 0.5)
    assert twice.sum() == pytest.approx(shares_of_readings(headings, ranges, 0.5).sum())


def arc(begin: float, end: float, distance: float = 1.0) -> Region:
    """Return a region from one heading to another, degrees."""
    return Region((0,), distance, math.radians((begin + end) / 2) % math.tau, math.radians(end - begin))


@pytest.mark.parametrize(
    ("measured", "predicted", "pairs", "parts"),
    [
        ([arc(0, 20)], [arc(21, 45)], [], []),
        ([arc(-30, -1)], [arc(1, 30)], [], []),
        ([arc(0, 30)], [arc(0, 30, 1.06)], [], []),
        ([arc(0, 30)], [arc(0, 30, 1.04)], [(0, 0)], []),
        ([arc(-20, 10)], [arc(5, 40)], [(0, 0)], []),  # across heading 0
        ([arc(0, 30)], [arc(-10, 12), arc(14, 34)], [(0, 1)], [(0, 0)]),  # 12° and 16° in common
        ([arc(0, 30), arc(40, 60)], [arc(0, 60)], [(0, 0)], [(1, 0)]),  # detected in pieces
        ([], [arc(0, 30)], [], []),
    ],
)
def test_regions_are_paired_by_the_headings_that_they_have_in_common(
    measured: list[Region], predicted: list[Region], pairs: list[tuple[int, int]], parts: list[tuple[int, int]]
) -> None:
    found = match_regions(measured, predicted)
    for matched, expected in ((found.pairs, pairs), (found.parts, parts)):
        assert [*matched] == [(measured[one], predicted[other]) for one, other in expected]
    paired = [*found.pairs, *found.parts]
    assert {*found.only_measured} == {*measured} - {one for one, _ in paired}
    assert {*found.only_predicted} == {*predicted} - {other for _, other in paired}


# The carrier's own body, and a turntable that is not nominal: the same for comparison, fit and map.


HERE = Place("", (0.42, 0.42))
BODY = replace(NXT, own_body=(OwnBodyPart(from_deg=40.0, to_deg=80.0, nearest=0.05, farthest=0.09),))


def test_readings_of_the_own_body_are_in_no_share_region_fit_or_map() -> None:
    angles = np.radians(np.arange(0.0, 360.0, 5.0))
    ranges = predict_scan(ARENA, HERE, NXT, angles).ranges
    ranges[8:17] = 0.07
    readings = readings_of(angles, ranges, ARENA.air.speed_of_sound)
    comparison = compare_readings(readings, ARENA, HERE, BODY)
    assert [row.index for row in comparison.rows if row.kind is Kind.OWN_BODY] == list(range(8, 17))
    summary, naive = comparison.summary(), compare_readings(readings, ARENA, HERE, NXT).summary()
    assert (summary.classes["own_body"], summary.within_5cm, summary.explained) == (9, 1.0, 1.0)
    assert (naive.within_5cm or 0.0) < 0.9
    assert summary.n_echo == naive.n_echo - 9 == echo_statistics(comparison).echoes
    details = reading_details(comparison, 10)
    assert (details["class"], details["echoes"], details["threshold_change_db"]) == ("own_body", [], None)
    regions = compare_regions(comparison)
    assert all(one.range > 0.1 for one in (*(first for first, _ in regions.pairs), *regions.only_measured))
    placed, of_room = PlacedScan(readings, HERE), [one for k, one in enumerate(readings) if not 8 <= k < 17]
    free = free_parameters(("heading",), ("scan",), ARENA, BODY)
    problem = make_problem([placed], ARENA, BODY, free, PredictionOptions(), all_echoes=False)
    assert len(problem.scans[0].angles) == len(of_room)
    # arcs count the rows as the likelihood does
    arcs = arcs_of(evidence_of([placed], [PoseSpread()], BODY, ARENA.air).scans, BODY, POSSIBLE)
    assert arcs == arcs_of([PlacedScan(of_room, HERE)], NXT, POSSIBLE)
    found = map_scans([placed], BODY, ARENA)
    assert (found.echoes, found.undetermined) == (summary.n_echo, 0)


TURNED = Place("", (0.42, 0.42), math.radians(30.0))
CROOKED = replace(
    NXT.certain,
    rounding=0.0,
    home_angle_deg=-12.0,
    turntable_scale=1.05,
    axis_x=0.03,
    axis_y=-0.02,
    clock_error=0.02,
    range_offset=-0.02,
)
CROOKED_BOARDS = [CROOKED, replace(CROOKED, mount=Mount(ahead=0.03))]


def measured_with(board: Board) -> list[Reading]:
    """Return what the fake scanner measures with this board, at turntable angles from 0° to 340°."""
    source, speed = RoomEchoes(ARENA, TURNED, board, disturbance=EXACT), ARENA.air.speed_of_sound
    # a face ahead of the axis has other paths at each heading
    angles = np.radians(np.arange(0.0, 343.0, 4.0 if board.mount.ahead == 0 else 12.0)).tolist()
    times = [source.receive(Ping(angle, 0, 0, 0.02, trace=False)).echo_times for angle in angles]
    return [Reading(k, 0, 0, angles[k], 0.1 * k, times[k][:1], speed) for k in range(len(angles))]


@pytest.mark.parametrize("board", CROOKED_BOARDS)
def test_the_prediction_and_the_likelihood_of_a_board_explain_what_this_board_measures(board: Board) -> None:
    readings = measured_with(board)
    rows = compare_readings(readings, ARENA, board.faced(TURNED), board).rows
    residuals = [row.residual for row in rows if row.measured is not None or row.predicted is not None]
    assert len(residuals) > 20
    assert residuals == pytest.approx([0.0] * len(residuals), abs=1e-9)
    scan, free = PlacedScan(readings, TURNED), free_parameters(("heading",), ("scan",), ARENA, board)

    def likelihood(other: Board) -> float:
        problem = make_problem([scan], ARENA, other, free, PredictionOptions(), all_echoes=False)
        return problem.near(problem.start())(problem.start())

    best = likelihood(board)
    for key, change in (("turntable_scale", 0.02), ("axis_x", 0.015), ("axis_y", 0.015), ("clock_error", 0.02)):
        for by in (change, -change):
            assert likelihood(replace(board, **{key: getattr(board, key) + by})) < best - 3, key


# Probabilities.


PHI = NormalDist().cdf
WALL, ORIGIN = polygon_room([(1.5, -1.0), (1.5, 1.0)], closed=False), Place("here", (0.0, 0.0))
LEVEL = 20 * math.log10(0.9)  # dB, of the wall straight ahead


def compared(board: Board, *ranges: float) -> Comparison:
    return compare_readings(readings_of(np.zeros(len(ranges)), ranges, WALL.air.speed_of_sound), WALL, ORIGIN, board)


def test_log_score_of_one_wall_and_a_normal_threshold() -> None:
    board, heard = replace(PAPER, threshold_db=LEVEL + 1.0, threshold_sd_db=2.0, range_sd=0.004), PHI(-0.5)
    spread, stray = math.hypot(0.004, 0.005), 0.01 * 0.01 / (2 * PAPER.max_range)
    at = 0.99 * heard * (PHI(0.008 / spread) - PHI(-0.002 / spread)) + stray
    silent = 0.99 * (1 - heard) + 0.005
    for measured, probability in ((1.503, at), (math.nan, silent), (0.7, stray)):
        assert score_comparison(compared(board, measured)).log_score == pytest.approx(math.log(probability), abs=2e-3)
    score = score_comparison(compared(board, math.nan, 1.503, math.nan))
    assert score.log_score == pytest.approx((2 * math.log(silent) + math.log(at)) / 3, abs=2e-3)
    assert score_comparison(compare_readings([], WALL, ORIGIN, board)).log_score is None


def test_results_are_tables_of_pandas_and_xarray(monkeypatch: pytest.MonkeyPatch) -> None:
    scan = predict_scan(ROOM, PLACE, NXT, np.radians([0.0, 90.0, 180.0]))
    compared = compare_readings(readings_of(scan.headings, scan.ranges), ROOM, PLACE, NXT)
    frame, predicted = compared.to_dataframe(), scan.to_dataframe()
    assert frame["predicted_m"].to_list() == pytest.approx(scan.ranges.tolist(), nan_ok=True)
    assert (frame["via"] == predicted["via"]).all()
    assert set(frame["class"]) <= {"match", "both_silent"}
    assert scan.to_xarray()["path_m"].sizes == {"row": 3}
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtra, match="study"):
        compared.to_dataframe()
