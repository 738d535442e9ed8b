"""The log of a scan with a fake scanner names the place and the board that the fake really has."""

import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_cli.window import _Scanners
from sonarhw_compare.match import compare_readings
from sonarhw_compare.one_call import read_fake_url
from sonarhw_gui.model.edits import with_sensor_at
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.bars import FAKE as FAKE_LABEL
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.log import Log, read_log
from sonarhw.readings import ScanOrder
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import drag, ended, predicted, until

SHORT = ScanOrder(start=0.0, step=math.radians(30), headings=12)


@pytest.fixture(scope="module")
def room_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the room `simple` with walls that absorb: few paths are loud, so the fake scanner needs little time."""
    file = tmp_path_factory.mktemp("room") / "simple.toml"
    file.write_text(load_room("simple").text.replace("reflectance = 0.95", "reflectance = 0.5"))
    return file


@pytest.fixture(scope="module")
def fake(room_file: Path) -> str:
    """Return the URL of the fake scanner."""
    return f"fake:{room_file}?place=figure7&board=lego-nxt&seed=3&pace=max"


@pytest.fixture
def scanners() -> Iterator[_Scanners]:
    with ExitStack() as during:
        yield _Scanners(during)


@pytest.fixture
def window(open_with: OpenWith, scanners: _Scanners, fake: str) -> MainWindow:
    """Open a window on the fake scanner in its room, as `sonarhw gui FAKE` does."""
    room = load_room(read_fake_url(fake).room)
    scene = Scene(room, room.place("figure7"), load_board("lego-nxt"), "simple.toml")
    return open_with(scene=scene, source=scanners.opener(fake), url=fake, find_scanner=scanners.find, order=SHORT)


def scan(qtbot: QtBot, window: MainWindow) -> Log:
    """Scan, and return the log."""
    before = window.session.status.recording
    window.session.scan()
    return scanned(qtbot, window, before)


def scanned(qtbot: QtBot, window: MainWindow, before: Path | None = None) -> Log:
    """Return the log of the scan that has begun; `before`: the log of an earlier scan."""
    until(qtbot, lambda: ended(window) and window.session.status.recording not in (None, before))
    return read_log(window.session.status.recording)


def choose(window: MainWindow, place: str, board: str) -> None:
    """Choose a place and a board in the window."""
    window.docks.show("Room")
    window.toolbar.place.textActivated.emit(place)
    window.room.model.board.textActivated.emit(board)
    assert (window.session.shown.scene.pose.name, window.session.shown.scene.board.name) == (place, board)


def is_of(log: Log, url: str) -> bool:
    """Return whether a log names the room, place and board of a fake scanner; the fake itself reports its board."""
    scanner, named = read_fake_url(url), log.metadata
    settings = load_room(scanner.room).text, scanner.place, scanner.board, scanner.board
    return settings == (named.room_text, named.place, named.board, log.info.board)


def test_the_next_scan_moves_the_fake_to_the_place_and_board_that_are_chosen(
    qtbot: QtBot, window: MainWindow, fake: str
) -> None:
    session = window.session
    first = scan(qtbot, window)
    assert session.scanners.url == fake
    assert is_of(first, fake)
    choose(window, "figure9", "hc-sr04")
    second = scan(qtbot, window)
    assert (second.metadata.place, second.metadata.board) == ("figure9", "hc-sr04")
    assert is_of(second, session.scanners.url)
    assert (read_fake_url(session.scanners.url).seed, window.banner.message) == (3, "")
    assert [one.range for one in first.readings] != [one.range for one in second.readings]


def test_a_board_that_no_fake_has_is_named_in_the_banner(qtbot: QtBot, window: MainWindow, fake: str) -> None:
    scene = window.session.shown.scene
    window.session.showing.edit(replace(scene, board=replace(scene.board, name="mine")), "choosing a board")
    scan(qtbot, window)
    assert "the fake scanner has board 'lego-nxt'" in window.banner.message
    assert window.session.scanners.url == fake


def test_scan_this_room_scans_from_the_place_and_with_the_board_that_are_shown(
    qtbot: QtBot, open_with: OpenWith, scanners: _Scanners
) -> None:
    url = "fake:corridor?place=end&pace=max"
    room = load_room("corridor")
    scene = Scene(room, room.place("end"), load_board("lego-nxt"), "corridor.toml")
    window = open_with(scene=scene, source=scanners.opener(url), url=url, find_scanner=scanners.find, order=SHORT)
    {action.text(): action for action in window.files.shipped.actions()}["simple"].trigger()
    until(qtbot, lambda: window.banner.accept_button.isVisible())
    choose(window, "figure9", "hc-sr04")
    shown = window.session.shown.scene
    assert window.banner.accept_button.text() == "Scan this room"
    qtbot.mouseClick(window.banner.accept_button, Qt.MouseButton.LeftButton)
    log = scanned(qtbot, window)
    assert window.session.shown.scene is shown
    assert (log.metadata.place, log.metadata.board) == ("figure9", "hc-sr04")
    assert is_of(log, window.session.scanners.url)
    assert window.banner.message == ""


def test_a_dragged_sensor_leaves_the_fake_where_it_is_and_is_named_in_the_banner(
    qtbot: QtBot, window: MainWindow, fake: str
) -> None:
    session = window.session
    session.showing.edit(with_sensor_at(session.shown.scene, (0.5, 0.3), 0.0), "moving the sensor")
    scan(qtbot, window)
    assert "the fake scanner is still at figure7" in window.banner.message
    assert session.scanners.url == fake
    before = session.status.recording
    qtbot.mouseClick(window.banner.accept_button, Qt.MouseButton.LeftButton)
    scanned(qtbot, window, before)
    assert read_fake_url(session.scanners.url).place == "0.5,0.3"


def test_the_status_bar_names_what_the_fake_keeps_and_a_command_moves_it_to_the_sensor(
    qtbot: QtBot, window: MainWindow
) -> None:
    session, label = window.session, window.status_bar.fake
    first = scan(qtbot, window)
    until(qtbot, lambda: predicted(window) and label.text() == FAKE_LABEL)
    assert not window.commands.move_fake.isEnabled()
    plan = window.views.plan.drawing
    sensor = tuple(session.shown.scene.pose.position)
    drag(qtbot, plan, plan.plot.vb, sensor, (0.5, 0.35))
    until(qtbot, lambda: label.text() == "fake scanner, still at figure7")
    assert "Move the fake scanner here" in label.toolTip()
    before = session.status.recording
    qtbot.keyClick(window, Qt.Key.Key_M, Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier)
    second = scanned(qtbot, window, before)
    place = session.shown.scene.pose
    assert math.dist(place.position, (0.5, 0.35)) < 0.02
    assert second.metadata.place == place.name
    room = session.shown.scene.room
    moved = read_fake_url(session.scanners.url)
    assert math.dist(moved.place_in(room).position, place.position) < 1e-4
    until(qtbot, lambda: predicted(window) and label.text() == FAKE_LABEL)
    assert shares(first, room, place) < 0.7 < shares(second, room, place)
    session.showing.undo()
    until(qtbot, lambda: label.text() == f"fake scanner, still at {place.name}")


def shares(log: Log, room: Room, place: Place) -> float:
    """Return the share of readings within 5 cm of their prediction at a place."""
    board = load_board("lego-nxt")
    return compare_readings(log.readings, room, place, board).summary().within_5cm


def test_a_turned_sensor_and_another_board_are_followed_too(qtbot: QtBot, window: MainWindow) -> None:
    session = window.session
    scan(qtbot, window)
    session.showing.edit(with_sensor_at(session.shown.scene, (0.5, 0.35), math.radians(40)), "moving the sensor")
    window.room.show_state(session.shown)
    window.room.model.board.textActivated.emit("hc-sr04")
    until(qtbot, lambda: window.status_bar.fake.text() == "fake scanner, still at figure7")
    before = session.status.recording
    window.commands.move_fake.trigger()
    scanned(qtbot, window, before)
    moved = read_fake_url(session.scanners.url)
    assert (moved.place, moved.heading, moved.board) == ("0.5,0.35", pytest.approx(math.radians(40)), "hc-sr04")
    until(qtbot, lambda: window.status_bar.fake.text() == FAKE_LABEL)
    window.room.model.board.textActivated.emit("paper")
    until(qtbot, lambda: window.status_bar.fake.text() == "fake scanner, still with board hc-sr04")
