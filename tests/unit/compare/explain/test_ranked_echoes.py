"""Ranked echoes, against closed forms of a rectangular room and against predictions with the changes made."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_compare.explain import (
    RankedEcho,
    explain_heading,
    explain_reading,
    outcome_text,
    ranked_echoes,
    remedy,
    remedy_text,
    runner_up,
)
from sonarhw_compare.fit.free_walls import left_normals, with_shifted_walls
from sonarhw_compare.match import compare_readings
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, weigh_paths
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading

ROOM = load_room("rooms/simple.toml")
PLACE = ROOM.place("figure9")  # 0.774 m from the left wall, 0.085 m from the bottom, 0.657 m from the top
BOARD = load_board("paper")
REFLECTANCE = 0.95
_A_LITTLE = 1e-6


def scan_at(degrees: float) -> PredictedScan:
    return predict_scan(ROOM, PLACE, BOARD, np.radians([degrees]))


def via(scan: PredictedScan, echo: RankedEcho) -> str:
    return ">".join(scan.paths.via(echo.path, scan.room))


def off_axis_db(degrees: float) -> float:
    """Return the level of a piston, twice 2 J1(x)/x cos(angle), relative to its axis (CIM-92-9 eq. 1)."""
    angle = math.radians(degrees)
    x = BOARD.wavenumber(ROOM.air) * BOARD.aperture_radius * math.sin(angle)
    return 2 * 20 * math.log10(abs(2 * j1(x) / x) * math.cos(angle))


def test_the_winner_is_first_and_the_blanked_wall_last() -> None:
    scan = scan_at(270.0)
    found = ranked_echoes(scan, 0)
    assert (via(scan, found[0]), outcome_text(found[0])) == ("bottom>top>bottom", "wins")
    assert found[0].range == pytest.approx(2 * 0.085 + 0.657, abs=5e-4)
    assert (via(scan, found[-1]), outcome_text(found[-1])) == ("bottom", "blanked")
    assert found[-1].range == pytest.approx(0.085, abs=5e-4)
    needed = BOARD.blanking - 2 * 0.085 / ROOM.air.speed_of_sound
    assert remedy(scan, 0, found[-1]).blanking == pytest.approx(needed, abs=1e-6)
    assert [echo.wins for echo in found] == [True] + [False] * (len(found) - 1)
    assert runner_up(found) is found[1]


def test_levels_are_those_of_a_piston_off_its_axis() -> None:
    scan = scan_at(200.0)
    left = next(echo for echo in ranked_echoes(scan, 0) if via(scan, echo) == "left")
    level = 20 * math.log10(REFLECTANCE) + off_axis_db(20.0)
    assert left.level_db == pytest.approx(level, abs=0.02)
    assert left.lacking_db == pytest.approx(BOARD.threshold_db - level, abs=0.02)
    assert outcome_text(left) == f"{BOARD.threshold_db - level:.1f} dB too weak"
    assert remedy_text(remedy(scan, 0, left)) == f"a threshold {BOARD.threshold_db - level:.1f} dB lower"


def test_the_distance_behind_the_winner_is_that_of_image_sources() -> None:
    scan = scan_at(0.0)  # the right wall is 0.154 m away, within blanking; then right, left, right
    found = ranked_echoes(scan, 0)
    again = next(echo for echo in found if via(scan, echo) == "right>left>right>left>right")
    assert found[0].range == pytest.approx(0.928 + 0.154, abs=5e-4)
    assert again.behind == pytest.approx(0.928, abs=1e-3)
    assert outcome_text(again, lambda metres: f"{100 * metres:.0f} cm") == "93 cm behind the winner"


def test_a_path_and_its_reverse_are_one_echo() -> None:
    scan = scan_at(45.0)
    ways = [
        (round(c.range, 6), frozenset((via(scan, c), ">".join(via(scan, c).split(">")[::-1]))))
        for c in ranked_echoes(scan, 0)
    ]
    assert len(ways) == len(set(ways))


@pytest.mark.parametrize("degrees", [45.0, 200.0, 215.0, 310.0])
def test_each_change_of_the_threshold_makes_its_echo_win(degrees: float) -> None:
    scan = scan_at(degrees)
    helped = 0
    for echo in ranked_echoes(scan, 0):
        change = remedy(scan, 0, echo).threshold_db
        if change is None or change < -15:  # fainter paths may be left out of the prediction
            continue
        board = replace(BOARD, threshold_db=BOARD.threshold_db + change + math.copysign(_A_LITTLE, change))
        after = weigh_paths(ROOM, PLACE, board, scan.headings, scan.paths)
        # a nearer echo wins only if the threshold stays above those still nearer, which have their own remedy
        assert after.ranges[0] <= echo.range + 1e-6
        helped += bool(abs(after.ranges[0] - echo.range) < 1e-6)
    assert helped > 0


def test_a_shorter_blanking_makes_a_blanked_echo_win() -> None:
    scan = scan_at(270.0)
    nearest = ranked_echoes(scan, 0)[-1]
    earlier = remedy(scan, 0, nearest).blanking
    assert earlier is not None
    for share, range_ in ((1.001, 0.085), (0.999, 0.827)):
        after = predict_scan(ROOM, PLACE, replace(BOARD, blanking=BOARD.blanking - share * earlier), scan.headings)
        assert after.ranges[0] == pytest.approx(range_, abs=5e-4)


def test_a_shifted_wall_lets_the_runner_up_win() -> None:
    board, options = replace(load_board("lego-nxt"), sum_arrivals=False), PredictionOptions(diffraction=False)
    room, place, heading = load_room("rooms/arena.toml"), Place("", (1.805, 0.3)), np.radians([320.0])
    scan = predict_scan(room, place, board, heading, options)
    second = runner_up(ranked_echoes(scan, 0))
    assert second is not None
    moved = remedy(scan, 0, second).wall
    assert moved is not None
    assert remedy_text(remedy(scan, 0, second)).endswith(
        f"{moved.wall} 0.005 m {'nearer' if moved.nearer > 0 else 'farther'}"
    )
    side = np.sign((left_normals(room.walls) * (np.array(place.position) - room.walls[:, :2])).sum(axis=1))
    for share, first in ((0.95, int(scan.winners[0])), (1.05, second.path)):
        by = share * moved.nearer * float(side[room.names.index(moved.wall)])
        shifted = with_shifted_walls(room, {moved.wall: by})
        after = predict_scan(shifted, place, board, heading, options)
        assert after.paths.via(int(after.winners[0]), shifted) == scan.paths.via(first, room)


def test_silence_has_echoes_without_a_winner() -> None:
    board = replace(BOARD, threshold_db=3.0)
    scan = weigh_paths(ROOM, PLACE, board, np.radians([90.0]), scan_at(90.0).paths)
    found = ranked_echoes(scan, 0)
    assert explain_heading(scan, 0).startswith("no echo is predicted at 90.0°")
    assert not any(echo.wins for echo in found)
    best = runner_up(found)
    assert best is not None
    assert best.behind is None
    assert best.lacking_db == pytest.approx(3.0 - 20 * math.log10(REFLECTANCE), abs=1e-3)


def test_the_sentence_about_a_heading() -> None:
    assert explain_heading(scan_at(270.0), 0) == (
        "0.827 m predicted at 270.0°: three reflections, bottom, top, bottom; "
        "the near wall (0.085 m) lies within blanking"
    )


def test_the_sentence_about_a_heading_states_what_the_receiver_adds_to_the_path() -> None:
    """The room has one wall at 0.085 m and one at 0.657 m: down, up, down is 2 × 0.827 m, whatever the receiver."""
    of_board = predict_scan(ROOM, PLACE, load_board("polaroid-6500"), np.radians([270.0]))
    range_ = float(of_board.ranges[0])
    assert explain_heading(of_board, 0) == (
        f"{range_:.3f} m predicted at 270.0°: three reflections, bottom, top, bottom; "
        f"half of the path is 0.827 m, and the receiver of the board adds {range_ - 0.827:.3f} m; "
        "the near wall (0.085 m) lies within blanking"
    )
    assert range_ > 0.828
    short = predict_scan(ROOM, PLACE, replace(BOARD, range_offset=-0.01), np.radians([270.0]))
    assert "half of the path is 0.827 m, and the receiver of the board subtracts 0.010 m" in explain_heading(short, 0)


def test_the_sentence_about_a_reading_and_the_row_of_the_winner_state_what_the_receiver_adds() -> None:
    board, speed = load_board("polaroid-6500"), ROOM.air.speed_of_sound
    scan = predict_scan(ROOM, PLACE, board, np.radians([270.0]))
    range_ = float(scan.ranges[0])
    reading = Reading(0, 0, 0, math.radians(270.0), 0.0, (2 * range_ / speed,), speed)
    said = explain_reading(compare_readings([reading], ROOM, PLACE, board), 0)
    added = f"{range_ - 0.827:.3f} m"
    assert range_ > 0.828
    assert f"; half of the path is 0.827 m, and the receiver of the board adds {added}; the near wall" in said
    longer = replace(reading, echo_times=(2 * (range_ + 0.01) / speed,))
    said = explain_reading(compare_readings([longer], ROOM, PLACE, board), 0)
    assert f" adds {added}; {range_:.3f} m is predicted; the near wall" in said  # so that the sum is not the reading
    assert outcome_text(ranked_echoes(scan, 0)[0]) == f"wins, receiver adds {added}"


def test_what_the_receiver_adds_to_the_winner_makes_no_other_echo_nearer_to_it() -> None:
    """The receiver of the board adds millimetres to the range that it reports, and nothing to the lengths of paths."""
    behind = []
    for board in (BOARD, load_board("polaroid-6500")):
        scan = predict_scan(ROOM, PLACE, board, np.radians([270.0]))
        found = {via(scan, echo): echo for echo in ranked_echoes(scan, 0)}
        behind.append(found["bottom>right>top>bottom"].behind)
    assert found["bottom>top>bottom"].range > 0.828
    exact = math.hypot(0.827, 0.154) - 0.827  # the right wall is 0.154 m from the sensor
    assert behind == pytest.approx([exact, exact], abs=2e-4)
