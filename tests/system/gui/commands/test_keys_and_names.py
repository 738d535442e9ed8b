"""Names of all tab stops, the command palette, the list of undo steps, copied pictures, and layouts."""

from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QGuiApplication, QImage
from PySide6.QtPrintSupport import QPrinter
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QMenu, QToolButton, QWidget
from pytestqt.qtbot import QtBot
from shiboken6 import Shiboken
from sonarhw_gui.jobs import forecast
from sonarhw_gui.window.commands import draw_page
from sonarhw_gui.window.window import MainWindow, spoken_name
from sonarhw_sim.room.room import load_room

from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenFake, OpenWith
from tests.system.gui.driving import dialog_of, predicted, until


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith) -> MainWindow:
    window = open_with()
    until(qtbot, lambda: predicted(window))
    return window


def tab_stops(window: MainWindow) -> list[QWidget]:
    """Return the widgets that Tab visits from the menu bar until it comes back, as Qt orders them."""
    first = stop = window.menuBar()
    found = []
    while (stop := stop.nextInFocusChain()) is not first:
        if stop.focusPolicy() & Qt.FocusPolicy.TabFocus and stop.window() is window:
            found.append(stop)
    return found


def test_every_tab_stop_has_a_name(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    for action in (*window.dock_openers, *window.commands.views, window.commands.play_sound):
        action.trigger()
        qtbot.wait(20)
    stops = tab_stops(window)
    assert len(stops) > 60
    assert [f"{type(stop).__name__} in {type(stop.parent()).__name__}" for stop in stops if not spoken_name(stop)] == []


def test_class_buttons_say_class_and_count(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    until(qtbot, lambda: any(spoken_name(b).startswith("matches: 3") for b in window.views.table.classes.values()))


def test_the_palette_runs_a_command_by_a_part_of_its_name(qtbot: QtBot, window: MainWindow) -> None:
    keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
    qtbot.keyClick(window, Qt.Key.Key_A, keys)
    palette = dialog_of(window)
    until(qtbot, palette.isVisible)
    assert len(palette.names) > 50
    qtbot.keyClicks(palette.words, "side by")
    assert palette.names[0] == "Side by side"
    qtbot.keyClick(palette.words, Qt.Key.Key_Return)
    assert window.views.large_view is window.views.side_by_side


def test_the_palette_finds_a_panel_by_its_purpose(qtbot: QtBot, window: MainWindow) -> None:
    window.commands.show_palette.trigger()
    panels = {"next place": "Find the room", "missing": "Causes", "compare two": "Scans", "home scanner": "Device"}
    for words, name in panels.items():
        dialog_of(window).words.clear()
        qtbot.keyClicks(dialog_of(window).words, words)
        assert dialog_of(window).names == [name]


def test_undo_steps_are_listed_and_undone_together(qtbot: QtBot, window: MainWindow) -> None:
    room = window.session.shown.scene
    for key in (Qt.Key.Key_Up, Qt.Key.Key_PageUp):
        qtbot.keyClick(window, key, Qt.KeyboardModifier.ShiftModifier)
        window.views.plan.drawing.controller._last_key = -1e9  # the next key press is another step
    assert window.isWindowModified()
    steps = next(menu for menu in window.findChildren(QMenu) if menu.title() == "Undo steps")
    steps.aboutToShow.emit()
    assert [action.text() for action in steps.actions()] == ["turning the sensor", "moving the sensor"]
    steps.actions()[1].trigger()
    assert window.session.shown.scene is room
    assert not window.isWindowModified()


def test_a_picture_of_the_large_view_is_copied(qtbot: QtBot, window: MainWindow) -> None:
    window.commands.copy_view.trigger()
    image: QImage = QGuiApplication.clipboard().image()
    assert image.width() == 2 * window.views.plan.drawing.width()
    assert image.height() > 2 * window.views.plan.drawing.height()  # with title and legend


def test_views_are_moved_floated_closed_and_reset(qtbot: QtBot, window: MainWindow) -> None:
    trace, ranges, table, echoes, _ = window.views.docks
    trace.setFloating(True)
    ranges.close()
    echoes.opener.trigger()
    until(qtbot, lambda: echoes.in_front and not table.in_front)
    assert [action.isChecked() for action in window.views.openers] == [True, False, False, True, False]
    ranges.opener.trigger()
    until(qtbot, ranges.isVisible)
    window.commands.reset_layout.trigger()
    until(qtbot, lambda: table.in_front and not echoes.in_front)
    assert not trace.isFloating()
    tops = [dock.mapTo(window, dock.rect().topLeft()).y() for dock in (trace, ranges, table)]
    assert tops == sorted(tops)
    assert len(set(tops)) == 3


def test_the_first_window_is_not_larger_than_its_screen(window: MainWindow) -> None:
    available = QApplication.primaryScreen().availableSize()
    assert window.width() <= available.width()
    assert window.height() <= available.height()


def test_a_demo_scan_waits_for_its_prediction(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Hold the prediction back: no scan; let it go: the scan begins, over its outline."""
    held, find_paths = [True], forecast.find_paths

    def wait(*args: object) -> object:
        while held[0]:
            qtbot_free.wait(0.01)
        return find_paths(*args)

    import threading

    qtbot_free = threading.Event()
    monkeypatch.setattr(forecast, "find_paths", wait)
    window = open_with(source=fake("max"), autostart=True)
    try:
        until(qtbot, lambda: "the scan begins when its prediction is there" in window.status_bar.activity.text())
        window.session.preparation.compiling(3, 60)
        until(qtbot, lambda: "preparing the model (first start only)" in window.status_bar.activity.text())
        bar = window.status_bar.progress
        assert (bar.isVisible(), bar.value(), bar.maximum()) == (True, 3, 60)
        assert "press Scan" not in window.sentence.text()
        assert window.session.live.job.phase is None
    finally:
        held[0] = False
    window.session.preparation.compiled()
    until(qtbot, lambda: len(window.session.shown.readings) > 0)
    assert window.session.shown.outline is not None
    until(qtbot, lambda: not window.status_bar.progress.isVisible())
    window.commands.stop.trigger()


def test_walls_and_posts_are_added_by_typed_coordinates(qtbot: QtBot, window: MainWindow) -> None:
    keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier
    for key, typed in ((Qt.Key.Key_W, ("0.2", "0.5", "0.6", "0.5")), (Qt.Key.Key_P, ("0.3", "0.3", "0.05"))):
        qtbot.keyClick(window, key, keys)
        dialog = window.views.plan.typed
        for field, text in zip(dialog.fields, typed, strict=True):
            field.selectAll()
            qtbot.keyClicks(field, text)
        qtbot.keyClick(dialog.fields[-1], Qt.Key.Key_Return)
        until(qtbot, lambda dialog=dialog: not Shiboken.isValid(dialog) or not dialog.isVisible())
    room = window.session.shown.scene.room
    assert room.walls[-1].tolist() == pytest.approx([0.2, 0.5, 0.6, 0.5])
    assert room.posts[-1].tolist() == pytest.approx([0.3, 0.3, 0.05])
    assert window.session.showing.history.steps == ("adding a post", "adding a wall")


def test_remove_without_a_selection_says_how_to_select(qtbot: QtBot, window: MainWindow) -> None:
    plan = window.views.plan
    button = next(button for button in plan.findChildren(QToolButton) if button.defaultAction() is plan.remove)
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    assert "Edit (E) selects" in plan.message.text()
    assert plan.message.isVisible()
    assert plan.message.fontMetrics().horizontalAdvance(plan.message.text()) < plan.message.width()


def test_an_impossible_wall_is_explained_in_the_dialog(qtbot: QtBot, window: MainWindow) -> None:
    window.views.plan._type_surface(post=True)
    dialog = window.views.plan.typed
    assert dialog.fields[-1].value() == pytest.approx(0.05)
    dialog._add()  # around the sensor, where the fields begin
    assert "lies inside post" in dialog.problem.text()
    assert dialog.isVisible()
    dialog.close()


def test_ctrl_s_saves_an_edited_room_in_its_file(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(ROOM.read_text())
    window = open_with()
    window.session.open_file(str(file))
    until(qtbot, lambda: window.windowTitle().endswith(" — mine.toml[*]") and predicted(window))
    before = window.session.shown.scene.pose.position
    qtbot.keyClick(window, Qt.Key.Key_Up, Qt.KeyboardModifier.ShiftModifier)
    assert window.isWindowModified()
    qtbot.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: not window.isWindowModified())
    saved = load_room(file).place(window.session.shown.scene.pose.name)
    assert saved.position == pytest.approx((before[0], before[1] + 0.01))
    assert window.findChild(QFileDialog) is None


def test_ctrl_s_asks_for_a_name_if_the_room_has_no_file(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_S, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: window.findChild(QFileDialog) is not None)
    assert window.findChild(QFileDialog).windowTitle() == "Save room as"


def test_the_large_view_is_printed_with_title_and_legend(qtbot: QtBot, window: MainWindow, tmp_path: Path) -> None:
    window.commands.print_view.trigger()
    preview = dialog_of(window)
    until(qtbot, preview.isVisible)
    printer = QPrinter()
    printer.setOutputFormat(QPrinter.OutputFormat.PdfFormat)
    printer.setOutputFileName(str(tmp_path / "plan.pdf"))
    draw_page(window.saving.image(), printer)
    assert (tmp_path / "plan.pdf").stat().st_size > 10_000
    preview.close()


def test_another_dialog_may_follow_a_print_preview_at_once(qtbot: QtBot, window: MainWindow) -> None:
    for wait in (0, 1, 40):
        window.commands.print_view.trigger()
        qtbot.wait(wait)
        window.commands.open_log.trigger()
        qtbot.wait(300)  # the preview draws later
        assert [type(dialog) for dialog in window.findChildren(QDialog) if dialog.isVisible()] == [QFileDialog]


def test_a_layout_is_saved_used_kept_and_deleted(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    memory = tmp_path / "window.ini"
    window = open_with(memory=memory)
    trace, ranges, *_others = window.views.docks
    ranges.close()
    trace.setFloating(True)
    _choose(window.layouts, "Save layout…")
    dialog = dialog_of(window)
    dialog.setTextValue("lab & bench")
    dialog.accept()
    window.commands.reset_layout.trigger()
    until(qtbot, lambda: ranges.isVisible() and not trace.isFloating())
    window.close()
    again = open_with(memory=memory)
    trace, ranges, *_others = again.views.docks
    _choose(again.layouts, "lab && bench")
    until(qtbot, lambda: trace.isFloating() and not ranges.isVisible())
    again.layouts.show_names()
    again.layouts.deleting.actions()[0].trigger()
    assert not again.layouts.layouts


def _choose(menu: QMenu, text: str) -> None:
    menu.show_names()
    next(action for action in menu.actions() if action.text() == text).trigger()
