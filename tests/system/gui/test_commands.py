"""Commands, keys and names: the palette, the help page, the first steps, printing, and what each start begins with."""

import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QGuiApplication
from PySide6.QtPrintSupport import QPrinter
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QFileDialog, QLabel, QMenu, QWidget
from sonarhw_cli.app import run
from sonarhw_compare.match import Kind
from sonarhw_gui.jobs import forecast
from sonarhw_gui.model.look import Look, ViewLayer
from sonarhw_gui.model.rows import Column
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.views.marks import reading_tip
from sonarhw_gui.window.commands import draw_page
from sonarhw_gui.window.dialogs import HelpPage
from sonarhw_gui.window.start import WindowStart, open_window
from sonarhw_gui.window.window import MainWindow, spoken_name
from sonarhw_sim.air import Receiver

from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from tests.checkout import CHECKOUT
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import ORDER, OpenFake, OpenWith
from tests.system.gui.driving import activate, click, dialog_of, drawn, key, pause, predicted, push, until


def tab_stops(window: MainWindow) -> list[QWidget]:
    """Return the widgets that Tab visits from the menu bar until it comes back, as Qt orders them."""
    first = stop = window.menuBar()
    stops = []
    while (stop := stop.nextInFocusChain()) is not first:
        if stop.focusPolicy() & Qt.FocusPolicy.TabFocus and stop.window() is window:
            stops.append(stop)
    return stops


def test_every_tab_stop_has_a_name_every_key_one_meaning_and_one_dialog_is_open_at_a_time(window: MainWindow) -> None:
    matches = window.legend.entries[Kind.MATCH]
    until(lambda: spoken_name(matches).startswith("3") and spoken_name(matches).endswith(" match, shown"))
    keys = [each.toString() for action in window.findChildren(QAction) for each in action.shortcuts()]
    assert sorted(keys) == sorted(set(keys))
    opening = [action for action in window.findChildren(QAction) if action.text().endswith("…") and action.isEnabled()]
    opening = [action for action in opening if not action.text().startswith("Film")]  # needs a computed heading
    assert len(opening) > 10
    for action in (*opening, window.commands.show_help):
        action.trigger()
        until(lambda: len([one for one in window.findChildren(QDialog) if one.isVisible()]) == 1)
    dialog_of(window).close()
    for wait in (0, 1, 40):  # another dialog may follow a print preview at once
        window.commands.print_view.trigger()
        pause(wait)
        window.commands.open_log.trigger()
        pause(300)  # the preview draws later
        assert [type(one) for one in window.findChildren(QDialog) if one.isVisible()] == [QFileDialog]
    dialog_of(window).close()
    for action in (*window.dock_openers, *window.commands.views, window.commands.play_sound):
        action.trigger()
        pause(20)
    stops = tab_stops(window)
    assert len(stops) > 60
    assert [f"{type(stop).__name__} in {type(stop.parent()).__name__}" for stop in stops if not spoken_name(stop)] == []


def test_tab_visits_the_plan_first_and_a_row_of_buttons_once(window: MainWindow) -> None:
    until(lambda: predicted(window))
    legend, chosen = window.legend, window.session.shown.chosen
    visited = [window.focusWidget()]
    while len(visited) < 2 or visited[-1] is not visited[0]:
        key(visited[-1], "Tab")
        visited.append(window.focusWidget())
    assert visited[0] is window.views.plan.drawing
    assert visited[1] is legend.entries[Kind.MATCH]
    assert 8 <= len(set(visited)) == len(visited) - 1 <= 15
    assert not any(panel.isAncestorOf(stop) for panel in (window.room, window.fit_panel) for stop in visited)
    key(visited[0], "Shift+Tab")
    assert window.focusWidget() is visited[-2]
    for step in ("Tab", "Tab", "Right", "Right", "Space"):
        key(window.focusWidget(), step)
    assert window.focusWidget() is legend.entries[ViewLayer.TRACE]
    until(lambda: ViewLayer.TRACE in window.session.shown.hidden)
    key(window.focusWidget(), "Tab")
    key(window.focusWidget(), "Shift+Tab")
    assert window.focusWidget() is legend.entries[ViewLayer.TRACE]  # the row remembers its button
    assert window.session.shown.chosen is chosen


