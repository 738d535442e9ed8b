"""Laws of a session: whatever happens to cable and board, the scan comes whole, from the same device, or is told of."""

import itertools
import math
import random
from collections import Counter

import pytest

from sonarhw.device.fake_board import BoardIdentity
from sonarhw.errors import CommandRefused, DeviceError, Incompatible, LinkLost, LogError, NoAnswer, WrongDevice
from sonarhw.host.actions import configuring, configuring_turntable, homing, scanning, turning
from sonarhw.host.conversation import MOVE_WITHIN
from sonarhw.host.session import Connection, Session
from sonarhw.link.serial_link import BOOTLOADER
from sonarhw.readings import Reading
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Configure, ConfigureTurntable, Heartbeat, Outcome, ReadingMessage, StartScan, Turn
from tests.fixtures.joined import dropping, flipping, without
from tests.fixtures.lost_and_found import PLUGGED, World
from tests.fixtures.plain_echoes import echo_time

ORDER = StartScan(start=10_000_000, step=2_500_000, headings=30, sweeps=2, pings=1)
TRACES = Configure(20_000, 2_380, 1, 343_200)


def check(readings: "list[Reading]", order: StartScan = ORDER) -> None:
    """Every reading of a scan, none twice, each right."""
    total = order.headings * order.sweeps * order.pings
    assert sorted(reading.number for reading in readings) == list(range(total))
    for reading in readings:
        place = reading.number // order.pings
        sweep, index = divmod(place, order.headings)
        index = order.headings - 1 - index if sweep % 2 else index
        angle = math.radians((order.start + order.step * index) / 1e6)
        assert reading.angle == pytest.approx(angle, abs=1e-8)
        assert (reading.sweep, reading.ping) == (sweep, reading.number % order.pings)
        assert reading.echo_times[0] == pytest.approx(echo_time(angle), abs=2e-9)


def test_two_hundred_random_unplugs_lose_no_reading_and_each_is_detected_within_a_second() -> None:
    chance = random.Random(1)
    unplugs = 0
    while unplugs < 200:
        unplugs += scan_with_unplugs(World(seed=unplugs).meet(), chance)


def scan_with_unplugs(world: World, chance: random.Random) -> int:
    """Scan, pulling the cable five times; how often that was before the scan was done."""
    scan, unplugs = world.scan(ORDER), 0
    for _ in range(5):
        world.until(lambda: scan.done or world.session.state is Connection.STREAMING)
        kind = chance.randrange(4)
        away = chance.choice((0.1, 1.0, 3.0, 9.0))
        world.pull(away, noticed=kind < 2, power=kind % 2 == 0, after=chance.uniform(0, 1.5))
        world.until(lambda: not world.pulls)
        if not scan.done:
            unplugs += 1
            pulled = world.now
            world.until(lambda: world.pulled is None or world.session.state not in PLUGGED)
            assert world.now - pulled <= 1.0
    world.until(lambda: scan.done)
    assert scan.result is Outcome.DONE
    check([*scan.readings])
    return unplugs


@pytest.mark.parametrize("cable", [dropping, flipping])
@pytest.mark.parametrize("trace", [False, True])
def test_one_fault_in_ten_thousand_bytes_loses_no_reading(cable: type[object], trace: bool) -> None:
    world = World().meet()
    world.up, world.down = cable(5, 1e-4), cable(6, 1e-4)  # type: ignore[call-arg]
    world.run(configuring(Configure(62_500, 2_380, int(trace), 343_200)))
    order = StartScan(0, 1_000_000, 360, 1, 1)
    scan = world.run(scanning(order))
    assert scan.error is None
    check([*scan.readings], order)
    books = world.session.statistics
    assert books.rejected_blocks > 0
    assert books.lost_readings == 0


def test_readings_that_the_device_no_longer_keeps_are_measured_again() -> None:
    world = World().meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    # heartbeats pass, nothing else does: the readings go out of what the device keeps
    world.up = without(lambda message: isinstance(message, ReadingMessage) and 10 <= message.number < 13)
    world.until(lambda: world.session.statistics.lost_readings == 3)
    world.up = lambda data: data
    world.until(lambda: scan.done)
    check([*scan.readings])
    assert [reading.number for reading in scan.readings][-3:] == [10, 11, 12]


