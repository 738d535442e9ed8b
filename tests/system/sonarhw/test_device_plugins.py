"""A package that is installed beside this one adds devices to every command, by its entry points."""

import errno
import importlib
import json
import math
import os
import random
import subprocess
import sys
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from sonarhw_compare.scanner_url import open_scanner

from sonarhw.errors import DeviceError, InputError, LinkLost
from sonarhw.host.scanner import Scanner
from sonarhw.log import LogWriter, read_log
from sonarhw.plugins import device_plugin, plugin_device
from sonarhw.plugins.device_plugin import CheckedPlugin, DeviceIdentity, DevicePlugin, Measurement
from sonarhw.plugins.plugin_device import PluginLink
from sonarhw.readings import Reading, ScanOrder, sector
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import NO_TEMPERATURE, Finished, Info, Message, Outcome, ReadingMessage, Settings, Started
from tests.checkout import CHECKOUT
from tests.fixtures import commands
from tests.fixtures.example_logs import METADATA
from tests.fixtures.text_devices.mcap_bytes import received_bytes
from tests.hang_guard import HANG, wait_until

EXAMPLE = CHECKOUT / "tests" / "fixtures" / "example_plugin"


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """Return a folder of packages with the example, with the metadata that pip would write."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    folder = tmp_path / "packages"
    metadata = folder / f"sonarhw_rangebox-{project['version']}.dist-info"
    metadata.mkdir(parents=True)
    about = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (metadata / "METADATA").write_text(about)
    points = "".join(f"{name} = {value}\n" for name, value in project["entry-points"][device_plugin.GROUP].items())
    (metadata / "entry_points.txt").write_text(f"[{device_plugin.GROUP}]\n{points}")
    (folder / "rangebox.py").write_text((EXAMPLE / "rangebox.py").read_text(encoding="utf-8"), encoding="utf-8")
    return folder


Command = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def sonarhw(installed: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Command]:
    """Return a function that runs a command where the example is installed."""
    monkeypatch.syspath_prepend(installed)

    def command(*words: str) -> subprocess.CompletedProcess[str]:
        forget_packages()
        return commands.sonarhw(*words)

    yield command
    forget_packages()


def forget_packages() -> None:
    """Look for installed packages again, as a new process does."""
    device_plugin.installed_plugins.cache_clear()
    sys.modules.pop("rangebox", None)


def test_a_device_that_turns_by_itself_is_scanned(sonarhw: Command, tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    done = sonarhw("scan", "rangebox:2.5", "--out", str(log), "--sweeps", "2")
    assert done.returncode == 1
    assert "60 of 60 echoes over 172° are at 2.500 m; check that the table turns" in done.stderr
    assert done.stderr.endswith(f"; 60 readings are kept in {log}\n")
    recorded = read_log(log)
    assert {round(reading.range or 0, 6) for reading in recorded.readings} == {2.5}
    assert recorded.metadata.board == "hc-sr04"
    assert (recorded.info.firmware, recorded.info.serial) == ("Range box", "7")
    assert b";31;32;" in received_bytes(log)


def test_a_device_that_takes_orders_measures_at_the_chosen_angles(sonarhw: Command, tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    options = ("--from", "-20", "--to", "20", "--step", "10", "--pings", "2")
    done = sonarhw("scan", "turret:1", "--out", str(log), *options)
    assert done.returncode == 0, done.stderr
    readings = read_log(log).readings
    assert [(round(r.angle * 57.29578), r.ping) for r in readings] == [
        (angle, ping) for angle in (-20, -10, 0, 10) for ping in (0, 1)
    ]
    assert all(len(reading.echo_times) == 2 for reading in readings)


def test_it_identifies_itself(sonarhw: Command) -> None:
    done = sonarhw("info", "--json", "rangebox:2.5")
    found = json.loads(done.stdout)
    keys = ("firmware", "serial", "protocol", "origin")
    assert [found[key] for key in keys] == ["Range box", "7", None, "measured"]


def test_its_own_errors_are_one_line(sonarhw: Command, tmp_path: Path) -> None:
    done = sonarhw("scan", "rangebox:far", "--out", str(tmp_path / "x.mcap"))
    assert (done.returncode, done.stderr) == (2, "sonarhw: rangebox:far: expected rangebox:METRES\n")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("missing_package:Device", "cannot be loaded: ModuleNotFoundError: No module named"),
        ("exits:Device", "cannot be loaded: SystemExit: 3; install it again"),
        ("json:Device", "cannot be loaded"),
        ("json:loads", "is not a subclass of sonarhw.DevicePlugin"),
    ],
)
def test_a_broken_plugin_is_one_line(value: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "exits.py").write_text("import sys; sys.exit(3)")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(
        device_plugin, "installed_plugins", lambda: {"broken": (EntryPoint("broken", value, device_plugin.GROUP),)}
    )
    with pytest.raises(InputError, match=f"the plug-in {value} {message}"):
        device_plugin.make_plugin("broken:1")


@pytest.mark.parametrize("scheme", ["fake", "rangebox"])
def test_a_scheme_that_two_packages_claim_is_refused_with_both(scheme: str, sonarhw: Command, tmp_path: Path) -> None:
    second = tmp_path / "packages" / "thief-2.0.dist-info"
    second.mkdir()
    (second / "METADATA").write_text("Metadata-Version: 2.1\nName: thief\nVersion: 2.0\n")
    (second / "entry_points.txt").write_text(f"[{device_plugin.GROUP}]\n{scheme} = json:loads\n")
    done = sonarhw("info", f"{scheme}://simple?place=figure9")
    owner = {"rangebox": "rangebox:RangeBox of the package"}
    assert done.returncode == 2
    assert owner.get(scheme, "sonarhw itself") in done.stderr
    assert "json:loads of the package thief 2.0" in done.stderr


class Defective(DevicePlugin):
    """A plug-in with a defect, which is the fragment of its URL."""

    identity = DeviceIdentity("defective")

    def open(self) -> None:
        if self.url.endswith("open"):
            raise KeyError("port")

    def read(self) -> list[Measurement]:
        if self.url.endswith("read"):
            raise ZeroDivisionError
        if self.url.endswith("exit"):
            sys.exit(3)
        if self.url.endswith("text"):
            return ["90,23"]  # type: ignore[list-item]  # a defect
        if self.url.endswith("hot"):
            return [Measurement(0.0, (1.0,), temperature_c=400.0)]
        return [Measurement(math.nan, (1.0,))]

    def close(self) -> None:
        """Do nothing."""


def open_device(plugin: DevicePlugin) -> Scanner:
    return Scanner.open(plugin.url, plugin=PluginLink(CheckedPlugin(plugin)))


@pytest.fixture
def range_box(monkeypatch: pytest.MonkeyPatch) -> Iterator[Scanner]:
    """A scanner with the device of the example."""
    monkeypatch.syspath_prepend(EXAMPLE)
    with open_device(importlib.import_module("rangebox").RangeBox("rangebox:2.5")) as scanner:
        yield scanner


def test_a_scan_refuses_other_actions(range_box: Scanner) -> None:
    scan = range_box.scan()
    next(scan)
    for action in (range_box.home, range_box.configure, range_box.scan().__next__):
        with pytest.raises(DeviceError, match="is busy"):
            action()
    assert len([*scan]) == 29
    with range_box.sequence():
        assert range_box.home() is Outcome.DONE
        scan = range_box.scan()
        next(scan)
        with pytest.raises(DeviceError, match="is busy"):
            range_box.home()


class FullDisk:
    """A recorder on a disk with room for some frames."""

    def __init__(self, room: float) -> None:
        self.room = room

    def frame(self, from_device: bool, time: float, wire: bytes) -> None:
        """Store a frame. Raises OSError if the disk is full."""
        self.room -= 1
        if self.room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")

    def reading(self, reading: Reading) -> None:
        """Store a reading."""


def scan_once(scanner: Scanner) -> None:
    """Wait for a sweep and scan it."""
    with scanner.sequence():
        scanner.home()
        list(scanner.scan())


def begin_only(scanner: Scanner) -> None:
    """Wait for a sweep. The end of the block ends the scan, which the recorder stores."""
    with scanner.sequence():
        scanner.home()


@pytest.mark.parametrize(("use", "room"), [(scan_once, 0), (scan_once, 1), (scan_once, 4), (begin_only, 1)])
def test_a_full_disk_frees_the_scanner(range_box: Scanner, use: Callable[[Scanner], None], room: int) -> None:
    range_box.record(disk := FullDisk(math.inf))
    disk.room = room
    with pytest.raises(OSError, match="No space"):
        use(range_box)
    range_box.record(None)
    with ThreadPoolExecutor(1) as other_thread:
        assert other_thread.submit(lambda: len([*range_box.scan()])).result() == 30


@pytest.mark.parametrize(
    ("where", "message"), [("open", "KeyError: 'port'"), ("read", "ZeroDivisionError: "), ("exit", "SystemExit: 3")]
)
def test_a_defect_of_a_plugin_is_one_line(where: str, message: str) -> None:
    origin = f"{__name__}:Defective"
    with pytest.raises(DeviceError, match=f"defective:{where}: the plug-in {origin} has a defect: {message}") as raised:
        open_device(Defective(f"defective:{where}"))
    assert type(raised.value.__cause__).__name__ == message.partition(":")[0]


class Starter(DevicePlugin):
    """A device that starts a process of its own, and leaves it behind."""

    identity = DeviceIdentity("starter")

    def open(self) -> None:
        """Start a process that never ends, and write its number to the file of the URL."""
        process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1e6)"])
        Path(self.url.partition(":")[2]).write_text(str(process.pid))

    def read(self) -> list[Measurement]:
        """Return a measurement."""
        time.sleep(0.001)
        return [Measurement(0.0, (1.0,))]

    def close(self) -> None:
        """Leave the process behind."""


def test_what_a_plugin_has_started_ends_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(device_plugin, "_END_WITHIN", HANG)  # the plug-in itself ends without a signal
    entry = EntryPoint("starter", f"{__name__}:Starter", device_plugin.GROUP)
    monkeypatch.setattr(device_plugin, "installed_plugins", lambda: {"starter": (entry,)})
    with open_scanner(f"starter:{tmp_path / 'started'}"):
        started = int((tmp_path / "started").read_text())
        os.kill(started, 0)
    wait_until(lambda: _has_ended(started))


def _has_ended(process: int) -> bool:
    state = subprocess.run(["ps", "-o", "state=", "-p", str(process)], capture_output=True, text=True, check=False)
    return state.stdout.strip() in ("", "Z")  # a zombie waits for whoever adopted it


_TEMPERATURE = "measurements with a temperature outside -100 to 327 °C, or not finite"


class Spoiled(DevicePlugin):
    """A device that swings over 10°, with a bad item after each good measurement."""

    identity = DeviceIdentity("spoiled")

    def __init__(self, bad: object) -> None:
        super().__init__("spoiled:")
        self._bad, self._count = bad, 0

    def open(self) -> None:
        """Do nothing."""

    def read(self) -> list[Measurement]:
        time.sleep(0.001)
        self._count += 1
        return [Measurement(math.radians(abs(self._count % 20 - 10)), (1.0,)), self._bad]  # type: ignore[list-item]  # a defect

    def close(self) -> None:
        """Do nothing."""


@pytest.mark.parametrize(
    ("bad", "kind"),
    [
        ("90,23", "objects of the type str instead of Measurement"),
        (None, "objects of the type NoneType instead of Measurement"),
        (Measurement(0.0, (1.0,), temperature_c=400.0), _TEMPERATURE),
        (Measurement(0.0, (1.0,), temperature_c=-300.0), _TEMPERATURE),
        (Measurement(math.nan, (1.0,)), "measurements with an angle beyond 2147 degrees, or not finite"),
        (Measurement(0.0, (math.inf,)), "measurements with a range that is not finite"),
        (Measurement(0.0, (1.0,), time=math.nan), "measurements with an impossible time"),
        (Measurement("90", (1.0,)), "measurements with something else than numbers"),  # type: ignore[arg-type]
        (Measurement(0.0, 1.0), "measurements with something else than numbers"),  # type: ignore[arg-type]
    ],
)
def test_a_bad_measurement_is_skipped_and_counted_by_its_kind(bad: object, kind: str) -> None:
    plugin = CheckedPlugin(Spoiled(bad))
    assert [len(plugin.read()[1]) for _ in range(5)] == [1] * 5
    assert plugin.ignored == {kind: 5}
    assert f"returns {kind} (5)" in str(plugin.no_reading("within 1 s"))


def test_a_device_that_falls_silent_ends_its_scan(monkeypatch: pytest.MonkeyPatch) -> None:
    class Silent(Spoiled):
        def read(self) -> list[Measurement]:
            return super().read()[:1] if self._count < 100 else []

    monkeypatch.setattr(plugin_device, "SILENCE", 0.2)
    with open_device(Silent(None)) as scanner, pytest.raises(DeviceError, match=r"no reading for 0\.2 s"):
        list(scanner.scan(ScanOrder(0.0, 1.0, 1, 1000)))


class Played(Spoiled):
    """A device that measures 1 m, 100 readings at once, and 2 m after its first `end`. It rests until `begin`."""

    def __init__(self) -> None:
        super().__init__(None)
        self._range, self._rests = 1.0, False

    def read(self) -> list[Measurement]:
        good = [] if self._rests else [super(Played, self).read()[0] for _ in range(100)]
        return [replace(item, ranges=(self._range + k % 7 / 10,)) for k, item in enumerate(good)]

    def begin(self, order: ScanOrder) -> bool:
        self._rests = False
        return True

    def end(self) -> None:
        self._range, self._rests = 2.0, True


def test_a_scan_has_no_measurements_from_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugin_device, "FRESH", 0.0)
    with open_device(Played()) as scanner:
        scans = [[reading.range or 0 for reading in scanner.scan()] for _ in range(2)]
    assert max(scans[0]) < 1.9 < min(scans[1])


@pytest.mark.parametrize(
    ("degrees", "message"),
    [
        ([30] * 100, r"the angle was 30° in \d+ readings.*servo turns"),
        ([*range(0, 180, 5)], "the angles jump at random"),
    ],
)
def test_a_scan_of_a_table_that_does_not_sweep_fails(degrees: list[int], message: str) -> None:
    class Lost(Spoiled):
        def read(self) -> list[Measurement]:
            time.sleep(0.001)
            self._count += 1
            angle = math.radians(random.Random(self._count).choice(degrees))
            return [Measurement(angle, (1.0 + self._count % 9,), time=time.time() + 0.5 * self._count)]

    with open_device(Lost(None)) as scanner, pytest.raises(DeviceError, match=message):
        list(scanner.scan())


def test_a_scan_keeps_its_good_measurements() -> None:
    plugin = Spoiled(Measurement(math.nan, (1.0,)))
    with Scanner.open(plugin.url, plugin=PluginLink(CheckedPlugin(plugin))) as scanner:
        readings = list(scanner.scan(sector()))
        assert len(readings) == 10
        assert any("an angle beyond" in kind for kind in scanner.ignored)


@pytest.mark.parametrize(
    ("defect", "message"),
    [
        ("1 // (self._count < 200)", "has a defect: ZeroDivisionError: integer division or modulo by zero; report it"),
        ("1 if self._count < 200 else __import__('os').abort()", "ended its process during 'read'"),
    ],
)
def test_a_failure_keeps_readings(defect: str, message: str, sonarhw: Command, installed: Path, tmp_path: Path) -> None:
    code = (installed / "rangebox.py").read_text()
    (installed / "rangebox.py").write_text(code.replace("self._count += 1", f"self._count += {defect}"))
    log = tmp_path / "scan.mcap"
    done = sonarhw("scan", "rangebox:2.5", "--out", str(log), "--sweeps", "20")
    kept = len(read_log(log).readings)
    assert (done.returncode, kept > 50) == (1, True)
    assert f"the plug-in rangebox:RangeBox of the package sonarhw-rangebox 1.0 {message}" in done.stderr
    assert f"; {kept} readings are kept" in done.stderr


class Unsteady(DevicePlugin):
    """A plug-in that takes orders, and loses its link once."""

    takes_orders = True
    identity = DeviceIdentity("unsteady")

    def __init__(self) -> None:
        super().__init__("unsteady:")
        self.orders: list[ScanOrder] = []
        self.calls: list[str] = []
        self._made = 0

    def open(self) -> None:
        self.calls.append("open")

    def read(self) -> list[Measurement]:
        time.sleep(0.001)
        if not self.orders or self._made == self.orders[-1].readings:
            return [Measurement(0.0, ())]
        if self._made == 3 and self.calls.count("open") == 1:
            raise LinkLost("unsteady: unplugged")
        _, angle, _ = self.orders[-1].ping_at(self._made)
        self._made += 1
        return [Measurement(angle, (1.0,))]

    def close(self) -> None:
        self.calls.append("close")

    def begin(self, order: ScanOrder) -> bool:
        self.orders.append(order)
        return False

    def end(self) -> None:
        self.calls.append("end")


def test_after_a_loss_a_scan_by_orders_continues_with_the_next_reading() -> None:
    plugin, order = Unsteady(), sector(0, 60, 10)
    with open_device(plugin) as scanner:
        readings = list(scanner.scan(order))
        assert (scanner.statistics.losses, scanner.statistics.reopened) == (1, 1)
        assert (scanner.loss, len(plugin.orders)) == (None, 1)
    assert [reading.number for reading in readings] == [*range(6)]
    assert [reading.angle for reading in readings] == pytest.approx([order.ping_at(k)[1] for k in range(6)])
    assert plugin.calls == ["open", "close", "open", "end", "close"]


class Blocked(Unsteady):
    """A plug-in whose `read` does not return any more."""

    def __init__(self) -> None:
        super().__init__()
        self.released = threading.Event()

    def read(self) -> list[Measurement]:
        if self.orders:
            self.released.wait(HANG)
        return super().read()


def test_a_plugin_that_blocks_does_not_prevent_stop_and_close(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugin_device, "END_WITHIN", 0.1)
    plugin = Blocked()
    with open_device(plugin) as scanner:
        threading.Timer(0.2, scanner.stop).start()
        assert list(scanner.scan()) == []
    assert not plugin.released.is_set()
    plugin.released.set()


def test_a_log_of_a_plugin_without_frames_from_the_host_is_read(tmp_path: Path) -> None:
    # as sonarhw wrote logs of plug-ins before they were devices
    messages: list[Message] = [
        Info(0, 1, 2, "Range box", "7", "hc-sr04", NO_TEMPERATURE, 0, 0),
        Settings(0, 62_500, 0, 0, 343_000),
        Started(1, 0),
        *(ReadingMessage(k, k // 2, 0, k * 1_000_000, k + 100, NO_TEMPERATURE, (5_000_000,)) for k in range(4)),
        Started(1, 4),
        Finished(1, Outcome.DONE, 4, ""),
    ]
    with LogWriter(tmp_path / "old.mcap", METADATA) as log:
        for k, message in enumerate(messages):
            log.received_bytes(k, b"%d;" % k)
            log.frame(True, k, encode_frame(Frame(message.TYPE, k, k, message.pack())))
    (scan,) = read_log(tmp_path / "old.mcap").scans
    assert (scan.expected, [reading.number for reading in scan.readings]) == (4, [0, 1, 2, 3])
    assert [reading.sweep for reading in scan.readings] == [0, 0, 1, 1]


def test_text_devices_are_a_plugin_of_this_project() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"][device_plugin.GROUP] == {"lines": "sonarhw.text_device:TextDevice"}
    assert device_plugin.is_plugin("lines:/dev/ttyUSB0")
