"""The promises of `sonarhw.Scanner` to its user, over every line and with every scanner."""

import math
import threading
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from sonarhw.host.scanner import Scanner
from sonarhw.link import Link
from sonarhw.log import LogWriter, read_log
from sonarhw.readings import ScanOrder, pings_in_place, sector
from sonarhw.wire.messages import Outcome, StartScan
from tests.contract.talk import Talk
from tests.fixtures.example_logs import METADATA
from tests.fixtures.plain_echoes import assert_scanned

ORDER = ScanOrder(start=0.0, step=math.radians(2), headings=8, sweeps=2)
LONG = ScanOrder(start=0.0, step=math.radians(1), headings=90, sweeps=400)  # always stopped early
MICROSTEP = math.radians(0.2)
WIRE = StartScan(start=0, step=1_000_000, headings=90, sweeps=4, pings=1)


# other echo sources have other echoes
assert_complete = partial(assert_scanned, angle=MICROSTEP, echoes=0)


def test_a_scan_gives_every_reading_once_in_time_order(free_url: str, tmp_path: Path) -> None:
    """Also the next one, and the log contains both."""
    path, scans = tmp_path / "scan.mcap", []
    with Scanner.open(free_url) as scanner, LogWriter(path, METADATA) as log:
        scanner.record(log)
        traces = bool(scanner.info.trace_rate)
        scanner.configure(listen=0.01, trace=traces)
        for order in (ORDER, replace(ORDER, sweeps=1)):
            readings = list(scanner.scan(order))
            assert_complete(readings, order)
            times = [reading.time for reading in sorted(readings, key=lambda reading: reading.number)]
            assert times == sorted(times)
            if not scanner.statistics.losses:  # after a loss, traces are not sent again
                assert all((reading.trace is not None) == traces for reading in readings)
            scans.append([(r.number, r.angle, r.echo_times) for r in readings])
    recorded = read_log(path)
    assert recorded.torn is None
    assert [[(r.number, r.angle, r.echo_times) for r in scan.readings] for scan in recorded.scans] == scans


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
        for turns in (-1, 1):
            order = sector(360 * turns - 8, 360 * turns + 9, 8)
            assert_complete(list(scanner.scan(order)), order)
        assert scanner.device_statistics().lost_steps == before


def test_pings_in_place_and_a_scan_from_a_zero_set_by_hand_do_not_home(free_url: str) -> None:
    with Scanner.open(free_url) as scanner:
        scanner.turn(math.radians(10))
        in_place = list(scanner.scan(pings_in_place(3)))
        assert [reading.angle for reading in in_place] == pytest.approx([math.radians(10)] * 3, abs=MICROSTEP)
        assert [reading.sweep for reading in in_place] == [0, 1, 2]
        assert scanner.home(here=True) is Outcome.DONE
        first, *others = scanner.scan(sector(0, 30, 10))
        assert first.angle == 0
        assert first.echo_times[0] == pytest.approx(in_place[0].echo_times[0], abs=20e-6)
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
