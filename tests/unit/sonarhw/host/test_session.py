"""A session with a fake board: the scan is complete and from one device, or ends with an error, over any cable."""

import itertools
import math
import random
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from sonarhw.device.fake_board import BoardIdentity
from sonarhw.errors import CommandRefused, DeviceError, LinkLost, LogError, NoAnswer, WrongDevice
from sonarhw.host import scripts
from sonarhw.host.driver import SIGN_OF_LIFE
from sonarhw.host.session import Connection, Session
from sonarhw.link import BOOTLOADER
from sonarhw.readings import Reading, pings_in_place
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.readings_of_frames import start_scan
from tests.fixtures.bench import TRACES, Bench, Cable, cut_every, dropping, flipping, without, without_first
from tests.fixtures.plain_echoes import assert_scanned

ORDER = msg.StartScan(start=10_000_000, step=2_500_000, headings=30, sweeps=2, pings=1)
CABLES: dict[str, Callable[[], Cable]] = {
    "one byte in 2000 dropped": lambda: dropping(1, 1 / 2000),
    "one byte in 300 dropped": lambda: dropping(2, 1 / 300),
    "one byte in 300 flipped": lambda: flipping(4, 1 / 300),
    "40 bytes in 1500 cut": lambda: cut_every(1500, 40),
    "200 bytes in 5000 cut": lambda: cut_every(5000, 200),
}


def assert_complete(readings: Sequence[Reading], order: msg.StartScan = ORDER) -> None:
    assert_scanned(readings, order)


@pytest.fixture
def bench() -> Bench:
    """Return a session that is connected to a fake board."""
    return Bench().connect()


# damaged and lost messages


@pytest.mark.parametrize("cable", CABLES.values(), ids=CABLES.keys())
@pytest.mark.parametrize("trace", [False, True], ids=["echoes", "traces"])
def test_every_reading_arrives_once(bench: Bench, cable: Callable[[], Cable], trace: bool) -> None:
    bench.up, bench.down = cable(), cable()
    for order in (ORDER, replace(ORDER, step=-3_000_000)):
        assert_complete(bench.scanned(order, trace), order)
    statistics = bench.session.statistics
    assert statistics.rejected_blocks > 0
    assert statistics.lost_readings == 0
    # the board measured each reading once: a lost frame causes no new measurement
    assert len(bench.echoes.pings) == 60 + 60


@pytest.mark.parametrize(
    "kind", [msg.Accepted, msg.Started, msg.Finished, msg.Settings, msg.ReadingMessage], ids=lambda kind: kind.__name__
)
def test_a_lost_message_is_recovered(bench: Bench, kind: type[msg.Message]) -> None:
    bench.do(scripts.homing())
    bench.up = without_first(kind)
    bench.do(scripts.configuring(TRACES))
    assert bench.do(scripts.turning(msg.Turn(90_000_000))).result is msg.Outcome.DONE
    assert_complete(bench.scanned(ORDER))
    statistics = bench.session.statistics
    assert (statistics.repeated_commands, statistics.resends) == ((0, 1) if kind is msg.ReadingMessage else (1, 0))


def test_a_lost_reading_is_requested_at_the_next_heartbeat_and_again_after_a_while(bench: Bench) -> None:
    requests: list[float] = []
    bench.do(scripts.homing())

    def noting(data: bytes) -> bytes:
        frames = [frame for frame in FrameDecoder().feed(data) if isinstance(frame, Frame)]
        requests.extend(bench.now for frame in frames if frame.type == msg.Resend.TYPE)
        return data

    bench.down = noting
    bench.up = without_first(msg.ReadingMessage)
    scan = bench.scan(msg.StartScan(0, 120_000_000, 3, 1, 1))  # 0.75 s between readings
    bench.until(lambda: scan.readings)
    assert (scan.readings[0].number, len(bench.echoes.pings), len(requests)) == (0, 1, 1)
    bench.up = without(lambda message: isinstance(message, msg.ReadingMessage | msg.Heartbeat))
    bench.until(lambda: len(requests) == 3)
    assert requests[2] - requests[1] == pytest.approx(0.3, abs=1e-3)


def test_more_readings_than_requests_for_one_are_requested_again(bench: Bench) -> None:
    seen = set[int]()

    def lost_at_first(message: msg.Message) -> bool:
        lost = isinstance(message, msg.ReadingMessage) and message.number % 2 == 0 and message.number not in seen
        if isinstance(message, msg.ReadingMessage):
            seen.add(message.number)
        return lost

    bench.up, order = without(lost_at_first), replace(ORDER, sweeps=4)
    assert_complete(bench.scanned(order), order)
    assert bench.session.statistics.lost_readings == 0  # which would be measured again


