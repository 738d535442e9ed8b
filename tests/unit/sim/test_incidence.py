"""Tables of reflectances along paths, against cases worked out by hand, and over the frequencies of a burst."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.space.sections import paths_from

FREQUENCY = 50e3


def line(degrees: float) -> float:
    """Return the reflectance at an angle of incidence: 0.2 straight on, 0.8 at 60° and beyond, straight between."""
    return 0.2 + 0.01 * min(degrees, 60.0)


def foam_room(more: str, table: str = "", scatter: float = 0.0) -> Room:
    usual = "".join(
        f"{{ incidence_deg = {degrees}, frequency = {FREQUENCY}, reflectance = {line(degrees)} }},"
        for degrees in (0, 60)
    )
    return parse_room(
        f"""
        name = "foam"
        [materials.foam]
        scatter = {scatter}
        table = [{table or usual}]
        {more}
        """,
        "foam",
    )


def walls(*points: tuple[float, float], closed: bool = False, names: str = "") -> str:
    corners = ", ".join(f"[{x}, {y}]" for x, y in points)
    edges = f"edges = {names.split()}" if names else ""
    return f'[[walls]]\nname = "wall"\npoints = [{corners}]\nclosed = {str(closed).lower()}\n{edges}\nmaterial = "foam"'


BOX = walls((0.0, 0.0), (2.0, 0.0), (2.0, 1.5), (0.0, 1.5), closed=True, names="south east north west")


def found(room: Room, place: Place, **options: object) -> Paths:
    wavelength = room.air.speed_of_sound / FREQUENCY
    return paths_from(room, place, PathSearch(5.0, wavelength, **options))  # type: ignore[arg-type]


def test_reflections_in_a_box_have_the_angles_of_image_sources() -> None:
    """All walls are parallel to an axis, so each path keeps its angles to both: the direction of its image."""
    room, place = foam_room(BOX), Place("here", (0.5, 0.4))
    paths = found(room, place, diffraction=False)
    assert len(paths) > 20
    for k in range(len(paths)):
        to_x = math.degrees(math.acos(min(1.0, abs(math.cos(paths.departures[k])))))
        angles = {"south": 90 - to_x, "north": 90 - to_x, "east": to_x, "west": to_x}
        expected = math.prod(line(angles[name]) for name in paths.via(k, room))
        assert paths.gains[k] == pytest.approx(expected, rel=1e-6)
    corner = [k for k in range(len(paths)) if paths.via(k, room) == ("south", "west")]
    # the corner is 0.5 m left and 0.4 m below: 51.34° on the south wall, 38.66° on the west wall
    assert paths.gains[corner] == pytest.approx([0.7134 * 0.5866], abs=1e-4)


def test_a_post_has_its_own_angle() -> None:
    post = '[[posts]]\nname = "post"\ncenter = [0.0, 2.0]\nradius = 0.2\nmaterial = "foam"\n' + walls((-9, 50), (9, 50))
    room = foam_room(post)
    search = PathSearch(5.0, room.air.speed_of_sound / FREQUENCY, diffraction=False)
    for aside in (0.0, 1.5):
        paths = paths_from(room, Place("here", (-aside, 0.0)), search, (aside, 0.0))
        constant = replace(room, tables={})
        usual = paths_from(constant, Place("here", (-aside, 0.0)), search, (aside, 0.0))
        row = int(np.flatnonzero(paths.bounces == 1)[0])
        # by symmetry it touches the nearest point, (0, 1.8)
        assert paths.gains[row] / usual.gains[row] == pytest.approx(line(math.degrees(math.atan2(aside, 1.8))) / 0.8)


def test_an_edge_fits_to_the_reflection_of_its_wall() -> None:
    """Where a wall ends exactly at the foot of the perpendicular, the edge returns half of its reflection."""
    room = foam_room(walls((0.0, 1.0), (9.0, 1.0)))
    for aside in (0.0, 0.6):
        here, there = Place("here", (-aside - 1e-6, 0.0)), (aside - 1e-6, 0.0)
        search = PathSearch(3.0, room.air.speed_of_sound / FREQUENCY)
        paths = paths_from(room, here, search, there)
        edge = int(np.flatnonzero(paths.edges >= 0)[0])
        assert abs(paths.gains[edge]) == pytest.approx(line(math.degrees(math.atan(aside))) / 2, rel=0.05)


def rows(*values: tuple[float, float]) -> str:
    """Return a table of reflectances by frequency."""
    return ", ".join(f"{{ incidence_deg = 0.0, frequency = {f}, reflectance = {value} }}" for f, value in values)


def test_the_carrier_decides_for_paths_and_for_the_paper_s_receiver() -> None:
    room = foam_room(walls((-9.0, 1.0), (9.0, 1.0)), rows((40e3, 0.2), (60e3, 0.6)))
    assert found(room, Place("here", (0.0, 0.0)), diffraction=False).gains == pytest.approx([0.4])
    options = PredictionOptions(receiver=Receiver.FIRST_ECHO, diffraction=False)
    for name, frequency in (("polaroid-6500", 49412.0), ("polaroid-56", 55e3)):
        scan = predict_scan(room, Place("here", (0.0, 0.0)), load_board(name), np.radians([90.0]), options)
        expected = 0.2 + 0.4 * (frequency - 40e3) / 20e3
        assert scan.ping(0).level_of_reading == pytest.approx(20 * math.log10(expected), abs=1e-6)


def test_a_trace_of_the_chirp_has_the_reflectance_of_each_of_its_frequencies() -> None:
    """The spectrum of the echo, over that of a perfect wall, is the table: 0.9 at 50 kHz, 0.3 at 60 kHz."""
    board = replace(load_board("polaroid-56"), own_burst_db=-200.0)
    wall, here = walls((-9.0, 1.0), (9.0, 1.0)), Place("here", (0.0, 0.0))
    options = PredictionOptions(diffraction=False)
    spectra = []
    for table in (rows((50e3, 0.9), (60e3, 0.3)), rows((50e3, 1.0))):
        scan = predict_scan(foam_room(wall, table), here, board, np.radians([90.0]), options)
        spectra.append(np.fft.fft(scan.ping(0).signal(0.02).samples))
    frequencies = board.frequency + np.fft.fftfreq(len(spectra[0]), 1 / 200e3)
    within = (frequencies > 49e3) & (frequencies < 61e3)
    expected = np.clip(0.9 - 0.6 * (frequencies[within] - 50e3) / 10e3, 0.3, 0.9)
    # at some frequencies the chirp has hardly any sound
    loud = np.abs(spectra[1][within]) > 0.02 * np.abs(spectra[1]).max()
    assert np.abs(spectra[0][within] / spectra[1][within])[loud] == pytest.approx(expected[loud], abs=0.01)
