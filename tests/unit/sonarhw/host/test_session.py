"""A session under faults of cable and board: the scan is complete and from one device, or ends with an error."""

import itertools
import math
import random

import pytest

from sonarhw.device.fake_board import BoardIdentity
from sonarhw.errors import CommandRefused, DeviceError, Incompatible, LinkLost, LogError, NoAnswer, WrongDevice
from sonarhw.host.scripts import MOVE_WITHIN, configuring, configuring_turntable, homing, scanning, turning, zeroing
from sonarhw.host.session import Connection
from sonarhw.readings import Reading, pings_in_place
from sonarhw.wire.messages import Configure, ConfigureTurntable, Outcome, ReadingMessage, StartScan, Turn, Zero
from sonarhw.wire.readings_of_frames import start_scan
from tests.conftest import Count
from tests.fixtures.joined import dropping, flipping, without
from tests.fixtures.plain_echoes import echo_time
from tests.fixtures.pulled_cables import CONNECTED, Bench

ORDER = StartScan(start=10_000_000, step=2_500_000, headings=30, sweeps=2, pings=1)
TRACES = Configure(20_000, 2_380, 1, 343_200)


def assert_complete(readings: "list[Reading]", order: StartScan = ORDER) -> None:
    """Assert that every reading of the scan is present once and correct."""
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


def test_random_unplugs_lose_no_reading_and_each_is_detected_within_a_second(count: Count) -> None:
    chance = random.Random(1)
    unplugs = 0
    while unplugs < count(50, 200):
        seen = scan_with_unplugs(Bench(seed=unplugs).connect(), chance)  # checks the scan and each unplug
        assert seen > 0
        unplugs += seen


def scan_with_unplugs(bench: Bench, chance: random.Random) -> int:
    """Scan and pull the cable five times; return the number of unplugs before the scan was done."""
    scan, unplugs = bench.scan(ORDER), 0
    for _ in range(5):
        bench.until(lambda: scan.done or bench.session.state is Connection.STREAMING)
        fault = chance.randrange(4)
        duration = chance.choice((0.1, 1.0, 3.0, 9.0))
        bench.pull(duration, port_vanishes=fault < 2, power=fault % 2 == 0, after=chance.uniform(0, 1.5))
        bench.until(lambda: not bench.pulls)
        if not scan.done:
            unplugs += 1
            pulled = bench.now
            bench.until(lambda: bench.pulled is None or bench.session.state not in CONNECTED)
            assert bench.now - pulled <= 1.0
    bench.until(lambda: scan.done)
    assert scan.result is Outcome.DONE
    assert_complete([*scan.readings])
    return unplugs


@pytest.mark.parametrize("cable", [dropping, flipping])
@pytest.mark.parametrize("trace", [False, True])
def test_one_fault_in_ten_thousand_bytes_loses_no_reading(cable: type[object], trace: bool) -> None:
    bench = Bench().connect()
    bench.up, bench.down = cable(5, 1e-4), cable(6, 1e-4)  # type: ignore[call-arg]
    bench.run(configuring(Configure(62_500, 2_380, int(trace), 343_200)))
    order = StartScan(0, 1_000_000, 360, 1, 1)
    scan = bench.run(scanning(order))
    assert scan.error is None
    assert_complete([*scan.readings], order)
    statistics = bench.session.statistics
    assert statistics.rejected_blocks > 0
    assert statistics.lost_readings == 0


def test_readings_that_the_device_no_longer_keeps_are_measured_again() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    # these readings are lost until the device no longer keeps them
    bench.up = without(lambda message: isinstance(message, ReadingMessage) and 10 <= message.number < 13)
    bench.until(lambda: bench.session.statistics.lost_readings == 3)
    bench.up = lambda data: data
    bench.until(lambda: scan.done)
    assert_complete([*scan.readings])
    assert [reading.number for reading in scan.readings][-3:] == [10, 11, 12]