def test_late_messages_of_an_earlier_scan_or_conversation_change_nothing(bench: Bench) -> None:
    late: list[bytes] = []
    lost = without(lambda message: isinstance(message, msg.ReadingMessage) and message.number == 3)

    def keeping(data: bytes) -> bytes:
        frames = [frame for frame in FrameDecoder().feed(data) if isinstance(frame, Frame)]
        late.extend(encode_frame(frame) for frame in frames if frame.type == msg.ReadingMessage.TYPE)
        return lost(data)

    bench.up = keeping
    first = bench.scan(msg.StartScan(0, 1_000_000, 5, 1, 1), readings=4)
    bench.session.stop(first, bench.now)
    bench.until(lambda: first.done)
    bench.up = lambda data: data
    stale = msg.Settings(command=4711, listen_us=1, blanking_us=0, trace=1, speed_of_sound=1)
    second = bench.session.start(scripts.scanning(msg.StartScan(90_000_000, 1_000_000, 5, 1, 1)), bench.now)
    bench.session.receive(b"\0".join([encode_frame(Frame(stale.TYPE, 0, 0, stale.pack())), *late]), bench.now)
    bench.until(lambda: second.done)
    assert [math.degrees(reading.angle) for reading in second.readings] == pytest.approx([90, 91, 92, 93, 94])
    assert [reading.speed_of_sound for reading in second.readings] == pytest.approx([344.8] * 5, abs=0.1)


def test_command_numbers_continue_at_0_after_65535() -> None:
    class Last(random.Random):
        def randrange(self, *_: object) -> int:
            return 65_534

    bench = Bench()
    bench.session = Session("the port", rng=Last())
    bench.session.connect(0.0)
    assert_complete(bench.connect().scanned(ORDER))


@pytest.mark.parametrize(
    ("cable", "message", "seconds"),
    [
        (lambda data: b"", "no byte received", 0.75),
        (lambda data: b"rubbish" * 9, "no valid message", 3.0),
        (without(lambda message: isinstance(message, msg.Accepted)), "no answer to Turn after 6 tries", 3.0),
        (without(lambda message: isinstance(message, msg.Finished)), "sends no Finished for Turn; start it again", 5.2),
    ],
)
def test_what_does_not_arrive_is_named_after_its_time(bench: Bench, cable: Cable, message: str, seconds: float) -> None:
    bench.do(scripts.homing())
    bench.up = cable
    turn, began = bench.session.start(scripts.turning(msg.Turn(1_000_000)), bench.now), bench.now
    bench.until(lambda: turn.error or bench.session.loss)
    assert bench.now - began == pytest.approx(seconds, abs=0.5)
    assert message in str(turn.error or bench.session.loss)


# an unplugged cable


def test_after_a_reset_during_a_scan_settings_and_zero_are_restored(bench: Bench) -> None:
    bench.do(scripts.configuring(TRACES))
    bench.do(scripts.configuring_turntable(msg.ConfigureTurntable(90_000_000, 0, 30_000, 1)))
    before, frames = bench.session.statistics.frames_received, list[bytes]()
    bench.up = lambda data: (frames.extend(data.split(b"\0")[:-1]), data)[1]
    scan = bench.scan(ORDER, readings=7)
    bench.reset()
    bench.until(lambda: scan.done)
    assert_complete(scan.readings)
    assert all(reading.trace is not None for reading in scan.readings)
    assert bench.session.statistics.frames_received == before + len(frames)  # of both conversations
    began = bench.now
    bench.do(scripts.turning(msg.Turn(270_000_000)))
    assert bench.now - began > 1.9  # at 90°/s
    statistics = bench.session.statistics
    assert (statistics.losses, statistics.reopened, statistics.resets) == (1, 0, 1)


def test_the_motor_is_held_while_the_host_sends_and_released_when_it_is_silent(bench: Bench) -> None:
    scan = bench.scan(ORDER, readings=7)
    bench.pull(0.5)
    bench.until(lambda: not bench.board.zero or scan.done)
    assert_complete(scan.readings)  # without a new homing
    bench.wait(10.0)
    assert bench.board.zero
    bench.pull(1e6, port_vanishes=False)
    pulled = bench.now
    bench.until(lambda: not bench.board.zero)
    assert bench.now - pulled == pytest.approx(2.0, abs=0.51)


def test_a_device_of_version_1_0_gets_no_keepalive_and_continues_after_an_unplug() -> None:
    bench = Bench(identity=BoardIdentity(serial="OLD", minor=0)).connect()
    assert bench.session.device.capabilities is None
    scan = bench.scan(ORDER, readings=20)
    bench.pull(1.0, power=True)
    bench.until(lambda: scan.done)
    assert_complete(scan.readings)
    # the old firmware received no unknown command
    assert bench.board.statistics(0).rejected == bench.session.statistics.rejected_messages == 0


