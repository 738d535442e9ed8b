"""The promises of `sonarhw.Scanner` to its user, over every line and with every scanner."""

import math
import threading
from dataclasses import replace
from pathlib import Path

import pytest

from sonarhw.host.scanner import Scanner
from sonarhw.link import Link
from sonarhw.log import LogWriter, read_log
from sonarhw.readings import Reading, ScanOrder, pings_in_place, sector
from sonarhw.wire.messages import Outcome, StartScan
from tests.contract.talk import Talk
from tests.fixtures.example_logs import METADATA
from tests.hang_guard import HANG

ORDER = ScanOrder(start=0.0, step=math.radians(2), headings=8, sweeps=2)
LONG = ScanOrder(start=0.0, step=math.radians(1), headings=90, sweeps=400)  # always stopped early
MICROSTEP = math.radians(0.2)
WIRE = StartScan(start=0, step=1_000_000, headings=90, sweeps=4, pings=1)


def assert_complete(readings: list[Reading], order: ScanOrder) -> None:
    """Assert that every reading of the scan is present once, at its angle."""
    assert sorted(reading.number for reading in readings) == list(range(order.readings))
    for reading in readings:
        sweep, angle, ping = order.ping_at(reading.number)
        assert (reading.sweep, reading.ping) == (sweep, ping)
        assert reading.angle == pytest.approx(angle, abs=MICROSTEP)


class InterruptedRecorder:
    """A recorder with a lock, as that of a log, and with a signal handler that stops the scanner at the first frame."""

    def __init__(self, scanner: Scanner) -> None:
        self._scanner = scanner
        self._lock = threading.RLock()
        self.frames = 0

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        with self._lock:
            self.frames += 1
            if self.frames == 1:
                self._scanner.stop()

    def reading(self, reading: Reading) -> None:
        """Do nothing."""


@pytest.mark.one_line
def test_a_stop_by_a_signal_handler_while_a_recording_begins_does_not_block(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        recorder = InterruptedRecorder(scanner)
        recording = threading.Thread(target=scanner.record, args=(recorder,), daemon=True)
        recording.start()
        recording.join(HANG)
        assert not recording.is_alive()
        assert recorder.frames == 3  # Hello, Info, Capabilities
        scanner.record(None)
        assert scanner.turn(0.1) is Outcome.DONE


def test_a_scan_gives_every_reading_once_in_time_order(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        readings = list(scanner.scan(ORDER))
    assert_complete(readings, ORDER)
    times = [reading.time for reading in sorted(readings, key=lambda reading: reading.number)]
    assert times == sorted(times)


def test_two_successive_scans_are_both_complete(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        scanner.configure(listen=0.01, trace=bool(scanner.info.trace_rate))
        for _ in range(2):
            readings = list(scanner.scan(ORDER))
            assert_complete(readings, ORDER)
            if scanner.info.trace_rate and not scanner.statistics.losses:  # after a loss, traces are not sent again
                assert all(reading.trace is not None for reading in readings)


def test_after_an_abandoned_scan_the_next_scan_is_complete(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        for reading in scanner.scan(LONG):
            if reading.number == 3:
                break
        assert scanner.turn(0.1) is Outcome.DONE
        assert_complete(list(scanner.scan(ORDER)), ORDER)


def test_a_scan_anywhere_ends_at_a_zero_mark_in_the_expected_place(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        before = scanner.device_statistics().lost_steps
        for turns in (-1, 0, 1):
            order = replace(sector(360 * turns - 8, 360 * turns + 9, 8), sweeps=2)
            assert_complete(list(scanner.scan(order)), order)
        assert scanner.device_statistics().lost_steps == before


def test_pings_in_place_leave_the_turntable_as_it_is(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        scanner.turn(0.1)
        readings = list(scanner.scan(pings_in_place(3)))
        assert [reading.angle for reading in readings] == pytest.approx([0.1] * 3, abs=MICROSTEP)
        assert [reading.sweep for reading in readings] == [0, 1, 2]


def test_a_scan_from_a_zero_set_by_hand_does_not_home(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        scanner.turn(math.radians(10))
        (at_ten,) = scanner.scan(pings_in_place(1))
        assert scanner.home(here=True) is Outcome.DONE
        first, *others = scanner.scan(sector(0, 30, 10))
        assert first.angle == 0
        assert first.echo_times[0] == pytest.approx(at_ten.echo_times[0], abs=20e-6)
        assert len(others) == 2


def test_stop_from_another_thread_ends_a_scan_and_keeps_its_readings(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        readings, stopper = [], threading.Thread(target=scanner.stop)
        for reading in scanner.scan(LONG):
            readings.append(reading)
            if reading.number == 3:
                stopper.start()
        stopper.join()
    assert 4 <= len(readings) < LONG.readings
    assert sorted(reading.number for reading in readings) == list(range(len(readings)))


def test_a_host_that_vanishes_during_a_scan_does_not_disturb_the_next_host(free_url: str) -> None:
    with Link(free_url) as link:
        talk = Talk(link)
        talk.greet()
        talk.home()
        talk.send(WIRE)
        talk.until(lambda messages: len(messages) > 10)
    with Scanner.open(free_url) as scanner:
        assert_complete(list(scanner.scan(ORDER)), ORDER)


def test_the_log_contains_the_delivered_readings(free_url: str, tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    with Scanner.open(free_url) as scanner, LogWriter(path, METADATA) as log:
        scanner.record(log)
        readings = list(scanner.scan(ORDER))
    recorded = read_log(path)
    assert recorded.torn is None
    assert [(r.number, r.angle, r.echo_times) for r in recorded.readings] == [
        (r.number, r.angle, r.echo_times) for r in readings
    ]
