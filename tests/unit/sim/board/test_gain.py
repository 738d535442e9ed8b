"""Gain of the receiver against closed forms of spreading, and against the times of its steps."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import largest_gain, load_board, path_loss_db, stepped_gain_db, uncompensated_db

BOARD = load_board("polaroid-6500")
FIXED = replace(BOARD, fixed_gain=True, gain_steps=(), absorption=False)
AIR = Air()


def test_without_absorption_a_path_loses_6_decibels_each_time_its_length_doubles() -> None:
    lengths = np.array([0.5, 1.0, 2.0, 4.0])
    assert path_loss_db(lengths, FIXED) == pytest.approx(20 * math.log10(2) * np.array([-1, 0, 1, 2]))
    assert uncompensated_db(lengths, FIXED, AIR) == pytest.approx(path_loss_db(lengths, FIXED))
    assert uncompensated_db(lengths, replace(FIXED, fixed_gain=False), AIR) == pytest.approx(np.zeros(4))


@pytest.mark.parametrize("nearest", [0.1, 0.2, 0.3])
def test_largest_gain_of_a_fixed_gain_is_that_of_the_first_echo_after_blanking(nearest: float) -> None:
    """Its path is there and back, and spreading divides the amplitude by the length in metres."""
    board = replace(FIXED, blanking=2 * nearest / AIR.speed_of_sound)
    assert largest_gain(board, AIR, 8.0) == pytest.approx(1 / (2 * nearest))
    assert largest_gain(replace(board, fixed_gain=False), AIR, 8.0) == 1.0


def test_largest_gain_in_dry_air_is_that_of_the_longest_path() -> None:
    dry, board = Air(relative_humidity=0.1), replace(BOARD, gain_steps=())
    decibels = -board.excess_absorption(dry) * 15.0
    assert decibels > 0
    assert largest_gain(board, dry, 15.0) == pytest.approx(10 ** (decibels / 20))


def test_gain_rises_at_the_time_of_each_step() -> None:
    steps = np.array(BOARD.gain_steps)
    before, at, after = (stepped_gain_db(steps + offset, BOARD) for offset in (-1e-9, 0.0, 1e-9))
    assert at - before == pytest.approx([BOARD.gain_step_db] * len(steps))
    assert at == pytest.approx(after, abs=1e-12)
