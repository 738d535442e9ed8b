"""The likelihood of a fit: closed forms, sums of probabilities, and independence of where paths were searched."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit import PlacedScan, free_parameters, likelihood
from sonarhw_compare.fit.objective import Objective, make_problem
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import beam_table
from sonarhw_sim.board.profile import Board, Mount, load_board
from sonarhw_sim.board.receiver import detect_echoes
from sonarhw_sim.board.signal import RATE, Arrivals, received
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import FloatArray
from tests.fixtures.predicted_readings import predicted_scan, readings_of

ARENA, LABORATORY, DOORSTEP = (load_room(name) for name in ("arena", "laboratory", "doorstep"))
BOARD = replace(load_board("polaroid-6500"), receiver=Receiver.FIRST_ECHO)
HERE = Place("", (0.9, 0.5))
NOISE = likelihood.ReadingNoise(0.004, 1.0, 0.05, 0.02, 0.05)


def objective_of(
    ranges: FloatArray, headings: FloatArray, board: Board = BOARD, receiver: Receiver = Receiver.FIRST_ECHO
) -> Objective:
    """Return the objective of readings in the arena."""
    scan = PlacedScan(readings_of(headings, ranges, ARENA.air.speed_of_sound), HERE)
    free, options = free_parameters(("x",), [""], ARENA, board), PredictionOptions(receiver=receiver)
    problem = make_problem([scan], ARENA, board, free, options, all_echoes=True)
    return problem.near(problem.start())


def by_reading(objective: Objective) -> FloatArray:
    return objective.by_reading(objective.problem.with_noise(np.array([HERE.position[0]]), NOISE), 0)


SCENES = {
    "walls": (ARENA, HERE, "south"),
    "a post": (LABORATORY, LABORATORY.places["bench"], "panel"),
    "heights": (DOORSTEP, DOORSTEP.places["robot"], "step"),
}
CHANGES = {"x": 0.012, "y": -0.012, "wall": 0.012, "reflectances": -0.25, "heading": 0.1, "offset": 0.01}
CHANGES |= {"threshold": -2.5, "aperture": -0.003, "ahead": 0.012, "aside": -0.03, "temperature": 3.0}


HARDEST = ["x", "y", "wall", "reflectances"]
CASES = (
    [("walls", word) for word in CHANGES]
    + [("a post", word) for word in HARDEST]
    + [("heights", word) for word in HARDEST[2:]]
)


@pytest.mark.parametrize(("scene", "word"), CASES)
def test_the_likelihood_does_not_depend_on_the_values_at_which_paths_were_searched(scene: str, word: str) -> None:
    room, place, moved = SCENES[scene]
    board = replace(BOARD, mount=Mount(ahead=0.01, separation=0.03) if scene == "walls" else Mount(), max_range=4.0)
    scan = predicted_scan(room, place, board, 15.0)
    free = free_parameters((f"wall:{moved}" if word == "wall" else word,), [""], room, board)
    problem = make_problem([scan], room, board, free, PredictionOptions(max_bounces=2), all_echoes=False)
    start = problem.start()
    other = start.copy()
    other[: len(free)] += CHANGES[word]
    here, there = problem.near(start), problem.near(other)
    # paths past a rim keep their place and level until they are searched again
    assert here(other) == pytest.approx(there(other), abs=1.0 if scene == "heights" else 0.3)
    assert abs(here(other) - here(start)) > 1.0


def test_several_vectors_at_once_have_the_values_of_each_alone() -> None:
    free = free_parameters(
        ("position", "heading", "threshold", "reflectance", "wall:east", "temperature"), [""], ARENA, BOARD
    )
    scan = PlacedScan(readings_of(1.2 * np.arange(5), [0.69, 0.86, math.nan, 1.2, 1.37]), HERE)
    problem = make_problem([scan], ARENA, BOARD, free, PredictionOptions(max_bounces=1, rays=720), all_echoes=False)
    start = problem.start()
    vectors = start + problem.steps * np.random.default_rng(3).normal(0.0, 0.5, (21, len(start)))
    vectors[4, problem.size - 1] = 99.0  # outside its bound
    here = problem.near(start)
    alone = [here(one) for one in vectors]
    assert here.many(vectors) == pytest.approx(alone, rel=1e-12)
    assert alone[4] == -math.inf
    assert len({round(one, 6) for one in alone if math.isfinite(one)}) >= 15


@pytest.mark.parametrize("heading", [0.3, 4.0])
def test_probabilities_of_all_ranges_and_of_silence_sum_to_one(heading: float) -> None:
    step = 2e-4
    ranges = np.append(math.nan, np.arange(0.3, BOARD.max_range + 0.05, step))
    chances = np.exp(by_reading(objective_of(ranges, np.full(len(ranges), heading))))
    # strays within blanking are impossible, so only ranges after it count
    assert chances[0] + chances[ranges > BOARD.blanked_range(ARENA.air)].sum() * step == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("first", "second"), [(-2.0, -3.0), (-1.0, -9.0), (-8.0, -1.0), (1.0, 1.0)])
def test_silence_of_two_paths_together_has_the_probability_that_random_phases_give(first: float, second: float) -> None:
    random, spread = np.random.default_rng(3), 0.5
    phases = np.exp(1j * random.uniform(0, math.tau, 100_000))
    amplitudes = 10 ** (first / 20) + 10 ** (second / 20) * phases
    together = 20 * np.log10(np.abs(amplitudes)) + random.normal(0, spread, len(phases)) < 0
    # the second path begins an arrival too, which is detected by itself
    alone = second + random.normal(0, spread, len(phases)) < 0
    paths = likelihood.PathArrays(
        np.array([[2.0, 0.0], [2.003, 0.0]]),
        np.zeros((2, 2)),
        np.zeros((2, 2)),
        np.tile((-1.0, 0.0), (2, 1)),
        np.array([likelihood.ODD, likelihood.ODD], np.int8),
        np.array([2, 2]),
        np.array([first, second]),
    )
    silent = likelihood.ScanArrays(np.zeros(1), np.full((1, 1), np.nan), np.zeros(1, np.int64), np.zeros(1, np.bool_))
    board = likelihood.BoardValues(0.0, 1.0, 17.0, 0.0, 0.1, 10.0, 0.0, 1.0, 0.0, (0.0, 0.0), (0.0, 0.0))
    noise = likelihood.ReadingNoise(0.001, spread, 0.0, 1e-9, 1e-9)
    found = likelihood.log_likelihoods(silent, paths, (0.0, 0.0), board, noise, beam_table(17.0), np.empty(0))
    assert math.exp(found[0]) == pytest.approx(together.mean() * alone.mean(), abs=0.06)


# Late detection of faint echoes and stepped gain, as whole pings through the board's own receiver have them.


OWN = load_board("polaroid-6500")
IDEAL, SPEED = replace(OWN, gain_steps=()), 343.987


def wall(distance: float, level_db: float) -> Arrivals:
    """Return the echo of one wall straight ahead."""
    return Arrivals(np.array([2 * distance / SPEED]), np.array([10 ** (level_db / 20)]), np.ones(1), np.ones(1))


def test_an_echo_is_detected_as_late_as_in_a_simulated_ping() -> None:
    table = likelihood.lateness_by_level(IDEAL, SPEED)
    assert (len(table) - 1) * likelihood.LATENESS_STEP == 40.0
    assert (np.diff(table) <= 0).all()
    for over in (0.5, 1.0, 3.0, 6.0, 12.0, 20.0, 30.0):
        ranges = detect_echoes(wall(2.0, IDEAL.threshold_db + over), IDEAL, SPEED).times * SPEED / 2
        assert ranges[0] - 2.0 == pytest.approx(table[round(over / likelihood.LATENESS_STEP)], abs=SPEED / RATE)
    # at the threshold almost the whole burst of 16 cycles of 49.4 kHz is needed
    assert table[0] > 0.7 * 16 / 49_412 * SPEED / 2


def test_the_offset_of_the_gain_is_that_of_received_echoes() -> None:
    distances = np.array([0.5, 1.0, 2.3, 4.0, 7.0])
    offsets = likelihood.level_offset_db(2 * distances, OWN, SPEED)
    for distance, offset in zip(distances.tolist(), offsets.tolist(), strict=True):
        arrives = round(2 * distance / SPEED * RATE)  # the burst rises after this sample
        stepped, ideal = (
            np.abs(received(wall(distance, -20.0), board, SPEED, 0.06, Receiver.BOARD, None).samples[arrives + 3])
            for board in (OWN, IDEAL)
        )
        # the ideal gain rises a little until then
        assert 20 * np.log10(stepped / ideal) == pytest.approx(offset, abs=0.3)
    assert np.ptp(offsets) > 1.0
    assert likelihood.level_offset_db(2 * distances, IDEAL, SPEED).tolist() == [0.0] * 5
