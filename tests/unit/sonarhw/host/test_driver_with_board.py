"""The conversation of driver and board: over any cable, each reading arrives once and at its angle."""

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from sonarhw.device.fake_board import FakeBoard
from sonarhw.errors import NoAnswer
from sonarhw.host.driver import ASK_AGAIN, ASKS, NO_MESSAGE, SIGN_OF_LIFE, SILENCE, TRIES, Driver
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import (
    Accepted,
    Configure,
    Finished,
    Heartbeat,
    Hello,
    Home,
    Message,
    Outcome,
    ReadingMessage,
    Resend,
    Settings,
    Started,
    StartScan,
    State,
    Stop,
    Turn,
)
from tests.fixtures.joined import Cable, Joined, cut_every, dropping, flipping, the_first, unchanged, without
from tests.fixtures.plain_echoes import PlainEchoes, echo_time

SECTOR = StartScan(start=10_000_000, step=2_500_000, headings=40, sweeps=2, pings=1)
CABLES = {
    "undamaged": lambda: unchanged,
    "one byte in 2000 dropped": lambda: dropping(1, 1 / 2000),
    "one byte in 300 dropped": lambda: dropping(2, 1 / 300),
    "one byte in 2000 flipped": lambda: flipping(3, 1 / 2000),
    "one byte in 300 flipped": lambda: flipping(4, 1 / 300),
    "40 bytes in 1500 cut": lambda: cut_every(1500, 40),
    "200 bytes in 5000 cut": lambda: cut_every(5000, 200),
}


@pytest.mark.parametrize("cable", CABLES.values(), ids=CABLES.keys())
@pytest.mark.parametrize("trace", [False, True], ids=["echoes", "traces"])
def test_every_reading_arrives_exactly_once_at_its_angle(cable: "type[Cable]", trace: bool) -> None:
    joined = Joined(down=cable(), up=cable())
    joined.greet(trace=trace)
    readings = joined.scan(SECTOR)
    assert sorted(reading.number for reading in readings) == list(range(80))
    for reading in readings:
        index = reading.number if reading.number < 40 else 79 - reading.number
        angle = math.radians(10 + 2.5 * index)
        assert reading.angle == pytest.approx(angle, abs=1e-8)
        assert reading.sweep == reading.number // 40
        assert reading.echo_times[0] == pytest.approx(echo_time(angle), abs=1e-9)
    assert joined.driver.statistics.lost_readings == 0
    # the board measured each reading once: a lost frame causes no new measurement
    assert len(joined.echoes.pings) == 80


@pytest.mark.parametrize("cable", [dropping, flipping])
def test_a_cable_that_passes_most_frames_loses_no_reading_and_never_hangs(cable: Callable[[int, float], Cable]) -> None:
    for seed in range(15):
        joined = Joined(down=cable(seed, 1 / 400), up=cable(1000 + seed, 1 / 400))
        joined.greet(trace=seed % 3 == 0)
        for headings in (1, 25):
            readings = joined.scan(StartScan(0, 3_000_000, headings, 1, 1))
            assert sorted(reading.number for reading in readings) == list(range(headings))
        assert len(joined.echoes.pings) == 26


def test_the_statistics_show_a_bad_cable_only() -> None:
    good, bad = Joined(), Joined(up=dropping(5, 1 / 200))
    for joined in (good, bad):
        joined.greet()
        joined.scan(SECTOR)
    clean, poor = good.driver.statistics, bad.driver.statistics
    assert (clean.rejected_blocks, clean.missing_frames, clean.resends, clean.repeated_commands) == (0, 0, 0, 0)
    assert poor.rejected_blocks > 0
    assert poor.missing_frames > 0
    assert poor.resends > 0
    keepalives = clean.frames_sent - 4
    assert 0 < keepalives < good.now / SIGN_OF_LIFE


def test_traces_arrive_complete_over_a_good_cable() -> None:
    joined = Joined()
    joined.greet(trace=True)
    for reading in joined.scan(SECTOR):
        assert reading.trace is not None
        assert reading.trace.rate == pytest.approx(50_000)
        np.testing.assert_allclose(reading.trace.samples, np.linspace(0, 1, 3125), atol=0.5 / 255 + 1e-12)


