"""Frames become readings: once each with their own trace, counted as missing or lost, and on the clock of the host."""

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.device.fake_board import BoardIdentity
from sonarhw.readings import Origin, Reading, Trace, origin_of
from sonarhw.wire import messages as msg
from sonarhw.wire.limits import CHUNK, KEPT_READINGS
from sonarhw.wire.readings_of_frames import MOST_DRIFT, DeviceClock, ReadingArrivals, ReadingAssembler, trace_chunks

EPOCH = 1_700_000_000.0


def made(number: int, fired_us: int | None = None) -> msg.ReadingMessage:
    """Return reading `number` of a scan whose pings are 100 ms apart."""
    return msg.ReadingMessage(number, 0, 0, 0, 100_000 * (number + 1) if fired_us is None else fired_us, 2000, ())


def chunks(number: int) -> list[msg.TraceChunk]:
    """Return a trace of two chunks, every sample `number`."""
    return [msg.TraceChunk(number, offset, 4, 20_000, 0, bytes([number, number])) for offset in (0, 2)]


def assembled(
    *messages: msg.Message, kind: msg.TraceKind = msg.TraceKind.ENVELOPE, flush: bool = True
) -> list[Reading]:
    """Return the readings in the messages of a scan with traces."""
    assembler = ReadingAssembler()
    scan = (msg.Settings(1, 62_500, 2380, kind, 343_200), msg.Started(2, 100), *messages)
    return [reading for message in scan for reading in assembler.feed(message)] + (assembler.flush() if flush else [])


def share(reading: Reading) -> float | None:
    """Return the share of the samples of its own trace that a reading has; None without samples."""
    if reading.trace is None or not len(reading.trace.samples):
        return None
    arrived = ~np.isnan(reading.trace.samples)
    assert (reading.trace.samples[arrived] == reading.number / 255).all()
    return float(arrived.mean())


# messages, then number of each reading and share of its trace
ASSEMBLED: dict[str, tuple[list[msg.Message], list[tuple[int, float | None]]]] = {
    "with its last chunk": ([made(5), *chunks(5)], [(5, 1.0)]),
    "repeated": ([made(1), made(1), *chunks(1), made(1)], [(1, 1.0)]),
    "sent again after all that a device keeps": (
        [made(number) for number in (*range(KEPT_READINGS), 0)],
        [(number, None) for number in range(KEPT_READINGS)],
    ),
    "another one sent again": ([made(7), chunks(7)[0], made(6), chunks(7)[1]], [(6, None), (7, 1.0)]),
    "sent again after its trace": ([*chunks(6), made(7), made(6), *chunks(7)], [(6, 1.0), (7, 1.0)]),
    "sent again after the end": ([*chunks(9), msg.Finished(2, 0, 10, ""), made(9)], [(9, 1.0)]),
    "a heartbeat in between": ([made(3), chunks(3)[0], msg.Heartbeat(3, 0, 4, 2000), chunks(3)[1]], [(3, 1.0)]),
    "a repeated Started": ([made(0), chunks(0)[0], msg.Started(2, 100), chunks(0)[1]], [(0, 1.0)]),
    "the next scan without Started": (
        [made(0), made(1), msg.Finished(2, 0, 2, ""), made(0, 10_000_000), made(1, 10_000_001)],
        [(0, None), (1, None)] * 2,
    ),
    "a restarted device": ([made(0), msg.Info(1, 1, 0, "", "", "", 2000, 0, 0), made(0)], [(0, None), (0, None)]),
    "a chunk without a period": ([made(1), msg.TraceChunk(1, 0, 4, 0, 0, b"\1\1")], [(1, None)]),
    "a chunk beyond the end": ([made(1), msg.TraceChunk(1, 3, 4, 20_000, 0, b"\1\1")], [(1, 0.0)]),
    "an empty chunk": ([made(1), msg.TraceChunk(1, 0, 0, 20_000, 0, b"")], [(1, None)]),
    # an index of a lost sample beyond the chunk is ignored
    "lost samples": ([made(255), msg.TraceChunk(255, 0, 4, 1000, 0, b"\xff" * 4, lost=bytes([2, 9]))], [(255, 0.75)]),
}


@pytest.mark.parametrize("name", ASSEMBLED)
def test_each_reading_is_assembled_once_with_its_own_trace(name: str) -> None:
    messages, expected = ASSEMBLED[name]
    assert [(reading.number, share(reading)) for reading in assembled(*messages)] == expected