def test_after_a_reset_during_a_scan_settings_and_zero_are_restored() -> None:
    bench = Bench().connect()
    bench.run(configuring(TRACES))
    bench.run(configuring_turntable(ConfigureTurntable(90_000_000, 0, 30_000, 1)))
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 7)
    bench.reset()
    reset = bench.now
    bench.until(lambda: bench.session.state not in CONNECTED)
    assert bench.now - reset <= 1.0
    bench.until(lambda: scan.done)
    assert_complete([*scan.readings])
    assert all(reading.trace is not None for reading in scan.readings)
    assert bench.board._turntable.speed == pytest.approx(math.pi / 2)
    statistics = bench.session.statistics
    assert (statistics.losses, statistics.reopened, statistics.resets) == (1, 0, 1)
    times = [reading.time for reading in scan.readings]
    assert times == sorted(times)


def test_time_after_a_reset_follows_the_clock_of_the_host() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 7)
    bench.pull(4.0, power=True)
    bench.until(lambda: scan.done)
    times = [reading.time for reading in scan.readings]
    gap = max(later - earlier for earlier, later in itertools.pairwise(times))
    assert 4.0 < gap < 12.0
    hosts = [reading.host_time for reading in scan.readings]
    for time, host in zip(times, hosts, strict=True):
        assert host is not None
        assert host - hosts[0] == pytest.approx(time - times[0], abs=0.05)  # type: ignore[operator]


def test_a_short_unplug_needs_no_new_homing() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 7)
    bench.pull(0.5)
    homed = []
    bench.until(lambda: homed.append(bench.board.zero) or scan.done)  # type: ignore[func-returns-value]
    assert all(homed)
    assert_complete([*scan.readings])


def test_the_motor_is_held_while_the_host_sends_and_released_when_it_is_silent() -> None:
    bench = Bench().connect()
    bench.run(homing())
    start = bench.now
    bench.until(lambda: bench.now > start + 10)
    assert bench.board.zero
    bench.pull(1e6, port_vanishes=False)
    pulled = bench.now
    bench.until(lambda: not bench.board.zero)
    assert bench.now - pulled == pytest.approx(2.0, abs=0.51)


def test_a_device_of_version_1_0_gets_no_keepalive_and_continues_after_an_unplug() -> None:
    bench = Bench(BoardIdentity(serial="OLD", minor=0)).connect()
    assert bench.session.device.capabilities is None
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 20)
    bench.pull(1.0, power=True)
    bench.until(lambda: scan.done)
    assert_complete([*scan.readings])
    # the old firmware received no unknown command
    assert bench.board.statistics(0).rejected == 0
    assert bench.session.statistics.rejected_messages == 0


def test_a_device_of_version_1_1_is_not_sent_what_it_would_misinterpret() -> None:
    bench = Bench(BoardIdentity(minor=1)).connect()
    for job, needs in (
        (scanning(start_scan(pings_in_place(2))), r"protocol 1\.1, a ping without homing needs 1\.2"),
        (zeroing(), r"protocol 1\.1, a zero that is set by hand needs 1\.2"),
    ):
        with pytest.raises(DeviceError, match=needs):
            raise bench.run(job).error or AssertionError
        assert bench.board.zero is Zero.UNKNOWN
    bench.run(homing())
    assert bench.board.zero is Zero.MARK


def test_a_zero_set_by_hand_is_not_replaced_by_homing_after_a_reset() -> None:
    bench = Bench().connect()
    bench.run(zeroing())
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 7)
    bench.reset()
    bench.until(lambda: scan.done)
    assert "lost the zero that was set by hand" in str(scan.error)
    assert bench.board.zero is Zero.UNKNOWN


def test_after_a_reset_pings_in_place_continue_without_homing() -> None:
    bench = Bench().connect()
    bench.run(homing())
    scan = bench.scan(start_scan(pings_in_place(20)))
    bench.until(lambda: len(scan.readings) == 7)
    bench.reset()
    bench.until(lambda: scan.done)
    assert scan.result is Outcome.DONE
    assert sorted(reading.number for reading in scan.readings) == list(range(20))
    assert bench.board.zero is Zero.UNKNOWN


