"""Predicted scans: the paper's figures, sums of arrivals, many poses at once, and the fake scanner."""

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from sonarhw_sim import Mount, Ring
from sonarhw_sim.air import Air, Model, Receiver, Unit, absorption
from sonarhw_sim.board.beam import beam, beam_gain, beam_table, sums_of_arrivals, together
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.predicted_scan import PredictedPing, PredictedScan, ReportedPaths, nearest_paths
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, predict_with
from sonarhw_sim.predict.room_echoes import plate_echo
from sonarhw_sim.room.room import Place, Room, load_room, parse_room, with_material

import sonarhw
from sonarhw.errors import InputError
from sonarhw.readings import FloatArray
from tests.conftest import Count
from tests.fixtures.rooms_for_tests import room_of

ROOM = load_room("rooms/simple.toml")


PAPER = load_board("paper")


def predict(place: str, *degrees: float, unit: Unit = Unit.PASS) -> PredictedScan:
    return predict_scan(ROOM, ROOM.places[place], PAPER, np.radians(degrees), PredictionOptions(unit=unit))


def test_figure_8_reads_past_the_unit_only_if_sound_passes_it() -> None:
    passing, blocking = predict("figure7", 0), predict("figure7", 0, unit=Unit.BLOCK)
    assert passing.ranges[0] == pytest.approx(1.022)
    assert passing.paths.via(int(passing.winners[0]), ROOM) == ("right", "left", "right")
    assert not any(echo.range == pytest.approx(1.022) for echo in blocking.ping(0).echoes)


def test_no_echo_within_blanking_beyond_the_range_or_below_the_threshold() -> None:
    board = replace(PAPER, max_range=1.5)
    scan = predict_scan(ROOM, ROOM.places["figure9"], board, np.radians(np.arange(0, 360, 1.0)))
    ranges = scan.ranges[~np.isnan(scan.ranges)]
    assert ranges.min() >= board.blanked_range(ROOM.air)
    assert ranges.max() <= 1.5
    levels = [scan.ping(k).levels[winner] for k, winner in enumerate(scan.winners) if winner >= 0]
    assert min(levels) >= board.threshold_db
    assert np.isnan(scan.ranges).any()


def test_fixed_gain_leaves_spreading_and_absorption_in_the_level() -> None:
    board = replace(load_board("hc-sr04"), fixed_gain=True)
    for ahead in (0.25, 0.5, 1.0, 2.0):
        room = room_of(np.array([[ahead, -5.0, ahead, 5.0]]))
        scan = predict_scan(room, Place("here", (0.0, 0.0)), board, np.zeros(1))
        length = 2 * ahead
        lost = 20 * math.log10(length) + absorption(board.frequency, room.air) * (length - 1)
        assert scan.ping(0).echoes[0].level_db == pytest.approx(20 * math.log10(room.reflectances[0]) - lost, abs=1e-9)


def test_an_edge_is_a_reflection_in_the_model_of_single_reflections() -> None:
    """Sound reflected by one wall and bent by the end of another is left out, whichever the end."""
    room = room_of([[1.0, -1.0, 1.0, 0.3], [-1.0, -2.0, -1.0, 2.0]])
    place, board, headings = Place("here", (0.0, 0.0)), replace(PAPER, threshold_db=-120.0), np.zeros(1)
    every = predict_with(Model.RAY_FOLLOWING, room, place, board, headings).paths
    single = predict_with(Model.KUC_SIEGEL, room, place, board, headings).paths
    touched = every.bounces + (every.edges >= 0)
    assert set(every.edges[touched > 1].tolist()) >= {0, 2, 3}
    assert (len(single), (single.bounces + (single.edges >= 0)).max()) == ((touched <= 1).sum(), 1)


@pytest.mark.parametrize("ka", [5.8, 17.33])
def test_beam_between_the_nodes_of_its_table_is_the_closed_form(ka: float) -> None:
    angles = np.linspace(-math.pi, math.pi, 2001)
    interpolated = [beam(math.cos(angle), ka, beam_table(ka)) for angle in angles]
    assert interpolated == pytest.approx(beam_gain(angles, ka), abs=1e-8)


# Arrivals that coincide are added with their phases.


BOARD = load_board("polaroid-6500")


ALONE = replace(BOARD, sum_arrivals=False)


