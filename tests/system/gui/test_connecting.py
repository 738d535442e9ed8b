"""Choosing a scanner: ports, URLs, fake scanners that follow the plan, devices that print text, and their boards."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import pytest
from PySide6.QtTest import QTest
from sonarhw_cli.window import _Scanners
from sonarhw_compare.match import compare_readings
from sonarhw_compare.scanner_url import read_fake_url
from sonarhw_gui.model.edits import with_board, with_corner, with_sensor_at
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import FAKE as FAKE_LABEL
from sonarhw_gui.session.scanner import Phase, ScannerTarget
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.served import serve
from sonarhw.errors import InputError
from sonarhw.host.scanner import Scanner
from sonarhw.link import Port, Usb
from sonarhw.log import Log, read_log
from sonarhw.readings import Origin, ScanOrder
from tests.fixtures.text_devices.mcap_bytes import received_bytes
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice, wall
from tests.hang_guard import HANG
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenSession, OpenWith
from tests.system.gui.driving import dialog_of, ended, key, predicted, push, until

ARDUINO = Port("/dev/ttyACM0", "ttyACM0", Usb(0x2341, 0x0042, "1234", None))
OTHER = Port("/dev/ttyS0", "n/a")
SHORT = ScanOrder(start=0.0, step=math.radians(30), headings=12)
RADAR = SKETCHES["radar 0 to 180 with * and #"]
STATED = "hc-sr04"


def nowhere(url: str) -> ScannerTarget:
    raise InputError(f"{url}: leads nowhere")


@pytest.fixture
def scanners() -> Iterator[_Scanners]:
    """What `sonarhw gui` finds scanners with."""
    with ExitStack() as during:
        yield _Scanners(during)


def rows(window: MainWindow) -> list[list[str]]:
    table = dialog_of(window).ports
    return [[table.item(row, column).text() for column in range(3)] for row in range(table.rowCount())]


def test_ports_are_queried_without_blocking_the_window(open_with: OpenWith, fake: OpenFake) -> None:
    gate, opener = threading.Event(), fake("max")
    window = open_with(find_scanner=lambda url: ScannerTarget(url, opener))
    session = window.session
    assert not window.commands.scan.isEnabled()
    session.scanners.find_ports = lambda: [ARDUINO, OTHER]
    session.scanners.probe = lambda device: (gate.wait(HANG), "scanner POL-7")
    key(window, "Ctrl+K")
    dialog = dialog_of(window)
    until(lambda: rows(window)[:1] == [["/dev/ttyACM0", "Arduino Mega 2560", "checking …"]])
    key(window, "2")
    assert window.views.side_by_side.isVisible()
    gate.set()
    until(lambda: not session.scanners.busy and rows(window)[0][2] == "scanner POL-7")
    assert rows(window)[1] == ["/dev/ttyS0", "n/a", "not checked"]
    assert dialog.url.currentText() == "/dev/ttyACM0"  # the only one that answers
    push(dialog.probe_all)
    until(lambda: rows(window)[1][2] == "scanner POL-7")
    dialog.field.clear()
    assert not dialog.connect_button.isEnabled()
    QTest.keyClicks(dialog.field, "socket://somewhere:4000")
    push(dialog.connect_button)
    until(lambda: session.status.job.phase is Phase.READY)
    assert session.scanners.urls == ("socket://somewhere:4000",)
    window.commands.scan.trigger()
    until(lambda: ended(window) and len(session.shown.readings) == ORDER.readings)


def test_errors_of_connecting_end_with_a_connection(open_session: OpenSession, fake: OpenFake) -> None:
    openers = {"silent": lambda: Scanner.open("socket://127.0.0.1:9"), "fake": fake("max")}

    def find(url: str) -> ScannerTarget:
        return ScannerTarget(url, openers[url]) if url in openers else nowhere(url)

    session = open_session(find_scanner=find)
    notices = session.notices
    notices.warn("the disk is nearly full")
    session.scanners.choose("soket://host")
    assert notices.shown.text == "soket://host: leads nowhere"
    assert (session.scanners.urls, session.status.can_scan) == ((), False)
    session.scanners.choose("silent")
    until(lambda: "127.0.0.1:9" in notices.shown.text)
    assert notices.more == 2
    session.scanners.choose("fake")
    until(lambda: notices.shown.text == "the disk is nearly full")
    assert session.status.job.phase in (Phase.CONNECTING, Phase.READY)
    assert notices.more == 0
    until(lambda: session.status.job.phase is Phase.READY)
    session.scanners.choose("gone")
    session.tick()
    assert "leads nowhere" in notices.shown.text  # the earlier connection does not end it
    assert session.scanners.url == "fake"


def test_another_scanner_is_rejected_during_a_scan(open_session: OpenSession, fake: OpenFake) -> None:
    opener = fake("real")
    session = open_session(fake(4.0), order=ENDLESS, find_scanner=lambda url: ScannerTarget(url, opener))
    session.scan()
    until(lambda: len(session.shown.readings) >= 2)
    session.scanners.choose("socket://another")
    assert "a scan is running" in session.notices.shown.text
    assert session.status.scanning
    assert (session.scanners.url, session.scanners.urls) == ("", ())


# fake scanners


def test_a_fake_provides_its_room(open_session: OpenSession, fake: OpenFake, scene: Scene, recorded: Path) -> None:
    target = ScannerTarget("fake:simple?place=figure9", fake("max"), scene)
    session = open_session(scene=Scene(None, None, scene.board), find_scanner=lambda url: target)
    session.open_file(str(recorded))
    until(lambda: session.replay is not None)
    session.scanners.choose(target.url)
    assert session.shown.scene is scene
    assert session.replay is None
    until(lambda: session.status.job.phase is Phase.READY)
    session.open_room("corridor")
    until(lambda: session.shown.scene.room_file == "corridor.toml")
    still_there = "the fake scanner is still in 'Simple room'; readings are predicted for what is shown"
    assert session.notices.shown.text == still_there
    assert session.files.path("room") is None  # a shipped room is saved under another name
    session.scan()
    assert session.notices.shown.text == still_there
    until(lambda: ended(session))


@pytest.fixture(scope="module")
def room_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write the room `simple` with walls that absorb: few paths are loud, so the fake scanner needs little time."""
    file = tmp_path_factory.mktemp("room") / "simple.toml"
    file.write_text(load_room("simple").text.replace("reflectance = 0.95", "reflectance = 0.5"))
    return file


