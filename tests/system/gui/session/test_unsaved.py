"""Unsaved changes are never lost: they can be restored, whichever file the next window opens."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs.files import open_room
from sonarhw_gui.model.edits import sensor_at, with_air_state, with_corner
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.session.kept import UnsavedRooms, read_unsaved
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board, parse_board
from sonarhw_sim.room.room import parse_room

from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import PATIENCE, until

LEFT, CONTROL = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.ControlModifier
OTHER = "Other room"


@pytest.fixture
def other(tmp_path: Path) -> Path:
    path = tmp_path / "other.toml"
    path.write_text(ROOM.read_text().replace('name = "Simple room"', f'name = "{OTHER}"'))
    return path


@pytest.fixture
def start(open_with: OpenWith, tmp_path: Path) -> Callable[[Path], MainWindow]:
    """Opens a window with a room file, as `sonarhw gui FILE` does."""

    def start_it(path: Path) -> MainWindow:
        scene = open_room(path, load_board("polaroid-6500")).scene
        return open_with(scene=scene, memory=tmp_path / "data" / "window.ini")

    return start_it


def draw(window: MainWindow) -> str:
    """Add a corner to a wall, and return the text of the room."""
    scene, label = with_corner(window.session.shown.scene, 0, (0.4, -0.05))
    window.session.showing.edit(scene, label)
    return scene.room.text


def question_text(window: MainWindow) -> str:
    return window.banner.message if window.banner.accept_button.text() == "Restore" else ""


def until_asked(qtbot: QtBot, window: MainWindow, about: str) -> None:
    until(qtbot, lambda: f"{about} has unsaved changes, made in the window on" in question_text(window))


def never_asked(qtbot: QtBot, window: MainWindow) -> bool:
    """Return whether the window asks nothing after an update."""
    with qtbot.waitSignal(window.session.showing.changed, timeout=PATIENCE):
        window.session.showing.update_soon()
    return question_text(window) == ""


def test_changes_are_restored_after_another_file_was_opened(
    qtbot: QtBot, start: Callable[[Path], MainWindow], other: Path
) -> None:
    window = start(ROOM)
    drawn = draw(window)
    window.close()
    window = start(other)
    assert never_asked(qtbot, window)
    window.close()

    window = start(ROOM)
    until_asked(qtbot, window, "simple.toml")
    assert window.session.shown.scene.room.text == ROOM.read_text()
    qtbot.mouseClick(window.banner.accept_button, LEFT)
    assert window.session.shown.scene.room.text == drawn
    assert question_text(window) == ""


def test_changes_before_a_crash_can_be_restored(
    qtbot: QtBot, start: Callable[[Path], MainWindow], tmp_path: Path
) -> None:
    crashed = start(ROOM)
    drawn = draw(crashed)
    until(qtbot, lambda: any((tmp_path / "data" / "unsaved").glob("*.json")))
    window = start(ROOM)
    until_asked(qtbot, window, "simple.toml")
    qtbot.mouseClick(window.banner.accept_button, LEFT)
    assert window.session.shown.scene.room.text == drawn


def test_reopening_a_room_in_the_same_window_offers_its_unsaved_changes(
    qtbot: QtBot, start: Callable[[Path], MainWindow], other: Path
) -> None:
    window = start(ROOM)
    drawn = draw(window)
    window.session.open_file(str(other))
    until(qtbot, lambda: window.session.shown.scene.room.name == OTHER)
    window.session.open_file(str(ROOM))
    until_asked(qtbot, window, "simple.toml")
    qtbot.mouseClick(window.banner.accept_button, LEFT)
    assert window.session.shown.scene.room.text == drawn


def test_there_is_no_question_about_saved_or_undone_changes(
    qtbot: QtBot, start: Callable[[Path], MainWindow], tmp_path: Path
) -> None:
    window = start(ROOM)
    draw(window)
    window.session.kept.rooms.write()
    window.session.save_room(str(tmp_path / "saved.toml"))
    window.close()
    for path in (ROOM, tmp_path / "saved.toml"):
        window = start(path)
        assert never_asked(qtbot, window)
        window.close()
    window = start(ROOM)
    draw(window)
    window.session.kept.rooms.write()
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL)
    window.close()
    assert never_asked(qtbot, start(ROOM))


def test_a_dismissed_question_comes_again_and_discarded_changes_do_not(
    qtbot: QtBot, start: Callable[[Path], MainWindow]
) -> None:
    window = start(ROOM)
    draw(window)
    window.close()
    for button in ("close_button", "decline_button"):
        window = start(ROOM)
        until_asked(qtbot, window, "simple.toml")
        qtbot.mouseClick(getattr(window.banner, button), LEFT)
        assert question_text(window) == ""
        window.close()
    assert never_asked(qtbot, start(ROOM))


def test_the_question_mentions_a_file_that_has_changed(
    qtbot: QtBot, start: Callable[[Path], MainWindow], tmp_path: Path
) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(ROOM.read_text())
    window = start(path)
    draw(window)
    window.close()
    path.write_text(ROOM.read_text().replace("0.928", "0.930"))
    window = start(path)
    until_asked(qtbot, window, "mine.toml")
    assert "the file has changed since then" in question_text(window)


def test_restoring_a_room_keeps_place_and_board_of_a_log(
    qtbot: QtBot, start: Callable[[Path], MainWindow], open_with: OpenWith, recorded: Path, tmp_path: Path
) -> None:
    window = start(ROOM)
    window.session.open_board("paper")
    drawn = draw(window)
    window.close()
    log = read_log(recorded)
    scene, _ = sensor_at(scene_of_log(log.metadata), (0.5, 0.4))
    window = open_with(scene=scene, source=log, memory=tmp_path / "data" / "window.ini")
    until_asked(qtbot, window, "simple.toml")
    qtbot.mouseClick(window.banner.accept_button, LEFT)
    there = window.session.shown.scene
    assert (there.room.text, there.place, there.board) == (drawn, scene.place, scene.board)
    assert len(window.session.shown.readings) == len(log.readings)
    assert never_asked(qtbot, window)


def test_a_moved_sensor_and_a_fitted_offset_are_restored(tmp_path: Path, scene: Scene) -> None:
    moved, _ = sensor_at(scene, (0.4, 0.3))
    board = parse_board(f"range_offset = 0.02\n{scene.board.text}", "board")
    fitted = replace(moved, board=replace(board, name=scene.board.name))
    leave(tmp_path, scene, fitted)
    (there,) = offered(tmp_path, scene)
    assert (there.place, there.board.range_offset) == (moved.place, 0.02)


def test_an_unreadable_file_is_reported_and_kept(tmp_path: Path, scene: Scene) -> None:
    (tmp_path / "spoilt.json").write_text("{")
    notices = Notices()
    rooms_in(tmp_path, notices).open(scene)
    assert "spoilt.json" in notices.shown.text
    assert (tmp_path / "spoilt.json").exists()


def test_an_unwritable_folder_is_reported(tmp_path: Path, scene: Scene) -> None:
    (tmp_path / "file").write_text("in the way")
    notices = Notices()
    rooms = rooms_in(tmp_path / "file", notices)
    rooms.open(scene)
    rooms.change(with_air_state(scene, temperature_c=3.0)[0], 0.0)
    rooms.tick(10.0)
    assert "save the room or lose its changes" in notices.shown.text


def rooms_in(folder: Path, notices: Notices) -> UnsavedRooms:
    return UnsavedRooms(folder, notices, lambda path: None)


def offered_files(notices: Notices) -> list[Path]:
    """Return the files that the window offers to restore."""
    return [notice.accept.subject for notice in notices.all]


def leave(folder: Path, opened: Scene, changed: Scene) -> None:
    rooms = rooms_in(folder, Notices())
    rooms.open(opened)
    rooms.change(changed, 0.0)
    rooms.write()


def offered(folder: Path, scene: Scene) -> list[Scene]:
    """Return the scenes that can be restored when `scene` is opened."""
    notices = Notices()
    rooms = rooms_in(folder, notices)
    rooms.open(scene)
    return [read_unsaved(path).applied_to(scene) for path in offered_files(notices)]


class Editor:
    """Edits rooms in several windows, one at a time, and keeps a list of the unsaved changes."""

    def __init__(self, folder: Path, rooms: list[Scene]) -> None:
        self.unsaved: list[dict[float, str]] = [{} for _ in rooms]
        self._folder, self._files, self._drawn = folder, rooms, 0
        self.start(0)

    def start(self, room: int, choice: int = 0) -> None:
        """Open a new window; the previous one was closed, or crashed after its last change was stored."""
        self._notices = Notices()
        self._rooms = rooms_in(self._folder, self._notices)
        self._open(room)

    def open(self, room: int, choice: int = 0) -> None:
        """Open another room in the same window."""
        self._open(room)

    def draw(self, room: int, choice: int = 0) -> None:
        """Make a change that was never made before."""
        self._drawn += 1
        self._change(with_air_state(self._now, temperature_c=self._drawn / 64)[0])

    def undo_all(self, room: int, choice: int = 0) -> None:
        """Undo all changes since the room was opened or restored."""
        self._change(self._start)

    def restore(self, room: int, choice: int = 0) -> None:
        """Accept one of the offers, if there are any."""
        if self._offers:
            path = self._offers[choice % len(self._offers)]
            self._start = self._now = read_unsaved(path).applied_to(self._now)
            self._rooms.open(self._now, path)
            self._offers = offered_files(self._notices)

    def save(self, room: int, choice: int = 0) -> None:
        """Save the room as a file."""
        self._rooms.saved(self._now)
        self.unsaved[self._room].pop(_degrees(self._now), None)

    def _open(self, room: int) -> None:
        self._rooms.open(self._files[room])
        self._room, self._start, self._now = room, self._files[room], self._files[room]
        self._offers = offered_files(self._notices)

    def _change(self, scene: Scene) -> None:
        unsaved = self.unsaved[self._room]
        unsaved.pop(_degrees(self._now), None)
        if scene is not self._files[self._room]:
            unsaved[_degrees(scene)] = scene.room.text
        self._now = scene
        self._rooms.change(scene, 0.0)
        self._rooms.tick(1.0)


def _degrees(scene: Scene) -> float:
    return scene.room.air.temperature_c


STEPS = (Editor.start, Editor.open, Editor.draw, Editor.draw, Editor.undo_all, Editor.restore, Editor.save)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(st.tuples(st.sampled_from(STEPS), st.integers(0, 1), st.integers(0, 3)), max_size=14))
def test_all_unsaved_changes_can_be_restored_after_any_sequence_of_actions(
    tmp_path_factory: pytest.TempPathFactory, scene: Scene, steps: list[tuple[Callable[..., None], int, int]]
) -> None:
    other = parse_room(scene.room.text.replace("Simple room", OTHER), "other.toml")
    files = [scene, replace(scene, room_file="other.toml", room=other)]
    folder = tmp_path_factory.mktemp("unsaved")
    editor = Editor(folder, files)
    for step, room, choice in steps:
        step(editor, room, choice)
    for unsaved, file in zip(editor.unsaved, files, strict=True):
        assert sorted(unsaved.values()) == sorted(there.room.text for there in offered(folder, file))