def test_another_device_at_the_same_usb_socket_is_refused() -> None:
    bench = Bench(reconnect=20.0).connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    bench.pull(1.0)
    bench.until(lambda: bench.pulled is not None)
    bench.reset(serial="FAKE-0008")
    bench.until(lambda: scan.done)
    assert isinstance(scan.error, WrongDevice)
    assert "FAKE-0008" in str(scan.error)
    assert "FAKE-0007" in str(scan.error)
    assert len(scan.readings) < 10


def test_the_scan_continues_when_the_right_device_returns_after_another_one() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    bench.pull(1.0)
    bench.until(lambda: bench.pulled is not None)
    bench.reset(serial="FAKE-0008")
    started = bench.now
    bench.until(lambda: bench.now > started + 4)
    bench.reset(serial="FAKE-0007")
    bench.until(lambda: scan.done)
    assert_complete([*scan.readings])


def test_a_device_that_does_not_return_is_an_error_after_the_set_time() -> None:
    bench = Bench(reconnect=10.0).connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    bench.pull(1e6)
    pulled = bench.now
    bench.until(lambda: scan.done)
    assert isinstance(scan.error, LinkLost)
    assert "did not come back within 10 s" in str(scan.error)
    assert bench.now - pulled == pytest.approx(10.0, abs=0.5)


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


def test_pauses_between_attempts_grow() -> None:
    bench = Bench(reconnect=60.0).connect()
    tries: list[float] = []
    fail = bench.session.open_failed
    bench.session.open_failed = lambda error, now: (tries.append(now), fail(error, now))[1]  # type: ignore[method-assign]
    bench.pull(1e6)
    began = bench.now
    bench.until(lambda: bench.now > began + 30)
    gaps = [later - earlier for earlier, later in itertools.pairwise(tries)]
    assert gaps[:4] == pytest.approx([0.5, 1.0, 2.0, 4.0])
    assert gaps[4:] == pytest.approx([4.0] * len(gaps[4:]))


def test_an_idle_session_reconnects_after_any_time() -> None:
    bench = Bench(reconnect=5.0).connect()
    bench.run(homing())
    bench.pull(100.0, power=True)
    bench.until(lambda: bench.session.state is Connection.LOST)
    bench.until(lambda: bench.session.state is Connection.READY, within=200)
    assert bench.run(turning(Turn(5_000_000))).result is Outcome.DONE


def test_a_job_started_while_the_device_is_lost_runs_after_its_return() -> None:
    bench = Bench().connect()
    bench.pull(5.0)
    bench.until(lambda: bench.session.state is Connection.LOST)
    scan = bench.run(scanning(ORDER))
    assert_complete([*scan.readings])


def test_stopping_a_scan_while_the_link_is_lost_ends_it() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    bench.pull(1e6)
    bench.until(lambda: bench.session.state is Connection.LOST)
    bench.session.stop(scan, bench.now)
    assert scan.done
    assert scan.result is Outcome.STOPPED


def test_stopping_a_waiting_job_while_the_link_is_lost_keeps_the_running_one() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    waiting = bench.session.start(turning(Turn(90_000_000)), bench.now)
    bench.until(lambda: len(scan.readings) == 5)
    bench.pull(2.0)
    bench.until(lambda: bench.session.state is Connection.LOST)
    bench.session.stop(waiting, bench.now)
    assert (waiting.done, waiting.result, scan.done) == (True, Outcome.STOPPED, False)
    bench.until(lambda: scan.done)
    assert_complete([*scan.readings])
    assert bench.run(turning(Turn(0))).result is Outcome.DONE


