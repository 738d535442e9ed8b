"""What the window keeps: its last state, unsaved rooms, notes on readings, and the steps to undo."""

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import sonarhw_compare.scans as note_file
from hypothesis import given, settings
from hypothesis import strategies as st
from PySide6.QtCore import QByteArray, Qt
from PySide6.QtGui import QColor
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit, QMenu, QPushButton
from sonarhw_compare.scans import notes_of_log, notes_path
from sonarhw_gui.jobs.files import open_room
from sonarhw_gui.model.edits import sensor_at, with_air_state, with_corner, with_options
from sonarhw_gui.model.look import DARK, LIGHT, LengthUnit, Look
from sonarhw_gui.model.rows import Column
from sonarhw_gui.model.scene import Scene, SceneMemory
from sonarhw_gui.session.kept import Memory, UnsavedRooms, read_memory, read_unsaved, write_memory, write_unsaved
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.session.scanner import ScannerTarget, ScanSettings
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.window.bars import PICTURE
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.air import Unit
from sonarhw_sim.board.profile import load_board, parse_board
from sonarhw_sim.room.room import load_room, parse_room

from sonarhw.errors import InputError, OutputError
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui import driving as ui
from tests.system.gui.conftest import ORDER, OpenFake, OpenSession, OpenWith

# the last state


@pytest.fixture
def shipped(scene: Scene) -> Scene:
    """A scene with an unchanged board profile."""
    return replace(scene, board=load_board("polaroid-6500"))


def never(url: str) -> ScannerTarget:
    def opener() -> Scanner:
        raise AssertionError("connected without a request")

    return ScannerTarget(url, opener)


def reopened(open_with: OpenWith, memory: Path, scene: Scene) -> MainWindow:
    elsewhere = replace(scene, place=scene.room.place("figure7"))
    return open_with(scene=elsewhere, memory=memory, resume=True, find_scanner=never)


def choose(menu: QMenu, text: str) -> None:
    menu.show_names()
    next(action for action in menu.actions() if action.text() == text).trigger()


def test_the_session_is_restored(open_with: OpenWith, recorded: Path, tmp_path: Path, shipped: Scene) -> None:
    memory = tmp_path / "memory" / "window.ini"
    window = reopened(open_with, memory, shipped)  # the first start restores nothing
    session = window.session
    assert (session.shown.scene.place.name, window.banner.message) == ("figure7", "")
    session.open_file(str(recorded))
    ui.until(lambda: session.replay is not None)
    moved, _ = sensor_at(session.shown.scene, (0.4, 0.3))
    moved = replace(moved, place=replace(moved.place, heading=0.5))
    edited, _ = with_options(with_air_state(moved, temperature_c=3.0)[0], unit=Unit.BLOCK)
    edited = replace(edited, board=parse_board(f"range_offset = 0.02\n{edited.board.text}", "board"))
    session.showing.edit(edited, "finding the pose")
    scan_settings = replace(session.live.settings, traces=False, max_range=1.5, order=replace(ORDER, sweeps=3))
    session.live.settings, session.scanners.urls = scan_settings, ("socket://somewhere:4000",)
    trace, ranges, *_ = window.views.docks
    ranges.close()
    trace.setFloating(True)
    choose(window.layouts, "Save layout…")
    ui.dialog_of(window).setTextValue("lab & bench")
    ui.dialog_of(window).accept()
    window.commands.reset_layout.trigger()
    ui.until(lambda: ranges.isVisible() and not trace.isFloating())
    ui.key(window, "Ctrl+D", "Ctrl+2", "2", "F8")
    ui.until(lambda: read_memory(memory).look.palette is DARK)  # at once
    window.close()

    window = reopened(open_with, memory, shipped)
    session = window.session
    ui.until(lambda: session.replay is not None)
    there = session.shown.scene
    assert (there.place, there.room.text, there.options) == (edited.place, edited.room.text, edited.options)
    assert (there.board.range_offset, there.room.air.temperature_c) == (0.02, 3.0)
    assert len(session.shown.readings) == ORDER.readings
    assert window.banner.message == ""  # edits of the own room need no warning
    assert (session.live.settings, session.scanners.urls) == (scan_settings, ("socket://somewhere:4000",))
    assert session.shown.look == Look(DARK, LengthUnit.CM)
    assert window.commands.switch_palette.isChecked()
    assert window.views.side_by_side.isVisible()
    assert window.room.isVisible()
    assert window.files.actions()[0].data() == str(recorded)
    trace, ranges, *_ = window.views.docks
    choose(window.layouts, "lab && bench")
    ui.until(lambda: trace.isFloating() and not ranges.isVisible())
    window.layouts.show_names()
    window.layouts.deleting.actions()[0].trigger()
    assert not window.layouts.layouts


