"""Readings are assembled once each with their own trace, despite lost and repeated messages."""

import numpy as np
import pytest

from sonarhw.readings import Reading, Trace
from sonarhw.wire.limits import CHUNK
from sonarhw.wire.messages import Finished, Heartbeat, Info, ReadingMessage, Settings, Started, TraceChunk, TraceKind
from sonarhw.wire.readings_of_frames import ReadingAssembler, trace_chunks


def reading(number: int, fired_us: int | None = None) -> ReadingMessage:
    """Reading `number` of a scan whose pings are 100 ms apart."""
    return ReadingMessage(number, 0, 0, 0, 100_000 * (number + 1) if fired_us is None else fired_us, 2000, ())


def chunks(number: int) -> list[TraceChunk]:
    """A trace of two chunks, every sample `number`."""
    return [TraceChunk(number, offset, 4, 20_000, 0, bytes([number, number])) for offset in (0, 2)]


@pytest.fixture
def assembler() -> ReadingAssembler:
    """An assembler in a scan with traces."""
    assembler = ReadingAssembler()
    assembler.feed(Settings(1, 62_500, 2380, 1, 343_200))
    assembler.feed(Started(2, 100))
    return assembler


def whole(reading: Reading) -> bool:
    """Whether a reading has all samples of its own trace."""
    return reading.trace is not None and bool((reading.trace.samples == reading.number / 255).all())


def test_a_reading_is_returned_with_the_last_chunk_of_its_trace(assembler: ReadingAssembler) -> None:
    first, second = chunks(5)
    assert assembler.feed(reading(5)) == []
    assert assembler.feed(first) == []
    (done,) = assembler.feed(second)
    assert whole(done)
    assert done.time == pytest.approx(0.6)


def test_a_repeated_reading_is_returned_once(assembler: ReadingAssembler) -> None:
    out = [item for message in (reading(1), reading(1), *chunks(1), reading(1)) for item in assembler.feed(message)]
    assert len(out + assembler.flush()) == 1


def test_a_reading_sent_again_does_not_disturb_the_current_trace(assembler: ReadingAssembler) -> None:
    first, second = chunks(7)
    out = [item for message in (reading(7), first, reading(6), second) for item in assembler.feed(message)]
    assert [item.number for item in out] == [6, 7]
    assert out[0].trace is None
    assert whole(out[1])


def test_a_trace_is_kept_until_its_lost_reading_is_sent_again(assembler: ReadingAssembler) -> None:
    for chunk in chunks(6):
        assert assembler.feed(chunk) == []
    out = [item for message in (reading(7), reading(6), *chunks(7)) for item in assembler.feed(message)]
    assert [item.number for item in out] == [6, 7]
    assert all(map(whole, out))


def test_the_last_reading_sent_again_has_its_trace(assembler: ReadingAssembler) -> None:
    for message in (*chunks(9), Finished(2, 0, 10, "")):
        assert assembler.feed(message) == []
    (done,) = assembler.feed(reading(9))
    assert whole(done)


@pytest.mark.parametrize(
    "later",
    [reading(4), Heartbeat(3, 0, 5, 2000), Finished(2, 0, 4, ""), Started(3, 10)],
    ids=lambda m: type(m).__name__,
)
def test_a_later_message_completes_a_reading_with_missing_chunks(
    assembler: ReadingAssembler, later: ReadingMessage | Heartbeat | Finished | Started
) -> None:
    assembler.feed(reading(3))
    assembler.feed(chunks(3)[1])
    (done,) = assembler.feed(later)
    assert done.trace is not None
    assert np.isnan(done.trace.samples).tolist() == [True, True, False, False]


def test_a_heartbeat_between_two_chunks_does_not_complete_the_reading(assembler: ReadingAssembler) -> None:
    first, second = chunks(3)
    out = [
        item for message in (reading(3), first, Heartbeat(3, 0, 4, 2000), second) for item in assembler.feed(message)
    ]
    assert len(out) == 1
    assert whole(out[0])


def test_traces_without_readings_do_not_accumulate(assembler: ReadingAssembler) -> None:
    for number in range(1000):
        assembler.feed(TraceChunk(number, 0, 4, 20_000, 0, b"\1\1"))
    assert len(assembler._traces) <= 4


def test_numbers_of_the_next_scan_are_new_readings_even_if_its_started_was_lost(
    assembler: ReadingAssembler,
) -> None:
    first = [item for n in range(3) for item in assembler.feed(reading(n))] + assembler.feed(Finished(2, 0, 3, ""))
    second = [item for n in range(3) for item in assembler.feed(reading(n, 10_000_000 + n))] + assembler.flush()
    assert [item.number for item in first] == [item.number for item in second] == [0, 1, 2]


def test_a_repeated_started_has_no_effect(assembler: ReadingAssembler) -> None:
    first, second = chunks(0)
    out = [item for message in (reading(0), first, Started(2, 100), second) for item in assembler.feed(message)]
    assert len(out) == 1
    assert whole(out[0])


