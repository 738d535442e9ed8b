"""Transducer and receiver: the beam, traces against a slow sum in time, gain, and the properties in data sheets."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import fftconvolve
from scipy.special import j1, jv
from sonarhw_sim.air import Air, Receiver, Unit, absorption
from sonarhw_sim.board import beam, profile, receiver
from sonarhw_sim.board.signal import RATE, Arrivals, Noise, burst_of, pulse_table, pulses, received
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.readings import FloatArray

SPEED = 343.987


CYCLE = 1 / 49412.0


BOARD = profile.load_board("polaroid-6500")


LEVEL = replace(BOARD, gain_steps=())  # the ideal gain


PAPERLIKE = replace(LEVEL, integration_cycles=0.0, rise_cycles=0.5, own_burst_db=-300.0)


ROOM = load_room("rooms/simple.toml")


def walls(*ranges_and_levels: tuple[float, float]) -> Arrivals:
    """Return arrivals of walls straight ahead at ranges (m) with levels (dB)."""
    ranges, levels = np.array(ranges_and_levels).reshape(-1, 2).T
    ahead = np.ones(len(ranges))
    return Arrivals(2 * ranges / SPEED, 10 ** (levels / 20), ahead, ahead)


def detected_ranges(board: profile.Board, *ranges_and_levels: tuple[float, float]) -> FloatArray:
    return (
        receiver.counted_time(receiver.detect_echoes(walls(*ranges_and_levels), board, SPEED).times, board) * SPEED / 2
    )


wall_scenes = st.lists(
    st.tuples(st.floats(0.42, 10.6), st.one_of(st.floats(-60, -41), st.floats(-39, 0))), min_size=1, max_size=6
)


@settings(deadline=None, max_examples=30)
@given(scene=wall_scenes)
def test_with_ideal_gain_and_no_integration_both_receivers_agree(scene: list[tuple[float, float]]) -> None:
    # overlapping echoes add with their phase, which the paper's receiver ignores
    ranges = sorted(distance for distance, _ in scene)
    apart = [scene[0]] if ranges and min(np.diff(ranges), default=1.0) < 0.2 else scene
    loud = sorted(distance for distance, level in apart if level > BOARD.threshold_db)
    detected = detected_ranges(PAPERLIKE, *apart)
    assert len(detected) >= len(loud)
    if loud:
        assert detected[0] == pytest.approx(loud[0], abs=2 * CYCLE * SPEED / 2)
        winner = receiver.detect_echoes(walls(*apart), PAPERLIKE, SPEED).winner
        assert apart[winner][0] == loud[0]
    else:
        assert len(detected) == 0


def test_range_is_that_of_a_rectifier_and_a_capacitor_on_the_rf_signal() -> None:
    rate = 5e6
    lone = np.abs(received(walls((1.0, 0.0)), LEVEL, SPEED, 0.01).rf(rate)[20_000:])
    arrivals = walls((1.0, -45.0), (1.3, -33.0), (1.302, -36.0))
    signal = np.abs(received(arrivals, LEVEL, SPEED, 0.02).rf(rate))

    def charged(rectified: FloatArray, full: float) -> int:
        tau, charge, most = LEVEL.integration_cycles * CYCLE * rate, 0.0, 0.0
        for k, current in enumerate(rectified):
            charge += (current - charge) / tau
            most = max(most, charge)
            if charge >= full:
                return k
        return round(most * 1e9)

    full = charged(lone, math.inf) / 1e9 * 10 ** (LEVEL.threshold_db / 20)
    blanked = math.ceil(LEVEL.blanking * rate)
    expected = (blanked + charged(signal[blanked:], full)) / rate
    assert receiver.detect_echoes(arrivals, LEVEL, SPEED).times[0] == pytest.approx(expected, abs=CYCLE / 2)


def test_echo_within_blanking_is_ignored_and_one_that_continues_is_detected_at_its_end() -> None:
    end = LEVEL.blanking * SPEED / 2
    assert len(detected_ranges(LEVEL, (0.2, -3.0))) == 0
    assert detected_ranges(LEVEL, (0.38, -3.0))[0] == pytest.approx(end, abs=0.01)


def test_next_echo_is_detected_only_after_re_arming() -> None:
    detected = receiver.detect_echoes(walls((1.0, -20.0), (1.04, -20.0), (1.3, -20.0)), LEVEL, SPEED).times
    assert np.diff(detected).min() >= LEVEL.rearm
    assert len(detected_ranges(replace(LEVEL, rearm=0.02), (1.0, -20.0), (2.0, -20.0))) == 1


@pytest.mark.parametrize("error", [-0.01, 0.01])
def test_wrong_clock_scales_ranges_and_blanking(error: float) -> None:
    board = replace(LEVEL, clock_error=error)
    exact = detected_ranges(LEVEL, (3.0, -10.0))[0]
    assert detected_ranges(board, (3.0, -10.0))[0] == pytest.approx(exact * (1 + error), rel=1e-9)
    # a strong echo that continues after blanking is detected at its end
    found = receiver.detect_echoes(walls((0.38, 0.0)), board, SPEED).times[0]
    assert found == pytest.approx(LEVEL.blanking / (1 + error), abs=CYCLE)


def test_stepped_gain_differs_from_the_ideal_one_by_at_most_6_decibels_and_0_on_average() -> None:
    steps = BOARD.gain_steps
    times = np.linspace(steps[0], steps[-1], 20_000, endpoint=False)
    lengths = times * Air().speed_of_sound
    off = profile.stepped_gain_db(times, BOARD) - 20 * np.log10(lengths) - absorption(BOARD.frequency, Air()) * lengths
    assert off.mean() == pytest.approx(0, abs=0.01)
    assert np.abs(off).max() == pytest.approx(5.8, abs=0.1)
    assert np.abs(off[lengths / 2 > 0.5]).max() < 4


def test_noise_alone_causes_echoes_without_a_winner() -> None:
    detected = receiver.detect_echoes(walls(), LEVEL, SPEED, Noise(0.02, (1,)))
    assert len(detected.times) > 0
    assert detected.winner == -1


@pytest.mark.parametrize(("low", "high", "share"), [(0.0, 0.02, 0.5), (0.004, 0.019, 0.4), (0.009, 0.049, 0.025)])
def test_without_integration_a_line_meets_the_threshold(low: float, high: float, share: float) -> None:
    board = replace(PAPERLIKE, threshold_db=-40.0, blanking=0.0, blanking_inhibit=None)
    samples = np.zeros(1000, dtype=np.complex128)
    samples[500], samples[501] = low, high
    assert receiver.echo_times(samples, board, SPEED)[0] * RATE == pytest.approx(500 + share)


# The first echo: equal to that of the whole signal, which takes other kernels.


BOARDS = {
    "6500": BOARD,
    "chirp": profile.load_board("polaroid-56"),
    "two transducers": profile.load_board("hc-sr04"),
    "early": replace(BOARD, blanking_inhibit=0.7e-3),  # detects the end of its own burst
    "fast clock": replace(BOARD, clock_error=0.01, integration_cycles=0.0),
    "ringing": replace(BOARD, ring_cycles=11.0),
    "long integration": replace(BOARD, integration_cycles=100.0),
}


A_TENTH = 1e-4  # m


angles = st.floats(-math.pi, math.pi)


scenes = st.lists(st.tuples(st.floats(0.05, 12.0), st.floats(-70, 6), angles, angles, angles), max_size=12)


def sound_of(scene: list[tuple[float, float, float, float, float]]) -> receiver.Sound:
    """Return sound of ranges (m), levels (dB), phases, departures and arrivals (rad)."""
    ranges, levels, phases, out, back = np.array(sorted(scene), dtype=np.float64).reshape(-1, 5).T
    leaving, arriving = (np.column_stack((np.cos(one), np.sin(one))) for one in (out, back))
    amplitudes = 10 ** (levels / 20) * np.exp(1j * phases)
    return receiver.Sound(2 * ranges / SPEED, amplitudes, leaving, arriving, np.empty((0, 0), np.bool_))


def arrivals_at(heading: float, sound: receiver.Sound) -> Arrivals:
    axis = np.array([math.cos(heading), math.sin(heading)])
    return Arrivals(sound.times, sound.amplitudes, sound.leaving @ axis, sound.arriving @ axis)


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS.keys())
@settings(deadline=None, max_examples=8)
@given(scene=scenes, headings=st.lists(angles, min_size=1, max_size=4))
def test_first_echo_is_that_of_the_whole_signal(
    board: profile.Board, scene: list[tuple[float, float, float, float, float]], headings: list[float]
) -> None:
    sound = sound_of(scene)
    times, winners = receiver.first_echoes(np.array(headings), sound, board, SPEED)
    for heading, time, winner in zip(headings, times, winners, strict=True):
        # where a hundredth of a decibel decides between two echoes, either is right
        changes = (0.0, -0.01, 0.01)
        assert any(_is_first(time, winner, arrivals_at(heading, sound), board, change) for change in changes)


def _is_first(time: float, winner: int, arrivals: Arrivals, board: profile.Board, change: float) -> bool:
    expected = receiver.detect_echoes(arrivals, replace(board, threshold_db=board.threshold_db + change), SPEED)
    if not len(expected.times):
        return math.isnan(time)
    return abs(expected.times[0] - time) * SPEED / 2 < A_TENTH and winner == expected.winner


@pytest.mark.parametrize("name", ["polaroid-56", "hc-sr04"])
def test_pulses_of_the_table_are_exact(name: str) -> None:
    board, random = profile.load_board(name), np.random.default_rng(1)
    table, burst = pulse_table(board, SPEED), burst_of(board, SPEED)
    out, back = random.uniform(0, math.pi / 2, (2, 60))
    times = random.uniform(0, 1e-4, 60)
    exact, _ = pulses(Arrivals(times, np.ones(60), np.cos(out), np.cos(back)), board, burst, SPEED)
    ka = table.wavenumber * (board.frequency + table.nodes)
    for k in range(60):
        beams = [np.array([_signed(one, abs(x)) for x in ka]) for one in (out[k], back[k])]
        phases = board.frequency * times[k] + table.nodes * (times[k] % 5e-6)
        weights = beams[0] * beams[1] * np.exp(-2j * math.pi * phases)
        made = weights @ (table.real + 1j * table.imaginary)
        assert np.abs(made - exact[k, : made.shape[0]]).max() < 1e-4
        assert np.abs(exact[k, made.shape[0] :]).max(initial=0.0) < 1e-4


def _signed(angle: float, ka: float) -> float:
    """Return the beam with its sign, 2 J₁(x)/x cos α."""
    x = max(ka * math.sin(angle), 1e-9)
    return float(2 * j1(x) / x * math.cos(angle))


@pytest.mark.parametrize(("unit", "ahead"), [(Unit.PASS, 0.0), (Unit.REFLECT, 0.0), (Unit.BLOCK, 0.1)])
def test_ranges_of_a_scan_are_those_of_its_signals(unit: Unit, ahead: float) -> None:
    # with the face ahead of the axis, every heading has paths of its own
    board = replace(BOARD, mount=profile.Mount(ahead=ahead))
    options = PredictionOptions(unit=unit, receiver=Receiver.BOARD, max_bounces=4)
    scan = predict_scan(ROOM, ROOM.places["figure9"], board, np.radians(np.arange(0.0, 360.0, 30.0)), options)
    assert (scan.winners >= 0).any()
    for k in range(len(scan.headings)):
        from_signal = scan.ping(k).echo_times()[:1] * ROOM.air.speed_of_sound / 2
        assert scan.distances[k : k + 1][: len(from_signal)] == pytest.approx(from_signal, abs=A_TENTH)
        assert bool(np.isnan(scan.distances[k])) == (len(from_signal) == 0)
        assert scan.winners[k] == scan.ping(k).first_detected().winner


# Traces.


CHIRP = profile.load_board("polaroid-56")


RINGING = replace(CHIRP, name="ringing", rise_cycles=2.0, ring_cycles=11.0)


FINE = 8e6  # Hz


def arrivals_of(*rows: tuple[float, float, float, float]) -> Arrivals:
    """Return arrivals_of of rows with time (s), amplitude, and degrees off the axis at departure and at arrival."""
    times, amplitudes, leaving, arriving = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return Arrivals(times, amplitudes, np.cos(np.radians(leaving)), np.cos(np.radians(arriving)))


def quiet(board: profile.Board) -> profile.Board:
    """Return the board without its own burst in the receiver."""
    return replace(board, own_burst_db=-300.0)


def slow_rf(
    board: profile.Board, rows: list[tuple[float, float, float, float]], duration: float, rate: float
) -> FloatArray:
    """Return the signal with its carrier, summed in time: drive, resonance twice, h_R twice, delay."""
    tau = board.rise_cycles / board.frequency
    t = np.arange(round(0.005 * FINE)) / FINE
    drive, begin, phase = np.zeros(len(t), dtype=np.complex128), 0.0, 0.0
    for tone in board.burst:
        on = (t >= begin) & (t < begin + tone.cycles / tone.frequency)
        drive[on] = np.exp(1j * (phase + math.tau * tone.frequency * (t[on] - begin)))
        phase += math.tau * tone.cycles
        begin += tone.cycles / tone.frequency
    rising = np.exp(-t / tau) * np.exp(1j * math.tau * board.frequency * t) / tau / FINE
    sent = fftconvolve(drive, rising)[: len(t)]
    if board.ring_cycles is not None:
        end = round(begin * FINE)
        free = np.exp((1j * math.tau - 1 / board.ring_cycles) * board.frequency * (t[end:] - t[end]))
        sent[end:] = sent[end] * free
    straight = fftconvolve(sent, rising)
    straight /= np.abs(straight).max()

    fine = np.zeros(round(duration * FINE) + 80_000)
    for time, amplitude, leaving, arriving in rows:
        pulse, start = straight, time
        for degrees in (leaving, arriving):
            if degrees == 0:
                continue
            half = math.ceil(board.aperture_radius * math.sin(math.radians(degrees)) / SPEED * FINE)
            times = np.arange(-half, half + 1) / FINE
            response = beam.impulse_response(times, math.radians(degrees), board.aperture_radius, SPEED) / FINE
            pulse, start = fftconvolve(pulse, response), start - half / FINE
        first = round(start * FINE)
        fine[first : first + len(pulse)] += amplitude * pulse.real[: len(fine) - first]
    return fine[: math.ceil(duration * FINE) : round(FINE / rate)]


@pytest.mark.parametrize("board", [BOARD, CHIRP, RINGING], ids=lambda board: board.name)
@pytest.mark.parametrize(
    "rows",
    [
        [(0.005, 1.0, 0.0, 0.0)],
        [(0.005, 1.0, 0.0, 50.0)],
        [(0.005, 1.0, 50.0, 0.0)],
        [(0.004, 0.5, 3.0, 40.0), (0.0040875, -0.9, 10.0, 0.0), (0.0061, 0.3, 25.0, 20.0)],
    ],
    ids=["straight", "detected aside", "sent aside", "three"],
)
def test_signal_equals_the_slow_sum(board: profile.Board, rows: list[tuple[float, float, float, float]]) -> None:
    expected = slow_rf(board, rows, 0.009, 1e6)
    signal = received(arrivals_of(*rows), quiet(board), SPEED, 0.009)
    assert signal.rf(1e6) == pytest.approx(expected, abs=0.02 * np.abs(expected).max())


# The beam, against a table of a piston, and h_R, against the formula printed by Kuc and Siegel.


IN_AIR = 343.987


RADIUS = 0.0192


CARRIER = 49412.0


def decibels(angle_deg: float, ka: float) -> float:
    return 20 * math.log10(float(beam.beam_gain(np.array(math.radians(angle_deg)), ka)))


@pytest.mark.parametrize(
    ("ka", "at_3", "at_6", "at_12", "null"), [(14.44, 6.43, 8.82, 11.68, 15.39), (17.33, 5.35, 7.34, 9.71, 12.77)]
)
def test_beam_is_that_of_a_piston(ka: float, at_3: float, at_6: float, at_12: float, null: float) -> None:
    for angle, loss in ((at_3, -3), (at_6, -6), (at_12, -12)):
        assert decibels(angle, ka) == pytest.approx(loss, abs=0.3)
    assert decibels(null, ka) < -45


@pytest.mark.parametrize("largest", [0.01, 1.0, 17.33, 300.0])
def test_the_factor_of_a_disc_and_its_slope_are_those_of_bessel_functions(largest: float) -> None:
    x = np.linspace(-largest, largest, 4000).reshape(40, 100)
    assert beam.disc_factor(x) == pytest.approx(2 * j1(x) / x, abs=3e-15)
    assert beam.disc_slope(x) == pytest.approx(-2 * jv(2, x) / x, abs=3e-15)


def test_peak_of_a_square_burst_there_is_minus_20_and_its_energy_minus_28() -> None:
    burst = beam.square_burst(CARRIER, 16, 4e6)
    peak, energy = beam.burst_loss(np.radians([17.2]), burst, 4e6, RADIUS, IN_AIR, passes=2)
    assert 20 * math.log10(peak[0]) == pytest.approx(-20, abs=0.5)
    assert 20 * math.log10(energy[0]) == pytest.approx(-28, abs=0.5)


@pytest.mark.parametrize("passes", [1, 2])
def test_pulse_off_the_axis_is_the_convolution_with_h_r(passes: int) -> None:
    rate, angle = 20e6, math.radians(25)
    pulse = beam.square_burst(CARRIER, 16, rate).imag
    crossing = RADIUS * math.sin(angle) / IN_AIR
    half = math.ceil(crossing * rate)
    # as printed: (2c cos α)/(π a sin α) √(1 − c²t²/(a² sin² α))
    t = np.arange(-half, half + 1) / rate
    inside = np.maximum(0, 1 - IN_AIR**2 * t**2 / (RADIUS * math.sin(angle)) ** 2)
    printed = 2 * IN_AIR * math.cos(angle) / (math.pi * RADIUS * math.sin(angle)) * np.sqrt(inside)
    expected = pulse
    for _ in range(passes):
        expected = fftconvolve(expected, printed) / rate

    left, begin = beam.convolved(pulse, rate, np.array([angle]), RADIUS, IN_AIR, passes)
    first = round((-passes * half / rate - begin) * rate)
    assert left[0, first : first + len(expected)].real == pytest.approx(expected, abs=2e-4)
    assert np.abs(left.imag).max() < 1e-12


def test_far_field_is_where_a_piston_on_its_axis_is_within_a_decibel_of_it() -> None:
    wavelength = IN_AIR / CARRIER
    z = beam.far_field(RADIUS, wavelength)
    k = 2 * math.pi / wavelength
    # exact on the axis, and its far field (Kinsler and Frey, §7.4)
    exact = abs(2 * math.sin(k / 2 * (math.hypot(z, RADIUS) - z)))
    assert -1.0 < 20 * math.log10(exact / (k * RADIUS**2 / (2 * z))) < -0.5


# Gain, against closed forms of spreading.


FIXED = replace(BOARD, fixed_gain=True, gain_steps=(), absorption=False)


USUAL_AIR = Air()


def test_without_absorption_a_path_loses_6_decibels_each_time_its_length_doubles() -> None:
    lengths = np.array([0.5, 1.0, 2.0, 4.0])
    assert profile.path_loss_db(lengths, FIXED) == pytest.approx(20 * math.log10(2) * np.array([-1, 0, 1, 2]))
    assert profile.uncompensated_db(lengths, FIXED, USUAL_AIR) == pytest.approx(profile.path_loss_db(lengths, FIXED))
    assert profile.uncompensated_db(lengths, replace(FIXED, fixed_gain=False), USUAL_AIR) == pytest.approx(np.zeros(4))


@pytest.mark.parametrize("nearest", [0.1, 0.2, 0.3])
def test_largest_gain_of_a_fixed_gain_is_that_of_the_first_echo_after_blanking(nearest: float) -> None:
    """Its path is there and back, and spreading divides the amplitude by the length in metres."""
    board = replace(FIXED, blanking=2 * nearest / USUAL_AIR.speed_of_sound)
    assert profile.largest_gain(board, USUAL_AIR, 8.0) == pytest.approx(1 / (2 * nearest))
    assert profile.largest_gain(replace(board, fixed_gain=False), USUAL_AIR, 8.0) == 1.0
