"""Readings of the carrier's own body: their class, and that they are in no share, fit, region or map."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.arcs import POSSIBLE, arcs_of, headings_and_ranges
from sonarhw_compare.explain import explain_reading, reading_details
from sonarhw_compare.fit.objective import make_problem
from sonarhw_compare.fit.parameters import free_parameters
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.map import map_scans
from sonarhw_compare.match import Kind, compare_readings
from sonarhw_compare.rooms.evidence import evidence_of
from sonarhw_compare.score import compare_regions, echo_statistics
from sonarhw_sim.board.profile import OwnBodyPart, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading

ROOM = load_room("rooms/arena.toml")
PLACE = Place("", (0.42, 0.42))
NXT = load_board("lego-nxt")
BOARD = replace(NXT, own_body=(OwnBodyPart(from_deg=40.0, to_deg=80.0, nearest=0.05, farthest=0.09),))
SPEED = ROOM.air.speed_of_sound


def scan() -> list[Reading]:
    """Return the predicted scan, but with an echo at 7 cm from 40 to 80 degrees."""
    headings = np.radians(np.arange(0.0, 360.0, 5.0))
    ranges = predict_scan(ROOM, PLACE, NXT, headings).ranges
    ranges[8:17] = 0.07
    times = [() if math.isnan(one) else (2 * one / SPEED,) for one in ranges.tolist()]
    return [Reading(k, 0, 0, float(headings[k]), 0.1 * k, times[k], SPEED) for k in range(len(times))]


def test_readings_of_the_own_body_have_their_class_and_are_in_no_share() -> None:
    comparison = compare_readings(scan(), ROOM, PLACE, BOARD)
    assert [row.index for row in comparison.rows if row.kind is Kind.OWN_BODY] == list(range(8, 17))
    summary, naive = comparison.summary(), compare_readings(scan(), ROOM, PLACE, NXT).summary()
    assert summary.classes["own_body"] == 9
    assert sum(summary.classes.values()) == summary.n == 72
    assert summary.n_echo == naive.n_echo - 9
    assert summary.within_5cm == summary.explained == 1.0
    assert summary.no_echo_agreement in (1.0, None)
    assert naive.within_5cm is not None
    assert naive.within_5cm < 0.9
    assert echo_statistics(comparison).echoes == summary.n_echo


def test_a_sentence_and_the_details_name_the_own_body() -> None:
    comparison = compare_readings(scan(), ROOM, PLACE, BOARD)
    assert explain_reading(comparison, 10) == (
        "0.070 m at 50.0°: own body, an echo of the carrier of the sensor and not of the room"
    )
    details = reading_details(comparison, 10)
    assert details["class"] == "own_body"
    assert details["echoes"] == []
    assert details["threshold_change_db"] is None


def test_regions_fits_and_maps_leave_the_own_body_out() -> None:
    comparison = compare_readings(scan(), ROOM, PLACE, BOARD)
    found = compare_regions(comparison)
    measured = [*(region for region, _ in found.pairs), *found.only_measured]
    assert all(region.range > 0.1 for region in measured)
    placed = PlacedScan(scan(), PLACE)
    free = free_parameters(("heading",), ("scan",), ROOM, BOARD)
    problem = make_problem([placed], ROOM, BOARD, free, PredictionOptions(), all_echoes=False)
    assert len(problem.scans[0].angles) == 72 - 9
    assert np.isnan(headings_and_ranges(placed, BOARD)[1][8:17]).all()
    assert headings_and_ranges(placed, NXT)[1][8:17] == pytest.approx(0.07)


def test_arcs_for_new_surfaces_count_rows_as_the_likelihood_does() -> None:
    """The search of surfaces ended with a traceback: the likelihood has no rows for the own body, the arcs had."""
    readings = scan()
    of_room = [one for k, one in enumerate(readings) if not 8 <= k < 17]
    evidence = evidence_of([PlacedScan(readings, PLACE)], [PoseSpread()], BOARD, ROOM.air)
    arcs = arcs_of(evidence.scans, BOARD, POSSIBLE)
    assert arcs == arcs_of([PlacedScan(of_room, PLACE)], NXT, POSSIBLE)
    assert max(max(arc.rows) for arc in arcs) < len(of_room)


def test_a_map_leaves_out_the_own_body() -> None:
    found = map_scans([PlacedScan(scan(), PLACE)], BOARD, ROOM)
    heard = sum(one.range is not None for one in scan()) - 9
    assert (found.echoes, found.undetermined) == (heard, 0)
