"""The changes that sentences name have the effects that they state."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.explain import explain_reading
from sonarhw_compare.match import TOLERANCE, Comparison, compare_readings
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, weigh_paths
from sonarhw_sim.room.room import load_room

from sonarhw.readings import FloatArray, Reading

ROOM = load_room("rooms/arena.toml")
PLACE = ROOM.places["p3"]
BOARD = replace(load_board("lego-nxt"), sum_arrivals=False)  # each echo wins by itself, so margins are exact
HEADINGS = np.radians(np.arange(0.0, 360.0, 2.0))
FAINT = predict_scan(ROOM, PLACE, replace(BOARD, threshold_db=-50.0), HEADINGS).paths
SPEED = 340.0


def ranges_at(threshold: float) -> FloatArray:
    return weigh_paths(ROOM, PLACE, replace(BOARD, threshold_db=threshold), HEADINGS, FAINT).ranges


def compared(ranges: FloatArray, receiver: Receiver = Receiver.FIRST_ECHO) -> Comparison:
    """Return the comparison of readings with these ranges."""
    readings = [
        Reading(k, 0, 0, float(angle), 0.1 * k, () if math.isnan(one) else (2 * float(one) / SPEED,), SPEED)
        for k, (angle, one) in enumerate(zip(HEADINGS, ranges, strict=True))
    ]
    return compare_readings(readings, ROOM, PLACE, BOARD, options=PredictionOptions(receiver=receiver))


def test_a_higher_or_lower_threshold_gives_the_stated_range() -> None:
    comparison = compared(ranges_at(BOARD.threshold_db))
    sentences = [explain_reading(comparison, index) for index in range(len(HEADINGS))]
    over = r"it is only ([\d.]+) dB over the threshold; a higher threshold gives (silence|[\d.]+ m)"
    below = r"an echo at ([\d.]+) m is only ([\d.]+) dB below the threshold"
    seen = [0, 0]
    for index, sentence in enumerate(sentences):
        if match := re.search(over, sentence):
            after = ranges_at(BOARD.threshold_db + float(match[1]) + 0.051)[index]
            stated = math.nan if match[2] == "silence" else float(match[2].removesuffix(" m"))
            assert after == pytest.approx(stated, abs=0.0006, nan_ok=True)
            assert float(match[1]) <= 1.0
            seen[0] += 1
        if match := re.search(below, sentence):
            after = ranges_at(BOARD.threshold_db - float(match[2]) - 0.051)[index]
            assert after == pytest.approx(float(match[1]), abs=0.0006)
            assert float(match[2]) <= 1.0
            seen[1] += 1
    assert min(seen) > 3


@pytest.mark.parametrize("change", [-2.0, 2.0])
def test_the_stated_threshold_makes_the_model_agree(change: float) -> None:
    other = ranges_at(BOARD.threshold_db + change)
    comparison = compared(other)
    seen = 0
    for index in range(len(HEADINGS)):
        sentence = explain_reading(comparison, index)
        if match := re.search(r"a threshold ([\d.]+) dB (higher|lower) would make the model agree", sentence):
            by = float(match[1]) * (1 if match[2] == "higher" else -1)
            assert by * change > 0
            # stated to a tenth
            after = [ranges_at(BOARD.threshold_db + by + more)[index] for more in (-0.051, 0.0, 0.051)]
            agree = [
                math.isnan(one) if math.isnan(other[index]) else abs(one - other[index]) <= TOLERANCE for one in after
            ]
            assert any(agree)
            seen += 1
    assert seen > 3


def test_margins_are_not_stated_for_the_boards_own_receiver() -> None:
    comparison = compared(ranges_at(BOARD.threshold_db + 2.0), Receiver.BOARD)
    text = " ".join(explain_reading(comparison, index) for index in range(len(HEADINGS)))
    assert "would make the model agree" not in text
    assert "dB over the threshold;" not in text
