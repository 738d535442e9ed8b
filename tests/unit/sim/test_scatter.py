"""Rough surfaces: Lambert's law along walls and over floors, energy, sums by power, and the speckle of a grain."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.optimize import brentq
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.board.signal import RATE, Arrivals, burst_of, pulses
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, search_for, weigh_paths
from sonarhw_sim.rays.paths import PATCH, Paths, PathSearch, find_paths, scattered_paths
from sonarhw_sim.room.room import Place, Room, parse_room

WAVELENGTH = 0.00696


SEARCH = PathSearch(20.0, WAVELENGTH, diffraction=False)


def wall_room(scatter: float, *, reflectance: float = 0.8, half: float = 200.0, post: bool = False) -> Room:
    """Return a room with a wall along y = 1, `half` to both sides, or a post of radius 0.3 with its near side there."""
    far = f"points = [[{-half}, {50.0 if post else 1.0}], [{half}, {50.0 if post else 1.0}]]"
    pillar = '[[posts]]\nname = "post"\ncenter = [0.0, 1.3]\nradius = 0.3\nmaterial = "carpet"' if post else ""
    return parse_room(
        f"""
        name = "carpet"
        [materials.carpet]
        reflectance = {reflectance}
        scatter = {scatter}
        [[walls]]
        name = "wall"
        edges = ["wall"]
        {far}
        material = "carpet"
        {pillar}
        """,
        "carpet",
    )


def returned_power(patches: Paths, lower: float, upper: float) -> float:
    among = (patches.departures > lower) & (patches.departures < upper)
    return float((patches.gains[among] ** 2).sum())


def test_patches_together_return_the_integral_along_the_wall() -> None:
    # integral along the wall: power on dx, scattered by Lambert's law, relative to a mirror
    def of_mirror(x: float) -> float:
        distance = math.hypot(x, 1.0)
        cosine = 1.0 / distance
        falls_on = cosine / (math.tau * distance)
        comes_back = falls_on * (cosine / 2) / distance
        return comes_back * 4 * math.pi * distance

    patches = scattered_paths(wall_room(0.4), (0.0, 0.0), SEARCH)
    for lower, upper in ((10.0, 50.0), (60.0, 120.0), (92.0, 140.0)):
        left, right = (1.0 / math.tan(math.radians(angle)) for angle in (upper, lower))
        integral = 0.8**2 * 0.4 * quad(of_mirror, left, right)[0]
        assert returned_power(patches, *np.radians([lower, upper])) == pytest.approx(integral, rel=0.08)


def test_specular_and_scattered_power_add_up_to_that_of_a_mirror() -> None:
    smooth, rough = wall_room(0.0), wall_room(0.36)
    assert rough.reflectances == pytest.approx(0.8 * smooth.reflectances)
    assert rough.reflectances**2 + rough.scattered**2 == pytest.approx(smooth.reflectances**2)
    assert find_paths(rough, (0.0, 0.0), SEARCH).gains == pytest.approx([0.8 * 0.8])


# Floors and ceilings.


QUIET = replace(load_board("polaroid-6500"), threshold_db=-60.0, own_burst_db=-200.0)


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
    return predict_scan(room, place_at(height), QUIET, np.radians(degrees), options)


def floor_level(height: float, begin: float, end: float) -> float:
    """Return the level (dB) of the Lambert floor with paths from `begin` to `end` (m), seen by the beam."""
    ka = QUIET.wavenumber(open_room().air) * QUIET.aperture_radius

    def power(around: float, sine: float) -> float:
        """Return the power by solid angle, which is that of the sine times that of the angle around."""
        off_axis = math.acos(min(1.0, math.sqrt(1 - sine**2) * math.cos(around)))
        return 4 * sine / math.pi * REFLECTANCE**2 * SCATTER * float(beam_gain(np.array([off_axis]), ka)[0]) ** 4

    sines = (2 * height / length for length in (end, begin))
    half, _ = dblquad(power, *sines, 0, math.pi / 2, epsabs=1e-10)
    return 10 * math.log10(2 * half)


@pytest.mark.parametrize(("height", "degrees"), [(0.1, 0.0), (0.15, 41.5)])
def test_level_is_the_integral_over_the_floor(height: float, degrees: float) -> None:
    scan = scan_of(open_room(), height, degrees)
    burst = 16 / QUIET.frequency * scan.room.air.speed_of_sound
    levels, loudest = scan.ping(0).levels, scan.ping(0).loudest
    assert {scan.paths.via(int(row), scan.room) for row in loudest} == {("floor",)}
    for length in (2.0, 2.5, 3.0, 4.0):
        row = int(np.searchsorted(scan.paths.lengths, length))
        exact = float(scan.paths.lengths[row])
        assert levels[row] == pytest.approx(floor_level(height, exact - burst, exact), abs=0.3)
    # by the time the power of one burst reaches the threshold
    first = float(2 * scan.distances[0])
    assert floor_level(height, first - burst, first) == pytest.approx(QUIET.threshold_db, abs=0.3)


# Predicted levels and readings.


HERE = Place("here", (0.0, 0.0))


BOARD = load_board("polaroid-6500")


IDEAL = replace(BOARD, gain_steps=(), own_burst_db=-200.0)


WALL = wall_room(0.5)  # along y = 1, with a reflectance of 0.8


DEGREES = (45.0, 65.0)


def scan_at(
    degrees: float, room: Room = WALL, board: Board = BOARD, patch: float = PATCH, **options: object
) -> PredictedScan:
    """Return the scan of one heading, with patches of this width."""
    chosen = PredictionOptions(**options)  # type: ignore[arg-type]
    search = search_for(room, board, chosen)
    both = [find_paths(room, HERE.position, search), scattered_paths(room, HERE.position, search, None, patch)]
    paths = Paths.join(both)
    paths = paths.select(np.argsort(paths.lengths, kind="stable"))
    return weigh_paths(room, HERE, board, np.radians([degrees]), paths, chosen)


def lambert_level(degrees: float, begin: float, end: float) -> float:
    """Return the level (dB) of a Lambert wall along y = 1 with paths from `begin` to `end` (m), seen by the beam."""
    ka = BOARD.wavenumber(WALL.air) * BOARD.aperture_radius

    def power(angle: float) -> float:
        beam = float(beam_gain(np.array([angle - math.radians(degrees)]), ka)[0])
        return 0.8**2 * 0.5 * math.sin(angle) * beam**4

    # a path at the angle φ is 2/sin φ long, on both sides of the perpendicular
    limits = [math.asin(min(1.0, 2 / max(length, 2.0))) for length in (end, begin)]
    whole = sum(
        quad(power, *ends, points=[math.radians(degrees)] if ends[0] < math.radians(degrees) < ends[1] else None)[0]
        for ends in (limits, (math.pi - limits[1], math.pi - limits[0]))
        if ends[1] > ends[0]
    )
    return 10 * math.log10(max(whole, 1e-30))


@pytest.mark.parametrize("degrees", DEGREES)
def test_level_and_range_are_those_of_the_integral_along_a_lambert_wall(degrees: float) -> None:
    scan = scan_at(degrees, receiver=Receiver.FIRST_ECHO)
    burst = 16 / BOARD.frequency * WALL.air.speed_of_sound
    found = brentq(lambda to: lambert_level(degrees, to - burst, to) + 40.0, 2.0, 2 / math.sin(math.radians(degrees)))
    assert scan.ranges[0] == pytest.approx(found / 2, abs=0.0005)
    loudest = max(lambert_level(degrees, end - burst, end) for end in np.linspace(found, found + burst, 60))
    assert scan.ping(0).level_of_reading == pytest.approx(loudest, abs=0.1)
    assert scan.paths.via(int(scan.winners[0]), WALL) == ("wall",)


@pytest.mark.parametrize("receiver", list(Receiver))
@pytest.mark.parametrize("degrees", DEGREES)
def test_level_does_not_depend_on_the_size_of_patches(degrees: float, receiver: Receiver) -> None:
    usual, half = (scan_at(degrees, patch=PATCH * factor, receiver=receiver) for factor in (1.0, 0.5))
    assert len(half.paths) > 1.9 * len(usual.paths)
    assert half.ping(0).level_of_reading == pytest.approx(usual.ping(0).level_of_reading, abs=0.1)
    assert half.distances[0] == pytest.approx(usual.distances[0], abs=0.001)
    peaks = [20 * math.log10(np.abs(scan.ping(0).signal(0.03).samples[1100:]).max()) for scan in (usual, half)]
    assert peaks[1] == pytest.approx(peaks[0], abs=0.1)


@pytest.mark.parametrize("degrees", DEGREES)
def test_signal_is_the_sum_of_the_powers_of_all_pulses(degrees: float) -> None:
    """Independent of histograms and of the carrier's beam: the exact pulse of each of many narrow patches."""
    rough = replace(WALL, reflectances=np.zeros(1))
    signal = scan_at(degrees, rough, IDEAL, receiver=Receiver.BOARD).ping(0).signal(0.02).samples
    speed, step = rough.air.speed_of_sound, math.radians(0.05)
    angles = np.arange(math.radians(20), math.radians(120), step)
    gains = np.sqrt(0.8**2 * 0.5 * np.sin(angles) * step)
    cosines = np.cos(angles - math.radians(degrees))
    exact, first = pulses(
        Arrivals(2 / np.sin(angles) / speed, gains, cosines, cosines), IDEAL, burst_of(IDEAL, speed), speed
    )
    power = np.zeros(len(signal) + exact.shape[1])
    for row, begin in enumerate(first.tolist()):
        power[begin : begin + exact.shape[1]] += np.abs(exact[row]) ** 2
    loud = power[: len(signal)] > 1e-2 * power.max()
    ratios = 20 * np.log10(np.abs(signal[loud])) - 10 * np.log10(power[: len(signal)][loud])
    # the model gives all patches the shape of the pulse straight ahead
    assert np.abs(ratios).max() < 1.0
    assert abs(20 * math.log10(np.abs(signal).max()) - 10 * math.log10(power.max())) < 0.2