def test_traces_without_readings_do_not_accumulate() -> None:
    old = [chunk for number in range(200) for chunk in chunks(number)]
    assert [share(reading) for reading in assembled(*old, made(0), made(199))] == [None, 1.0]


@pytest.mark.parametrize("carrier", [False, True], ids=["envelope", "carrier"])
def test_a_trace_is_transmitted_with_eight_bits(carrier: bool) -> None:
    samples = np.sin(np.linspace(0, 9, 700))
    sent = Trace(samples if carrier else np.abs(samples), 76_900.0, 0.0004, carrier)
    (whole,) = assembled(made(0), *trace_chunks(0, sent), kind=msg.TraceKind(1 + carrier))
    assert (whole.trace.carrier, whole.trace.start) == (carrier, pytest.approx(sent.start))
    np.testing.assert_allclose(whole.trace.samples, sent.samples, atol=(1.01 if carrier else 0.51) / 255)


@pytest.mark.parametrize(
    ("kind", "expected"), [(msg.TraceKind.ENVELOPE, [0.0, 0.2, 1.0]), (msg.TraceKind.CARRIER, [-1.0, -0.6, 1.0])]
)
@pytest.mark.parametrize("more", [b"", b"\x07"], ids=["whole", "half a sample more"])
def test_samples_of_sixteen_bits_are_shares_of_65535(kind: msg.TraceKind, expected: list[float], more: bytes) -> None:
    samples = np.array([0, 13_107, 65_535], dtype="<u2").tobytes() + more
    (done,) = assembled(made(0), msg.TraceChunk(0, 0, 3, 20_000, 0, samples, bits=16, kind=int(kind)), kind=kind)
    assert done.trace.samples == pytest.approx(expected)
    assert done.trace.rate == pytest.approx(50_000)


def test_a_trace_is_cut_to_what_its_messages_can_count_and_lost_samples_are_marked() -> None:
    sent = [*trace_chunks(1, Trace(np.zeros(66_000), 50_000.0, 0.0))]
    assert {chunk.total for chunk in sent} == {65_535} == {sum(len(chunk.samples) for chunk in sent)}
    samples = np.full(3 * CHUNK, 0.5)
    samples[[CHUNK + 7, 2 * CHUNK - 1]] = np.nan
    samples[2 * CHUNK :] = np.nan  # the whole third, which is not sent
    sent = [*trace_chunks(0, Trace(samples, 50_000.0, 0.0))]
    assert [(chunk.offset, chunk.lost) for chunk in sent] == [(0, b""), (CHUNK, bytes([7, CHUNK - 1]))]


# what has arrived


@given(st.integers(1, 300), st.lists(st.tuples(st.booleans(), st.integers(0, 320)), max_size=100))
def test_every_reading_made_is_received_missing_or_lost(total: int, events: list[tuple[bool, int]]) -> None:
    arrivals, received = ReadingArrivals(total), set()
    for arrives, number in events:
        if not arrives:
            arrivals.device_made(number)
        elif arrivals.arrived(number):
            assert number not in received
            received.add(number)
        wanted = arrivals.next_resend()
        assert (wanted is None) == (len(received) + arrivals.lost == arrivals.made)
        if wanted:
            first, count = wanted
            assert first not in received
            assert 1 <= count <= KEPT_READINGS
            assert first >= arrivals.made - KEPT_READINGS


def test_readings_outside_of_the_requested_part_are_rejected() -> None:
    arrivals = ReadingArrivals(10, first=6)
    assert [arrivals.arrived(number) for number in (5, 10, 7)] == [False, False, True]
    assert arrivals.next_resend() == (6, 1)
    assert arrivals.arrived(6)
    arrivals.device_made(10)
    assert arrivals.next_resend() == (8, 2)


# the clock of the device


def clock_of(*frames: tuple[float, float] | int) -> DeviceClock:
    """Return a clock after frames of device time and arrival, s after EPOCH, and boot counts."""
    clock = DeviceClock()
    for frame in frames:
        if isinstance(frame, int):
            clock.set_boot(frame)
        else:
            clock.add_frame(round(frame[0] * 1e6), EPOCH + frame[1])
    return clock


