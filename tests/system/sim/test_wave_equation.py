"""Paths have the arrivals of the wave equation, and their strengths; before that, its own answers are held to laws."""

import math

import numpy as np
import pytest
from scipy.special import hankel1
from sonarhw_sim.choices import EdgeStrength

from tests.oracles.wave_equation import CELL, FLAT_WALL, STEP, WAVELENGTH, Scene, arrival_near, direct, echoes
from tests.oracles.wave_scenes import CORNERS, DIFFRACTED, PLATES, REFLECTED, differences, unexplained


def decibels(ratio: float) -> float:
    return 20 * math.log10(ratio)


def test_flat_wall_answers_as_its_image_would() -> None:
    image = direct((2 * 0.2405, 0.0))
    assert echoes(FLAT_WALL) == pytest.approx(image, abs=2e-4 * np.abs(image).max())


def test_burst_spreads_as_from_a_line_source() -> None:
    near, far = (_carrier(direct((cells * CELL, 0.0))) for cells in (120, 400))
    wavenumber = 2 * math.pi / WAVELENGTH
    closed_form = abs(hankel1(0, wavenumber * 0.4) / hankel1(0, wavenumber * 0.12))
    assert decibels(abs(far / near) / closed_form) == pytest.approx(0.0, abs=0.1)


def _carrier(heard: np.ndarray) -> complex:
    lengths = np.arange(len(heard)) * STEP
    return complex(heard @ np.exp(2j * math.pi * lengths / WAVELENGTH))


def test_oblique_wall_answers_as_a_level_one() -> None:
    c, s = math.cos(math.radians(30)), 0.5
    wall = (0.2405 * c + 9 * s, 0.2405 * s - 9 * c, 0.2405 * c - 9 * s, 0.2405 * s + 9 * c)
    arrival = arrival_near(Scene("oblique wall", (wall,), solids=((0,),)), 0.481)
    assert arrival.length == pytest.approx(0.481, abs=0.1 * WAVELENGTH)
    assert decibels(arrival.strength) == pytest.approx(0.0, abs=0.2)


def test_border_of_the_grid_is_not_heard() -> None:
    heard = direct((0.0, 0.0))
    assert np.abs(heard[len(heard) // 2 :]).max() < 1e-4 * np.abs(heard).max()


@pytest.mark.parametrize("scene", REFLECTED, ids=lambda scene: scene.name)
def test_reflected_sound_arrives_as_its_paths_say(scene: Scene) -> None:
    arrivals = differences(scene)
    assert arrivals
    for arrival in arrivals:
        assert abs(arrival.cycles) < 0.2
        assert abs(arrival.decibels) < 0.5


def test_right_angle_corner_is_as_strong_as_a_wall_once() -> None:
    corner = differences(REFLECTED[2])[-1]
    assert corner.via == "w0>w1"
    assert decibels(corner.found.strength) == pytest.approx(0.0, abs=0.3)


@pytest.mark.parametrize("scene", DIFFRACTED, ids=lambda scene: scene.name)
def test_edges_bend_sound_as_keller_says(scene: Scene) -> None:
    arrivals = differences(scene, EdgeStrength.KELLER)
    assert any(arrival.bent for arrival in arrivals)
    for arrival in arrivals:
        assert abs(arrival.cycles) < 0.2
        assert abs(arrival.decibels) < 1.0


@pytest.mark.parametrize("scene", PLATES, ids=lambda scene: scene.name)
def test_papers_factor_is_right_for_plates_to_the_spread_of_their_angles(scene: Scene) -> None:
    # physics.md: -20 to -36 dB where the factor says -33; farther round than 120°, less
    (bent,) = [arrival for arrival in differences(scene) if arrival.bent]
    assert -11 < bent.decibels < 13
    assert bent.decibels > -3 or "135" in scene.name


def test_papers_factor_is_right_for_a_box_seen_from_its_corner() -> None:
    (bent,) = differences(CORNERS[1])
    assert bent.decibels == pytest.approx(0.7, abs=0.5)


@pytest.mark.parametrize("scene", REFLECTED + DIFFRACTED, ids=lambda scene: scene.name)
def test_what_no_path_explains_is_faint(scene: Scene) -> None:
    assert decibels(unexplained(scene)) < -30
