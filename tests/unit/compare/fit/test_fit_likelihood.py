"""Moved paths equal those of a new search, and probabilities of all readings sum to one."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan, free_parameters
from sonarhw_compare.fit.free_walls import left_normals, with_shifted_walls
from sonarhw_compare.fit.likelihood import (
    BENT,
    EVEN,
    ODD,
    BoardValues,
    PathArrays,
    ReadingNoise,
    ScanArrays,
    _late,
    _legs,
    _touched_normals,
    displaced,
    echo_paths,
    growth_by_wall,
    log_likelihoods,
    with_reverses,
    with_summed_patches,
)
from sonarhw_compare.fit.objective import Objective, make_problem
from sonarhw_sim.air import EdgeStrength, Receiver
from sonarhw_sim.board.beam import beam_table
from sonarhw_sim.board.profile import Board, Mount, load_board
from sonarhw_sim.compiled import compiled
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, search_for, weigh_paths
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Place, Room, load_room
from sonarhw_sim.space.sections import paths_from

from benchmarks.cases.synthetic_scan import synthetic_scan
from sonarhw.readings import FloatArray, Reading
from tests.fixtures.rooms_for_tests import room_of

ARENA = load_room("rooms/arena.toml")
BOARD = load_board("polaroid-6500")
HERE, THERE = (0.9, 0.5), (0.912, 0.491)
BY = (0.012, -0.009)
SEARCH = replace(
    search_for(ARENA, BOARD, PredictionOptions(max_bounces=5, edge_strength=EdgeStrength.PAPER)),
    # without the many faint paths that come and go as walls move
    faintest_diffraction=10 ** ((BOARD.threshold_db - 3) / 20),
)


def same_paths(some: Paths, others: Paths, there: Room = ARENA) -> list[tuple[int, int]]:
    """Return pairs of rows with the same surfaces and edges; `others` are in the room `there`."""
    rows = [
        {paths.via(row, room): row for row in range(len(paths))} for paths, room in ((some, ARENA), (others, there))
    ]
    return [(row, rows[1][way]) for way, row in rows[0].items() if way in rows[1]]


def test_moved_paths_equal_those_of_a_new_search() -> None:
    here, there = find_paths(ARENA, HERE, SEARCH), find_paths(ARENA, THERE, SEARCH)
    one = echo_paths(here, ARENA, [], [])
    moved = [displaced(one.out[k], one.back[k], one.turn[k], one.kind[k], BY, BY) for k in range(len(here))]
    out, back = np.split(np.array(moved), 2, axis=1)
    pairs = same_paths(here, there)
    assert len(pairs) > 0.9 * len(there)
    for row, other in pairs:
        assert np.hypot(*out[row]) + np.hypot(*back[row]) == pytest.approx(there.lengths[other], abs=1e-12)
        assert out[row] / np.hypot(*out[row]) == pytest.approx(there.leaving[other], abs=1e-12)


def test_a_patch_in_a_likelihood_is_as_loud_as_all_that_are_received_with_it() -> None:
    room = room_of([(-200.0, 1.0, 200.0, 1.0)])
    room, here = replace(room, scattered=np.array([0.5, 0.0])[: len(room.names)]), Place("here", (0.0, 0.0))
    every = paths_from(room, here, SEARCH)
    few = with_summed_patches(every, room, BOARD)
    assert len(every) > 3 * len(few)
    assert not few.scattered.any()
    for row in np.flatnonzero((few.lengths > 2.1) & (few.lengths < 4))[::5].tolist():
        towards = few.departures[row : row + 1]
        scan = weigh_paths(room, here, BOARD, towards, every)
        levels, loudest = scan.ping(0).levels, scan.ping(0).loudest
        same = int(np.abs(scan.paths.lengths - few.lengths[row]).argmin())
        assert scan.paths.scattered[loudest[same]]
        assert 20 * math.log10(few.gains[row]) == pytest.approx(levels[same], abs=0.1)


def test_each_path_and_its_reverse_become_one_of_twice_the_amplitude() -> None:
    paths = find_paths(ARENA, HERE, SEARCH)
    together = with_reverses(paths, BOARD)
    assert with_reverses(paths, replace(BOARD, sum_arrivals=False)) is paths
    ways = [together.via(row, ARENA) for row in range(len(together))]
    assert {frozenset((way, way[::-1])) for way in ways} == {
        frozenset((way, way[::-1])) for way in (paths.via(row, ARENA) for row in range(len(paths)))
    }
    assert len({frozenset((way, way[::-1])) for way in ways}) == len(ways) < len(paths)
    alone = {paths.via(row, ARENA): paths.gains[row] for row in range(len(paths))}
    for row, way in enumerate(ways):
        # a path that retraces itself is its own reverse, also through a right-angle corner
        itself = np.allclose(together.leaving[row], together.arriving[row], atol=1e-9)
        assert together.gains[row] == pytest.approx(alone[way] * (1 if itself else 2))
        assert itself or way[::-1] in alone


def test_paths_to_a_separate_listener_equal_those_of_a_search() -> None:
    here, aside = find_paths(ARENA, HERE, SEARCH), find_paths(ARENA, HERE, SEARCH, THERE)
    one = echo_paths(here, ARENA, [], [])
    for row, other in same_paths(here, aside):
        x, y, bx, by = displaced(one.out[row], one.back[row], one.turn[row], one.kind[row], (0.0, 0.0), BY)
        assert math.hypot(x, y) + math.hypot(bx, by) == pytest.approx(aside.lengths[other], abs=1e-12)


def test_only_the_legs_to_the_edge_of_a_bent_path_change_when_sender_and_listener_move() -> None:
    out, back, unused = np.array([1.0, 2.0]), np.array([3.0, 5.0]), np.array([0.6, 0.8])
    found = displaced(out, back, unused, BENT, (0.1, 0.3), (0.5, 0.9))
    assert found == pytest.approx((0.9, 1.7, 2.5, 4.1))


@compiled
def legs(
    one: tuple[float, float, float, float], rise: FloatArray, turn: FloatArray, kind: int
) -> tuple[float, float, float, float]:
    return _legs(one, rise, turn, kind)


def test_legs_in_space_have_the_lengths_of_pythagoras() -> None:
    """A leg of 3, 4 and 12 m, and one of 1, 2 and 2 m."""
    one, rise, turn = (3.0, 4.0, 1.0, 2.0), np.array([12.0, 2.0]), np.array([1.0, 0.0])
    assert legs(one, rise, turn, BENT) == pytest.approx((13.0, 3.0, 1 / 3, 2 / 3))
    assert legs(one, rise, turn, EVEN) == pytest.approx((13.0, 0.0, -3 / 13, -4 / 13))


def test_a_post_reflects_along_its_radius_before_and_after_an_edge() -> None:
    posts = [(0.5, 0.4, 0.05), (0.1, 0.9, 0.03)]
    room = room_of([(0.0, -1.0, 0.0, 1.5), (0.6, 1.2, 0.9, 1.2)], posts)
    paths = find_paths(room, (0.9, 0.6), PathSearch(6.0, SEARCH.wavelength, faintest_diffraction=1e-6))
    seen = set()
    normals = _touched_normals(paths, left_normals(room.walls))
    for path in np.flatnonzero(paths.edges >= 0).tolist():
        points = paths.outline(path)[1:-1]
        touches = np.delete(points, paths.bends[path], axis=0)
        surfaces = paths.surfaces[path]
        for k, (column, touch) in enumerate(zip(np.flatnonzero(surfaces >= 0), touches, strict=True)):
            if (surface := surfaces[column]) >= 2:
                x, y, radius = posts[surface - 2]
                normal = normals[path, column]
                assert (normal.real, normal.imag) == pytest.approx((touch - (x, y)) / radius, abs=1e-6)
                seen.add(k - int(paths.bends[path]))
    assert {-1, 0} <= seen  # the last before the edge, and the first after it


@compiled
def late(over: float, lateness: FloatArray) -> float:
    return _late(over, lateness)


def test_lateness_between_levels_is_interpolated_and_constant_beyond() -> None:
    table = np.array([0.05, 0.03, 0.02, 0.018])  # at 0, 0.5, 1 and 1.5 dB
    levels = [-3.0, 0.0, 0.25, 0.5, 0.6, 1.0, 1.25, 1.499]
    expected = np.interp(levels, [0.0, 0.5, 1.0, 1.5], table)
    assert [late(level, table) for level in levels] == pytest.approx(expected.tolist(), abs=1e-5)
    assert late(99.0, table) == pytest.approx(0.018, abs=1e-5)
    assert late(1.0, np.empty(0)) == 0.0


def test_paths_after_moves_of_walls_equal_those_of_a_new_search() -> None:
    shifts = {"divider": 0.013, "east": -0.021, "south": 0.017}
    room = with_shifted_walls(ARENA, shifts)
    here, there = find_paths(ARENA, HERE, SEARCH), find_paths(room, HERE, SEARCH)
    one, by = echo_paths(here, ARENA, [], list(shifts)), np.array(list(shifts.values()))
    out, back = one.out + one.out_by_wall @ by, one.back + one.back_by_wall @ by
    pairs = same_paths(here, there, room)
    assert len(pairs) > 0.7 * len(there)
    assert {0, 1} <= {int(here.bends[row]) for row, _ in pairs if here.edges[row] >= 0}
    for row, other in pairs:
        assert np.hypot(*out[row]) + np.hypot(*back[row]) == pytest.approx(there.lengths[other], abs=1e-12)
        assert out[row] / np.hypot(*out[row]) == pytest.approx(there.leaving[other], abs=1e-12)


@pytest.mark.parametrize("searched", [{}, {"reflectance:board": 0.63}, {"threshold": -41.5}, {"wall:divider": 3e-4}])
def test_the_likelihood_hardly_depends_on_where_paths_were_searched(searched: dict[str, float]) -> None:
    """Diffracted paths down to 3 dB below the threshold of the profile were too few: log-likelihoods fell by 10."""
    board = replace(BOARD, receiver=Receiver.FIRST_ECHO)
    place = Place("", (0.8756, 0.3031), 1.8795)
    scan = synthetic_scan(
        replace(ARENA, reflectances=0.75 * ARENA.reflectances), place, replace(board, threshold_db=-42.5), 10
    )
    free = free_parameters(("threshold", "reflectance", "walls"), [""], ARENA, board)
    problem = make_problem([PlacedScan(scan, place)], ARENA, board, free, PredictionOptions(), all_echoes=True)
    true = {"threshold": -42.5, "reflectance:board": 0.675}
    values = problem.start()
    for row, parameter in enumerate(problem.parameters):
        values[row] = true.get(parameter.name, values[row])
    other = values.copy()
    for row, parameter in enumerate(problem.parameters):
        other[row] = searched.get(parameter.name, other[row])
    here, there = (problem.near(one).by_reading(values, 0) for one in (values, other))
    assert there == pytest.approx(here, abs=2.0)
    assert there.sum() == pytest.approx(here.sum(), abs=2.0)


def test_growth_by_wall_equals_the_measured_growth() -> None:
    step = 1e-4
    room = with_shifted_walls(ARENA, {"divider": step})
    here, moved_wall = find_paths(ARENA, HERE, SEARCH), find_paths(room, HERE, SEARCH)
    grown = growth_by_wall(echo_paths(here, ARENA, [], ["divider"]))[:, 0]
    pairs = same_paths(here, moved_wall, room)
    assert np.abs(grown[[row for row, _ in pairs]]).max() > 1
    for row, other in pairs:
        assert (moved_wall.lengths[other] - here.lengths[row]) / step == pytest.approx(grown[row], abs=1e-2)


def test_growth_by_wall_over_a_post_equals_the_measured_growth() -> None:
    """One path runs over the post first, then over the wall, and one in reverse; neither is symmetric."""
    step, here = 1e-5, (0.4, -0.3)

    def paths_with(offset: float) -> tuple[Paths, Room]:
        room = room_of([[-3.0, 1.0 + offset, 3.0, 1.0 + offset]], [(1.6, -0.2, 0.3)])
        return find_paths(room, here, PathSearch(12.0, 0.00696, 3, diffraction=False)), room

    (before, room), (after, _) = paths_with(0.0), paths_with(step)
    grown = growth_by_wall(echo_paths(before, room, [], ["w0"]))[:, 0]
    both = [row for row in range(len(before)) if {0, 1} <= set(before.surfaces[row].tolist())]
    assert len(both) >= 2
    for row in both:
        (other,) = [
            k
            for k in range(len(after))
            if after.surfaces[k].tolist() == before.surfaces[row].tolist()
            and abs(after.lengths[k] - before.lengths[row]) < 1e-3
            and abs(after.departures[k] - before.departures[row]) < 1e-3
        ]
        assert (after.lengths[other] - before.lengths[row]) / step == pytest.approx(grown[row], abs=1e-3)


def test_a_moving_wall_moves_its_corners() -> None:
    room = with_shifted_walls(ARENA, {"south": 0.05})
    before, after = (dict(zip(one.names, one.walls.tolist(), strict=True)) for one in (ARENA, room))
    assert after["south"] != before["south"]
    # the corner of east and south is still one point
    assert after["east"][2:] == after["south"][:2]
    assert after["divider"] == before["divider"]


def objective_of(
    room: Room,
    ranges: list[float | None],
    headings: FloatArray,
    board: Board = BOARD,
    options: PredictionOptions = PredictionOptions(),
) -> Objective:
    """Return the objective of readings with these ranges at these headings."""
    speed = room.air.speed_of_sound
    readings = [
        Reading(k, 0, 0, float(heading), 0.0, () if one is None else (2 * one / speed,), speed)
        for k, (one, heading) in enumerate(zip(ranges, headings, strict=True))
    ]
    free = free_parameters(("x",), [""], room, board)
    problem = make_problem([PlacedScan(readings, Place("", HERE))], room, board, free, options, all_echoes=True)
    return problem.near(problem.start())


@pytest.mark.parametrize(
    ("word", "value"),
    [("reflectances", 0.7), ("threshold", -37.5), ("offset", 0.01), ("aperture", 0.018), ("heading", 0.1)],
)
def test_a_likelihood_does_not_depend_on_the_values_at_which_paths_were_searched(word: str, value: float) -> None:
    headings = np.radians(np.arange(0.0, 360.0, 6.0))
    scan = predict_scan(ARENA, Place("", HERE), BOARD, headings)
    readings = [
        Reading(k, 0, 0, float(heading), 0.0, () if math.isnan(one) else (2 * one / 343.0,), 343.0)
        for k, (heading, one) in enumerate(zip(headings, scan.ranges.tolist(), strict=True))
    ]
    free = free_parameters((word,), [""], ARENA, BOARD)
    options = PredictionOptions(max_bounces=3, receiver=Receiver.FIRST_ECHO)
    problem = make_problem([PlacedScan(readings, Place("", HERE))], ARENA, BOARD, free, options, all_echoes=False)
    start = problem.start()
    other = start.copy()
    other[: len(free)] = value
    here, there = problem.near(start), problem.near(other)
    assert here(other) == pytest.approx(there(other), abs=0.3)
    assert abs(here(other) - here(start)) > 1.0


NOISE = ReadingNoise(0.004, 1.0, 0.05, 0.02, 0.05)


@pytest.mark.parametrize("heading", [0.0, 0.3, 1.9, 4.0])
def test_probabilities_of_all_ranges_and_of_silence_sum_to_one(heading: float) -> None:
    step = 2e-4
    ranges = np.arange(0.3, BOARD.max_range + 0.05, step)
    objective = objective_of(ARENA, [None, *ranges.tolist()], np.full(len(ranges) + 1, heading))
    chances = np.exp(objective.by_reading(objective.problem.with_noise(np.array([HERE[0]]), NOISE), 0))
    # strays within blanking are impossible, so only ranges after it count
    opens = BOARD.blanked_range(ARENA.air)
    assert chances[0] + chances[1:][ranges > opens].sum() * step == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("first", "second"), [(-2.0, -3.0), (-1.0, -9.0), (-8.0, -1.0), (1.0, 1.0)])
def test_silence_of_two_paths_together_has_the_probability_that_random_phases_give(first: float, second: float) -> None:
    random, spread = np.random.default_rng(3), 0.5
    phases = np.exp(1j * random.uniform(0, math.tau, 400_000))
    amplitudes = 10 ** (first / 20) + 10 ** (second / 20) * phases
    together = 20 * np.log10(np.abs(amplitudes)) + random.normal(0, spread, len(phases)) < 0
    # the second path begins an arrival too, which is detected by itself
    alone = second + random.normal(0, spread, len(phases)) < 0

    ahead = np.array([[2.0, 0.0], [2.003, 0.0]])
    paths = PathArrays(
        ahead,
        np.zeros((2, 2)),
        np.zeros((2, 2)),
        np.tile((-1.0, 0.0), (2, 1)),
        np.array([ODD, ODD], np.int8),
        np.array([2, 2]),
        np.array([first, second]),
    )
    silent = ScanArrays(np.zeros(1), np.full((1, 1), np.nan), np.zeros(1, np.int64), np.zeros(1, np.bool_))
    board = BoardValues(0.0, 1.0, 17.0, 0.0, 0.1, 10.0, 0.0, 1.0, 0.0, (0.0, 0.0), (0.0, 0.0))
    noise = ReadingNoise(0.001, spread, 0.0, 1e-9, 1e-9)
    found = log_likelihoods(silent, paths, (0.0, 0.0), board, noise, beam_table(17.0), np.empty(0))
    assert math.exp(found[0]) == pytest.approx(together.mean() * alone.mean(), abs=0.06)


def test_only_a_receiver_that_adds_arrivals_adds_those_within_a_wavelength() -> None:
    headings, options = np.zeros(1), PredictionOptions(receiver=Receiver.FIRST_ECHO)
    objective = objective_of(ARENA, [None], headings, options=options)
    lengths, rows = objective._lengths[0], np.arange(len(objective.paths[0].until))
    assert objective.paths[0].until.tolist() == [
        int((lengths <= length + BOARD.wavelength(ARENA.air)).sum()) for length in lengths
    ]
    assert (objective.paths[0].until > rows + 1).any()
    single = replace(BOARD, sum_arrivals=False)
    for board, receiver in ((single, Receiver.FIRST_ECHO), (BOARD, Receiver.BOARD)):
        alone = objective_of(ARENA, [None], headings, board, replace(options, receiver=receiver)).paths[0].until
        assert alone.tolist() == list(range(1, len(alone) + 1))


def test_silence_is_likely_exactly_where_the_model_predicts_it() -> None:
    headings = np.arange(72) * math.tau / 72
    near = replace(BOARD, max_range=1.25)
    ranges = predict_scan(ARENA, Place("", HERE), near, headings).ranges
    objective = objective_of(ARENA, [None] * 72, headings, near)
    values = objective.problem.with_noise(np.array([HERE[0]]), NOISE)
    silences = objective.by_reading(values, 0)
    assert 10 < np.isnan(ranges).sum() < 62
    assert np.median(silences[np.isnan(ranges)]) > np.median(silences[~np.isnan(ranges)]) + 2


@pytest.mark.parametrize("mount", [Mount(ahead=0.08, aside=0.05), Mount(ahead=0.05, aside=-0.06, separation=0.06)])
def test_echoes_of_a_head_off_the_axis_are_most_likely_with_its_own_mount(mount: Mount) -> None:
    headings = np.arange(72) * math.tau / 72
    board = replace(BOARD, mount=mount)
    ranges = predict_scan(ARENA, Place("", HERE), board, headings).ranges
    readings = [None if math.isnan(one) else float(one) for one in ranges]
    mirrored, nearer = (mount.model_copy(update=change) for change in ({"aside": -mount.aside}, {"ahead": 0.0}))
    medians = []
    for one in (mount, mirrored, nearer):
        objective = objective_of(ARENA, readings, headings, replace(BOARD, mount=one))
        likelihoods = objective.by_reading(objective.problem.with_noise(np.array([HERE[0]]), NOISE), 0)
        medians.append(np.median(likelihoods[~np.isnan(ranges)]))
    # an exact range has the density 1 / (4 mm √2π), a wrong one that of strays
    assert medians[0] == pytest.approx(math.log(1 / (0.004 * math.sqrt(math.tau))), abs=0.5)
    assert max(medians[1:]) < medians[0] - 2


def test_late_detection_by_the_receiver_is_part_of_the_expected_range() -> None:
    headings = np.arange(72) * math.tau / 72
    options = PredictionOptions(receiver=Receiver.BOARD)
    board = replace(BOARD, integration_cycles=64.0)  # detects faint echoes several centimetres late
    ranges = predict_scan(ARENA, Place("", HERE), board, headings, options).ranges
    readings = [None if math.isnan(one) else float(one) for one in ranges]
    medians = []
    for receiver in Receiver:
        objective = objective_of(ARENA, readings, headings, board, replace(options, receiver=receiver))
        likelihoods = objective.by_reading(objective.problem.with_noise(np.array([HERE[0]]), NOISE), 0)
        medians.append((float(np.median(likelihoods[~np.isnan(ranges)])), receiver))
    assert max(medians)[1] is Receiver.BOARD
    assert max(medians)[0] > min(medians)[0] + 2