def jittered(chance: random.Random, start: float, drift: float, since: float = 0.0) -> list[tuple[float, float]]:
    """Return a minute of ten frames per second, at least 1 ms late and sometimes much later."""
    return [
        (
            since + k / 10,
            start + k / 10 * (1 + drift) + 0.001 + chance.expovariate(250) + 0.2 * (chance.random() < 0.05),
        )
        for k in range(600)
    ]


@pytest.mark.parametrize("drift", [-0.005, 0.0, 1e-4, 0.005])
def test_device_times_are_mapped_to_the_host_within_two_milliseconds(drift: float) -> None:
    clock = clock_of(*jittered(random.Random(3), 0.0, drift))
    assert clock.drift == pytest.approx(drift, abs=3e-5)
    for device in (30.0, 59.0):
        # the least delay of 1 ms shifts the line by 1 ms
        assert clock.host_time(device) == pytest.approx(EPOCH + device * (1 + drift) + 0.001, abs=0.002)


def test_the_first_frames_give_a_time_and_no_drift() -> None:
    assert (clock_of().known, clock_of().host_time(1.0)) == (False, None)
    late = clock_of((0.0, 0.5), (1.5, 1.5))
    assert (late.drift, late.host_time(1.5), late.continued(2_000_000)) == (0.0, pytest.approx(EPOCH + 1.5), 2.0)


@pytest.mark.parametrize("counted", [True, False], ids=["boot counter", "clock ran back"])
def test_time_continues_across_a_reset(counted: bool) -> None:
    chance, drift = random.Random(4), 2e-4
    # five seconds off, then a clock from zero; with a boot counter, the new clock may even be ahead of the old one
    since = 100.0 if counted else 0.0
    boots = (1, 2) if counted else (0, 0)
    before, after = jittered(chance, 0.0, drift), jittered(chance, 65.0, drift, since)
    clock = clock_of(boots[0], *before, boots[1], *after)
    assert clock.resets == 1
    time = clock.continued(round((since + 30.0) * 1e6))
    assert time == pytest.approx(65.0 / (1 + drift) + 30.0, abs=0.25)
    assert clock.host_time(time) == pytest.approx(EPOCH + 65.0 + 30.0 * (1 + drift), abs=0.01)


def test_time_never_runs_back_at_a_reset() -> None:
    # one second late, but for the last, so the fitted line says that less time has passed than the last frame shows
    frames = ((k + 0.5, k + 0.5 + (0.0 if k == 9 else 1.0)) for k in range(10))
    assert clock_of(1, *frames, 2, (0.0, 9.6)).continued(0) >= 9.5


@pytest.mark.parametrize(
    ("frames", "drift"),
    [
        *(([(k, k * (1 + drift)) for k in range(30)], math.copysign(MOST_DRIFT, drift)) for drift in (-0.05, 0.05)),
        # from five seconds on
        ([(k, k * 1.01) for k in range(4)], 0.0),
        ([(k, k * 1.01) for k in range(5)], 0.01),
        # of each second only the frame with the least delay
        ([(k / 10, k / 10 + (0.002 if k % 10 == 4 else 0.3 + 0.001 * k)) for k in range(300)], 0.0),
        # the last minute
        ([(k, k + 0.001 * (k if k <= 100 else 200 - k)) for k in range(200)], -0.001),
    ],
    ids=["slow", "fast", "four seconds", "five seconds", "least delay", "last minute"],
)
def test_drift_is_fitted_within_its_limit(frames: list[tuple[float, float]], drift: float) -> None:
    assert clock_of(*frames).drift == pytest.approx(drift, abs=1e-6)


# origin


@pytest.mark.parametrize(
    ("made_by", "firmware", "serial", "origin"),
    [
        ("scan", "sonarhw-mega 0.1.0", "SONAR-0A1B2C", Origin.MEASURED),
        ("scan", BoardIdentity().firmware, "FAKE-0001", Origin.FAKE),
        ("scan", "sonarhw-mega 0.1.0", "EMULATED", Origin.FAKE),
        ("simulate", "", "", Origin.SIMULATED),
        ("import", "", "", Origin.IMPORTED),
        ("unknown", "", "", Origin.MEASURED),  # a torn log
    ],
)
def test_origin_follows_from_writer_and_device(made_by: str, firmware: str, serial: str, origin: Origin) -> None:
    assert origin_of(made_by, firmware, serial) is origin