WAVELENGTH = 0.007


ORIGIN = Place("here", (0.0, 0.0))


def corner(opening_deg: float, distance: float = 1.0, from_floor_deg: float = 20.0) -> Room:
    """Return two long walls with air between them; the place is `distance` from the vertex."""
    towards = math.radians(from_floor_deg)
    x, y = -distance * math.cos(towards), -distance * math.sin(towards)
    opening = math.radians(opening_deg)
    return room_of([(x, y, x + 3.0, y), (x, y, x + 3.0 * math.cos(opening), y + 3.0 * math.sin(opening))])


def scan_at(room: Room, heading: float, board: Board = BOARD, **options: Any) -> PredictedScan:
    return predict_scan(room, ORIGIN, board, np.array([heading]), PredictionOptions(**options))


def test_path_and_its_reverse_are_6_db_louder_than_one_of_them() -> None:
    room = corner(60.0)
    found = scan_at(room, 0.0)
    pair = [k for k in range(len(found.paths)) if found.paths.bounces[k] == 2 and found.paths.edges[k] < 0]
    assert len(pair) == 2
    assert found.paths.lengths[pair[0]] == pytest.approx(found.paths.lengths[pair[1]])
    heading = float(np.angle(np.exp(1j * found.paths.departures[pair]).sum()))
    both, alone = scan_at(room, heading), scan_at(room, heading, ALONE)
    row = next(k for k in range(len(both.paths)) if both.paths.bounces[k] == 2 and both.paths.edges[k] < 0)
    assert both.ping(0).levels[row] - alone.ping(0).levels[row] == pytest.approx(20 * math.log10(2), abs=0.05)


@pytest.mark.parametrize(("sequence", "opening"), [(("w0", "w1"), 90.0), (("w0", "w1", "w0"), 45.0)])
def test_path_that_retraces_itself_counts_once(sequence: tuple[str, ...], opening: float) -> None:
    room = corner(opening, 0.8, 15.0)
    paths = scan_at(room, 0.0).paths
    rows = [k for k in range(len(paths)) if paths.via(k, room) in (sequence, sequence[::-1])]
    assert len(rows) == 1
    towards = float(paths.departures[rows[0]])
    both, alone = scan_at(room, towards), scan_at(room, towards, ALONE)
    row = next(k for k in range(len(both.paths)) if both.paths.via(k, room) == sequence)
    assert both.ping(0).levels[row] == pytest.approx(alone.ping(0).levels[row], abs=0.01)


def test_reading_is_that_of_the_loudest_of_its_arrival_and_has_the_level_of_the_sum() -> None:
    # an edge 1 mm of path before the wall is over the threshold only because the wall is
    room = room_of([(1.0, -2.0, 1.0, 2.0), (0.9985, 0.05, 0.9985, 2.0)])
    scan = scan_at(room, 0.0, receiver=Receiver.FIRST_ECHO)
    paths = scan.paths
    assert paths.via(0, room) == ("w1/",)
    assert paths.via(int(scan.winners[0]), room) == ("w0",)
    assert scan.distances[0] == pytest.approx(1.0)
    echo = scan.ping(0).echoes[0]
    assert echo.path == scan.winners[0]
    assert scan.ping(0).level_of_reading == pytest.approx(echo.level_db)


@pytest.mark.parametrize(("apart", "sums"), [(0.0, (2, 2)), (0.25, (2**0.5, 1)), (0.5, (0, 1)), (1.01, (1, 1))])
def test_sum_depends_on_the_difference_of_the_paths_in_wavelengths(apart: float, sums: tuple[float, float]) -> None:
    lengths = 2.0 + np.array([0.0, apart]) * WAVELENGTH
    added, _ = sums_of_arrivals(np.ones(2), together(lengths, np.zeros(2), WAVELENGTH, BOARD))
    assert added == pytest.approx(sums, abs=1e-9)
    alone, _ = sums_of_arrivals(np.ones(2), together(lengths, np.zeros(2), WAVELENGTH, ALONE))
    assert alone == pytest.approx([1, 1])


# The echo nearest to a measured range.


REACH = 0.05


FIGURE_9 = ROOM.place("figure9")


HEADINGS = np.radians(np.arange(0.0, 360.0, 15.0))


