"""The list of recordings: newest first, with room and readings, filtered by words, opened by key or mouse."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs.files import list_recordings
from sonarhw_gui.window.dialogs import RecordingsDialog
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from sonarhw.log.writer import write_scan
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import activate, dialog_of, until

CTRL_SHIFT = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier


@pytest.fixture
def folder(recorded: Path, tmp_path: Path) -> Path:
    """A scan of today, an older and shorter one of the cellar, and a file that is not a log."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    shutil.copy(recorded, folder / "today.mcap")
    log = read_log(recorded)
    cellar = log.metadata.room_text.replace('name = "Simple room"', 'name = "Cellar"')
    made = replace(log.metadata, started=log.metadata.started - 86_400, room_text=cellar)
    write_scan(folder / "cellar.mcap", made, log.readings[:7])
    (folder / "broken.mcap").write_text("no log")
    os.utime(folder / "broken.mcap", (0, 0))
    return folder


def opened(qtbot: QtBot, open_with: OpenWith, folder: Path) -> tuple[MainWindow, RecordingsDialog]:
    window = open_with(recordings=folder)
    qtbot.keyClick(window, Qt.Key.Key_O, CTRL_SHIFT)
    dialog = dialog_of(window)
    activate(qtbot, dialog)
    until(qtbot, lambda: dialog.table.rowCount() == len(list(folder.glob("*.mcap"))))
    return window, dialog


def row(dialog: RecordingsDialog, number: int) -> list[str]:
    return [dialog.table.item(number, column).text() for column in range(dialog.table.columnCount())]


def test_the_list_shows_date_room_place_and_readings_newest_first(
    qtbot: QtBot, open_with: OpenWith, folder: Path
) -> None:
    _, dialog = opened(qtbot, open_with, folder)
    assert row(dialog, 0)[1:] == ["Simple room", "figure9", str(ORDER.readings), "yes", "today.mcap", "whole"]
    assert row(dialog, 1)[1:6] == ["Cellar", "figure9", "7", "yes", "cellar.mcap"]
    assert "is not an MCAP file" in row(dialog, 2)[6]
    assert row(dialog, 0)[0] > row(dialog, 1)[0]
    assert "3 recordings" in dialog.summary.text()


def test_words_filter_the_list_and_the_remaining_recording_opens(
    qtbot: QtBot, open_with: OpenWith, folder: Path
) -> None:
    window, dialog = opened(qtbot, open_with, folder)
    qtbot.keyClicks(dialog.search, "cellar fig")
    assert [dialog.table.isRowHidden(number) for number in range(3)] == [True, False, True]
    assert not dialog.open_button.isEnabled()
    dialog.table.selectRow(1)
    qtbot.mouseClick(dialog.open_button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: len(window.session.shown.readings) == 7)
    assert window.session.shown.scene.room.name == "Cellar"
    until(qtbot, lambda: dialog_of(window) is None)


def test_return_opens_the_newest_recording(qtbot: QtBot, open_with: OpenWith, folder: Path) -> None:
    window, dialog = opened(qtbot, open_with, folder)
    qtbot.keyClick(dialog, Qt.Key.Key_Return)
    until(qtbot, lambda: len(window.session.shown.readings) == ORDER.readings)


def test_escape_opens_nothing_and_closing_the_window_closes_the_list(
    qtbot: QtBot, open_with: OpenWith, folder: Path
) -> None:
    window, dialog = opened(qtbot, open_with, folder)
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    until(qtbot, lambda: dialog_of(window) is None)
    assert window.session.replay is None
    window.commands.show_recordings.trigger()
    assert dialog_of(window) is not None
    window.close()  # open_with checks that no thread is left


def test_a_missing_folder_is_an_empty_list_with_a_hint(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    window = open_with(recordings=tmp_path / "none")
    qtbot.keyClick(window, Qt.Key.Key_O, CTRL_SHIFT)
    assert "no recordings yet" in dialog_of(window).summary.text()
    assert not dialog_of(window).open_button.isEnabled()


def test_unchanged_recordings_are_not_read_again(folder: Path) -> None:
    rows, files = list_recordings(folder)
    while len(rows) < files:
        rows, files = list_recordings(folder, rows)
    again, _ = list_recordings(folder, rows)
    assert [id(row) for row in again] == [id(row) for row in rows]
    (folder / "today.mcap").unlink()
    rest, _ = list_recordings(folder, rows)
    assert [row.path.name for row in rest] == ["cellar.mcap", "broken.mcap"]
