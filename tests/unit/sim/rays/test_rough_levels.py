"""A rough floor or ceiling scatters sound back by Lambert's law in space, as far as nothing stands before it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.rays.paths import PathSearch
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.space.levels import rough_level_paths

BOARD = replace(load_board("polaroid-6500"), threshold_db=-60.0, own_burst_db=-200.0)
SEARCH = PathSearch(8.0, 0.00696, diffraction=False)
FLOOR = '[floor]\nheight = 0.0\nmaterial = "carpet"'
REFLECTANCE, SCATTER = 0.8, 0.5


def open_room(levels: str = FLOOR, walls: str = "") -> Room:
    """Return a room with one wall far away, besides `walls`."""
    return parse_room(
        f"""
        name = "open"
        [materials.carpet]
        reflectance = {REFLECTANCE}
        scatter = {SCATTER}
        [materials.foam]
        reflectance = 0.0
        [[walls]]
        name = "far"
        points = [[-50.0, 50.0], [50.0, 50.0]]
        material = "foam"
        {walls}
        {levels}
        """,
        "open",
    )


def place_at(height: float) -> Place:
    return Place("here", (0.0, 0.0), height=height)


def scan_of(room: Room, height: float, *degrees: float) -> PredictedScan:
    options = PredictionOptions(receiver=Receiver.FIRST_ECHO)
    return predict_scan(room, place_at(height), BOARD, np.radians(degrees), options)


def lambert_level(height: float, begin: float, end: float) -> float:
    """Return the level (dB) of the Lambert floor with paths from `begin` to `end` (m), seen by the beam."""
    ka = BOARD.wavenumber(open_room().air) * BOARD.aperture_radius

    def power(around: float, sine: float) -> float:
        """Return the power by solid angle, which is that of the sine times that of the angle around."""
        off_axis = math.acos(min(1.0, math.sqrt(1 - sine**2) * math.cos(around)))
        return 4 * sine / math.pi * REFLECTANCE**2 * SCATTER * float(beam_gain(np.array([off_axis]), ka)[0]) ** 4

    sines = (2 * height / length for length in (end, begin))
    half, _ = dblquad(power, *sines, 0, math.pi / 2, epsabs=1e-10)
    return 10 * math.log10(2 * half)


@pytest.mark.parametrize("degrees", [0.0, 41.5])
@pytest.mark.parametrize("height", [0.1, 0.15])
def test_level_is_the_integral_over_the_floor(height: float, degrees: float) -> None:
    scan = scan_of(open_room(), height, degrees)
    burst = 16 / BOARD.frequency * scan.room.air.speed_of_sound
    levels, loudest = scan.ping(0).levels, scan.ping(0).loudest
    assert {scan.paths.via(int(row), scan.room) for row in loudest} == {("floor",)}
    for length in (2.0, 2.5, 3.0, 4.0):
        row = int(np.searchsorted(scan.paths.lengths, length))
        exact = float(scan.paths.lengths[row])
        assert levels[row] == pytest.approx(lambert_level(height, exact - burst, exact), abs=0.3)
    # by the time the power of one burst reaches the threshold
    first = float(2 * scan.distances[0])
    assert lambert_level(height, first - burst, first) == pytest.approx(BOARD.threshold_db, abs=0.3)


def test_ceiling_scatters_as_the_floor() -> None:
    ceiling = FLOOR.replace("floor", "ceiling").replace("0.0", "0.2")
    below, above = scan_of(open_room(), 0.1, 0.0), scan_of(open_room(ceiling), 0.1, 0.0)
    assert above.ranges == pytest.approx(below.ranges)
    assert above.paths.elevations == pytest.approx(-below.paths.elevations)
    assert (above.paths.elevations > 0).all()


def test_directions_and_points_lead_to_the_floor() -> None:
    (paths,) = rough_level_paths(open_room(), place_at(0.5), 0.5, SEARCH)
    assert paths.lengths.max() > 7.0
    reach = np.hypot(*paths.points[:, 1].T)
    assert paths.lengths == pytest.approx(2 * np.hypot(reach, 0.5))
    assert np.tan(paths.elevations) == pytest.approx(np.column_stack((-0.5 / reach, -0.5 / reach)))
    assert np.arctan2(*paths.points[:, 1].T[::-1]) == pytest.approx(paths.departures, abs=1e-9)


@pytest.mark.parametrize(
    ("obstacle", "height", "hidden"),
    [
        ('[[walls]]\nname = "w"\npoints = [[1.0, -9.0], [1.0, 9.0]]\nmaterial = "foam"', "", (1.0, math.inf)),
        # 0.3 m high, seen from 0.5 m: its shadow on the floor ends at 1 m · 0.5 / 0.2
        ('[[walls]]\nname = "w"\npoints = [[1.0, -9.0], [1.0, 9.0]]\nmaterial = "foam"', "[0.0, 0.3]", (1.0, 2.5)),
        ('[[walls]]\nname = "w"\npoints = [[1.0, -9.0], [1.0, 9.0]]\nmaterial = "foam"', "[0.6, 0.9]", (9.0, 9.0)),
        # the shadow begins at the near side, 1 m away, and ends behind the far side of the lid
        ('[[posts]]\nname = "p"\ncenter = [1.2, 0.0]\nradius = 0.2\nmaterial = "foam"', "[0.0, 0.3]", (1.0, 3.5)),
    ],
)
def test_obstacles_throw_shadows(obstacle: str, height: str, hidden: tuple[float, float]) -> None:
    room = open_room(walls=obstacle + (f"\nheight = {height}" if height else ""))
    (paths,) = rough_level_paths(room, place_at(0.5), 0.5, SEARCH)
    ahead = paths.select(np.flatnonzero(np.abs(paths.departures) < 0.02))
    (every,) = rough_level_paths(open_room(), place_at(0.5), 0.5, SEARCH)
    reaches = np.hypot(*every.points[np.abs(every.departures) < 0.02, 1].T)
    visible = reaches[(reaches < hidden[0]) | (reaches > hidden[1])]
    assert np.hypot(*ahead.points[:, 1].T) == pytest.approx(visible)


def test_smooth_levels_and_places_without_height_have_no_patches() -> None:
    smooth = open_room(FLOOR.replace("carpet", "foam"))
    assert rough_level_paths(smooth, place_at(0.5), 0.5, SEARCH) == []
    flat = predict_scan(open_room(), Place("here", (0.0, 0.0)), BOARD, np.zeros(1))
    assert len(flat.paths) == 0
