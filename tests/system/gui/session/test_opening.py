"""Files are opened by drag and drop and from the recent files; errors are reported."""

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QTimer, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QApplication, QFileDialog, QMessageBox
from pytestqt.qtbot import QtBot
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import until

LEFT, NO_KEY = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier


def drop(window: MainWindow, *paths: Path) -> bool:
    """Drop files on the window, and return whether it accepts them."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    enter = QDragEnterEvent(QPoint(200, 200), Qt.DropAction.CopyAction, data, LEFT, NO_KEY)
    enter.ignore()
    QApplication.sendEvent(window, enter)
    if enter.isAccepted():
        QApplication.sendEvent(window, QDropEvent(QPointF(200, 200), Qt.DropAction.CopyAction, data, LEFT, NO_KEY))
    return enter.isAccepted()


def test_a_dropped_log_is_shown(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with()
    assert drop(window, recorded)
    until(qtbot, lambda: len(window.session.shown.readings) == ORDER.readings)
    assert window.session.status.replay is not None


@pytest.mark.parametrize(("place", "warning"), [("", "its readings are shown at figure7, the first"), ("figure9", "")])
def test_a_log_without_a_place_is_shown_at_the_first_place_with_a_warning(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path, place: str, warning: str
) -> None:
    metadata = LogMetadata("import", 0.0, ROOM.name, ROOM.read_text(), place)
    write_scan(tmp_path / "scan.mcap", metadata, [Reading(0, 0, 0, 0.0, 0.0, (0.005,), 343.2)])
    window = open_with()
    assert drop(window, tmp_path / "scan.mcap")
    until(qtbot, lambda: window.session.replay is not None)
    assert window.session.shown.scene.place.name == (place or "figure7")
    assert warning in window.banner.message
    assert bool(window.banner.message) == bool(warning)


def test_a_log_without_readings_says_so(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    metadata = LogMetadata("import", 0.0, ROOM.name, ROOM.read_text(), "figure9")
    write_scan(tmp_path / "scan.mcap", metadata, [])
    window = open_with()
    assert drop(window, tmp_path / "scan.mcap")
    until(qtbot, lambda: window.session.replay is not None)
    assert "scan.mcap: contains no readings" in window.banner.message


def test_a_log_dropped_with_a_room_is_shown_in_this_room(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    room = tmp_path / "other.toml"
    room.write_text(ROOM.read_text().replace('name = "Simple room"', 'name = "Other room"'))
    window = open_with()
    assert drop(window, room, recorded)
    until(qtbot, lambda: window.session.replay is not None and not window.session.jobs.busy("open files"))
    until(qtbot, lambda: window.session.shown.scene.room.name == "Other room")
    assert len(window.session.shown.readings) == ORDER.readings
    assert f"recorded in {ROOM.name}; they are now compared with other.toml" in window.banner.message


def test_readings_are_compared_from_their_place_when_their_room_is_opened_again(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    places = ROOM.read_text().index("[places.figure9]")
    without = tmp_path / "without.toml"
    without.write_text(ROOM.read_text()[:places])
    window = open_with()
    session = window.session
    session.open_file(str(recorded))
    until(qtbot, lambda: session.replay is not None)
    for room, place in ((without, "figure7"), (ROOM, "figure9")):  # figure7 is the first place of both
        session.open_file(str(room))
        until(qtbot, lambda room=room: session.shown.scene.room_file == room.name)
        assert session.shown.scene.pose.name == place


def test_a_log_of_a_place_that_its_room_does_not_name_is_compared_with_a_warning(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    log = read_log(recorded)
    moved = replace(log, metadata=replace(log.metadata, place="0.3,0.3"))
    window = open_with(source=moved)
    window.session.open_room("simple")
    until(qtbot, lambda: window.banner.message != "")
    assert "recorded at place 0.3,0.3; they are now compared from figure9" in window.banner.message


def test_a_room_is_saved_under_a_new_name_and_overwrites_only_after_a_question(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    (tmp_path / "simple-edited.toml").write_text("an older room")
    window = open_with()
    window.commands.save_room_as.trigger()
    dialog = window.findChild(QFileDialog)
    assert dialog.selectedFiles() == [str(tmp_path / "simple-edited-2.toml")]
    questions: list[str] = []

    def refuse() -> None:
        question = QApplication.activeModalWidget()
        assert isinstance(question, QMessageBox)
        questions.append(question.text())
        question.button(QMessageBox.StandardButton.No).click()

    dialog.selectFile("simple-edited.toml")
    QTimer.singleShot(0, refuse)
    dialog.accept()
    assert "already exists" in questions[0]
    assert (tmp_path / "simple-edited.toml").read_text() == "an older room"
    dialog.reject()


@pytest.mark.parametrize("name", ["notes.txt", "picture.png"])
def test_unsupported_files_are_not_accepted(open_with: OpenWith, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("text")
    assert not drop(open_with(), tmp_path / name)


def test_a_room_of_another_program_is_imported(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    drawing = tmp_path / "plan.json"
    drawing.write_text('{"type": "LineString", "coordinates": [[0, 0], [3.2, 0], [3.2, 2.4], [0, 2.4], [0, 0]]}')
    window = open_with()
    assert drop(window, drawing)
    until(qtbot, lambda: "give the unit" in window.banner.message)  # Open room… asks for it
    window.session.open_room(drawing, "m")
    until(qtbot, lambda: window.session.shown.scene.room_file == "plan.toml")
    assert window.session.shown.scene.room is not None
    assert len(window.session.shown.scene.room.walls) == 4


def test_files_named_on_the_command_line_are_recent_files(open_with: OpenWith, tmp_path: Path, recorded: Path) -> None:
    window = open_with(source=read_log(recorded), source_file=recorded, used=(ROOM, recorded))
    assert [action.data() for action in window.files.actions()] == [str(recorded), str(ROOM)]


def test_recent_files_are_listed_newest_first_and_open_with_a_click(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    room = tmp_path / "small.toml"
    room.write_text(ROOM.read_text())
    window = open_with()
    assert not window.files.isEnabled()
    for path in (recorded, room):
        window.session.open_file(str(path))
        until(qtbot, lambda path=path: str(path) in window.session.documents.recent)
    assert [action.text() for action in window.files.actions()] == ["small.toml", recorded.name]
    window.session.leave_replay()
    window.files.actions()[1].trigger()
    until(qtbot, lambda: window.session.replay is not None)
    assert window.session.documents.recent[0] == str(recorded)
