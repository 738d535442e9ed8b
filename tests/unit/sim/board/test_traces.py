"""Traces against a slow sum in time by the printed formulas, and properties of sampled traces."""

import math
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import fftconvolve, hilbert
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.beam import impulse_response
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.board.signal import CONVERTER_RATE, Arrivals, Noise, Signal, burst_of, received

from sonarhw.readings import FloatArray

SPEED = 343.987
BOARD = load_board("polaroid-6500")
CHIRP = load_board("polaroid-56")
RINGING = replace(CHIRP, name="ringing", rise_cycles=2.0, ring_cycles=11.0)
FINE = 8e6  # Hz


def arrivals(*rows: tuple[float, float, float, float]) -> Arrivals:
    """Return arrivals of rows with time (s), amplitude, and degrees off the axis at departure and at arrival."""
    times, amplitudes, leaving, arriving = np.array(rows, dtype=np.float64).reshape(-1, 4).T
    return Arrivals(times, amplitudes, np.cos(np.radians(leaving)), np.cos(np.radians(arriving)))


def quiet(board: Board) -> Board:
    """Return the board without its own burst in the receiver."""
    return replace(board, own_burst_db=-300.0)


def slow_rf(board: Board, rows: list[tuple[float, float, float, float]], duration: float, rate: float) -> FloatArray:
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
            response = impulse_response(times, math.radians(degrees), board.aperture_radius, SPEED) / FINE
            pulse, start = fftconvolve(pulse, response), start - half / FINE
        first = round(start * FINE)
        fine[first : first + len(pulse)] += amplitude * pulse.real[: len(fine) - first]
    return fine[: math.ceil(duration * FINE) : round(FINE / rate)]


@pytest.mark.parametrize("board", [BOARD, CHIRP, RINGING], ids=lambda board: board.name)
@pytest.mark.parametrize(
    "rows",
    [
        [(0.005, 1.0, 0.0, 0.0)],
        [(0.00512625, -0.7, 17.2, 17.2)],
        [(0.005, 1.0, 0.0, 50.0)],
        [(0.005, 1.0, 50.0, 0.0)],
        [(0.004, 0.5, 3.0, 40.0), (0.0040875, -0.9, 10.0, 0.0), (0.0061, 0.3, 25.0, 20.0)],
    ],
    ids=["straight", "oblique", "detected aside", "sent aside", "three"],
)
def test_signal_equals_the_slow_sum_in_time(board: Board, rows: list[tuple[float, float, float, float]]) -> None:
    expected = slow_rf(board, rows, 0.009, 1e6)
    signal = received(arrivals(*rows), quiet(board), SPEED, 0.009)
    assert signal.rf(1e6) == pytest.approx(expected, abs=0.02 * np.abs(expected).max())


def test_chirp_steps_down_from_60_to_50_kilohertz() -> None:
    rf = received(arrivals((0.005, 0.9, 0, 0)), quiet(CHIRP), SPEED, 0.008).rf(1e6)
    turning = np.diff(np.unwrap(np.angle(hilbert(rf)))) * 1e6 / math.tau
    begin = 0.005
    for tone in CHIRP.burst:
        lasting = tone.cycles / tone.frequency
        late = slice(round((begin + 0.7 * lasting) * 1e6), round((begin + lasting) * 1e6))
        assert np.median(turning[late]) == pytest.approx(tone.frequency, abs=900)
        begin += lasting


@settings(deadline=None, max_examples=30)
@given(time=st.floats(0.003, 0.008), degrees=st.floats(0, 60))
def test_echoes_half_a_period_apart_cancel(time: float, degrees: float) -> None:
    later = time + 0.5 / BOARD.frequency
    alone = received(arrivals((time, 0.9, degrees, degrees)), quiet(BOARD), SPEED, 0.01).envelope(200e3)
    both = received(
        arrivals((time, 0.9, degrees, degrees), (later, 0.9, degrees, degrees)), quiet(BOARD), SPEED, 0.01
    ).envelope(200e3)
    middle = np.abs(both.times - time - 8 / BOARD.frequency) < 2 / BOARD.frequency
    assert both.samples[middle].max() < 0.05 * alone.samples.max()


