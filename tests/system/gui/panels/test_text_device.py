"""A device that prints text is found, connected, scanned over a room and recorded in the window."""

import math
from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot
from sonarhw_cli.window import _board_of, _Scanners
from sonarhw_gui.session.scanner import Phase, ScannerFinder
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from sonarhw.readings import Origin
from tests.fixtures.text_devices.mcap_bytes import received_bytes
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice, wall
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import dialog_of, ended, predicted, until

RADAR = SKETCHES["radar 0 to 180 with * and #"]


@pytest.fixture
def finder() -> Iterator[ScannerFinder]:
    """Return the function with which `sonarhw gui` finds scanners."""
    with ExitStack() as exit_stack:
        yield _Scanners(exit_stack).find


def open_dialog(qtbot: QtBot, window: MainWindow) -> None:
    window.session.scanners.find_ports = lambda: []
    qtbot.keyClick(window, Qt.Key.Key_K, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: not window.session.scanners.busy)


def test_listening_proposes_the_url_and_a_scan_is_shown_over_the_room(
    qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder
) -> None:
    with PrintingDevice(RADAR.rounds()) as device:
        window = open_with(find_scanner=finder)
        window.session.scanners.urls = (device.port,)  # used before
        open_dialog(qtbot, window)
        dialog = dialog_of(window)
        QTest.keyClicks(dialog.field, device.port)
        qtbot.mouseClick(dialog.listen, Qt.MouseButton.LeftButton)
        expected = f"lines:{device.port}?baud=9600&preset=arduino-radar"
        until(qtbot, lambda: dialog.url.currentText() == expected)
        assert dialog.ports.item(0, 2).text().startswith("prints arduino-radar at 9600 baud")
        dialog.field.selectAll()  # as when the focus enters it
        qtbot.keyClick(dialog.field, Qt.Key.Key_Return)
        until(qtbot, lambda: window.session.status.job.phase is Phase.READY)
        assert window.session.scanners.url == expected
        until(qtbot, lambda: window.session.shown.scene.board.name == "hc-sr04")
        assert "board hc-sr04" in window.banner.message
        window.commands.scan.trigger()
        until(qtbot, lambda: ended(window) and len(window.session.shown.readings) > 0)
        until(qtbot, lambda: predicted(window))
        shown, status = window.session.shown, window.session.status
    assert status.job.phase is Phase.DONE
    assert sorted(round(math.degrees(reading.angle)) for reading in shown.readings) == [*range(181)]
    for reading in shown.readings:
        true = wall(math.degrees(reading.angle))
        assert reading.range == (None if true is None else pytest.approx(true / 100))
    recorded = read_log(status.job.recording)
    assert recorded.metadata.board == "hc-sr04"
    assert len(recorded.readings) == 181
    assert recorded.origin is Origin.MEASURED
    assert received_bytes(status.job.recording) in bytes(device.written)


def test_what_the_device_cannot_obey_is_disabled(qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder) -> None:
    with PrintingDevice(RADAR.rounds()) as device:
        window = open_with(find_scanner=finder)
        window.session.scanners.choose(f"lines:{device.port}?preset=arduino-radar")
        until(qtbot, lambda: window.session.status.job.phase is Phase.READY)
        panel = window.device
        until(qtbot, lambda: "turns by itself" in panel.summary.text())
        fields = (panel.start, panel.end, panel.step, panel.pings, panel.traces, panel.turn)
        assert not any(field.isEnabled() for field in fields)
        assert panel.sweeps.isEnabled()
        assert panel.identity.text() == f"text lines, arduino-radar\nat lines:{device.port}?preset=arduino-radar"
        assert panel.summary.text() == "1 sweep; the device turns by itself"


def test_an_invalid_url_of_a_text_device_is_one_message(
    qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder
) -> None:
    window = open_with(find_scanner=finder)
    window.session.scanners.choose("lines:/dev/ttyUSB9?preset=radar")
    assert "preset=radar: expected arduino-radar" in window.banner.message


def test_a_device_that_prints_nothing_known_is_reported(
    qtbot: QtBot, open_with: OpenWith, finder: ScannerFinder
) -> None:
    window = open_with(find_scanner=finder)
    open_dialog(qtbot, window)
    dialog = dialog_of(window)
    QTest.keyClicks(dialog.field, "/dev/ttyUSB9")
    qtbot.mouseClick(dialog.listen, Qt.MouseButton.LeftButton)
    until(qtbot, lambda: dialog.ports.rowCount() == 1 and "there is no such port" in dialog.ports.item(0, 2).text())
    assert dialog.url.currentText() == "/dev/ttyUSB9"
    dialog.field.setText("socket://127.0.0.1:9")
    assert not dialog.listen.isEnabled()


@pytest.mark.parametrize(("preset", "board"), [("arduino-radar", "hc-sr04"), ("csv", None)])
def test_the_window_begins_with_the_board_of_the_preset(preset: str, board: str | None) -> None:
    assert _board_of(f"lines:/dev/ttyUSB9?preset={preset}") == board
