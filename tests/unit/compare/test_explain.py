"""What is said about a reading: sentences, details for JSON and ranked echoes, against predictions with the changes."""

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_compare.explain import (
    RankedEcho,
    details,
    explain_heading,
    explain_reading,
    outcome_text,
    ranked_echoes,
    remedy,
    remedy_text,
)
from sonarhw_compare.fit.free_walls import left_normals, with_shifted_walls
from sonarhw_compare.match import TOLERANCE, compare_readings
from sonarhw_compare.score import assigned_echoes
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import Board, OwnBodyPart, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, weigh_paths
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import deviation_text, estimate_degrees, estimate_text, heading_text, in_degrees
from sonarhw.readings import FloatArray
from tests.fixtures.predicted_readings import readings_of

ARENA = load_room("arena")
PLACE = replace(ARENA.places["p3"], heading=math.radians(20.0))
NXT = replace(load_board("lego-nxt"), sum_arrivals=False)  # each echo wins by itself, so margins are exact
ANGLES = np.radians(np.arange(0.0, 360.0, 6.0))
FAINT = predict_scan(ARENA, PLACE, replace(NXT, threshold_db=-50.0), ANGLES + PLACE.heading)
_A_LITTLE = 1e-6  # dB


def range_at(change: float, index: int) -> float:
    """Return the range at a heading with another threshold."""
    board, heading = replace(NXT, threshold_db=NXT.threshold_db + change), FAINT.headings[index : index + 1]
    return float(weigh_paths(ARENA, PLACE, board, heading, FAINT.paths).ranges[0])


def ranges_at(change: float) -> FloatArray:
    board = replace(NXT, threshold_db=NXT.threshold_db + change)
    return weigh_paths(ARENA, PLACE, board, FAINT.headings, FAINT.paths).ranges


def agrees(one: float, other: float) -> bool:
    return math.isnan(one) == math.isnan(other) and not abs(one - other) > TOLERANCE


def test_details_are_json_whose_margins_are_those_of_other_boards_and_rooms() -> None:
    exact = ranges_at(0.0)
    measured = exact + 0.02 * (np.arange(len(ANGLES)) % 9 == 0)
    measured[5::10] = math.nan
    readings = readings_of(ANGLES, np.column_stack((measured, measured + 0.7)))
    comparison = compare_readings(readings, ARENA, PLACE, NXT)
    found, paths = details(comparison), comparison.prediction.paths
    assert json.loads(json.dumps(found)) == found
    seen, several = {"with_higher_threshold": 0, "with_lower_threshold": 0, "threshold_change_db": 0}, 0
    for index, (row, entry) in enumerate(zip(comparison.rows, found["readings"], strict=True)):
        assert entry["turntable_deg"] == pytest.approx(math.degrees(row.reading.angle))
        assert entry["heading_deg"] == pytest.approx((math.degrees(row.reading.angle) + 20.0) % 360.0)
        assert (entry["measured_m"], entry["predicted_m"]) == (row.measured, row.predicted)
        assert (entry["class"], entry["explanation"]) == (row.kind.value, explain_reading(comparison, index))
        echoes = assigned_echoes(comparison, index)
        several += len(echoes) > 1
        assert [(one["measured_m"], one["predicted_m"], one["level_db"], one["via"]) for one in entry["echoes"]] == [
            (far, echo and echo.range, echo and echo.level_db, echo and [*paths.via(echo.path, ARENA)])
            for far, echo in echoes
        ]
        if (louder := entry["with_higher_threshold"]) and entry["margin_db"] is not None:
            assert range_at(entry["margin_db"] + _A_LITTLE, index) == pytest.approx(louder["range_m"])
            seen["with_higher_threshold"] += 1
        if (fainter := entry["with_lower_threshold"]) and entry["lacking_db"] < 15:
            assert range_at(-entry["lacking_db"] - _A_LITTLE, index) == pytest.approx(fainter["range_m"])
            seen["with_lower_threshold"] += 1
        if (change := entry["threshold_change_db"]) and change > -15:
            after = range_at(change + math.copysign(_A_LITTLE, change), index)
            assert agrees(after, math.nan if row.measured is None else row.measured)
            seen["threshold_change_db"] += 1
        if entry["next"] is not None and entry["predicted_m"] is not None:
            assert entry["next"]["range_m"] - entry["predicted_m"] == pytest.approx(entry["next_behind_m"], abs=1e-9)
    assert min(*seen.values(), several) > 2
    for pair in found["regions"]["pairs"]:
        of_scan, predicted = pair["measured"], pair["predicted"]
        assert pair["farther_m"] == pytest.approx(of_scan["range_m"] - predicted["range_m"], abs=1e-9)
        assert pair["wider_deg"] == pytest.approx(of_scan["width_deg"] - predicted["width_deg"], abs=1e-6)
        turned = (of_scan["bearing_deg"] - predicted["bearing_deg"] + 180) % 360 - 180
        assert pair["turned_deg"] == pytest.approx(turned, abs=1e-6)
    assert len(found["regions"]["pairs"]) > 3