def test_a_resent_reading_keeps_the_traces_of_its_neighbours() -> None:
    # every third frame of a reading is lost, but not its trace
    lost = 0

    def cable(data: bytes) -> bytes:
        nonlocal lost
        frames = data.split(b"\0")
        kept = []
        for frame in frames:
            if len(frame) in range(40, 60) and lost < 25:
                lost += 1
                if lost % 3 == 0:
                    continue
            kept.append(frame)
        return b"\0".join(kept)

    joined = Joined()
    joined.greet(trace=True)
    joined.up = cable
    readings = joined.scan(SECTOR)
    assert joined.driver.statistics.resends > 0
    assert len(readings) == 80
    for reading in readings:
        assert reading.trace is not None
        assert not np.isnan(reading.trace.samples).any()


def test_the_reading_rate_is_limited_by_turning_listening_and_ten_per_second() -> None:
    # 5° at 180°/s, 20 ms of settling and 62.5 ms of listening take 110.3 ms
    for step, period in ((1_000_000, 0.1), (5_000_000, 5 / 180 + 0.020 + 0.0625)):
        joined = Joined()
        joined.greet()
        times = [reading.time for reading in joined.scan(StartScan(0, step, 72, 1, 1))]
        assert times[-1] - times[1] == pytest.approx(70 * period, abs=1e-3)


@pytest.mark.parametrize("step", [0.5, 1, 2, 5, 10, 90])
@pytest.mark.parametrize(("headings", "sweeps", "pings"), [(6, 1, 3), (6, 2, 1), (1, 3, 2)])
@pytest.mark.parametrize("listen", [3_000, 30_000, 65_000])
def test_no_two_pings_start_within_a_tenth_of_a_second(
    step: float, headings: int, sweeps: int, pings: int, listen: int
) -> None:
    joined = Joined()
    joined.greet()
    joined.ask(Configure(listen, 2_380, 0, 343_200))
    order = StartScan(0, round(step * 1e6), headings, sweeps, pings)
    times = [reading.time for _ in range(2) for reading in joined.scan(order)]
    assert len(times) == 2 * headings * sweeps * pings
    assert all(later - earlier > 0.1 - 1e-7 for earlier, later in itertools.pairwise(times))


def test_a_move_between_two_pings_fits_inside_the_ping_period() -> None:
    joined = Joined()
    joined.greet()
    joined.ask(Configure(30_000, 2_380, 0, 343_200))
    # turning by 5° and settling take 48 ms, after 30 ms of listening; the turntable is already at the first heading
    times = [reading.time for reading in joined.scan(StartScan(0, 5_000_000, 10, 1, 2))]
    assert np.diff(times) == pytest.approx([0.1] * 19, abs=2e-6)


def test_the_ping_period_is_kept_after_a_stopped_scan() -> None:
    joined = Joined()
    joined.greet()
    joined.ask(StartScan(0, 1_000_000, 50, 1, 1))
    joined.until(lambda: len(joined.readings) == 5)
    joined.ask(Stop())
    last = joined.readings[-1].time
    (first, *_) = joined.scan(StartScan(0, 1_000_000, 1, 1, 1))
    assert first.time - last > 0.1 - 1e-7


def test_thirty_six_headings_with_traces_take_less_than_twelve_seconds() -> None:
    joined = Joined()
    joined.greet(trace=True)
    began = joined.now
    joined.scan(StartScan(0, 10_000_000, 36, 1, 1))
    assert joined.now - began < 12.0


def test_heartbeats_come_every_quarter_second_while_homing_and_turning() -> None:
    joined = Joined()
    joined.ask(Hello(1, 1))
    beats: list[tuple[float, int]] = []

    seen: Heartbeat | None = None

    def watch(done: bool) -> bool:
        nonlocal seen
        if joined.driver.heartbeat is not seen:
            seen = joined.driver.heartbeat
            assert seen is not None
            beats.append((joined.now, seen.state))
        return done

    home = joined.ask(Home())
    joined.until(lambda: watch(home.finished is not None))
    turn = joined.ask(Turn(350_000_000))
    joined.until(lambda: watch(turn.finished is not None))
    assert {State.HOMING, State.TURNING} <= {state for _, state in beats}
    assert all(0.24 < b[0] - a[0] < 0.26 for a, b in itertools.pairwise(beats))


def test_homing_takes_less_than_three_seconds_from_any_angle() -> None:
    for seed in range(20):
        joined = Joined(board=FakeBoard(PlainEchoes(), seed=seed))
        joined.ask(Hello(1, 1))
        began = joined.now
        assert joined.act(Home()).finished is not None
        assert joined.now - began < 3.0


def test_a_lost_finished_is_recovered_by_repeating_the_command() -> None:
    joined = Joined()
    joined.greet()
    joined.up = without(the_first(Finished))
    turn = joined.act(Turn(90_000_000))
    assert turn.finished is not None
    assert turn.finished.outcome == Outcome.DONE
    assert joined.driver.statistics.repeated_commands == 1