def amplitude_at(length: float, scan: PredictedScan) -> float:
    """Return the amplitude that the receiver of a scan has at the instant of a path of this length, m."""
    if scan.receiver is Receiver.FIRST_ECHO:
        return float(10 ** (scan.ping(0).levels[np.searchsorted(scan.paths.lengths, length)] / 20))
    sample = round(length / WALL.air.speed_of_sound * RATE)
    return float(np.abs(scan.ping(0).signal(0.008).samples[sample]))


@pytest.mark.parametrize("receiver", list(Receiver))
def test_amplitudes_of_a_grain_have_a_rayleigh_distribution(receiver: Receiver) -> None:
    without_mirror = replace(WALL, reflectances=np.zeros(1))
    usual = replace(scan_at(65.0, without_mirror, IDEAL), receiver=receiver)
    length = 2 / math.sin(math.radians(65.0)) + 0.05
    amplitudes = np.array([amplitude_at(length, replace(usual, grain=seed)) for seed in range(250)])
    mean = amplitude_at(length, usual)
    from scipy.stats import kstest  # takes a second

    assert kstest(amplitudes, "rayleigh", (0.0, mean / math.sqrt(2))).pvalue > 0.01
    assert (amplitudes**2).mean() == pytest.approx(mean**2, rel=0.16)


def test_a_grain_is_a_function_of_its_seed() -> None:
    headings = np.radians(np.arange(40.0, 70.0, 1.0))
    one, same, other = (predict_scan(WALL, HERE, BOARD, headings, PredictionOptions(grain=seed)) for seed in (1, 1, 2))
    assert one.ranges.tolist() == same.ranges.tolist() != other.ranges.tolist()
    assert other.paths.scattered[other.winners].mean() > 0.5
