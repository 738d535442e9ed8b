"""The model shows what the paper says about its figures, and each claim fails for another scene."""

import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.paper import figures
from sonarhw_compare.paper.scenes import Claim
from sonarhw_sim.air import Model, Unit
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import parse_room

PAGE = Path("docs/figures/figures.md").read_text(encoding="utf-8")
CLAIMS = [claim for exhibit in figures.EXHIBITS for claim in exhibit.claims]

NEAREST_WITH_NOISE = tuple(replace(scene, model=Model.NEAREST, seed=seed) for seed, scene in enumerate(figures.WALK))
# 0.3 m from a wall, which is within blanking
WITHIN_BLANKING = tuple(replace(scene, place=f"{scene.place.split(',')[0]},0.3") for scene in figures.WALK)
OPEN_SPACE = tuple(replace(scene, room="oblique_corner", place="near") for scene in figures.WALK)
SLANTED = tuple(replace(scene, model=Model.CONE) for scene in figures.WALK)
TOO_CLOSE_TO_THE_PERSON = tuple(replace(scene, place="3.5,1.6") for scene in figures.SCANS)
TRANSDUCER_TURNED = replace(figures.AT_45, degrees=(7.0, 8.0, 1.0))
EMPTY_TABLE = tuple(replace(scene, room="simple", place="figure9") for scene in figures.SCANS)

# each claim with a scene for which it is false: another unit, place, object, model or transducer
BROKEN: list[Callable[[], Claim]] = [
    partial(figures.nothing_returns, figures.TILTED),
    partial(figures.one_echo, figures.PARALLEL),
    partial(figures.many_echoes, replace(figures.PARALLEL, unit=Unit.PASS)),
    partial(figures.strongest_is_reflected_by_the_plate, TRANSDUCER_TURNED),
    partial(figures.near_wall_over_a_short_span, EMPTY_TABLE),
    # wide beams
    partial(figures.near_wall_over_a_short_span, tuple(replace(scene, board="hc-sr04") for scene in figures.SCANS)),
    partial(figures.near_wall_over_a_short_span, tuple(replace(scene, board="lego-nxt") for scene in figures.SCANS)),
    partial(figures.blackboard_moves_the_wall, figures.BESIDE_THE_BLACKBOARD),
    partial(figures.person_is_strong, TOO_CLOSE_TO_THE_PERSON),
    partial(figures.pillar_is_half_lost, pillar="person"),
    partial(figures.burst_off_the_axis, radius=0.016),
    partial(figures.loss_grows_to_the_first_null, radius=0.016),
    partial(figures.single_readings_are_theirs, model=lambda scene: replace(scene, model=Model.NEAREST).scan.ranges),
    # 0.5 m from an edge, which is then above the threshold
    partial(figures.single_readings_are_theirs, replace(figures.RAY_FOLLOWING, place="1.85,0.95")),
    partial(figures.several_reflections_are_missing, model=lambda scene: scene.scan.ranges),
    partial(figures.circle_of_minimum_range, figures.FIGURE_8),
    partial(figures.far_wall_is_wavy, figures.FIGURE_9),
    partial(figures.nothing_near_at_the_right, replace(figures.FIGURE_8, unit=Unit.PASS)),
    partial(figures.upper_wall_is_true, figures.FIGURE_8),
    partial(figures.lower_wall_is_false, replace(figures.FIGURE_9, unit=Unit.BLOCK)),
    partial(figures.corridor_of_twice_the_width, replace(figures.FIGURE_9, unit=Unit.BLOCK)),
    partial(figures.body_removes_the_false_wall, figures.FIGURE_9),
    partial(figures.walls_do_not_meet, figures.RIGHT),
    partial(figures.lower_is_seen_behind_upper, replace(figures.OBLIQUE, place="0.3,-0.3")),
    partial(figures.oblique_almost_unchanged, nearer=replace(figures.OBLIQUE, place="0.15,0.3")),
    partial(figures.oblique_walls_are_lost_off_the_axis, replace(figures.OBLIQUE, model=Model.NEAREST)),
    partial(figures.corner_is_a_tangential_wall, figures.OBLIQUE),
    partial(figures.hole_at_each_side, replace(figures.RIGHT, board="hc-sr04")),
    partial(figures.almost_unchanged_from_nearer, nearer=replace(figures.RIGHT, place="0.6,0.2")),
    partial(figures.right_walls_are_lost_off_the_axis, replace(figures.RIGHT, model=Model.NEAREST)),
    partial(figures.legs_of_the_reading, replace(figures.READING, unit=Unit.BLOCK)),
    partial(figures.level_is_the_product_of_reflectances, replace(figures.READING, degrees=(276.0, 277.0, 1.0))),
    partial(figures.right_at_right_angles, NEAREST_WITH_NOISE),
    partial(figures.right_at_right_angles, WITHIN_BLANKING),
    partial(figures.long_ahead_and_behind, SLANTED),
    partial(figures.long_ahead_and_behind, OPEN_SPACE),
    partial(figures.errors_are_correlated_between_headings, NEAREST_WITH_NOISE),
    partial(figures.errors_are_correlated_between_places, NEAREST_WITH_NOISE),
]