@pytest.mark.parametrize(
    ("job", "needs"),
    [
        (lambda: scripts.scanning(start_scan(pings_in_place(2))), r"protocol 1\.1, a ping without homing needs 1\.2"),
        (scripts.zeroing, r"protocol 1\.1, a zero that is set by hand needs 1\.2"),
    ],
)
def test_version_1_1_is_not_sent_what_it_misinterprets(job: Callable[[], scripts.Job], needs: str) -> None:
    bench = Bench(identity=BoardIdentity(minor=1)).connect()
    with pytest.raises(DeviceError, match=needs):
        bench.do(job())
    assert bench.board.zero is msg.Zero.UNKNOWN


def test_a_zero_set_by_hand_is_not_replaced_by_homing_after_a_reset(bench: Bench) -> None:
    bench.do(scripts.zeroing())
    scan = bench.scan(ORDER, readings=7)
    bench.reset()
    bench.until(lambda: scan.done)
    assert "lost the zero that was set by hand" in str(scan.error)
    assert bench.board.zero is msg.Zero.UNKNOWN


@pytest.mark.parametrize("returns", [False, True])
def test_another_device_at_the_same_usb_socket_is_refused_until_the_right_one_returns(returns: bool) -> None:
    bench = Bench(reconnect=20.0).connect()
    scan = bench.scan(ORDER, readings=5)
    bench.pull(1.0)
    bench.until(lambda: bench.pulled is not None)
    bench.reset(serial="FAKE-0008")
    if returns:
        bench.wait(4.0)
        bench.reset(serial="FAKE-0007")
    bench.until(lambda: scan.done)
    if returns:
        assert_complete(scan.readings)
    else:
        assert isinstance(scan.error, WrongDevice)
        assert "FAKE-0008" in str(scan.error)
        assert "FAKE-0007" in str(scan.error)
        assert len(scan.readings) < 10


def test_ten_losses_without_a_reading_are_an_error() -> None:
    bench = Bench(reconnect=math.inf).connect()
    scan = bench.scan(ORDER)
    while not scan.done:
        bench.until(lambda: scan.done or bench.session.state is Connection.STREAMING)
        bench.reset()
        bench.until(lambda: scan.done or bench.session.state is not Connection.STREAMING)
    assert not scan.readings
    assert isinstance(scan.error, LinkLost)
    assert "it has restarted; the scanner was lost 10 times in a row" in str(scan.error)


def test_pauses_between_attempts_grow_to_4_s_and_an_idle_session_never_gives_up() -> None:
    bench = Bench(reconnect=5.0).connect()
    bench.do(scripts.homing())
    bench.pull(100.0, power=True)
    tries: list[float] = []
    fail = bench.session.open_failed
    bench.session.open_failed = lambda error, now: (tries.append(now), fail(error, now))[1]  # type: ignore[method-assign]
    bench.until(lambda: bench.session.state is Connection.LOST)
    bench.until(lambda: bench.session.state is Connection.READY, within=200)
    assert np.diff(tries)[:5] == pytest.approx([0.5, 1.0, 2.0, 4.0, 4.0])
    assert np.diff(tries)[5:].max() == pytest.approx(4.0)
    assert bench.do(scripts.turning(msg.Turn(5_000_000))).result is msg.Outcome.DONE


@pytest.mark.parametrize("stopped_first", [False, True])
def test_a_stopped_scan_ends_without_its_lost_device(bench: Bench, stopped_first: bool) -> None:
    scan = bench.scan(ORDER, readings=5)
    if stopped_first:
        bench.session.stop(scan, bench.now)
    bench.pull(1e6)
    bench.until(lambda: bench.session.state is Connection.LOST)
    assert scan.done == stopped_first
    bench.session.stop(scan, bench.now)
    assert (scan.done, scan.result) == (True, msg.Outcome.STOPPED)


# jobs


def test_turning_and_scanning_home_first_and_a_refusal_ends_its_job_only(bench: Bench) -> None:
    refused = bench.run(scripts.turning(msg.Turn(800_000_000)))
    assert isinstance(refused.error, CommandRefused)
    assert bench.do(scripts.turning(msg.Turn(80_000_000))).result is msg.Outcome.DONE
    assert_complete(Bench(seed=9).connect().scanned(ORDER))


def test_homing_without_an_end_is_stopped_with_an_error(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench.board.turntable, "home", lambda now: now + 1e6)
    with pytest.raises(DeviceError, match="check that the turntable can move freely"):
        bench.do(scripts.homing(), within=scripts.MOVE_WITHIN + 5)
    assert not bench.board.busy


