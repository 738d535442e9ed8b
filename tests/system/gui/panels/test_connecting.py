"""Choosing a scanner: the list of ports, any URL, and a scan. A slow port blocks nothing."""

import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import Phase, ScannerTarget
from sonarhw_gui.window.window import MainWindow

from sonarhw.errors import InputError
from sonarhw.host.scanner import Scanner, probe_port
from sonarhw.link import Port, Usb
from tests.hang_guard import HANG
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenWith
from tests.system.gui.driving import dialog_of, ended, until

ARDUINO = Port("/dev/ttyACM0", "ttyACM0", Usb(0x2341, 0x0042, "1234", None))
OTHER = Port("/dev/ttyS0", "n/a")
CONTROL = Qt.KeyboardModifier.ControlModifier


def nowhere(url: str) -> ScannerTarget:
    raise InputError(f"{url}: leads nowhere")


def with_ports(window: MainWindow, ask: Callable[[str], tuple[bool, str]]) -> None:
    scanners = window.session.scanners
    scanners.find_ports, scanners.probe = lambda: [ARDUINO, OTHER], ask


def rows(window: MainWindow) -> list[list[str]]:
    table = dialog_of(window).ports
    return [[table.item(row, column).text() for column in range(3)] for row in range(table.rowCount())]


def open_dialog(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.keyClick(window, Qt.Key.Key_K, CONTROL)
    assert dialog_of(window).isVisible()


def test_ports_are_listed_and_known_ones_are_queried(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with(find_scanner=nowhere)
    with_ports(window, lambda device: (True, "scanner POL-7"))
    open_dialog(qtbot, window)
    until(qtbot, lambda: not window.session.scanners.busy and dialog_of(window).ports.rowCount() == 2)
    assert rows(window) == [
        ["/dev/ttyACM0", "Arduino Mega 2560", "scanner POL-7"],
        ["/dev/ttyS0", "n/a", "not checked"],
    ]
    assert dialog_of(window).url.currentText() == "/dev/ttyACM0"  # the only one that answers
    qtbot.mouseClick(dialog_of(window).probe_all, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: rows(window)[1][2] == "scanner POL-7")


def test_a_silent_port_does_not_block_the_window(qtbot: QtBot, open_with: OpenWith) -> None:
    gate = threading.Event()
    window = open_with(find_scanner=nowhere)
    with_ports(window, lambda device: (gate.wait(HANG), "answered late"))
    open_dialog(qtbot, window)
    until(qtbot, lambda: rows(window)[:1] == [["/dev/ttyACM0", "Arduino Mega 2560", "checking …"]])
    qtbot.keyClick(window, Qt.Key.Key_2)
    assert window.views.side_by_side.isVisible()
    gate.set()
    until(qtbot, lambda: rows(window)[0][2] == "answered late")


def test_a_typed_url_is_connected_and_scans(qtbot: QtBot, open_with: OpenWith, fake: OpenFake, scene: Scene) -> None:
    opener = fake("max")
    window = open_with(find_scanner=lambda url: ScannerTarget(url, opener))
    assert not window.commands.scan.isEnabled()
    with_ports(window, lambda device: (False, "no scanner"))
    open_dialog(qtbot, window)
    dialog = dialog_of(window)
    assert not dialog.connect_button.isEnabled()
    QTest.keyClicks(dialog.field, "socket://somewhere:4000")
    qtbot.mouseClick(dialog.connect_button, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: window.session.status.job.phase is Phase.READY)
    assert window.session.scanners.urls == ("socket://somewhere:4000",)
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and len(window.session.shown.readings) == ORDER.readings)


def test_a_fake_scanner_provides_its_room(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, scene: Scene, recorded: Path
) -> None:
    opener = fake("max")
    window = open_with(scene=Scene(None, None, scene.board), find_scanner=lambda url: ScannerTarget(url, opener, scene))
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.replay is not None)
    window.session.scanners.choose("fake:simple.toml")
    assert window.session.shown.scene is scene
    assert window.session.replay is None
    until(qtbot, lambda: window.session.status.job.phase is Phase.READY)


def test_errors_of_connecting_come_before_warnings_and_end_when_a_scanner_is_connected(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake
) -> None:
    openers = {"silent": lambda: Scanner.open("socket://127.0.0.1:9"), "fake": fake("max")}

    def find(url: str) -> ScannerTarget:
        if url not in openers:
            raise InputError(f"{url}: no such file")
        return ScannerTarget(url, openers[url])

    window = open_with(find_scanner=find)
    session, banner = window.session, window.banner
    session.notices.warn("the disk is nearly full")
    session.scanners.choose("fake:gone.toml")
    assert "no such file" in banner.message
    session.scanners.choose("silent")
    until(qtbot, lambda: "127.0.0.1:9" in banner.message)
    assert "2 more" in banner.more_button.text()
    session.scanners.choose("fake")
    until(qtbot, lambda: banner.message == "⚠ the disk is nearly full")
    assert session.status.job.phase in (Phase.CONNECTING, Phase.READY)
    assert not banner.more_button.isVisible()
    until(qtbot, lambda: session.status.job.phase is Phase.READY)
    session.scanners.choose("fake:gone.toml")
    session.tick()
    assert "no such file" in banner.message  # the earlier connection does not end it


def test_a_fake_scanner_that_is_in_another_room_than_the_opened_one_is_named(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, scene: Scene
) -> None:
    target = ScannerTarget("fake:simple?place=figure9", fake("max"), scene)
    window = open_with(source=target, url=target.url, find_scanner=nowhere)
    rooms = {action.text(): action for action in window.files.shipped.actions()}
    rooms["corridor"].trigger()
    until(qtbot, lambda: window.session.shown.scene.room_file == "corridor.toml")
    still_there = "⚠ the fake scanner is still in 'Simple room'; readings are predicted for what is shown"
    assert window.banner.message == still_there
    assert window.session.files.path("room") is None  # a shipped room is saved under another name
    window.session.scan()
    assert window.banner.message == still_there
    until(qtbot, lambda: ended(window))


def test_an_invalid_url_is_reported_and_the_scanner_stays(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(find_scanner=nowhere, source=fake("max"))
    window.session.scanners.choose("soket://host")
    assert "soket://host: leads nowhere" in window.banner.message
    assert window.session.scanners.urls == ()
    assert window.commands.scan.isEnabled()


def test_another_scanner_is_rejected_during_a_scan(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    opener = fake("real")
    window = open_with(
        find_scanner=lambda url: ScannerTarget(url, opener), source=fake(4.0), autostart=True, order=ENDLESS
    )
    until(qtbot, lambda: len(window.session.shown.readings) >= 2)
    window.session.scanners.choose("socket://another")
    assert "a scan is running" in window.banner.message
    assert window.session.status.scanning
    assert window.session.scanners.url == ""
    assert window.session.scanners.urls == ()


@pytest.mark.parametrize(
    ("url", "reason"), [("socket://127.0.0.1:9", "no scanner: "), ("nonsense://x", "no scanner: ")]
)
def test_a_port_without_a_scanner_gives_the_reason(url: str, reason: str) -> None:
    answers, why = probe_port(url, patience=0.3)
    assert not answers
    assert why.startswith(reason)
    assert not why.startswith(f"{reason}{url}")
