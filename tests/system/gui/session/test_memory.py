"""The window restores its last state; missing or damaged settings are replaced by defaults."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import QByteArray, Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.edits import sensor_at, with_air_state, with_options
from sonarhw_gui.model.look import DARK, LengthUnit, Look
from sonarhw_gui.model.scene import Scene, SceneMemory
from sonarhw_gui.session.kept import Memory, read_memory, read_unsaved, write_memory, write_unsaved
from sonarhw_gui.session.scanner import ScannerTarget, ScanSettings
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.air import Unit
from sonarhw_sim.board.profile import load_board, parse_board
from sonarhw_sim.room.room import load_room

from sonarhw.errors import InputError, OutputError
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenWith
from tests.system.gui.driving import predicted, until

CONTROL = Qt.KeyboardModifier.ControlModifier


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


def test_a_log_is_restored_with_views_and_look(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path, shipped: Scene
) -> None:
    memory = tmp_path / "memory" / "window.ini"
    window = open_with(scene=shipped, memory=memory, find_scanner=never)
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.replay is not None)
    qtbot.keyClick(window, Qt.Key.Key_D, CONTROL)
    qtbot.keyClick(window, Qt.Key.Key_2, CONTROL)
    qtbot.keyClick(window, Qt.Key.Key_2)
    qtbot.keyClick(window, Qt.Key.Key_F8)
    window.close()

    window = reopened(open_with, memory, shipped)
    until(qtbot, lambda: window.session.replay is not None)
    assert len(window.session.shown.readings) == ORDER.readings
    assert window.session.shown.scene.place.name == "figure9"
    assert window.session.shown.look == Look(DARK, LengthUnit.CM)
    assert window.commands.switch_palette.isChecked()
    assert window.views.side_by_side.isVisible()
    assert window.room.isVisible()
    assert window.files.actions()[0].data() == str(recorded)


def test_a_moved_sensor_and_the_scan_settings_are_restored(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path, shipped: Scene
) -> None:
    memory = tmp_path / "window.ini"
    window = open_with(scene=shipped, memory=memory, find_scanner=never)
    there = replace(shipped.place, position=(0.4, 0.3), heading=0.5)
    options = replace(shipped.options, unit=Unit.BLOCK)
    window.session.showing.edit(replace(shipped, place=there, options=options), "moving the sensor")
    scan_settings = replace(window.session.live.settings, traces=False, max_range=1.5, order=replace(ORDER, sweeps=3))
    window.session.live.settings = scan_settings
    window.close()
    window = reopened(open_with, memory, shipped)
    assert window.session.shown.scene.place == there
    assert window.session.shown.scene.options == options
    assert window.session.live.settings == scan_settings
    assert window.session.shown.scene.room.text == shipped.room.text


def test_a_fitted_place_and_an_edited_room_are_restored_with_their_log(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path, shipped: Scene
) -> None:
    memory = tmp_path / "window.ini"
    window = open_with(scene=shipped, memory=memory, find_scanner=never)
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.replay is not None)
    moved, _ = sensor_at(window.session.shown.scene, (0.4, 0.3))
    edited, _ = with_air_state(moved, temperature_c=3.0)
    board = parse_board(f"range_offset = 0.02\n{edited.board.text}", "board")
    edited = replace(with_options(edited, unit=Unit.BLOCK)[0], board=board)
    window.session.showing.edit(edited, "finding the pose")
    window.close()

    window = reopened(open_with, memory, shipped)
    until(qtbot, lambda: window.session.replay is not None)
    there = window.session.shown.scene
    assert (there.place, there.room.text, there.options) == (edited.place, edited.room.text, edited.options)
    assert (there.board.range_offset, there.room.air.temperature_c) == (0.02, 3.0)
    assert len(window.session.shown.readings) == ORDER.readings
    assert window.banner.message == ""  # edits of the own room need no warning


def test_a_restored_log_that_was_recorded_in_another_room_is_shown_with_a_warning(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, tmp_path: Path, shipped: Scene
) -> None:
    corridor = load_room("corridor")
    elsewhere = Scene(corridor, corridor.place("start"), shipped.board, "corridor.toml")
    memory = tmp_path / "window.ini"
    write_memory(memory, Memory(scene=SceneMemory.of(elsewhere), log=str(recorded)))
    window = reopened(open_with, memory, shipped)
    until(qtbot, lambda: window.session.replay is not None)
    assert "recorded in simple.toml; they are now compared with corridor.toml" in window.banner.message


def test_after_closing_during_a_scan_the_recording_is_restored_and_nothing_moves(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, tmp_path: Path, shipped: Scene
) -> None:
    memory = tmp_path / "window.ini"
    window = open_with(
        scene=shipped,
        memory=memory,
        find_scanner=never,
        url="socket://scanner",
        source=fake(4.0),
        autostart=True,
        order=ENDLESS,
    )
    until(qtbot, lambda: len(window.session.shown.readings) >= 3)
    recording = window.session.status.job.recording
    window.close()
    kept = len(read_log(recording).readings)
    assert 3 <= kept < ENDLESS.readings

    window = reopened(open_with, memory, shipped)
    until(qtbot, lambda: window.session.replay is not None and predicted(window))
    assert len(window.session.shown.readings) == kept
    assert window.session.status.replay is not None
    assert window.commands.scan.isEnabled()  # with the scanner of the last session


def test_the_first_start_and_a_start_with_a_file_restore_nothing(
    open_with: OpenWith, tmp_path: Path, shipped: Scene
) -> None:
    memory = tmp_path / "window.ini"
    window = reopened(open_with, memory, shipped)
    assert window.session.shown.scene.place.name == "figure7"
    assert window.banner.message == ""
    window.close()
    window = open_with(scene=shipped, memory=memory, find_scanner=never)
    assert window.session.shown.scene.place.name == "figure9"


def test_a_missing_log_is_reported_and_its_room_is_shown(
    qtbot: QtBot, open_with: OpenWith, tmp_path: Path, shipped: Scene
) -> None:
    memory = tmp_path / "window.ini"
    write_memory(memory, Memory(scene=SceneMemory.of(shipped), log=str(tmp_path / "gone.mcap")))
    window = reopened(open_with, memory, shipped)
    until(qtbot, lambda: "gone.mcap" in window.banner.message)
    assert window.session.shown.scene.place.name == "figure9"


@pytest.mark.parametrize("text", ["{", "scene=3", 'scene="{}"', "scan=[]", "look/scale=large", "[look", "\udcff"])
def test_damaged_settings_are_reported_and_the_window_opens(
    open_with: OpenWith, tmp_path: Path, shipped: Scene, text: str
) -> None:
    memory = tmp_path / "window.ini"
    memory.write_bytes(text.encode("utf-8", "surrogateescape"))
    window = reopened(open_with, memory, shipped)
    assert "window.ini" in window.banner.message
    assert window.session.shown.scene.place.name == "figure7"


def test_an_unknown_layout_is_replaced_by_the_default(open_with: OpenWith, tmp_path: Path, shipped: Scene) -> None:
    memory = tmp_path / "window.ini"
    nonsense = QByteArray(b"nonsense")
    layout = {"window": nonsense, "docks": nonsense, "gone": nonsense, "views": nonsense}
    write_memory(memory, Memory(layout=layout, view=99))
    text = memory.read_text().replace("palette=light", "palette=pink").replace("unit=M", "unit=PARSEC")
    memory.write_text(text.replace("scale=1", "scale=99"))
    window = open_with(scene=shipped, memory=memory)
    assert window.views.plan.isVisible()
    assert window.session.shown.look == Look().scaled(99.0)
    assert "PARSEC" in text


@pytest.mark.parametrize("used", [(), ("a, b.mcap",), ("ä.mcap", "@c;d.mcap")])
def test_written_settings_are_read_back(tmp_path: Path, shipped: Scene, used: tuple[str, ...]) -> None:
    settings = ScanSettings(tmp_path, ORDER, traces=False, max_range=1.5)
    memory = Memory(
        *(
            SceneMemory.of(shipped),
            "x.mcap",
            "socket://x",
            settings,
            used,
            used,
            Look(DARK, LengthUnit.FT, 1.5),
            2,
        ),
        layout={"side": QByteArray(b"\0\xff,;")},
    )
    write_memory(tmp_path / "new" / "window.ini", memory)
    assert read_memory(tmp_path / "new" / "window.ini") == memory


def test_an_empty_file_gives_default_settings(tmp_path: Path) -> None:
    (tmp_path / "window.ini").touch()
    assert read_memory(tmp_path / "window.ini") == Memory()


def test_unwritable_and_unreadable_settings_are_errors(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        write_memory(tmp_path / "file" / "window.ini", Memory())
    with pytest.raises(InputError, match="defaults are used"):
        read_memory(tmp_path)


def test_a_settings_file_that_is_not_regular_is_neither_read_nor_replaced(tmp_path: Path) -> None:
    for kind in ("pipe", "device"):
        file = tmp_path / kind
        if kind == "pipe":
            os.mkfifo(file)
        else:
            file.symlink_to("/dev/zero")
        before = file.stat()
        with pytest.raises(InputError, match=f"it is a {'named ' if kind == 'pipe' else ''}{kind}"):
            read_memory(file)
        with pytest.raises(OutputError, match="is not a regular file"):
            write_memory(file, Memory())
        with pytest.raises(InputError, match="cannot be read"):
            read_unsaved(file)
        with pytest.raises(OSError, match="is not a regular file"):
            write_unsaved(file, "{}")
        assert (file.stat().st_mode, file.stat().st_ino) == (before.st_mode, before.st_ino)
