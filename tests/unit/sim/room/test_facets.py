"""Pillars of many walls are distinguished from intended chains of many walls, and have almost no echoes."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Room, facets_of, load_room, parse_room

from benchmarks.cases.office import office_floor

Points = Sequence[tuple[float, float]]
BOX = [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]
MIDDLE, RADIUS = (2.0, 1.5), 0.15


def circle(walls: int, radius: float = RADIUS, middle: tuple[float, float] = MIDDLE) -> list[tuple[float, float]]:
    turns = [math.tau * k / walls for k in range(walls)]
    return [(middle[0] + radius * math.cos(turn), middle[1] + radius * math.sin(turn)) for turn in turns]


def room_text(*chains: Points, place: tuple[float, float] | None = (1.0, 1.4), more: str = "") -> str:
    walls = [
        f'[[walls]]\nname = "w{k}"\npoints = {[list(point) for point in chain]}\nclosed = true\nmaterial = "m"'
        for k, chain in enumerate(chains)
    ]
    stands = [] if place is None else [f"[places.p]\nposition = {list(place)}"]
    return "\n".join(('name = "Drawn"', "[materials.m]\nreflectance = 0.95", *walls, *stands, more))


def drawn(*chains: Points, place: tuple[float, float] | None = (1.0, 1.4), more: str = "") -> Room:
    return parse_room(room_text(*chains, place=place, more=more), "drawn")


@pytest.mark.parametrize("pillar", [circle(12), circle(64), circle(64)[::-1]], ids=["12", "64", "clockwise"])
def test_a_pillar_of_many_walls_is_a_circle_with_centre_and_radius(pillar: Points) -> None:
    (found,) = facets_of(drawn(BOX, pillar))
    assert found.walls == range(4, 4 + len(pillar))
    assert found.middle == pytest.approx(MIDDLE)
    assert found.radius == pytest.approx(RADIUS)


def test_several_pillars_are_found_and_posts_are_ignored() -> None:
    post = '[[posts]]\nname = "post"\ncenter = [1.0, 0.5]\nradius = 0.2\nmaterial = "m"'
    found = facets_of(drawn(circle(20), BOX, circle(30, 0.2, (3.0, 2.0)), more=post))
    assert [one.radius for one in found] == pytest.approx([0.15, 0.2])


@pytest.mark.parametrize("middle", [(2.0, 1.5), (1.85, 1.0)], ids=["same y", "same x"])
def test_a_pillar_after_a_chain_that_ends_at_one_of_its_coordinates_is_found(middle: tuple[float, float]) -> None:
    """The chain ends at x = 2, y = 1.5, and the pillar begins 0.15 m to the right of its middle."""
    room = drawn([(2.0, 1.5), (0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)], circle(16, middle=middle))
    assert [one.middle for one in facets_of(room)] == [pytest.approx(middle)]


STAR = [point for k in range(16) for point in (circle(32, 0.2)[2 * k], circle(32, 0.15)[2 * k + 1])]
STAIRS = [(0.1 * (k // 2 + k % 2), 0.1 * (k // 2)) for k in range(30)] + [(0.0, 1.4)]


@pytest.mark.parametrize(
    "chains",
    [
        (BOX, circle(8)),
        (BOX, circle(64)[:40]),
        (BOX, STAR),
        (BOX, STAIRS),
        (BOX, [(x, 1.5 + (y - 1.5) / 2) for x, y in circle(64)]),
        (BOX, [circle(17)[5 * k % 17] for k in range(17)]),
        (circle(64, 3.0),),
        (circle(64, 3.0), [(0.5, 0.5), (1.0, 0.5), (0.7, 0.8)]),
    ],
    ids=["octagon", "round bay", "star", "stairs", "ellipse", "chords", "round room", "round room, furnished"],
)
def test_other_chains_are_not_circles(chains: Sequence[Points]) -> None:
    assert facets_of(drawn(*chains)) == ()


def test_a_circle_round_a_place_is_a_round_room() -> None:
    tower, building = circle(64, 1.0), BOX
    assert facets_of(drawn(building, tower, place=(2.1, 1.4))) == ()
    assert len(facets_of(drawn(building, tower, place=(0.5, 0.5)))) == 1


def test_a_round_room_without_places_is_not_an_object() -> None:
    table = [(0.5, 0.5), (1.0, 0.5), (0.7, 0.8)]
    assert facets_of(drawn(circle(64, 3.0), table, place=None)) == ()
    assert len(facets_of(drawn(circle(64), table, place=None))) == 1


def test_no_example_room_contains_circles_of_walls() -> None:
    for file in sorted(Path("rooms").glob("*.toml")):
        assert facets_of(load_room(file)) == (), file.name
    assert facets_of(office_floor(1000)) == ()


def test_a_post_has_echoes_and_the_same_pillar_of_walls_almost_none() -> None:
    post = f'[[posts]]\nname = "post"\ncenter = {list(MIDDLE)}\nradius = {RADIUS}\nmaterial = "m"'
    towards, board = np.array([math.atan2(0.1, 1.0)]), load_board("paper")
    (round_one,), (flat,) = (
        predict_scan(room, room.places["p"], board, towards).ranges
        for room in (drawn(BOX, more=post), drawn(BOX, circle(64)))
    )
    assert round_one == pytest.approx(math.hypot(1.0, 0.1) - RADIUS)
    assert math.isnan(flat)


def test_the_command_warns_in_one_line_with_the_replacement(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "room.toml"
    file.write_text(room_text(BOX, circle(64)))
    for command in ("simulate", "paths"):
        assert run([command, str(file), *(["--step", "90"] if command == "simulate" else [])]) == 0
        printed = capsys.readouterr()
        assert printed.err == (
            f"sonarhw: warning: {file}: walls 'w1[0]' to 'w1[63]' approximate a circle, but flat walls return almost "
            "no sound; use [[posts]] with center = [2, 1.5] and radius = 0.15\n"
        )
        assert "warning" not in printed.out
