"""The replay bar in a real window: steps, loop, time slider, scans, gaps, leaving, and a lost drive."""

import errno
import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import DARK, LIGHT, Palette
from sonarhw_gui.panels.replay import time_text
from sonarhw_gui.session.source import SPEEDS
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import Log, read_log
from sonarhw.log.mcap_records import OpenFile
from tests.system.gui.conftest import ORDER, OpenFake, OpenWith
from tests.system.gui.driving import ended, predicted, until

WAIT = 60.0  # s in the middle of the second scan


@pytest.fixture
def log(recorded: Path) -> Log:
    """Return a log of two scans, the second with a gap of one minute."""
    (scan,) = read_log(recorded).scans
    late = tuple(replace(reading, time=reading.time + WAIT * (reading.number >= 18)) for reading in scan.readings)
    return replace(read_log(recorded), scans=(scan, replace(scan, readings=late)))


@pytest.fixture
def window(open_with: OpenWith, log: Log) -> MainWindow:
    return open_with(source=log)


def button(window: MainWindow, action: QAction) -> QToolButton:
    """Return the button of an action in the replay bar."""
    (found,) = (each for each in window.replay_bar.findChildren(QToolButton) if each.defaultAction() is action)
    return found


def press(qtbot: QtBot, window: MainWindow, action: QAction) -> None:
    qtbot.mouseClick(button(window, action), Qt.MouseButton.LeftButton)


def seen(window: MainWindow) -> int:
    return len(window.session.shown.readings)


def test_steps_move_by_one_reading_with_mouse_and_keys(qtbot: QtBot, window: MainWindow) -> None:
    press(qtbot, window, window.commands.step_back)
    assert seen(window) == 2 * ORDER.readings - 1
    qtbot.keyClick(window, Qt.Key.Key_Comma)
    assert seen(window) == 2 * ORDER.readings - 2
    qtbot.keyClick(window, Qt.Key.Key_Period)
    press(qtbot, window, window.commands.step_forward)
    press(qtbot, window, window.commands.step_forward)
    assert seen(window) == 2 * ORDER.readings
    assert not window.session.replay.playing


def test_a_step_pauses_the_replay(qtbot: QtBot, window: MainWindow) -> None:
    window.session.replay.toggle()
    until(qtbot, lambda: seen(window) >= 2)
    press(qtbot, window, window.commands.step_forward)
    assert window.replay_bar.play.text() == "Play"


def test_scans_are_marked_and_buttons_go_to_them(qtbot: QtBot, window: MainWindow) -> None:
    first, second = window.session.replay.scan_starts
    marks = window.replay_bar.slider.marks
    assert marks[0] < marks[1] < window.replay_bar.slider.width()
    press(qtbot, window, window.commands.previous_scan)
    assert (seen(window), window.session.replay.position) == (ORDER.readings + 1, pytest.approx(second))
    qtbot.keyClick(window, Qt.Key.Key_Left, Qt.KeyboardModifier.ControlModifier)
    assert (seen(window), window.session.replay.position) == (1, pytest.approx(first))
    press(qtbot, window, window.commands.next_scan)
    assert seen(window) == ORDER.readings + 1
    press(qtbot, window, window.commands.next_scan)
    assert seen(window) == 2 * ORDER.readings


@pytest.mark.parametrize("colours", [LIGHT, DARK])
def test_the_mark_of_a_scan_is_at_its_slider_position(qtbot: QtBot, window: MainWindow, colours: Palette) -> None:
    window.session.showing.set_look(replace(window.session.shown.look, palette=colours))
    window.session.replay.seek(window.session.replay.duration)
    slider = window.replay_bar.slider
    image = slider.grab().toImage()
    for mark in slider.marks[1:]:
        assert image.pixelColor(round(mark), 1).name().upper() == colours.predicted.upper()


