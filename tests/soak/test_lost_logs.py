"""A disk that fills and a log that is deleted, at random writes of each recorder: no shown reading is lost."""

import errno
import math
import os
import random
from collections.abc import Callable
from importlib.metadata import EntryPoint
from io import FileIO
from pathlib import Path
from typing import Any

import pytest
from sonarhw_cli.app import run
from sonarhw_gui.model.scene import scene_with
from sonarhw_gui.session.scanner import Phase, ScannerThread, ScanSettings, scan_and_record
from sonarhw_sim.board.profile import load_board

import sonarhw
from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.log import read_log
from sonarhw.plugins import device_plugin
from sonarhw.readings import ScanOrder
from tests.checkout import CHECKOUT
from tests.conftest import Count
from tests.fixtures.plain_echoes import PlainEchoes
from tests.fixtures.text_devices.printing_device import PrintingDevice
from tests.system.cli.instrument.test_lines_command import RADAR

ORDER = ScanOrder(0.0, math.radians(5), 72)
Recorder = Callable[[str, Path, pytest.CaptureFixture[str]], list[str]]


def by_command(url: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the headings that `scan --print` prints, degrees."""
    run(["scan", url, "--out", str(folder / "scan.mcap"), "--print"])
    return [line.split(",")[1] for line in capsys.readouterr().out.splitlines()[1:]]


def by_window(url: str, folder: Path, _: pytest.CaptureFixture[str]) -> list[str]:
    """Return the headings that the window shows, degrees."""
    settings = ScanSettings(folder, ORDER)
    scene, shown = scene_with(load_board("paper")), []
    live = ScannerThread(
        lambda: sonarhw.open_scanner(url),
        Phase.HOMING,
        scan_and_record(scene, settings),
        lambda: shown.extend(live.take()),
    )
    live.start()
    live.disconnect()
    live.join()
    return [f"{math.degrees(reading.angle):.9g}" for reading in shown]


def failing_drive(folder: Path, fault: str, first: int) -> type[FileIO]:
    """Return the class of files of which those in `folder` fail from a write on, or are deleted at it."""
    writes = iter(range(1, 1_000_000))

    class Drive(FileIO):
        def write(self, data: Any) -> int:
            path = Path(os.fsdecode(self.name))
            number = next(writes) if path.parent == folder else 0
            if fault == "full" and number >= first:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            if fault == "deleted" and number == first:
                path.unlink()
            return super().write(data)

    return Drive


@pytest.mark.parametrize("device", ["frames", "text", "plug-in"])
@pytest.mark.parametrize("recorder", [by_command, by_window])
def test_no_reading_that_was_shown_is_lost_with_its_log(
    device: str,
    recorder: Recorder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    count: Count,
) -> None:
    monkeypatch.syspath_prepend(CHECKOUT / "tests" / "fixtures" / "example_plugin")
    turret = EntryPoint("turret", "rangebox:Turret", device_plugin.GROUP)
    monkeypatch.setattr(device_plugin, "installed_plugins", lambda: {"lines": device_plugin.OWN, "turret": (turret,)})
    for seed in range(count(4, 100)):
        chance, folder = random.Random(f"{device} {seed}"), tmp_path / str(seed) / "drive"
        folder.mkdir(parents=True)
        monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / str(seed) / "data"))
        fault, first = ("full", "deleted")[seed % 2], chance.randrange(2, 80)
        monkeypatch.setattr("sonarhw.log.writer.FileIO", failing_drive(folder, fault, first))
        with (
            PrintingDevice(RADAR.rounds()) as printing,
            serve(FakeBoard(PlainEchoes()), tcp="127.0.0.1:0", pace="max") as endpoint,
        ):
            text = f"lines:{printing.port}?preset=arduino-radar"
            shown = recorder({"text": text, "plug-in": "turret:1"}.get(device, endpoint.url), folder, capsys)
        assert len(shown) > 30
        logs = sorted((tmp_path / str(seed)).rglob("*.mcap"), key=lambda log: len(read_log(log).readings))
        kept = [f"{math.degrees(reading.angle):.9g}" for reading in read_log(logs[-1]).readings]
        assert kept == shown, f"{fault} at write {first}"
        assert logs[-1].parent != folder or len(logs) == 1