def test_another_echo_wins_exactly_after_the_stated_shift_of_a_wall() -> None:
    options, here = PredictionOptions(diffraction=False), Place("", (1.793, 0.3))
    headings = np.radians(np.arange(0.0, 360.0, 10.0))
    scan = predict_scan(ARENA, here, NXT, headings, options)
    entries = details(compare_readings(readings_of(headings, scan.ranges), ARENA, here, NXT, options=options))
    left = np.sign((left_normals(ARENA.walls) * (np.array(here.position) - ARENA.walls[:, :2])).sum(axis=1))
    slight = 0
    for index, entry in enumerate(entries["readings"]):
        change = entry["wall_change"]
        if change is None or abs(change["nearer_m"]) > 0.025:
            continue
        first = list(scan.paths.via(int(scan.winners[index]), ARENA))
        for share, via in ((0.95, first), (1.05, change["to"]["via"])):
            by = share * change["nearer_m"] * float(left[ARENA.names.index(change["wall"])])
            moved = with_shifted_walls(ARENA, {change["wall"]: by})
            after = predict_scan(moved, here, NXT, headings[index : index + 1], options)
            assert list(after.paths.via(int(after.winners[0]), moved)) in (via, via[::-1])
        slight += 1
    assert slight > 0
    near = compare_readings(readings_of([math.radians(320.0)], [0.3]), ARENA, Place("", (1.805, 0.3)), NXT)
    assert re.search(r"with \w+ 0\.005 m (near|farth)er it would be one reflection, south$", explain_reading(near, 0))


SIMPLE = load_room("simple")
FIGURE_9 = SIMPLE.place("figure9")  # 0.774 m from the left wall, 0.085 m from the bottom, 0.657 m from the top
PAPER, POLAROID = load_board("paper"), load_board("polaroid-6500")
REFLECTANCE = 0.95
FALSE_WALL = "three reflections, bottom, top, bottom"
BLANKED = "the near wall (0.085 m) lies within blanking"


def scan_at(degrees: float, board: Board = PAPER) -> PredictedScan:
    return predict_scan(SIMPLE, FIGURE_9, board, np.radians([degrees]))


def said_of(degrees: float, range_: float, board: Board = PAPER, place: Place = FIGURE_9) -> str:
    readings = readings_of(np.radians([degrees]), [range_])
    return explain_reading(compare_readings(readings, SIMPLE, place, board), 0)


def at_level(over_db: float) -> Board:
    """Return a board that receives the top wall straight ahead `over_db` over its threshold."""
    return replace(PAPER, threshold_db=min(0.0, 20 * math.log10(REFLECTANCE) - over_db))


@pytest.mark.parametrize(
    ("degrees", "range_", "board", "sentence"),
    [
        (270, 0.827, PAPER, f"0.827 m at 270.0°: {FALSE_WALL}; {BLANKED}"),
        (90, math.nan, PAPER, "no echo at 90.0°: the model predicts 0.657 m by one reflection, top"),
        (90, 0.5, PAPER, "0.500 m at 90.0°: nearer than the model's 0.657 m by one reflection, top; no path of the…"),
        (90, 1.399, PAPER, "1.399 m at 90.0°: a later echo, three reflections, …"),
        (90, 0.657, at_level(0.4), "…; it is only 0.4 dB over the threshold; a higher threshold gives silence"),
        (90, 0.657, at_level(2.5), "0.657 m at 90.0°: one reflection, top"),
        (90, math.nan, at_level(0.4), "…; a threshold 0.4 dB higher would make the model agree"),
        (90, 0.657, at_level(-0.3), "…slightly below the threshold here; a threshold 0.3 dB lower would make the mo…"),
        (90, 0.3, replace(PAPER, threshold_db=0.0), "…the model predicts no echo here; an object may be missing in…"),
        (90, math.nan, replace(PAPER, threshold_db=0.0), "no echo at 90.0°: none is predicted either…"),
    ],
)
def test_the_sentence_about_a_reading(degrees: float, range_: float, board: Board, sentence: str) -> None:
    pattern = ".*".join(map(re.escape, sentence.split("…")))
    assert re.fullmatch(pattern, said_of(degrees, range_, board))


