"""Predictions against the paper's figures 7 to 9, 12 and 13, and the rule of the first echo."""

import math
from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from sonarhw_sim.air import Model, Receiver, Unit, absorption
from sonarhw_sim.board.beam import beam, beam_gain, beam_table
from sonarhw_sim.board.profile import Mount, board_names, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, predict_with
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import FloatArray
from tests.fixtures.rooms_for_tests import room_of

ROOM = load_room("rooms/simple.toml")
PAPER = load_board("paper")


def predict(place: str, *degrees: float, unit: Unit = Unit.PASS) -> PredictedScan:
    return predict_scan(ROOM, ROOM.places[place], PAPER, np.radians(degrees), PredictionOptions(unit=unit))


@pytest.mark.parametrize(
    ("heading", "distance", "via"),
    [
        (90, 0.657, ("top",)),
        (270, 0.827, ("bottom", "top", "bottom")),  # the false wall of figure 9
        (140, math.hypot(0.774, 0.657), ("top", "left")),  # the upper left corner, as a wall
    ],
)
def test_figure_9(heading: float, distance: float, via: tuple[str, ...]) -> None:
    scan = predict("figure9", heading)
    assert scan.ranges[0] == pytest.approx(distance, abs=1e-9)
    assert scan.paths.via(int(scan.winners[0]), ROOM) == via


def test_near_wall_of_figure_9_lies_within_blanking() -> None:
    blanked = predict("figure9", 270).ping(0).blanked_echoes
    assert blanked[0].range == pytest.approx(0.085)


def test_figure_8_reads_past_the_unit_only_if_sound_passes_it() -> None:
    passing, blocking = predict("figure7", 0), predict("figure7", 0, unit=Unit.BLOCK)
    assert passing.ranges[0] == pytest.approx(1.022)
    assert passing.paths.via(int(passing.winners[0]), ROOM) == ("right", "left", "right")
    assert not any(echo.range == pytest.approx(1.022) for echo in blocking.ping(0).echoes)


@pytest.mark.parametrize("place", ["figure12", "figure13"])
def test_right_angle_corner_is_a_wall_with_one_hole_at_each_side(place: str) -> None:
    room = load_room("rooms/right_corner.toml")
    scan = predict_scan(room, room.places[place], PAPER, np.radians(np.arange(-30, 120, 3.0)))
    corner = next(k for k in range(len(scan.paths)) if len(scan.paths.via(k, room)) == 2)
    detected = [(first >= 0, first == corner) for first in scan.winners]
    runs = [key for key, _ in groupby(detected)]
    at = runs.index((True, True))
    assert runs[at - 2 : at + 3] == [(True, False), (False, False), (True, True), (False, False), (True, False)]
    reach = math.dist(room.places[place].position, (0.8, 0.8))
    assert np.nanmax(np.abs(scan.ranges[scan.winners == corner] - reach)) < 1e-9


def test_no_echo_within_blanking_beyond_the_range_or_below_the_threshold() -> None:
    board = replace(PAPER, max_range=1.5)
    scan = predict_scan(ROOM, ROOM.places["figure9"], board, np.radians(np.arange(0, 360, 1.0)))
    ranges = scan.ranges[~np.isnan(scan.ranges)]
    assert ranges.min() >= board.blanked_range(ROOM.air)
    assert ranges.max() <= 1.5
    levels = [scan.ping(k).levels[winner] for k, winner in enumerate(scan.winners) if winner >= 0]
    assert min(levels) >= board.threshold_db
    assert np.isnan(scan.ranges).any()


def test_first_echo_is_the_earliest_detected_one() -> None:
    scan = predict("figure9", *range(0, 360, 7))
    for k in range(len(scan.headings)):
        echoes = scan.ping(k).echoes
        assert [e.range for e in echoes] == pytest.approx(sorted(e.range for e in echoes), abs=1e-12)
        if echoes:
            assert scan.ranges[k] == echoes[0].range


def test_board_that_rounds_reports_whole_centimetres() -> None:
    board = load_board("lego-nxt")
    scan = predict_scan(ROOM, ROOM.places["figure9"], board, np.radians(np.arange(0, 360, 10.0)))
    centimetres = scan.ranges[~np.isnan(scan.ranges)] * 100
    assert centimetres == pytest.approx(np.round(centimetres))


