"""Late detection of faint echoes and stepped gain, as whole pings through the board's own receiver have them."""

from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.fit.likelihood import LATENESS_STEP, lateness_by_level, level_offset_db
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.board.receiver import detect_echoes
from sonarhw_sim.board.signal import RATE, Arrivals, received

SPEED = 343.987
BOARD = load_board("polaroid-6500")
LEVEL = replace(BOARD, gain_steps=())  # the ideal gain


def wall(distance: float, level_db: float) -> Arrivals:
    """Return the echo of one wall straight ahead."""
    return Arrivals(np.array([2 * distance / SPEED]), np.array([10 ** (level_db / 20)]), np.ones(1), np.ones(1))


def test_an_echo_is_detected_as_late_as_in_a_simulated_ping() -> None:
    table = lateness_by_level(LEVEL, SPEED)
    for over in (0.5, 1.0, 3.0, 6.0, 12.0, 20.0, 30.0):
        ranges = detect_echoes(wall(2.0, LEVEL.threshold_db + over), LEVEL, SPEED).times * SPEED / 2
        late = table[round(over / LATENESS_STEP)]
        assert ranges[0] - 2.0 == pytest.approx(late, abs=SPEED / RATE)


def test_a_louder_echo_is_never_later_and_40_db_are_covered() -> None:
    table = lateness_by_level(LEVEL, SPEED)
    assert (len(table) - 1) * LATENESS_STEP == 40.0
    assert (np.diff(table) <= 0).all()
    assert np.isfinite(table).all()
    # at the threshold almost the whole burst of 16 cycles of 49.4 kHz is needed
    assert table[0] > 0.7 * 16 / 49_412 * SPEED / 2
    assert table[-1] < 0.3 * table[0]


def test_the_offset_of_the_gain_is_that_of_received_echoes() -> None:
    distances = np.array([0.5, 1.0, 2.3, 4.0, 7.0])
    offsets = level_offset_db(2 * distances, BOARD, SPEED)
    for distance, offset in zip(distances.tolist(), offsets.tolist(), strict=True):
        arrives = round(2 * distance / SPEED * RATE)  # the burst rises after this sample
        stepped, ideal = (
            np.abs(received(wall(distance, -20.0), board, SPEED, 0.06, Receiver.BOARD, None).samples[arrives + 3])
            for board in (BOARD, LEVEL)
        )
        # the ideal gain rises a little until then
        assert 20 * np.log10(stepped / ideal) == pytest.approx(offset, abs=0.3)
    assert np.ptp(offsets) > 1.0
    assert level_offset_db(2 * distances, LEVEL, SPEED).tolist() == [0.0] * 5