def test_after_a_reset_during_a_scan_settings_and_zero_are_restored() -> None:
    world = World().meet()
    world.run(configuring(TRACES))
    world.run(configuring_turntable(ConfigureTurntable(90_000_000, 0, 30_000, 1)))
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 7)
    world.reset()
    reset = world.now
    world.until(lambda: world.session.state not in PLUGGED)
    assert world.now - reset <= 1.0
    world.until(lambda: scan.done)
    check([*scan.readings])
    assert all(reading.trace is not None for reading in scan.readings)
    assert world.board._turntable.speed == pytest.approx(math.pi / 2)
    books = world.session.statistics
    assert (books.losses, books.reopened, books.resets) == (1, 0, 1)
    times = [reading.time for reading in scan.readings]
    assert times == sorted(times)


def test_time_after_a_reset_follows_the_clock_of_the_host() -> None:
    world = World().meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 7)
    world.pull(4.0, power=True)
    world.until(lambda: scan.done)
    times = [reading.time for reading in scan.readings]
    gap = max(later - earlier for earlier, later in itertools.pairwise(times))
    assert 4.0 < gap < 12.0
    hosts = [reading.host_time for reading in scan.readings]
    for time, host in zip(times, hosts, strict=True):
        assert host is not None
        assert host - hosts[0] == pytest.approx(time - times[0], abs=0.05)  # type: ignore[operator]


def test_a_short_unplug_needs_no_new_homing() -> None:
    world = World().meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 7)
    world.pull(0.5)
    homed = []
    world.until(lambda: homed.append(world.board.homed) or scan.done)  # type: ignore[func-returns-value]
    assert all(homed)
    check([*scan.readings])


def test_the_motor_is_held_while_the_host_sends_and_released_when_it_is_silent() -> None:
    world = World().meet()
    world.run(homing())
    start = world.now
    world.until(lambda: world.now > start + 10)
    assert world.board.homed
    world.pull(1e6, noticed=False)
    pulled = world.now
    world.until(lambda: not world.board.homed)
    assert world.now - pulled == pytest.approx(2.0, abs=0.51)


def test_a_device_of_version_1_0_gets_no_keepalive_and_continues_after_an_unplug() -> None:
    world = World(BoardIdentity(serial="OLD", minor=0)).meet()
    assert world.session.device.capabilities is None
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 20)
    world.pull(1.0, power=True)
    world.until(lambda: scan.done)
    check([*scan.readings])
    # nothing the old firmware does not know was sent to it
    assert world.board.statistics(0).rejected == 0
    assert world.session.statistics.rejected_messages == 0


def test_another_device_at_the_same_usb_socket_is_refused() -> None:
    world = World(reconnect=20.0).meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    world.pull(1.0)
    world.until(lambda: world.pulled is not None)
    world.reset(serial="FAKE-0008")
    world.until(lambda: scan.done)
    assert isinstance(scan.error, WrongDevice)
    assert "FAKE-0008" in str(scan.error)
    assert "FAKE-0007" in str(scan.error)
    assert len(scan.readings) < 10


def test_the_scan_continues_when_the_right_device_returns_after_another_one() -> None:
    world = World().meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    world.pull(1.0)
    world.until(lambda: world.pulled is not None)
    world.reset(serial="FAKE-0008")
    started = world.now
    world.until(lambda: world.now > started + 4)
    world.reset(serial="FAKE-0007")
    world.until(lambda: scan.done)
    check([*scan.readings])


def test_a_device_that_does_not_return_is_an_error_after_the_set_time() -> None:
    world = World(reconnect=10.0).meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    world.pull(1e6)
    pulled = world.now
    world.until(lambda: scan.done)
    assert isinstance(scan.error, LinkLost)
    assert "did not come back within 10 s" in str(scan.error)
    assert world.now - pulled == pytest.approx(10.0, abs=0.5)


