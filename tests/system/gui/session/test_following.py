"""A log that is being written is followed, and a changed room or board file is reloaded on request."""

from pathlib import Path

import pytest
import sonarhw_sim.board
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs.files import FileWatch
from sonarhw_gui.model.edits import with_corner
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board

from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import predicted, until

BOARDS = Path(sonarhw_sim.board.__file__).parent / "shipped"


def count(window: MainWindow) -> int:
    return len(window.session.shown.readings)


@pytest.fixture
def growing(recorded: Path, tmp_path: Path) -> tuple[Path, bytes]:
    """Return a log that contains half of its readings so far, and the rest of its bytes."""
    whole, path = recorded.read_bytes(), tmp_path / "growing.mcap"
    path.write_bytes(whole[: len(whole) // 2])
    return path, whole[len(whole) // 2 :]


def test_a_log_that_is_being_written_is_followed_to_its_end(
    qtbot: QtBot,
    open_with: OpenWith,
    growing: tuple[Path, bytes],
    recorded: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sonarhw_gui.jobs.files.TORN_AFTER", 1e6)
    path, rest = growing
    window = open_with()
    window.session.open_file(str(path))
    until(qtbot, lambda: count(window) > 0)
    first = window.session.shown.readings
    assert len(first) < ORDER.readings
    assert not window.banner.isVisible()  # it is not a damaged log
    for part in (rest[: len(rest) // 2], rest[len(rest) // 2 :]):
        before = count(window)
        with path.open("ab") as file:
            file.write(part)
        until(qtbot, lambda before=before: count(window) > before)
    expected = [(reading.time, reading.echo_times) for reading in read_log(recorded).readings]
    assert [(reading.time, reading.echo_times) for reading in window.session.shown.readings] == expected
    assert all(one is other for one, other in zip(first, window.session.shown.readings, strict=False))
    until(qtbot, lambda: predicted(window))
    until(qtbot, lambda: window.status_bar.activity.text().startswith("replaying growing.mcap"))


def test_while_it_grows_the_status_bar_says_so_and_a_position_is_kept(
    qtbot: QtBot, open_with: OpenWith, growing: tuple[Path, bytes]
) -> None:
    path, rest = growing
    window = open_with()
    window.session.open_file(str(path))
    until(qtbot, lambda: count(window) > 4)
    window.session.replay.seek_reading(3)
    until(qtbot, lambda: count(window) == 4)
    with path.open("ab") as file:
        file.write(rest[: len(rest) // 2])
    until(qtbot, lambda: window.status_bar.activity.text().startswith("following growing.mcap"))
    until(qtbot, lambda: len(window.session.replay.readings) > window.session.replay.count + 1)
    assert count(window) == 4


def test_a_torn_log_that_is_not_written_any_more_is_reported(
    qtbot: QtBot, open_with: OpenWith, growing: tuple[Path, bytes]
) -> None:
    import os

    path, _ = growing
    os.utime(path, (1.0, 1.0))
    window = open_with()
    window.session.open_file(str(path))
    until(qtbot, lambda: count(window) > 0)
    assert "whole readings are shown" in window.banner._label.text()


def test_a_changed_room_file_is_reloaded_on_request_at_the_same_place_and_fits(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path
) -> None:
    path = tmp_path / "own.toml"
    path.write_text(ROOM.read_text())
    window = open_with()
    window.session.open_file(str(path))
    until(qtbot, lambda: window.session.shown.scene.room_file == path.name)
    window.session.showing.set_place("figure7")
    path.write_text(ROOM.read_text().replace("0.742", "1.742"))
    until(qtbot, window.banner.isVisible)
    assert "own.toml has changed on disk" in window.banner._label.text()
    before = window.session.shown.scene.room.walls.max()
    assert before < 1
    qtbot.mouseClick(window.banner.accept_button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: window.session.shown.scene.room.walls.max() > 1.7)
    assert window.session.shown.scene.pose.name == "figure7"
    assert window.views.plan.drawing.plot.vb.viewRect().bottom() > 1.742


@pytest.fixture
def edited(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> tuple[MainWindow, Path]:
    """Return a window with a moved corner in a room file of its own, and the file."""
    path = tmp_path / "own.toml"
    path.write_text(ROOM.read_text())
    window = open_with(memory=tmp_path / "data" / "window.ini")
    window.session.open_file(str(path))
    until(qtbot, lambda: window.session.shown.scene.room_file == path.name)
    scene, label = with_corner(window.session.shown.scene, 0, (0.4, -0.05))
    window.session.showing.edit(scene, label)
    return window, path


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("0.742", "1.742", "own.toml was changed outside: line"),
        ('name = "Simple room"', "name = 3", "it is not a valid room: own.toml: name"),
    ],
)
def test_a_room_file_that_was_changed_outside_is_never_overwritten_without_a_question(
    qtbot: QtBot, edited: tuple[MainWindow, Path], old: str, new: str, said: str
) -> None:
    window, path = edited
    theirs = ROOM.read_text().replace(old, new)
    path.write_text(theirs)
    window.commands.save_room.trigger()
    assert "not saved" in window.banner.message
    assert said in window.banner.message
    assert path.read_text() == theirs
    qtbot.mouseClick(window.banner.accept_button, Qt.MouseButton.LeftButton)
    assert path.read_text() == window.session.shown.scene.written_room.text
    assert (path.parent / "own-before.toml").read_text() == theirs
    assert "own-before.toml" in window.banner.message
    window.commands.save_room.trigger()  # it is this window's content now
    assert not (path.parent / "own-before_2.toml").exists()


def test_instead_of_overwriting_a_changed_room_file_it_is_reloaded_and_the_edits_can_be_restored(
    qtbot: QtBot, edited: tuple[MainWindow, Path]
) -> None:
    window, path = edited
    mine = window.session.shown.scene.room.text
    path.write_text(ROOM.read_text().replace("0.742", "1.742"))
    window.commands.save_room.trigger()
    qtbot.mouseClick(window.banner.decline_button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: window.session.shown.scene.room.walls.max() > 1.7)
    until(qtbot, lambda: "own.toml has unsaved changes" in window.banner.message)
    qtbot.mouseClick(window.banner.accept_button, Qt.MouseButton.LeftButton)
    assert window.session.shown.scene.room.text == mine


def test_a_room_file_that_was_removed_is_written_again(qtbot: QtBot, edited: tuple[MainWindow, Path]) -> None:
    window, path = edited
    path.unlink()
    window.commands.save_room.trigger()
    assert path.read_text() == window.session.shown.scene.written_room.text


def test_a_changed_board_profile_is_reloaded_on_request(qtbot: QtBot, open_with: OpenWith, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text((BOARDS / "hc-sr04.toml").read_text())
    window = open_with()
    window.session.open_board(str(path))
    assert window.session.shown.scene.board.max_range == load_board("hc-sr04").max_range
    path.write_text((BOARDS / "lego-nxt.toml").read_text())
    until(qtbot, window.banner.isVisible)
    qtbot.mouseClick(window.banner.accept_button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: window.session.shown.scene.board.max_range == load_board("lego-nxt").max_range)


def test_each_change_is_reported_once_and_a_missing_file_is_awaited(tmp_path: Path, scene: Scene) -> None:
    path, files = tmp_path / "room.toml", FileWatch()
    path.write_text("a")
    files.watch("room", path)
    assert not list(files.changed(0.0))
    path.write_text("longer")
    assert not list(files.changed(0.5))  # looks once a second
    assert list(files.changed(1.0)) == [("room", path)]
    assert not list(files.changed(2.0))
    path.unlink()
    assert not list(files.changed(3.0))
    path.write_text("again and longer")
    assert [what for what, _ in files.changed(4.0)] == ["room"]
    files.watch("room", None)
    path.write_text("unseen")
    assert not list(files.changed(5.0))