def test_the_palette_runs_commands_and_the_large_view_is_printed(open_with: OpenWith, tmp_path: Path) -> None:
    window = open_with()
    views, session = window.views, window.session
    until(lambda: predicted(window))
    available = QApplication.primaryScreen().availableSize()
    assert window.width() <= available.width()
    assert window.height() <= available.height()
    key(window, "Ctrl+Shift+A")
    palette = dialog_of(window)
    assert len(palette.names) > 50
    panels = {"next place": "Find the room", "missing": "Causes", "compare two": "Scans", "home scanner": "Device"}
    for words, name in panels.items():  # a panel is found by its purpose
        palette.words.clear()
        QTest.keyClicks(palette.words, words)
        assert palette.names == [name]
    palette.words.clear()
    QTest.keyClicks(palette.words, "side by")
    assert palette.names[0] == "Side by side"
    key(palette.words, "Return")
    assert views.large_view is views.side_by_side
    key(window, "1")

    scene, now = session.shown.scene, 0.0
    views.plan.drawing.controller.clock = lambda: now
    key(window, "Shift+Up")
    now = 5.0
    key(window, "Shift+PgUp")
    assert window.isWindowModified()
    steps = next(menu for menu in window.findChildren(QMenu) if menu.title() == "Undo steps")
    steps.aboutToShow.emit()
    assert [action.text() for action in steps.actions()] == ["turning the sensor", "moving the sensor"]
    steps.actions()[1].trigger()
    assert session.shown.scene is scene
    assert not window.isWindowModified()
    key(window, "Ctrl+Shift+Z")
    assert window.commands.undo.text() == "Undo moving the sensor"

    window.commands.copy_view.trigger()
    image = QGuiApplication.clipboard().image()
    assert image.width() == 2 * views.plan.drawing.width()
    assert image.height() > 2 * views.plan.drawing.height()  # with title and legend
    window.commands.print_view.trigger()
    until(dialog_of(window).isVisible)
    printer = QPrinter()
    printer.setOutputFormat(QPrinter.OutputFormat.PdfFormat)
    printer.setOutputFileName(str(tmp_path / "plan.pdf"))
    draw_page(window.saving.image(), printer)
    assert (tmp_path / "plan.pdf").stat().st_size > 10_000
    dialog_of(window).close()

    trace, ranges, table, echoes, _ = views.docks  # moved, floated, closed and reset
    trace.setFloating(True)
    ranges.close()
    echoes.opener.trigger()
    until(lambda: echoes.in_front and not table.in_front)
    assert [action.isChecked() for action in views.openers] == [True, False, False, True, False]
    ranges.opener.trigger()
    until(ranges.isVisible)
    window.commands.reset_layout.trigger()
    until(lambda: table.in_front and not echoes.in_front)
    assert not trace.isFloating()
    tops = [dock.mapTo(window, dock.rect().topLeft()).y() for dock in (trace, ranges, table)]
    assert tops == sorted(set(tops))