def test_ten_losses_without_a_reading_are_an_error() -> None:
    world = World(reconnect=math.inf).meet()
    scan = world.scan(ORDER)
    while not scan.done:
        world.until(lambda: scan.done or world.session.state is Connection.STREAMING)
        world.reset()
        world.until(lambda: scan.done or world.session.state is not Connection.STREAMING)
    assert not scan.readings
    assert isinstance(scan.error, LinkLost)
    assert "it has restarted; the scanner was lost 10 times in a row" in str(scan.error)


def test_pauses_between_attempts_grow() -> None:
    world = World(reconnect=60.0).meet()
    tries: list[float] = []
    fail = world.session.open_failed
    world.session.open_failed = lambda error, now: (tries.append(now), fail(error, now))[1]  # type: ignore[method-assign]
    world.pull(1e6)
    began = world.now
    world.until(lambda: world.now > began + 30)
    gaps = [later - earlier for earlier, later in itertools.pairwise(tries)]
    assert gaps[:4] == pytest.approx([0.5, 1.0, 2.0, 4.0])
    assert gaps[4:] == pytest.approx([4.0] * len(gaps[4:]))


def test_an_idle_session_reconnects_after_any_time() -> None:
    world = World(reconnect=5.0).meet()
    world.run(homing())
    world.pull(100.0, power=True)
    world.until(lambda: world.session.state is Connection.LOST)
    world.until(lambda: world.session.state is Connection.READY, within=200)
    assert world.run(turning(Turn(5_000_000))).result is Outcome.DONE


def test_a_job_started_while_the_device_is_lost_runs_after_its_return() -> None:
    world = World().meet()
    world.pull(5.0)
    world.until(lambda: world.session.state is Connection.LOST)
    scan = world.run(scanning(ORDER))
    check([*scan.readings])


def test_stopping_a_scan_while_the_link_is_lost_ends_it() -> None:
    world = World().meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    world.pull(1e6)
    world.until(lambda: world.session.state is Connection.LOST)
    world.session.stop(scan, world.now)
    assert scan.done
    assert scan.result is Outcome.STOPPED


def test_turning_and_scanning_home_first() -> None:
    world = World().meet()
    assert world.run(turning(Turn(1_000_000))).result is Outcome.DONE
    other = World(seed=9).meet()
    check([*other.run(scanning(ORDER)).readings])


def test_a_refused_request_is_an_error_and_the_next_one_is_served() -> None:
    world = World().meet()
    refused = world.run(turning(Turn(800_000_000)))
    assert isinstance(refused.error, CommandRefused)
    assert world.run(turning(Turn(80_000_000))).result is Outcome.DONE


def test_a_jammed_turntable_is_a_fault_and_not_a_lost_link() -> None:
    world = World().meet()
    world.board.wedge(5.0)
    home = world.run(homing())
    assert isinstance(home.error, DeviceError)
    assert "zero mark" in str(home.error)
    assert world.session.statistics.losses == 0


def test_a_turntable_jammed_after_a_reset_is_a_fault_and_the_session_continues() -> None:
    world = World().meet()
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    world.reset()
    world.board.wedge(8.0)
    reset = world.now
    world.until(lambda: scan.done)
    assert isinstance(scan.error, DeviceError)
    assert "zero mark" in str(scan.error)
    assert world.now - reset < 5.0
    assert world.session.state is Connection.READY
    world.until(lambda: world.now > reset + 9.0)
    check([*world.run(scanning(ORDER)).readings])


def test_homing_without_an_end_is_stopped_with_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World().meet()
    monkeypatch.setattr(world.board._turntable, "home", lambda now: now + 1e6)
    home = world.session.start(homing(), world.now)
    world.until(lambda: home.done, within=MOVE_WITHIN + 5)
    assert isinstance(home.error, DeviceError)
    assert "check that the turntable can move freely" in str(home.error)
    assert not world.board.busy


