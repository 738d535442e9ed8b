"""Files in the window: opened and dropped, imported, listed, reloaded when they change, and saved."""

import json
import math
import os
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import sonarhw_sim.board
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QTimer, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QDialogButtonBox, QLineEdit, QMessageBox, QPushButton
from sonarhw_cli.app import run
from sonarhw_gui.jobs.files import DATA, PICTURES, Documents, list_recordings, save_file, write_data, write_svg
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.edits import sensor_at, with_corner
from sonarhw_gui.model.scene import Scene, first_place
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.window.dialogs import RecordingsDialog
from sonarhw_gui.window.import_dialog import ImportDialog
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.errors import InputError, OutputError
from sonarhw.log import LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import ORDER, OpenSession, OpenWith
from tests.system.gui.driving import LEFT, activate, dialog_of, enter, key, log_name, predicted, push, until

Ask = Callable[..., ImportDialog]
BOARDS = Path(sonarhw_sim.board.__file__).parent / "shipped"


# opened and dropped


def drop(window: MainWindow, *paths: Path) -> bool:
    """Drop files on the window, to be moved or copied; return whether it accepts them, as copies."""
    data, no_key = QMimeData(), Qt.KeyboardModifier.NoModifier
    data.setUrls([QUrl.fromLocalFile(str(path)) for path in paths])
    both = Qt.DropAction.CopyAction | Qt.DropAction.MoveAction
    entered = QDragEnterEvent(QPoint(200, 200), both, data, LEFT, no_key)
    dropped = QDropEvent(QPointF(200, 200), both, data, LEFT, no_key)
    for event in (entered, dropped):
        event.setDropAction(Qt.DropAction.MoveAction)
        event.ignore()
        QApplication.sendEvent(window, event)
        if not event.isAccepted():
            return False
        assert event.dropAction() is Qt.DropAction.CopyAction
    return True