def test_f1_explains_every_key_and_class_in_the_words_of_the_docs_and_esc_closes_it_first(window: MainWindow) -> None:
    window.session.showing.choose(3)
    key(window, "F1")
    page = dialog_of(window)
    assert (page.width(), page.height()) <= (1280, 800)
    text = "".join(label.text() for label in page.findChildren(QLabel))
    every = [*window.commands.actions.values()]
    for action in every:
        assert f"<b>{action.shortcut().toString()}" in text, action.text()
    lines = (CHECKOUT / "docs" / "comparing" / "compare.md").read_text(encoding="utf-8").splitlines()
    rows = [line.strip("|").split(" | ") for line in lines if line.count(" | ") == 2]
    explained = {kind.strip(): (meaning, hint.strip()) for kind, meaning, hint in rows if kind.strip() != "class"}
    assert explained.keys() == {kind.label for kind in Kind} - {"both silent"}
    for kind, (meaning, hint) in explained.items():
        assert f"<b>{kind}</b>: {meaning}" in text
        assert f"{hint}." in text
    key(window, "Esc")
    until(lambda: dialog_of(window) is None)
    assert window.session.shown.chosen == 3
    key(window, "Esc")  # follows the newest reading
    assert window.session.shown.chosen == ORDER.readings - 1

    groups = {f"Group {k}": every[k : k + 8] for k in range(0, len(every), 8)}
    for scale in (1.0, 2.0):  # the last key is visible or can be scrolled to
        window.session.showing.set_look(Look(scale=scale))
        page = HelpPage(groups, Look(scale=scale), None, QSize(1280, 760))
        activate(page)
        bar, viewport = page.area.verticalScrollBar(), page.area.viewport()
        assert (page.width() <= 1280, page.height() <= 760) == (True, True)
        assert page.area.horizontalScrollBar().maximum() == 0
        assert scale > 1 or bar.maximum() == 0
        bar.setValue(bar.maximum())
        for label in page.findChildren(QLabel):
            assert label.height() >= label.heightForWidth(label.width())
            end = label.mapTo(viewport, label.rect().bottomLeft())
            assert viewport.rect().contains(end) or "<table>" not in label.text()
        page.close()


# the first steps


def test_the_hint_of_the_first_start(open_with: OpenWith, recorded: Path, tmp_path: Path, scene: Scene) -> None:
    memory = tmp_path / "window.ini"
    open_with(memory=memory).close()  # closed before its scan: the next start shows the hint again
    window = open_with(source=read_log(recorded), memory=memory)
    hint, ranges, session = window.hint, window.views.ranges, window.session
    assert hint.isVisible()
    for word, label in zip(("fake scanner", "predicted", "Click"), hint.labels, strict=True):
        assert word in label.text()
    until(lambda: predicted(window))
    click(ranges, ranges.ranges.vb, drawn(ranges.marks[0])[20])
    until(lambda: not hint.isVisible() and session.shown.chosen == 20)
    window.close()
    window = open_with(memory=memory)
    hint, session, plan = window.hint, window.session, window.views.plan.drawing
    assert not hint.isVisible()
    key(window, "Shift+F1")
    marks, line, to_click = (label.text() for label in hint.labels)
    assert ("none yet" in marks, "Blue line: predicted" in line, "Click the blue line" in to_click) == (True,) * 3
    until(lambda: predicted(window))
    outline, (x, y) = session.shown.outline, session.shown.scene.pose.position
    reached = int(np.flatnonzero(np.isfinite(outline.ranges))[0])
    heading, away = outline.headings[reached], outline.ranges[reached]
    click(plan, plan.plot.vb, (x + away * np.cos(heading), y + away * np.sin(heading)))
    until(lambda: session.shown.answer is not None and not hint.isVisible())
    for end in (lambda: push(hint.close_button), lambda: hint.timer.start(1)):
        window.commands.show_first_steps.trigger()
        assert hint.isVisible()
        end()
        until(lambda: not hint.isVisible())
    session.set_scene(replace(scene, room=None, place=None))
    assert "needs a room (Ctrl+R)" in hint.labels[1].text()
    session.show_log(read_log(recorded))
    until(lambda: "from a fake scanner" in hint.labels[0].text())
    assert "Click a mark" in hint.labels[2].text()


