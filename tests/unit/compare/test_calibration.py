"""Calibration in a known room and with plates: scans with hidden constants are predicted, or of a fake scanner."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import j1
from sonarhw_compare.calibration.outcome import Calibration
from sonarhw_compare.calibration.plate import calibrate_with_plates, find_blanking
from sonarhw_compare.calibration.plate_readings import plate_levels, plate_readings
from sonarhw_compare.calibration.room import calibrate_in_room, find_own_body, spreads
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes
from sonarhw_sim.room.room import Place, load_room

from sonarhw.errors import NoPlate
from sonarhw.readings import Ping
from tests.fixtures.plate_scans import CONSTANTS, hidden_board, plates, scanned_plate, start_board
from tests.fixtures.predicted_readings import predicted_readings, readings_of

ROOM, NXT = load_room("arena"), load_board("lego-nxt")
SPEED, AIR_SPEED = ROOM.air.speed_of_sound, Air().speed_of_sound
PLACES = [Place("", at) for at in ((0.84, 0.30), (1.80, 0.54), (1.38, 1.68), (1.38, 0.54), (1.80, 0.30))]


# Threshold, aperture and their spreads.


def test_spreads_are_those_of_the_readings() -> None:
    true, scans = replace(NXT, threshold_sd_db=3.0, range_sd=0.012), []
    angles = np.radians(np.arange(0.0, 360.0, 2.0))
    for place in PLACES:
        fake = RoomEchoes(ROOM, place, true, 0, EXACT)
        pings = [fake.receive(Ping(angle, 0, 0, 0.03, trace=False)).echo_times for angle in angles.tolist()]
        ranges = [times[0] * SPEED / 2 if times else math.nan for times in pings]
        scans.append(PlacedScan(readings_of(angles, ranges, SPEED), place))
    of_range, of_threshold = spreads(scans, ROOM, NXT, PLACES, lambda: None)
    assert of_range.value == pytest.approx(true.range_sd, abs=0.0015)
    assert of_threshold.value == pytest.approx(true.threshold_sd_db, abs=1.0)


# Reflectances.


# The carrier's own body, among the echoes that the room does not explain.


def unexplained(place: Place, body: Sequence[int], others: np.random.Generator | None = None) -> PlacedScan:
    """Return what the room does not explain: echoes at 20 to 22 cm at the turntable angles `body`, °, and silence.

    With `others`, one angle in seven has an echo from 0.1 to 2.5 m that is not in the room.
    """
    angles = np.arange(0, 360, 3)
    predicted = predict_scan(ROOM, place, NXT, np.radians(angles)).ranges
    ranges = predicted.copy()
    if others is not None:
        strange = others.random(len(angles)) < 1 / 7
        ranges[strange] = others.uniform(0.1, 2.5, strange.sum())
    own = np.isin(angles, body)
    ranges[own] = 0.20 + 0.02 * (angles[own] % 2)
    rows = ~(np.abs(ranges - predicted) <= 0.05)
    return PlacedScan(readings_of(np.radians(angles[rows]), ranges[rows], SPEED), place)


WIDE = [*range(60, 91)]
ACROSS = [*range(340, 360), *range(25)]
TWO_PARTS = [*range(84, 103), *range(201, 229)]


@pytest.mark.parametrize(
    ("bodies", "parts"),
    [
        ([WIDE] * 5, [(58.5, 91.5)]),
        ([ACROSS] * 5, [(340.5, 385.5)]),  # across angle 0
        ([WIDE] * 4 + [[]], [(58.5, 91.5)]),  # one scan misses it
        ([WIDE] * 4 + [[*WIDE, *range(93, 97)]], [(58.5, 97.5)]),  # an end that one place alone shows
        ([WIDE] * 4 + [[*WIDE, *range(96, 100)]], [(58.5, 91.5)]),  # apart from it
        ([TWO_PARTS] * 5, [(82.5, 103.5), (199.5, 229.5)]),
        ([WIDE], []),  # one place shows none
        ([[]] * 5, []),
    ],
)
def test_echoes_common_to_places_are_the_own_body(bodies: list[list[int]], parts: list[tuple[float, float]]) -> None:
    body = find_own_body([unexplained(place, one) for place, one in zip(PLACES, bodies, strict=False)])
    assert [(part.from_deg % 360, part.to_deg - part.from_deg) for part in body] == [
        (pytest.approx(low, abs=1.6), pytest.approx(high - low, abs=3.1)) for low, high in parts
    ]
    assert all((part.nearest, part.farthest) == pytest.approx((0.175, 0.245)) for part in body)


@pytest.mark.parametrize("seed", range(3))
def test_echoes_that_are_alike_by_chance_are_no_own_body(seed: int) -> None:
    random = np.random.default_rng(seed)
    assert find_own_body([unexplained(place, (), random) for place in PLACES]) == ()
    body = find_own_body([unexplained(place, WIDE, random) for place in PLACES])
    assert [part.spans(math.radians(75.0)) for part in body] == [True]


# Plates: hidden constants are found, or the reason is stated.


# the largest accepted error of each constant, in its unit
TOLERANCES = {
    "aperture_radius": 0.02 * CONSTANTS["aperture_radius"],
    "gain_step_db": 0.5,
    "threshold_db": 0.5,
    "rise_cycles": 0.05 * CONSTANTS["rise_cycles"],
    "own_burst_db": 1.0,
    "blanking": 20e-6,
}


def test_what_the_scans_hardly_determine_stays() -> None:
    """With an ideal gain and a threshold above the side lobes, one arc gives a relation of aperture and threshold."""
    start = replace(load_board("paper"), threshold_db=-20.0)
    readings = scanned_plate(start, 1.0, traces=False)
    found = calibrate_with_plates(start, [plate_readings("1 m", readings, 1.0, 0.0, start)])
    assert {"aperture_radius", "threshold_db"} & set(found.kept)
    assert "the scans determine it to ±" in " ".join(found.kept.values())


def test_blanking_by_the_scanner_hides_that_of_the_board() -> None:
    seen = plates(hidden_board(), distances=(0.25,), traces=False)
    found = Calibration(start_board(), start_board())
    find_blanking(found, seen)
    assert found.board.blanking == pytest.approx(CONSTANTS["blanking"], abs=TOLERANCES["blanking"])
    found = Calibration(start_board(), start_board())
    find_blanking(found, [replace(scan, blanked_until=CONSTANTS["blanking"]) for scan in seen])
    assert found.kept == {"blanking": "the scanner ignored all echoes before 1.7 ms; scan with less blanking"}
    assert found.board == start_board()


def test_plates_within_blanking_give_no_levels() -> None:
    scans = plates(hidden_board(), distances=(0.25,))
    with pytest.raises(NoPlate, match=r"no plate is beyond 0\.29 m, where blanking ends"):
        calibrate_with_plates(start_board(), scans)


def test_a_plate_has_the_level_of_a_perfect_wall_times_the_beam_there_and_back() -> None:
    board = load_board("paper")
    levels = plate_levels(board, AIR_SPEED, 1.3)
    angles = np.radians([0.5, 3.0, 7.5, 10.0, 18.0])
    x = board.wavenumber(Air()) * board.aperture_radius * np.sin(angles)
    expected = 40 * np.log10(np.abs(2 * j1(x) / x) * np.cos(angles))
    assert levels.detected_at(angles) == pytest.approx(expected, abs=0.01)
    assert levels.detected_at(-angles) == pytest.approx(expected, abs=0.01)
    # a burst contains other frequencies than its carrier, which matter little in the main lobe
    assert levels.peaks_at(angles[:3]) == pytest.approx(expected[:3], abs=0.1)


# A value is changed if no single place decides it.


def test_a_value_of_the_geometry_that_one_place_alone_shows_is_not_changed() -> None:
    room, board = load_room("arena"), load_board("hc-sr04")
    scans = [
        PlacedScan(predicted_readings(room, room.places[name], replace(board, range_offset=by), 10.0), place, name)
        for name, by in zip(("p0", "p2", "p3"), (0.0, 0.0, 0.06), strict=True)
        for place in [room.places[name]]
    ]
    found = calibrate_in_room(board, scans, room)
    assert found.without_places
    assert not found.without_places.keys() & {finding.key for finding in found.findings}
    # 6 cm at one place look like another scale of the turntable, but not without this place or another one
    assert all("by all scans, but without p" in found.kept[key] for key in found.without_places)
    assert any(" without p0: " in line for line in found.lines())