def test_files_are_dropped_listed_opened_again_and_overwritten_only_after_a_question(
    open_with: OpenWith, recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_with(source=read_log(recorded), source_file=recorded, used=(ROOM, recorded))
    session, recent = window.session, window.files
    assert [action.data() for action in recent.actions()] == [str(recorded), str(ROOM)]
    for name in ("notes.txt", "picture.png"):
        assert not drop(window, tmp_path / name)
    room = tmp_path / "other.toml"
    room.write_text(ROOM.read_text().replace('name = "Simple room"', 'name = "Other room"'))
    session.leave_replay()
    assert drop(window, room, recorded)  # the log is shown in this room
    until(lambda: session.replay is not None and not session.jobs.busy("open files"))
    until(lambda: session.shown.scene.room.name == "Other room")
    assert len(session.shown.readings) == ORDER.readings
    assert f"recorded in {ROOM.name}; they are now compared with other.toml" in window.banner.message
    assert [action.text() for action in recent.actions()] == ["other.toml", recorded.name, ROOM.name]
    session.leave_replay()
    recent.actions()[1].trigger()
    until(lambda: session.replay is not None)
    assert session.documents.recent[0] == str(recorded)

    # a name is proposed that does not exist, in the folder of the log
    window.commands.save_room_as.trigger()
    dialog = dialog_of(window)
    assert dialog.directory().absolutePath() == str(recorded.parent)
    dialog.reject()
    session.leave_replay()
    monkeypatch.setattr(session.documents, "saved_in", tmp_path)
    (tmp_path / "simple-edited.toml").write_text("an older room")
    session.open_room("simple")
    until(lambda: session.shown.scene.room_file == "simple.toml")
    window.commands.save_room_as.trigger()
    dialog = dialog_of(window)
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


@pytest.mark.parametrize(
    ("place", "readings", "message"),
    [
        ("", 1, "its readings are shown at figure7, the first"),
        ("figure9", 1, ""),
        ("figure9", 0, "scan.mcap: contains no readings"),
    ],
)
def test_a_log_without_a_place_or_without_readings_is_opened_with_a_warning(
    open_session: OpenSession, tmp_path: Path, place: str, readings: int, message: str
) -> None:
    metadata = LogMetadata("import", 0.0, ROOM.name, ROOM.read_text(), place)
    write_scan(tmp_path / "scan.mcap", metadata, [Reading(0, 0, 0, 0.0, 0.0, (0.005,), 343.2)] * readings)
    session = open_session()
    session.open_file(str(tmp_path / "scan.mcap"))
    until(lambda: session.replay is not None)
    assert session.shown.scene.place.name == (place or "figure7")
    assert message in session.notices.shown.text
    assert bool(session.notices.shown.text) == bool(message)


def test_a_room_of_another_program_is_imported(open_session: OpenSession, tmp_path: Path) -> None:
    session, drawing = open_session(), tmp_path / "plan.json"
    drawing.write_text('{"type": "LineString", "coordinates": [[0, 0], [3.2, 0], [3.2, 2.4], [0, 2.4], [0, 0]]}')
    session.open_file(str(drawing))
    until(lambda: "give the unit" in session.notices.shown.text)  # Open room… asks for it
    session.open_room(drawing, "m")
    until(lambda: session.shown.scene.room_file == "plan.toml")
    assert len(session.shown.scene.room.walls) == 4
    assert session.shown.scene.pose.position == (1.6, 1.2)  # the middle: the drawing has no place


def test_readings_return_to_their_place(open_session: OpenSession, recorded: Path, tmp_path: Path) -> None:
    without, log = tmp_path / "without.toml", read_log(recorded)
    without.write_text(ROOM.read_text()[: ROOM.read_text().index("[places.figure9]")])
    session = open_session()
    session.open_file(str(recorded))
    until(lambda: session.replay is not None)
    for room, place in ((without, "figure7"), (ROOM, "figure9")):  # figure7 is the first place of both
        session.open_file(str(room))
        until(lambda room=room: session.shown.scene.room_file == room.name)
        assert session.shown.scene.pose.name == place
    session.notices.clear()
    session.show_log(replace(log, metadata=replace(log.metadata, place="0.3,0.3")))
    session.open_room("simple")
    until(lambda: "recorded at place 0.3,0.3; they are now compared from figure9" in session.notices.shown.text)


# imported


@pytest.fixture
def asked(jobs: Jobs, tmp_path: Path, scene: Scene) -> Iterator[Ask]:
    """Return a function that writes a file of another program and asks how to read it."""
    dialogs: list[ImportDialog] = []

    def ask(*lines: str, name: str = "turret.csv") -> ImportDialog:
        (tmp_path / name).write_text("\n".join(lines) + "\n")
        dialogs.append(ImportDialog(tmp_path / name, Shown(scene), jobs, None))
        dialogs[-1].show()
        until(lambda: dialogs[-1].note.text() not in ("", "reading …"))
        return dialogs[-1]

    yield ask
    for dialog in dialogs:
        dialog.reject()


def preview(dialog: ImportDialog) -> list[list[str]]:
    table = dialog.preview
    columns = range(table.columnCount())
    return [[table.item(row, column).text() for column in columns] for row in range(table.rowCount())]


def step_to(choice: QComboBox, text: str) -> None:
    """Choose an entry with the arrow keys."""
    for _ in range(choice.findText(text) - choice.currentIndex()):
        key(choice, "Down")


def test_a_scan_of_another_program_needs_only_enter(open_with: OpenWith, tmp_path: Path, scene: Scene) -> None:
    window, csv = open_with(), tmp_path / "turret.csv"
    assert not window.files.isEnabled()  # no recent file
    for shortcut in ("Ctrl+E", "Ctrl+Shift+E"):
        key(window, shortcut)
        assert "no readings to save" in window.banner.message
    assert dialog_of(window) is None
    csv.write_text("A scan of the cellar\nturret_deg,range_cm\n0,15.4\n90,\n180,77.4\n")
    for command in (window.commands.open_log, window.commands.import_scan):
        command.trigger()
        dialog_of(window).selectFile(str(csv))
        dialog_of(window).accept()
        until(lambda: isinstance(dialog_of(window), ImportDialog))
        assert dialog_of(window).windowTitle() == "Import turret.csv"
        activate(dialog_of(window))
        key(dialog_of(window), "Esc")
        until(lambda: dialog_of(window) is None)
    assert not (tmp_path / "recordings").exists()
    other = tmp_path / "other.txt"
    other.write_text("".join(f"Angle: {k} Distance: {50 + k} cm\n" for k in range(0, 90, 5)))
    assert drop(window, csv, other)
    until(lambda: dialog_of(window) is not None and dialog_of(window).import_button.isEnabled())
    dialog = dialog_of(window)
    assert preview(dialog) == [
        ["A scan of the cellar", "", ""],
        ["turret_deg,range_cm", "", ""],
        ["0,15.4", "0.0°", "0.154 m"],
        ["90,", "90.0°", "no echo"],
        ["180,77.4", "180.0°", "0.774 m"],
    ]
    assert dialog.note.text().startswith("3 readings, 1 without an echo; turntable angles 0.0° to 180.0°, 0.154 m to")
    assert "range in centimetres: 'cm' in the text" in dialog.note.text()
    key(dialog, "Return")
    until(lambda: len(window.session.shown.readings) == 3)
    assert window.session.shown.readings[0].range == pytest.approx(0.154, abs=1e-6)
    assert "turret.csv was imported as turret.mcap" in window.status_bar.currentMessage()
    assert "turret.csv" not in window.banner.message
    log = read_log(tmp_path / "recordings" / "turret.mcap")
    assert len(log.readings) == 3
    assert log.metadata.source == str(csv)
    assert "range in centimetres" in log.metadata.read_as
    assert (window.session.shown.scene.room, window.session.shown.scene.board) == (scene.room, scene.board)
    until(lambda: dialog_of(window) is not None and dialog_of(window).windowTitle() == "Import other.txt")
    until(dialog_of(window).import_button.isEnabled)
    key(dialog_of(window), "Return")
    until(lambda: len(window.session.shown.readings) == 18)
    started = open_with(source_file=csv, more_files=(other,))
    until(lambda: (asked := dialog_of(started)) is not None and asked.windowTitle() == "Import turret.csv")
    dialog_of(started).reject()
    until(lambda: (asked := dialog_of(started)) is not None and asked.windowTitle() == "Import other.txt")
    dialog_of(started).reject()


def test_an_unknown_place_warns_until_it_is_set(open_session: OpenSession, scene: Scene, recorded: Path) -> None:
    room, log = load_room("laboratory"), read_log(recorded)
    session = open_session(scene=replace(scene, room=room, place=first_place(room)))
    session.show_log(replace(log, metadata=replace(log.metadata, place="")), "scan.mcap")
    assert "scan.mcap: the log contains no place" in session.notices.shown.text
    session.showing.edit(*sensor_at(session.shown.scene, (1.3, 0.7)))
    assert "contains no place" not in session.notices.shown.text


def test_every_convention_of_a_table_is_chosen_with_the_keyboard(asked: Ask) -> None:
    dialog, imported = asked("a,b,c", "1,10,500", "2,20,9999", "3,30,700"), []
    dialog.imported.connect(lambda path, scan, pose: imported.append((path, scan, pose)))
    fields = dialog.fields
    assert dialog.note.text().startswith("⚠ ")
    assert not dialog.import_button.isEnabled()
    step_to(fields["heading"], "b")
    until(lambda: "name the columns of both heading and range" in dialog.note.text())
    for name, text in (("range", "c"), ("time", "a"), ("unit", "mm"), ("turn", "clockwise")):
        step_to(fields[name], text)
    enter(dialog.zero, "90")
    QTest.keyClicks(fields["no_echo"], "x")
    assert "'x'; expected a number" in dialog.note.text()
    assert not dialog.import_button.isEnabled()
    fields["no_echo"].selectAll()
    QTest.keyClicks(fields["no_echo"], "9999")
    until(dialog.import_button.isEnabled)
    assert [line[1:] for line in preview(dialog)[1:]] == [
        ["80.0°", "0.500 m"],
        ["70.0°", "no echo"],
        ["60.0°", "0.700 m"],
    ]
    push(dialog.import_button)
    ((path, scan, pose),) = imported
    assert path.name == "turret.csv"
    assert [reading.range is None for reading in scan.readings] == [False, True, False]
    assert scan.readings[2].time - scan.readings[0].time == pytest.approx(2.0, abs=1e-5)
    assert not pose


def offered(dialog: ImportDialog) -> dict[str, QPushButton]:
    """Return the buttons that answer what is doubtful, by their texts."""
    return {button.text(): button for button in dialog.answers.findChildren(QPushButton)}


def test_a_frequent_range_means_no_echo_only_after_the_user_confirms_it(asked: Ask) -> None:
    dialog = asked("turret_deg,range_cm", *(f"{10 * k},{400 if k % 3 else 15.4 + k}" for k in range(12)))
    until(lambda: "400 means no echo" in offered(dialog))
    assert preview(dialog)[2][-1] == "4.000 m"
    push(offered(dialog)["400 means no echo"])
    until(lambda: preview(dialog)[2][-1] == "no echo")
    assert "12 readings, 8 without an echo" in dialog.note.text()
    until(lambda: "400 means no echo" not in offered(dialog))


def test_a_question_is_shown_and_its_field_has_the_focus(asked: Ask) -> None:
    dialog = asked("angle,range", *(f"{5 * k},{50 + k * 7 % 31}" for k in range(12)))
    assert "fits centimetres and inches: choose “Unit of the range” cm or in" in dialog.note.text()
    assert not dialog.import_button.isEnabled()
    push(offered(dialog)["Unit of the range: cm"])
    until(dialog.import_button.isEnabled)
    assert dialog.fields["unit"].currentText() == "cm"
    push(offered(dialog)["Headings increase: clockwise"])
    until(lambda: "angles grow clockwise" in dialog.note.text())
    dialog = asked(*(f"{k % 7};{20 + k * 7 % 31}" for k in range(20)), name="pattern.log")
    for field in ("heading", "range"):
        assert dialog.fields[field].isVisible()
    assert not dialog.fields["rate"].isVisible()
    dialog = asked("0.1 0.2 0.1", "0.1 0.3 0.1", name="traces.npy")
    until(lambda: "the sampling rate is not stated; add “Sampling rate, Hz” HZ" in dialog.note.text())
    assert dialog.fields["rate"].isVisible()
    assert not dialog.fields["heading"].isVisible()


def test_a_capture_is_read_with_a_pattern_of_the_user(asked: Ask) -> None:
    dialog = asked(*(f"<{k}|{300 + k}|7>" for k in range(9)), name="putty.log")
    QTest.keyClicks(dialog.fields["pattern"], "<{deg}|{mm}|{-}>")
    until(dialog.import_button.isEnabled)
    assert preview(dialog)[1] == ["<1|301|7>", "1.0°", "0.301 m"]


def test_the_points_are_drawn_in_the_room_before_the_import(asked: Ask, scene: Scene) -> None:
    dialog = asked("deg,range_cm", *(f"{k},20" for k in range(0, 360, 30)))
    drawn = dialog.plan.shown
    assert drawn.scene is scene
    assert {round(reading.range, 3) for reading in drawn.readings} == {0.2}
    step_to(dialog.fields["unit"], "mm")
    until(lambda: {round(reading.range, 3) for reading in dialog.plan.shown.readings} == {0.02})


def test_an_opened_log_is_checked_as_every_scan(open_with: OpenWith, tmp_path: Path) -> None:
    window = open_with()
    log = written_log(tmp_path, [0.4 + 0.01 * k if k % 3 else 4.0 for k in range(24)])
    window.session.open_file(str(log))
    until(lambda: "8 of 24 readings have a range of exactly 4 m" in window.banner.message)
    assert "sonarhw import FILE --no-echo 4" in window.banner.message


def written_log(folder: Path, ranges: list[float]) -> Path:
    """Write a log with these ranges (m), 5° apart."""
    readings = [
        Reading(k, 0, 0, math.radians(5 * k), 0.1 * k, (2 * distance / 343.0,), 343.0)
        for k, distance in enumerate(ranges)
    ]
    write_scan(folder / "clamped.mcap", LogMetadata("scan", 1e9, board="hc-sr04"), readings)
    return folder / "clamped.mcap"


# recordings


def test_recordings_are_listed_and_opened(open_with: OpenWith, jobs: Jobs, recorded: Path, tmp_path: Path) -> None:
    folder, log = tmp_path / "recordings", read_log(recorded)
    empty = RecordingsDialog(folder, jobs, None)
    assert "no recordings yet" in empty.summary.text()
    assert not empty.open_button.isEnabled()
    folder.mkdir()
    shutil.copy(recorded, folder / "today.mcap")
    cellar = log.metadata.room_text.replace('name = "Simple room"', 'name = "Cellar"')
    older = replace(log.metadata, started=log.metadata.started - 86_400, room_text=cellar)
    write_scan(folder / "cellar.mcap", older, log.readings[:7])
    (folder / "broken.mcap").write_text("no log")
    os.utime(folder / "broken.mcap", (0, 0))

    window = open_with(recordings=folder)
    key(window, "Ctrl+Shift+O")
    dialog = dialog_of(window)
    activate(dialog)
    until(lambda: dialog.table.rowCount() == 3)
    rows = [[dialog.table.item(row, column).text() for column in range(7)] for row in range(3)]
    assert rows[0][1:] == ["Simple room", "figure9", str(ORDER.readings), "yes", "today.mcap", "whole"]
    assert rows[1][1:6] == ["Cellar", "figure9", "7", "yes", "cellar.mcap"]
    assert "is not an MCAP file" in rows[2][6]
    assert rows[0][0] > rows[1][0]
    assert "3 recordings" in dialog.summary.text()
    QTest.keyClicks(dialog.search, "cellar fig")
    assert [dialog.table.isRowHidden(number) for number in range(3)] == [True, False, True]
    assert not dialog.open_button.isEnabled()
    dialog.table.selectRow(1)
    push(dialog.open_button)
    until(lambda: len(window.session.shown.readings) == 7 and dialog_of(window) is None)
    assert window.session.shown.scene.room.name == "Cellar"
    for pressed, name in (("Esc", "cellar.mcap"), ("Return", "today.mcap")):  # of the newest
        window.commands.show_recordings.trigger()
        until(lambda: dialog_of(window) is not None and dialog_of(window).table.rowCount() == 3)
        dialog_of(window).search.clear()
        dialog_of(window).table.selectRow(0)
        key(dialog_of(window), pressed)
        until(lambda name=name: dialog_of(window) is None and log_name(window) == name)
    window.commands.show_recordings.trigger()
    window.close()  # open_with checks that no thread is left

    rows, files = list_recordings(folder)
    while len(rows) < files:
        rows, files = list_recordings(folder, rows)
    again, _ = list_recordings(folder, rows)
    assert [id(row) for row in again] == [id(row) for row in rows]  # unchanged ones are not read again
    (folder / "today.mcap").unlink()
    assert [row.path.name for row in list_recordings(folder, rows)[0]] == ["cellar.mcap", "broken.mcap"]


# changed by another program


def open_own(session: WindowSession, path: Path) -> None:
    """Open a copy of the simple room in a file of its own."""
    path.write_text(ROOM.read_text())
    session.open_file(str(path))
    until(lambda: session.shown.scene.room_file == path.name)


def test_a_changed_room_or_board_is_reloaded_on_request(open_with: OpenWith, tmp_path: Path) -> None:
    window, path, board = open_with(), tmp_path / "own.toml", tmp_path / "mine.toml"
    session = window.session
    open_own(session, path)
    session.showing.set_place("figure7")
    path.write_text(ROOM.read_text().replace("0.742", "1.742"))
    until(window.banner.isVisible)
    assert "own.toml has changed on disk" in window.banner.message
    assert session.shown.scene.room.walls.max() < 1
    push(window.banner.accept_button)
    until(lambda: session.shown.scene.room.walls.max() > 1.7)
    assert session.shown.scene.pose.name == "figure7"
    assert window.views.plan.drawing.plot.vb.viewRect().bottom() > 1.742
    shutil.copy(BOARDS / "hc-sr04.toml", board)
    session.open_board(str(board))
    assert session.shown.scene.board.max_range == load_board("hc-sr04").max_range
    board.write_text((BOARDS / "lego-nxt.toml").read_text())
    until(window.banner.isVisible)
    push(window.banner.accept_button)
    until(lambda: session.shown.scene.board.max_range == load_board("lego-nxt").max_range)


@pytest.fixture
def edited(open_session: OpenSession, tmp_path: Path) -> tuple[WindowSession, Path]:
    """Return a session with a moved corner in a room file of its own, and the file."""
    session, path = open_session(memory=tmp_path / "data" / "window.ini"), tmp_path / "own.toml"
    open_own(session, path)
    session.showing.edit(*with_corner(session.shown.scene, 0, (0.4, -0.05)))
    return session, path


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.742", "1.742", "own.toml was changed outside: line"),
        ('name = "Simple room"', "name = 3", "it is not a valid room: own.toml: name"),
    ],
)
def test_a_changed_room_file_is_kept(edited: tuple[WindowSession, Path], old: str, new: str, said: str) -> None:
    session, path = edited
    theirs, notices = ROOM.read_text().replace(old, new), session.notices
    path.write_text(theirs)
    session.save_room_again()
    assert "not saved" in notices.shown.text
    assert said in notices.shown.text
    assert path.read_text() == theirs
    notices.accept()
    assert path.read_text() == session.shown.scene.written_room.text
    assert (path.parent / "own-before.toml").read_text() == theirs
    assert "own-before.toml" in notices.shown.text
    session.save_room_again()  # it is the content of this session now
    assert not (path.parent / "own-before_2.toml").exists()
    path.unlink()
    session.save_room_again()  # a removed file is written again
    assert path.read_text() == session.shown.scene.written_room.text