def test_a_click_on_the_slider_seeks_there(qtbot: QtBot, window: MainWindow) -> None:
    slider = window.replay_bar.slider
    qtbot.mouseClick(slider, Qt.MouseButton.LeftButton, pos=QPoint(slider.width() // 2, slider.height() // 2))
    state = window.session.replay
    assert state.position == pytest.approx(state.duration / 2, abs=0.02 * state.duration)
    assert window.replay_bar.time.text() == time_text(state)


def test_dragging_the_handle_seeks(qtbot: QtBot, window: MainWindow) -> None:
    slider = window.replay_bar.slider
    middle = slider.height() // 2
    qtbot.mousePress(slider, Qt.MouseButton.LeftButton, pos=QPoint(slider.width() - 5, middle))
    counts = []
    for share in (0.75, 0.5, 0.01):
        qtbot.mouseMove(slider, QPoint(round(share * slider.width()), middle))
        counts.append(seen(window))
    qtbot.mouseRelease(slider, Qt.MouseButton.LeftButton, pos=QPoint(2, middle))
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < counts[0]


def test_a_loop_restarts_the_replay_and_without_it_the_replay_stops(qtbot: QtBot, window: MainWindow) -> None:
    window.session.replay.speed = 50.0
    qtbot.keyClick(window, Qt.Key.Key_L, Qt.KeyboardModifier.ControlModifier)
    assert button(window, window.commands.set_loop).isChecked()
    positions = []
    window.session.replay_changed.connect(lambda state: positions.append(state.position))
    window.session.replay.toggle()
    until(qtbot, lambda: sum(later < earlier for earlier, later in pairwise(positions)) >= 3)
    assert window.session.replay.playing
    press(qtbot, window, window.commands.set_loop)
    until(qtbot, lambda: not window.session.replay.playing)
    assert seen(window) == 2 * ORDER.readings


def test_skipping_gaps_keeps_the_same_reading(qtbot: QtBot, window: MainWindow) -> None:
    window.session.replay.seek_reading(ORDER.readings + 20)
    replay = window.session.replay
    count, duration = replay.count, replay.duration
    press(qtbot, window, window.commands.set_skip_gaps)
    assert count == replay.count == seen(window)
    assert duration - replay.duration == pytest.approx(WAIT, abs=2.0)
    assert len(replay.scan_starts) == 2
    press(qtbot, window, window.commands.set_skip_gaps)
    assert window.session.replay.duration == pytest.approx(duration)


def test_speeds_are_a_tenth_to_fifty_times_and_all_at_once(window: MainWindow) -> None:
    names = [window.replay_bar.speed.itemText(k) for k in range(len(SPEEDS))]
    assert (names[0], "50×" in names, names[-1]) == ("0.1×", True, "all at once")
    for index, speed in enumerate(SPEEDS):
        window.replay_bar.speed.activated.emit(index)
        assert window.session.replay.speed == speed
        assert window.replay_bar.speed.currentIndex() == index


def test_leaving_a_replay_without_an_earlier_scan_shows_no_readings(qtbot: QtBot, window: MainWindow) -> None:
    assert window.replay_bar.badge.isVisible()
    press(qtbot, window, window.commands.leave_replay)
    assert not window.replay_bar.isVisible()
    assert window.session.shown.readings == ()
    until(qtbot, lambda: window.status_bar.badge.text() == "no scan")
    for action in (window.commands.toggle, window.commands.leave_replay, window.commands.next_scan):
        assert not action.isEnabled()


def test_leaving_a_replay_returns_to_the_live_scan_and_its_place(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, recorded: Path
) -> None:
    window = open_with(source=fake("max"))
    until(qtbot, lambda: predicted(window))
    window.session.showing.set_place("figure7")
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and predicted(window))
    scanned = window.session.shown.readings
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.status.replay is not None)
    assert window.toolbar.place.currentText() == "figure9"
    qtbot.keyClick(window, Qt.Key.Key_W, Qt.KeyboardModifier.ControlModifier)
    assert window.session.shown.readings is scanned
    assert window.toolbar.place.currentText() == "figure7"
    until(qtbot, lambda: predicted(window) and window.session.status.replay is None)


def test_a_lost_drive_shows_a_banner_and_stops_the_replay(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*_: object) -> bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    window.session.replay.speed = 5.0
    window.session.replay.toggle()
    until(qtbot, lambda: seen(window) >= 3)
    monkeypatch.setattr(OpenFile, "read", gone)
    until(qtbot, lambda: f"{recorded}: can no longer be read" in window.banner.message)
    assert "shown without traces" in window.banner.message
    assert not window.session.replay.playing
    window.session.replay.seek_reading(2)  # on a busy machine the replay has reached its end
    kept = seen(window)
    for _ in range(5):
        press(qtbot, window, window.commands.step_forward)
    window.session.tick()
    assert seen(window) == kept + 5
    assert window.session.shown.chosen_reading.trace is None
    qtbot.mouseClick(window.banner.close_button, Qt.MouseButton.LeftButton)
    window.session.tick()
    assert window.banner.message == ""
