"""The warnings of a fit in the window: what to do is named as it is done there."""

from dataclasses import replace

import pytest
from sonarhw_compare.fit import Estimate, PlacedScan, free_parameters
from sonarhw_compare.fit.fitting import unexplained, warnings_of
from sonarhw_compare.match import Summary
from sonarhw_gui.jobs.searches import FitFound, warnings
from sonarhw_gui.model.scene import scene_with

from tests.fixtures.fit_results import BOARD, PLACE, ROOM, heading_fit

SUMMARY = Summary(10, 10, 9, 0.3, 0.0, None, None, {}, 1.0, 0.0, 0.0, 0.0, 0.0)


def found(everywhere: bool) -> FitFound:
    """Return a fit of two headings, with which 3 of 10 echoes match."""
    fit = heading_fit(-105.9, 74.1)
    several = warnings_of(fit)
    few = unexplained([PlacedScan((), PLACE, "this scan")], [SUMMARY])
    assert len(several) == len(few) == 1
    offset = free_parameters(("offset",), ("scan",), ROOM, BOARD)
    at_bound = warnings_of(replace(fit, parameters=offset, estimates={"offset": Estimate(0.06, 0.001, 0.0, 0.0)}))
    result = replace(fit, warnings=(*few, *several, *at_bound))
    return FitFound(scene_with(BOARD, ROOM, PLACE), 0, everywhere, result, ({}, {}), 0.3, (0.3, 0.3))


@pytest.mark.parametrize("everywhere", [False, True])
def test_a_warning_names_no_command_and_repeats_no_pose_of_the_list(everywhere: bool) -> None:
    texts = warnings(found(everywhere))
    assert len(texts) == 3
    assert "only 30% of the echoes" in texts[0]
    assert ("search in the whole room" in texts[0]) is not everywhere
    assert "the room may be symmetric" in texts[1]
    assert texts[2] == "offset is at its bound, 0.06 m"
    assert not any("`" in text or "105.9" in text for text in texts)
