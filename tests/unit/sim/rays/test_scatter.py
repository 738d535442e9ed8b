"""Rough surfaces return sound at oblique incidence by Lambert's law, and conserve energy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from sonarhw_sim.board.profile import board_names, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan, path_amplitudes, strengths
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.rays.paths import PATCH, Paths, PathSearch, find_paths, patch_gain, scattered_paths
from sonarhw_sim.room.room import Place, Room, parse_room, with_material

from tests.fixtures.rooms_for_tests import room_of

WAVELENGTH = 0.00696
SEARCH = PathSearch(20.0, WAVELENGTH, diffraction=False)


def wall_room(scatter: float, *, reflectance: float = 0.8, half: float = 200.0, post: bool = False) -> Room:
    """Return a room with a wall along y = 1, `half` to both sides, or a post of radius 0.3 with its near side there."""
    far = f"points = [[{-half}, {50.0 if post else 1.0}], [{half}, {50.0 if post else 1.0}]]"
    pillar = '[[posts]]\nname = "post"\ncenter = [0.0, 1.3]\nradius = 0.3\nmaterial = "carpet"' if post else ""
    return parse_room(
        f"""
        name = "carpet"
        [materials.carpet]
        reflectance = {reflectance}
        scatter = {scatter}
        [[walls]]
        name = "wall"
        edges = ["wall"]
        {far}
        material = "carpet"
        {pillar}
        """,
        "carpet",
    )


def predicted(room: Room, position: tuple[float, float], degrees: float) -> PredictedScan:
    board = load_board("polaroid-6500")
    return predict_scan(room, Place("here", position), board, np.array([math.radians(degrees)]))


def returned_power(patches: Paths, lower: float, upper: float) -> float:
    among = (patches.departures > lower) & (patches.departures < upper)
    return float((patches.gains[among] ** 2).sum())


def test_patches_together_return_the_integral_along_the_wall() -> None:
    # integral along the wall: power on dx, scattered by Lambert's law, relative to a mirror
    def of_mirror(x: float) -> float:
        distance = math.hypot(x, 1.0)
        cosine = 1.0 / distance
        falls_on = cosine / (math.tau * distance)
        comes_back = falls_on * (cosine / 2) / distance
        return comes_back * 4 * math.pi * distance

    patches = scattered_paths(wall_room(0.4), (0.0, 0.0), SEARCH)
    for lower, upper in ((10.0, 50.0), (60.0, 120.0), (92.0, 140.0)):
        left, right = (1.0 / math.tan(math.radians(angle)) for angle in (upper, lower))
        integral = 0.8**2 * 0.4 * quad(of_mirror, left, right)[0]
        assert returned_power(patches, *np.radians([lower, upper])) == pytest.approx(integral, rel=0.08)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 100.0, 200.0, 300.0])
def test_patches_of_a_wall_in_any_direction_have_the_gain_of_their_incidence(degrees: float) -> None:
    """The wall is 1 m away, so a patch at a distance of r has a cosine of incidence of 1/r."""
    towards = complex(math.cos(math.radians(degrees)), math.sin(math.radians(degrees)))
    start, end = towards * (1 - 3j), towards * (1 + 2j)
    room = room_of([(start.real, start.imag, end.real, end.imag)], reflectances=[0.8])
    room = replace(room, scattered=np.array([0.8]))
    for side in (1, -1):  # of the wall
        place = towards - side * towards
        patches = scattered_paths(room, (place.real, place.imag), SEARCH)
        assert len(patches) > 50
        halves = patches.lengths / 2
        gains = 0.8 * patch_gain(1 / halves, halves, halves, np.full(len(halves), PATCH))
        # patches of a sector have equal widths, a little less than the widest
        assert patches.gains == pytest.approx(gains, rel=0.05)


def test_patch_on_a_post_uses_its_curved_face() -> None:
    patches = scattered_paths(wall_room(0.4, post=True), (0.0, 0.0), SEARCH)
    assert len(patches) > 8
    for k in range(len(patches)):
        _, touch, _ = patches.outline(k)
        normal = (touch - (0.0, 1.3)) / 0.3
        cosine = float(-normal @ touch / np.hypot(*touch))
        assert patches.gains[k] == pytest.approx(0.8 * math.sqrt(0.4 * cosine * PATCH), rel=0.02)


def test_every_patch_is_one_straight_path_there_and_back() -> None:
    room = wall_room(1.0)
    patches = scattered_paths(room, (0.0, 0.0), SEARCH)
    assert len(patches) > 60
    assert (np.diff(patches.lengths) >= 0).all()
    assert patches.lengths == pytest.approx(2 / np.sin(patches.departures))
    assert patches.arrivals == pytest.approx(patches.departures)
    assert set(patches.bounces) == {1}
    assert {patches.via(k, room) for k in range(len(patches))} == {("wall",)}
    assert (patches.lengths <= 20.0).all()


def test_specular_and_scattered_power_add_up_to_that_of_a_mirror() -> None:
    smooth, rough = wall_room(0.0), wall_room(0.36)
    assert rough.reflectances == pytest.approx(0.8 * smooth.reflectances)
    assert rough.reflectances**2 + rough.scattered**2 == pytest.approx(smooth.reflectances**2)
    assert find_paths(rough, (0.0, 0.0), SEARCH).gains == pytest.approx([0.8 * 0.8])


@pytest.mark.parametrize("name", board_names())
@pytest.mark.parametrize("scatter", [0.2, 0.6, 1.0])
def test_rough_wall_returns_no_more_power_than_a_mirror(name: str, scatter: float) -> None:
    board = load_board(name)
    for degrees in (90.0, 80.0):
        powers = []
        for room in (wall_room(0.0), wall_room(scatter)):
            scan = predict_scan(room, Place("here", (0.0, 0.0)), board, np.array([math.radians(degrees)]))
            loud = path_amplitudes(room, board, math.radians(degrees), scan.paths, strengths(room, board, scan.paths))
            powers.append(float((loud**2).sum()))
        mirrored = powers[0] if degrees == 90.0 else 0.8**2
        assert powers[1] <= mirrored


def test_rough_wall_at_45_degrees_has_a_weak_echo_and_a_mirror_none() -> None:
    # the wall 1 m ahead of 90°; along 45° it is √2 m away
    mirror, carpet = predicted(wall_room(0.0), (0.0, 0.0), 45.0), predicted(wall_room(0.5), (0.0, 0.0), 45.0)
    assert math.isnan(mirror.ranges[0])
    assert carpet.ranges[0] == pytest.approx(math.sqrt(2), rel=0.15)
    assert -40.0 <= carpet.ping(0).levels[carpet.winners[0]] <= -20.0


def test_smooth_rooms_have_no_patches() -> None:
    room = wall_room(0.0)
    assert len(scattered_paths(room, (0.0, 0.0), SEARCH)) == 0
    scan = predicted(room, (0.0, 0.0), 90.0)
    assert scan.paths.lengths.tolist() == find_paths(room, (0.0, 0.0), SEARCH).lengths.tolist()


def test_hidden_patches_and_a_sensor_inside_a_post_are_silent() -> None:
    room = wall_room(1.0, post=True)
    assert len(scattered_paths(room, (0.0, 1.3), SEARCH)) == 0
    shielded = replace(room, scattered=np.array([1.0, 0.0]))
    search, hidden = PathSearch(200.0, WAVELENGTH), math.asin(0.3 / 1.3)
    sent_from_here = scattered_paths(shielded, (0.0, 0.0), search)
    heard_here = scattered_paths(shielded, (0.0, 1.75), search, (0.0, 0.0))  # sent from behind the post
    for directions in (sent_from_here.departures, heard_here.arrivals):
        assert len(directions) > 10
        assert np.abs(directions - math.pi / 2).min() > hidden


def test_scatter_to_a_separate_receiver_is_reciprocal() -> None:
    room, here, there = wall_room(0.7), (0.0, 0.0), (0.3, 0.1)
    powers = [
        float((scattered_paths(room, source, SEARCH, receiver).gains ** 2).sum())
        for source, receiver in ((here, there), (there, here))
    ]
    assert powers[0] == pytest.approx(powers[1], rel=0.15)
    alone = scattered_paths(room, here, SEARCH)
    beside = scattered_paths(room, here, SEARCH, (1e-9, 0.0))
    assert beside.gains == pytest.approx(alone.gains, abs=1e-6)


@pytest.mark.parametrize("position", [(0.0, 1.0), (200.0, 1.0), (3.0, 1.0 - 1e-9)])
def test_sensor_on_the_rough_wall_has_finite_echoes(position: tuple[float, float]) -> None:
    patches = scattered_paths(wall_room(1.0), position, SEARCH)
    assert np.isfinite(patches.gains).all()
    assert (patches.gains <= 0.8).all()


@pytest.mark.parametrize(("reflectance", "scatter"), [(0.8, 0.0), (0.6, 0.36), (0.9, 1.0)])
def test_a_changed_material_is_the_same_as_in_the_file(reflectance: float, scatter: float) -> None:
    changed = with_material(wall_room(0.2), "carpet", reflectance, scatter)
    read = wall_room(scatter, reflectance=reflectance)
    assert changed.reflectances == pytest.approx(read.reflectances)
    assert changed.scattered == pytest.approx(read.scattered)
    # scatter is a share of the power, so both parts add up to the power of the mirror
    assert changed.reflectances**2 + changed.scattered**2 == pytest.approx([reflectance**2])
    assert changed.scattered**2 == pytest.approx([scatter * reflectance**2])
    assert with_material(changed, "brick", 0.1).reflectances.tolist() == changed.reflectances.tolist()
