"""Random actions in the window, and many files in turns: no error, no critical message of Qt, little growth of memory.

`make test` runs a short version. With `--soak`: 5000 actions, and 100 files.
"""

import ctypes
import gc
import logging
import random
from collections import deque
from itertools import cycle, islice
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QtMsgType
from PySide6.QtWidgets import QApplication, QDialog
from pytestqt.exceptions import capture_exceptions
from sonarhw_compare.scans import notes_path
from sonarhw_gui.jobs.files import file_kind
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import ScannerTarget
from sonarhw_gui.window.garbage import collected_between_events
from sonarhw_gui.window.import_dialog import ImportDialog
from sonarhw_gui.window.window import MainWindow

from tests.checkout import CHECKOUT
from tests.conftest import Count
from tests.system.gui.conftest import OpenFake, OpenWith
from tests.system.gui.dense_scan import dense_log
from tests.system.gui.driving import pause, predicted, until
from tests.system.gui.monkey import Monkey

SEED = 16
_LOG = logging.getLogger(__name__)  # measured figures: pytest --log-cli-level INFO
# of resident memory after the warm-up. With seed 16, 490 MiB after 1000 of 5000 actions and 507 MiB at the end; 100
# files, after two of each and at the end: 333 and 337 MiB
GROWTH = 1.05
WARM_UP = 500  # actions, at least: each panel, kind of plot and compiled kernel is loaded at its first use
_BSCAN, _ALL_PANES = 2, 3  # number of the B-scan among the large views, and of its choice "All three"
_PAGE = 4096  # bytes
_CRITICAL = (QtMsgType.QtCriticalMsg, QtMsgType.QtFatalMsg)


