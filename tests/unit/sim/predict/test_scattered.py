"""Sound of rough surfaces adds by power over burst and beam, in both receivers; a grain makes a speckle of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.stats import kstest
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.board.signal import RATE, Arrivals, burst_of, pulses
from sonarhw_sim.predict.predicted_scan import PredictedScan, with_first_echoes, with_scattered_sound
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan, search_for, weigh_paths
from sonarhw_sim.rays.paths import PATCH, Paths, find_paths, scattered_paths
from sonarhw_sim.room.room import Place, Room, load_room

from tests.unit.sim.rays.test_scatter import wall_room

HERE = Place("here", (0.0, 0.0))
BOARD = load_board("polaroid-6500")
IDEAL = replace(BOARD, gain_steps=(), own_burst_db=-200.0)
WALL = wall_room(0.5)  # along y = 1, with a reflectance of 0.8
DEGREES = (45.0, 55.0, 65.0, 75.0)


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
    found = brentq(
        lambda end: lambert_level(degrees, end - burst, end) + 40.0, 2.0, 2 / math.sin(math.radians(degrees))
    )
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
    amplitudes = np.array([amplitude_at(length, replace(usual, grain=seed)) for seed in range(400)])
    mean = amplitude_at(length, usual)
    assert kstest(amplitudes, "rayleigh", (0.0, mean / math.sqrt(2))).pvalue > 0.01
    assert (amplitudes**2).mean() == pytest.approx(mean**2, rel=0.12)


def test_a_grain_is_a_function_of_its_seed() -> None:
    headings = np.radians(np.arange(40.0, 70.0, 1.0))
    one, same, other = (predict_scan(WALL, HERE, BOARD, headings, PredictionOptions(grain=seed)) for seed in (1, 1, 2))
    assert one.ranges.tolist() == same.ranges.tolist() != other.ranges.tolist()
    assert other.paths.scattered[other.winners].mean() > 0.5


def test_a_grain_leaves_smooth_rooms_alone() -> None:
    smooth, headings = wall_room(0.0), np.radians(np.arange(0.0, 180.0, 5.0))
    usual, grained = (predict_scan(smooth, HERE, BOARD, headings, PredictionOptions(grain=seed)) for seed in (None, 1))
    assert np.array_equal(usual.ranges, grained.ranges, equal_nan=True)


def test_reflection_and_scatter_add_by_power() -> None:
    """Straight ahead: the mirror of the wall, and the patches whose sound is still received at that instant."""
    scan = scan_at(90.0, receiver=Receiver.FIRST_ECHO)
    levels, loudest = scan.ping(0).levels, scan.ping(0).loudest
    row = int(np.searchsorted(scan.paths.lengths, 2.05))
    assert scan.paths.scattered[loudest[row]]
    assert levels[row] == pytest.approx(lambert_level(90.0, 1.95, float(scan.paths.lengths[row])), abs=0.1)
    mirror = int(np.flatnonzero(~scan.paths.scattered)[0])
    assert levels[mirror] == pytest.approx(20 * math.log10(0.8 * math.sqrt(0.5)), abs=0.1)


def test_profiles_that_detect_each_path_alone_add_scattered_sound_too() -> None:
    for name in ("paper", "lego-nxt"):
        usual, half = (scan_at(65.0, board=load_board(name), patch=PATCH * factor) for factor in (1.0, 0.5))
        assert half.ping(0).level_of_reading == pytest.approx(usual.ping(0).level_of_reading, abs=0.1)


@pytest.mark.parametrize("receiver", list(Receiver))
def test_headings_away_from_rough_surfaces_are_computed_together_with_equal_results(receiver: Receiver) -> None:
    room, headings = load_room("rooms/doorstep.toml"), np.radians(np.arange(0.0, 360.0, 9.0))
    scan = predict_scan(room, room.place("plan"), BOARD, headings, PredictionOptions(receiver=receiver))
    assert 0 < len(with_scattered_sound(scan)) < len(headings) / 2
    if receiver is Receiver.FIRST_ECHO:
        assert with_first_echoes(scan).winners.tolist() == scan.winners.tolist()
        return
    for k in range(len(headings)):
        alone = scan.ping(k).first_detected()
        assert alone.winner == scan.winners[k]
        assert float(alone.times[0]) * room.air.speed_of_sound / 2 == pytest.approx(scan.distances[k], abs=1e-4)
