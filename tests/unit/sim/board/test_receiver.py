"""The board's own receiver: agreement with the paper's, delay of detection, and properties in its data sheet."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sonarhw_sim.air import Air, Receiver, absorption
from sonarhw_sim.board.profile import Board, load_board, stepped_gain_db
from sonarhw_sim.board.receiver import _sums_between, counted_time, detect_echoes, detect_first_echo, echo_times
from sonarhw_sim.board.signal import RATE, Arrivals, Noise, received
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.readings import FloatArray

SPEED = 343.987
CYCLE = 1 / 49412.0
BOARD = load_board("polaroid-6500")
LEVEL = replace(BOARD, gain_steps=())  # the ideal gain
PAPERLIKE = replace(LEVEL, integration_cycles=0.0, rise_cycles=0.5, own_burst_db=-300.0)
ROOM = load_room("rooms/simple.toml")


def walls(*ranges_and_levels: tuple[float, float]) -> Arrivals:
    """Return arrivals of walls straight ahead at ranges (m) with levels (dB)."""
    ranges, levels = np.array(ranges_and_levels).reshape(-1, 2).T
    ahead = np.ones(len(ranges))
    return Arrivals(2 * ranges / SPEED, 10 ** (levels / 20), ahead, ahead)


def detected_ranges(board: Board, *ranges_and_levels: tuple[float, float]) -> FloatArray:
    return counted_time(detect_echoes(walls(*ranges_and_levels), board, SPEED).times, board) * SPEED / 2


scenes = st.lists(
    st.tuples(st.floats(0.42, 10.6), st.one_of(st.floats(-60, -41), st.floats(-39, 0))), min_size=1, max_size=6
)


@settings(deadline=None, max_examples=60)
@given(scene=scenes)
def test_with_ideal_gain_and_no_integration_both_receivers_agree(scene: list[tuple[float, float]]) -> None:
    # overlapping echoes add with their phase, which the paper's receiver ignores
    ranges = sorted(distance for distance, _ in scene)
    apart = [scene[0]] if ranges and min(np.diff(ranges), default=1.0) < 0.2 else scene
    loud = sorted(distance for distance, level in apart if level > BOARD.threshold_db)
    detected = detected_ranges(PAPERLIKE, *apart)
    assert len(detected) >= len(loud)
    if loud:
        assert detected[0] == pytest.approx(loud[0], abs=2 * CYCLE * SPEED / 2)
        winner = detect_echoes(walls(*apart), PAPERLIKE, SPEED).winner
        assert apart[winner][0] == loud[0]
    else:
        assert len(detected) == 0


@settings(deadline=None, max_examples=60)
@given(distance=st.floats(0.5, 10.0), over=st.floats(0.2, 40))
def test_range_error_is_positive_and_at_most_burst_and_decay(distance: float, over: float) -> None:
    late = detected_ranges(LEVEL, (distance, LEVEL.threshold_db + over))[0] - distance
    assert 0 < late < (16 + 4) * CYCLE * SPEED / 2


def test_barely_detected_echo_is_45_millimetres_later_than_a_strong_one() -> None:
    late = [detected_ranges(LEVEL, (2.0, LEVEL.threshold_db + over))[0] for over in (1, 3, 6, 10, 20, 40)]
    assert late == sorted(late, reverse=True)
    assert late[0] - late[-1] == pytest.approx(0.045, abs=0.005)


def test_threshold_has_the_same_meaning_for_both_receivers() -> None:
    for cycles in (0.0, 3.0, 16.0):
        board = replace(LEVEL, integration_cycles=cycles)
        assert len(detected_ranges(board, (2.0, board.threshold_db - 0.1))) == 0
        assert len(detected_ranges(board, (2.0, board.threshold_db + 0.1))) == 1


def test_range_is_that_of_a_rectifier_and_a_capacitor_on_the_rf_signal() -> None:
    rate = 5e6
    lone = np.abs(received(walls((1.0, 0.0)), LEVEL, SPEED, 0.01).rf(rate)[20_000:])
    arrivals = walls((1.0, -45.0), (1.3, -33.0), (1.302, -36.0))
    signal = np.abs(received(arrivals, LEVEL, SPEED, 0.02).rf(rate))

    def charged(rectified: FloatArray, full: float) -> int:
        tau, charge, most = LEVEL.integration_cycles * CYCLE * rate, 0.0, 0.0
        for k, current in enumerate(rectified):
            charge += (current - charge) / tau
            most = max(most, charge)
            if charge >= full:
                return k
        return round(most * 1e9)

    full = charged(lone, math.inf) / 1e9 * 10 ** (LEVEL.threshold_db / 20)
    blanked = math.ceil(LEVEL.blanking * rate)
    expected = (blanked + charged(signal[blanked:], full)) / rate
    assert detect_echoes(arrivals, LEVEL, SPEED).times[0] == pytest.approx(expected, abs=CYCLE / 2)


def test_echo_within_blanking_is_ignored_and_one_that_continues_is_detected_at_its_end() -> None:
    end = LEVEL.blanking * SPEED / 2
    assert len(detected_ranges(LEVEL, (0.2, -3.0))) == 0
    assert detected_ranges(LEVEL, (0.38, -3.0))[0] == pytest.approx(end, abs=0.01)


def test_binh_detects_walls_from_6_inches_and_nearer_ones_late() -> None:
    board = replace(LEVEL, blanking_inhibit=0.75e-3)
    assert detected_ranges(board, (0.1524, -3.0))[0] == pytest.approx(0.1524, abs=0.01)
    assert detected_ranges(board, (0.10, -3.0))[0] == pytest.approx(0.1524, abs=0.03)
    assert detected_ranges(board, (0.25, -3.0))[0] == pytest.approx(0.25, abs=0.01)
    assert len(detected_ranges(board)) == 0  # its own burst has decayed


def test_targets_3_inches_apart_are_two_echoes() -> None:
    detected = detected_ranges(LEVEL, (1.0, -20.0), (1.0762, -20.0))
    assert np.diff(detected) == pytest.approx([0.0762], abs=0.01)


def test_next_echo_is_detected_only_after_re_arming() -> None:
    detected = detect_echoes(walls((1.0, -20.0), (1.04, -20.0), (1.3, -20.0)), LEVEL, SPEED).times
    assert np.diff(detected).min() >= LEVEL.rearm
    assert len(detected_ranges(replace(LEVEL, rearm=0.02), (1.0, -20.0), (2.0, -20.0))) == 1


def test_density_of_echoes_follows_the_amplitude_when_re_armed_without_pause() -> None:
    quick = replace(LEVEL, rearm=20e-6)
    counts = [len(detected_ranges(quick, (1.0, level))) for level in (-39.5, -30.0, -20.0, 0.0)]
    assert counts == sorted(counts)
    assert counts[-1] > 2 * counts[0]


@pytest.mark.parametrize("error", [-0.01, 0.01])
def test_wrong_clock_scales_ranges_and_blanking(error: float) -> None:
    board = replace(LEVEL, clock_error=error)
    exact = detected_ranges(LEVEL, (3.0, -10.0))[0]
    assert detected_ranges(board, (3.0, -10.0))[0] == pytest.approx(exact * (1 + error), rel=1e-9)
    # a strong echo that continues after blanking is detected at its end
    found = detect_echoes(walls((0.38, 0.0)), board, SPEED).times[0]
    assert found == pytest.approx(LEVEL.blanking / (1 + error), abs=CYCLE)


def test_stepped_gain_differs_from_the_ideal_one_by_at_most_6_decibels_and_0_on_average() -> None:
    steps = BOARD.gain_steps
    times = np.linspace(steps[0], steps[-1], 20_000, endpoint=False)
    lengths = times * Air().speed_of_sound
    off = stepped_gain_db(times, BOARD) - 20 * np.log10(lengths) - absorption(BOARD.frequency, Air()) * lengths
    assert off.mean() == pytest.approx(0, abs=0.01)
    assert np.abs(off).max() == pytest.approx(5.8, abs=0.1)
    assert np.abs(off[lengths / 2 > 0.5]).max() < 4


def test_stepped_gain_misses_far_walls_that_the_ideal_one_detects() -> None:
    assert len(detected_ranges(LEVEL, (10.0, -30.0))) == 1
    assert len(detected_ranges(BOARD, (10.0, -30.0))) == 0
    assert len(detected_ranges(BOARD, (5.0, -30.0))) == 1


def test_winner_is_the_loudest_arrival_that_fills_the_capacitor() -> None:
    assert detect_echoes(walls((1.0, -45.0), (1.002, -20.0), (1.004, -30.0)), LEVEL, SPEED).winner == 1
    assert detect_echoes(walls((0.2, 0.0), (3.0, -20.0)), LEVEL, SPEED).winner == 1


@settings(deadline=None, max_examples=40)
@given(scene=scenes, level=st.sampled_from([0.0, 0.002, 0.008]), seed=st.integers(0, 99))
def test_first_echo_does_not_depend_on_the_length_of_the_signal(
    scene: list[tuple[float, float]], level: float, seed: int
) -> None:
    noise = Noise(level, (seed,))
    whole, first = (
        detect_echoes(walls(*scene), BOARD, SPEED, noise),
        detect_first_echo(walls(*scene), BOARD, SPEED, noise),
    )
    assert first.times[:1] == pytest.approx(whole.times[:1], abs=1e-12)
    assert first.winner == whole.winner


@pytest.mark.parametrize("threshold_db", [-math.inf, -3000.0])
def test_lowest_threshold_detects_the_first_sound_after_blanking(threshold_db: float) -> None:
    detected = detected_ranges(replace(BOARD, threshold_db=threshold_db), (1.0, -20.0))
    assert BOARD.blanking * SPEED / 2 < detected[0] < 1.001
    assert np.isfinite(detected).all()


def test_noise_alone_causes_echoes_without_a_winner() -> None:
    detected = detect_echoes(walls(), LEVEL, SPEED, Noise(0.02, (1,)))
    assert len(detected.times) > 0
    assert detected.winner == -1


def test_an_arrival_far_below_the_noise_is_not_the_winner() -> None:
    loud, level = detect_echoes(walls(), LEVEL, SPEED, Noise(0.02, (1,))), -100.0
    just_before = float(loud.times[0]) * SPEED / 2 - 0.005
    detected = detect_echoes(walls((just_before, level), (9.0, 0.0)), LEVEL, SPEED, Noise(0.02, (1,)))
    assert detected.times[0] == pytest.approx(loud.times[0], abs=1e-6)
    assert detected.winner == -1


def test_reported_range_is_that_of_the_signal() -> None:
    headings = np.radians(np.arange(0, 360, 30.0))
    options = PredictionOptions(receiver=Receiver.BOARD, noise=0.001, seed=5)
    scan = predict_scan(ROOM, ROOM.places["figure9"], BOARD, headings, options)
    speed = ROOM.air.speed_of_sound
    for k in range(len(headings)):
        found = echo_times(scan.ping(k).signal(2 * BOARD.max_range / speed).samples, BOARD, speed)
        assert scan.distances[k] == pytest.approx(found[0] * speed / 2)
        assert scan.ping(k).echo_times() == pytest.approx(found)


def test_false_wall_of_figure_9_exists_for_the_boards_receiver_too() -> None:
    options = PredictionOptions(receiver=Receiver.BOARD)
    scan = predict_scan(ROOM, ROOM.places["figure9"], BOARD, np.radians([270.0, 90.0]), options)
    assert scan.paths.via(int(scan.winners[0]), ROOM) == ("bottom", "top", "bottom")
    assert scan.ranges == pytest.approx([0.827, 0.657], abs=0.01)
    assert (scan.ranges > [0.827, 0.657]).all()


@pytest.mark.parametrize(("low", "high", "share"), [(0.0, 0.02, 0.5), (0.004, 0.019, 0.4), (0.009, 0.049, 0.025)])
def test_without_integration_the_time_is_that_at_which_a_straight_line_meets_the_threshold(
    low: float, high: float, share: float
) -> None:
    board = replace(PAPERLIKE, threshold_db=-40.0, blanking=0.0, blanking_inhibit=None)
    samples = np.zeros(1000, dtype=np.complex128)
    samples[500], samples[501] = low, high
    assert echo_times(samples, board, SPEED)[0] * RATE == pytest.approx(500 + share)


@pytest.mark.parametrize("over", [1.2, 2.0, 10.0])
def test_a_constant_signal_fills_the_capacitor_after_the_time_of_an_exponential(over: float) -> None:
    """v = L (1 - exp(-t/τ)) is 1 at t = τ ln(L / (L - 1))."""
    board = replace(LEVEL, threshold_db=0.0, blanking=0.0, blanking_inhibit=None, integration_cycles=8.0)
    lone = lowest_level(board)
    samples = np.full(4000, over * lone, dtype=np.complex128)
    constant = board.integration_cycles / board.frequency
    assert echo_times(samples, board, SPEED)[0] == pytest.approx(constant * math.log(over / (over - 1)), abs=1 / RATE)


def lowest_level(board: Board) -> float:
    """Return the lowest constant level that is ever detected, by bisection."""
    low, high = 0.0, 2.0
    for _ in range(40):
        level = (low + high) / 2
        found = len(echo_times(np.full(20_000, level, dtype=np.complex128), board, SPEED)) > 0
        low, high = (low, level) if found else (level, high)
    return high


def test_without_an_echo_there_is_no_winner() -> None:
    silent = detect_echoes(walls((2.0, -200.0), (3.0, -200.0)), LEVEL, SPEED)
    assert (len(silent.times), silent.winner) == (0, -1)
    loud = detect_echoes(walls((2.0, -200.0), (3.0, -20.0)), LEVEL, SPEED)
    assert (len(loud.times), loud.winner) == (1, 1)


def test_pulses_are_summed_after_the_gain_within_a_window() -> None:
    """Three pulses of two samples in four samples of gain; the window begins at the second sample."""
    some = np.array([[1.0, 2j], [3.0, 4.0], [5.0, 6.0]], np.complex128)
    gain = np.array([1.0, 10.0, 100.0, 1000.0])
    found = _sums_between(some, np.array([0, 1, 3]), gain, 1)
    assert found.tolist() == [2 * 10, 3 * 10 + 4 * 100, 5 * 1000]
