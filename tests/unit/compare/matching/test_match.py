"""Classes, figures, sentences and the plain fit, on scans with known truth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.explain import explain_reading
from sonarhw_compare.fit.starting import Fit, all_round, best_agreement, fit_scan
from sonarhw_compare.match import Comparison, Kind, classify, compare_readings
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.errors import InputError
from sonarhw.readings import Reading

ROOM = load_room("rooms/simple.toml")
PLACE = ROOM.places["figure9"]
PAPER = load_board("paper")
SPEED = 340.0


def reading(number: int, angle: float, distance: float | None) -> Reading:
    times = () if distance is None else (2 * distance / SPEED,)
    return Reading(number, 0, 0, angle, 0.1 * number, times, SPEED)


def predicted_readings(step_deg: float, heading: float = 0.0, offset: float = 0.0) -> list[Reading]:
    """Return predicted readings of a turntable with step 0 at `heading`, with ranges too short by `offset`."""
    angles = np.radians(np.arange(0, 360, step_deg))
    ranges = predict_scan(ROOM, PLACE, PAPER, angles + heading).ranges
    return [
        reading(k, float(a), None if math.isnan(r) else float(r) - offset)
        for k, (a, r) in enumerate(zip(angles, ranges, strict=True))
    ]


@pytest.mark.parametrize(
    ("measured", "predicted", "kind"),
    [
        (1.00, 1.05, Kind.MATCH),
        (1.0, 1.051, Kind.SHORT),
        (1.051, 1.0, Kind.LONG),
        (None, 1.0, Kind.MISSED),
        (1.0, None, Kind.EXTRA),
        (None, None, Kind.BOTH_SILENT),
    ],
)
def test_every_reading_has_one_class(measured: float | None, predicted: float | None, kind: Kind) -> None:
    assert classify(measured, predicted) is kind


def test_a_predicted_scan_matches_entirely() -> None:
    summary = compare_readings(predicted_readings(5), ROOM, PLACE, PAPER).summary()
    assert summary.within_5cm == 1.0
    assert summary.explained == 1.0
    assert summary.n == 72
    assert summary.median_abs_error_m == pytest.approx(0, abs=1e-9)
    assert sum(summary.classes.values()) == 72


def test_figures_count_the_changes_of_the_scan() -> None:
    # with this threshold, some headings are silent
    board = replace(PAPER, threshold_db=-3.0)
    angles = np.radians(np.arange(0, 360, 5.0))
    ranges = predict_scan(ROOM, PLACE, board, angles).ranges
    with_echo, silent = np.flatnonzero(~np.isnan(ranges)), np.flatnonzero(np.isnan(ranges))
    assert len(silent) > 5
    measured: list[float | None] = [None if math.isnan(r) else float(r) for r in ranges]
    measured[with_echo[0]] = None  # missed
    measured[with_echo[1]] = float(ranges[with_echo[1]]) - 0.3  # short
    measured[silent[0]] = 0.5  # extra
    readings = [reading(k, float(a), m) for k, (a, m) in enumerate(zip(angles, measured, strict=True))]
    summary = compare_readings(readings, ROOM, PLACE, board).summary()
    assert summary.classes["missed"] == summary.classes["short"] == summary.classes["extra"] == 1
    assert summary.n_echo == len(with_echo)
    assert summary.within_5cm == pytest.approx((len(with_echo) - 2) / len(with_echo))
    expected = ((len(silent) - 1) / len(silent) + (len(with_echo) - 1) / len(with_echo)) / 2
    assert summary.no_echo_agreement == pytest.approx(expected)


def test_figures_are_none_without_measured_echoes() -> None:
    summary = compare_readings([reading(0, 0.0, None)], ROOM, PLACE, PAPER).summary()
    assert (summary.within_5cm, summary.median_abs_error_m, summary.no_echo_agreement, summary.explained) == (None,) * 4


def test_a_sensor_outside_the_walls_is_mentioned() -> None:
    outside = replace(PLACE, position=(-1.0, 0.3))
    outside_text = explain_reading(compare_readings([reading(0, math.pi, 0.5)], ROOM, outside, PAPER), 0)
    assert outside_text.endswith("the model predicts no echo here; the sensor is outside the walls")


def sentence(angle_deg: float, distance: float | None) -> str:
    comparison = compare_readings([reading(0, math.radians(angle_deg), distance)], ROOM, PLACE, PAPER)
    return explain_reading(comparison, 0)


def test_a_false_wall_is_explained() -> None:
    assert sentence(270, 0.827) == (
        "0.827 m at 270.0°: three reflections, bottom, top, bottom; the near wall (0.085 m) lies within blanking"
    )


def test_other_classes_are_explained() -> None:
    assert sentence(90, None) == "no echo at 90.0°: the model predicts 0.657 m by one reflection, top"
    assert sentence(90, 0.5).startswith("0.500 m at 90.0°: nearer than the model's 0.657 m by one reflection, top;")
    assert "a later echo, " in sentence(90, 1.399)


def test_the_offset_is_added_to_measured_ranges() -> None:
    (row,) = compare_readings([reading(0, math.pi / 2, 0.6)], ROOM, PLACE, PAPER, offset=0.057).rows
    assert row.measured == pytest.approx(0.657)
    assert row.kind is Kind.MATCH
    assert compare_readings([reading(0, math.pi / 2, 0.6)], ROOM, PLACE, PAPER).rows[0].kind is not Kind.MATCH


def test_a_reading_of_the_model_that_is_noise_has_no_path() -> None:
    comparison = compare_readings([reading(0, math.pi / 2, 0.5)], ROOM, PLACE, PAPER)
    noise = replace(comparison.prediction, winners=np.array([-1]), receiver=Receiver.BOARD)
    assert "no path: noise, or the board's own burst" in explain_reading(replace(comparison, prediction=noise), 0)


def test_a_sentence_mentions_small_margins() -> None:
    scan = predict_scan(ROOM, PLACE, replace(PAPER, threshold_db=-1.5), np.array([math.pi / 2]))
    (echo,) = scan.ping(0).echoes[:1]
    for threshold, measured, expected_end in (
        (echo.level_db - 0.4, 0.657, "; it is only 0.4 dB over the threshold; a higher threshold gives silence"),
        (echo.level_db - 2.5, 0.657, "top"),
        (echo.level_db - 0.4, None, "; a threshold 0.4 dB higher would make the model agree"),
        (min(0.0, echo.level_db + 0.3), 0.657, "; a threshold 0.3 dB lower would make the model agree"),
    ):
        board = replace(PAPER, threshold_db=threshold)
        readings = [reading(0, math.pi / 2, measured)]
        sentence = explain_reading(compare_readings(readings, ROOM, PLACE, board), 0)
        assert sentence.endswith(expected_end)
        assert not expected_end or ("accounts for it" not in sentence and "may be missing in the room" not in sentence)


@pytest.mark.parametrize(("heading_deg", "offset"), [(0.0, 0.0), (37.5, 0.02), (200.0, -0.03)])
def test_fit_finds_heading_and_offset_of_a_predicted_scan(heading_deg: float, offset: float) -> None:
    readings = predicted_readings(6, math.radians(heading_deg), offset)
    fit = fit_scan(readings, ROOM, PLACE, PAPER, frozenset({"heading", "offset"}))
    assert math.degrees(fit.heading) == pytest.approx(heading_deg, abs=0.5 + 1e-9)
    assert fit.offset == pytest.approx(offset, abs=0.005)


def test_fit_finds_a_position_nearby() -> None:
    readings = predicted_readings(6, 0.5, 0.01)
    believed = replace(PLACE, position=(PLACE.position[0] + 0.02, PLACE.position[1] - 0.01))
    shares: list[float] = []
    fit = fit_scan(readings, ROOM, believed, PAPER, frozenset({"heading", "offset", "position"}), tick=shares.append)
    assert fit.place.position == pytest.approx(PLACE.position, abs=1e-9)
    assert fit.offset == pytest.approx(0.01)
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert len(shares) > 20  # one call for each position


@pytest.mark.parametrize(("more", "moved"), [(2, False), (12, True)])
def test_fit_moves_only_for_clearly_more_readings(more: int, moved: bool) -> None:
    # elsewhere, every prediction is 8 mm longer, so the readings that are 55 mm too long match
    here = 1.0 + 0.3 * np.sin(3 * all_round())
    elsewhere = replace(PLACE, position=(PLACE.position[0] + 0.01, PLACE.position[1]))
    too_long = np.zeros(120)
    too_long[np.arange(20) * 6] = 0.5
    too_long[np.arange(more) * 6] = 0.055
    readings = [
        reading(k, float(angle), float(near) + extra)
        for k, (angle, near, extra) in enumerate(zip(all_round()[::6], here[::6], too_long.tolist(), strict=True))
    ]
    silent = [reading(120 + k, float(angle), None) for k, angle in enumerate(all_round()[::6])]
    tables = [(PLACE, here), (elsewhere, here + 0.008)]
    fit = best_agreement([*readings, *silent], tables, frozenset({"position"}), PAPER)
    assert fit.place == (elsewhere if moved else PLACE)


def test_fit_changes_only_free_parameters() -> None:
    fit = fit_scan(predicted_readings(6, 1.0, 0.02), ROOM, PLACE, PAPER, frozenset({"heading"}))
    assert (fit.offset, fit.place.position) == (0.0, PLACE.position)


def test_fit_rejects_unknown_parameters() -> None:
    with pytest.raises(InputError, match="wind"):
        fit_scan(predicted_readings(30), ROOM, PLACE, PAPER, frozenset({"wind"}))


def test_no_heading_corrects_a_reversed_turntable() -> None:
    def share(readings: list[Reading]) -> float:
        fit = fit_scan(readings, ROOM, PLACE, PAPER, frozenset({"heading", "offset"}))
        comparison: Comparison = compare_readings(readings, ROOM, fit.place, PAPER, offset=fit.offset)
        return comparison.summary().within_5cm or 0.0

    readings = predicted_readings(6, 0.5)
    assert share(readings) > 0.95
    assert share([replace(r, angle=-r.angle) for r in readings]) < 0.6


def test_the_plain_fit_states_its_grid_and_a_value_at_its_edge() -> None:
    fit = Fit(0.01, PLACE, ("heading", "offset", "position"), 0.02)
    assert fit.search == (
        "heading in steps of 0.5°; offset within 60 mm in steps of 5 mm; position within 3 cm in steps of 1 cm"
    )
    assert fit.at_edge == ()
    assert len(fit.lines()) == 2
    edge = Fit(-0.06, PLACE, ("offset", "position"), 0.03)
    assert edge.at_edge == ("offset", "position")
    assert fit.doubts == ()
    assert edge.doubts == ("offset and position at the edge of the grid; a better fit may lie beyond",)
    assert Fit(0.06, PLACE, ("heading",), 0.03).at_edge == ()
    assert Fit(0.055, PLACE, ("offset", "position"), 0.024).at_edge == ()