OpenOnFake = Callable[..., WindowSession]


@pytest.fixture
def open_on_fake(open_session: OpenSession, scanners: _Scanners, room_file: Path) -> OpenOnFake:
    """Return a function that opens a session on a fake scanner: its own one, or that of a typed URL."""

    def open_it(follows: bool, pace: str = "max") -> WindowSession:
        url = f"fake:{room_file}?place=figure7&board=lego-nxt&seed=3&pace={pace}"
        settings, room = read_fake_url(url), load_room(room_file)
        scene = Scene(room, settings.place_in(room), load_board(settings.board), room_file.name)
        target = scanners.find(url, follows)
        return open_session(target, scene=scene, find_scanner=scanners.find, order=SHORT)

    return open_it


def scan(session: WindowSession) -> Log:
    """Scan once the scanner is idle, and return the log."""
    until(lambda: session.status.can_scan)
    before = session.status.job.recording
    session.scan()
    until(lambda: ended(session) and session.status.job.recording not in (None, before))
    return read_log(session.status.job.recording)


def is_of(log: Log, scene: Scene) -> bool:
    """Return whether a log names the room, place and board of a scene, and the fake scanner reports that board."""
    named, board = log.metadata, scene.board.name
    settings = scene.written_room.text, scene.pose.name, board, board
    return settings == (named.room_text, named.place, named.board, log.info.board)


def share(log: Log, scene: Scene) -> float:
    """Return the share of readings within 5 cm of their prediction in a scene."""
    return compare_readings(log.readings, scene.room, scene.pose, scene.board).summary().within_5cm