# turned boards and rough walls have other paths at each heading
OWN_PATHS = predict_scan(ROOM, FIGURE_9, BOARD, HEADINGS, PredictionOptions(Unit.REFLECT, max_bounces=3))


ROUGH = predict_scan(with_material(ROOM, ROOM.materials[0], 0.9, scatter=0.3), FIGURE_9, BOARD, HEADINGS)


def nearest_of(scan: PredictedScan, row: int, measured: float) -> int:
    """Return the path of the nearest of all echoes at a heading; -1: none within REACH."""
    echoes = [echo for echo in scan.ping(row).echoes if abs(echo.range - measured) <= REACH]
    return min(echoes, key=lambda echo: abs(echo.range - measured)).path if echoes else -1


@pytest.mark.parametrize(
    "scan",
    [
        predict_scan(ROOM, FIGURE_9, BOARD, HEADINGS),
        predict_scan(ROOM, FIGURE_9, BOARD, HEADINGS, PredictionOptions(Unit.BLOCK, max_bounces=4)),
        predict_scan(ROOM, FIGURE_9, replace(BOARD, rounding=0.01), HEADINGS),
        OWN_PATHS,
        ROUGH,
    ],
    ids=["arrivals added", "face blocks", "whole centimetres", "own paths", "rough walls"],
)
def test_the_nearest_echo_is_that_of_a_search_among_all(scan: PredictedScan) -> None:
    rows = np.repeat(np.arange(len(HEADINGS)), 8)
    measured = np.tile(np.linspace(0.45, 1.2, 8), len(HEADINGS)) + 0.01 * np.sin(np.arange(len(rows)))
    expected = [nearest_of(scan, *reading) for reading in zip(rows.tolist(), measured.tolist(), strict=True)]
    assert nearest_paths(scan, rows, measured, REACH).tolist() == expected
    assert max(expected) > -1
    assert min(expected) == -1


# The echo of a plate.


DISTANCE = 1.3


def test_only_the_own_receiver_of_a_board_delays_an_echo_and_faint_ones_more() -> None:
    own = load_board("polaroid-6500")
    assert plate_echo(replace(own, receiver=Receiver.FIRST_ECHO), Air(), DISTANCE).delay == 0
    delays = [plate_echo(own, Air(), DISTANCE, level).delay for level in (6, 0, -6)]
    assert 0.001 < delays[0] < delays[1] < delays[2] < 0.01


# Many poses at once.


TWELVE = np.arange(12) * np.radians(30)


def poses_in(room: Room, count: int, seed: int) -> FloatArray:
    random, ends = np.random.default_rng(seed), room.walls.reshape(-1, 2)
    points = random.uniform(ends.min(axis=0) + 0.1, ends.max(axis=0) - 0.1, (20 * count, 2))
    free = [point for point in points.tolist() if not (room.is_outside(point) or room.posts_at(point))]
    return np.column_stack((free[:count], random.uniform(-4, 4, count)))


def one_by_one(room: Room, board: Board, poses: FloatArray, height: float | None = None) -> FloatArray:
    ranges = []
    for x, y, heading in poses.tolist():
        place = board.faced(sonarhw.Place("", (x, y), heading, height))
        ranges.append(sonarhw.predict(room, place, board, place.heading + board.turned(TWELVE)).ranges)
    return np.array(ranges)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("name", "board", "height", "count"),
    [
        ("arena", "hc-sr04", None, 40),
        ("laboratory", "hc-sr04", None, 16),  # a post, and edges of a panel
        ("laboratory", "paper", None, 12),  # faint echoes off the post
        ("laboratory", "polaroid-6500", None, 4),  # the board's own receiver
        ("corridor", "paper", None, 4),  # sums of arrivals, and readings beyond its range
        ("doorstep", "hc-sr04", 0.3, 2),  # floor, and walls of limited height
    ],
)
def test_ranges_are_those_of_single_predictions(name: str, board: str, height: float | None, count: int) -> None:
    room, profile = sonarhw.load_room(name), replace(sonarhw.load_board(board), home_angle_deg=3.0, axis_x=0.02)
    poses = poses_in(room, count, seed=3)
    expected = one_by_one(room, profile, poses, height)
    ranges = sonarhw.predict_ranges(room, poses, TWELVE, profile, height=height)
    assert ranges.shape == (count, 12)
    other = (np.isnan(ranges) != np.isnan(expected)) | (np.abs(ranges - expected) > 0.001)
    assert np.isfinite(expected).sum() > 2 * count
    assert other.sum() <= 1


