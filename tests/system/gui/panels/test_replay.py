"""A log in a real window: shown at once, played, paused, scrubbed, and truncated."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QGraphicsView
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.source import SPEEDS, lost_in
from sonarhw_gui.window.window import MainWindow

from sonarhw.device.replayed_log import Playback
from sonarhw.log import Log, read_log
from sonarhw.wire.messages import Outcome
from tests.system.gui.conftest import ORDER, OpenFake, OpenWith
from tests.system.gui.driving import PATIENCE, predicted, until


@pytest.fixture
def log(recorded: Path) -> Log:
    return read_log(recorded)


@pytest.fixture
def window(open_with: OpenWith, log: Log) -> MainWindow:
    return open_with(source=log)


def test_a_log_is_shown_completely_with_the_slider_at_its_end(qtbot: QtBot, window: MainWindow) -> None:
    until(qtbot, lambda: predicted(window))
    assert len(window.session.shown.readings) == ORDER.readings
    assert window.replay_bar.isVisible()
    assert window.replay_bar.slider.value() == window.replay_bar.slider.maximum() > 0
    until(qtbot, lambda: window.status_bar.badge.text() == "replay")
    assert not window.commands.scan.isEnabled()


def test_play_begins_at_the_beginning_and_runs_to_the_end(qtbot: QtBot, window: MainWindow) -> None:
    window.replay_bar.speed.setCurrentIndex(SPEEDS.index(2.0))
    window.replay_bar.speed.activated.emit(SPEEDS.index(2.0))
    counts = []
    window.session.showing.changed.connect(lambda shown: counts.append(len(shown.readings)))
    qtbot.mouseClick(window.replay_bar.play, Qt.MouseButton.LeftButton)
    assert window.replay_bar.play.text() == "Pause"
    while window.session.replay.playing:
        window.session.replay.advance(0.05)
    assert counts == sorted(counts)
    assert counts[0] <= 1
    assert counts[-1] == ORDER.readings
    assert len(set(counts)) > 5
    assert window.replay_bar.play.text() == "Play"


def test_stepping_and_scrubbing_keep_the_chosen_reading_selected_in_the_table(
    qtbot: QtBot, window: MainWindow, recorded: Path
) -> None:
    until(qtbot, lambda: predicted(window))
    replay, rows = window.session.replay, window.views.table.view.selectionModel()

    def selected() -> bool:
        chosen = window.views.table.model.row_of(window.session.shown.chosen)
        return [index.row() for index in rows.selectedRows()] == [chosen] == [rows.currentIndex().row()]

    assert selected()
    for command in (
        window.commands.step_back,
        window.commands.step_back,
        window.commands.step_forward,
        window.commands.choose_previous,
    ):
        command.trigger()
        assert selected(), command.text()
    window.commands.follow_newest.trigger()
    for part in (0.0, 0.5, 0.2, 1.0):
        replay.seek(part * replay.duration)
        assert selected(), part
    window.session.showing.choose(0)
    with qtbot.waitSignal(window.session.recent_changed, timeout=PATIENCE):
        window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.shown.chosen == ORDER.readings - 1)
    assert selected()


def test_play_continues_where_pause_has_stopped(qtbot: QtBot, window: MainWindow) -> None:
    window.session.replay.toggle()
    window.session.replay.advance(0.3)
    assert len(window.session.shown.readings) >= 2
    qtbot.mouseClick(window.replay_bar.play, Qt.MouseButton.LeftButton)
    paused_at = window.session.replay.position
    window.session.tick()
    assert window.session.replay.position == paused_at
    qtbot.mouseClick(window.replay_bar.play, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: window.session.replay.position > paused_at)


def test_space_plays_and_pauses(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_Space)
    assert window.session.replay.playing
    qtbot.keyClick(window, Qt.Key.Key_Space)
    assert not window.session.replay.playing


def test_scrubbing_shows_the_readings_up_to_that_time(qtbot: QtBot, window: MainWindow) -> None:
    until(qtbot, lambda: predicted(window))
    slider = window.replay_bar.slider
    slider.setValue(slider.maximum() // 2)
    half = len(window.session.shown.readings)
    assert 0 < half < ORDER.readings
    slider.setValue(0)
    assert len(window.session.shown.readings) <= 1
    slider.setValue(slider.maximum())
    assert len(window.session.shown.readings) == ORDER.readings
    assert predicted(window)


def test_all_at_once_is_a_speed(window: MainWindow) -> None:
    window.session.replay.speed = math.inf
    window.session.replay.toggle()
    window.session.tick()
    assert len(window.session.shown.readings) == ORDER.readings
    assert window.replay_bar.speed.currentText() == "all at once"


def test_a_truncated_log_shows_a_banner_and_its_readings(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    torn = tmp_path / "torn.mcap"
    data = recorded.read_bytes()
    torn.write_bytes(data[: len(data) // 2])
    window = open_with()
    window.session.open_file(str(torn))
    until(qtbot, lambda: window.session.replay is not None)
    kept = len(window.session.shown.readings)
    assert 0 < kept < ORDER.readings
    until(qtbot, lambda: window.banner.message.startswith("⚠ torn.mcap: "))  # once it does not grow any more
    assert f"{kept} whole readings are shown; to repair it: `sonarhw log recover`" in window.banner.message


def test_a_log_of_a_scan_with_lost_steps_shows_a_banner(qtbot: QtBot, window: MainWindow, log: Log) -> None:
    (scan,) = log.scans
    assert scan.finished is not None
    lost = replace(scan.finished, outcome=Outcome.LOST_STEPS)
    window.session.show_log(replace(log, scans=(replace(scan, finished=lost),)), "bench.mcap")
    warning = f"⚠ bench.mcap: the turntable lost steps; all {ORDER.readings} angles may be wrong"
    until(qtbot, lambda: window.banner.message.startswith(warning))


def test_a_log_opened_in_the_window_provides_its_room(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene
) -> None:
    window = open_with(scene=Scene(None, None, scene.board))
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.status.replay is not None and predicted(window))
    assert window.session.shown.scene.room.name == "Simple room"
    assert window.toolbar.place.currentText() == "figure9"


def test_an_invalid_log_shows_a_banner(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    path = tmp_path / "no.mcap"
    path.write_text("no log")
    window = open_with()
    window.session.open_file(str(path))
    until(qtbot, lambda: bool(window.banner.message))
    assert "no.mcap" in window.banner.message


def test_a_scan_after_a_replay_closes_the_log(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, recorded: Path
) -> None:
    window = open_with(source=fake("max"))
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.replay_bar.isVisible())
    window.commands.scan.trigger()
    until(qtbot, lambda: len(window.session.shown.readings) == ORDER.readings and not window.session.status.scanning)
    assert not window.replay_bar.isVisible()


def test_playback_keeps_the_recorded_schedule(log: Log) -> None:
    playback = Playback(log)
    first, last = log.readings[0], log.readings[-1]
    assert playback.count == ORDER.readings
    playback.play()
    playback.speed = 2.0
    before_last = (last.time - log.scans[0].began) / 2 - 1e-3
    playback.advance(before_last)
    assert playback.count == ORDER.readings - 1
    playback.seek(first.time - log.scans[0].began)
    assert playback.count == 1


def test_lost_readings_are_those_made_but_missing(log: Log) -> None:
    (scan,) = log.scans
    assert lost_in(scan) == 0
    assert lost_in(replace(scan, readings=scan.readings[:5] + scan.readings[7:])) == 2
    # a stopped scan has not lost the readings that it never made
    stopped = replace(scan, readings=scan.readings[:10], finished=replace(scan.finished, readings=10))
    assert lost_in(stopped) == 0
    assert lost_in(replace(scan, readings=scan.readings[:10], finished=None)) == 0


# pixels at the edges of dots that round differently if only a part is drawn; a mark of an earlier frame has over 40
ROUNDED = 20


def test_nothing_of_earlier_frames_remains_on_the_screen(qtbot: QtBot, window: MainWindow) -> None:
    until(qtbot, lambda: predicted(window))
    window.session.showing.choose(20)
    QApplication.processEvents()
    window.session.replay.toggle()
    until(qtbot, lambda: len(window.session.shown.readings) >= ORDER.readings // 3)
    window.session.replay.pause()
    until(qtbot, lambda: predicted(window))
    QApplication.processEvents()
    for view in (window.views.ranges, window.views.plan.drawing):
        until(qtbot, lambda view=view: _differing(_on_screen(window, view), _redrawn(view)) <= ROUNDED)


def _differing(one: QImage, other: QImage) -> int:
    """Return the number of different pixels of two images of one size and 4 bytes a pixel."""
    assert one.size() == other.size()
    pixels = [np.frombuffer(image.constBits(), np.uint32) for image in (one, other)]
    return int((pixels[0] != pixels[1]).sum())


def _on_screen(window: MainWindow, view: QGraphicsView) -> QImage:
    image = window.screen().grabWindow(view.viewport().winId()).toImage()
    return image.convertToFormat(QImage.Format.Format_RGB32)


def _redrawn(view: QGraphicsView) -> QImage:
    return view.viewport().grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
