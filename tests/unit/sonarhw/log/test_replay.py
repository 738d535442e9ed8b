import math
from dataclasses import replace
from pathlib import Path

import pytest

from sonarhw.errors import InputError
from sonarhw.export.encoded_log import write_scan
from sonarhw.host.actions import scanning
from sonarhw.host.driver import Driver
from sonarhw.log import Log, read_log
from sonarhw.readings import Reading
from sonarhw.replay.replayed_log import ReplayDevice
from sonarhw.wire.assembly import ReadingAssembler
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import (
    Accepted,
    Configure,
    Finished,
    Heartbeat,
    Hello,
    Home,
    Info,
    Message,
    Outcome,
    ReadingMessage,
    Refusal,
    Refused,
    Resend,
    Settings,
    Started,
    StartScan,
    State,
    Stop,
    TraceChunk,
    Turn,
    unpack_message,
)
from tests.fixtures.example_logs import METADATA, assert_readings_close, example_reading, write_example
from tests.fixtures.joined import unchanged
from tests.fixtures.pulled_cables import Bench

COUNT = 12
WISH = Configure(listen_us=1000, blanking_us=0, trace=0, speed_of_sound=1)
ORDER = StartScan(0, 5_000_000, COUNT, 1, 1)
BORN = 1000.0  # what the clock says when the device is switched on


