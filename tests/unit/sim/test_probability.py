"""Probabilities of readings against closed forms, and against pings of the fake scanner with perturbed thresholds."""

import math
from dataclasses import replace
from statistics import NormalDist, median

import numpy as np
import pytest
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict import probability
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes
from sonarhw_sim.room.room import Place, Room, parse_room

from sonarhw.readings import FloatArray, Ping

PHI = NormalDist().cdf


HERE = Place("here", (0.0, 0.0))


AHEAD = np.zeros(1)


WALL = """
name = "walls"
[materials.hard]
reflectance = 0.9
[materials.soft]
reflectance = 0.2
[[walls]]
name = "far"
points = [[1.5, -0.8], [1.5, 0.8]]
material = "MATERIAL"
"""


POST = '[[posts]]\nname = "post"\ncenter = [1.0, 0.1]\nradius = 0.05\nmaterial = "hard"\n'


def room(with_post: bool = False) -> Room:
    wall = WALL.replace("MATERIAL", "soft" if with_post else "hard")
    return parse_room(wall + (POST if with_post else ""), "test")


def board(name: str = "paper", **values: float) -> Board:
    return replace(load_board(name), **({"threshold_sd_db": 2.0} | values))


def outcomes(
    where: Room, which: Board, pings: int = 1, tolerance: float = 0.0
) -> tuple[probability.PossibleReading, ...]:
    scan = probability.scan_with_fainter_paths(where, HERE, which, AHEAD)
    return probability.possible_readings(scan, 0, pings, tolerance)


@pytest.mark.parametrize("over", [-3.0, 0.5])
@pytest.mark.parametrize("name", ["paper", "lego-nxt", "polaroid-6500"])
def test_one_wall_is_heard_with_the_normal_probability_of_its_level(name: str, over: float) -> None:
    level = 20 * math.log10(0.9)  # a wall straight ahead; its ends are far fainter
    # with an ideal gain, a wall is as loud at any range
    which = replace(board(name, threshold_db=level - over), absorption=False, gain_steps=(), fixed_gain=False)
    found = outcomes(room(), which)
    assert found[0].probability == pytest.approx(PHI(over / 2.0), abs=1e-3)
    assert found[-1].range is None
    assert found[0].probability + found[-1].probability == pytest.approx(1.0, abs=1e-4)
    # a faint echo charges the board's own receiver up to the end of its burst, 54 mm of range later
    late = 0.06 if name == "polaroid-6500" else 1e-3
    assert 1.5 - 1e-3 <= (found[0].range or 0.0) <= 1.5 + late


def test_two_echoes_have_the_product_of_first_missed_and_second_heard() -> None:
    where = room(with_post=True)
    scan = predict_scan(where, HERE, board(threshold_db=-100.0), AHEAD)
    levels = scan.ping(0).levels
    first, second = (float(levels[np.abs(scan.paths.lengths - length) < 0.001].max()) for length in (1.90998, 3.0))
    threshold = first + 3.0
    which = board(threshold_db=threshold, threshold_sd_db=5.0)
    post, wall, silence = outcomes(where, which)
    heard = PHI(-3.0 / 5), PHI((second - threshold) / 5)
    assert 0.1 < heard[1] < 0.999  # else the test would show nothing
    assert post.probability == pytest.approx(heard[0], abs=1e-6)
    assert wall.probability == pytest.approx((1 - heard[0]) * heard[1], abs=2e-3)
    assert silence.probability == pytest.approx((1 - heard[0]) * (1 - heard[1]), abs=2e-3)


def test_median_of_three_outcomes_against_every_sequence_of_pings() -> None:
    chances = np.array([0.2, 0.5, 0.3])
    expected = np.zeros(3)
    for sequence in np.ndindex(3, 3, 3, 3, 3):
        expected[int(median(sequence))] += math.prod(chances[k] for k in sequence)
    assert probability.median_chances(chances, 5) == pytest.approx(expected, abs=1e-12)


def test_spread_of_a_median() -> None:
    assert probability.median_spread(1) == 1.0
    # 1 − √3/π, the variance of the median of three
    assert probability.median_spread(3) ** 2 == pytest.approx(1 - math.sqrt(3) / math.pi, rel=2e-3)
    drawn = np.median(np.random.default_rng(1).standard_normal((200_000, 5)), axis=1)
    assert probability.median_spread(5) == pytest.approx(float(drawn.std()), rel=0.01)


@pytest.mark.parametrize("name", ["paper", "polaroid-6500"])
def test_pings_of_the_fake_have_these_probabilities(name: str) -> None:
    """The fake perturbs each arrival of each ping, in both receivers; this is an independent implementation."""
    where, draws = room(with_post=True), 700
    which = board(name, threshold_db=-17.0, threshold_sd_db=4.0, range_sd=0.002)
    first, second, silence = (one for one in outcomes(where, which) if one.probability > 0.01)
    fake = RoomEchoes(where, HERE, which, 7, EXACT)
    heard: FloatArray = np.full(draws, np.nan)
    for k in range(draws):
        times = fake.receive(Ping(0.0, k, 0, 0.03, trace=False)).echo_times
        heard[k] = times[0] * where.air.speed_of_sound / 2 if times else np.nan
    error = 3.5 * 0.5 / math.sqrt(draws)
    near, far = heard[heard < 1.25], heard[heard > 1.25]
    assert len(near) / draws == pytest.approx(first.probability, abs=error)
    assert len(far) / draws == pytest.approx(second.probability, abs=error)
    assert np.isnan(heard).mean() == pytest.approx(silence.probability, abs=error)
    for one, ranges in ((first, near), (second, far)):
        assert one.range == pytest.approx(float(ranges.mean()), abs=0.002)
        assert one.spread == pytest.approx(float(ranges.std()), rel=0.2)


def test_walls_add_their_tolerance_to_the_spread() -> None:
    (wall, _) = outcomes(room(), board(threshold_db=-20.0, range_sd=0.003), 5, 0.005)
    assert wall.spread == pytest.approx(math.hypot(0.003 * probability.median_spread(5), 0.005), rel=1e-6)


def test_ranges_of_an_outcome_add_up_and_are_whole_multiples_of_the_rounding() -> None:
    rounded = replace(load_board("lego-nxt"), rounding=0.01)
    found = dict(probability.range_chances(probability.PossibleReading(0.8, 1.234, 0.006, 0), rounded))
    assert sum(found.values()) == pytest.approx(0.8)
    assert found[1.23] == pytest.approx(0.8 * (PHI(0.001 / 0.006) - PHI(-0.009 / 0.006)), rel=2e-3)
    exact = replace(load_board("paper"), rounding=0.0)
    assert dict(probability.range_chances(probability.PossibleReading(0.8, 1.234, 0.0, 0), exact)) == {1.234: 0.8}
    assert dict(probability.range_chances(probability.PossibleReading(0.2, None, 0.0, -1), exact)) == {None: 0.2}
