"""What can be tested with a text device of your own: `pytest tests/contract --url 'lines:PORT?preset=NAME'`."""

import threading
from pathlib import Path

import sonarhw
from sonarhw.log import LogWriter, read_log
from sonarhw.readings import ScanOrder
from tests.fixtures.example_logs import METADATA
from tests.fixtures.text_devices.mcap_bytes import received_bytes

TWO = ScanOrder(0.0, 1.0, 1, sweeps=2)


def test_two_sweeps_are_over_the_same_angles(plugin_url: str) -> None:
    with sonarhw.open_scanner(plugin_url) as scanner:
        readings = list(scanner.scan(TWO))
    first, second = ({round(r.angle, 3) for r in readings if r.sweep == sweep} for sweep in (0, 1))
    assert len(first) >= 3
    # a device may print an end of its sweep only on the way out
    assert len(first ^ second) <= 2
    assert [reading.number for reading in readings] == list(range(len(readings)))


def test_the_log_has_the_readings_and_the_bytes(plugin_url: str, tmp_path: Path) -> None:
    path = tmp_path / "scan.mcap"
    with sonarhw.open_scanner(plugin_url) as scanner, LogWriter(path, METADATA) as log:
        scanner.record(log)
        readings = list(scanner.scan())
        scanner.record(None)
    recorded = read_log(path)
    assert recorded.torn is None
    assert [(r.angle, r.echo_times) for r in recorded.readings] == [(r.angle, r.echo_times) for r in readings]
    assert len(received_bytes(path)) >= 4 * len(readings)


def test_stop_from_another_thread_ends_a_scan(plugin_url: str) -> None:
    with sonarhw.open_scanner(plugin_url) as scanner:
        endless = scanner.scan(ScanOrder(0.0, 1.0, 1, sweeps=60_000))
        next(endless)
        stopper = threading.Thread(target=scanner.stop)
        stopper.start()
        assert len(list(endless)) < 60_000 - 1
        stopper.join()
