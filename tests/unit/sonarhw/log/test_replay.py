import math
from dataclasses import replace
from pathlib import Path

import pytest

from sonarhw.device.replayed_log import ReplayDevice
from sonarhw.errors import InputError
from sonarhw.host.driver import Driver
from sonarhw.host.scripts import scanning
from sonarhw.log import Log, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading
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
from sonarhw.wire.readings_of_frames import ReadingAssembler
from tests.fixtures.example_logs import METADATA, assert_readings_close, example_reading, write_example
from tests.fixtures.joined import unchanged
from tests.fixtures.pulled_cables import Bench

COUNT = 12
CONFIGURE = Configure(listen_us=1000, blanking_us=0, trace=0, speed_of_sound=1)
SCAN = StartScan(0, 5_000_000, COUNT, 1, 1)
SWITCHED_ON = 1000.0  # time of the clock when the device is switched on, s


class Host:
    """A host with a virtual clock that keeps each received message with its time of arrival."""

    def __init__(self, device: ReplayDevice) -> None:
        self.device = device
        self.now = SWITCHED_ON
        self.received: list[tuple[float, Message]] = []
        self.assembler = ReadingAssembler()
        self.readings: list[Reading] = []
        self._decoder = FrameDecoder()
        self._sequence = 40

    def send(self, message: Message, *, again: bool = False) -> int:
        """Send a message, or with `again` repeat the last frame; return its sequence number."""
        self._sequence += not again
        frame = Frame(message.TYPE, self._sequence, 0, message.pack())
        self.device.receive(encode_frame(frame), self.now)
        return self._sequence

    def wait(self, seconds: float) -> None:
        """Advance the clock by `seconds`, event by event."""
        end = self.now + seconds
        while (event := self.device.next_event()) is not None and event <= end:
            self.now = max(self.now, event)
            self._take(self.device.advance(self.now))
        self.now = end
        self._take(self.device.advance(self.now))

    def all(self, kind: type[Message]) -> list[Message]:
        return [message for _, message in self.received if isinstance(message, kind)]

    def times(self, kind: type[Message]) -> list[float]:
        return [time for time, message in self.received if isinstance(message, kind)]

    def _take(self, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            assert isinstance(frame, Frame)
            message = unpack_message(frame.type, frame.payload)
            assert message is not None
            self.received.append((self.now, message))
            self.readings += self.assembler.feed(message)


def recorded(folder: Path, *, trace: bool = False) -> Log:
    write_example(folder / "scan.mcap", COUNT, trace=trace)
    return read_log(folder / "scan.mcap")


def greeted(device: ReplayDevice) -> Host:
    host = Host(device)
    host.send(Hello(1, 0))
    host.send(CONFIGURE)
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
    host.send(SCAN)
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
    host.send(SCAN)
    host.wait(10.0)
    listen = log.scans[0].settings.listen_us * 1e-6 if log.scans[0].settings else 0.0
    for reading, came, original in zip(host.readings, host.times(ReadingMessage), log.readings, strict=True):
        assert came - begin == pytest.approx((original.time + listen) / speed, abs=0.002)
        assert reading.time - (begin - SWITCHED_ON) == pytest.approx(original.time / speed, abs=1e-6)


def test_the_schedule_does_not_drift_when_the_clock_is_read_late(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    begin = host.now - SWITCHED_ON
    host.send(SCAN)
    for _ in range(40):
        host.now += 0.0377
        host._take(host.device.advance(host.now))
    assert [reading.time - begin for reading in host.readings] == pytest.approx(
        [r.time for r in log.readings], abs=1e-6
    )


def test_a_replay_answers_with_the_recorded_identity_and_settings(log: Log) -> None:
    host = Host(ReplayDevice(log))
    hello = host.send(Hello(1, 0))
    configure = host.send(CONFIGURE)
    host.wait(0.1)
    assert log.info is not None
    assert log.settings is not None
    assert host.all(Info) == [replace(log.info, command=hello)]
    assert host.all(Settings) == [replace(log.settings, command=configure)]


def test_homing_and_turning_end_at_once(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    home = host.send(Home())
    host.wait(0.01)
    turn = host.send(Turn(90_000_000))
    host.wait(0.3)
    assert host.all(Accepted) == [Accepted(home), Accepted(turn)]
    assert host.all(Finished) == [Finished(home, 0, 0, ""), Finished(turn, 0, 0, "")]
    (*_, beat) = host.all(Heartbeat)
    assert isinstance(beat, Heartbeat)
    assert (beat.state, beat.angle) == (State.IDLE, 90_000_000)


def test_a_replay_requires_a_hello_and_is_busy_while_it_plays(log: Log) -> None:
    host = Host(ReplayDevice(log))
    early = host.send(SCAN)
    host.wait(0.1)
    host.send(Hello(1, 0))
    host.send(SCAN)
    late = host.send(Home())
    host.wait(0.1)
    refusals = [(one.command, one.code) for one in host.all(Refused) if isinstance(one, Refused)]
    assert refusals == [(early, Refusal.NO_HELLO), (late, Refusal.BUSY)]
    assert host.device.busy


def test_a_heartbeat_comes_every_quarter_second_at_any_speed(log: Log) -> None:
    host = greeted(ReplayDevice(log, speed=0.1))
    host.send(SCAN)
    host.wait(3.0)
    beats = host.times(Heartbeat)
    assert [beat - SWITCHED_ON for beat in beats] == pytest.approx([0.25 * n for n in range(1, 13)], abs=0.002)


def test_a_repeated_command_is_executed_once_and_answered_twice(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    scan = host.send(SCAN)
    host.wait(0.35)
    host.send(SCAN, again=True)
    host.wait(5.0)
    assert host.all(Started) == 2 * [Started(scan, COUNT)]
    assert [reading.number for reading in host.readings] == [*range(COUNT)]


def test_stop_ends_the_scan_and_keeps_its_readings(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    scan = host.send(SCAN)
    host.wait(0.45)
    stop = host.send(Stop())
    host.wait(5.0)
    made = len(host.readings)
    assert 0 < made < COUNT
    assert host.all(Finished) == [Finished(scan, Outcome.STOPPED, made, "")]
    assert host.all(Accepted) == [Accepted(stop)]
    assert not host.device.busy


def test_readings_are_resent_on_request(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    host.send(SCAN)
    host.wait(5.0)
    first = [message for message in host.all(ReadingMessage) if isinstance(message, ReadingMessage)]
    host.send(Resend(3, 2))
    host.wait(0.1)
    assert host.all(ReadingMessage)[COUNT:] == first[3:5]


def test_a_loop_continues_until_the_requested_number_of_readings(log: Log) -> None:
    host = greeted(ReplayDevice(log, loop=True))
    scan = host.send(replace(SCAN, sweeps=3))
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
        host.send(SCAN)
        host.wait(5.0)
    assert [one.readings for one in host.all(Started) if isinstance(one, Started)] == [COUNT, 3, COUNT]


def test_a_request_for_a_part_replays_that_part_of_the_previous_scan(log: Log) -> None:
    other = replace(log.scans[0], readings=log.scans[0].readings[:3])
    host = greeted(ReplayDevice(replace(log, scans=(*log.scans, other))))
    host.send(SCAN)
    host.wait(5.0)
    host.readings.clear()
    host.send(replace(SCAN, first=4, count=3))
    host.wait(0.15)
    assert [reading.number for reading in host.readings][:1] == [4]  # at once, without a pause for the omitted part
    host.wait(5.0)
    assert [reading.number for reading in host.readings] == [4, 5, 6]
    assert [r.echo_times for r in host.readings] == [r.echo_times for r in log.readings[4:7]]


def test_a_log_without_a_speed_of_sound_is_refused(log: Log) -> None:
    unknown = [replace(reading, speed_of_sound=math.nan) for reading in log.readings]
    silent = replace(log, settings=None, scans=(replace(log.scans[0], settings=None, readings=tuple(unknown)),))
    with pytest.raises(InputError, match="no speed of sound"):
        ReplayDevice(silent)


@pytest.mark.parametrize("requested", [343_200, 300_000])
def test_a_log_without_settings_is_replayed_with_the_recorded_ranges(log: Log, requested: int) -> None:
    bare = replace(log, settings=None, scans=(replace(log.scans[0], settings=None),))
    host = Host(ReplayDevice(bare))
    for message in (Hello(1, 0), replace(CONFIGURE, speed_of_sound=requested), SCAN):
        host.send(message)
    host.wait(5.0)
    for got, wanted in zip(host.readings, log.readings, strict=True):
        assert got.echo_ranges == pytest.approx(wanted.echo_ranges, abs=1e-6)


def test_without_any_settings_readings_arrive_at_their_times(log: Log) -> None:
    host = Host(ReplayDevice(replace(log, settings=None, scans=(replace(log.scans[0], settings=None),))))
    for message in (Hello(1, 0), SCAN):
        host.send(message)
    begin = host.now
    host.wait(5.0)
    came = [time - begin for time in host.times(ReadingMessage)]
    assert came == pytest.approx([reading.time for reading in log.readings], abs=0.002)


def test_missing_readings_leave_no_gap_in_the_numbers(log: Log) -> None:
    gappy = replace(log.scans[0], readings=log.scans[0].readings[::2])
    host = greeted(ReplayDevice(replace(log, scans=(gappy,))))
    host.send(SCAN)
    host.wait(5.0)
    assert [reading.number for reading in host.readings] == [*range(COUNT // 2)]
    assert [r.echo_times for r in host.readings] == [r.echo_times for r in gappy.readings]


def test_a_new_hello_stops_the_replay(log: Log) -> None:
    host = greeted(ReplayDevice(log))
    host.send(SCAN)
    host.wait(0.3)
    host.device.hang_up()
    host.send(Hello(1, 0))
    host.wait(1.0)
    assert not host.device.busy
    host.readings.clear()
    host.send(SCAN)
    host.wait(5.0)
    assert len(host.readings) == COUNT


def test_a_speed_of_zero_is_refused(log: Log) -> None:
    with pytest.raises(ValueError, match="above 0"):
        ReplayDevice(log, speed=0.0)


def test_stop_works_at_any_replay_speed(tmp_path: Path) -> None:
    write_scan(tmp_path / "scan.mcap", METADATA, [example_reading(n, trace=True, angle=0.0) for n in range(400)])
    host = greeted(ReplayDevice(read_log(tmp_path / "scan.mcap"), speed=1e6))
    host.send(SCAN)
    host.wait(1e-4)
    host.send(Stop())
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

    for message in (Hello(1, 0), CONFIGURE, SCAN):
        now = until_done(message, now)
    assert [reading.echo_times for reading in readings] == [reading.echo_times for reading in log.readings]
    assert driver.statistics.lost_readings == 0


def test_traces_arrive_in_chunks_of_their_reading(tmp_path: Path) -> None:
    host = greeted(ReplayDevice(recorded(tmp_path, trace=True)))
    host.send(SCAN)
    host.wait(5.0)
    chunks = [chunk for chunk in host.all(TraceChunk) if isinstance(chunk, TraceChunk)]
    assert [chunk.number for chunk in chunks] == [n for n in range(COUNT) for _ in range(3)]


def replayed(device: ReplayDevice) -> Bench:
    """Return a session connected to this device."""
    bench = Bench()
    bench.board = device  # type: ignore[assignment]  # the bench serves it like a board
    return bench.connect()


def test_a_replayed_boot_counter_is_not_taken_for_repeated_resets(log: Log) -> None:
    assert log.info is not None
    # several heartbeats arrive before the first reading
    late = replace(log.scans[0], began=log.scans[0].began - 1.0)
    bench = replayed(ReplayDevice(replace(log, info=replace(log.info, minor=1, boot=3), scans=(late,))))
    scan = bench.run(scanning(SCAN))
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
    scan = bench.scan(replace(SCAN, headings=2 * COUNT))
    bench.until(lambda: scan.done)
    assert scan.error is None
    assert [reading.echo_times for reading in scan.readings] == [reading.echo_times for reading in log.readings]
    assert bench.session.statistics.losses == 1