class Counting:
    """A recorder that counts frames. Its disk may be full."""

    def __init__(self, full: bool = False) -> None:
        self.frames, self._full = 0, full

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        self.frames += 1

    def reading(self, reading: Reading) -> None:
        if self._full:
            raise LogError("no space left")


def test_a_recorder_that_fails_ends_its_job_and_stops_the_board(bench: Bench) -> None:
    bench.session.recording.use(Counting(full=True))
    scan = bench.scan(ORDER)
    bench.until(lambda: scan.done)
    assert isinstance(scan.error, LogError)
    bench.until(lambda: not bench.board.busy)
    assert_complete(bench.scanned(ORDER))


# the speed of the line, and its greeting

FAST = BoardIdentity(serial="FAST", bauds=(250_000, 500_000, 1_000_000))


def test_a_speed_that_failed_is_not_used_in_a_later_conversation() -> None:
    bench = Bench(identity=FAST, bauds=True)
    bench.highest_clean_baud, bench.clean_down = 500_000, True
    bench.connect()
    bench.board.line.change(1_000_000)
    bench.highest_clean_baud = 1_000_000
    bench.until(lambda: bench.session.state is not Connection.READY)
    bench.connect()
    assert bench.session.device.baud == bench.board.line.baud == 500_000


def test_a_device_left_at_a_higher_speed_is_found_and_errors_before_that_are_not_counted() -> None:
    bench = Bench(identity=FAST, bauds=True)
    bench.board.line.change(1_000_000)
    bench.connect()
    assert bench.session.state is Connection.READY
    counted = bench.session.statistics
    assert (counted.rejected_blocks, counted.missing_frames, counted.repeated_commands) == (0, 0, 0)
    assert Bench(identity=FAST).connect().board.line.baud == 250_000  # a line whose speed cannot be set


def greetings(session: Session, times: Sequence[float]) -> list[tuple[float, int]]:
    """Return time and speed of each greeting that the session sends at these times."""
    sent = []
    for now in times:
        session.advance(now)
        if session.outgoing():
            sent.append((now, session.device.baud))
    return sent


BEAT = encode_frame(Frame(msg.Heartbeat.TYPE, 5, 0, msg.Heartbeat(0, 0, 0, 2000).pack()))
TENTHS = [tenth / 10 for tenth in range(60)]


def opened(**line: float) -> Session:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, **line)
    return session


def test_a_first_greeting_tries_each_speed_three_times_and_that_of_an_arriving_frame_again() -> None:
    session = opened(bauds=True)
    bauds = [baud for _, baud in greetings(session, [tenth / 10 for tenth in range(400)])]
    assert isinstance(session.failed, NoAnswer)
    rounds = [baud for baud, _ in itertools.groupby(bauds)]
    assert min(map(rounds.count, set(rounds))) >= 3
    session = opened(bauds=True)
    greetings(session, TENTHS[:1])
    session.receive(BEAT, 0.7)  # the device returned to its first speed
    assert [baud for _, baud in greetings(session, TENTHS[7:25])][:4] == [250_000, 250_000, 250_000, 1_000_000]


def test_a_possible_bootloader_receives_nothing_for_two_seconds_unless_the_device_already_sends() -> None:
    session = opened(quiet=BOOTLOADER)
    assert [now for now, _ in greetings(session, TENTHS)][:2] == pytest.approx([2.0, 2.5])
    session = opened(quiet=BOOTLOADER)
    session.receive(BEAT, 0.3)
    assert session.outgoing()


def test_readings_that_the_device_no_longer_keeps_are_measured_again(bench: Bench) -> None:
    scan = bench.scan(ORDER, readings=5)
    # these readings are lost until the device no longer keeps them
    bench.up = without(lambda message: isinstance(message, msg.ReadingMessage) and 10 <= message.number < 13)
    bench.until(lambda: bench.session.statistics.lost_readings == 3)
    bench.up = lambda data: data
    bench.until(lambda: scan.done)
    assert_complete(scan.readings)
    assert [reading.number for reading in scan.readings][-3:] == [10, 11, 12]


def test_the_statistics_show_a_bad_cable_only(bench: Bench) -> None:
    bad = Bench().connect()
    bad.up = dropping(5, 1 / 200)
    for one in (bench, bad):
        one.scanned(ORDER)
    clean, poor = bench.session.statistics, bad.session.statistics
    assert (clean.rejected_blocks, clean.missing_frames, clean.resends, clean.repeated_commands) == (0, 0, 0, 0)
    assert min(poor.rejected_blocks, poor.missing_frames, poor.resends) > 0
    assert 0 < clean.frames_sent < 10 + bench.now / SIGN_OF_LIFE