def test_the_next_scan_of_its_own_fake_takes_place_board_and_room_as_they_are_shown(open_on_fake: OpenOnFake) -> None:
    session = open_on_fake(follows=True)
    showing = session.showing
    first, own = scan(session), session.shown.scene
    assert is_of(first, own)
    until(lambda: session.status.fake[0] == FAKE_LABEL)
    assert "Each scan takes the room, the place and the board" in session.status.fake[1]
    moved = with_sensor_at(own, (0.5, 0.35), math.radians(40))
    showing.edit(moved, "moving the sensor")
    until(lambda: session.status.fake[0] == "fake scanner, at figure7 until the next scan")
    second = scan(session)
    assert is_of(second, session.shown.scene)
    turned_back = replace(moved, place=replace(moved.place, heading=0.0))
    assert max(share(first, moved), share(second, turned_back)) < 0.7 < share(second, session.shown.scene)
    for edited in (
        lambda scene: with_board(scene, load_board(STATED)),
        lambda scene: (replace(scene, board=replace(scene.board, name="mine")), "choosing a board"),
        lambda scene: with_corner(scene, 0, (0.4, -0.05)),
    ):
        showing.edit(*edited(session.shown.scene))
        assert is_of(scan(session), session.shown.scene)
    session.open_room("corridor")
    until(lambda: session.shown.scene.room_file == "corridor.toml")
    assert session.status.fake[0] == "fake scanner, in 'Simple room' until the next scan"
    showing.edit(with_sensor_at(session.shown.scene, session.shown.scene.place.position, 0.1), "turning the sensor")
    session.scan()
    session.stop()  # directly after the command, at another place
    until(lambda: ended(session) and session.status.job.phase is Phase.STOPPED)
    assert session.status.readings == 0
    session.open_room("simple")
    until(lambda: session.shown.scene.room_file == "simple.toml")
    assert is_of(scan(session), session.shown.scene)
    assert session.notices.shown.text == ""


def test_a_typed_fake_keeps_its_place_and_board_and_the_window_says_so(open_on_fake: OpenOnFake) -> None:
    session = open_on_fake(follows=False)
    own = session.shown.scene
    scan(session)
    until(lambda: session.status.fake[0] == FAKE_LABEL)
    assert "It stays in its room, at its place and with its board" in session.status.fake[1]
    session.showing.edit(with_sensor_at(own, (0.5, 0.3), 0.0), "moving the sensor")
    until(lambda: session.status.fake[0] == "fake scanner, still at figure7")
    for _ in range(2):
        log = scan(session)
        assert "the fake scanner is still at figure7; readings are predicted for" in session.notices.shown.text
        assert share(log, session.shown.scene) < 0.7 < share(log, own)
    session.showing.edit(*with_board(own, load_board(STATED)))
    assert scan(session).info.board == "lego-nxt"
    assert "the fake scanner is still with board lego-nxt" in session.notices.shown.text
    assert session.status.fake[0] == "fake scanner, still with board lego-nxt"


def test_a_new_room_is_scanned_by_a_fake_scanner_and_closed_again(open_with: OpenWith, scanners: _Scanners) -> None:
    window = open_with(find_scanner=scanners.find)
    session, commands = window.session, window.commands
    commands.new_room.trigger()
    dialog = dialog_of(window)
    dialog.name.setText("Cellar")
    dialog.width_field.setValue(1.2)
    dialog.depth_field.setValue(0.9)
    dialog.buttons.accepted.emit()
    until(lambda: predicted(window))
    assert session.shown.scene.room.walls.reshape(-1, 2).max(axis=0).tolist() == [1.2, 0.9]
    assert session.shown.scene.pose.position == (0.6, 0.45)
    assert session.shown.scene.room.names == ("south", "east", "north", "west")
    commands.save_room_as.trigger()
    assert Path(dialog_of(window).selectedFiles()[0]).name == "cellar.toml"
    dialog_of(window).reject()
    commands.connect_fake.trigger()
    until(lambda: session.status.can_scan)
    commands.scan.trigger()
    until(lambda: len(session.shown.readings) > 3)
    commands.stop.trigger()
    until(lambda: ended(window))
    assert read_log(session.log_file).metadata.room_text == session.shown.scene.room.text
    assert not window.start_page.isVisible()
    commands.close_readings.trigger()
    until(lambda: not session.shown.readings)
    commands.close_room.trigger()
    assert session.shown.scene.room is None
    until(window.start_page.isVisible)
    assert not window.views.isVisible()


# the board that a scanner states


@pytest.fixture
def url(echoes: RoomEchoes) -> Iterator[str]:
    """Serve a scanner with an HC-SR04 at a port, as a real one is."""
    board = FakeBoard(echoes, 2, identity=BoardIdentity(serial="FAKE-0002", profile=STATED))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        yield endpoint.url


