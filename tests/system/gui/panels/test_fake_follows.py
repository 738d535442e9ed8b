"""The log of a scan with a fake scanner names the place and the board that the fake really has."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot
from sonarhw_cli.window import _Scanners
from sonarhw_compare.match import compare_readings
from sonarhw_compare.scanner_url import read_fake_url
from sonarhw_gui.model.edits import with_corner, with_sensor_at
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import FAKE as FAKE_LABEL
from sonarhw_gui.session.scanner import Phase
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

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


OpenFake = Callable[[str, bool], MainWindow]


@pytest.fixture
def open_fake(open_with: OpenWith, scanners: _Scanners) -> OpenFake:
    """Return a function that opens a window on a fake scanner: its own one, or that of a typed URL."""

    def open_it(url: str, follows: bool) -> MainWindow:
        settings = read_fake_url(url)
        room = load_room(settings.room)
        scene = Scene(room, settings.place_in(room), load_board(settings.board), f"{Path(settings.room).stem}.toml")
        scanner = scanners.find(url, follows)
        return open_with(scene=scene, source=scanner, url=url, find_scanner=scanners.find, order=SHORT)

    return open_it


@pytest.fixture
def window(open_fake: OpenFake, fake: str) -> MainWindow:
    """Open a window with its own fake scanner."""
    return open_fake(fake, True)


@pytest.fixture
def typed(open_fake: OpenFake, fake: str) -> MainWindow:
    """Open a window on the fake scanner of a typed URL, as `sonarhw gui URL` does."""
    return open_fake(fake, False)


def scan(qtbot: QtBot, window: MainWindow) -> Log:
    """Scan, and return the log."""
    before = window.session.status.job.recording
    window.session.scan()
    return scanned(qtbot, window, before)


def scanned(qtbot: QtBot, window: MainWindow, before: Path | None = None) -> Log:
    """Return the log of the scan that has begun; `before`: the log of an earlier scan."""
    until(qtbot, lambda: ended(window) and window.session.status.job.recording not in (None, before))
    return read_log(window.session.status.job.recording)


def choose(window: MainWindow, place: str, board: str) -> None:
    """Choose a place and a board in the window."""
    window.open_dock("Room")
    window.toolbar.place.textActivated.emit(place)
    window.room.model.board.textActivated.emit(board)
    assert (window.session.shown.scene.pose.name, window.session.shown.scene.board.name) == (place, board)


def is_of(log: Log, scene: Scene) -> bool:
    """Return whether a log names the room, place and board of a scene, and the fake scanner reports that board."""
    named, board = log.metadata, scene.board.name
    settings = scene.written_room.text, scene.pose.name, board, board
    return settings == (named.room_text, named.place, named.board, log.info.board)


def shares(log: Log, scene: Scene) -> float:
    """Return the share of readings within 5 cm of their prediction in a scene."""
    return compare_readings(log.readings, scene.room, scene.pose, scene.board).summary().within_5cm


def test_the_next_scan_takes_the_place_and_the_board_that_are_chosen(
    qtbot: QtBot, window: MainWindow, fake: str
) -> None:
    session = window.session
    first = scan(qtbot, window)
    assert is_of(first, session.shown.scene)
    choose(window, "figure9", "hc-sr04")
    second = scan(qtbot, window)
    assert (second.metadata.place, second.metadata.board) == ("figure9", "hc-sr04")
    assert is_of(second, session.shown.scene)
    assert (session.scanners.url, window.banner.message) == (fake, "")
    assert [one.range for one in first.readings] != [one.range for one in second.readings]


def test_the_next_scan_takes_a_board_with_a_name_of_its_own(qtbot: QtBot, window: MainWindow) -> None:
    scene = window.session.shown.scene
    window.session.showing.edit(replace(scene, board=replace(scene.board, name="mine")), "choosing a board")
    assert is_of(scan(qtbot, window), window.session.shown.scene)
    assert window.banner.message == ""


def test_the_next_scan_takes_another_room_that_was_opened(qtbot: QtBot, open_fake: OpenFake, room_file: Path) -> None:
    window = open_fake("fake:corridor?place=end&pace=max", True)
    window.session.open_file(str(room_file))
    until(qtbot, lambda: window.session.shown.scene.room_file == "simple.toml")
    choose(window, "figure9", "hc-sr04")
    shown = window.session.shown.scene
    assert window.status_bar.fake.text() == "fake scanner, in 'Corridor' until the next scan"
    log = scan(qtbot, window)
    assert window.session.shown.scene is shown
    assert is_of(log, shown)
    assert log.metadata.place == "figure9"
    assert window.banner.message == ""


def test_the_next_scan_takes_an_edited_room(qtbot: QtBot, window: MainWindow) -> None:
    session = window.session
    first = scan(qtbot, window)
    session.showing.edit(*with_corner(session.shown.scene, 0, (0.4, -0.05)))
    second = scan(qtbot, window)
    assert is_of(second, session.shown.scene)
    assert second.metadata.room_text != first.metadata.room_text


def test_the_status_bar_names_where_the_fake_is_and_a_scan_moves_it_to_the_dragged_sensor(
    qtbot: QtBot, window: MainWindow
) -> None:
    session, label = window.session, window.status_bar.fake
    first, before = scan(qtbot, window), session.shown.scene
    until(qtbot, lambda: predicted(window) and label.text() == FAKE_LABEL)
    assert "Each scan takes the room, the place and the board" in label.toolTip()
    plan = window.views.plan.drawing
    drag(qtbot, plan, plan.plot.vb, tuple(before.pose.position), (0.5, 0.35))
    until(qtbot, lambda: label.text() == "fake scanner, at figure7 until the next scan")
    second = scan(qtbot, window)
    scene = session.shown.scene
    assert math.dist(scene.pose.position, (0.5, 0.35)) < 0.02
    assert is_of(second, scene)
    until(qtbot, lambda: predicted(window) and label.text() == FAKE_LABEL)
    assert shares(first, scene) < 0.7 < shares(second, scene)
    session.showing.undo()
    until(qtbot, lambda: label.text() == f"fake scanner, at {scene.pose.name} until the next scan")


def test_a_turned_sensor_is_followed_too(qtbot: QtBot, window: MainWindow) -> None:
    session = window.session
    scan(qtbot, window)
    session.showing.edit(with_sensor_at(session.shown.scene, (0.5, 0.35), math.radians(40)), "moving the sensor")
    log = scan(qtbot, window)
    assert is_of(log, session.shown.scene)
    turned = replace(session.shown.scene, place=replace(session.shown.scene.place, heading=0.0))
    assert shares(log, turned) < 0.7 < shares(log, session.shown.scene)


def test_a_drag_during_a_sweep_counts_for_the_next_scan(qtbot: QtBot, open_fake: OpenFake, fake: str) -> None:
    window = open_fake(fake.replace("pace=max", "pace=real"), True)
    session = window.session
    before = session.shown.scene
    session.scan()
    until(qtbot, lambda: len(session.shown.readings) >= 2)
    session.showing.edit(with_sensor_at(before, (0.5, 0.3), 0.0), "moving the sensor")
    until(qtbot, lambda: window.status_bar.fake.text() == "fake scanner, at figure7 until the next scan")
    assert session.status.scanning
    session.stop()
    first = scanned(qtbot, window)
    assert is_of(first, before)
    recording = session.status.job.recording
    session.scan()
    until(qtbot, lambda: session.status.job.recording not in (None, recording) and session.status.readings >= 2)
    session.stop()
    assert scanned(qtbot, window, recording).metadata.place == "0.5,0.3"


def test_a_stop_directly_after_a_scan_at_another_place_leaves_the_next_scan_there(
    qtbot: QtBot, window: MainWindow
) -> None:
    session = window.session
    scan(qtbot, window)
    session.showing.edit(with_sensor_at(session.shown.scene, (0.5, 0.3), 0.0), "moving the sensor")
    session.scan()
    session.stop()
    until(qtbot, lambda: ended(window) and session.status.job.phase is Phase.STOPPED)
    assert (session.status.readings, window.banner.message) == (0, "")
    assert is_of(scan(qtbot, window), session.shown.scene)


def test_a_typed_fake_keeps_its_place_and_the_window_says_so(qtbot: QtBot, typed: MainWindow, fake: str) -> None:
    session, label, own = typed.session, typed.status_bar.fake, typed.session.shown.scene
    scan(qtbot, typed)
    until(qtbot, lambda: label.text() == FAKE_LABEL)
    assert "It stays in its room, at its place and with its board" in label.toolTip()
    session.showing.edit(with_sensor_at(own, (0.5, 0.3), 0.0), "moving the sensor")
    until(qtbot, lambda: label.text() == "fake scanner, still at figure7")
    for _ in range(2):
        log = scan(qtbot, typed)
        assert "the fake scanner is still at figure7; readings are predicted for" in typed.banner.message
        assert shares(log, session.shown.scene) < 0.7 < shares(log, own)
    assert session.scanners.url == fake


def test_a_typed_fake_keeps_its_board_and_the_window_says_so(qtbot: QtBot, typed: MainWindow) -> None:
    choose(typed, "figure7", "hc-sr04")
    log = scan(qtbot, typed)
    assert "the fake scanner is still with board lego-nxt" in typed.banner.message
    assert log.info.board == "lego-nxt"
    assert typed.status_bar.fake.text() == "fake scanner, still with board lego-nxt"
