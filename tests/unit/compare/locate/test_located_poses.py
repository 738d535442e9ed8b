"""Poses that are found from several starts: each is reported once, and places get their probabilities."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from sonarhw_compare.drawings import draw_located
from sonarhw_compare.fit.search import Peak
from sonarhw_compare.fit.starting import Scores
from sonarhw_compare.locate import Located, Pose, _bagged, _clear, _different, _within, locate_scan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room, parse_room

from sonarhw.errors import InputError
from sonarhw.readings import Reading

ROOM = load_room("rooms/arena.toml")
SCORES = Scores(
    np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([0.0, 1.0]), np.array([[0.0, -1.0], [-2.0, -math.inf]]), 1.0
)


def top(x: float, y: float, degrees: float, score: float) -> Peak:
    """Return a maximum of the likelihood; its objective is not used here."""
    return Peak(score, np.array([x, y, math.radians(degrees), 0.0, 1.0]), None)  # type: ignore[arg-type]


def test_maxima_less_than_3_centimetres_and_10_degrees_apart_are_one_pose() -> None:
    best = top(1.0, 1.0, 359.0, 5.0)
    others = [
        top(1.0, 1.04, 359.0, 4.0),
        top(1.04, 1.0, 359.0, 3.0),
        top(1.0, 1.0, 345.0, 2.0),
        top(1.0, 1.0, 10.0, 1.0),
    ]
    same = [top(1.02, 1.02, 359.0, 4.5), top(1.0, 1.0, 8.0, 3.5), top(1.0, 1.0, 350.0, 0.5)]
    assert _different([*same, *reversed(others), best]) == [best, *others]


def located(*poses: tuple[tuple[float, float], float]) -> Located:
    """Return poses with these positions and probabilities."""
    found = tuple(Pose(position, 0.0, 0.0, share, (0.01, 0.01, 0.01)) for position, share in poses)
    return Located(ROOM, load_board("lego-nxt"), (), found, SCORES, 2.0, 1.0)


def test_a_place_has_the_share_of_the_poses_within_ten_centimetres() -> None:
    (one, (x, y)), (other, (a, b)) = [(name, place.position) for name, place in ROOM.places.items()][:2]
    found = located(((x + 0.09, y), 0.5), ((x, y - 0.05), 0.1), ((a, b), 0.2), ((x + 0.11, y), 0.2))
    shares = found.places()
    assert shares[one] == pytest.approx(0.75)
    assert shares[other] == pytest.approx(0.25)
    assert set(shares) == set(ROOM.places)
    assert found.place_near(found.poses[0]) == one
    assert found.place_near(found.poses[3]) is None
    assert set(located(((x + 0.5, y), 1.0)).places().values()) == {0.0}


def test_the_log_posterior_of_the_lattice_sums_headings_and_counts_neighbours_as_one_reading() -> None:
    first, second = located().lattice
    expected = math.log(math.exp(-2.0 / 2)) - math.log(1 + math.exp(-1.0 / 2))
    assert (first, second) == pytest.approx((0.0, expected))


def test_a_room_without_any_echo_is_refused() -> None:
    room = parse_room(
        'name = "box"\n[materials.hard]\nreflectance = 0.0\n[[walls]]\nname = "box"\nclosed = true\n'
        'material = "hard"\npoints = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.2], [0.0, 0.2]]\n',
        "box",
    )
    readings = [Reading(k, 0, 0, k * math.pi / 6, float(k), (0.003,), 343.0) for k in range(12)]
    with pytest.raises(InputError, match="no position in this room"):
        locate_scan(readings, room, load_board("polaroid-6500"))


def test_the_picture_shows_each_echo_at_its_range_from_the_best_pose() -> None:
    ranges = [0.5, None, 0.75, 1.0]
    readings = tuple(
        Reading(k, 0, 0, k * math.pi / 2, 0.0, () if r is None else (2 * r / 343.2,), 343.2)
        for k, r in enumerate(ranges)
    )
    pose = Pose((0.4, 0.3), 0.2, 0.01, 1.0, (0.01, 0.01, 0.01))
    found = Located(ROOM, load_board("lego-nxt"), readings, (pose,), SCORES, 2.0, 1.0)
    (axes, *_) = draw_located(found).axes
    (points,) = (line.get_xydata() for line in axes.lines if str(line.get_label()).startswith("scan"))
    away = [math.dist(point, pose.position) for point in np.asarray(points)]
    assert away == pytest.approx([0.51, 0.76, 1.01])
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert len(legend) == len(set(legend)) == 3


@pytest.mark.parametrize(("readings", "redundancy", "doubtful"), [(4, 2.0, True), (12, 2.0, True), (14, 2.0, False)])
def test_a_scan_with_few_independent_readings_is_doubtful(readings: int, redundancy: float, doubtful: bool) -> None:
    scan = (Reading(0, 0, 0, 0.0, 0.0, (0.003,), 343.0),) * readings
    found = Located(ROOM, load_board("lego-nxt"), scan, (), SCORES, redundancy, 1.0)
    assert [f"only {readings // 2} independent readings" in doubt for doubt in found.doubts] == [True] * doubtful


def test_the_volume_of_a_peak_is_bounded_by_the_room() -> None:
    sides = np.ptp(ROOM.walls.reshape(-1, 2), axis=0)
    bounded = _within(ROOM, np.diag([1e4, 1e4, 1e4]))
    assert np.sqrt(np.diag(bounded)) == pytest.approx(np.append(sides, math.tau) / math.sqrt(12), rel=1e-3)
    narrow = np.diag([1e-6, 4e-6, 1e-4])
    assert _within(ROOM, narrow) == pytest.approx(narrow, rel=1e-2)


def test_poses_at_which_the_sensor_touches_a_wall_are_left_out() -> None:
    free, touching = top(0.5, 1.0, 0.0, 0.0), top(0.003, 1.0, 0.0, 1.0)
    board = load_board("lego-nxt")
    assert _clear([touching, free], ROOM, board) == [free]
    assert _clear([touching], ROOM, board) == [touching]


def first_probability(differences: list[float], redundancy: float = 1.0) -> float:
    """Return the probability of the first of two equally wide peaks with these differences of log-likelihoods."""
    by_reading = (np.array(differences), np.zeros(len(differences)))
    tops = [
        Peak(float(one.sum()), np.zeros(4), SimpleNamespace(by_reading=lambda _values, _scan, one=one: one))  # type: ignore[arg-type]
        for one in by_reading
    ]
    return float(_bagged(tops, np.zeros(2), redundancy)[0])


@pytest.mark.parametrize("redundancy", [1.0, 4.0])
def test_if_all_readings_prefer_a_pose_alike_its_probability_is_that_of_their_likelihood(redundancy: float) -> None:
    assert first_probability([0.05] * 40, redundancy) == pytest.approx(1 / (1 + math.exp(-2.0 / redundancy)))


@pytest.mark.parametrize(("spread", "redundancy"), [(0.5, 1), (1.0, 1), (1.0, 4)])
def test_if_readings_contradict_each_other_a_pose_is_less_probable(spread: float, redundancy: int) -> None:
    count = 400
    blocks = 2.0 / count * redundancy + spread * np.random.default_rng(0).choice([-1.0, 1.0], count // redundancy)
    blocks += 2.0 / count * redundancy - blocks.mean()
    # each block has one difference; the sum over a sample of blocks is normal
    deviation = float(np.std(blocks)) * math.sqrt(len(blocks))
    sums = 2.0 + deviation * np.random.default_rng(1).standard_normal(100_000)
    expected = float((1 / (1 + np.exp(-sums))).mean())
    found = first_probability(np.repeat(blocks, redundancy).tolist(), redundancy)
    assert found == pytest.approx(expected, abs=0.05)
    assert found < 1 / (1 + math.exp(-2.0)) - 0.1
