"""A package that is installed beside this one adds devices to every command, by its entry points."""

import errno
import importlib
import json
import math
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from sonarhw.errors import DeviceError, InputError
from sonarhw.log import read_log
from sonarhw.plugins import device_plugin
from sonarhw.plugins.device_plugin import DeviceIdentity, DevicePlugin, Measurement
from sonarhw.plugins.plugin_scanner import PluginScanner
from sonarhw.readings import Reading
from sonarhw.wire.messages import Outcome
from tests.checkout import CHECKOUT
from tests.fixtures.text_devices.mcap_bytes import received_bytes

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


def sonarhw(packages: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    path = os.pathsep.join((str(packages), os.environ.get("PYTHONPATH", "")))
    return subprocess.run(
        [sys.executable, "-m", "sonarhw", *arguments],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_device_that_turns_by_itself_is_scanned(installed: Path, tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    done = sonarhw(installed, "scan", "rangebox:2.5", "--out", str(log), "--sweeps", "2")
    assert (done.returncode, done.stderr.splitlines()[0]) == (0, f"60 readings, 60 with an echo, in {log}")
    recorded = read_log(log)
    assert {round(reading.range or 0, 6) for reading in recorded.readings} == {2.5}
    assert recorded.metadata.board == "hc-sr04"
    assert recorded.info is not None
    assert (recorded.info.firmware, recorded.info.serial) == ("Range box", "7")
    assert b";31;32;" in received_bytes(log)


def test_a_device_that_takes_orders_measures_at_the_chosen_angles(installed: Path, tmp_path: Path) -> None:
    log = tmp_path / "scan.mcap"
    options = ("--from", "-20", "--to", "20", "--step", "10", "--pings", "2")
    done = sonarhw(installed, "scan", "turret:1", "--out", str(log), *options)
    assert done.returncode == 0, done.stderr
    readings = read_log(log).readings
    assert [(round(r.angle * 57.29578), r.ping) for r in readings] == [
        (angle, ping) for angle in (-20, -10, 0, 10) for ping in (0, 1)
    ]
    assert all(len(reading.echo_times) == 2 for reading in readings)


def test_it_identifies_itself(installed: Path) -> None:
    done = sonarhw(installed, "info", "--json", "rangebox:2.5")
    found = json.loads(done.stdout)
    keys = ("firmware", "serial", "protocol", "origin")
    assert [found[key] for key in keys] == ["Range box", "7", None, "measured"]


def test_its_own_errors_are_one_line(installed: Path, tmp_path: Path) -> None:
    done = sonarhw(installed, "scan", "rangebox:far", "--out", str(tmp_path / "x.mcap"))
    assert (done.returncode, done.stderr) == (2, "sonarhw: rangebox:far: expected rangebox:METRES\n")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("missing_package:Device", "cannot be loaded: No module named"),
        ("json:Device", "cannot be loaded"),
        ("json:loads", "is not a subclass of sonarhw.DevicePlugin"),
    ],
)
def test_a_broken_plugin_is_one_line(value: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        device_plugin, "_installed", lambda: {"broken": EntryPoint("broken", value, device_plugin.GROUP)}
    )
    with pytest.raises(InputError, match=message):
        device_plugin.make_plugin("broken:1")


class Defective(DevicePlugin):
    """A plug-in with a defect, which is the fragment of its URL."""

    identity = DeviceIdentity("defective")

    def open(self) -> None:
        if self.url.endswith("open"):
            raise KeyError("port")

    def read(self) -> list[Measurement]:
        if self.url.endswith("read"):
            raise ZeroDivisionError
        return [Measurement(math.nan, (1.0,))]

    def close(self) -> None:
        """Do nothing."""


@pytest.fixture
def range_box(monkeypatch: pytest.MonkeyPatch) -> Iterator[PluginScanner]:
    """A scanner with the device of the example."""
    monkeypatch.syspath_prepend(EXAMPLE)
    with PluginScanner(importlib.import_module("rangebox").RangeBox("rangebox:2.5")) as scanner:
        yield scanner


def test_a_scan_refuses_other_actions(range_box: PluginScanner) -> None:
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


def scan_once(scanner: PluginScanner) -> None:
    """Wait for a sweep and scan it."""
    with scanner.sequence():
        scanner.home()
        list(scanner.scan())


def begin_only(scanner: PluginScanner) -> None:
    """Wait for a sweep. The end of the block ends the scan, which the recorder stores."""
    with scanner.sequence():
        scanner.home()


@pytest.mark.parametrize(("use", "room"), [(scan_once, 0), (scan_once, 1), (scan_once, 4), (begin_only, 1)])
def test_after_a_full_disk_a_scanner_is_free_again(
    range_box: PluginScanner, use: Callable[[PluginScanner], None], room: int
) -> None:
    range_box.record(disk := FullDisk(math.inf))
    disk.room = room
    with pytest.raises(OSError, match="No space"):
        use(range_box)
    range_box.record(None)
    with ThreadPoolExecutor(1) as other_thread:
        assert other_thread.submit(lambda: len([*range_box.scan()])).result() == 30


@pytest.mark.parametrize(
    ("where", "message"),
    [
        ("open", "KeyError: 'port'"),
        ("read", "ZeroDivisionError: "),
        ("nan", "ValueError: .*angle=nan.* expected finite numbers"),
    ],
)
def test_a_defect_of_a_plugin_is_one_line(where: str, message: str) -> None:
    with pytest.raises(DeviceError, match=f"defective:{where}: the plug-in has a defect: {message}") as raised:
        PluginScanner(Defective(f"defective:{where}"))
    assert isinstance(raised.value.__cause__, Exception)


def test_text_devices_are_a_plugin_of_this_project() -> None:
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"][device_plugin.GROUP] == {"lines": "sonarhw.text_device:TextDevice"}
    assert device_plugin.is_plugin("lines:/dev/ttyUSB0")
