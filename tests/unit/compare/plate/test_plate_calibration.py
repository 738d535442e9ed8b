"""Scans of a wall by a fake scanner with hidden constants: the calibration finds them, or says why not."""

from dataclasses import replace

import pytest
from sonarhw_compare.calibration.outcome import Calibration
from sonarhw_compare.calibration.plate import calibrate_with_plates, find_blanking
from sonarhw_compare.calibration.plate_readings import plate_readings
from sonarhw_sim.board.profile import load_board

from sonarhw.errors import NoPlate
from tests.unit.compare.plate.plate_scans import CONSTANTS, hidden_board, plates, scanned_plate, start_board

# the largest accepted error of each constant, in its unit
TOLERANCES = {
    "aperture_radius": 0.02 * CONSTANTS["aperture_radius"],
    "gain_step_db": 0.5,
    "threshold_db": 0.5,
    "rise_cycles": 0.05 * CONSTANTS["rise_cycles"],
    "own_burst_db": 1.0,
    "blanking": 20e-6,
}


def test_all_hidden_constants_are_found_from_traces() -> None:
    start, scans = start_board(), plates(hidden_board(), tilt_deg=1.3)
    found = calibrate_with_plates(start, scans)
    assert not found.kept
    assert not found.doubts
    assert {one.key for one in found.findings} == set(CONSTANTS)
    for one in found.findings:
        assert one.value == pytest.approx(CONSTANTS[one.key], abs=TOLERANCES[one.key]), one.key
        assert one.low <= CONSTANTS[one.key] <= one.high, one.key
        assert one.high - one.low < 4 * TOLERANCES[one.key], one.key
    text = found.profile("mine").text
    assert "#   0.25 m: plate at 0.25 m" in text
    assert "beginning with profile 'polaroid-6500'" in text
    lines = {line.split(" = ")[0]: line for line in text.splitlines() if " = " in line}
    assert "# calibrated, 95 % 0.0" in lines["aperture_radius"]
    assert "before: 0.0192 (m)" in lines["aperture_radius"]


def test_a_ring_down_that_differs_from_the_swelling_is_found() -> None:
    hidden = {"rise_cycles": 2.0, "ring_cycles": 9.0}
    scans = plates(hidden_board(**hidden), distances=(0.25, 0.5, 1.0), seed=3)
    found = {one.key: one for one in calibrate_with_plates(start_board(), scans).findings}
    for key, value in hidden.items():
        assert found[key].low <= value <= found[key].high, key
        assert found[key].value == pytest.approx(value, rel=0.05), key
    assert found["ring_cycles"].before == start_board().rise_cycles
    assert found["own_burst_db"].value == pytest.approx(CONSTANTS["own_burst_db"], abs=TOLERANCES["own_burst_db"])
    assert found["aperture_radius"].value == pytest.approx(CONSTANTS["aperture_radius"], rel=0.02)


def test_without_traces_hearing_gives_aperture_gain_and_an_interval_that_contains_the_threshold() -> None:
    """A plate that ends between two headings tells no more with three pings at each than with one."""
    hidden = {"aperture_radius": 0.02218, "gain_step_db": 3.327, "threshold_db": -38.463, "rise_cycles": 1.5}
    scans = plates(hidden_board(**hidden), seed=4, tilt_deg=-0.88, traces=False)
    found = calibrate_with_plates(start_board(), scans)
    assert found.kept["rise_cycles"] == found.kept["own_burst_db"] == "the logs contain no traces"
    assert {one.key for one in found.findings} >= {"aperture_radius", "gain_step_db"}
    for one in found.findings:
        true = (CONSTANTS | hidden)[one.key]
        assert one.low <= true <= one.high, one.key
        assert one.value == pytest.approx(true, abs=TOLERANCES[one.key]), one.key


def test_one_plate_shows_no_gain_and_no_blanking() -> None:
    start, scans = start_board(), plates(hidden_board(), distances=(1.0,))
    found = calibrate_with_plates(start, scans)
    assert found.kept["gain_step_db"] == "one log shows the gain at one time only"
    assert "no plate is so near" in found.kept["blanking"]
    assert (found.board.gain_step_db, found.board.blanking) == (start.gain_step_db, start.blanking)
    assert found.board.aperture_radius == pytest.approx(CONSTANTS["aperture_radius"], rel=0.02)


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


def test_a_plate_elsewhere_is_refused() -> None:
    readings = scanned_plate(hidden_board(), 1.0, traces=False)
    with pytest.raises(NoPlate, match=r"2 m\.mcap: the plate is detected at 0 headings, expected at least 5"):
        plate_readings("2 m.mcap", readings, 2.0, 0.0, start_board())


def test_plates_within_blanking_give_no_levels() -> None:
    scans = plates(hidden_board(), distances=(0.25,))
    with pytest.raises(NoPlate, match=r"no plate is beyond 0\.29 m, where blanking ends"):
        calibrate_with_plates(start_board(), scans)
