"""A log in the window: shown at once, played, scrubbed, looped, left, followed while it grows, and lost."""

import errno
import math
import os
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtGui import QAction, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QGraphicsView, QToolButton
from sonarhw_compare.match import Kind
from sonarhw_gui.model.look import DARK, LIGHT
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.panels.replay import time_text
from sonarhw_gui.session.source import SPEEDS
from sonarhw_gui.window.bars import activity_text
from sonarhw_gui.window.window import MainWindow

import sonarhw
from sonarhw.log import Log, read_log
from sonarhw.log.mcap_records import OpenFile
from sonarhw.log.writer import write_scan
from sonarhw.readings import FloatArray
from sonarhw.wire.messages import Outcome
from tests.system.gui.conftest import ORDER, OpenFake, OpenSession, OpenWith
from tests.system.gui.driving import LEFT, drawn, ended, keep_pictures, key, predicted, push, until

WAIT = 60.0  # s in the middle of the second scan


@pytest.fixture
def log(recorded: Path) -> Log:
    return read_log(recorded)


@pytest.fixture
def two_scans(log: Log) -> Log:
    """A log of two scans, the second with a gap of one minute."""
    (scan,) = log.scans
    late = tuple(replace(reading, time=reading.time + WAIT * (reading.number >= 18)) for reading in scan.readings)
    return replace(log, scans=(scan, replace(scan, readings=late)))


def seen(window: MainWindow) -> int:
    return len(window.session.shown.readings)


def selected(window: MainWindow) -> bool:
    """Return whether the table has selected the chosen reading only."""
    rows = window.views.table.view.selectionModel()
    chosen = window.views.table.model.row_of(window.session.shown.chosen)
    return [index.row() for index in rows.selectedRows()] == [chosen] == [rows.currentIndex().row()]


