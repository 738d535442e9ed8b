"""The scanner in the window: connecting, turning, homing, stopping, a lost and restored cable."""

import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractSpinBox, QDialog
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.panels.device import DevicePanel
from sonarhw_gui.session.scanner import JobState, Phase
from sonarhw_gui.session.status import Status, link_figures, order_of_sector, scan_summary
from sonarhw_gui.window.bars import badge_text
from sonarhw_gui.window.commands import Commands
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Pace, serve
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from sonarhw.readings import Ping, PingResult, ScanOrder, sector
from tests.fixtures.stuck_boards import EndlessHoming
from tests.hang_guard import HANG
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenWith
from tests.system.gui.driving import activate, ended, until

LONG = replace(ORDER, sweeps=5)
AWAY = 10 * HANG  # s that the link waits for a lost scanner; every test restores it earlier


@pytest.fixture
def during() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def board(scene: Scene, echoes: RoomEchoes) -> FakeBoard:
    return FakeBoard(echoes, 3, scene.board.blanking)


def opened(open_with: OpenWith, board: FakeBoard, during: ExitStack, pace: Pace = 4.0, **start: object) -> MainWindow:
    """Serve a board and return a window with its device panel open."""
    endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace=pace))
    window = open_with(source=lambda: Scanner.open(endpoint.url, reconnect=AWAY), **start)
    window.dock_openers[0].trigger()
    return window


def press(qtbot: QtBot, button: object) -> None:
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def type_into(qtbot: QtBot, field: QAbstractSpinBox, text: str) -> None:
    field.selectAll()
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)


def idle(window: MainWindow, phase: Phase) -> bool:
    return window.session.status.job.phase is phase and not window.session.status.scanning


# connecting


def test_connect_shows_the_identity_and_disconnect_releases_the_port(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: "FAKE-0003" in window.device.identity.text())
    until(qtbot, lambda: window.device.state.text() == "Connected")
    url = window.session.status.link.url
    press(qtbot, window.device.disconnect_button)
    until(qtbot, lambda: window.device.state.text() == "Not connected")
    assert window.status_bar.badge.text() == "no scan"
    with Scanner.open(url) as other:
        assert other.info.serial == "FAKE-0003"


