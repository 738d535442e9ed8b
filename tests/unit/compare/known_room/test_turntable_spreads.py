"""The spreads of threshold and range of a calibration: those of simulated readings, not the bounds of the search."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_compare.calibration.room import spreads
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Ping, Reading

ROOM, NXT = load_room("rooms/arena.toml"), load_board("lego-nxt")
PLACES = [Place("", at) for at in ((0.84, 0.30), (1.80, 0.54), (1.38, 1.68), (1.38, 0.54), (1.80, 0.30))]
BOUND = 8.0  # dB, of the search


def scans_of(board: Board) -> list[PlacedScan]:
    scans = []
    for place in PLACES:
        fake = RoomEchoes(ROOM, place, board, 0, EXACT)
        angles = np.radians(np.arange(0.0, 360.0, 2.0)).tolist()
        pings = [fake.receive(Ping(angle, 0, 0, 0.03, trace=False)) for angle in angles]
        readings = [
            Reading(k, 0, 0, angle, 0.1 * k, ping.echo_times, ROOM.air.speed_of_sound)
            for k, (angle, ping) in enumerate(zip(angles, pings, strict=True))
        ]
        scans.append(PlacedScan(readings, place))
    return scans


def test_spreads_are_those_of_the_readings() -> None:
    true = replace(NXT, threshold_sd_db=3.0, range_sd=0.012)
    of_range, of_threshold = spreads(scans_of(true), ROOM, NXT, PLACES, lambda: None)
    assert of_range.value == pytest.approx(true.range_sd, abs=0.0015)
    assert of_threshold.value == pytest.approx(true.threshold_sd_db, abs=1.0)


def test_the_search_does_not_end_in_a_corner_of_its_bounds() -> None:
    """With an aperture that is 20 % too large in the profile, the first climb ended at the bound of the spread."""
    true = replace(NXT, threshold_sd_db=1.5, range_sd=0.012, aperture_radius=0.003, threshold_db=-19.0)
    _, of_threshold = spreads(scans_of(true), ROOM, NXT, PLACES, lambda: None)
    assert math.isfinite(of_threshold.deviation)
    assert of_threshold.value < 0.8 * BOUND
