"""The scanner from the window: connected, turned, homed, stopped, unplugged and plugged in again."""

import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractSpinBox, QDialog
from pytestqt.qtbot import QtBot
from sonarhw_gui.bars.status_bar import badge_text
from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.live.device_texts import link_figures, order_of_sector, scan_summary
from sonarhw_gui.live.scanner_state import Phase
from sonarhw_gui.live.window_status import Source, Status
from sonarhw_gui.panels.device_panel import DevicePanel
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shell.main_window import MainWindow
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes

from sonarhw.device.endpoint import Pace, serve
from sonarhw.device.fake_board import FakeBoard
from sonarhw.echo_source import Ping, PingResult
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from sonarhw.readings import ScanOrder, sector
from tests.fixtures.stuck_boards import EndlessHoming
from tests.hang_guard import HANG
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenWith
from tests.system.gui.driving import PATIENCE, ended, until

LONG = replace(ORDER, sweeps=5)
AWAY = 10 * HANG  # s that a lost scanner may be away: a test puts it back when it has seen enough


@pytest.fixture
def during() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def board(scene: Scene, echoes: RoomEchoes) -> FakeBoard:
    return FakeBoard(echoes, 3, scene.board.blanking)


def opened(open_with: OpenWith, board: FakeBoard, during: ExitStack, pace: Pace = 4.0, **start: object) -> MainWindow:
    """A window with its device panel open, before a board that is served."""
    endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace=pace))
    window = open_with(source=lambda: Scanner.open(endpoint.url, reconnect=AWAY), **start)
    window.docks.actions[0].trigger()
    return window


def press(qtbot: QtBot, button: object) -> None:
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def type_into(qtbot: QtBot, field: QAbstractSpinBox, text: str) -> None:
    field.selectAll()
    qtbot.keyClicks(field, text)
    qtbot.keyClick(field, Qt.Key.Key_Return)


def idle(window: MainWindow, phase: Phase) -> bool:
    return window.session.status.phase is phase and not window.session.status.scanning


# connecting