# each claim that the model does not show, with a scene for which it is true
NOT_SHOWN: list[Callable[[], Claim]] = [
    partial(figures.small_echo_vanishes, turned=TRANSDUCER_TURNED),
    partial(figures.protruding_corner_is_strong, figures.BESIDE_THE_CLOSET),
    partial(figures.very_close_at_the_right, replace(figures.FIGURE_7, place="0.45,0.345")),
    partial(figures.far_wall_is_wavy_again, figures.FIGURE_8),
]


def test_the_page_says_no_for_exactly_the_claims_that_the_model_does_not_show() -> None:
    """`test_figures_command.py` tests that the command writes this page."""
    agrees = re.findall(r"^\| .* \| (yes|\*\*no\*\*) \|$", PAGE, re.MULTILINE)
    assert agrees == ["**no**" if claim in _claims_of(NOT_SHOWN) else "yes" for claim in CLAIMS]


@pytest.mark.parametrize("broken", BROKEN, ids=lambda broken: broken.func.__name__)
def test_a_claim_fails_for_another_scene(broken: Callable[[], Claim]) -> None:
    shown = broken()
    assert not shown.holds, shown.measured


@pytest.mark.parametrize("claim", NOT_SHOWN, ids=lambda claim: claim.func.__name__)
def test_a_claim_that_the_model_does_not_show_holds_for_another_scene(claim: Callable[[], Claim]) -> None:
    shown = claim()
    assert shown.holds, shown.measured


def test_every_claim_is_tested_with_another_scene() -> None:
    assert _claims_of(BROKEN) | _claims_of(NOT_SHOWN) == set(CLAIMS)


def _claims_of(scenes: list[Callable[[], Claim]]) -> set[Callable[[], Claim]]:
    return {scene.func for scene in scenes}  # type: ignore[attr-defined]


def test_independent_model_hears_the_nearer_of_two_walls_up_to_the_critical_angle() -> None:
    """The nearer wall hides the farther one; without it, the farther one is heard. A disc of 19.2 mm, 11.0°."""
    far = "[[walls]]\nname = '2.0'\npoints = [[2.0, -1.0], [2.0, 1.0]]\nmaterial = 'm'\n"
    near = far.replace("2.0", "1.0")
    for walls, expected in ((far, 2.0), (near + far, 1.0)):
        room = parse_room("name = 'r'\n[materials.m]\nreflectance = 1.0\n" + walls, "r.toml")
        headings = np.radians([-11.2, -10.8, 0.0, 10.8, 11.2, 180.0])
        found = figures.single_reflection_ranges(room, load_board("paper"), (0.0, 0.0), headings)
        np.testing.assert_allclose(found, [np.nan, expected, expected, expected, np.nan, np.nan])


def test_pulses_of_the_beam_figure_last_as_long_as_the_burst_and_the_delay_across_the_face() -> None:
    """A burst of 16 cycles of 49.412 kHz; a face of 19.2 mm radius."""
    exhibit = next(exhibit for exhibit in figures.EXHIBITS if exhibit.name == "figure5")
    pulses = exhibit.draw().axes[0].lines
    for line, degrees in zip(pulses, (0.0, 5.0, 10.0, 17.2), strict=True):
        times, pressure = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
        heard = times[np.abs(pressure - pressure[0]) > 1e-6]
        across = 2 * 0.0192 * np.sin(np.radians(degrees)) / 343.2
        assert np.ptp(heard) == pytest.approx(1e6 * (16 / 49_412 + across), abs=1.0)