def test_dry_air_is_louder_but_not_on_paper() -> None:
    dry = replace(ROOM, air=replace(ROOM.air, relative_humidity=0.1))
    for name, louder in (("polaroid-6500", True), ("paper", False)):
        board = load_board(name)
        usual, drier = (predict_scan(r, r.places["figure9"], board, np.array([math.pi / 2])) for r in (ROOM, dry))
        assert (drier.ping(0).levels[3] > usual.ping(0).levels[3] + 0.5) == louder


def test_fixed_gain_leaves_spreading_and_absorption_in_the_level() -> None:
    board = replace(load_board("hc-sr04"), fixed_gain=True)
    for ahead in (0.25, 0.5, 1.0, 2.0):
        room = room_of(np.array([[ahead, -5.0, ahead, 5.0]]))
        scan = predict_scan(room, Place("here", (0.0, 0.0)), board, np.zeros(1))
        length = 2 * ahead
        lost = 20 * math.log10(length) + absorption(board.frequency, room.air) * (length - 1)
        assert scan.ping(0).echoes[0].level_db == pytest.approx(20 * math.log10(room.reflectances[0]) - lost, abs=1e-9)


def test_search_heading_by_heading_finds_all_echoes_with_a_fixed_gain() -> None:
    board = replace(load_board("hc-sr04"), fixed_gain=True, threshold_db=-16.0)
    off_axis = replace(board, mount=Mount(ahead=1e-9))
    arena, headings = load_room("rooms/arena.toml"), np.radians(np.arange(0, 360, 11.0))
    together, by_heading = (predict_scan(arena, arena.places["p1"], b, headings) for b in (board, off_axis))
    assert by_heading.ranges == pytest.approx(together.ranges, abs=1e-6, nan_ok=True)
    assert 3 < np.isnan(together.ranges).sum() < len(headings) / 2


def test_included_boards_load() -> None:
    assert {"polaroid-6500", "paper", "lego-nxt", "hc-sr04"} <= set(board_names())
    assert all(load_board(name).name == name for name in board_names())


def test_baseline_models_of_the_paper() -> None:
    place, headings = ROOM.places["figure9"], np.radians([140.0, 170.0, 168.0])
    nearest = predict_with(Model.NEAREST, ROOM, place, PAPER, headings)
    assert nearest.ranges[1:] == pytest.approx([0.774 / math.cos(math.radians(away)) for away in (10, 12)])
    cone = predict_with(Model.CONE, ROOM, place, PAPER, headings)
    assert cone.ranges[1:] == pytest.approx([0.774] * 2, abs=1e-4)
    single = predict_with(Model.KUC_SIEGEL, ROOM, place, PAPER, headings)
    assert single.paths.bounces.max() == 1
    assert math.isnan(single.ranges[0])  # a corner needs a second reflection


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


def test_winner_is_the_first_of_the_echoes_whatever_the_unit() -> None:
    for unit in Unit:
        scan = predict("figure7", *range(0, 360, 3), unit=unit)
        firsts = [echoes[0].path if (echoes := scan.ping(k).echoes) else -1 for k in range(len(scan.headings))]
        assert scan.winners.tolist() == firsts


def test_noise_depends_on_the_heading_only_and_is_the_same_after_a_full_turn() -> None:
    options = PredictionOptions(noise=0.01, receiver=Receiver.BOARD)
    board = load_board("polaroid-6500")

    def noise(*headings: float) -> list[FloatArray]:
        scan = predict_scan(ROOM, ROOM.places["figure9"], board, np.array(headings), options)
        quiet = replace(scan, noise=0.0)
        return [
            np.asarray(scan.ping(k).signal(0.02).envelope().samples - quiet.ping(k).signal(0.02).envelope().samples)
            for k in range(len(headings))
        ]

    (alone,), (first, other, turned) = noise(0.5), noise(0.5, 0.5001, 0.5 + math.tau)
    assert np.abs(alone).max() > 0.001
    np.testing.assert_allclose(first, alone, atol=1e-12)
    np.testing.assert_allclose(turned, alone, atol=1e-9)
    assert abs(np.corrcoef(other, alone)[0, 1]) < 0.5
