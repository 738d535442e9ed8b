"""Edge diffraction: strength by the paper and by angle, and reflections on both sides of the edge."""

import math

import numpy as np
import pytest
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.rays.diffraction import EdgeDiffraction, edge_gain, keller
from sonarhw_sim.rays.paths import PathSearch, find_paths
from sonarhw_sim.room.room import Room, load_room

from tests.fixtures.rooms_for_tests import polygon_room
from tests.oracles.image_sources import specular_lengths

WAVELENGTH = 0.00696
FIN = '[[walls]]\nname = "fin"\npoints = [[1.0, 0.2], [1.0, -1.0]]\nmaterial = "hard"'
CEILING = [(-2.0, 1.0), (2.0, 1.0)]


def diffracted(room: Room, search: PathSearch) -> dict[tuple[str, ...], float]:
    """Return the shortest length of each sequence that contains an edge."""
    paths = find_paths(room, (0.0, 0.0), search)
    return {paths.via(int(k), room): paths.lengths[k] for k in np.flatnonzero(paths.edges >= 0)[::-1]}


def test_reflections_before_and_after_an_edge_are_found() -> None:
    lengths = diffracted(
        polygon_room(CEILING, closed=False, extra=FIN), PathSearch(5.0, WAVELENGTH, edge_strength=EdgeStrength.PAPER)
    )
    straight, mirrored = math.hypot(1.0, 0.2), math.hypot(1.0, 1.8)
    assert lengths[("fin[0]/",)] == pytest.approx(2 * straight)
    assert lengths[("w[0]", "fin[0]/")] == pytest.approx(straight + mirrored)
    assert lengths[("fin[0]/", "w[0]")] == pytest.approx(straight + mirrored)
    assert lengths[("w[0]", "fin[0]/", "w[0]")] == pytest.approx(2 * mirrored)


def test_every_diffracted_path_has_its_reverse() -> None:
    room = load_room("rooms/laboratory.toml")
    paths = find_paths(room, room.places["bench"].position, PathSearch(9.0, WAVELENGTH, faintest_diffraction=3e-3))
    rows = np.flatnonzero(paths.edges >= 0)
    listed = {(round(paths.gains[k], 9), paths.via(k, room)) for k in rows}
    assert len(rows) > 100
    assert all((gain, via[::-1]) in listed for gain, via in listed)


def test_strength_by_angle_from_a_thin_plate_is_one_and_one_over_the_cosine() -> None:
    for degrees in (100.0, 120.0, 150.0, 179.0):
        angle = math.radians(degrees)
        assert keller(angle, angle, 2.0) * math.sqrt(2) == pytest.approx(abs(1 + 1 / math.cos(angle)))


def test_corner_of_a_box_is_a_little_over_the_papers_factor_at_135_degrees() -> None:
    angle = math.radians(135)
    assert 20 * math.log10(keller(angle, angle, 1.5)) == pytest.approx(0.7, abs=0.05)


def test_right_angle_inner_corner_does_not_diffract() -> None:
    assert keller(math.radians(20), math.radians(50), 0.5) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("n", [0.7, 1.3, 1.5, 2.0])
def test_strength_is_reciprocal(n: float) -> None:
    random = np.random.default_rng(0)
    for one, other in random.uniform(0.05, n * math.pi - 0.05, (50, 2)):
        assert keller(one, other, n) == pytest.approx(keller(other, one, n))


def test_no_edge_is_louder_than_a_wall() -> None:
    room = polygon_room([(0.5, 0.0), (0.5, 1.0)], closed=False)
    for y in np.linspace(-0.02, 0.02, 9):
        search = PathSearch(2.0, WAVELENGTH, edge_strength=EdgeStrength.KELLER)
        paths = find_paths(room, (0.0, float(y)), search)
        assert paths.gains.max() <= 1.0


def test_gain_of_unequal_legs_is_that_of_their_harmonic_mean() -> None:
    assert edge_gain(0.35, 0.35, WAVELENGTH) == pytest.approx(10 ** (-33.0 / 20), rel=0.01)
    assert edge_gain(0.2, 0.6, WAVELENGTH) == pytest.approx(edge_gain(0.3, 0.3, WAVELENGTH))


@pytest.mark.parametrize("strength", EdgeStrength)
def test_no_path_above_the_faintest_is_missed(strength: EdgeStrength) -> None:
    room = load_room("rooms/arena.toml")
    place = room.places["p3"].position
    everything, louder = (
        find_paths(room, place, PathSearch(6.0, WAVELENGTH, edge_strength=strength, faintest_diffraction=faintest))
        for faintest in (1e-9, 1e-2)
    )
    rows = np.flatnonzero((everything.edges >= 0) & (everything.gains >= 1e-2))
    found = np.sort(louder.lengths[louder.edges >= 0])
    assert len(rows) > 20
    assert found == pytest.approx(np.sort(everything.lengths[rows]), abs=1e-9)


def test_longest_path_to_an_edge_just_reaches_the_faintest() -> None:
    edge_diffraction = EdgeDiffraction(WAVELENGTH, 0.01, EdgeStrength.PAPER)
    for distance in (0.95, 1.2, 1.7):
        longest = float(edge_diffraction.longest_partial(np.array([distance]))[0])
        assert edge_gain(longest, distance, WAVELENGTH) == pytest.approx(0.01)
    assert edge_diffraction.longest_partial(np.array([0.5, 2.0])).tolist() == [math.inf, 0.0]


def test_paths_to_a_receiver_elsewhere_are_those_of_image_sources() -> None:
    room = load_room("rooms/simple.toml")
    search = PathSearch(4.0, WAVELENGTH, 3, diffraction=False)
    there = find_paths(room, (0.3, 0.2), search, receiver=(0.7, 0.5))
    assert there.lengths[0] == pytest.approx(0.5)
    assert there.bounces[0] == 0
    expected = sorted(
        math.hypot(x, y)
        for i in range(-3, 4)
        for j in range(-3, 4)
        if abs(i) + abs(j) <= 3
        for x in [i * 0.928 + (0.7 if i % 2 == 0 else 0.228) - 0.3]
        for y in [j * 0.742 + (0.5 if j % 2 == 0 else 0.242) - 0.2]
        if math.hypot(x, y) <= 4.0
    )
    assert there.lengths == pytest.approx(expected)
    assert len(specular_lengths(room, (0.3, 0.2), 1)) == 4