class Host:
    """A host with a virtual clock: says what it is told to and keeps what comes, with the time it came."""

    def __init__(self, device: ReplayDevice) -> None:
        self.device = device
        self.now = BORN
        self.heard: list[tuple[float, Message]] = []
        self.assembler = ReadingAssembler()
        self.readings: list[Reading] = []
        self._decoder = FrameDecoder()
        self._sequence = 40

    def say(self, message: Message, *, again: bool = False) -> int:
        """Send a message, or the newest frame once more; its sequence number."""
        self._sequence += not again
        frame = Frame(message.TYPE, self._sequence, 0, message.pack())
        self.device.receive(encode_frame(frame), self.now)
        return self._sequence

    def wait(self, seconds: float) -> None:
        """Let time pass, stopping wherever the device has something to do."""
        end = self.now + seconds
        while (event := self.device.next_event()) is not None and event <= end:
            self.now = max(self.now, event)
            self._take(self.device.advance(self.now))
        self.now = end
        self._take(self.device.advance(self.now))

    def all(self, kind: type[Message]) -> list[Message]:
        return [message for _, message in self.heard if isinstance(message, kind)]

    def times(self, kind: type[Message]) -> list[float]:
        return [time for time, message in self.heard if isinstance(message, kind)]

    def _take(self, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            assert isinstance(frame, Frame)
            message = unpack_message(frame.type, frame.payload)
            assert message is not None
            self.heard.append((self.now, message))
            self.readings += self.assembler.feed(message)


def recorded(folder: Path, *, trace: bool = False) -> Log:
    write_example(folder / "scan.mcap", COUNT, trace=trace)
    return read_log(folder / "scan.mcap")


def greeted(device: ReplayDevice) -> Host:
    host = Host(device)
    host.say(Hello(1, 0))
    host.say(WISH)
    host.wait(0.1)
    return host


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return recorded(tmp_path)


@pytest.mark.parametrize("trace", [False, True], ids=["echoes", "traces"])
@pytest.mark.parametrize("speed", [0.5, 1.0, 7.0, math.inf])
def test_a_replayed_scan_equals_the_recorded_scan(tmp_path: Path, trace: bool, speed: float) -> None:
    log = recorded(tmp_path, trace=trace)
    host = greeted(ReplayDevice(log, speed))
    host.say(ORDER)
    host.wait(10.0)
    assert host.all(Started) == [Started(host._sequence, COUNT)]
    assert host.all(Finished) == [Finished(host._sequence, Outcome.DONE, COUNT, "")]
    assert [reading.echo_times for reading in host.readings] == [reading.echo_times for reading in log.readings]
    for got, wanted in zip(host.readings, log.readings, strict=True):
        assert_readings_close(replace(got, time=wanted.time), wanted)


@pytest.mark.parametrize("speed", [0.5, 1.0, 2.0])
def test_readings_have_the_recorded_arrival_times_and_timestamps(log: Log, speed: float) -> None:
    host = greeted(ReplayDevice(log, speed))
    begin = host.now
    host.say(ORDER)
    host.wait(10.0)
    listen = log.scans[0].settings.listen_us * 1e-6 if log.scans[0].settings else 0.0
    for reading, came, original in zip(host.readings, host.times(ReadingMessage), log.readings, strict=True):
        assert came - begin == pytest.approx((original.time + listen) / speed, abs=0.002)
        assert reading.time - (begin - BORN) == pytest.approx(original.time / speed, abs=1e-6)


def test_the_schedule_does_not_drift_when_the_clock_is_read_late(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    begin = host.now - BORN
    host.say(ORDER)
    for _ in range(40):
        host.now += 0.0377
        host._take(host.device.advance(host.now))
    assert [reading.time - begin for reading in host.readings] == pytest.approx(
        [r.time for r in log.readings], abs=1e-6
    )


def test_a_replay_answers_with_the_recorded_identity_and_settings(log: Log) -> None:
    host = Host(ReplayDevice(log))
    hello = host.say(Hello(1, 0))
    configure = host.say(WISH)
    host.wait(0.1)
    assert log.info is not None
    assert log.settings is not None
    assert host.all(Info) == [replace(log.info, command=hello)]
    assert host.all(Settings) == [replace(log.settings, command=configure)]


def test_homing_and_turning_end_at_once(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    home = host.say(Home())
    host.wait(0.01)
    turn = host.say(Turn(90_000_000))
    host.wait(0.3)
    assert host.all(Accepted) == [Accepted(home), Accepted(turn)]
    assert host.all(Finished) == [Finished(home, 0, 0, ""), Finished(turn, 0, 0, "")]
    (*_, beat) = host.all(Heartbeat)
    assert isinstance(beat, Heartbeat)
    assert (beat.state, beat.angle) == (State.IDLE, 90_000_000)


def test_a_replay_requires_a_hello_and_is_busy_while_it_plays(log: Log) -> None:
    host = Host(ReplayDevice(log))
    early = host.say(ORDER)
    host.wait(0.1)
    host.say(Hello(1, 0))
    host.say(ORDER)
    late = host.say(Home())
    host.wait(0.1)
    refusals = [(one.command, one.code) for one in host.all(Refused) if isinstance(one, Refused)]
    assert refusals == [(early, Refusal.NO_HELLO), (late, Refusal.BUSY)]
    assert host.device.busy


def test_a_heartbeat_comes_every_quarter_second_at_any_speed(log: Log) -> None:
    host = greeted(ReplayDevice(log, speed=0.1))
    host.say(ORDER)
    host.wait(3.0)
    beats = host.times(Heartbeat)
    assert [beat - BORN for beat in beats] == pytest.approx([0.25 * n for n in range(1, 13)], abs=0.002)


def test_a_repeated_command_is_executed_once_and_answered_twice(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    scan = host.say(ORDER)
    host.wait(0.35)
    host.say(ORDER, again=True)
    host.wait(5.0)
    assert host.all(Started) == 2 * [Started(scan, COUNT)]
    assert [reading.number for reading in host.readings] == [*range(COUNT)]


def test_stop_ends_the_scan_and_keeps_its_readings(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    scan = host.say(ORDER)
    host.wait(0.45)
    stop = host.say(Stop())
    host.wait(5.0)
    made = len(host.readings)
    assert 0 < made < COUNT
    assert host.all(Finished) == [Finished(scan, Outcome.STOPPED, made, "")]
    assert host.all(Accepted) == [Accepted(stop)]
    assert not host.device.busy


def test_readings_are_resent_on_request(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    host.say(ORDER)
    host.wait(5.0)
    first = [message for message in host.all(ReadingMessage) if isinstance(message, ReadingMessage)]
    host.say(Resend(3, 2))
    host.wait(0.1)
    assert host.all(ReadingMessage)[COUNT:] == first[3:5]


def test_a_loop_continues_until_the_requested_number_of_readings(log: Log) -> None:
    host = greeted(ReplayDevice(log, loop=True))
    scan = host.say(replace(ORDER, sweeps=3))
    host.wait(10.0)
    assert host.all(Started) == [Started(scan, 3 * COUNT)]
    assert host.all(Finished) == [Finished(scan, Outcome.DONE, 3 * COUNT, "")]
    assert [reading.number for reading in host.readings] == [*range(3 * COUNT)]
    assert [reading.sweep for reading in host.readings] == [n // COUNT for n in range(3 * COUNT)]
    gaps = [after.time - before.time for before, after in zip(host.readings, host.readings[1:], strict=False)]
    assert gaps == pytest.approx([0.1] * (3 * COUNT - 1), abs=2e-6)
    for got, wanted in zip(host.readings, 3 * log.readings, strict=True):
        assert got.echo_times == wanted.echo_times


def test_each_scan_command_plays_the_next_recorded_scan(log: Log) -> None:
    shorter = replace(log.scans[0], readings=log.scans[0].readings[:3])
    host = greeted(ReplayDevice(replace(log, scans=(*log.scans, shorter))))
    for _ in range(3):
        host.say(ORDER)
        host.wait(5.0)
    assert [one.readings for one in host.all(Started) if isinstance(one, Started)] == [COUNT, 3, COUNT]


def test_a_request_for_a_part_replays_that_part_of_the_previous_scan(log: Log) -> None:
    other = replace(log.scans[0], readings=log.scans[0].readings[:3])
    host = greeted(ReplayDevice(replace(log, scans=(*log.scans, other))))
    host.say(ORDER)
    host.wait(5.0)
    host.readings.clear()
    host.say(replace(ORDER, first=4, count=3))
    host.wait(0.15)
    assert [reading.number for reading in host.readings][:1] == [4]  # at once, not after what is left out
    host.wait(5.0)
    assert [reading.number for reading in host.readings] == [4, 5, 6]
    assert [r.echo_times for r in host.readings] == [r.echo_times for r in log.readings[4:7]]


def test_a_log_without_a_speed_of_sound_is_refused(log: Log) -> None:
    unheard = [replace(reading, speed_of_sound=math.nan) for reading in log.readings]
    silent = replace(log, settings=None, scans=(replace(log.scans[0], settings=None, readings=tuple(unheard)),))
    with pytest.raises(InputError, match="no speed of sound"):
        ReplayDevice(silent)


@pytest.mark.parametrize("wished", [343_200, 300_000])
def test_a_log_without_settings_is_replayed_with_the_recorded_ranges(log: Log, wished: int) -> None:
    bare = replace(log, settings=None, scans=(replace(log.scans[0], settings=None),))
    host = Host(ReplayDevice(bare))
    for message in (Hello(1, 0), replace(WISH, speed_of_sound=wished), ORDER):
        host.say(message)
    host.wait(5.0)
    for got, wanted in zip(host.readings, log.readings, strict=True):
        assert got.echo_ranges == pytest.approx(wanted.echo_ranges, abs=1e-6)


def test_missing_readings_leave_no_gap_in_the_numbers(log: Log) -> None:
    gappy = replace(log.scans[0], readings=log.scans[0].readings[::2])
    host = greeted(ReplayDevice(replace(log, scans=(gappy,))))
    host.say(ORDER)
    host.wait(5.0)
    assert [reading.number for reading in host.readings] == [*range(COUNT // 2)]
    assert [r.echo_times for r in host.readings] == [r.echo_times for r in gappy.readings]


def test_a_new_hello_stops_the_replay(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    host.say(ORDER)
    host.wait(0.3)
    host.device.hang_up()
    host.say(Hello(1, 0))
    host.wait(1.0)
    assert not host.device.busy
    host.readings.clear()
    host.say(ORDER)
    host.wait(5.0)
    assert len(host.readings) == COUNT


def test_a_speed_of_zero_is_refused(log: Log) -> None:
    with pytest.raises(ValueError, match="above 0"):
        ReplayDevice(log, speed=0.0)


def test_stop_works_at_any_replay_speed(tmp_path: Path) -> None:
    write_scan(tmp_path / "scan.mcap", METADATA, [example_reading(n, trace=True, angle=0.0) for n in range(400)])
    host = greeted(ReplayDevice(read_log(tmp_path / "scan.mcap"), speed=1e6))
    host.say(ORDER)
    host.wait(1e-4)
    host.say(Stop())
    host.wait(1.0)
    (finished,) = host.all(Finished)
    assert isinstance(finished, Finished)
    assert finished.outcome == Outcome.STOPPED


def test_the_driver_receives_the_whole_scan(log: Log) -> None:
    driver, device, now = Driver(first_sequence=5), ReplayDevice(log, speed=3.0), 0.0
    readings: list[Reading] = []

    def until_done(message: Message, now: float) -> float:
        command = driver.command(message, now)
        while command.answer is None or (isinstance(message, StartScan) and not driver.scan_complete):
            device.receive(driver.outgoing(), now)
            now = min(time for time in (driver.next_event(), device.next_event()) if time is not None)
            data = device.advance(now)
            if data:
                driver.receive(data, now)
            else:
                driver.advance(now)
            readings.extend(driver.readings())
        return now

    for message in (Hello(1, 0), WISH, ORDER):
        now = until_done(message, now)
    assert [reading.echo_times for reading in readings] == [reading.echo_times for reading in log.readings]
    assert driver.statistics.lost_readings == 0


def test_traces_arrive_in_chunks_of_their_reading(tmp_path: Path) -> None:
    host = greeted(ReplayDevice(recorded(tmp_path, trace=True)))
    host.say(ORDER)
    host.wait(5.0)
    chunks = [chunk for chunk in host.all(TraceChunk) if isinstance(chunk, TraceChunk)]
    assert [chunk.number for chunk in chunks] == [n for n in range(COUNT) for _ in range(3)]


def replayed(device: ReplayDevice) -> Bench:
    """A session with that device."""
    bench = Bench()
    bench.board = device  # type: ignore[assignment]  # it is served as a board is
    return bench.connect()


def test_a_replayed_boot_counter_is_not_taken_for_repeated_resets(log: Log) -> None:
    assert log.info is not None
    # several heartbeats come before the first reading
    late = replace(log.scans[0], began=log.scans[0].began - 1.0)
    bench = replayed(ReplayDevice(replace(log, info=replace(log.info, minor=1, boot=3), scans=(late,))))
    scan = bench.run(scanning(ORDER))
    assert [reading.echo_times for reading in scan.readings] == [reading.echo_times for reading in log.readings]
    assert bench.session.statistics.losses == 0


def test_a_reset_reported_with_the_start_of_a_shorter_scan_loses_no_reading(log: Log) -> None:
    assert log.info is not None
    bench = replayed(ReplayDevice(replace(log, info=replace(log.info, minor=1))))
    held = b""
    reset = encode_frame(Frame(Heartbeat.TYPE, 0, 2**40, Heartbeat(State.SCANNING, 0, 2, 0, boot=99).pack()))

    def cable(data: bytes) -> bytes:
        nonlocal held
        held += data
        types = [frame.type for frame in FrameDecoder().feed(held) if isinstance(frame, Frame)]
        if Started.TYPE in types and types.count(ReadingMessage.TYPE) < 2:
            return b""
        data, held = held, b""
        if Started.TYPE not in types:
            return data
        bench.up = unchanged
        return data + reset

    bench.up = cable
    scan = bench.scan(replace(ORDER, headings=2 * COUNT))
    bench.until(lambda: scan.done)
    assert scan.error is None
    assert [reading.echo_times for reading in scan.readings] == [reading.echo_times for reading in log.readings]
    assert bench.session.statistics.losses == 1