def test_a_changed_room_file_is_reloaded_and_edits_are_restored(edited: tuple[WindowSession, Path]) -> None:
    session, path = edited
    mine = session.shown.scene.room.text
    path.write_text(ROOM.read_text().replace("0.742", "1.742"))
    session.save_room_again()
    session.notices.decline()
    until(lambda: session.shown.scene.room.walls.max() > 1.7)
    until(lambda: "own.toml has unsaved changes" in session.notices.shown.text)
    session.notices.accept()
    assert session.shown.scene.room.text == mine


# saved


def save(window: MainWindow, path: Path, shortcut: str) -> None:
    """Press the keys, enter a file name and click Save; the caller checks the file."""
    key(window, shortcut)
    until(lambda: dialog_of(window) is not None)
    field = dialog_of(window).findChild(QLineEdit, "fileNameEdit")
    field.setText(str(path))  # with typed letters Qt's completer would change the name
    push(dialog_of(window).findChild(QDialogButtonBox).button(QDialogButtonBox.StandardButton.Save))
    until(lambda: not window.session.jobs.busy("save files"))


def test_views_and_the_window_are_saved_as_png_pdf_and_svg(window: MainWindow, tmp_path: Path) -> None:
    measured = window.session.shown.look.palette.measured.lower()
    for shortcut, view, drawn in (
        ("Ctrl+P", "plan", (False, True, False)),
        ("Ctrl+Alt+T", "trace", (True, False, False)),
        ("Ctrl+Alt+R", "ranges", (False, False, False)),
    ):
        save(window, tmp_path / f"{view}.png", shortcut)
        image, shown = QImage(str(tmp_path / f"{view}.png")), getattr(window.views, view).picture()
        assert image.width() == 2 * shown.width()
        assert image.height() > 2 * shown.height()
        pixels = ((x, y) for x in range(0, image.width(), 3) for y in range(0, image.height(), 3))
        assert any(image.pixelColor(x, y).name() == measured for x, y in pixels)
        save(window, tmp_path / f"{view}.svg", shortcut)
        svg = ElementTree.parse(tmp_path / f"{view}.svg").getroot()
        assert svg.tag.endswith("svg")
        assert any("Simple room · place figure9" in (element.text or "") for element in svg.iter())
        assert window.status_bar.currentMessage() == f"saved: {tmp_path / f'{view}.svg'}"
        explained = " ".join(filter(None, (element.text for element in svg.iter())))
        assert ("threshold" in explained, "turntable zero" in explained, "pointer" in explained) == drawn
        save(window, tmp_path / f"{view}.pdf", shortcut)
        page = (tmp_path / f"{view}.pdf").read_bytes()
        ((width, height),) = re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", page)  # one page
        assert float(width) / float(height) == pytest.approx(image.width() / image.height(), rel=0.01)
    save(window, tmp_path / "window.png", "Ctrl+Shift+P")
    image = QImage(str(tmp_path / "window.png"))
    assert (image.width(), image.height()) == (2 * window.width(), 2 * window.height())

    # clipped to the plot, and without an effect that only browsers support
    drawing = ElementTree.parse(tmp_path / "plan.svg").getroot()
    (inside,) = (element for element in drawing.iter() if element.tag.endswith("}svg") and element is not drawing)
    assert inside.get("overflow") == "hidden"
    paths = [element for element in drawing.iter() if element.tag.endswith(("path", "polyline"))]
    assert 0 < len([element for element in inside.iter() if element in paths]) < len(paths)
    assert window.views.plan.drawing.plot.vb.childGroup.opacity() == 1.0
    assert "vector-effect" not in (tmp_path / "plan.svg").read_text()
    assert not [element for element in inside.iter() if element.tag.endswith("image")]  # marks are shapes

    before = window.views.stage.width()
    key(window, "2")
    until(lambda: window.views.stage.width() > before)
    save(window, tmp_path / "both.png", "Ctrl+P")
    assert QImage(str(tmp_path / "both.png")).width() == 2 * window.views.side_by_side.width()