def test_a_recorder_that_fails_ends_its_job_and_stops_the_board() -> None:
    class FullDisk:
        def frame(self, received: bool, time: float, wire: bytes) -> None:
            pass

        def reading(self, reading: Reading) -> None:
            raise LogError("no space left")

    world = World().meet()
    world.session.recording.use(FullDisk())
    scan = world.scan(ORDER)
    world.until(lambda: scan.done)
    assert isinstance(scan.error, LogError)
    world.until(lambda: not world.board.busy)
    check([*world.run(scanning(ORDER)).readings])


def test_a_recorder_receives_nothing_between_jobs() -> None:
    class Counting:
        def __init__(self) -> None:
            self.frames = 0

        def frame(self, received: bool, time: float, wire: bytes) -> None:
            self.frames += 1

        def reading(self, reading: Reading) -> None:
            pass

    world, recorder = World().meet(), Counting()
    world.session.recording.use(recorder)
    assert recorder.frames == 2  # the greeting
    world.run(homing())
    heard, now = recorder.frames, world.now
    assert heard > 4
    world.until(lambda: world.now > now + 5)
    assert recorder.frames == heard


def test_a_missing_scanner_and_another_major_version_are_reported_at_once() -> None:
    mute = World()
    mute.up = lambda data: b""
    assert isinstance(mute.meet().session.failed, NoAnswer)
    newer = World(BoardIdentity(major=2, minor=0)).meet()
    assert isinstance(newer.session.failed, Incompatible)
    assert newer.session.state is Connection.DISCONNECTED


# the speed of the line

FAST = BoardIdentity(serial="FAST", bauds=(250_000, 500_000, 1_000_000))


@pytest.mark.parametrize("sound_up_to", [250_000, 500_000, 1_000_000])
def test_the_line_uses_the_highest_speed_without_errors(sound_up_to: int) -> None:
    world = World(FAST, bauds=True)
    world.highest_sound_baud = sound_up_to
    world.meet()
    assert world.session.device.baud == world.board.line.baud == sound_up_to
    check([*world.run(scanning(ORDER)).readings])


def test_a_device_that_was_reset_is_found_again_at_its_first_speed() -> None:
    world = World(FAST, bauds=True).meet()
    assert world.board.line.baud == 1_000_000
    scan = world.scan(ORDER)
    world.until(lambda: len(scan.readings) == 5)
    world.reset()
    world.until(lambda: scan.done)
    check([*scan.readings])
    assert world.board.line.baud == 1_000_000


def test_a_device_left_at_a_higher_speed_is_found() -> None:
    world = World(FAST, bauds=True)
    world.board.line.change(1_000_000)
    world.meet()
    assert world.session.state is Connection.READY


def test_a_line_without_a_settable_speed_is_left_unchanged() -> None:
    world = World(FAST).meet()
    assert world.board.line.baud == 250_000


# a bootloader


def test_a_possible_bootloader_receives_nothing_for_two_seconds() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, quiet=BOOTLOADER)
    said_at = []
    for tenth in range(40):
        session.advance(tenth / 10)
        if session.outgoing():
            said_at.append(tenth / 10)
    assert said_at[0] == pytest.approx(2.0)
    assert said_at[1] == pytest.approx(2.5)


def test_a_first_greeting_tries_each_speed_of_the_line_three_times_before_it_gives_up() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, bauds=True)
    spoken, now = [], 0.0
    while session.failed is None:
        if session.outgoing():
            spoken.append(session.device.baud)
        now = session.next_event()
        session.advance(now)
    assert min(Counter(baud for baud, _ in itertools.groupby(spoken)).values()) >= 3
    assert isinstance(session.failed, NoAnswer)


def test_a_device_that_already_sends_is_greeted_at_once() -> None:
    session = Session("the port", rng=random.Random(1))
    session.connect(0.0)
    session.opened(0.0, quiet=BOOTLOADER)
    beat = Heartbeat(0, 0, 0, 2000)
    session.receive(encode_frame(Frame(beat.TYPE, 5, 0, beat.pack())), 0.3)
    assert session.outgoing()
