"""Recordings that take hours, are killed, or meet a disk that fills and a log that is deleted."""

import errno
import math
import os
import random
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import nullcontext
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
from sonarhw.host.scripts import configuring
from sonarhw.log import Log, LogWriter, read_log
from sonarhw.plugins import device_plugin
from sonarhw.readings import ScanOrder
from sonarhw.wire.messages import StartScan
from tests.checkout import CHECKOUT
from tests.conftest import Count
from tests.fixtures import commands
from tests.fixtures.bench import TRACES, Bench
from tests.fixtures.commands import lines, started
from tests.fixtures.example_logs import METADATA
from tests.fixtures.plain_echoes import PlainEchoes
from tests.fixtures.text_devices.printing_device import PrintingDevice
from tests.system.cli.instrument.test_lines_command import RADAR

# memory during long scans with traces: a minute in a normal run, with `--soak` an hour, on a virtual clock


SWEEP = 180  # headings, some 18 s
SLACK = 1000  # temporary allocated blocks
INDEX = 24  # allocated blocks per reading in the index that closes a log, less than a kilobyte


@pytest.mark.parametrize("recorded", [False, True], ids=["scanning", "recording"])
def test_memory_grows_only_by_the_index_of_the_log(tmp_path: Path, count: Count, recorded: bool) -> None:
    sweeps = count(4, 200)
    path = tmp_path / "hour.mcap"
    bench = Bench().connect()
    with LogWriter(path, METADATA) if recorded else nullcontext() as writer:
        bench.session.recording.use(writer)
        half, end = blocks_while_scanning(bench, sweeps)
    readings = (sweeps - 1 - sweeps // 2) * SWEEP
    assert end - half < SLACK + (INDEX * readings if recorded else 0)
    if recorded:
        log = read_log(path)
        assert log.torn is None
        assert len(log.readings) == sweeps * SWEEP


def blocks_while_scanning(bench: Bench, sweeps: int) -> tuple[int, int]:
    """Return the numbers of allocated blocks after half of the sweeps and after all but one."""
    bench.do(configuring(TRACES))
    scan, sizes = bench.scan(StartScan(0, 1_000_000, SWEEP, sweeps, 1)), []
    for sweep in (sweeps // 2, sweeps - 1):
        while not scan.readings or scan.readings[-1].number < sweep * SWEEP:
            bench.echoes.pings.clear()
            while len(scan.readings) > 1:
                scan.readings.popleft()
            bench.step()
        sizes.append(sys.getallocatedblocks())
    bench.until(lambda: scan.done)
    return sizes[0], sizes[1]


# after kill -9 the log opens and contains every reading that was printed


LONG = ("--step", "1", "--sweeps", "400")  # always killed early
TAIL = 4096  # bytes


def test_every_reading_delivered_before_the_kill_is_in_the_log(tmp_path: Path, count: Count) -> None:
    chance = random.Random(11)
    for kill in range(count(2, 200)):
        log = tmp_path / f"{kill}.mcap"
        with serve(FakeBoard(PlainEchoes(), seed=2), tcp="127.0.0.1:0", pace=20.0) as endpoint:
            traces = ("--traces",) if kill % 2 else ()
            with started("scan", endpoint.url, "--out", log, "--print", *LONG, *traces) as process:
                printed = lines(process, chance.randrange(1, 400))
                threading.Event().wait(chance.uniform(0, 0.05))
                process.send_signal(signal.SIGKILL)
                printed += process.stdout.readlines()
                assert process.wait() == -signal.SIGKILL
        headings = [line.split(",")[1] for line in printed[1:] if line.endswith("\n")]
        assert_contains(read_log(log), headings)


def assert_contains(log: Log, headings: list[str]) -> None:
    """Assert that the log begins with readings at these headings."""
    recorded = [f"{math.degrees(reading.angle):.9g}" for reading in log.readings]
    assert recorded[: len(headings)] == headings


def test_a_log_cut_at_each_byte_of_its_tail_opens(tmp_path: Path, count: Count) -> None:
    whole, torn = tmp_path / "whole.mcap", tmp_path / "torn.mcap"
    with serve(FakeBoard(PlainEchoes(), seed=2), tcp="127.0.0.1:0", pace="max") as endpoint:
        assert commands.sonarhw("scan", endpoint.url, "--out", whole, "--step", "30", "--traces").returncode == 0
    data, before = whole.read_bytes(), 0
    assert read_log(whole).torn is None
    for at in range(len(data) - TAIL, len(data), count(101, 1)):
        torn.write_bytes(data[:at])
        log = read_log(torn)
        assert log.torn is not None
        assert before <= len(log.readings) <= 12
        before = len(log.readings)
    assert before == 12


# at random writes of each recorder: no shown reading is lost


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
