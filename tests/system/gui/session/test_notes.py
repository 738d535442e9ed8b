"""Notes on readings: added, edited, deleted and undone by keys and mouse; kept beside the log, and never lost."""

import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QContextMenuEvent
from PySide6.QtWidgets import QApplication, QLineEdit
from pytestqt.qtbot import QtBot
from sonarhw_cli.app import run
from sonarhw_compare.scans import notes_of_log, notes_path
from sonarhw_gui.model.rows import Column
from sonarhw_gui.session.kept import NoteStore
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.window.window import MainWindow

from sonarhw.errors import OutputError
from sonarhw.log import read_log
from tests.system.gui.conftest import OpenFake, OpenWith
from tests.system.gui.driving import dialog_of, ended, pixel_at, position_of, predicted, until
from tests.system.gui.session.test_saving import save

SHIFT, CONTROL = Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def log(recorded: Path, tmp_path: Path) -> Path:
    (tmp_path / "bench").mkdir()
    return Path(shutil.copy(recorded, tmp_path / "bench" / "scan.mcap"))


def opened(qtbot: QtBot, open_with: OpenWith, log: Path, **start: object) -> MainWindow:
    window = open_with(source=read_log(log), source_name=log.name, source_file=log, **start)
    until(qtbot, lambda: predicted(window))
    return window


def stored(log: Path) -> dict[int, str]:
    return notes_of_log(log, read_log(log).readings).texts


def note(qtbot: QtBot, window: MainWindow, reading: int, text: str) -> None:
    """Select a reading, press N, type the text and press Enter."""
    window.session.showing.choose(reading)
    qtbot.keyClick(window, Qt.Key.Key_N)
    field = dialog_of(window).findChild(QLineEdit)
    field.selectAll()
    qtbot.keyClick(field, Qt.Key.Key_Delete)
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)


def test_a_note_is_written_at_once_edited_deleted_and_undone(qtbot: QtBot, open_with: OpenWith, log: Path) -> None:
    window, before = opened(qtbot, open_with, log), log.read_bytes()
    note(qtbot, window, 27, "false wall")
    assert stored(log) == {27: "false wall"}
    assert window.bounces.text().startswith("note: false wall — 1 bottom")
    assert window.commands.edit_note.text() == "Edit note…"
    note(qtbot, window, 27, "false wall, 3 bounces")
    note(qtbot, window, 9, "the post")
    assert stored(log) == {9: "the post", 27: "false wall, 3 bounces"}
    window.session.showing.choose(27)
    qtbot.keyClick(window, Qt.Key.Key_N, SHIFT)
    assert stored(log) == {9: "the post"}
    assert window.commands.undo.text() == "Undo deleting a note"
    for expected in ({9: "the post", 27: "false wall, 3 bounces"}, {27: "false wall, 3 bounces"}, {27: "false wall"}):
        qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL)
        assert stored(log) == expected
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL)
    assert not notes_path(log).exists()
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL | SHIFT)
    assert stored(log) == {27: "false wall"}
    assert log.read_bytes() == before


def test_the_next_window_shows_the_notes_in_plan_ranges_table_and_report(
    qtbot: QtBot, open_with: OpenWith, log: Path, tmp_path: Path
) -> None:
    note(qtbot, opened(qtbot, open_with, log), 4, "edge of the board")
    window = opened(qtbot, open_with, log)
    plan, ranges, table = window.views.plan.drawing, window.views.ranges, window.views.table
    for marks in (plan._marks, ranges._marks[0]):
        assert list(zip(*marks.notes.getData(), strict=True)) == [position_of(marks, 4)]
        assert marks.notes.isVisible()
    assert "note" in window.legend.explained
    assert window.legend.explained["note"].isVisible()
    assert not table.view.isColumnHidden(Column.NOTE)
    assert table.noted.text() == "1 note"
    qtbot.mouseClick(table.noted, Qt.MouseButton.LeftButton)
    assert table.model.order.tolist() == [4]
    qtbot.mouseClick(table.noted, Qt.MouseButton.LeftButton)
    qtbot.keyClicks(table.words, "board")
    assert table.model.order.tolist() == [4]
    table.words.clear()
    window.commands.save_report.trigger()
    dialog_of(window).fileSelected.emit(str(tmp_path / "report.html"))
    until(qtbot, lambda: not window.session.jobs.busy("save files"))
    assert "edge of the board" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize("name", ["plan", "ranges", "table"])
def test_the_context_menu_notes_the_reading_below_the_mouse(
    qtbot: QtBot, open_with: OpenWith, log: Path, name: str
) -> None:
    window = opened(qtbot, open_with, log)
    table, plan, ranges = window.views.table, window.views.plan.drawing, window.views.ranges
    if name == "table":
        reading, below = 2, table.view.viewport()
        at = table.view.visualRect(table.model.index(reading, Column.HEADING)).center()
    else:
        view, box, marks = (
            (plan, plan.plot.vb, plan._marks) if name == "plan" else (ranges, ranges.ranges.vb, ranges._marks[0])
        )
        seen = [
            k
            for points, places in marks.placed.values()
            for k, at in zip(points.readings, places, strict=True)
            if box.viewRect().contains(QPointF(*at))
        ]
        reading, below = seen[0], view.viewport()
        at = pixel_at(view, box, position_of(marks, reading))
    qtbot.mouseClick(below, Qt.MouseButton.RightButton, pos=at)
    QApplication.sendEvent(below, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, below.mapToGlobal(at)))
    menu = QApplication.activePopupWidget()
    assert window.session.shown.chosen == reading
    next(action for action in menu.actions() if action.text() == "Add note…").trigger()
    menu.close()
    field = dialog_of(window).findChild(QLineEdit)
    qtbot.keyClicks(field, name)
    qtbot.keyClick(field, Qt.Key.Key_Return)
    assert stored(log) == {reading: name}