def test_an_action_without_its_finished_ends_with_an_error() -> None:
    joined = Joined()
    joined.greet()
    joined.up = without(lambda message: isinstance(message, Finished))
    with pytest.raises(NoAnswer, match="is idle but sends no Finished for Turn; start it again"):
        joined.act(Turn(1_000_000))
    assert joined.driver.statistics.repeated_commands == ASKS


def test_a_lost_answer_is_recovered_after_the_command_has_finished() -> None:
    joined = Joined()
    joined.greet()
    joined.up = without(the_first(Accepted))
    turn = joined.act(Turn(1_000_000))  # takes 26 ms
    assert isinstance(turn.answer, Accepted)
    joined.up = without(the_first(Started))
    assert len(joined.scan(StartScan(0, 1_000_000, 2, 1, 1))) == 2


def test_command_numbers_continue_at_0_after_65535() -> None:
    joined = Joined(driver=Driver(first_sequence=65_534))
    joined.greet()
    assert len(joined.scan(StartScan(0, 5_000_000, 3, 1, 1))) == 3
    assert joined.ask(Home()).sequence == 2


def test_a_lost_started_loses_no_reading() -> None:
    joined = Joined()
    joined.greet()
    joined.scan(SECTOR)
    joined.up = without(the_first(Started))
    readings = joined.scan(SECTOR)
    assert [reading.number for reading in readings] == list(range(80))
    assert joined.driver.statistics.repeated_commands == 1


def test_a_lost_reading_is_requested_at_the_next_heartbeat_before_the_next_reading() -> None:
    joined = Joined()
    joined.greet()
    joined.up = without(the_first(ReadingMessage))
    # 120° apart: 0.75 s between readings
    joined.ask(StartScan(0, 120_000_000, 3, 1, 1))
    joined.until(lambda: len(joined.readings) == 1)
    assert joined.readings[0].number == 0
    assert len(joined.echoes.pings) == 1


def test_a_reading_that_is_lost_again_is_requested_again_after_a_while() -> None:
    """Without any bytes from the board to wake the driver."""
    joined = Joined()
    joined.greet()
    requests: list[float] = []

    def noting(data: bytes) -> bytes:
        frames = [frame for frame in FrameDecoder().feed(data) if isinstance(frame, Frame)]
        requests.extend(joined.now for frame in frames if frame.type == Resend.TYPE)
        return data

    joined.down = noting
    joined.up = without(lambda message: isinstance(message, ReadingMessage | Heartbeat))
    joined.ask(StartScan(0, 1_000_000, 2, 1, 1))
    joined.until(lambda: len(requests) == 2)
    assert requests[1] - requests[0] == pytest.approx(ASK_AGAIN, abs=1e-3)


@pytest.mark.parametrize("lost", [3, 2])
def test_readings_lost_just_before_the_end_of_the_scan_are_requested(lost: int) -> None:
    """Finished states how many readings the board has made."""
    numbers: list[int] = []

    def unwanted(message: Message) -> bool:
        if isinstance(message, ReadingMessage):
            numbers.append(message.number)
        late = isinstance(message, ReadingMessage) and message.number >= lost and numbers.count(message.number) == 1
        return late or isinstance(message, Heartbeat)

    joined = Joined()
    joined.greet()
    joined.up = without(unwanted)
    readings = joined.scan(StartScan(0, 5_000_000, 4, 1, 1))
    assert sorted(one.number for one in readings) == [0, 1, 2, 3]
    assert numbers.count(0) == 1


def test_a_reading_of_the_previous_scan_is_left_out_of_the_next_one() -> None:
    joined = Joined()
    joined.greet()
    late: list[bytes] = []

    def keep_readings(data: bytes) -> bytes:
        late.extend(
            encode_frame(frame)
            for frame in FrameDecoder().feed(data)
            if isinstance(frame, Frame) and frame.type == ReadingMessage.TYPE
        )
        return data

    joined.up = without(lambda message: isinstance(message, ReadingMessage) and message.number == 3)
    lost = joined.up
    joined.driver.command(StartScan(0, 1_000_000, 5, 1, 1), joined.now)
    joined.up = lambda data: lost(keep_readings(data))
    joined.until(lambda: len(joined.readings) == 4)
    joined.ask(Stop())
    joined.up = unchanged
    second = joined.driver.command(StartScan(90_000_000, 1_000_000, 5, 1, 1), joined.now)
    joined.driver.receive(b"\0".join([b"", *late]), joined.now)  # repeated answers to a Resend
    joined.until(lambda: second.finished is not None and joined.driver.scan_complete)
    angles = [math.degrees(reading.angle) for reading in joined.readings[4:]]
    assert angles == pytest.approx([90, 91, 92, 93, 94])


