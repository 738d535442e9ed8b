"""Devices that print text keep every promise of a scanner, over a pseudo-terminal; their text in a file, too."""

import math
import random
import threading
from collections.abc import Callable, Iterable, Iterator
from itertools import islice, pairwise
from pathlib import Path

import pytest
from sonarhw_compare.imports import ImportOptions, import_scan

import sonarhw
from sonarhw.errors import DeviceError, InputError, LinkLost, NoAnswer
from sonarhw.host.scanner import Scanner
from sonarhw.log import LogWriter, copy_log, read_log
from sonarhw.plugins import plugin_device
from sonarhw.plugins.device_plugin import CheckedPlugin
from sonarhw.plugins.plugin_device import PluginLink
from sonarhw.readings import Origin, Reading, ScanOrder
from sonarhw.text_device import TextDevice, read_lines_url
from tests.fixtures.example_logs import METADATA
from tests.fixtures.text_devices.mcap_bytes import received_bytes
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice, Sketch, wall
from tests.fixtures.text_devices.received_clock import ReceivedClock
from tests.hang_guard import HANG

RADAR = SKETCHES["radar 15 to 165"]
END = b"\r\n.\n"  # of a line, for all sketches
PATIENCE = 60.0  # s; no test depends on it


def open_device(port: str, query: str = RADAR.query, patience: float = PATIENCE) -> Scanner:
    return sonarhw.open_scanner(f"lines:{port}?{query}", patience=patience)


@pytest.fixture(params=SKETCHES)
def sketch(request: pytest.FixtureRequest) -> Sketch:
    return SKETCHES[request.param]


def sweeps(count: int) -> ScanOrder:
    return ScanOrder(0.0, 1.0, 1, sweeps=count)


def degrees(reading: Reading) -> int:
    return round(math.degrees(reading.angle))


def assert_true(readings: list[Reading]) -> None:
    """Assert that each reading is the distance of the wall at its angle."""
    for reading in readings:
        true = wall(degrees(reading))
        assert reading.range == (None if true is None else pytest.approx(true / 100, abs=1e-6))
        assert degrees(reading) == pytest.approx(math.degrees(reading.angle), abs=1e-5)


def assert_sweeps(sketch: Sketch, readings: list[Reading], count: int) -> None:
    """Assert that so many sweeps are whole, each angle once, and numbered in order of time."""
    assert_true(readings)
    assert [reading.number for reading in readings] == list(range(len(readings)))
    for sweep in range(count):
        angles = [degrees(reading) for reading in readings if reading.sweep == sweep]
        assert len(angles) == len(set(angles))
        # the radar of 15 to 165 prints one of its ends only once in a round
        assert sketch.sweep - set(angles) <= {15}
    assert {reading.sweep for reading in readings} == {*range(count)}
    times = [reading.time for reading in readings]
    assert times == sorted(set(times))


def test_the_log_of_successive_scans_has_their_whole_sweeps_and_the_bytes(sketch: Sketch, tmp_path: Path) -> None:
    path, device = tmp_path / "scan.mcap", PrintingDevice(sketch.rounds())
    with device, open_device(device.port, sketch.query) as scanner, LogWriter(path, METADATA) as log:
        scanner.record(log)
        scans = [list(scanner.scan(sweeps(count))) for count in (3, 1)]
        scanner.record(None)
    recorded, raw = read_log(path), received_bytes(path)
    copy_log(recorded, tmp_path / "copy.mcap")
    for log in (recorded, read_log(tmp_path / "copy.mcap")):
        assert log.torn is None
        assert_sweeps(sketch, scans[0], 3)
        assert sketch.sweep - {degrees(reading) for reading in scans[1]} <= {15}
        for scan, readings in zip(log.scans, scans, strict=True):
            assert_true(readings)
            assert all(reading.origin is Origin.MEASURED for reading in readings)
            assert scan.expected == len(readings)
            assert [(r.number, r.sweep, r.angle, r.echo_times, r.time) for r in scan.readings] == [
                (r.number, r.sweep, r.angle, r.echo_times, r.time) for r in readings
            ]
        assert b"".join(data for _, data in log.frames.received_bytes()) == raw
    assert raw in bytes(device.written)
    assert sketch.line(sketch.angles[-1]).encode() in raw