def test_every_view_names_the_origin_of_readings(open_with: OpenWith, recorded: Path, tmp_path: Path) -> None:
    def legend(window: MainWindow) -> set[str]:
        entries = window.legend.entries.values()
        return {entry.text().lstrip("0123456789 ") for entry in entries if entry not in window.legend.unused}

    def never() -> Scanner:
        raise AssertionError("nothing connects")

    simulated = tmp_path / "simulated.mcap"
    assert run(["simulate", str(ROOM), "--place", "figure9", "--step", "30", "--out", str(simulated)]) == 0
    window = open_with(source=never, url="fake:simple?place=figure9")
    assert {"trace", "predicted"} <= legend(window)
    assert "none yet" in window.hint.labels[0].text()
    for path, origin, count in ((simulated, "simulated", 12), (recorded, "fake", ORDER.readings)):
        window.session.show_log(read_log(path), path.name, path)
        until(lambda count=count: len(window.session.shown.readings) == count)
        until(lambda origin=origin: f" · {origin} readings — " in window.windowTitle())
        assert reading_tip(window.session.shown, 0).splitlines()[1].startswith(f"{origin} ")
        header = window.views.table.model.headerData(Column.MEASURED, Qt.Orientation.Horizontal)
        assert header == f"{origin} (m)"
        window.views.side_by_side.show_state(window.session.shown)
        assert window.views.side_by_side.title.text() == origin.capitalize()
        fake, said = origin == "fake", window.hint.labels[0].text()
        until(lambda fake=fake: window.status_bar.fake.isVisible() == fake)
        assert ("hides one post" in said, origin in said, "measured" in said) == (fake, True, False)


# the start


def test_a_window_is_painted_before_it_predicts(qapp: object, scene: Scene, tmp_path: Path) -> None:
    """So that kernels do not delay the first paint. A window on another desktop is never painted."""
    for unpainted in (False, True):
        window = open_window(WindowStart(scene, recordings=tmp_path))
        assert not window.session.showing.forecast.searching
        window.setAttribute(Qt.WidgetAttribute.WA_DontShowOnScreen, unpainted)
        window.show()
        until(lambda window=window: predicted(window))
        window.close()
    window = open_window(WindowStart(scene, recordings=tmp_path))
    window.close()
    window.session.begin()
    assert not window.session.showing.forecast.searching


def test_height_and_receiver_of_the_options_are_those_of_the_prediction(monkeypatch: pytest.MonkeyPatch) -> None:
    starts: list[WindowStart] = []
    monkeypatch.setattr("sonarhw_cli.window._run", lambda start: starts.append(start) or 0)
    assert run(["gui", "doorstep", "--place", "1,1,0", "--height", "0.9", "--receiver", "board"]) == 0
    scene = starts[0].scene
    assert scene.room
    assert scene.place
    assert (scene.place.height, scene.options.receiver_of(scene.board)) == (0.9, Receiver.BOARD)


def test_a_demo_scan_waits(open_with: OpenWith, fake: OpenFake, monkeypatch: pytest.MonkeyPatch) -> None:
    """Hold the prediction back: no scan; let it go: the scan begins, over its outline."""
    gate, find_paths = threading.Event(), forecast.find_paths
    monkeypatch.setattr(forecast, "find_paths", lambda *args: gate.wait() and find_paths(*args))
    window = open_with(source=fake("max"), autostart=True)
    session, bar = window.session, window.status_bar
    try:
        until(lambda: "the scan begins when its prediction is there" in bar.activity.text())
        session.preparation.compiling(3, 60)
        until(lambda: "preparing the model (first start only)" in bar.activity.text())
        assert (bar.progress.isVisible(), bar.progress.value(), bar.progress.maximum()) == (True, 3, 60)
        assert "press Scan" not in window.sentence.text()
        assert session.live.job.phase is None
    finally:
        gate.set()
    session.preparation.compiled()
    until(lambda: len(session.shown.readings) > 0)
    assert session.shown.outline is not None
    until(lambda: not bar.progress.isVisible())
    session.stop()
