"""A heading is the same number in every output, and that of a reading is never 360 degrees."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.explain import explain_reading, summary_lines
from sonarhw_compare.fit import Estimate, FitResult, Mode, free_parameters
from sonarhw_compare.fit.fitting import warnings_of
from sonarhw_compare.headings import deviation_text, estimate_degrees, estimate_text, heading_text, in_degrees
from sonarhw_compare.report import report_html, report_of
from sonarhw_compare.scans import GivenScan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Reading

ROOM = load_room("rooms/simple.toml")
PLACE = ROOM.places["figure9"]
PAPER = load_board("paper")


@pytest.mark.parametrize("just_below", [-1e-17, math.tau, math.radians(-0.04), math.radians(359.96)])
def test_a_heading_just_below_zero_is_0_degrees(just_below: float) -> None:
    assert heading_text(just_below) == "0.0°"
    assert in_degrees(just_below, 1) == 0.0
    assert heading_text(just_below, 0) == "0°"


def test_other_headings_are_in_0_to_360_degrees() -> None:
    assert in_degrees(-math.pi / 2) == 270.0
    assert in_degrees(math.radians(359.94), 2) == 359.94
    assert heading_text(math.radians(359.94)) == "359.9°"
    assert heading_text(3 * math.pi) == "180.0°"


def test_report_sentence_and_summary_have_the_same_heading() -> None:
    place = replace(PLACE, heading=math.radians(-0.01))
    reading = Reading(0, 0, 0, 0.0, 0.0, (0.001,), 340.0)
    report = report_of(GivenScan("log", (reading,)), ROOM, place, PAPER, PredictionOptions())
    page = report_html(report)
    assert "<td>turntable step 0 at</td><td>0.0°</td>" in page
    assert "<td>0.0</td>" in page
    assert " at 0.0°: " in explain_reading(report.comparison, 0)
    assert re.search("turntable step 0 at 0.0°", summary_lines(report.comparison.summary())[-1])
    assert "360.0" not in page


def test_an_estimated_heading_is_within_half_a_turn_of_the_known_one() -> None:
    assert estimate_degrees(math.radians(359.9), decimals=1) == -0.1
    assert estimate_degrees(math.radians(-0.01), math.tau, 1) == 360.0
    assert estimate_degrees(math.radians(-85.0), math.radians(270)) == pytest.approx(275.0)
    assert estimate_degrees(math.pi) == estimate_degrees(-math.pi) == 180.0
    assert str(estimate_degrees(-1e-12)) == "0.0"


def test_a_fit_has_two_significant_digits_of_its_deviation() -> None:
    table = list(heading_fit(-0.002).lines())
    assert table[1].split() == ["heading", "0.00°", "0.14°", "-0.30", "to", "0.30"]
    assert any("ranges +0.00% from" in line for line in table)
    assert (estimate_text(-0.000004, 0.000996), deviation_text(0.000996, "m")) == ("0.0000", "1.0 mm")
    assert (estimate_text(1.7196661, 0.000059), deviation_text(0.000059, "m")) == ("1.719666", "0.059 mm")
    assert (estimate_text(21.4, 12.3), deviation_text(12.3, "°C")) == ("21", "12 °C")


def test_solutions_that_print_alike_are_one() -> None:
    assert warnings_of(heading_fit(359.999, 0.001)) == ()
    (several,) = warnings_of(heading_fit(0.0, 180.0))
    assert str(several).startswith("2 solutions")
    assert str(several).endswith("heading 0.0°; heading 180.0°")
    assert several.kind == "several solutions"


def heading_fit(*degrees: float) -> FitResult:
    """Return a fit of the heading alone, with these solutions; the first is the best."""
    values = [math.radians(one) for one in degrees]
    return FitResult(
        parameters=free_parameters(("heading",), ("scan",), ROOM, PAPER),
        estimates={"heading": Estimate(values[0], math.radians(0.14), math.radians(-0.3), math.radians(0.3))},
        correlations=np.eye(1),
        noise={"range_m": 0.001, "level_db": 1.0, "missed": 0.0, "lost": 0.0, "stray_per_m": 0.0, "stretch": 0.999999},
        warnings=(),
        modes=tuple(Mode({"heading": value}, 0.0) for value in values),
        room=ROOM,
        places=(PLACE,),
        board=PAPER,
        score=0.0,
        samples=np.empty((0, 1)),
    )
