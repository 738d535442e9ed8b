"""Arrivals that coincide are added with their phases; the profile `paper` detects each alone."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sonarhw_sim.air import EdgeStrength, Receiver
from sonarhw_sim.board.beam import sums_of_arrivals, together
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from tests.fixtures.rooms_for_tests import room_of

BOARD = load_board("polaroid-6500")
ALONE = replace(BOARD, sum_arrivals=False)
WAVELENGTH = 0.007
HERE = Place("here", (0.0, 0.0))


def corner(opening_deg: float, distance: float = 1.0, from_floor_deg: float = 20.0) -> Room:
    """Return two long walls with air between them; the place is `distance` from the vertex."""
    towards = math.radians(from_floor_deg)
    x, y = -distance * math.cos(towards), -distance * math.sin(towards)
    opening = math.radians(opening_deg)
    return room_of([(x, y, x + 3.0, y), (x, y, x + 3.0 * math.cos(opening), y + 3.0 * math.sin(opening))])


def scan_at(room: Room, heading: float, board: Board = BOARD, **options: Any) -> PredictedScan:
    return predict_scan(room, HERE, board, np.array([heading]), PredictionOptions(**options))


def test_path_and_its_reverse_are_6_db_louder_than_one_of_them() -> None:
    room = corner(60.0)
    everything = scan_at(room, 0.0)
    pair = [
        k for k in range(len(everything.paths)) if everything.paths.bounces[k] == 2 and everything.paths.edges[k] < 0
    ]
    assert len(pair) == 2
    assert everything.paths.lengths[pair[0]] == pytest.approx(everything.paths.lengths[pair[1]])
    heading = float(np.angle(np.exp(1j * everything.paths.departures[pair]).sum()))
    both, alone = scan_at(room, heading), scan_at(room, heading, ALONE)
    row = next(k for k in range(len(both.paths)) if both.paths.bounces[k] == 2 and both.paths.edges[k] < 0)
    assert both.ping(0).levels[row] - alone.ping(0).levels[row] == pytest.approx(20 * math.log10(2), abs=0.05)


@pytest.mark.parametrize(("sequence", "opening"), [(("w0", "w1"), 90.0), (("w0", "w1", "w0"), 45.0)])
def test_path_that_retraces_itself_counts_once(sequence: tuple[str, ...], opening: float) -> None:
    room = corner(opening, 0.8, 15.0)
    paths = scan_at(room, 0.0).paths
    rows = [k for k in range(len(paths)) if paths.via(k, room) in (sequence, sequence[::-1])]
    assert len(rows) == 1
    towards = float(paths.departures[rows[0]])
    both, alone = scan_at(room, towards), scan_at(room, towards, ALONE)
    row = next(k for k in range(len(both.paths)) if both.paths.via(k, room) == sequence)
    assert both.ping(0).levels[row] == pytest.approx(alone.ping(0).levels[row], abs=0.01)


def test_reading_is_that_of_the_loudest_of_its_arrival_and_has_the_level_of_the_sum() -> None:
    # an edge 1 mm of path before the wall is over the threshold only because the wall is
    room = room_of([(1.0, -2.0, 1.0, 2.0), (0.9985, 0.05, 0.9985, 2.0)])
    scan = scan_at(room, 0.0, receiver=Receiver.FIRST_ECHO)
    paths = scan.paths
    assert paths.via(0, room) == ("w1/",)
    assert paths.via(int(scan.winners[0]), room) == ("w0",)
    assert scan.distances[0] == pytest.approx(1.0)
    echo = scan.ping(0).echoes[0]
    assert echo.path == scan.winners[0]
    assert scan.ping(0).level_of_reading == pytest.approx(echo.level_db)


@pytest.mark.parametrize(("apart", "sums"), [(0.0, (2, 2)), (0.25, (2**0.5, 1)), (0.5, (0, 1)), (1.01, (1, 1))])
def test_sum_depends_on_the_difference_of_the_paths_in_wavelengths(apart: float, sums: tuple[float, float]) -> None:
    lengths = 2.0 + np.array([0.0, apart]) * WAVELENGTH
    added, _ = sums_of_arrivals(np.ones(2), together(lengths, np.zeros(2), WAVELENGTH, BOARD))
    assert added == pytest.approx(sums, abs=1e-9)
    alone, _ = sums_of_arrivals(np.ones(2), together(lengths, np.zeros(2), WAVELENGTH, ALONE))
    assert alone == pytest.approx([1, 1])


def test_a_sum_has_signs_and_the_first_of_equals_is_the_loudest() -> None:
    lengths = np.array([2.0, 2.0, 2.001])
    added, loudest = sums_of_arrivals(np.array([0.3, -0.7, 0.0]), together(lengths, np.zeros(3), WAVELENGTH, BOARD))
    assert added == pytest.approx([0.4, 0.4, 0.0])
    assert loudest.tolist() == [1, 1, 2]
    _, loudest = sums_of_arrivals(np.array([1.0, 1.0, -1.0]), together(lengths, np.zeros(3), WAVELENGTH, BOARD))
    assert loudest.tolist() == [0, 0, 2]


def test_whole_scan_is_that_of_its_levels() -> None:
    room = load_room("rooms/laboratory.toml")
    headings = np.radians(np.arange(0.0, 360.0, 7.0))
    options = PredictionOptions(receiver=Receiver.FIRST_ECHO)
    scan = predict_scan(room, room.places["bench"], BOARD, headings, options)
    for k in range(len(headings)):
        echoes = scan.ping(k).echoes
        assert scan.winners[k] == (echoes[0].path if echoes else -1)
        if echoes:
            assert scan.ping(k).level_of_reading == pytest.approx(echoes[0].level_db)


def test_profile_of_the_paper_detects_each_path_alone() -> None:
    for name in ("paper", "paper-b12"):
        board = load_board(name)
        assert board.edge_strength is EdgeStrength.PAPER
        assert not board.sum_arrivals
    assert BOARD.edge_strength is EdgeStrength.UNIFORM
    room = corner(60.0)
    alone = scan_at(room, 0.3, load_board("paper"))
    amplitudes = alone.paths.gains
    levels = alone.ping(0).levels
    assert (levels <= 20 * np.log10(amplitudes) + 1e-9).all()


def test_option_is_stronger_than_the_profile() -> None:
    room = room_of([(1.0, -9.0, 1.0, -0.03)])
    quiet = scan_at(room, 0.0, edge_strength=EdgeStrength.PAPER)
    uniform = scan_at(room, 0.0, load_board("paper"), edge_strength=EdgeStrength.UNIFORM)
    assert uniform.ping(0).level_of_reading == pytest.approx(-12.2, abs=1.0)  # 0.6 dB of it by the beam
    assert quiet.winners[0] == -1 or quiet.ping(0).level_of_reading < -30


def test_trace_adds_the_edges_with_their_phase() -> None:
    """The peak of the trace of a strip is the level that the Fresnel integral gives."""
    endless = scan_at(room_of([(1.0, -9.0, 1.0, 9.0)]), 0.0).ping(0).signal(0.008)
    for width, level in ((0.01, -15.4), (0.04, -3.4)):
        strip = scan_at(room_of([(1.0, -width / 2, 1.0, width / 2)]), 0.0).ping(0).signal(0.008)
        late = slice(int(0.0058 * 2 * 60_000), None)
        ratio = np.abs(strip.samples[late]).max() / np.abs(endless.samples[late]).max()
        assert 20 * math.log10(ratio) == pytest.approx(level, abs=0.7)


def test_board_receiver_hears_a_strip_by_its_sum() -> None:
    strip = room_of([(1.0, -0.005, 1.0, 0.005)])
    for threshold, heard in ((-18.0, True), (-12.0, False)):
        board = replace(BOARD, threshold_db=threshold)
        scan = scan_at(strip, 0.0, board, receiver=Receiver.BOARD)
        assert np.isfinite(scan.distances[0]) == heard