def test_answers_to_an_earlier_conversation_are_ignored() -> None:
    joined = Joined()
    joined.greet()
    stale = Settings(command=4711, listen_us=1, blanking_us=0, trace=1, speed_of_sound=1)
    joined.driver.receive(encode_frame(Frame(stale.TYPE, 0, 0, stale.pack())), joined.now)
    (reading,) = joined.scan(StartScan(0, 1, 1, 1, 1))
    assert reading.speed_of_sound == pytest.approx(343.2)
    assert reading.trace is None


def test_noise_before_a_command_does_not_damage_it() -> None:
    joined = Joined()
    joined.board.receive(b"bytes of a terminal program used before", 0.0)
    joined.ask(Hello(1, 1))
    assert joined.driver.statistics.repeated_commands == 0


def test_readings_of_the_previous_scan_are_not_resent_in_the_next_one() -> None:
    joined = Joined()
    joined.greet()
    joined.scan(SECTOR)
    joined.ask(StartScan(0, 1_000_000, 50, 1, 1))
    before = joined.driver.statistics.frames_received
    joined.ask(Resend(0, 64))
    end = joined.now + 0.02  # the first reading of this scan takes longer
    joined.until(lambda: joined.now >= end)
    assert joined.driver.statistics.frames_received == before + 1  # only Accepted


def test_the_tap_receives_each_frame_unchanged() -> None:
    passed: list[bytes] = []
    joined = Joined(driver=Driver(first_sequence=100, tap=lambda received, time, wire: passed.append(wire)))
    joined.greet()
    # COBS allows a last byte after a full block of 254 bytes; the encoder of this project omits it
    wire = next(wire for wire in map(unknown_frame, range(1, 256)) if len(wire) == 256)
    padded = wire[:-1] + b"\x01\0"
    joined.driver.receive(padded, joined.now)
    assert passed[-1] == padded


def unknown_frame(filling: int) -> bytes:
    """Return a frame of an unknown type, 254 bytes long before byte stuffing."""
    return encode_frame(Frame(0xF0, 0x0101, 0x0101_0101_0101_0101, bytes([filling]) * (254 - 15)))


def test_a_second_scan_is_not_mixed_with_the_first() -> None:
    joined = Joined(down=dropping(11, 1 / 100), up=dropping(12, 1 / 100))
    joined.greet()
    for step in (2_500_000, -3_000_000, 1_000_000):
        order = StartScan(20_000_000, step, 30, 1, 1)
        readings = joined.scan(order)
        assert sorted(reading.number for reading in readings) == list(range(30))
        for reading in readings:
            assert reading.angle == pytest.approx(math.radians(20 + step / 1e6 * reading.number), abs=1e-8)


def test_silence_in_the_middle_of_a_scan_is_an_error_after_three_quarters_of_a_second() -> None:
    joined = Joined()
    joined.greet()
    joined.ask(SECTOR)
    joined.until(lambda: len(joined.readings) == 5)
    joined.up = lambda data: b""
    began = joined.now
    with pytest.raises(NoAnswer, match="no byte received"):
        joined.until(lambda: False)
    assert joined.now - began == pytest.approx(SILENCE, abs=0.26)


def test_a_silent_device_is_an_error_after_three_seconds_of_greeting() -> None:
    joined = Joined(up=lambda data: b"")
    with pytest.raises(NoAnswer, match="no answer to Hello after 6 tries"):
        joined.ask(Hello(1, 1))
    assert joined.now == pytest.approx(3.0)
    assert joined.driver.statistics.frames_sent == TRIES


def test_noise_does_not_count_as_a_sign_of_life() -> None:
    joined = Joined()
    joined.greet()
    joined.up = lambda data: b"rubbish" * 9
    began = joined.now
    with pytest.raises(NoAnswer, match="no valid message"):
        joined.until(lambda: False)
    assert joined.now - began == pytest.approx(NO_MESSAGE, abs=0.3)


def test_an_unanswered_command_is_an_error_after_the_last_try() -> None:
    joined = Joined()
    joined.greet()
    joined.up = without(lambda message: isinstance(message, Accepted))
    before = joined.driver.statistics.frames_sent
    with pytest.raises(NoAnswer, match="no answer to Stop after 6 tries"):
        joined.ask(Stop())
    assert joined.driver.statistics.frames_sent == before + TRIES