@settings(deadline=None, max_examples=30)
@given(
    rows=st.lists(
        st.tuples(st.floats(0, 0.009), st.floats(-0.3, 0.3), st.floats(0, 180), st.floats(0, 180)), max_size=3
    ),
    rate=st.floats(3e5, 1e6),
)
def test_signal_stays_within_its_envelope(rows: list[tuple[float, float, float, float]], rate: float) -> None:
    signal = received(arrivals(*rows), quiet(BOARD), SPEED, 0.01)
    rf, envelope = signal.rf(rate), signal.envelope(rate).samples
    assert len(rf) == len(envelope) == math.ceil(0.01 * rate)
    assert np.isfinite(rf).all()
    assert np.abs(rf) == pytest.approx(np.minimum(np.abs(rf), envelope), abs=0.003)


def test_sampled_signal_is_the_rf_signal_in_256_steps() -> None:
    signal = received(arrivals((0.005, 0.5, 8, 8), (0.0053, 0.02, 0, 0)), BOARD, SPEED, 0.01)
    rf, sampled = signal.rf(CONVERTER_RATE), signal.sampled()
    assert len(sampled) == math.ceil(0.01 * 16e6 / 16 / 13)
    assert sampled * 128 == pytest.approx(np.round(sampled * 128))
    assert (sampled.min(), sampled.max()) == (-1, 127 / 128)
    assert np.abs(sampled - rf).max() <= 1 / 128


def test_carrier_folds_to_27_and_a_half_kilohertz_in_the_converter() -> None:
    signal = received(arrivals((0.005, 0.9, 0, 0)), quiet(BOARD), SPEED, 0.01)
    spectrum = np.abs(np.fft.rfft(signal.sampled()))
    assert np.fft.rfftfreq(len(signal.sampled()), 1 / CONVERTER_RATE)[spectrum.argmax()] == pytest.approx(
        27_511, abs=200
    )


@pytest.mark.parametrize("degrees", [90.0, 120.0, 180.0])
def test_nothing_is_received_from_behind(degrees: float) -> None:
    for rows in ((0.005, 1.0, degrees, 0.0), (0.005, 1.0, 0.0, degrees)):
        assert received(arrivals(rows), quiet(BOARD), SPEED, 0.01).envelope().samples.max() < 1e-12


def test_own_burst_overdrives_the_receiver_and_has_decayed_where_binh_may_end_blanking() -> None:
    trace = received(arrivals(), BOARD, SPEED, 0.01).envelope()
    assert trace.samples[(trace.times > 50e-6) & (trace.times < 16 / BOARD.frequency)].min() == 1.0
    assert trace.samples[trace.times >= 0.75e-3].max() < 10 ** (BOARD.threshold_db / 20)


def test_stepped_gain_follows_the_ideal_one_up_to_its_last_step() -> None:
    def level(time: float, receiver: Receiver) -> float:
        trace = received(arrivals((time, 0.2, 0, 0)), quiet(BOARD), SPEED, 0.065, receiver).envelope(200e3)
        return 20 * math.log10(trace.samples.max())

    for time in np.arange(0.003, 0.038, 0.0035):
        assert level(time, Receiver.FIRST_ECHO) == pytest.approx(20 * math.log10(0.2), abs=0.05)
        assert level(time, Receiver.BOARD) == pytest.approx(20 * math.log10(0.2), abs=6)
    # from 6.7 to 10.3 m: 3.7 dB of spreading and 11.8 dB of air
    assert level(0.039, Receiver.BOARD) - level(0.060, Receiver.BOARD) == pytest.approx(15.5, abs=0.3)


def test_noise_is_a_function_of_its_seed_with_the_given_level() -> None:
    def noisy(seed: int) -> Signal:
        return received(arrivals(), quiet(BOARD), SPEED, 0.06, noise=Noise(0.01, (seed,)))

    assert (noisy(3).samples == noisy(3).samples).all()
    assert (noisy(3).samples != noisy(4).samples).any()
    assert np.sqrt((noisy(3).rf(1e6) ** 2).mean()) == pytest.approx(0.01, rel=0.1)


def test_many_traces_leak_no_memory() -> None:
    rows = [(0.0006 * k, 0.1, 5.0, 5.0) for k in range(1, 101)]

    def make() -> None:
        received(arrivals(*rows), BOARD, SPEED, 0.062).rf(1e6)

    make()
    tracemalloc.start()
    make()
    before, _ = tracemalloc.get_traced_memory()
    for _ in range(50):
        make()
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 10_000


def test_bursts_are_cached_for_few_boards_only() -> None:
    for k in range(100):
        burst_of(replace(BOARD, aperture_radius=0.01 + k * 1e-4), SPEED)
    assert burst_of.cache_info().currsize <= 16