def test_the_session_is_moving_only_while_the_turntable_moves() -> None:
    bench = Bench().connect()
    configured = bench.session.start(configuring(TRACES), bench.now)
    states = set()
    while not configured.done:
        states.add(bench.session.state)
        bench.step()
    assert states == {Connection.READY}
    bench.run(homing())
    turned = bench.session.start(turning(Turn(90_000_000)), bench.now)
    while not turned.done:
        states.add(bench.session.state)
        bench.step()
    assert states == {Connection.READY, Connection.MOVING}
    assert bench.session.state is Connection.READY


def test_turning_and_scanning_home_first() -> None:
    bench = Bench().connect()
    assert bench.run(turning(Turn(1_000_000))).result is Outcome.DONE
    other = Bench(seed=9).connect()
    assert_complete([*other.run(scanning(ORDER)).readings])


def test_a_refused_request_is_an_error_and_the_next_one_is_served() -> None:
    bench = Bench().connect()
    refused = bench.run(turning(Turn(800_000_000)))
    assert isinstance(refused.error, CommandRefused)
    assert bench.run(turning(Turn(80_000_000))).result is Outcome.DONE


def test_a_jammed_turntable_is_a_fault_and_not_a_lost_link() -> None:
    bench = Bench().connect()
    bench.board.wedge(5.0)
    home = bench.run(homing())
    assert isinstance(home.error, DeviceError)
    assert "zero mark" in str(home.error)
    assert bench.session.statistics.losses == 0


def test_a_turntable_jammed_after_a_reset_is_a_fault_and_the_session_continues() -> None:
    bench = Bench().connect()
    scan = bench.scan(ORDER)
    bench.until(lambda: len(scan.readings) == 5)
    bench.reset()
    bench.board.wedge(8.0)
    reset = bench.now
    bench.until(lambda: scan.done)
    assert isinstance(scan.error, DeviceError)
    assert "zero mark" in str(scan.error)
    assert bench.now - reset < 5.0
    assert bench.session.state is Connection.READY
    bench.until(lambda: bench.now > reset + 9.0)
    assert_complete([*bench.run(scanning(ORDER)).readings])


def test_homing_without_an_end_is_stopped_with_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench().connect()
    monkeypatch.setattr(bench.board._turntable, "home", lambda now: now + 1e6)
    home = bench.session.start(homing(), bench.now)
    bench.until(lambda: home.done, within=MOVE_WITHIN + 5)
    assert isinstance(home.error, DeviceError)
    assert "check that the turntable can move freely" in str(home.error)
    assert not bench.board.busy


def test_a_recorder_that_fails_ends_its_job_and_stops_the_board() -> None:
    class FullDisk:
        def frame(self, received: bool, time: float, wire: bytes) -> None:
            pass

        def reading(self, reading: Reading) -> None:
            raise LogError("no space left")

    bench = Bench().connect()
    bench.session.recording.use(FullDisk())
    scan = bench.scan(ORDER)
    bench.until(lambda: scan.done)
    assert isinstance(scan.error, LogError)
    bench.until(lambda: not bench.board.busy)
    assert_complete([*bench.run(scanning(ORDER)).readings])


def test_a_recorder_receives_nothing_between_jobs() -> None:
    class Counting:
        def __init__(self) -> None:
            self.frames = 0

        def frame(self, received: bool, time: float, wire: bytes) -> None:
            self.frames += 1

        def reading(self, reading: Reading) -> None:
            pass

    bench, recorder = Bench().connect(), Counting()
    bench.session.recording.use(recorder)
    assert recorder.frames == 3  # the greeting
    bench.run(homing())
    count, now = recorder.frames, bench.now
    assert count > 5
    bench.until(lambda: bench.now > now + 5)
    assert recorder.frames == count


def test_a_missing_scanner_and_another_major_version_are_reported_at_once() -> None:
    silent = Bench()
    silent.up = lambda data: b""
    assert isinstance(silent.connect().session.failed, NoAnswer)
    newer = Bench(BoardIdentity(major=2, minor=0)).connect()
    assert isinstance(newer.session.failed, Incompatible)
    assert newer.session.state is Connection.DISCONNECTED