def test_what_is_not_restored_is_named(open_with: OpenWith, recorded: Path, tmp_path: Path, shipped: Scene) -> None:
    corridor = load_room("corridor")
    elsewhere = Scene(corridor, corridor.place("start"), shipped.board, "corridor.toml")
    memory, nonsense = tmp_path / "window.ini", QByteArray(b"nonsense")
    for scene, log, message in (
        (elsewhere, recorded, "recorded in simple.toml; they are now compared with corridor.toml"),
        (shipped, tmp_path / "gone.mcap", "gone.mcap"),
    ):
        write_memory(memory, Memory(scene=SceneMemory.of(scene), log=str(log)))
        window = reopened(open_with, memory, shipped)
        ui.until(lambda window=window, message=message: message in window.banner.message)
        assert window.session.shown.scene.place.name == scene.place.name
        window.close()
    memory.write_text("scene=3")
    window = reopened(open_with, memory, shipped)
    assert "window.ini" in window.banner.message
    assert window.session.shown.scene.place.name == "figure7"
    window.close()
    layout = dict.fromkeys(("window", "docks", "gone", "views"), nonsense)
    write_memory(memory, Memory(layout=layout, view=99))
    text = memory.read_text().replace("palette=light", "palette=pink").replace("unit=M", "unit=PARSEC")
    memory.write_text(text.replace("scale=1", "scale=99"))
    window = open_with(scene=shipped, memory=memory)
    assert window.views.plan.isVisible()
    assert window.session.shown.look == Look().scaled(99.0)


@pytest.mark.parametrize("used", [(), ("a, b.mcap",), ("ä.mcap", "@c;d.mcap")])
def test_written_settings_are_read_back(tmp_path: Path, shipped: Scene, used: tuple[str, ...]) -> None:
    scan_settings = ScanSettings(tmp_path, ORDER, traces=False, max_range=1.5)
    look = Look(DARK, LengthUnit.FT, 1.5)
    written = SceneMemory.of(shipped), "x.mcap", "socket://x", scan_settings, used, used, look, 2
    memory = Memory(*written, layout={"side": QByteArray(b"\0\xff,;")})
    file = tmp_path / "new" / "window.ini"
    write_memory(file, memory)
    assert read_memory(file) == memory
    file.write_text("")
    assert read_memory(file) == Memory()


def test_the_start_page_has_pictures(open_with: OpenWith, scene: Scene, recorded: Path, tmp_path: Path) -> None:
    memory, nothing = tmp_path / "window.ini", Scene(None, None, scene.board)
    window = open_with(scene=nothing, memory=memory)
    window.session.open_file(str(recorded))
    ui.until(lambda: ui.predicted(window))
    window.close()
    page = open_with(scene=nothing, memory=memory).start_page
    ui.until(page.isVisible)
    newest = next(button for button in page.findChildren(QPushButton) if recorded.name in button.text())
    picture = newest.icon().pixmap(PICTURE).toImage()
    colours = [picture.pixelColor(x, y) for x in range(picture.width()) for y in range(picture.height())]
    orange = QColor(LIGHT.measured)
    assert sum(abs(colour.hue() - orange.hue()) < 8 and colour.saturation() > 150 for colour in colours) > 8