def test_a_sentence_names_the_own_body_a_place_outside_and_an_echo_without_a_path() -> None:
    body = replace(PAPER, own_body=(OwnBodyPart(from_deg=40.0, to_deg=80.0, nearest=0.05, farthest=0.09),))
    own = "0.070 m at 50.0°: own body, an echo of the carrier of the sensor and not of the room"
    assert said_of(50.0, 0.07, body) == own
    outside = said_of(180.0, 0.5, place=replace(FIGURE_9, position=(-1.0, 0.3)))
    assert outside.endswith("the model predicts no echo here; the sensor is outside the walls")
    comparison = compare_readings(readings_of([math.pi / 2], [0.5]), SIMPLE, FIGURE_9, PAPER)
    noise = replace(comparison.prediction, winners=np.array([-1]), receiver=Receiver.BOARD)
    assert "no path: noise, or the board's own burst" in explain_reading(replace(comparison, prediction=noise), 0)


def test_a_sentence_states_what_the_receiver_adds_to_the_path() -> None:
    """The room has one wall at 0.085 m and one at 0.657 m: down, up, down is 2 × 0.827 m, whatever the receiver."""
    of_board = scan_at(270.0, POLAROID)
    range_ = float(of_board.ranges[0])
    assert range_ > 0.828
    added = f"half of the path is 0.827 m, and the receiver of the board adds {range_ - 0.827:.3f} m"
    assert explain_heading(of_board, 0) == f"{range_:.3f} m predicted at 270.0°: {FALSE_WALL}; {added}; {BLANKED}"
    assert said_of(270.0, range_, POLAROID) == f"{range_:.3f} m at 270.0°: {FALSE_WALL}; {added}; {BLANKED}"
    # so that the sum is not the reading
    assert f"{added}; {range_:.3f} m is predicted; the near" in said_of(270.0, range_ + 0.01, POLAROID)
    assert outcome_text(ranked_echoes(of_board, 0)[0]) == f"wins, receiver adds {range_ - 0.827:.3f} m"
    assert "the receiver of the board subtracts 0.010 m" in said_of(270.0, 0.817, replace(PAPER, range_offset=-0.01))


def via(scan: PredictedScan, echo: RankedEcho) -> str:
    return ">".join(scan.paths.via(echo.path, scan.room))


def test_levels_are_those_of_a_piston_off_its_axis_and_distances_those_of_image_sources() -> None:
    """A piston, twice 2 J₁(x)/x cos(angle), relative to its axis (CIM-92-9 eq. 1)."""
    x = PAPER.wavenumber(SIMPLE.air) * PAPER.aperture_radius * math.sin(math.radians(20.0))
    level = 20 * math.log10(REFLECTANCE * (2 * j1(x) / x * math.cos(math.radians(20.0))) ** 2)
    scan = scan_at(200.0)
    left = next(echo for echo in ranked_echoes(scan, 0) if via(scan, echo) == "left")
    assert left.level_db == pytest.approx(level, abs=0.02)
    assert outcome_text(left) == f"{PAPER.threshold_db - level:.1f} dB too weak"
    assert remedy_text(remedy(scan, 0, left)) == f"a threshold {PAPER.threshold_db - level:.1f} dB lower"
    scan = scan_at(0.0)  # the right wall is 0.154 m away, within blanking; then right, left, right
    again = next(echo for echo in ranked_echoes(scan, 0) if via(scan, echo) == "right>left>right>left>right")
    assert again.behind == pytest.approx(0.928, abs=1e-3)
    assert outcome_text(again, lambda metres: f"{100 * metres:.0f} cm") == "93 cm behind the winner"
    # what the receiver of a board adds to the winner makes no other echo nearer to it
    scan = scan_at(270.0, POLAROID)
    behind = next(echo.behind for echo in ranked_echoes(scan, 0) if via(scan, echo) == "bottom>right>top>bottom")
    assert behind == pytest.approx(math.hypot(0.827, 0.154) - 0.827, abs=2e-4)


def test_headings_and_estimates_in_text() -> None:
    assert [in_degrees(-math.pi / 2), in_degrees(math.radians(359.94), 2)] == [270.0, 359.94]
    assert [heading_text(math.radians(359.94)), heading_text(3 * math.pi)] == ["359.9°", "180.0°"]
    # an estimated heading is within half a turn of the known one
    assert estimate_degrees(math.radians(359.9), decimals=1) == -0.1
    assert estimate_degrees(math.radians(-0.01), math.tau, 1) == 360.0
    assert estimate_degrees(math.pi) == estimate_degrees(-math.pi) == 180.0
    assert str(estimate_degrees(-1e-12)) == "0.0"
    # two significant digits of the deviation
    for value, deviation, unit, texts in (
        (-0.000004, 0.000996, "m", ("0.0000", "1.0 mm")),
        (1.7196661, 0.000059, "m", ("1.719666", "0.059 mm")),
        (21.4, 12.3, "°C", ("21", "12 °C")),
    ):
        assert (estimate_text(value, deviation), deviation_text(deviation, unit)) == texts