def test_exported_data_equal_those_of_the_command(window: MainWindow, recorded: Path, tmp_path: Path) -> None:
    log = Path(shutil.copy(recorded, tmp_path / "scan.mcap"))
    window.session.open_file(str(log))
    until(lambda: log_name(window) == "scan.mcap" and predicted(window))
    window.session.showing.pin(27, "false wall, 3 bounces")
    window.commands.export_data.trigger()
    assert dialog_of(window).directory().absolutePath() == str(tmp_path)  # of the log, then the last one used
    dialog_of(window).close()
    (tmp_path / "out").mkdir()
    for ending in (".csv", ".npz", ".json"):
        save(window, tmp_path / "out" / f"saved{ending}", "Ctrl+E")
    saved, exported = tmp_path / "out" / "saved.csv", tmp_path / "exported.csv"
    for ending in (".csv", ".npz"):
        assert run(["log", "export", str(log), "--out", str(exported.with_suffix(ending))]) == 0
    assert saved.read_bytes() == exported.read_bytes()
    header, *lines = saved.read_text().splitlines()
    assert (header.endswith(",note"), len(lines)) == (True, ORDER.readings)
    assert [place for place, line in enumerate(lines) if line.endswith(',"false wall, 3 bounces"')] == [27]
    with np.load(saved.with_suffix(".npz")) as one, np.load(exported.with_suffix(".npz")) as other:
        assert one.files == other.files
        numbers = [name for name in one.files if name != "notes"]
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in numbers)
        assert {k: text for k, text in enumerate(one["notes"]) if text} == {27: "false wall, 3 bounces"}
    assert json.loads(saved.with_suffix(".json").read_text())["n"] == ORDER.readings

    window.commands.save_report.trigger()
    assert dialog_of(window).directory().absolutePath() == str(tmp_path / "out")
    dialog_of(window).close()
    save(window, tmp_path / "scan.html", "Ctrl+Shift+E")
    report = (tmp_path / "scan.html").read_text()
    assert "<h1>Simple room, place figure9</h1>" in report
    assert "false wall, 3 bounces" in report
    assert len(re.findall(r"data:image/", report)) == 3
    assert report.count("<tr><td>") >= ORDER.readings

    mine, questions = tmp_path / "mine.csv", []
    mine.write_text("mine")

    def say_no() -> None:
        question = QApplication.activeModalWidget()
        if isinstance(question, QMessageBox):
            questions.append(question.text())
            push(question.button(QMessageBox.StandardButton.No))
        else:
            QTimer.singleShot(20, say_no)

    QTimer.singleShot(20, say_no)
    save(window, mine, "Ctrl+E")
    assert (len(questions), mine.read_text()) == (1, "mine")
    dialog_of(window).close()