def test_settings_in_what_is_no_file_are_neither_read_nor_replaced(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        write_memory(tmp_path / "file" / "window.ini", Memory())
    with pytest.raises(InputError, match="defaults are used"):
        read_memory(tmp_path)
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    for file, kind in ((tmp_path / "pipe", "named pipe"), (tmp_path / "device", "device")):
        before = file.stat()
        with pytest.raises(InputError, match=f"it is a {kind}"):
            read_memory(file)
        with pytest.raises(OutputError, match="is not a regular file"):
            write_memory(file, Memory())
        with pytest.raises(InputError, match="cannot be read"):
            read_unsaved(file)
        with pytest.raises(OSError, match="is not a regular file"):
            write_unsaved(file, "{}")
        assert (file.stat().st_mode, file.stat().st_ino) == (before.st_mode, before.st_ino)


# unsaved rooms

OTHER = "Other room"
Start = Callable[[Path], WindowSession]


@pytest.fixture
def other(tmp_path: Path) -> Path:
    path = tmp_path / "other.toml"
    path.write_text(ROOM.read_text().replace('name = "Simple room"', f'name = "{OTHER}"'))
    return path


@pytest.fixture
def start(open_session: OpenSession, tmp_path: Path) -> Start:
    """Begins the session of a window with a room file, as `sonarhw gui FILE` does."""

    def start_it(path: Path) -> WindowSession:
        scene = open_room(path, load_board("polaroid-6500")).scene
        return open_session(scene=scene, memory=tmp_path / "data" / "window.ini")

    return start_it


def draw(session: WindowSession) -> str:
    """Add a corner to a wall, and return the text of the room."""
    session.showing.edit(*with_corner(session.shown.scene, 0, (0.4, -0.05)))
    return session.shown.scene.room.text


def question(session: WindowSession) -> str:
    """Return the question that is shown after an update; empty without one."""
    session.tick()
    notice = session.notices.shown
    return notice.text if notice.accept is not None and notice.accept.text == "Restore" else ""


ASKED = "simple.toml has unsaved changes, made in the window on"


def test_changes_are_restored_after_a_crash(start: Start, other: Path, tmp_path: Path) -> None:
    session = start(ROOM)
    drawn_room = draw(session)
    session.close()
    session = start(other)
    assert question(session) == ""
    session.close()
    session = start(ROOM)
    assert ASKED in question(session)
    assert session.shown.scene.room.text == ROOM.read_text()
    session.notices.accept()
    assert session.shown.scene.room.text == drawn_room
    assert question(session) == ""
    session.open_file(str(other))  # in the same session
    ui.until(lambda: session.shown.scene.room.name == OTHER)
    session.open_file(str(ROOM))
    ui.until(lambda: ASKED in question(session))
    session.notices.accept()
    assert session.shown.scene.room.text == drawn_room
    session.showing.edit(*with_air_state(session.shown.scene, temperature_c=3.0))
    ui.until(lambda: any("3.0" in file.read_text() for file in (tmp_path / "data" / "unsaved").glob("*.json")))
    after_a_crash = start(ROOM)
    assert ASKED in question(after_a_crash)
    after_a_crash.notices.accept()
    assert after_a_crash.shown.scene.room.text == session.shown.scene.room.text


def test_a_found_pose_is_not_called_a_change_of_the_room(start: Start) -> None:
    session = start(ROOM)
    session.showing.edit(*sensor_at(session.shown.scene, (0.4, 0.3)))
    session.close()
    session = start(ROOM)
    assert "simple.toml: the sensor was moved in the window on" in question(session)
    session.notices.accept()
    assert session.shown.scene.pose.position == (0.4, 0.3)


def test_a_dismissed_question_comes_again_and_discarded_changes_do_not(start: Start) -> None:
    session = start(ROOM)
    draw(session)
    session.close()
    for answer in (Notices.dismiss, Notices.decline):
        session = start(ROOM)
        assert ASKED in question(session)
        answer(session.notices)
        assert question(session) == ""
        session.close()
    assert question(start(ROOM)) == ""


def rooms_in(folder: Path, notices: Notices) -> UnsavedRooms:
    return UnsavedRooms(folder, notices, lambda path: None)


def offered_files(notices: Notices) -> list[Path]:
    """Return the files that the window offers to restore."""
    return [notice.accept.subject for notice in notices.all]


def offered(folder: Path, scene: Scene) -> list[Scene]:
    """Return the scenes that can be restored when `scene` is opened."""
    notices = Notices()
    rooms_in(folder, notices).open(scene)
    return [read_unsaved(path).applied_to(scene) for path in offered_files(notices)]


def test_only_a_moved_sensor_is_restored(tmp_path: Path, scene: Scene) -> None:
    elsewhere = replace(scene, place=next(place for place in scene.room.places.values() if place != scene.place))
    warmer, _ = with_air_state(scene, temperature_c=3.0)
    for changed, place in ((warmer, elsewhere.place), (sensor_at(warmer, (0.4, 0.3))[0], None)):
        rooms = rooms_in(tmp_path, Notices())
        rooms.open(scene)
        rooms.change(changed, 0.0)
        rooms.tick(1.0)
        (there,) = offered(tmp_path, elsewhere)
        assert there.place == (place or changed.place)
        rooms.saved(changed)


def test_an_unreadable_file_is_kept_and_an_unwritable_folder_is_reported(tmp_path: Path, scene: Scene) -> None:
    notices, spoilt = Notices(), tmp_path / "spoilt.json"
    spoilt.write_text("{")
    rooms_in(tmp_path, notices).open(scene)
    assert "spoilt.json" in notices.shown.text
    assert spoilt.exists()
    rooms = rooms_in(spoilt, notices)
    rooms.open(scene)
    rooms.change(with_air_state(scene, temperature_c=3.0)[0], 0.0)
    rooms.tick(10.0)
    assert "save the room or lose its changes" in notices.shown.text


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
        self.open(room)

    def open(self, room: int, choice: int = 0) -> None:
        """Open another room in the same window."""
        self._rooms.open(self._files[room])
        self._room, self._start, self._now = room, self._files[room], self._files[room]
        self._offers = offered_files(self._notices)

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


# notes


@pytest.fixture
def log(recorded: Path, tmp_path: Path) -> Path:
    (tmp_path / "bench").mkdir()
    return Path(shutil.copy(recorded, tmp_path / "bench" / "scan.mcap"))


def with_log(session: WindowSession, log: Path) -> WindowSession:
    session.show_log(read_log(log), log.name, log)
    return session


def stored(log: Path) -> dict[int, str]:
    return notes_of_log(log, read_log(log).readings).texts


def test_notes_are_edited_with_keys_and_mouse(open_with: OpenWith, log: Path, recorded: Path) -> None:
    before = log.read_bytes()
    window = open_with(source=read_log(log), source_name=log.name, source_file=log)
    session, showing, table = window.session, window.session.showing, window.views.table
    ui.until(lambda: ui.predicted(window))

    def note(reading: int, text: str) -> None:
        showing.choose(reading)
        ui.key(window, "N")
        ui.enter(ui.dialog_of(window).findChild(QLineEdit), text)

    note(27, "false wall")
    assert stored(log) == {27: "false wall"}  # written at once
    assert window.bounces.text().startswith("note: false wall — 1 bottom")
    assert window.commands.edit_note.text() == "Edit note…"
    note(27, "false wall, 3 bounces")
    note(9, "the post")
    assert stored(log) == {9: "the post", 27: "false wall, 3 bounces"}
    plan, ranges = window.views.plan.drawing, window.views.ranges
    for marks in (plan.marks, ranges.marks[0]):
        assert {*zip(*marks.notes.getData(), strict=True)} == {ui.drawn(marks)[9], ui.drawn(marks)[27]}
        assert marks.notes.isVisible()
    window.legend.more.setChecked(True)
    assert window.legend.explained["note"].isVisible()
    assert not table.view.isColumnHidden(Column.NOTE)
    assert table.noted.text() == "2 notes"
    ui.push(table.noted)
    assert sorted(table.model.order.tolist()) == [9, 27]
    ui.push(table.noted)
    QTest.keyClicks(table.words, "post")
    assert table.model.order.tolist() == [9]
    table.words.clear()
    showing.choose(27)
    ui.key(window, "Shift+N")
    assert stored(log) == {9: "the post"}
    assert window.commands.undo.text() == "Undo deleting a note"
    for expected in ({9: "the post", 27: "false wall, 3 bounces"}, {27: "false wall, 3 bounces"}, {27: "false wall"}):
        ui.key(window, "Ctrl+Z")
        assert stored(log) == expected
    ui.key(window, "Ctrl+Z")
    assert not notes_path(log).exists()
    ui.key(window, "Ctrl+Shift+Z")
    assert stored(log) == {27: "false wall"}

    # the context menu notes the reading below the mouse
    for place in ("plan", "ranges", "table"):
        if place == "table":
            reading, below = 2, table.view.viewport()
            at = table.view.visualRect(table.model.index(reading, Column.HEADING)).center()
        else:
            view, marks = (plan, plan.marks) if place == "plan" else (ranges, ranges.marks[0])
            box = plan.plot.vb if place == "plan" else ranges.ranges.vb
            reading, point = next((k, at) for k, at in ui.drawn(marks).items() if box.viewRect().contains(*at))
            below, at = view.viewport(), ui.pixel_at(view, box, point)
        QTest.mouseClick(below, Qt.MouseButton.RightButton, pos=at)
        menu = ui.menu_of(below, at)
        assert showing.shown.chosen == reading
        next(action for action in menu.actions() if action.text() in ("Add note…", "Edit note…")).trigger()
        menu.close()
        ui.enter(ui.dialog_of(window).findChild(QLineEdit), place)
        assert stored(log)[reading] == place
    assert log.read_bytes() == before

    # a dialog about a reading that is gone changes nothing
    showing.choose(3)
    ui.key(window, "N")
    QTest.keyClicks(ui.dialog_of(window).findChild(QLineEdit), "too late")
    session.open_file(str(recorded))
    ui.until(lambda: session.log_file == os.path.abspath(recorded))
    ui.dialog_of(window).accept()
    assert not session.shown.notes
    ui.until(lambda: "too late" in window.banner.message)
    assert not notes_path(recorded).exists()
    session.leave_replay()
    ui.until(lambda: not window.commands.edit_note.isEnabled() and not window.commands.delete_note.isEnabled())


def test_notes_of_a_live_scan_are_kept(open_session: OpenSession, fake: OpenFake, recorded: Path) -> None:
    session = open_session(fake("max"))
    session.scan()
    ui.until(lambda: ui.ended(session) and len(session.shown.readings) == ORDER.readings)
    session.showing.pin(5, "while it was new")
    recording = Path(session.log_file)
    assert stored(recording) == {5: "while it was new"}
    session.open_file(str(recorded))
    ui.until(lambda: ui.log_name(session) == recorded.name)
    assert not session.shown.notes
    assert "note" not in session.showing.history.undo_label  # its readings are no longer shown
    session.leave_replay()
    assert session.shown.notes.of(5) == "while it was new"
    session.scan()
    assert not session.shown.notes
    ui.until(lambda: ui.ended(session) and session.status.job.recording not in (None, recording))
    assert stored(recording) == {5: "while it was new"}


def test_a_folder_that_cannot_be_written_gives_one_line_and_loses_no_note(
    open_session: OpenSession, log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = note_file.atomic_file

    def refuse(path: Path, *arguments: object, **options: object) -> object:
        if path.parent == log.parent:
            raise OutputError(f"{path}: Read-only file system; choose another folder for the log")
        return write(path, *arguments, **options)

    memory, unsaved = tmp_path / "state" / "window.ini", tmp_path / "state" / "unsaved"
    session, warned = with_log(open_session(memory=memory), log), []
    session.notices.changed.connect(lambda: warned.append(session.notices.shown.text))
    with monkeypatch.context() as patch:  # tests run as root, who may write everywhere
        patch.setattr(note_file, "atomic_file", refuse)
        session.showing.pin(4, "on a stick")
        session.showing.pin(5, "another")
        session.tick()
    assert len([text for text in warned if text]) == 1
    assert "scan.notes.csv: Read-only file system" in warned[-1]
    assert f"keeps the notes in {unsaved} meanwhile" in warned[-1]
    assert not notes_path(log).exists()
    session.close()
    again = with_log(open_session(memory=memory), log)
    assert dict(again.shown.notes.by_reading) == {4: "on a stick", 5: "another"}
    again.showing.pin(6, "third")
    assert stored(log) == {4: "on a stick", 5: "another", 6: "third"}
    assert not list(unsaved.glob("*.csv"))


# undo