ALL_ROUND = np.radians(np.arange(0, 360, 5.0))
CLUTTER = """
name = "clutter"
[materials.m]
reflectance = 0.9
[[walls]]
name = "outline"
points = [[0.0, 0.0], [2.6, 0.1], [2.5, 1.9], [0.1, 2.1]]
closed = true
material = "m"
[[walls]]
name = "box"
points = [[1.6, 1.2], [1.9, 1.1], [2.0, 1.4]]
closed = true
material = "m"
[[posts]]
name = "column"
center = [0.6, 1.5]
radius = 0.08
material = "m"
[[posts]]
name = "leg"
center = [1.2, 0.7]
radius = 0.01
material = "m"
"""


def test_readings_from_short_paths_are_those_of_all_paths_to_the_bit(count: Count) -> None:
    boards = [load_board(name) for name in ("paper", "hc-sr04", "polaroid-6500")]
    rooms = [load_room("arena"), load_room("laboratory"), ROOM, parse_room(CLUTTER, "clutter")]
    settled, poses = 0, count(1, 5)
    for room, board in product(rooms, boards):
        for x, y, turn in poses_in(room, poses, seed=9).tolist():
            place = board.faced(Place("", (x, y), turn))
            whole = predict_scan(room, place, board, ALL_ROUND)
            scan = sonarhw.predict(room, place, board, ALL_ROUND)
            settled += len(scan.paths.known) < len(whole.paths)
            assert np.array_equal(scan.distances, whole.distances, equal_nan=True)
            assert np.array_equal(scan.winners, whole.winners)
            assert np.array_equal(scan.reported_paths.levels, whole.reported_paths.levels, equal_nan=True)
            assert scan == whole
    assert settled > len(rooms) * len(boards) * poses / 2


def test_readings_do_without_paths_that_need_too_much_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = sonarhw.predict("laboratory", "bench")
    lengths = expected.paths.lengths[expected.winners]
    monkeypatch.setattr("sonarhw_sim.rays.fan.MOST_POINTS", 600_000)
    scan = sonarhw.predict("laboratory", "bench")
    assert np.array_equal(scan.ranges, expected.ranges)
    assert np.array_equal(scan.columns()["path_m"], lengths)
    with pytest.raises(InputError, match="too many paths"):
        _ = scan.ping(0).echoes


def test_paths_that_need_too_much_memory_at_once_are_searched_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    room = load_room("arena")
    poses = poses_in(room, 12, seed=4)
    ranges = sonarhw.predict_ranges(room, poses, TWELVE, "hc-sr04")
    monkeypatch.setattr("sonarhw_sim.rays.fan.MOST_POINTS", 6000)
    assert np.array_equal(sonarhw.predict_ranges(room, poses, TWELVE, "hc-sr04"), ranges, equal_nan=True)
    monkeypatch.setattr("sonarhw_sim.rays.fan.MOST_POINTS", 60)
    with pytest.raises(InputError, match="too many paths"):
        sonarhw.predict_ranges(room, poses, TWELVE, "hc-sr04")


@pytest.mark.parametrize(
    "board",
    [
        replace(load_board("hc-sr04"), mount=Mount(ahead=0.05, separation=0.026), home_angle_deg=4.0, axis_x=0.03),
        replace(load_board("hc-sr04"), ring=Ring(sensors=6, radius=0.1, interval=0.05)),
        replace(load_board("polaroid-6500"), ring=Ring(sensors=3, radius=0.05, interval=0.08), max_range=3.0),
        replace(load_board("hc-sr04"), ring=Ring(sensors=3, radius=0.1, interval=0.004)),  # hears its neighbours
    ],
)
def test_sensors_beside_the_axis_read_what_each_reads_alone(board: Board) -> None:
    room, headings = load_room("arena"), None if board.ring else TWELVE[:4]
    poses = poses_in(room, 2, seed=5)
    for pose, ranges in zip(poses.tolist(), sonarhw.predict_ranges(room, poses, headings, board), strict=True):
        place = board.faced(sonarhw.Place("", tuple(pose[:2]), pose[2]))
        there = board.ring.headings(place) if board.ring else place.heading + board.turned(TWELVE[:4])
        assert np.allclose(sonarhw.predict(room, place, board, there).ranges, ranges, atol=0.001, equal_nan=True)