def test_the_first_scan_has_its_board(open_session: OpenSession, scanners: _Scanners, url: str, scene: Scene) -> None:
    polaroid = replace(scene, board=load_board("polaroid-6500"))
    session = open_session(scanners.find(url), scene=polaroid)
    session.takes_board = True  # as `sonarhw gui URL` without --board
    assert scan(session).metadata.board == STATED
    assert session.shown.scene.board.name == STATED
    assert f"board {STATED}" in session.notices.shown.text


def test_a_chosen_board_is_kept(open_session: OpenSession, scanners: _Scanners, url: str, scene: Scene) -> None:
    polaroid = replace(scene, board=load_board("polaroid-6500"))
    session = open_session(scene=polaroid, find_scanner=scanners.find)
    session.scanners.choose(url)
    until(lambda: session.shown.scene.board.name == STATED)
    session.showing.undo()
    calibrated = replace(scene, board=replace(load_board(STATED), name="mine", threshold_db=-21.0))
    own = open_session(scene=calibrated, find_scanner=scanners.find)
    assert scan(session).metadata.board == session.shown.scene.board.name == "polaroid-6500"
    session.live.disconnect()
    until(lambda: session.status.link is None)
    own.scanners.choose(url)
    until(lambda: ended(own) and own.status.link is not None)
    assert scan(own).metadata.board == own.shown.scene.board.name == "mine"


# devices that print text


def test_listening_proposes_the_url_of_a_printing_device(open_with: OpenWith, scanners: _Scanners) -> None:
    with PrintingDevice(RADAR.rounds()) as device:
        window = open_with(find_scanner=scanners.find)
        session, panel = window.session, window.device
        session.scanners.urls = (device.port,)  # used before
        session.scanners.find_ports = lambda: []
        key(window, "Ctrl+K")
        until(lambda: not session.scanners.busy)
        dialog = dialog_of(window)
        dialog.field.setText("/dev/ttyUSB9")
        push(dialog.listen)
        until(lambda: dialog.ports.rowCount() == 1 and "there is no such port" in dialog.ports.item(0, 2).text())
        with PrintingDevice(b"%d\t%.2f\r\n" % (a, 0.8 + a % 37 / 20) for a in cycle(range(0, 360, 5))) as other:
            dialog.field.setText(other.port)
            push(dialog.listen)
            until(lambda: dialog.url.count() > 1)
            units = [dialog.url.itemText(k).rpartition("&unit=")[2] for k in range(dialog.url.count())]
            assert (units, dialog.url.currentText()) == (
                ["m", "ft", "yd", device.port],
                f"lines:{other.port}?baud=9600&preset=csv",
            )
        dialog.field.setText("socket://127.0.0.1:9")
        assert not dialog.listen.isEnabled()
        dialog.field.clear()
        QTest.keyClicks(dialog.field, device.port)
        push(dialog.listen)
        expected = f"lines:{device.port}?baud=9600&preset=arduino-radar"
        until(lambda: dialog.url.currentText() == expected)
        assert any(row[2].startswith("prints arduino-radar at 9600 baud") for row in rows(window))
        dialog.field.selectAll()  # as when the focus enters it
        key(dialog.field, "Return")
        until(lambda: session.status.job.phase is Phase.READY and session.shown.scene.board.name == STATED)
        assert session.scanners.url == expected
        assert f"board {STATED}" in window.banner.message
        until(lambda: "turns by itself" in panel.summary.text())
        fields = (panel.start, panel.end, panel.step, panel.pings, panel.traces, panel.turn)
        assert [field.isEnabled() for field in (*fields, panel.sweeps)] == [False] * 6 + [True]
        assert panel.identity.text() == f"text lines, arduino-radar\nat {expected}"
        window.commands.scan.trigger()
        until(lambda: ended(window) and len(session.shown.readings) > 0 and predicted(window))
        shown, status = session.shown, session.status
    assert status.job.phase is Phase.DONE
    assert sorted(round(math.degrees(reading.angle)) for reading in shown.readings) == [*range(181)]
    for reading in shown.readings:
        true = wall(math.degrees(reading.angle))
        assert reading.range == (None if true is None else pytest.approx(true / 100))
    recorded = read_log(status.job.recording)
    assert (recorded.metadata.board, len(recorded.readings), recorded.origin) == (STATED, 181, Origin.MEASURED)
    assert received_bytes(status.job.recording) in bytes(device.written)