def test_connect_says_who_answers_and_disconnect_lets_go_of_the_port(
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


def test_one_connection_serves_one_scan_after_the_other(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max", autostart=True)
    until(qtbot, lambda: idle(window, Phase.DONE))
    first = window.session.status.recording
    window.commands.scan.trigger()
    until(qtbot, lambda: idle(window, Phase.DONE) and window.session.status.recording != first)
    assert window.session.status.link.statistics.reopened == 0
    assert [len(read_log(path).scans) for path in (first, window.session.status.recording)] == [1, 1]


# turning


def test_turn_and_home_turn_the_turntable_and_say_where_it_points(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    type_into(qtbot, window.device.target, "123.4")
    until(qtbot, lambda: window.device.angle.text() == "123.4°")
    until(qtbot, lambda: idle(window, Phase.READY))
    window.commands.home.trigger()
    until(qtbot, lambda: window.device.angle.text() == "0.0°")
    assert window.session.shown.readings == ()


def test_f6_stops_a_turntable_that_turns(
    qtbot: QtBot, open_with: OpenWith, echoes: RoomEchoes, during: ExitStack
) -> None:
    window = opened(open_with, EndlessHoming(echoes), during)
    window.session.live.home()
    until(qtbot, lambda: window.session.status.phase is Phase.HOMING)
    qtbot.keyClick(window, Qt.Key.Key_F6)
    until(qtbot, lambda: idle(window, Phase.STOPPED))
    assert window.banner.message == ""


def test_f6_stops_it_from_a_dialog_in_front_of_the_window(
    qtbot: QtBot, open_with: OpenWith, echoes: RoomEchoes, during: ExitStack
) -> None:
    window = opened(open_with, EndlessHoming(echoes), during)
    dialog = QDialog(window)
    with qtbot.waitActive(dialog, timeout=PATIENCE):
        dialog.show()
        dialog.activateWindow()
    window.commands.home.trigger()
    until(qtbot, lambda: window.session.status.phase is Phase.HOMING)
    qtbot.keyClick(dialog, Qt.Key.Key_F6)
    until(qtbot, lambda: idle(window, Phase.STOPPED))


def test_an_angle_the_cable_does_not_reach_is_told_and_the_scanner_stays(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    window.session.live.turn(math.radians(9999))
    until(qtbot, lambda: window.banner.message != "")
    assert window.session.status.phase is Phase.FAILED
    window.session.live.home()
    until(qtbot, lambda: idle(window, Phase.READY))
    assert window.session.status.link.statistics.reopened == 0


# scanning a sector


def test_a_sector_typed_into_the_panel_is_what_is_scanned(
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


def test_a_shorter_range_is_not_listened_beyond(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during, "max")
    type_into(qtbot, window.device.reach, "0.6")
    window.commands.scan.trigger()
    until(qtbot, lambda: idle(window, Phase.DONE))
    heard = [reading.range for reading in window.session.shown.readings if reading.range is not None]
    assert heard
    assert max(heard) < 0.62


def test_a_sector_without_headings_is_told_and_the_last_wish_stays(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during)
    type_into(qtbot, window.device.end, "0")
    assert "the sector is empty" in window.device.summary.text()
    until(qtbot, lambda: window.session.status.scan_settings is not None)
    assert window.session.status.scan_settings.order == ORDER


def test_a_sector_that_leads_down_has_a_negative_step() -> None:
    order = order_of_sector(90.0, 0.0, 10.0, sweeps=2, pings=3)
    assert order == ScanOrder(math.radians(90), math.radians(-10), 9, 2, 3)
    assert order_of_sector(0.0, 360.0, 5.0, 1, 1) == sector()
    assert scan_summary(order, None) == "9 headings, 54 readings"
    with pytest.raises(ValueError, match="more than"):
        order_of_sector(0.0, 360.0, 0.01, sweeps=10_000, pings=100)


# what can be done


def test_without_a_scanner_nothing_of_it_can_be_pressed(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    window.docks.actions[0].trigger()
    panel = window.device
    assert panel.state.text() == "No scanner chosen"
    for button in (panel.connect_button, panel.disconnect_button, panel.turn):
        assert not button.isEnabled()
    for action in (window.commands.home, window.commands.scan, window.commands.stop):
        assert not action.isEnabled()


def test_in_a_replay_the_turntable_is_left_alone(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, recorded: object
) -> None:
    window = open_with(source=fake("max"))
    window.session.open_file(str(recorded))
    until(qtbot, lambda: window.session.replay.loaded)
    until(qtbot, lambda: not window.commands.home.isEnabled())
    assert not window.device.turn.isEnabled()
    assert "Leave the replay" in window.device.hint.text()


# the cable


class PulledOnce(RoomEchoes):
    """Pulls the cable of a board at the tenth ping."""

    board: FakeBoard
    pings = 0

    def receive(self, ping: Ping) -> PingResult:
        """What the room gives back."""
        self.pings += 1
        if self.pings == 10:
            self.board.plug = None
        return super().receive(ping)


def test_a_cable_pulled_in_mid_scan_is_a_banner_that_goes_when_it_is_back_and_the_scan_is_whole(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, during: ExitStack
) -> None:
    echoes = PulledOnce(scene.room, scene.place, scene.board, 1, EXACT)
    echoes.prepare()
    board = echoes.board = FakeBoard(echoes, 3, scene.board.blanking)
    window = opened(open_with, board, during, 6.0, autostart=True, order=LONG)
    until(qtbot, lambda: "the scan goes on by itself" in window.banner.message)
    until(qtbot, lambda: window.status_bar.activity.text().startswith("waiting for the scanner"))
    assert window.status_bar.badge.text() == "away"
    assert window.session.status.scanning
    assert window.commands.stop.isEnabled()
    board.plug = 0
    until(qtbot, lambda: window.banner.message == "")
    until(qtbot, lambda: ended(window))
    until(qtbot, lambda: window.status_bar.badge.text() == "recorded")
    assert window.session.status.phase is Phase.DONE
    assert sorted(reading.number for reading in window.session.shown.readings) == list(range(LONG.readings))
    assert window.session.status.link.statistics.losses >= 1
    log = read_log(window.session.status.recording)
    assert len(log.readings) == LONG.readings


def test_a_scan_that_is_over_is_recorded_only_beside_its_connected_scanner_in_its_room(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack, scene: Scene
) -> None:
    window = opened(open_with, board, during, "max", autostart=True)
    seen = window.status_bar.badge
    until(qtbot, lambda: idle(window, Phase.DONE))
    until(qtbot, lambda: seen.text() == "recorded")
    window.session.set_scene(replace(scene, room=replace(scene.room, name="elsewhere")))
    assert seen.text() == "no scan"
    window.session.set_scene(scene)
    assert seen.text() == "recorded"
    press(qtbot, window.device.disconnect_button)
    until(qtbot, lambda: seen.text() == "away")
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    until(qtbot, lambda: seen.text() == "recorded")
    window.session.live.use(None)  # as another scanner is chosen
    until(qtbot, lambda: seen.text() == "away")


@pytest.mark.parametrize(("readings", "told"), [(12, "lost"), (0, "no scan")])
def test_after_a_scan_that_failed_the_badge_is_not_live(readings: int, told: str) -> None:
    assert badge_text(Status(Source.LIVE, Phase.FAILED, can_scan=True, readings=readings)) == told


def test_a_cable_pulled_while_nothing_runs_is_told_too(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during)
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    board.plug = None
    until(qtbot, lambda: "plug it in again" in window.banner.message)
    assert window.device.state.text().startswith("Lost")
    board.plug = 0
    until(qtbot, lambda: window.banner.message == "")
    until(qtbot, lambda: window.device.state.text() == "Connected")


def test_a_lost_cable_that_was_put_away_stays_away_and_stop_still_works(
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
    assert len(read_log(window.session.status.recording).readings) >= 2


def test_the_clock_of_a_scanner_that_runs_at_another_pace_tells_no_drift(
    qtbot: QtBot, open_with: OpenWith, board: FakeBoard, during: ExitStack
) -> None:
    window = opened(open_with, board, during)
    press(qtbot, window.device.connect_button)
    until(qtbot, lambda: idle(window, Phase.READY))
    link = window.session.status.link
    for drift, told in ((1e-4, "+100 ppm"), (-0.019, "-19000 ppm"), (-0.02, "–"), (0.02, "–")):
        figures = {name: text for name, text, _ in link_figures(replace(link, drift=drift))}
        assert figures["Clock drift"] == told


def test_the_panel_alone_shows_what_it_is_told(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with()
    panel = DevicePanel(Commands(window))
    qtbot.addWidget(panel)
    panel.show_status(replace(Status(can_scan=True), angle=math.pi / 2, temperature_c=21.34))
    assert (panel.angle.text(), panel.temperature.text()) == ("90.0°", "21.3 °C")
    assert [label.text() for label in panel.figures][1:3] == ["–", "–"]
