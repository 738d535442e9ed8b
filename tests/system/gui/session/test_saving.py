"""Pictures, data and reports are saved by key and dialog, completely, and never over a file without a question."""

import json
import re
from functools import partial
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication, QDialogButtonBox, QFileDialog, QLineEdit, QMessageBox
from pytestqt.qtbot import QtBot
from sonarhw_cli.app import run
from sonarhw_gui.jobs.files import DATA, Documents, save_file, with_own_coordinates, write_data
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.window import MainWindow

from sonarhw.errors import InputError
from sonarhw.log import read_log
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import dialog_of, predicted, until

CTRL, SHIFT, ALT = (
    Qt.KeyboardModifier.ControlModifier,
    Qt.KeyboardModifier.ShiftModifier,
    Qt.KeyboardModifier.AltModifier,
)


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> MainWindow:
    window = open_with(source=read_log(recorded), source_name=recorded.name, source_file=recorded)
    until(qtbot, lambda: predicted(window))
    return window


def save(qtbot: QtBot, window: MainWindow, path: Path, key: Qt.Key, modifier: Qt.KeyboardModifier = CTRL) -> None:
    """Press the key, enter a file name and click Save; the caller checks the file."""
    qtbot.keyClick(window, key, modifier)
    until(qtbot, lambda: dialog_of(window) is not None)
    field = dialog_of(window).findChild(QLineEdit, "fileNameEdit")
    field.setText(str(path))  # with typed letters Qt's completer would change the name
    button = dialog_of(window).findChild(QDialogButtonBox).button(QDialogButtonBox.StandardButton.Save)
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: not window.session.jobs.busy("save files"))


@pytest.mark.parametrize(
    ("key", "modifier", "view"),
    [
        (Qt.Key.Key_P, CTRL, "plan"),
        (Qt.Key.Key_T, CTRL | ALT, "trace"),
        (Qt.Key.Key_R, CTRL | ALT, "ranges"),
    ],
)
def test_a_view_is_saved_as_png_and_as_svg(
    qtbot: QtBot, window: MainWindow, tmp_path: Path, key: Qt.Key, modifier: Qt.KeyboardModifier, view: str
) -> None:
    save(qtbot, window, tmp_path / "view.png", key, modifier)
    image = QImage(str(tmp_path / "view.png"))
    shown = getattr(window.views, view).picture()
    assert image.width() == 2 * shown.width()
    assert image.height() > 2 * shown.height()
    colours = {image.pixelColor(x, y).name() for x in range(0, image.width(), 3) for y in range(0, image.height(), 3)}
    assert window.session.shown.look.palette.measured.lower() in colours
    save(qtbot, window, tmp_path / "view.svg", key, modifier)
    drawing = ElementTree.parse(tmp_path / "view.svg").getroot()
    assert drawing.tag.endswith("svg")
    texts = [text for element in drawing.iter() if (text := (element.text or "").strip())]
    assert any("Simple room · place figure9" in text for text in texts)
    assert window.status_bar.currentMessage() == f"saved: {tmp_path / 'view.svg'}"


def test_the_dialog_opens_in_the_folder_of_the_log_and_then_in_the_last_one_used(
    qtbot: QtBot, window: MainWindow, recorded: Path, tmp_path: Path
) -> None:
    window.commands.save_room_as.trigger()
    dialog = window.findChild(QFileDialog)
    assert dialog.directory().absolutePath() == str(recorded.parent)
    dialog.reject()
    window.commands.export_data.trigger()
    assert dialog_of(window).directory().absolutePath() == str(recorded.parent)
    save(qtbot, window, tmp_path / "data.csv", Qt.Key.Key_E)
    window.commands.save_report.trigger()
    assert dialog_of(window).directory().absolutePath() == str(tmp_path)


def test_for_a_live_scan_the_dialog_opens_in_the_last_folder_but_not_in_the_recordings(tmp_path: Path) -> None:
    recordings, rooms = tmp_path / "recordings", tmp_path / "rooms"
    for folder in (recordings, rooms):
        folder.mkdir()
    documents = Documents(recordings)
    scan = str(recordings / "scan.mcap")
    assert documents.folder(scan) == Path.home()
    documents.recent = (scan, str(tmp_path / "gone" / "a.toml"), str(rooms / "b.toml"))
    assert documents.folder(scan) == rooms


