"""Several scans at once, with mouse and keys: before and after a post was put up, and two sweeps of one log."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QFileDialog, QGraphicsTextItem, QStyle, QStyleOptionViewItem
from pytestqt.qtbot import QtBot
from sonarhw_cli.app import run
from sonarhw_compare.two_scans import ScanChange
from sonarhw_gui.model.shown import SHOWN
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import keep_pictures, log_name, predicted, until

LEFT = Qt.MouseButton.LeftButton
POST = '[[posts]]\nname = "chair"\ncenter = [0.3, 0.4]\nradius = 0.03\nmaterial = "shelving"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scans")
    (folder / "with_post.toml").write_text(Path("rooms/simple.toml").read_text() + POST)
    for room, out in (("rooms/simple.toml", "before"), (str(folder / "with_post.toml"), "after")):
        assert run(["simulate", room, "--place", "figure9", "--step", "5", "--out", str(folder / f"{out}.mcap")]) == 0
    return folder


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, folder: Path) -> MainWindow:
    window = open_with(source=read_log(folder / "after.mcap"))
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_F12)
    until(qtbot, window.scans.isVisible)
    return window


def add(qtbot: QtBot, window: MainWindow, log: Path) -> None:
    """Add a log with the button and the file dialog."""
    count = window.scans.list.count()
    qtbot.mouseClick(window.scans.add, LEFT)
    until(qtbot, lambda: any(one.isVisible() for one in window.findChildren(QFileDialog)))
    (dialog,) = (one for one in window.findChildren(QFileDialog) if one.isVisible())
    dialog.selectFile(str(log))
    dialog.accept()
    until(qtbot, lambda: window.scans.list.count() == count + 1)


def toggle_eye(qtbot: QtBot, window: MainWindow, row: int) -> None:
    """Click the check box of a scan."""
    scans = window.scans.list
    item = QStyleOptionViewItem()
    scans.initViewItemOption(item)
    item.rect = scans.visualItemRect(scans.item(row))
    item.features |= QStyleOptionViewItem.ViewItemFeature.HasCheckIndicator
    box = scans.style().subElementRect(QStyle.SubElement.SE_ItemViewItemCheckIndicator, item, scans)
    qtbot.mouseClick(scans.viewport(), LEFT, pos=box.center() + QPoint(1, 0))


def test_before_and_after_a_post_was_put_up(qtbot: QtBot, window: MainWindow, folder: Path) -> None:
    add(qtbot, window, folder / "before.mcap")
    shown = window.session.shown
    assert shown.pair == (0, SHOWN)
    style = shown.overlays[0].style
    plan, ranges = window.views.plan.drawing.overlays, window.views.ranges.overlays
    until(qtbot, lambda: plan.scatters[style].isVisible() and ranges.scatters[style].isVisible())
    # the plan shows its echoes from the same place: 36 of 72 are those of the scan shown
    sensor = np.array(shown.scene.pose.position)
    far = np.hypot(*(np.column_stack(plan.scatters[style].getData()) - sensor).T)
    before = [reading.range for reading in read_log(folder / "before.mcap").readings if reading.range is not None]
    assert sorted(far) == pytest.approx(sorted(before), abs=1e-6)

    next(one for one in window.views.openers if one.text() == "Differences").trigger()
    view = window.views.differences
    until(qtbot, lambda: view.isVisible() and view.difference is not None)
    changes = view.difference.changes
    assert changes[ScanChange.NEARER] > 20
    assert changes[ScanChange.FARTHER] == 0
    assert f"{changes[ScanChange.NEARER]} nearer" in view.summary.text()
    keep_pictures(qtbot, window, "scans")

    toggle_eye(qtbot, window, 0)
    until(qtbot, lambda: not plan.scatters[style].isVisible() and not ranges.scatters[style].isVisible())
    assert view.difference is not None

    # the other way round, with keys
    window.scans.first.setFocus()
    qtbot.keyClick(window.scans.first, Qt.Key.Key_Up)
    qtbot.keyClick(window.scans.second, Qt.Key.Key_Down)
    until(qtbot, lambda: view.difference is not None and view.difference.changes[ScanChange.FARTHER] > 20)

    qtbot.mouseClick(window.scans.remove, LEFT)
    until(qtbot, lambda: view.difference is None)
    assert window.scans.list.count() == 0


def test_a_kept_scan_stays_when_another_log_is_opened(qtbot: QtBot, window: MainWindow, folder: Path) -> None:
    qtbot.mouseClick(window.scans.keep, LEFT)
    assert window.scans.list.count() == 1
    window.session.open_file(str(folder / "before.mcap"))
    until(qtbot, lambda: log_name(window) == "before.mcap" and predicted(window))
    next(one for one in window.views.openers if one.text() == "Differences").trigger()
    view = window.views.differences
    until(qtbot, lambda: view.difference is not None and view.difference.changes[ScanChange.FARTHER] > 20)


def test_differences_without_a_second_scan_are_a_sentence_instead_of_empty_axes(
    qtbot: QtBot, window: MainWindow
) -> None:
    next(one for one in window.views.openers if one.text() == "Differences").trigger()
    view = window.views.differences
    until(qtbot, view.isVisible)

    def axes() -> list[bool]:
        return [view.plot.getAxis(side).isVisible() for side in ("left", "bottom")]

    text = next(
        item for item in view.canvas.scene().items() if isinstance(item, QGraphicsTextItem) and item.isVisible()
    )
    assert text.toPlainText().startswith("No scan to compare with: ")
    assert view.canvas.sceneRect().contains(text.sceneBoundingRect())
    assert axes() == [False, False]
    qtbot.mouseClick(window.scans.keep, LEFT)
    until(qtbot, lambda: axes() == [True, True])
    assert not text.isVisible()
    assert "same" in view.summary.text()
    assert view.summary.isVisible()
    qtbot.mouseClick(window.scans.remove, LEFT)
    until(qtbot, text.isVisible)
    assert axes() == [False, False]


def test_two_sweeps_of_one_log(qtbot: QtBot, open_with: OpenWith, folder: Path, tmp_path: Path) -> None:
    log = read_log(folder / "before.mcap")
    twice = replace(log, scans=(replace(log.scans[0], readings=replace_sweeps(log.readings)),))
    window = open_with(source=twice, source_file=folder / "before.mcap")
    qtbot.keyClick(window, Qt.Key.Key_F12)
    until(qtbot, window.scans.isVisible)
    qtbot.mouseClick(window.scans.sweeps, LEFT)
    assert window.session.scans.pair == (0, 1)
    assert [window.scans.list.item(row).text() for row in (0, 1)] == [
        "before, sweep 1",
        "before, sweep 2",
    ]


def replace_sweeps(readings: tuple) -> tuple:
    return (*readings, *(replace(reading, sweep=1) for reading in readings))