@pytest.fixture
def files(recorded: Path, scene: Scene, tmp_path: Path) -> list[Path]:
    """Write logs, rooms and CSV scans, some of them torn, damaged or empty."""
    folder = tmp_path / "files"
    folder.mkdir()
    chance, whole = random.Random(SEED), recorded.read_bytes()
    (folder / "torn.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    flipped = bytearray(whole)
    for _ in range(20):
        flipped[chance.randrange(len(flipped))] ^= 1 << chance.randrange(8)
    (folder / "flipped.mcap").write_bytes(flipped)
    (folder / "empty.mcap").write_bytes(b"")
    (folder / "whole.mcap").write_bytes(whole)
    dense_log(folder / "two_sweeps.mcap", scene, 720, sweep=360)
    notes_path(folder / "whole.mcap").write_text("sweep,reading,heading_deg,range_m,note\n1,3,30,9,gone\nhalf a")
    (folder / "turret.csv").write_text("deg,cm\n0,15.4\n90,65.7\n180,\n")
    (folder / "no_scan.csv").write_bytes(b"\x00\xff;;\n" * 9)
    (folder / "broken.toml").write_text("walls = 3")
    for name in ("simple", "corridor"):
        (folder / f"{name}.toml").write_text((CHECKOUT / "rooms" / f"{name}.toml").read_text())
    return sorted(path for path in folder.iterdir() if not path.name.endswith(".notes.csv"))


@pytest.fixture
def window(
    open_with: OpenWith, fake: OpenFake, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> MainWindow:
    """A window with a scanner and stored settings; dialogs begin in an empty folder."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    opener = fake("max")

    def find_scanner(url: str, follows: bool = False) -> ScannerTarget:
        return ScannerTarget(url, opener, follow=(lambda _: opener) if follows else None)

    return open_with(source=opener, memory=tmp_path / "state" / "window.ini", find_scanner=find_scanner)


def test_random_actions_raise_no_error(
    window: MainWindow, files: list[Path], recorded: Path, count: Count, qtlog: object
) -> None:
    actions = count(40, 5000)
    monkey, last = Monkey(window, files, SEED), deque[str](maxlen=25)
    warm = 0
    with capture_exceptions() as errors, collected_between_events():
        for number in range(actions):
            if number == max(actions // 5, WARM_UP):
                warm = settled_memory(window, recorded)
            last.append(monkey.act())
            _LOG.debug("%d: %s", number, last[-1])
            assert not errors, f"action {number}: {errors[0][1]!r} after {list(last)}"  # the traceback is in stderr
            assert not critical(qtlog), f"action {number}: {critical(qtlog)} after {list(last)}"
            assert window.isVisible(), f"action {number} closed the window: {list(last)}"
        end = settled_memory(window, recorded)
        assert not errors, f"at the end: {errors[0][1]!r} after {list(last)}"
    _LOG.info("%d actions: %.0f MiB after the warm-up, %.0f MiB at the end", actions, warm / 2**20, end / 2**20)
    if warm:
        assert end < GROWTH * warm


def test_files_in_turns_raise_no_error_and_keep_the_memory(
    window: MainWindow, files: list[Path], recorded: Path, count: Count, qtlog: object
) -> None:
    turns, warm = count(len(files), 100), 0
    with capture_exceptions() as errors, collected_between_events():
        for number, path in enumerate(islice(cycle(files), turns)):
            if number == 2 * len(files):
                warm = settled_memory(window, recorded)
            window.session.open_file(str(path))
            if file_kind(path) == "scan":
                until(lambda: bool(window.findChildren(ImportDialog)))
                for dialog in window.findChildren(ImportDialog):
                    until(lambda dialog=dialog: dialog.note.text() != "reading …")
                    dialog.import_button.click()
                    dialog.close()
            until(lambda: not window.session.jobs.busy("open files"))
            pause(60)  # two ticks
            until(lambda: window.session.shown.scene.room is None or predicted(window))
            assert not errors, f"{path.name}: {errors[0][1]!r}"
            assert not critical(qtlog), f"{path.name}: {critical(qtlog)}"
        end = settled_memory(window, recorded)
    _LOG.info("%d files: %.0f MiB after two of each, %.0f MiB at the end", turns, warm / 2**20, end / 2**20)
    if warm:
        assert end < GROWTH * warm


def critical(qtlog: object) -> list[str]:
    """Return the critical messages of Qt so far."""
    return [record.message for record in qtlog.records if record.type in _CRITICAL]  # type: ignore[attr-defined]


def settled_memory(window: MainWindow, log: Path) -> int:
    """Bring the window to the same state each time, and return its resident memory, bytes."""
    session = window.session
    for popup in iter(QApplication.activePopupWidget, None):
        popup.close()
    for dialog in window.findChildren(QDialog):
        dialog.close()
    session.stop()
    session.sound.close()
    session.fitting.cancel()
    session.causes.cancel()
    session.finding.cancel()
    lanes = "save files", "open files", "causes", "fit", "find the room"
    until(lambda: not (session.live.running or any(map(session.jobs.busy, lanes))))
    while session.scans.scans:
        session.scans.remove(0)
    session.close_readings()  # the last scan is kept while a log is shown, and is as long as chance made it
    QApplication.clipboard().clear()  # of a picture of a view
    session.showing.set_look(Look())
    session.showing.show_all()
    window.commands.reset_layout.trigger()
    window.resize(1280, 800)
    session.open_file(str(log))
    until(lambda: session.log_file == str(log) and not session.jobs.busy("open files"))
    until(lambda: predicted(window))
    bscan = window.views.bscan
    for action, wanted in ((bscan.choices.actions()[_ALL_PANES], True), (bscan.polar, False), (bscan.decibels, True)):
        if action.isChecked() != wanted:
            action.trigger()
    for number in reversed(range(len(window.views.large))):  # each is created when it is first visible; last the plan
        window.views.stage.setCurrentIndex(number)
        pause(60)  # two ticks
        if number == _BSCAN:
            until(lambda: bscan_done(window))
    session.notices.clear()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * _PAGE


def bscan_done(window: MainWindow) -> bool:
    """Return whether all panes of the B-scan are drawn."""
    shown, view = window.session.shown, window.views.bscan
    return shown.bscan is not None and shown.bscan.rows.done == 1 and shown.bscan.settings == view.settings


def test_every_command_is_within_reach_of_the_monkey(window: MainWindow, files: list[Path]) -> None:
    texts = {action.text().strip("…") for action in Monkey(window, files, SEED).every_command()}
    assert {
        "Causes",
        "Scans",
        "Find the room",
        "Differences",
        "Import scan",
        "Add note",
        "Ask",
        "Play sound",
        "Find pose",
    } <= texts
    assert len(texts) > 90
    assert "Close" not in texts