def test_after_disconnect_a_scan_connects_again(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    press(qtbot, window.device.disconnect_button)
    window.commands.scan.trigger()
    until(qtbot, lambda: idle(window, Phase.DONE))
    assert len(window.session.shown.readings) == ORDER.readings


def test_one_connection_runs_several_scans(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max", autostart=True)
    until(qtbot, lambda: idle(window, Phase.DONE))
    first = window.session.status.job.recording
    window.commands.scan.trigger()
    until(qtbot, lambda: idle(window, Phase.DONE) and window.session.status.job.recording != first)
    assert window.session.status.link.statistics.reopened == 0
    assert [len(read_log(path).scans) for path in (first, window.session.status.job.recording)] == [1, 1]


# turning


def test_turn_and_home_move_the_turntable_and_show_its_angle(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    type_into(qtbot, window.device.target, "123.4")
    until(qtbot, lambda: window.device.angle.text() == "123.4°")
    until(qtbot, lambda: idle(window, Phase.READY))
    window.commands.home.trigger()
    until(qtbot, lambda: window.device.angle.text() == "0.0°")
    assert window.session.shown.readings == ()


def test_f6_stops_a_turning_turntable(qtbot: QtBot, open_with: OpenWith, echoes: RoomEchoes, during: ExitStack) -> None:
    window = opened(open_with, EndlessHoming(echoes), during)
    window.session.live.home()
    until(qtbot, lambda: window.session.status.job.phase is Phase.HOMING)
    qtbot.keyClick(window, Qt.Key.Key_F6)
    until(qtbot, lambda: idle(window, Phase.STOPPED))
    assert window.banner.message == ""


def test_f6_works_in_a_dialog_in_front_of_the_window(
    qtbot: QtBot, open_with: OpenWith, echoes: RoomEchoes, during: ExitStack
) -> None:
    window = opened(open_with, EndlessHoming(echoes), during)
    dialog = QDialog(window)
    activate(qtbot, dialog)
    window.commands.home.trigger()
    until(qtbot, lambda: window.session.status.job.phase is Phase.HOMING)
    qtbot.keyClick(dialog, Qt.Key.Key_F6)
    until(qtbot, lambda: idle(window, Phase.STOPPED))


def test_an_angle_beyond_the_cable_is_reported_and_the_connection_stays(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    window.session.live.turn(math.radians(9999))
    until(qtbot, lambda: window.banner.message != "")
    assert window.session.status.job.phase is Phase.FAILED
    window.session.live.home()
    until(qtbot, lambda: idle(window, Phase.READY))
    assert window.session.status.link.statistics.reopened == 0


# scanning a sector


def test_a_scan_covers_the_sector_typed_in_the_panel(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    panel = window.device
    for field, text in ((panel.start, "30"), (panel.end, "90"), (panel.step, "15"), (panel.pings, "2")):
        type_into(qtbot, field, text)
    panel.traces.click()
    assert panel.summary.text().startswith("4 headings, 8 readings")
    window.commands.scan.trigger()
    until(qtbot, lambda: idle(window, Phase.DONE))
    readings = window.session.shown.readings
    angles = sorted({round(math.degrees(reading.angle), 3) for reading in readings})
    assert (len(readings), angles) == (8, [30, 45, 60, 75])
    assert all(reading.trace is None for reading in readings)


def test_echoes_beyond_a_shorter_range_are_ignored(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    type_into(qtbot, window.device.max_range, "0.6")
    window.commands.scan.trigger()
    until(qtbot, lambda: idle(window, Phase.DONE))
    ranges = [reading.range for reading in window.session.shown.readings if reading.range is not None]
    assert ranges
    assert max(ranges) < 0.62


def test_an_empty_sector_is_reported_and_the_last_settings_stay(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during)
    type_into(qtbot, window.device.end, "0")
    assert "the sector is empty" in window.device.summary.text()
    until(qtbot, lambda: window.session.status.settings is not None)
    assert window.session.status.settings.order == ORDER


def test_a_descending_sector_has_a_negative_step() -> None:
    order = order_of_sector(90.0, 0.0, 10.0, sweeps=2, pings=3)
    assert order == ScanOrder(math.radians(90), math.radians(-10), 9, 2, 3)
    assert order_of_sector(0.0, 360.0, 5.0, 1, 1) == sector()
    assert scan_summary(order, None) == "9 headings, 54 readings"
    with pytest.raises(ValueError, match="a scan can have"):
        order_of_sector(0.0, 360.0, 0.01, sweeps=10_000, pings=100)


# possible actions


def test_without_a_scanner_its_buttons_are_disabled(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    window.dock_openers[0].trigger()
    panel = window.device
    assert panel.state.text() == "No scanner chosen"
    for button in (panel.connect_button, panel.disconnect_button, panel.turn):
        assert not button.isEnabled()
    for action in (window.commands.home, window.commands.scan, window.commands.stop):
        assert not action.isEnabled()


def test_the_turntable_is_disabled_during_a_replay(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, recorded: object
) -> None:
    window = open_with(source=fake("max"))
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.replay is not None)
    until(qtbot, lambda: not window.commands.home.isEnabled())
    assert not window.device.turn.isEnabled()
    assert "Leave the replay" in window.device.hint.text()


# the cable


class PulledOnce(RoomEchoes):
    """A room that pulls the cable of its board at the tenth ping."""

    board: FakeBoard
    pings = 0

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of a ping."""
        self.pings += 1
        if self.pings == 10:
            self.board.plug = None
        return super().receive(ping)


def test_a_cable_pulled_during_a_scan_shows_a_banner_until_it_is_back_and_the_scan_is_complete(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, during: ExitStack
) -> None:
    echoes = PulledOnce(scene.room, scene.place, scene.board, 1, EXACT)
    echoes.prepare()
    board = echoes.board = FakeBoard(echoes, 3, scene.board.blanking)
    window = opened(open_with, board, during, 6.0, autostart=True, order=LONG)
    until(qtbot, lambda: "The scan then continues by itself" in window.banner.message)
    until(qtbot, lambda: window.status_bar.activity.text().startswith("waiting for the scanner"))
    assert window.status_bar.badge.text() == "away"
    assert window.session.status.scanning
    assert window.commands.stop.isEnabled()
    board.plug = 0
    until(qtbot, lambda: window.banner.message == "")
    until(qtbot, lambda: ended(window))
    until(qtbot, lambda: window.status_bar.badge.text() == "recorded")
    assert window.session.status.job.phase is Phase.DONE
    assert sorted(reading.number for reading in window.session.shown.readings) == list(range(LONG.readings))
    assert window.session.status.link.statistics.losses >= 1
    log = read_log(window.session.status.job.recording)
    assert len(log.readings) == LONG.readings


def test_the_badge_of_an_ended_scan_depends_on_its_scanner_and_room(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack, scene: Scene
) -> None:
    window = opened(open_with, board, during, "max", autostart=True)
    seen = window.status_bar.badge
    until(qtbot, lambda: idle(window, Phase.DONE))
    until(qtbot, lambda: seen.text() == "recorded")
    window.session.set_scene(replace(scene, room=replace(scene.room, name="elsewhere")))
    assert seen.text() == "earlier scan"
    window.session.set_scene(scene)
    assert seen.text() == "recorded"
    press(qtbot, window.device.disconnect_button)
    until(qtbot, lambda: seen.text() == "away")
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    until(qtbot, lambda: seen.text() == "recorded")
    window.session.live.use(None)  # as if another scanner was chosen
    until(qtbot, lambda: seen.text() == "away")


@pytest.mark.parametrize(("readings", "text"), [(12, "lost"), (0, "no scan")])
def test_the_badge_is_not_live_after_a_failed_scan(readings: int, text: str) -> None:
    assert badge_text(Status(JobState(Phase.FAILED), chosen=True, readings=readings)) == text


def test_a_cable_pulled_between_scans_is_reported(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during)
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    board.plug = None
    until(qtbot, lambda: "plug the scanner in again" in window.banner.message)
    assert window.device.state.text().startswith("Lost")
    board.plug = 0
    until(qtbot, lambda: window.banner.message == "")
    until(qtbot, lambda: window.device.state.text() == "Connected")


def test_a_dismissed_banner_of_a_lost_cable_stays_hidden_and_stop_works(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, autostart=True, order=ENDLESS)
    until(qtbot, lambda: len(window.session.shown.readings) >= 2)
    board.plug = None
    until(qtbot, lambda: window.banner.message != "")
    press(qtbot, window.banner.close_button)
    assert window.banner.message == ""
    window.session.tick()
    assert window.banner.message == ""
    qtbot.keyClick(window, Qt.Key.Key_F6)
    until(qtbot, lambda: idle(window, Phase.STOPPED))
    assert len(read_log(window.session.status.job.recording).readings) >= 2


def test_no_clock_drift_is_shown_for_a_scanner_at_another_pace(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during)
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    link = window.session.status.link
    for drift, text in ((1e-4, "+100 ppm"), (-0.019, "-19000 ppm"), (-0.02, "–"), (0.02, "–")):
        figures = {name: text for name, text, _ in link_figures(replace(link, drift=drift))}
        assert figures["Clock drift"] == text


def test_the_panel_alone_shows_a_status(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    panel = DevicePanel(Commands(window), window.session.live)
    qtbot.addWidget(panel)
    panel.show_status(Status(JobState(angle=math.pi / 2, temperature_c=21.34), chosen=True))
    assert (panel.angle.text(), panel.temperature.text()) == ("90.0°", "21.3 °C")
    assert [label.text() for label in panel.figures][1:3] == ["–", "–"]
