"""A recorded log as a device, and its playback: speed, steps, loops and seeking, on the recorded schedule."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sonarhw.device.replayed_log import Playback, ReplayDevice
from sonarhw.errors import InputError
from sonarhw.host.scripts import scanning
from sonarhw.log import Log, LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Origin, Reading, origin_of
from sonarhw.wire import messages as msg
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.readings_of_frames import ReadingAssembler
from tests.contract.talk import DirectLine, Talk, readings
from tests.fixtures.bench import Bench, unchanged
from tests.fixtures.example_logs import METADATA, STARTED, assert_readings_close, example_reading, write_example

COUNT = 12
CONFIGURE = msg.Configure(listen_us=1000, blanking_us=0, trace=0, speed_of_sound=1)
SCAN = msg.StartScan(0, 5_000_000, COUNT, 1, 1)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Log:
    path = tmp_path_factory.mktemp("log") / "scan.mcap"
    write_example(path, COUNT, trace=True)
    return read_log(path)


def greeted(device: ReplayDevice, configure: msg.Configure | None = CONFIGURE) -> Talk:
    line = DirectLine(device)
    talk = Talk(line, line.clock)
    talk.ask(msg.Hello(1, 0), msg.Info)
    if configure:
        talk.ask(configure, msg.Settings)
    return talk


def played(talk: Talk, order: msg.StartScan = SCAN, seconds: float = 30.0) -> list[Reading]:
    """Return the readings of a scan, after so many seconds."""
    since, assembler = len(talk.received), ReadingAssembler()
    talk.send(order)
    talk.quiet(seconds)
    messages = talk.messages(since)
    settings = [message for message in talk.messages() if isinstance(message, msg.Settings)][-1:]
    return [reading for message in (*settings, *messages) for reading in assembler.feed(message)]


def with_scans(log: Log, *scans: tuple[Reading, ...]) -> Log:
    """Return the log with these scans."""
    return replace(log, scans=tuple(replace(log.scans[0], readings=readings) for readings in scans))


@pytest.mark.parametrize("speed", [0.5, 1.0, 7.0, math.inf])
def test_a_replayed_scan_equals_the_recorded_one_on_its_schedule(log: Log, speed: float) -> None:
    talk = greeted(ReplayDevice(log, speed))
    begin = talk.clock()
    found = played(talk)
    for got, wanted in zip(found, log.readings, strict=True):
        assert_readings_close(replace(got, time=wanted.time), wanted)
        assert got.time - begin == pytest.approx(wanted.time / speed, abs=2e-3)
    chunks = [chunk.number for chunk in talk.messages() if isinstance(chunk, msg.TraceChunk)]
    assert chunks == [n for n in range(COUNT) for _ in range(3)]
    assert [one.readings for one in talk.messages() if isinstance(one, msg.Finished)] == [COUNT]


@pytest.mark.parametrize(("writer", "origin"), [("simulate", Origin.SIMULATED), ("import", Origin.IMPORTED)])
def test_a_scan_of_a_replay_has_the_origin_of_its_log(tmp_path: Path, writer: str, origin: Origin) -> None:
    write_scan(tmp_path / "log.mcap", LogMetadata(writer, STARTED), [example_reading(0)])
    log = read_log(tmp_path / "log.mcap")
    assert log.origin is origin
    # the replay reports the recorded identity, and the scan of the replay is made by `scan`
    assert origin_of("scan", log.info.firmware, log.info.serial) is origin


def test_a_heartbeat_comes_every_quarter_second_and_stop_ends_a_scan_at_any_speed(log: Log) -> None:
    for speed, played_for in ((0.1, 0.3), (1.0, 0.3), (1e6, 1e-4)):
        talk = greeted(ReplayDevice(with_scans(log, log.readings * 40), speed))
        talk.ask(SCAN, msg.Started)
        assert talk.ask(msg.Home(), msg.Refused).code == msg.Refusal.BUSY
        talk.quiet(played_for)
        stopped = talk.answers(msg.Stop())[0]
        assert isinstance(stopped, msg.Accepted)
        (finished,) = [one for one in talk.messages() if isinstance(one, msg.Finished)]
        assert finished.outcome == msg.Outcome.STOPPED
        assert finished.readings == len(readings(talk.messages()))
        assert sum(isinstance(message, msg.Heartbeat) for message in talk.quiet(1.0)) in (4, 5)


def test_each_scan_command_plays_the_next_recorded_scan_and_a_part_that_of_the_previous_one(log: Log) -> None:
    talk = greeted(ReplayDevice(with_scans(log, log.readings, log.readings[:3])))
    assert len(played(talk)) == COUNT
    began = talk.clock()
    part = played(talk, replace(SCAN, first=4, count=3), seconds=0.15)
    assert [reading.number for reading in part][:1] == [4]  # at once, without a pause for the omitted part
    assert part[0].time - began < 0.1
    talk.ask(msg.Stop(), msg.Accepted)
    part = played(talk, replace(SCAN, first=4, count=3))
    assert [reading.echo_times for reading in part] == [reading.echo_times for reading in log.readings[4:7]]
    assert [len(played(talk)) for _ in range(2)] == [3, COUNT]


def test_a_log_without_a_speed_of_sound_and_a_speed_of_zero_are_refused(log: Log) -> None:
    unknown = tuple(replace(reading, speed_of_sound=math.nan) for reading in log.readings)
    silent = replace(log, settings=None, scans=(replace(log.scans[0], settings=None, readings=unknown),))
    with pytest.raises(InputError, match="no speed of sound"):
        ReplayDevice(silent)
    with pytest.raises(ValueError, match="above 0"):
        ReplayDevice(log, speed=0.0)


def test_a_log_whose_damaged_time_a_replay_would_wait_for_is_played_only_without_pauses(log: Log) -> None:
    late = with_scans(log, (*log.readings[:-1], replace(log.readings[-1], time=log.readings[-1].time + 1e13)))
    with pytest.raises(InputError, match=r"a reading 1e\+13 s after the one before"):
        ReplayDevice(late, speed=10.0)
    assert len(played(greeted(ReplayDevice(late, math.inf)))) == COUNT


@pytest.mark.parametrize("speed_of_sound", [343_200, 300_000])
def test_a_log_without_settings_is_replayed_with_the_recorded_ranges(log: Log, speed_of_sound: int) -> None:
    bare = replace(log, settings=None, scans=(replace(log.scans[0], settings=None),))
    found = played(greeted(ReplayDevice(bare), replace(CONFIGURE, speed_of_sound=speed_of_sound)))
    for got, wanted in zip(found, log.readings, strict=True):
        assert got.echo_ranges == pytest.approx(wanted.echo_ranges, abs=1e-6)
    assert len(played(greeted(ReplayDevice(bare), None))) == COUNT  # the host needs not configure


def replayed(device: ReplayDevice) -> Bench:
    """Return a session connected to this device."""
    bench = Bench()
    bench.board = device  # type: ignore[assignment]  # the bench serves it like a board
    return bench.connect()


def test_a_replayed_boot_counter_is_not_taken_for_repeated_resets(log: Log) -> None:
    # several heartbeats arrive before the first reading
    late = replace(log.scans[0], began=log.scans[0].began - 1.0)
    bench = replayed(ReplayDevice(replace(log, info=replace(log.info, minor=1, boot=3), scans=(late,))))
    scan = bench.run(scanning(SCAN))
    assert [reading.echo_times for reading in scan.readings] == [reading.echo_times for reading in log.readings]
    assert bench.session.statistics.losses == 0


def test_a_reset_reported_with_the_start_of_a_shorter_scan_loses_no_reading(log: Log) -> None:
    bench = replayed(ReplayDevice(replace(log, info=replace(log.info, minor=1))))
    held = b""
    reset = encode_frame(
        Frame(msg.Heartbeat.TYPE, 0, 2**40, msg.Heartbeat(msg.State.SCANNING, 0, 2, 0, boot=99).pack())
    )

    def cable(data: bytes) -> bytes:
        nonlocal held
        held += data
        types = [frame.type for frame in FrameDecoder().feed(held) if isinstance(frame, Frame)]
        if msg.Started.TYPE in types and types.count(msg.ReadingMessage.TYPE) < 2:
            return b""
        data, held = held, b""
        if msg.Started.TYPE not in types:
            return data
        bench.up = unchanged
        return data + reset

    bench.up = cable
    scan = bench.scan(replace(SCAN, headings=2 * COUNT))
    bench.until(lambda: scan.done)
    assert scan.error is None
    assert [reading.echo_times for reading in scan.readings] == [reading.echo_times for reading in log.readings]
    assert bench.session.statistics.losses == 1


# playback


@pytest.fixture(scope="module")
def two_scans(tmp_path_factory: pytest.TempPathFactory) -> Log:
    """Return a log of two scans with the same readings."""
    path = tmp_path_factory.mktemp("playback") / "scan.mcap"
    write_scan(path, METADATA, [example_reading(number, sweep=number // 4) for number in range(COUNT)])
    two_scans = read_log(path)
    return replace(two_scans, scans=(*two_scans.scans, *two_scans.scans))


def playing(two_scans: Log, speed: float = 1.0) -> Playback:
    playback = Playback(two_scans)
    playback.speed = speed
    playback.play()
    return playback


@pytest.mark.parametrize("speed", [0.1, 1.0, 3.0, 1000.0])
def test_readings_appear_at_their_recorded_times_divided_by_the_speed(two_scans: Log, speed: float) -> None:
    for passed in (0.05, 0.15, 0.95, 1.15, 2.05, 2.15):
        playback = playing(two_scans, speed)
        playback.advance(passed / speed)
        times = [*(0.1 * n for n in range(COUNT)), *(2.1 + 0.1 * n for n in range(COUNT))]
        assert playback.count == sum(time < passed for time in times)


@settings(max_examples=50)
@given(ticks=st.lists(st.floats(1e-4, 0.05), min_size=1, max_size=60))
def test_playback_does_not_drift_at_irregular_clock_reads(two_scans: Log, ticks: list[float]) -> None:
    playback = playing(two_scans, 0.7)
    for tick in ticks:
        playback.advance(tick)
    assert playback.position == pytest.approx(min(0.7 * math.fsum(ticks), playback.duration), abs=1e-12)


def test_an_infinite_speed_is_accepted_and_zero_is_refused(two_scans: Log) -> None:
    playback = playing(two_scans, math.inf)
    playback.advance(1e-3)
    assert (playback.count, playback.playing) == (2 * COUNT, False)
    for speed in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="above 0"):
            playback.speed = speed


def test_playback_stops_when_paused_and_at_the_end(two_scans: Log) -> None:
    playback = playing(two_scans)
    playback.advance(0.25)
    assert playback.advance(0.0)
    playback.pause()
    assert not playback.advance(10.0)
    assert playback.position == pytest.approx(0.25)
    playback.play()
    playback.advance(100.0)
    assert (playback.position, playback.playing) == (playback.duration, False)
    playback.play()
    assert playback.position == 0.0


def test_a_loop_starts_over_and_never_ends(two_scans: Log) -> None:
    playback = playing(two_scans)
    playback.loop = True
    lap = playback.duration * (1 + 1 / (2 * COUNT - 1))
    playback.advance(5 * lap + 0.35)
    assert playback.playing
    assert playback.position == pytest.approx(0.35)
    assert playback.count == 4


def test_playback_seeks_to_a_reading_a_scan_and_a_sweep(two_scans: Log) -> None:
    playback = Playback(two_scans)
    for index in (0, 7, 2 * COUNT - 1, 3):
        playback.seek_reading(index)
        assert playback.count == index + 1
    playback.seek_scan(1)
    assert playback.count == COUNT + 1
    playback.seek_sweep(1, 2)
    assert playback.count == COUNT + 8 + 1
    playback.seek_sweep(0, 1)
    assert playback.count == 4 + 1
    for missing in (lambda: playback.seek_reading(2 * COUNT), lambda: playback.seek_scan(2)):
        with pytest.raises(IndexError):
            missing()


def test_playback_steps_reading_by_reading(two_scans: Log) -> None:
    playback = playing(two_scans)
    playback.advance(0.55)
    playback.step(1)
    assert (playback.count, playback.playing) == (7, False)
    playback.step(-3)
    assert playback.count == 4
    playback.step(-10)
    assert playback.count == 1
    playback.loop = True
    playback.step(-1)
    assert playback.count == 2 * COUNT
    playback.step(1)
    assert playback.count == 1


def with_pause(two_scans: Log, scan: int, number: int, pause: float) -> Log:
    """Return a log of one scan with a pause before one of its readings."""
    readings = two_scans.scans[0].readings
    late = tuple(replace(reading, time=reading.time + pause * (reading.number >= number)) for reading in readings)
    return replace(two_scans, scans=(replace(two_scans.scans[scan], readings=late),))


def test_gaps_are_skipped_and_other_intervals_are_kept(two_scans: Log) -> None:
    playback = Playback(with_pause(two_scans, 0, 6, 60.0))
    assert playback.duration == pytest.approx(1.1 + 60.0)
    playback.seek_reading(8)
    playback.skip_gaps = True
    assert (playback.count, playback.duration) == (9, pytest.approx(1.1))
    assert playback.position == pytest.approx(0.8)
    playback.skip_gaps = False
    assert (playback.count, playback.position) == (9, pytest.approx(60.8))