def test_notes_of_a_live_scan_are_kept_beside_its_recording(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, recorded: Path
) -> None:
    window = open_with(source=fake("max"))
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and len(window.session.shown.readings) == 36)
    note(qtbot, window, 5, "while it was new")
    recording = Path(window.session.log_file)
    assert stored(recording) == {5: "while it was new"}
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.replay is not None)
    assert not window.session.shown.notes
    assert "note" not in window.commands.undo.text()  # its readings are no longer shown
    window.commands.leave_replay.trigger()
    assert window.session.shown.notes.of(5) == "while it was new"
    window.commands.scan.trigger()
    assert not window.session.shown.notes
    until(qtbot, lambda: ended(window))
    assert stored(recording) == {5: "while it was new"}


def test_a_folder_that_cannot_be_written_gives_one_line_and_loses_no_note(
    qtbot: QtBot, open_with: OpenWith, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sonarhw_compare.scans as note_file

    write = note_file.atomic_file

    def refuse(path: Path, *arguments: object, **options: object) -> object:
        if path.parent == log.parent:
            raise OutputError(f"{path}: Read-only file system; choose another folder for the log")
        return write(path, *arguments, **options)

    memory = tmp_path / "state" / "window.ini"
    window = opened(qtbot, open_with, log, memory=memory)
    warned: list[str] = []
    notices = window.session.notices
    notices.changed.connect(lambda: warned.append(notices.shown.text))
    with monkeypatch.context() as patch:  # tests run as root, who may write everywhere
        patch.setattr(note_file, "atomic_file", refuse)
        note(qtbot, window, 4, "on a stick")
        note(qtbot, window, 5, "another")
        window.session.tick()
    assert len([text for text in warned if text]) == 1
    assert "scan.notes.csv: Read-only file system" in warned[-1]
    assert f"keeps the notes in {tmp_path / 'state' / 'unsaved'} meanwhile" in warned[-1]
    assert not notes_path(log).exists()
    window.close()
    again = opened(qtbot, open_with, log, memory=memory)
    assert dict(again.session.shown.notes.by_reading) == {4: "on a stick", 5: "another"}
    note(qtbot, again, 6, "third")
    assert stored(log) == {4: "on a stick", 5: "another", 6: "third"}
    assert not list((tmp_path / "state" / "unsaved").glob("*.csv"))


@pytest.mark.parametrize("content", [b"not,notes\n1,2\n", b"\x00\xff" * 40])
def test_a_foreign_notes_file_is_kept_and_named_in_one_line(
    qtbot: QtBot, open_with: OpenWith, log: Path, content: bytes
) -> None:
    notes_path(log).write_bytes(content)
    window = opened(qtbot, open_with, log)
    until(qtbot, lambda: "scan.notes.csv" in window.banner.message)
    window.banner.close_button.click()
    note(qtbot, window, 4, "mine")
    until(qtbot, lambda: "the notes are lost when the window closes" in window.banner.message)
    assert window.session.shown.notes.of(4) == "mine"
    assert notes_path(log).read_bytes() == content
    notes_path(log).unlink()
    note(qtbot, window, 5, "second")
    assert stored(log) == {4: "mine", 5: "second"}


def test_a_dialog_about_a_reading_that_is_gone_changes_nothing(
    qtbot: QtBot, open_with: OpenWith, log: Path, recorded: Path
) -> None:
    window = opened(qtbot, open_with, log)
    window.session.showing.choose(3)
    qtbot.keyClick(window, Qt.Key.Key_N)
    qtbot.keyClicks(dialog_of(window).findChild(QLineEdit), "too late")
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.log_file == os.path.abspath(recorded))
    dialog_of(window).accept()
    assert not window.session.shown.notes
    until(qtbot, lambda: "too late" in window.banner.message)
    assert not notes_path(recorded).exists()


def test_the_note_commands_are_in_the_palette_and_off_without_a_reading(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    until(qtbot, lambda: predicted(window))
    assert not window.commands.edit_note.isEnabled()
    assert not window.commands.delete_note.isEnabled()


def test_exports_contain_the_notes_as_those_of_the_command_line(
    qtbot: QtBot, open_with: OpenWith, log: Path, tmp_path: Path
) -> None:
    window = opened(qtbot, open_with, log)
    note(qtbot, window, 27, "false wall, 3 bounces")
    for ending in (".csv", ".npz"):
        save(qtbot, window, tmp_path / f"saved{ending}", Qt.Key.Key_E)
        assert run(["log", "export", str(log), "--out", str(tmp_path / f"exported{ending}")]) == 0
    assert (tmp_path / "saved.csv").read_text() == (tmp_path / "exported.csv").read_text()
    lines = (tmp_path / "saved.csv").read_text().splitlines()
    assert lines[0].endswith(",note")
    assert [place for place, line in enumerate(lines[1:]) if line.endswith(',"false wall, 3 bounces"')] == [27]
    for name in ("saved", "exported"):
        with np.load(tmp_path / f"{name}.npz") as arrays:
            assert {place: text for place, text in enumerate(arrays["notes"]) if text} == {27: "false wall, 3 bounces"}


def test_notes_of_a_scan_without_a_log_are_lost_with_one_warning(recorded: Path) -> None:
    notices, warned = Notices(), []
    notices.changed.connect(lambda: warned.append(notices.shown.text))
    readings, store = read_log(recorded).readings, NoteStore(None, notices)
    notes = store.open(None, readings).with_note(2, "the post")
    store.save(notes, readings, None)
    assert "this scan has no log, and its notes are lost when the window closes" in warned[0]
    store.save(notes.with_note(3, "another"), readings, None)
    assert len(warned) == 1
