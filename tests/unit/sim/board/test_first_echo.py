"""The first echo of the board's own receiver: equal to that of the whole signal, which takes other kernels."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import j1
from sonarhw_sim.air import Receiver, Unit
from sonarhw_sim.board.profile import Board, Mount, load_board
from sonarhw_sim.board.receiver import Sound, detect_echoes, first_echoes
from sonarhw_sim.board.signal import Arrivals, burst_of, pulse_table, pulses
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import load_room

SPEED = 343.987
BOARD = load_board("polaroid-6500")
BOARDS = {
    "6500": BOARD,
    "chirp": load_board("polaroid-56"),
    "two transducers": load_board("hc-sr04"),
    "early": replace(BOARD, blanking_inhibit=0.7e-3),  # detects the end of its own burst
    "no integration": replace(BOARD, integration_cycles=0.0),
    "fast clock": replace(BOARD, clock_error=0.01),
    "ringing": replace(BOARD, ring_cycles=11.0),
    "long integration": replace(BOARD, integration_cycles=100.0),
}
A_TENTH = 1e-4  # m
ROOM = load_room("rooms/simple.toml")

angles = st.floats(-math.pi, math.pi)
scenes = st.lists(st.tuples(st.floats(0.05, 12.0), st.floats(-70, 6), angles, angles, angles), max_size=12)


def sound_of(scene: list[tuple[float, float, float, float, float]]) -> Sound:
    """Return sound of ranges (m), levels (dB), phases, departures and arrivals (rad)."""
    ranges, levels, phases, out, back = np.array(sorted(scene), dtype=np.float64).reshape(-1, 5).T
    leaving, arriving = (np.column_stack((np.cos(one), np.sin(one))) for one in (out, back))
    amplitudes = 10 ** (levels / 20) * np.exp(1j * phases)
    return Sound(2 * ranges / SPEED, amplitudes, leaving, arriving, np.empty((0, 0), np.bool_))


def arrivals_at(heading: float, sound: Sound) -> Arrivals:
    axis = np.array([math.cos(heading), math.sin(heading)])
    return Arrivals(sound.times, sound.amplitudes, sound.leaving @ axis, sound.arriving @ axis)


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS.keys())
@settings(deadline=None, max_examples=15)
@given(scene=scenes, headings=st.lists(angles, min_size=1, max_size=4))
def test_first_echo_is_that_of_the_whole_signal(
    board: Board, scene: list[tuple[float, float, float, float, float]], headings: list[float]
) -> None:
    sound = sound_of(scene)
    times, winners = first_echoes(np.array(headings), sound, board, SPEED)
    for heading, time, winner in zip(headings, times, winners, strict=True):
        # where a hundredth of a decibel decides between two echoes, either is right
        changes = (0.0, -0.01, 0.01)
        assert any(_is_first(time, winner, arrivals_at(heading, sound), board, change) for change in changes)


def _is_first(time: float, winner: int, arrivals: Arrivals, board: Board, change: float) -> bool:
    expected = detect_echoes(arrivals, replace(board, threshold_db=board.threshold_db + change), SPEED)
    if not len(expected.times):
        return math.isnan(time)
    return abs(expected.times[0] - time) * SPEED / 2 < A_TENTH and winner == expected.winner


@pytest.mark.parametrize("name", ["polaroid-6500", "polaroid-56", "hc-sr04", "lego-nxt"])
def test_pulses_of_the_table_are_exact(name: str) -> None:
    board, random = load_board(name), np.random.default_rng(1)
    table, burst = pulse_table(board, SPEED), burst_of(board, SPEED)
    out, back = random.uniform(0, math.pi / 2, (2, 200))
    times = random.uniform(0, 1e-4, 200)
    exact, _ = pulses(Arrivals(times, np.ones(200), np.cos(out), np.cos(back)), board, burst, SPEED)
    ka = table.wavenumber * (board.frequency + table.nodes)
    for k in range(200):
        beams = [np.array([_signed(one, abs(x)) for x in ka]) for one in (out[k], back[k])]
        phases = board.frequency * times[k] + table.nodes * (times[k] % 5e-6)
        weights = beams[0] * beams[1] * np.exp(-2j * math.pi * phases)
        made = weights @ (table.real + 1j * table.imaginary)
        assert np.abs(made - exact[k, : made.shape[0]]).max() < 1e-4
        assert np.abs(exact[k, made.shape[0] :]).max(initial=0.0) < 1e-4


def _signed(angle: float, ka: float) -> float:
    """Return the beam with its sign, 2 J₁(x)/x cos α."""
    x = max(ka * math.sin(angle), 1e-9)
    return float(2 * j1(x) / x * math.cos(angle))


@pytest.mark.parametrize("unit", [Unit.PASS, Unit.BLOCK, Unit.REFLECT])
@pytest.mark.parametrize("ahead", [0.0, 0.1])
def test_ranges_of_a_scan_are_those_of_its_signals(unit: Unit, ahead: float) -> None:
    # with the face ahead of the axis, every heading has paths of its own
    board = replace(BOARD, mount=Mount(ahead=ahead))
    options = PredictionOptions(unit=unit, receiver=Receiver.BOARD, max_bounces=4)
    scan = predict_scan(ROOM, ROOM.places["figure9"], board, np.radians(np.arange(0.0, 360.0, 20.0)), options)
    assert (scan.winners >= 0).any()
    for k in range(len(scan.headings)):
        from_signal = scan.ping(k).echo_times()[:1] * ROOM.air.speed_of_sound / 2
        assert scan.distances[k : k + 1][: len(from_signal)] == pytest.approx(from_signal, abs=A_TENTH)
        assert bool(np.isnan(scan.distances[k])) == (len(from_signal) == 0)
        assert scan.winners[k] == scan.ping(k).first_detected().winner
