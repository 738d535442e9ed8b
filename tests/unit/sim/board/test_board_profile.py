"""Receiver keys of board profiles, and errors in them."""

import math
import re

import numpy as np
import pytest
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Tone, load_board, parse_board

from sonarhw.errors import InputError

PROFILE = """
name = "mine"
aperture_radius = 0.0192
frequency = 49412.0
transmit_cycles = 16
blanking = 0.00238
max_range = 10.7
threshold_db = -40.0
"""
CHIRP = """
[[chirp]]
frequency = 60000.0
cycles = 6
[[chirp]]
frequency = 50000.0
cycles = 10
"""


def test_profile_without_receiver_keys_has_the_papers_receiver() -> None:
    board = parse_board(PROFILE, "mine.toml")
    assert board.receiver is Receiver.FIRST_ECHO
    assert board.burst == (Tone(frequency=49412.0, cycles=16),)
    assert board.gain_steps == ()
    assert board.blanking_end == board.blanking


def test_every_key_of_the_receiver_is_read() -> None:
    text = PROFILE + (
        'receiver = "board"\nrise_cycles = 2.0\nring_cycles = 11.0\nown_burst_db = 6.0\nintegration_cycles = 4.0\n'
        "gain_steps = [0.002, 0.005]\ngain_step_db = 5.0\nblanking_inhibit = 0.001\nrearm = 0.0005\n"
        "clock_error = -0.01\n"
    )
    board = parse_board(text + CHIRP, "mine.toml")
    assert board.receiver is Receiver.BOARD
    assert (board.rise_cycles, board.ring_cycles, board.own_burst_db) == (2.0, 11.0, 6.0)
    assert board.integration_cycles == 4.0
    assert (board.gain_steps, board.gain_step_db, board.rearm) == ((0.002, 0.005), 5.0, 0.0005)
    assert (board.clock_error, board.blanking_end) == (-0.01, 0.001)
    assert board.burst == (Tone(frequency=60000.0, cycles=6), Tone(frequency=50000.0, cycles=10))
    assert board.blanked_range(Air()) == pytest.approx(0.001 * 343.987 / 2, rel=1e-4)


def test_gain_steps_of_the_6500_follow_its_clock() -> None:
    steps, end = [], 16 / 49.412e3
    for clocks in (192, *[256] * 7, *[512] * 3):
        end += clocks / 93.33e3
        steps.append(end)
    assert load_board("polaroid-6500").gain_steps == pytest.approx(steps, abs=2e-5)


def test_spreads_are_read_and_default_to_none() -> None:
    assert (load_board("hc-sr04").threshold_sd_db, load_board("hc-sr04").range_sd) == (0.0, 0.0)
    board = parse_board(PROFILE + "threshold_sd_db = 2.5\nrange_sd = 0.004\n", "mine.toml")
    assert (board.threshold_sd_db, board.range_sd) == (2.5, 0.004)
    assert parse_board(board.text, "its text") == board


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ('receiver = "best"', "receiver: expected 'first-echo' or 'board', got 'best'"),
        ("gain_steps = [0.005, 0.002]", "gain_steps: expected increasing times"),
        ("gain_steps = [-0.005]", r"gain_steps\[0\]: expected greater than 0"),
        ("gain_step_db = -4.0", "gain_step_db: expected greater than or equal to 0"),
        ("integration_cycles = -1.0", "integration_cycles: expected greater than or equal to 0"),
        ("rise_cycles = 0.1", "rise_cycles: expected greater than or equal to 0.5"),
        ("rise_cycles = 1e9", "rise_cycles: expected less than or equal to 100"),
        ("blanking_inhibit = 0.003", "blanking_inhibit: expected 0.00238 s .* got 0.003"),
        ("rearm = 0.0", "rearm: expected greater than 0"),
        ("range_offset = -5.0", "range_offset: expected greater than or equal to -1 m, got -5.*in mm, write -0.005$"),
        ("range_offset = -5000.0", "range_offset: expected greater than or equal to -1 m, got -5000.0$"),
        ("gain_steps = [2.38]", "gain_steps.*1 s, got 2.38; if this is in ms, write 0.00238$"),
        ("rounding = 100.0", "rounding: expected less than or equal to 1 m, got 100"),
        (
            "gain_steps = [0.002]\nfixed_gain = true",
            "fixed_gain and gain_steps: expected one of them; a fixed gain has no steps",
        ),
        ("threshold_sd_db = -1.0", "threshold_sd_db: expected greater than or equal to 0 dB, got -1"),
        ("range_sd = 4.0", "range_sd: expected less than or equal to 1 m, got 4.0; if this is in mm, write 0.004"),
        ("clock_error = 1.0", "clock_error: expected less than or equal to 0.1"),
        ("own_burst_db = nan", "own_burst_db: expected a finite number"),
        (CHIRP.replace("10", "11"), "chirp: expected transmit_cycles = 16 cycles in all, got 17"),
        (CHIRP.replace("60000.0", "80000.0"), r"chirp\[0\].frequency: expected one within 30000 Hz .* got 80000"),
        (CHIRP.replace("60000.0", "6.0"), r"chirp\[0\].frequency: expected greater than or equal to 1000"),
    ],
)
def test_wrong_receiver_is_rejected_in_one_line(wrong: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_board(PROFILE + wrong, "mine.toml")
    assert re.search(f"^mine.toml: {message}", str(caught.value))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (
            "frequency",
            "49.412",
            "expected greater than or equal to 1000 Hz, got 49.412; if this is in kHz, write 49412.0",
        ),
        ("frequency", "0.5", "expected greater than or equal to 1000 Hz, got 0.5"),
        ("aperture_radius", "19.2", "expected less than or equal to 1 m, got 19.2; if this is in mm, write 0.0192"),
        ("blanking", "2.38", "expected less than or equal to 1 s, got 2.38; if this is in ms, write 0.00238"),
        ("blanking", "-2.38", "expected greater than or equal to 0 s, got -2.38"),
    ],
)
def test_a_number_beyond_its_limits_gets_a_guess_of_its_unit(key: str, value: str, message: str) -> None:
    text = re.sub(rf"^{key} = .*$", f"{key} = {value}", PROFILE, flags=re.MULTILINE)
    with pytest.raises(InputError) as caught:
        parse_board(text, "mine.toml")
    assert str(caught.value) == f"mine.toml: {key}: {message}"


def test_max_range_below_the_end_of_blanking_is_rejected() -> None:
    with pytest.raises(InputError, match=r"max_range: expected more than 0\.409 m, where blanking ends, got 0\.4; it"):
        parse_board(PROFILE.replace("10.7", "0.4"), "mine.toml")
    assert parse_board(PROFILE.replace("10.7", "0.4\nblanking_inhibit = 0.001"), "mine.toml").max_range == 0.4


def test_reported_ranges_are_the_nearest_multiples_of_the_rounding() -> None:
    board = parse_board(PROFILE + "rounding = 0.01\nrange_offset = 0.1", "mine.toml")
    reported = board.reported(np.array([0.4149, 0.4151, 0.4199, math.nan]))
    assert reported[:3] == pytest.approx([0.51, 0.52, 0.52])
    assert math.isnan(reported[3])
    assert parse_board(PROFILE, "mine.toml").reported(np.array([0.4149])) == pytest.approx([0.4149])