def test_a_log_of_two_scans_is_played(open_with: OpenWith, two_scans: Log) -> None:
    window = open_with(source=two_scans)
    session, bar, commands, replay = window.session, window.replay_bar, window.commands, window.session.replay
    slider, whole = bar.slider, 2 * ORDER.readings

    def press(action: QAction) -> None:
        (button,) = (each for each in bar.findChildren(QToolButton) if each.defaultAction() is action)
        push(button)

    until(lambda: predicted(window) and window.status_bar.badge.text() == "replay")
    assert seen(window) == whole
    assert bar.isVisible()
    assert slider.value() == slider.maximum() > 0
    assert not commands.scan.isEnabled()
    assert selected(window)

    # steps pause the replay and keep the chosen reading selected in the table
    for step, count in (
        (lambda: press(commands.step_back), whole - 1),
        (lambda: key(window, ","), whole - 2),
        (lambda: key(window, "."), whole - 1),
        (lambda: press(commands.step_forward), whole),
        (lambda: press(commands.step_forward), whole),
    ):
        step()
        assert (seen(window), replay.playing) == (count, False)
        assert selected(window)
    for part in (0.0, 0.5, 0.2, 1.0):
        replay.seek(part * replay.duration)
        assert selected(window), part

    # scans are marked, at their positions, in both palettes
    first, second = replay.scan_starts
    assert slider.marks[0] < slider.marks[1] < slider.width()
    for colours in (DARK, LIGHT):
        session.showing.set_look(replace(session.shown.look, palette=colours))
        image = slider.grab().toImage()
        assert image.pixelColor(round(slider.marks[1]), 1).name().upper() == colours.predicted.upper()
    for go, count, position in (
        (lambda: press(commands.previous_scan), ORDER.readings + 1, second),
        (lambda: key(window, "Ctrl+Left"), 1, first),
        (lambda: press(commands.next_scan), ORDER.readings + 1, second),
        (lambda: press(commands.next_scan), whole, replay.duration),
    ):
        go()
        assert (seen(window), replay.position) == (count, pytest.approx(position))

    # the slider is clicked and dragged
    push(slider, QPoint(slider.width() // 2, slider.height() // 2))
    assert replay.position == pytest.approx(replay.duration / 2, abs=0.02 * replay.duration)
    assert bar.time.text() == time_text(replay)
    slider.setValue(slider.maximum())
    QTest.mousePress(slider, LEFT, pos=QPoint(slider.width() - 5, slider.height() // 2))
    counts = []
    for share in (0.75, 0.5, 0.01):
        QTest.mouseMove(slider, QPoint(round(share * slider.width()), slider.height() // 2))
        counts.append(seen(window))
    QTest.mouseRelease(slider, LEFT, pos=QPoint(2, slider.height() // 2))
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] < counts[0]

    # without gaps, the same reading stays
    replay.seek_reading(ORDER.readings + 20)
    count, duration = replay.count, replay.duration
    press(commands.set_skip_gaps)
    assert count == replay.count == seen(window)
    assert duration - replay.duration == pytest.approx(WAIT, abs=2.0)
    press(commands.set_skip_gaps)
    assert replay.duration == pytest.approx(duration)

    # played: with any speed, with Space, in a loop
    names = [bar.speed.itemText(k) for k in range(len(SPEEDS))]
    assert (names[0], "50×" in names, names[-1]) == ("0.1×", True, "all at once")
    for index, speed in enumerate(SPEEDS):
        bar.speed.activated.emit(index)
        assert (replay.speed, bar.speed.currentIndex()) == (speed, index)
    replay.speed = 1.0
    replay.seek(0.0)
    key(window, "Space")
    assert (replay.playing, bar.play.text()) == (True, "Pause")
    until(lambda: seen(window) >= 2)
    push(bar.play)
    paused_at = replay.position
    session.tick()
    assert (replay.position, bar.play.text()) == (paused_at, "Play")
    push(bar.play)
    until(lambda: replay.position > paused_at)
    press(commands.step_forward)
    assert bar.play.text() == "Play"
    replay.speed = 50.0
    key(window, "Ctrl+L")
    positions: list[float] = []
    session.replay_changed.connect(note := lambda state: positions.append(state.position))
    replay.toggle()
    until(lambda: sum(later < earlier for earlier, later in pairwise(positions)) >= 2)
    assert replay.playing
    session.replay_changed.disconnect(note)
    press(commands.set_loop)
    until(lambda: not replay.playing)
    assert seen(window) == whole

    assert bar.badge.isVisible()
    press(commands.leave_replay)
    until(lambda: window.status_bar.badge.text() == "no scan")
    assert not bar.isVisible()
    assert session.shown.readings == ()
    for action in (commands.toggle, commands.leave_replay, commands.next_scan):
        assert not action.isEnabled()


def test_a_log_has_its_room(open_session: OpenSession, recorded: Path, tmp_path: Path, scene: Scene, log: Log) -> None:
    session = open_session(scene=Scene(None, None, scene.board))
    session.open_file(str(recorded))
    until(lambda: session.status.replay is not None and predicted(session))
    assert (session.shown.scene.room.name, session.shown.scene.pose.name) == ("Simple room", "figure9")
    (scan,) = log.scans
    lost = replace(scan, finished=replace(scan.finished, outcome=Outcome.LOST_STEPS))
    session.show_log(replace(log, scans=(lost,)), "bench.mcap")
    warning = f"bench.mcap: the turntable lost steps; all {ORDER.readings} angles may be wrong"
    assert session.notices.shown.text.startswith(warning)
    (tmp_path / "no.mcap").write_text("no log")
    session.open_file(str(tmp_path / "no.mcap"))
    until(lambda: session.notices.shown.text.startswith("no.mcap") or "no.mcap: " in session.notices.shown.text)


def test_leaving_a_replay_returns_to_the_live_scan(open_with: OpenWith, fake: OpenFake, recorded: Path) -> None:
    window = open_with(source=fake("max"))
    session, place = window.session, window.toolbar.place
    place.textActivated.emit("figure7")
    until(lambda: predicted(window))
    assert session.shown.outline.place.name == "figure7"
    window.commands.scan.trigger()
    until(lambda: ended(window) and predicted(window))
    readings = session.shown.readings
    session.open_file(str(recorded))
    until(lambda: session.status.replay is not None)
    assert place.currentText() == "figure9"
    key(window, "Ctrl+W")
    assert (session.shown.readings is readings, place.currentText()) == (True, "figure7")
    session.open_file(str(recorded))
    until(lambda: session.replay is not None)
    before = session.live.job.recording
    session.scan()
    until(lambda: ended(session) and session.status.job.recording not in (None, before))
    assert not window.replay_bar.isVisible()
    session.live.turn(1.0)
    until(lambda: "connected" in window.status_bar.activity.text())
    session.live.disconnect()
    until(lambda: "connected" not in window.status_bar.activity.text())


def test_a_lost_drive_is_reported(open_session: OpenSession, recorded: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def gone(*_: object) -> bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    session = open_session(read_log(recorded))
    until(lambda: predicted(session))
    session.replay.speed = 5.0
    session.replay.toggle()
    until(lambda: len(session.shown.readings) >= 3)
    monkeypatch.setattr(OpenFile, "read", gone)
    until(lambda: f"{recorded}: can no longer be read" in session.notices.shown.text)
    assert "shown without traces" in session.notices.shown.text
    assert not session.replay.playing
    session.replay.seek_reading(2)  # on a busy machine the replay has reached its end
    kept = len(session.shown.readings)
    for _ in range(5):
        session.replay.step(1)
    session.notices.dismiss()
    session.tick()
    assert (len(session.shown.readings), session.shown.chosen_reading.trace) == (kept + 5, None)
    assert session.notices.shown.text == ""


# pixels at the edges of dots that round differently if only a part is drawn; a mark of an earlier frame has over 40
ROUNDED = 20


def test_nothing_of_earlier_frames_remains_on_the_screen(window: MainWindow) -> None:
    window.session.showing.choose(20)
    QApplication.processEvents()
    window.session.replay.toggle()
    until(lambda: seen(window) >= ORDER.readings // 3)
    window.session.replay.pause()
    until(lambda: predicted(window))
    QApplication.processEvents()
    for view in (window.views.ranges, window.views.plan.drawing):
        until(lambda view=view: _differing(_on_screen(window, view), _redrawn(view)) <= ROUNDED)


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


# a log that grows


@pytest.fixture
def growing(recorded: Path, tmp_path: Path) -> tuple[Path, Callable[[float], None]]:
    """Return a log with half of its bytes so far, and a function that appends a share of the rest."""
    rest, path = recorded.read_bytes(), tmp_path / "growing.mcap"
    half = len(rest) // 2
    path.write_bytes(rest[:half])
    rest = rest[half:]

    def grow(share: float) -> None:
        nonlocal rest
        count = math.ceil(share * len(rest))
        with path.open("ab") as file:
            file.write(rest[:count])
        rest = rest[count:]

    return path, grow


def test_a_log_that_is_being_written_is_followed_to_its_end(
    open_session: OpenSession,
    growing: tuple[Path, Callable[[float], None]],
    recorded: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sonarhw_gui.jobs.files.TORN_AFTER", 1e6)
    path, grow = growing
    session = open_session()
    session.open_file(str(path))
    until(lambda: len(session.shown.readings) > 4)
    first = session.shown.readings
    assert len(first) < ORDER.readings
    assert session.notices.shown.text == ""  # it is not a damaged log
    session.replay.seek_reading(3)  # a position is kept
    grow(0.5)
    until(lambda: activity_text(session.status).startswith("following growing.mcap"))
    assert len(session.shown.readings) == 4
    session.replay.seek(session.replay.duration)  # at the end, it stays there
    grow(1.0)
    until(lambda: len(session.shown.readings) == ORDER.readings)
    expected = [(reading.time, reading.echo_times) for reading in read_log(recorded).readings]
    assert [(reading.time, reading.echo_times) for reading in session.shown.readings] == expected
    assert all(one is other for one, other in zip(first, session.shown.readings, strict=False))
    until(lambda: predicted(session) and activity_text(session.status).startswith("replaying growing.mcap"))


def test_a_torn_log_is_reported(open_session: OpenSession, growing: tuple[Path, Callable[[float], None]]) -> None:
    path, grow = growing
    os.utime(path, (1.0, 1.0))
    session = open_session()
    session.open_file(str(path))
    until(lambda: session.notices.shown.text.startswith("growing.mcap: "))
    kept = len(session.shown.readings)
    assert 0 < kept < ORDER.readings
    assert f"{kept} whole readings are shown; to repair it: `sonarhw log recover`" in session.notices.shown.text
    grow(0.5)  # it is written after all
    until(lambda: len(session.shown.readings) > kept)
    assert session.notices.shown.text == ""


@pytest.fixture
def drive(tmp_path: Path) -> tuple[Path, Scene, FloatArray]:
    """Return the log and the scene of a drive along x in a rectangle of 2 m by 1.6 m, and the 13 values of x.

    The robot has sensors ahead and to the left.
    """
    room = sonarhw.room_from_arrays([[0, 0], [2, 0], [2, 1.6], [0, 1.6]], places={"start": (0.5, 0.7)})
    x = np.linspace(0.5, 1.1, 13)
    poses = np.column_stack((x + 3, np.full(13, 0.7), np.zeros(13)))  # odometry that begins 3 m beside the place
    ranges = np.column_stack((2 - x, np.full(13, 0.9)))
    scan = sonarhw.scan_from_arrays(np.tile([0, math.pi / 2], 13), ranges.ravel(), pose=np.repeat(poses, 2, axis=0))
    board = sonarhw.load_board("paper")
    metadata = sonarhw.LogMetadata("import", 1e9, "room.toml", room.text, "start", board.name, board.text)
    write_scan(tmp_path / "drive.mcap", metadata, scan.readings)
    return tmp_path / "drive.mcap", scene_of_log(metadata, scan.readings), x


def test_a_replay_moves_the_sensor(open_with: OpenWith, drive: tuple[Path, Scene, FloatArray]) -> None:
    path, scene, x = drive
    window = open_with(scene=scene, source=read_log(path))
    session, plan = window.session, window.views.plan.drawing
    until(lambda: session.showing.forecast.compared is not None and session.showing.forecast.uncompared == 0)
    until(lambda: session.shown.compared is not None and session.shown.compared.end == 26)
    keep_pictures(window, "drive")
    at_walls = {k: (2.0, 0.7) if k % 2 == 0 else (x[k // 2], 1.6) for k in range(26)}
    assert drawn(plan.marks) == {k: pytest.approx(point, abs=1e-5) for k, point in at_walls.items()}
    assert {row.kind for row in map(session.shown.row, range(26)) if row} == {Kind.MATCH}
    for reading in (25, 8, 3):
        session.replay.seek_reading(reading)
        until(lambda reading=reading: seen(window) == reading + 1)
        assert session.shown.sensor.position == pytest.approx((x[reading // 2], 0.7))
        assert f"at {(reading % 2) * 90:.1f}°: one reflection" in window.sentence.text()
    session.replay.seek_reading(25)
    window.open_dock("Track")
    until(lambda: seen(window) == 26 and window.track.begin.isEnabled())
    window.track.begin.click()
    until(lambda: session.shown.track is not None)
    until(lambda: plan.track.cloud.getData()[0] is not None and len(plan.track.cloud.getData()[0]))
    keep_pictures(window, "track")
    assert np.allclose(session.shown.track.path, np.column_stack((x, np.full(13, 0.7))), atol=0.03)
    assert "13 updates with 26 readings" in window.track.lines.text()
    session.replay.seek_reading(8)
    until(lambda: len(session.shown.track.path) == 5)


def test_a_robot_is_tracked_while_its_log_grows(
    open_with: OpenWith, drive: tuple[Path, Scene, FloatArray], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sonarhw_gui.jobs.files.TORN_AFTER", 1e6)
    path, scene, x = drive
    rest, growing = path.read_bytes(), tmp_path / "growing.mcap"

    def grow(count: int) -> None:
        nonlocal rest
        with growing.open("ab") as file:
            file.write(rest[:count])
        rest = rest[count:]

    third = len(rest) // 3
    grow(third)
    window = open_with(scene=scene)
    session, track = window.session, window.track
    session.open_file(str(growing))
    until(lambda: len(session.shown.readings) > 2)
    window.open_dock("Track")
    until(track.begin.isEnabled)
    track.begin.click()
    until(lambda: session.shown.track is not None)
    first = session.shown.track.path
    grow(third)
    until(lambda: len(session.shown.track.path) > len(first))
    assert session.shown.track.path[: len(first)].tolist() == first.tolist()  # not tracked again
    grow(len(rest))
    until(lambda: "with 26 readings" in track.lines.text())
    assert session.shown.track.path[-1].tolist() == pytest.approx([x[-1], 0.7], abs=0.03)