def test_an_svg_is_clipped_to_the_plot(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    save(qtbot, window, tmp_path / "plan.svg", Qt.Key.Key_P)
    drawing = ElementTree.parse(tmp_path / "plan.svg").getroot()
    inside = [element for element in drawing.iter() if element.tag.endswith("}svg") and element is not drawing]
    assert len(inside) == 1
    assert inside[0].get("overflow") == "hidden"
    paths = [element for element in drawing.iter() if element.tag.endswith(("path", "polyline"))]
    assert 0 < len([element for element in inside[0].iter() if element in paths]) < len(paths)
    assert window.views.plan.drawing.plot.vb.childGroup.opacity() == 1.0


def test_lines_of_an_svg_need_no_effect_that_only_browsers_support(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    save(qtbot, window, tmp_path / "plan.svg", Qt.Key.Key_P)
    assert "vector-effect" not in (tmp_path / "plan.svg").read_text()
    scaled = """<svg xmlns="http://www.w3.org/2000/svg"><g transform="matrix(2,0,0,-10,5,1)">
        <path vector-effect="non-scaling-stroke" d="M0,0 L1.5,-2e-1"/><polyline vector-effect="x" points="1,1 3,4 "/>
        <rect vector-effect="non-scaling-stroke" x="1" y="2" width="3" height="1"/></g></svg>"""
    path, line, box = ElementTree.fromstring(with_own_coordinates(scaled))[0]
    assert path.get("d") == "M5,1 L8,3"
    assert line.get("points") == "7,-9 11,-39 "
    assert box.get("d") == "M7,-19 L13,-19 L13,-29 L7,-29 Z"


def test_the_window_and_any_large_view_can_be_saved(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    save(qtbot, window, tmp_path / "window.png", Qt.Key.Key_P, CTRL | SHIFT)
    image = QImage(str(tmp_path / "window.png"))
    assert (image.width(), image.height()) == (2 * window.width(), 2 * window.height())
    before = window.views.stage.width()
    qtbot.keyClick(window, Qt.Key.Key_2)
    until(qtbot, lambda: window.views.stage.width() > before)
    save(qtbot, window, tmp_path / "both.png", Qt.Key.Key_P)
    assert QImage(str(tmp_path / "both.png")).width() == 2 * window.views.side_by_side.width()


def test_exported_data_equal_those_of_the_command_line(
    qtbot: QtBot, window: MainWindow, recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for ending in (".csv", ".npz", ".json"):
        save(qtbot, window, tmp_path / f"saved{ending}", Qt.Key.Key_E)
    for ending in (".csv", ".npz"):
        assert run(["log", "export", str(recorded), "--out", str(tmp_path / f"exported{ending}")]) == 0
    assert (tmp_path / "saved.csv").read_bytes() == (tmp_path / "exported.csv").read_bytes()
    assert len((tmp_path / "saved.csv").read_text().splitlines()) == ORDER.readings + 1
    with np.load(tmp_path / "saved.npz") as saved, np.load(tmp_path / "exported.npz") as exported:
        assert saved.files == exported.files
        assert all(np.array_equal(saved[name], exported[name], equal_nan=True) for name in saved.files)
    figures = json.loads((tmp_path / "saved.json").read_text())
    assert figures["n"] == ORDER.readings
    exported_files = [tmp_path / f"exported{ending}" for ending in (".csv", ".npz")]
    assert capsys.readouterr().err == "".join(f"{file}: written\n" for file in exported_files)


def test_the_report_contains_the_scan_and_its_room(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    save(qtbot, window, tmp_path / "scan.html", Qt.Key.Key_E, CTRL | SHIFT)
    text = (tmp_path / "scan.html").read_text()
    assert "<h1>Simple room, place figure9</h1>" in text
    assert len(re.findall(r"data:image/", text)) == 3
    assert text.count("<tr><td>") >= ORDER.readings


def test_an_existing_file_is_unchanged_if_the_user_declines(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    there = tmp_path / "mine.csv"
    there.write_text("mine")
    questions = []

    def say_no() -> None:
        question = QApplication.activeModalWidget()
        if isinstance(question, QMessageBox):
            questions.append(question.text())
            qtbot.mouseClick(question.button(QMessageBox.StandardButton.No), Qt.MouseButton.LeftButton)
        else:
            QTimer.singleShot(20, say_no)

    QTimer.singleShot(20, say_no)
    save(qtbot, window, there, Qt.Key.Key_E)
    assert questions
    assert there.read_text() == "mine"
    dialog_of(window).close()


def test_files_are_not_overwritten_without_permission_and_need_a_known_extension(
    recorded: Path, scene: Scene, tmp_path: Path
) -> None:
    there = tmp_path / "mine.csv"
    there.write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        save_file(partial(write_data, recorded, scene, (), ".csv"), DATA, there, overwrite=False)
    with pytest.raises(InputError, match=r"expected a name ending in \.csv or \.npz or \.json"):
        save_file(partial(write_data, recorded, scene, (), ".csv"), DATA, tmp_path / "a.xlsx", overwrite=False)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]
    assert there.read_text() == "mine"


def test_a_failed_write_is_reported_and_the_next_files_are_saved(
    qtbot: QtBot, window: MainWindow, recorded: Path, tmp_path: Path
) -> None:
    session, scene = window.session, window.session.shown.scene
    write = partial(write_data, recorded, scene, (), ".csv")
    for path in ("nowhere/a.csv", "b.csv", "c.csv"):
        session.save(write, DATA, tmp_path / path)
    until(qtbot, lambda: not session.jobs.busy("save files"))
    assert "nowhere" in window.banner.message
    assert sorted(path.name for path in tmp_path.glob("*.csv")) == ["b.csv", "c.csv"]


def test_without_readings_nothing_is_saved(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    for modifier in (CTRL, CTRL | SHIFT):
        qtbot.keyClick(window, Qt.Key.Key_E, modifier)
        assert "no readings to save" in window.banner.message
    assert dialog_of(window) is None
