"""A CSV scan is imported after a preview: columns, unit, direction, zero and the value for no echo are asked."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QFileDialog
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.import_dialog import ImportDialog
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import until
from tests.system.gui.session.test_opening import drop

LEFT = Qt.MouseButton.LeftButton


def written(folder: Path, *lines: str) -> Path:
    path = folder / "turret.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def dropped(qtbot: QtBot, window: MainWindow, path: Path) -> ImportDialog:
    assert drop(window, path)
    until(qtbot, lambda: window.findChild(ImportDialog) is not None)
    return window.findChild(ImportDialog)


def preview(dialog: ImportDialog) -> list[list[str]]:
    table = dialog.preview
    return [
        [table.item(row, column).text() for column in range(table.columnCount())] for row in range(table.rowCount())
    ]


def step_to(qtbot: QtBot, choice: QComboBox, text: str) -> None:
    """Choose an entry with the arrow keys."""
    choice.setFocus()
    for _ in range(choice.findText(text) - choice.currentIndex()):
        qtbot.keyClick(choice, Qt.Key.Key_Down)


def test_a_csv_scan_with_known_columns_needs_only_enter(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path, scene: Scene
) -> None:
    window = open_with()
    dialog = dropped(qtbot, window, written(tmp_path, "turret_deg,range_cm", "0,15.4", "90,", "180,77.4"))
    until(qtbot, dialog.import_button.isEnabled)
    assert preview(dialog) == [
        ["0", "15.4", "0.0°", "0.154 m"],
        ["90", "", "90.0°", "no echo"],
        ["180", "77.4", "180.0°", "0.774 m"],
    ]
    assert dialog.note.text().startswith("3 readings, 1 without an echo; turntable angles 0.0° to 180.0°, 0.154 m to")
    qtbot.keyClick(dialog, Qt.Key.Key_Return)
    until(qtbot, lambda: len(window.session.shown.readings) == 3)
    assert window.session.shown.readings[0].range == pytest.approx(0.154, abs=1e-6)
    assert "turret.csv was imported as turret.mcap" in window.banner.message
    assert len(read_log(tmp_path / "recordings" / "turret.mcap").readings) == 3
    assert window.session.shown.scene.room is scene.room
    assert window.session.shown.scene.board is scene.board


def test_every_convention_is_chosen_with_the_keyboard(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    window = open_with()
    dialog = dropped(qtbot, window, written(tmp_path, "a,b,c", "1,10,500", "2,20,9999", "3,30,700"))
    assert "choose the column of the heading" in dialog.note.text()
    assert not dialog.import_button.isEnabled()
    step_to(qtbot, dialog.heading, "b")
    assert "choose the column of the range" in dialog.note.text()
    step_to(qtbot, dialog.distance, "c")
    step_to(qtbot, dialog.time, "a")
    step_to(qtbot, dialog.unit, "mm")
    step_to(qtbot, dialog.turn, "clockwise")
    dialog.zero.selectAll()
    qtbot.keyClicks(dialog.zero, "90")
    qtbot.keyClicks(dialog.no_echo, "x")
    assert "'x'; expected a number" in dialog.note.text()
    assert not dialog.import_button.isEnabled()
    dialog.no_echo.selectAll()
    qtbot.keyClicks(dialog.no_echo, "9999")
    until(qtbot, dialog.import_button.isEnabled)
    assert [line[3:] for line in preview(dialog)] == [["80.0°", "0.500 m"], ["70.0°", "no echo"], ["60.0°", "0.700 m"]]
    qtbot.mouseClick(dialog.import_button, LEFT)
    until(qtbot, lambda: len(window.session.shown.readings) == 3)
    assert [reading.range is None for reading in window.session.shown.readings] == [False, True, False]
    times = [reading.time for reading in window.session.shown.readings]
    assert times[2] - times[0] == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize("silence", ["400", "0"])
def test_a_frequent_range_means_no_echo_only_after_the_user_confirms_it(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path, silence: str
) -> None:
    lines = [f"{10 * k},{silence if k % 3 else 15.4 + k}" for k in range(12)]
    dialog = dropped(qtbot, open_with(), written(tmp_path, "turret_deg,range_cm", *lines))
    until(qtbot, dialog.silence.isVisible)
    assert dialog.silence.text() == f"{silence} means no echo (8 readings)"
    assert preview(dialog)[1][-1] == ("4.000 m" if silence == "400" else "0.000 m")
    qtbot.mouseClick(dialog.silence, LEFT)
    until(qtbot, lambda: preview(dialog)[1][-1] == "no echo")
    assert "12 readings, 8 without an echo" in dialog.note.text()
    assert not dialog.silence.isVisible()


def test_without_a_frequent_range_nothing_is_proposed(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    lines = [f"{5 * k},{30 + k // 2}" for k in range(36)]
    dialog = dropped(qtbot, open_with(), written(tmp_path, "turret_deg,range_cm", *lines))
    until(qtbot, dialog.import_button.isEnabled)
    assert not dialog.silence.isVisible()


def test_a_wrong_line_is_reported_in_the_dialog(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    lines = [f"{k},0.5" for k in range(20)]
    dialog = dropped(qtbot, open_with(), written(tmp_path, "deg,m", *lines, "20,oops"))
    until(qtbot, lambda: "line 22: m is 'oops'; expected a number" in dialog.note.text())
    assert not dialog.import_button.isEnabled()
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    assert not (tmp_path / "recordings").exists()


def test_decimal_commas_are_recognised(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    dialog = dropped(qtbot, open_with(), written(tmp_path, "Winkel;dist_cm", "1,5;15,4"))
    assert dialog.decimal_comma.isChecked()
    step_to(qtbot, dialog.heading, "Winkel")
    until(qtbot, dialog.import_button.isEnabled)
    assert preview(dialog) == [["1,5", "15,4", "1.5°", "0.154 m"]]


@pytest.mark.parametrize("command", ["open_log", "import_scan"])
def test_the_file_menu_opens_the_import_dialog(qtbot: QtBot, open_with: OpenWith, tmp_path: Path, command: str) -> None:
    window = open_with()
    getattr(window.commands, command).trigger()
    chooser = window.findChild(QFileDialog)
    chooser.selectFile(str(written(tmp_path, "deg,m", "0,1")))
    chooser.accept()
    until(qtbot, lambda: window.findChild(ImportDialog) is not None)
    assert window.findChild(ImportDialog).windowTitle() == "Import turret.csv"