def test_ctrl_s_saves_an_edited_room_in_its_file_or_asks_for_a_name(open_with: OpenWith, tmp_path: Path) -> None:
    window, file = open_with(), tmp_path / "mine.toml"
    key(window, "Ctrl+S")
    until(lambda: dialog_of(window) is not None)
    assert dialog_of(window).windowTitle() == "Save room as"
    dialog_of(window).close()
    open_own(window.session, file)
    assert window.windowTitle().endswith(" — mine.toml[*]")
    own, before = set(window.session.shown.scene.room.places), window.session.shown.scene.pose.position
    for step in (1, 2):  # the file has no places that the sensor was moved to before
        key(window, "Shift+Up")
        assert window.isWindowModified()
        key(window, "Ctrl+S")
        until(lambda: not window.isWindowModified())
        room, name = load_room(file), window.session.shown.scene.pose.name
        assert room.place(name).position == pytest.approx((before[0], before[1] + 0.01 * step))
        assert set(room.places) == set(window.session.shown.scene.room.places) == {*own, name}
    assert dialog_of(window) is None


def test_for_a_live_scan_the_dialog_opens_in_the_last_folder_but_not_in_the_recordings(tmp_path: Path) -> None:
    recordings, rooms = tmp_path / "recordings", tmp_path / "rooms"
    for folder in (recordings, rooms):
        folder.mkdir()
    documents, scan = Documents(recordings), str(recordings / "scan.mcap")
    assert documents.folder(scan) == Path.home()
    documents.recent = (scan, str(tmp_path / "gone" / "a.toml"), str(rooms / "b.toml"))
    assert documents.folder(scan) == rooms