def test_readings_of_a_restarted_device_are_new(assembler: ReadingAssembler) -> None:
    out = [item for n in range(3) for item in assembler.feed(reading(n))]
    out += assembler.feed(Info(1, 1, 0, "", "", "", 2000, 0, 0))
    assert [item.number for item in out] == [0, 1, 2]
    again = [item for n in range(3) for item in assembler.feed(reading(n))]
    assert [item.number for item in again + assembler.flush()] == [0, 1, 2]


@pytest.mark.parametrize(
    "chunk",
    [TraceChunk(1, 0, 4, 0, 0, b"\1\1"), TraceChunk(1, 3, 4, 20_000, 0, b"\1\1"), TraceChunk(1, 0, 0, 20_000, 0, b"")],
    ids=["no period", "beyond the end", "empty"],
)
def test_an_invalid_chunk_is_ignored(assembler: ReadingAssembler, chunk: TraceChunk) -> None:
    assembler.feed(reading(1))
    out = assembler.feed(chunk) + assembler.flush()
    assert [item.number for item in out] == [1]


@pytest.mark.parametrize("carrier", [False, True], ids=["envelope", "carrier"])
def test_a_trace_is_transmitted_with_eight_bits(carrier: bool) -> None:
    samples = np.sin(np.linspace(0, 9, 700))
    sent = Trace(samples if carrier else np.abs(samples), 76_900.0, 0.0004, carrier)
    assembler = ReadingAssembler()
    assembler.feed(Settings(1, 62_500, 2380, 2 if carrier else 1, 343_200))
    assembler.feed(reading(0))
    (whole,) = [item for chunk in trace_chunks(0, sent) for item in assembler.feed(chunk)]
    assert whole.trace is not None
    assert whole.trace.carrier == carrier
    assert whole.trace.start == pytest.approx(sent.start)
    np.testing.assert_allclose(whole.trace.samples, sent.samples, atol=(1.01 if carrier else 0.51) / 255)


def test_sixteen_bit_samples_keep_full_precision() -> None:
    levels = np.array([0, 1, 32768, 65534, 65535], dtype="<u2")
    assembler = ReadingAssembler()
    assembler.feed(Settings(1, 62_500, 2380, 1, 343_200))
    assembler.feed(reading(0))
    (whole,) = assembler.feed(TraceChunk(0, 0, 5, 13_000, 0, levels.tobytes(), 1, 16))
    assert whole.trace is not None
    np.testing.assert_allclose(whole.trace.samples, levels / 65535, atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "expected"), [(TraceKind.ENVELOPE, [0.0, 0.2, 1.0]), (TraceKind.CARRIER, [-1.0, -0.6, 1.0])]
)
@pytest.mark.parametrize("more", [b"", b"\x07"], ids=["whole", "half a sample more"])
def test_samples_of_sixteen_bits_are_shares_of_65535(kind: TraceKind, expected: list[float], more: bytes) -> None:
    assembler = ReadingAssembler()
    assembler.feed(Settings(1, 62_500, 2380, int(kind), 343_200))
    assembler.feed(Started(2, 1))
    samples = np.array([0, 13_107, 65_535], dtype="<u2").tobytes() + more
    (done,) = [
        out
        for message in (reading(0), TraceChunk(0, 0, 3, 20_000, 0, samples, bits=16, kind=int(kind)))
        for out in assembler.feed(message)
    ]
    assert done.trace is not None
    assert done.trace.samples == pytest.approx(expected)
    assert done.trace.rate == pytest.approx(50_000)


def test_a_trace_is_cut_to_the_samples_that_its_messages_can_count() -> None:
    sent = [*trace_chunks(1, Trace(np.zeros(66_000), 50_000.0, 0.0))]
    assert {chunk.total for chunk in sent} == {65_535}
    assert sum(len(chunk.samples) for chunk in sent) == 65_535


def test_missing_samples_are_marked_as_lost_and_whole_missing_chunks_are_not_sent() -> None:
    samples = np.full(3 * CHUNK, 0.5)
    samples[[CHUNK + 7, 2 * CHUNK - 1]] = np.nan
    samples[2 * CHUNK :] = np.nan  # the whole third
    sent = [*trace_chunks(0, Trace(samples, 50_000.0, 0.0))]
    assert [(chunk.offset, chunk.lost) for chunk in sent] == [(0, b""), (CHUNK, bytes([7, CHUNK - 1]))]


def test_lost_samples_are_missing_and_the_trace_is_complete(assembler: ReadingAssembler) -> None:
    assembler.feed(Settings(1, 20_000, 2_380, TraceKind.ENVELOPE, 343_200))
    assembler.feed(Started(2, 1))
    assembler.feed(reading(0))
    # an index beyond the chunk is ignored
    (made,) = assembler.feed(TraceChunk(0, 0, 4, 1000, 0, b"\xff" * 4, lost=bytes([2, 9])))
    assert made.trace is not None
    assert list(np.isnan(made.trace.samples)) == [False, False, True, False]