def test_a_file_of_the_same_text_has_the_same_sweeps(sketch: Sketch, tmp_path: Path) -> None:
    path, url = tmp_path / "capture.txt", read_lines_url(f"lines:port?{sketch.query}")
    path.write_bytes(b"".join(islice(sketch.rounds(), 3 * len(sketch.angles))))
    zero, one = url.turntable_angle(0), url.turntable_angle(1)
    turn = "ccw" if one > zero else "cw"
    layout = url.layout
    stated = ImportOptions(
        preset=layout.preset,
        pattern=layout.pattern,
        unit=layout.unit or "",
        angle=layout.angle or "",
        step=layout.step,
        no_echo=layout.no_echo[0] if layout.no_echo else None,
        turn=turn,
        heading_zero=math.degrees(zero),
    )
    readings = import_scan(path, stated).readings
    assert_true(readings)
    angles = [degrees(reading) for reading in readings if reading.sweep == 0]
    assert sketch.sweep - set(angles) <= {15}


def damaged(sketch: Sketch, rng: random.Random) -> Iterator[bytes]:
    """Print with banners, halves of lines and bytes of a wrong baud rate between the lines."""
    for line in sketch.rounds():
        match rng.randrange(40):
            case 0:
                yield b"\r\nBrownout, restarting\r\n"
            case 1:
                yield line[: len(line) // 2].rstrip(b"0123456789") + rng.choice((b"\r\n", b"!."))
            case 2:
                yield (
                    bytes(rng.choice((0x80, 0xFE, 0xF8, 0x1E, 0x86)) for _ in range(rng.randrange(1, 40))) + b"\r\n.\n"
                )
            case 3:
                yield b"x" * 900 + END
        yield line


def test_damage_is_counted_and_never_taken_for_a_reading(sketch: Sketch) -> None:
    pieces = damaged(sketch, random.Random(4))
    with PrintingDevice(pieces) as device, open_device(device.port, sketch.query) as scanner:
        readings = list(scanner.scan(sweeps(4)))
        ignored = scanner.ignored
        assert scanner.statistics.rejected_blocks >= 10
    assert_true(readings)
    assert ignored["noise"] >= 3
    assert ignored["lines of other text"] >= 3
    assert ignored["half lines"] >= 1


@pytest.mark.parametrize(
    ("pieces", "query", "message"),
    [
        (
            lambda: (random.Random(k).randbytes(30).replace(b",", b"\xff") for k in range(10**9)),
            RADAR.query,
            r"mostly not text; the baud rate may not be 9600",
        ),
        (SKETCHES["Angle and Distance in words"].rounds, "preset=maxbotix&step=5", r"such as 'Angle: .* expected 'R0"),
        (list, RADAR.query, "nothing was received; check the cable"),
    ],
    ids=["wrong baud rate", "another format", "silent"],
)
def test_a_device_without_readings_is_reported_with_the_reason(
    pieces: Callable[[], Iterable[bytes]], query: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = pieces is list
    if not silent:
        monkeypatch.setattr(plugin_device, "time", ReceivedClock(monkeypatch, 500))
    with PrintingDevice(pieces()) as device, pytest.raises(NoAnswer, match=message):
        open_device(device.port, query, patience=0.2 if silent else PATIENCE)


@pytest.fixture
def opened(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Return the event that the port is open. What was printed before is not received."""
    event, really_open = threading.Event(), TextDevice.open

    def open_it(device: TextDevice) -> None:
        really_open(device)
        event.set()

    monkeypatch.setattr(TextDevice, "open", open_it)
    monkeypatch.setattr(plugin_device, "SILENCE", 0.5)
    monkeypatch.setattr(plugin_device, "FRESH", HANG)  # the scan may begin late
    return event


def printed_once(opened: threading.Event, angles: list[int], monkeypatch: pytest.MonkeyPatch) -> Iterator[bytes]:
    text = "".join(map(RADAR.line, angles)).encode()
    monkeypatch.setattr(plugin_device, "time", ReceivedClock(monkeypatch, len(text)))  # silence begins after the text

    def pieces() -> Iterator[bytes]:
        opened.wait(HANG)
        yield text

    return pieces()


def test_a_device_that_falls_silent_fails(opened: threading.Event, monkeypatch: pytest.MonkeyPatch) -> None:
    readings: list[Reading] = []
    pieces = printed_once(opened, [*range(15, 60)], monkeypatch)
    silent = pytest.raises(NoAnswer, match=r"no reading for 0\.5 s")
    with PrintingDevice(pieces) as device, open_device(device.port) as scanner, silent:
        readings.extend(scanner.scan())  # keeps those before the error
    assert_true(readings)
    assert [degrees(reading) for reading in readings] == [*range(16, 60)]


def test_a_device_may_stop_after_a_whole_sweep(opened: threading.Event, monkeypatch: pytest.MonkeyPatch) -> None:
    angles = [*range(15, 166), *range(165, 14, -1)]
    pieces = printed_once(opened, angles, monkeypatch)
    with PrintingDevice(pieces) as device, open_device(device.port) as scanner:
        readings = list(scanner.scan())
    assert_true(readings)
    assert [degrees(reading) for reading in readings] == angles[151:]


def test_after_a_reconnection_the_scan_ends_with_a_whole_sweep(tmp_path: Path) -> None:
    link = tmp_path / "ttyUSB0"
    readings = []
    with PrintingDevice(RADAR.rounds(), link) as first:
        scanner = open_device(first.port)
        scan = scanner.scan(sweeps(2))
        readings += [next(scan) for _ in range(20)]
    with PrintingDevice(RADAR.rounds(), link), scanner:
        readings += scan
        assert scanner.statistics.losses == 1
    assert_true(readings)
    last = [degrees(reading) for reading in readings if reading.sweep == readings[-1].sweep]
    assert RADAR.sweep - set(last) <= {15}


def test_a_device_that_never_comes_back_is_lost(tmp_path: Path) -> None:
    with PrintingDevice(RADAR.rounds(), tmp_path / "ttyUSB0") as device:
        plugin = sonarhw_plugin(device.port)
        scanner = Scanner.open(plugin.url, reconnect=0.3, plugin=PluginLink(plugin))
        scan = scanner.scan(sweeps(60_000))  # more than it prints before its end
        next(scan)
    with scanner, pytest.raises(LinkLost, match=r"did not come back within 0\.3 s"):
        list(scan)


def sonarhw_plugin(port: str) -> CheckedPlugin:
    from sonarhw.plugins.device_plugin import make_plugin

    return make_plugin(f"lines:{port}?{RADAR.query}")


def test_a_rangefinder_without_an_angle_counts_steps() -> None:
    ranges = (f"R{1000 + k % 72:04}\r".encode() for k in range(10**9))
    with PrintingDevice(ranges) as device, open_device(device.port, "preset=maxbotix&step=5") as scanner:
        scanner.configure(listen=0.06)
        readings = list(scanner.scan(sweeps(2)))
    assert [degrees(reading) for reading in readings] == 2 * [*range(0, 360, 5)]
    printed = [round(1000 * reading.range) for reading in readings if reading.range]
    assert all((after - before) % 72 == 1 for before, after in pairwise(printed))


def test_a_motor_that_stands_still_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugin_device, "MOST_LEAD", 50)
    reason = r"did not turn back in 50 readings, and is 90\.0° now"
    still = (b"90,23." for _ in range(10**9))
    with PrintingDevice(still) as device, open_device(device.port) as scanner, pytest.raises(DeviceError, match=reason):
        list(scanner.scan())


def test_the_device_obeys_no_commands() -> None:
    with PrintingDevice(RADAR.rounds()) as device, open_device(device.port) as scanner:
        with pytest.raises(InputError, match="cannot be turned"):
            scanner.turn(0.1)
        assert scanner.info.board == "hc-sr04"
        assert not scanner.takes_orders