def test_a_ring_has_its_own_headings_and_levels_are_over_the_threshold() -> None:
    room, board = sonarhw.load_room("arena"), sonarhw.load_board("hc-sr04")
    ring = replace(board, ring=Ring(sensors=6, radius=0.1, interval=0.05))
    ranges, levels = sonarhw.predict_ranges(room, poses_in(room, 2, seed=5), board=ring, levels=True)
    assert ranges.shape == levels.shape == (2, 6)
    assert ((levels >= 0) == np.isfinite(ranges)).mean() > 0.98


@pytest.mark.parametrize(
    ("name", "board", "height", "poses_in_soak"),
    [
        ("laboratory", "polaroid-6500", None, 12),
        ("laboratory", "paper", None, 18),
        ("arena", "hc-sr04", None, 90),
        ("doorstep", "polaroid-6500", 0.3, 6),
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_levels_and_paths_of_many_poses_are_those_of_single_predictions(
    name: str, board: str, height: float | None, poses_in_soak: int, count: Count
) -> None:
    room, profile = sonarhw.load_room(name), sonarhw.load_board(board)
    poses = poses_in(room, count(poses_in_soak // 6, poses_in_soak), seed=8)
    ranges, levels, paths = sonarhw.predict_ranges(room, poses, TWELVE, profile, levels=True, paths=True, height=height)
    _, quick = sonarhw.predict_ranges(room, poses, TWELVE, profile, paths=True, height=height)  # no farther than needed
    assert isinstance(paths, ReportedPaths)
    assert isinstance(quick, ReportedPaths)
    other = 0
    for row, (x, y, turn) in enumerate(poses.tolist()):
        place = profile.faced(sonarhw.Place("", (x, y), turn, height))
        scan = sonarhw.predict(room, place, profile, place.heading + profile.turned(TWELVE))
        for k, winner in enumerate(scan.winners.tolist()):
            ping = scan.ping(k)
            loudest = float(ping.levels[scan.in_time].max(initial=-np.inf)) - profile.threshold_db
            differs = not (levels[row, k] == loudest or abs(levels[row, k] - loudest) < 0.01)
            for reported in (paths, quick):
                differs |= _described(reported, row, k, room) != (_path_of(ping, winner, room) if winner >= 0 else None)
            other += differs
    assert other <= 0.01 * ranges.size
    assert paths.bounces.max() > 1


def _described(paths: ReportedPaths, row: int, k: int, room: sonarhw.Room) -> tuple[object, ...] | None:
    """Return length, level and course of the path of a reading; None without an echo."""
    surfaces = [room.names[surface] for surface in paths.surfaces[row, k] if surface >= 0]
    if np.isnan(paths.lengths[row, k]):
        assert not surfaces
        assert np.isnan(paths.levels[row, k])
        return None
    length, level, edge = paths.lengths[row, k], paths.levels[row, k], paths.edges[row, k]
    return round(float(length), 4), round(float(level), 1), sorted(surfaces), int(edge)


def _path_of(ping: PredictedPing, winner: int, room: sonarhw.Room) -> tuple[object, ...]:
    """Return what `_described` returns for the path of a reading of a single prediction."""
    paths = ping.scan.paths
    surfaces = [room.names[surface] for surface in paths.surfaces[winner].tolist() if surface >= 0]
    return (
        round(float(paths.lengths[winner]), 4),
        round(ping.level_of_reading, 1),
        sorted(surfaces),
        paths.edges[winner],
    )


def test_noise_that_hides_the_echoes_gives_a_warning() -> None:
    clear, hidden = PredictionOptions(noise=0.003), PredictionOptions(noise=0.01)
    expected = sonarhw.predict("simple", "figure9", "polaroid-6500").ranges
    with pytest.warns(UserWarning, match="noise 0.01: crosses the threshold.*; with 0.002, most are of echoes"):
        noisy = sonarhw.predict("simple", "figure9", "polaroid-6500", options=hidden).ranges
    assert (abs(noisy - expected) > 0.02).mean() > 0.5
    ranges = sonarhw.predict("simple", "figure9", "polaroid-6500", options=clear).ranges
    assert (abs(ranges - expected) > 0.02).mean() < 0.3