def test_no_file_is_overwritten_without_permission(recorded: Path, scene: Scene, tmp_path: Path) -> None:
    mine, link, new = tmp_path / "mine.csv", tmp_path / "plan.svg", tmp_path / "new.svg"
    mine.write_text("mine")
    link.symlink_to(mine)
    data, svg = partial(write_data, recorded, scene, (), ".csv"), partial(write_svg, "<svg/>")
    for write, endings, path, overwrite, message in (
        (data, DATA, mine, False, "exists already"),
        (data, DATA, tmp_path / "a.xlsx", False, f"expected a name ending in {' or '.join(map(re.escape, DATA))}"),
        (svg, PICTURES, link, True, r"plan\.svg: is a link to .*mine\.csv"),
    ):
        with pytest.raises(InputError, match=message):
            save_file(write, endings, path, overwrite=overwrite)
    with pytest.raises(OutputError, match="exists already"):  # it appears while the picture is drawn
        save_file(lambda _: new.write_text("new"), PICTURES, new, overwrite=False)
    kept = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert kept == {"mine.csv": "mine", "plan.svg": "mine", "new.svg": "new"}


def test_a_failed_write_is_reported(open_session: OpenSession, recorded: Path, scene: Scene, tmp_path: Path) -> None:
    session = open_session()
    write = partial(write_data, recorded, scene, (), ".csv")
    for path in ("nowhere/a.csv", "b.csv", "c.csv"):
        session.save(write, DATA, tmp_path / path)
    until(lambda: not session.jobs.busy("save files"))
    assert "nowhere" in session.notices.shown.text
    assert sorted(path.name for path in tmp_path.glob("*.csv")) == ["b.csv", "c.csv"]
