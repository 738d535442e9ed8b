"""Scans in the window: complete, stopped, broken or closed, each with a readable log; the scanner and its cable."""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtGui import QStatusTipEvent
from PySide6.QtWidgets import QApplication, QDialog
from sonarhw_gui.model.edits import with_sensor_at
from sonarhw_gui.model.look import MARKS, Unclassed
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.session import session as tick_timer
from sonarhw_gui.session.scanner import JobState, Phase
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.session.status import Status, link_figures, order_of_sector, scan_summary, state_text
from sonarhw_gui.window.bars import activity_text, badge_text
from sonarhw_sim.predict.room_echoes import EXACT, RoomEchoes

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Endpoint, open_server_port, serve
from sonarhw.errors import LinkError
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from sonarhw.readings import Ping, PingResult, ScanOrder, sector
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.stuck_boards import EndlessHoming
from tests.hang_guard import HANG
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenSession, OpenWith
from tests.system.gui.driving import activate, drawn, ended, enter, key, predicted, push, until

LONG = replace(ORDER, sweeps=5)
AWAY = 10 * HANG  # s that the link waits for a lost scanner; every test restores it earlier


@pytest.fixture
def during() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def board(scene: Scene, echoes: RoomEchoes) -> FakeBoard:
    return FakeBoard(echoes, 3, scene.board.blanking)


def scanned(session: WindowSession, before: Path | None = None) -> Path:
    """Wait for the end of a scan, and return its log; `before`: the log of the scan before it."""
    until(lambda: ended(session) and session.status.job.recording not in (None, before))
    return session.status.job.recording


def idle(session: WindowSession, phase: Phase) -> bool:
    return session.status.job.phase is phase and not session.status.scanning


def text(session: WindowSession) -> str:
    """Return the message that the session shows."""
    return session.notices.shown.text


def test_a_scan_is_shown_with_its_prediction(open_session: OpenSession, fake: OpenFake, scene: Scene) -> None:
    session = open_session(fake("max"))
    session.scan_when_predicted()
    path = scanned(session)
    until(lambda: predicted(session))
    shown = session.shown
    assert len(shown.readings) == ORDER.readings
    assert set(shown.classes) <= set(MARKS) - {Unclassed.MEASURED}
    until(lambda: (trace := session.shown.trace) is not None and trace.predicted is not None)
    assert session.shown.trace.measured is not None
    assert len(session.shown.trace.predicted.envelope.times) > 500
    log, metadata = read_log(path), read_log(path).metadata
    assert (log.torn, len(log.readings)) == (None, ORDER.readings)
    assert (metadata.place, metadata.room_file, metadata.board) == ("figure9", "simple.toml", scene.board.name)
    assert scene_of_log(metadata).board.text == metadata.board_text == scene.board.text != ""
    assert path.name.endswith("_simple-room.mcap")
    assert f"recorded in {path}" in activity_text(session.status)

    # one connection runs several scans; a stop directly after the command leaves no readings
    session.scan()
    session.stop()
    until(lambda: idle(session, Phase.STOPPED) and session.shown.readings == ())
    assert (session.status.job.recording, text(session)) == (None, "")
    session.scan()
    second = scanned(session, path)
    assert session.status.link.statistics.reopened == 0
    assert [len(read_log(each).readings) for each in (path, second)] == [ORDER.readings] * 2
    assert len(session.shown.readings) == ORDER.readings


def test_a_scan_is_live_until_its_stop(open_with: OpenWith, fake: OpenFake, monkeypatch: pytest.MonkeyPatch) -> None:
    window = open_with(source=fake(4.0), autostart=True, order=ENDLESS)
    session, bar = window.session, window.status_bar
    until(lambda: len(session.shown.readings) >= 3 and bar.badge.text() == "● live")
    assert not window.commands.scan.isEnabled()
    with monkeypatch.context() as patch:  # a reading is shown without a wait for the regular tick
        patch.setattr(tick_timer, "TICK", 3_600_000)
        before = len(session.shown.readings)
        until(lambda: len(session.shown.readings) >= before + 5)
    key(window, "F6")
    until(lambda: idle(session, Phase.STOPPED) and bar.badge.text() == "recorded" and predicted(window))
    assert (window.banner.message, window.commands.scan.isEnabled()) == ("", True)
    log = read_log(session.status.job.recording)
    assert log.torn is None
    assert 3 <= len(log.readings) < ENDLESS.readings
    reached = {k for k, reading in enumerate(session.shown.readings) if reading.range is not None}
    until(lambda: reached <= drawn(window.views.plan.drawing.marks).keys())
    assert len(window.views.ranges.outline.getData()[0]) >= 360
    until(lambda: window.sentence.text() == session.shown.sentence)
    assert window.windowTitle() == "sonarhw — Simple room · place figure9 · fake readings — simple.toml[*]"
    QApplication.sendEvent(window, QStatusTipEvent(window.commands.scan.statusTip()))
    assert not bar.currentMessage()  # hints of commands do not cover the status of a scan
    assert bar.activity.isVisible()


def test_a_stop_that_is_sent_late_does_not_stop_the_next_scan(open_session: OpenSession, fake: OpenFake) -> None:
    sending, next_scan, opener = threading.Event(), threading.Event(), fake("max")

    @contextmanager
    def slow_to_stop() -> Iterator[Scanner]:
        with opener() as scanner:
            stop, home = scanner.stop, scanner.home

            def stop_late() -> None:
                sending.set()
                next_scan.wait(0.5)  # a correct session begins no scan while the stop is being sent
                stop()

            def home_later(*order: object) -> object:
                assert sending.wait(HANG)
                return home(*order)

            scanner.stop, scanner.home = stop_late, home_later
            yield scanner

    session = open_session(slow_to_stop)
    session.scan()
    until(lambda: session.status.job.phase is Phase.HOMING)
    session.stop()
    until(lambda: idle(session, Phase.STOPPED))
    first = session.status.job.recording
    session.scan()
    next_scan.set()
    assert len(read_log(scanned(session, first)).readings) == ORDER.readings
    assert session.status.job.phase is Phase.DONE


def test_a_stop_before_the_scanner_answers_leaves_no_log(open_session: OpenSession, fake: OpenFake) -> None:
    opening, proceed, opener = threading.Event(), threading.Event(), fake("max")

    @contextmanager
    def slow() -> Iterator[Scanner]:
        opening.set()
        assert proceed.wait(HANG)
        with opener() as scanner:
            yield scanner

    session = open_session(slow)
    session.scan()
    until(opening.is_set)
    session.stop()
    proceed.set()
    until(lambda: idle(session, Phase.STOPPED))
    assert session.status.job.recording is None


def test_closing_during_a_scan_leaves_a_complete_log_and_no_thread(open_session: OpenSession, fake: OpenFake) -> None:
    session = open_session(fake(4.0), order=ENDLESS)
    session.scan()
    until(lambda: len(session.shown.readings) >= 3)
    recording = session.status.job.recording
    session.close()  # open_session checks that no thread is left
    log = read_log(recording)
    assert log.torn is None
    assert 3 <= len(log.readings) < ENDLESS.readings


def test_a_scanner_that_never_answers_does_not_hold_the_closing_session(open_session: OpenSession) -> None:
    opening, answered = threading.Event(), threading.Event()

    def open_it() -> Scanner:
        opening.set()
        answered.wait()
        raise LinkError("late")

    session = open_session(open_it)
    session.scan()
    until(opening.is_set)
    session.close()
    answered.set()


@contextmanager
def vanishing(board: FakeBoard) -> Iterator[tuple[str, Callable[[], None]]]:
    """Serve a board; yield its URL and a function that closes its port."""
    with open_server_port(tcp="127.0.0.1:0") as port:
        endpoint = Endpoint(board, port, 4.0)
        thread = threading.Thread(target=endpoint.run)
        thread.start()

        def vanish() -> None:
            endpoint.stop()
            thread.join()
            port.close()

        yield port.url, vanish


def test_a_lost_link_is_reported_and_keeps_the_readings(open_session: OpenSession, board: FakeBoard) -> None:
    with vanishing(board) as (url, vanish):
        session = open_session(lambda: Scanner.open(url, reconnect=1.0), order=ENDLESS)
        session.scan()
        until(lambda: len(session.shown.readings) >= 3)
        vanish()
        until(lambda: idle(session, Phase.FAILED))
    assert url in text(session)
    assert "readings are kept in" in text(session)
    log = read_log(session.status.job.recording)
    assert log.torn is None
    assert len(log.readings) >= 3 <= len(session.shown.readings)


def test_what_goes_wrong_around_a_scan_is_one_message(
    open_session: OpenSession, fake: OpenFake, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    missing = open_session(lambda: Scanner.open("socket://127.0.0.1:9"))
    unwritable = open_session(fake("max"), recordings=tmp_path / "file" / "recordings")
    for session, message in ((missing, "127.0.0.1:9"), (unwritable, "recordings are stored there")):
        session.scan()
        until(lambda session=session: ended(session))
        assert message in text(session)
        assert session.status.can_scan
    monkeypatch.setattr("sonarhw.files.free_bytes", lambda _: 20_000_000)
    full = open_session(fake("max"))
    full.scan()
    assert len(read_log(scanned(full)).readings) == ORDER.readings
    assert "its disk is nearly full: 20.0 MB are free" in text(full)
    with serve(faulty("reset=0.1@r20"), tcp="127.0.0.1:0", pace=20) as endpoint:
        reset = open_session(lambda: Scanner.open(endpoint.url))
        reset.scan()
        until(lambda: idle(reset, Phase.DONE))
    assert "20 of 36 angles, from 0° on, could not be checked for lost steps" in text(reset)


def test_a_scan_from_a_moved_place_warns(open_session: OpenSession, fake: OpenFake) -> None:
    session = open_session(fake("max"))
    session.scan()
    first = scanned(session)
    assert text(session) == ""
    session.showing.edit(with_sensor_at(session.shown.scene, (0.5, 0.3), 0.0), "moving the sensor")
    session.scan()
    assert "the sensor was moved only in the window" in text(session)
    scanned(session, first)


# the panel of the scanner


def test_the_panel_drives_a_scanner(open_with: OpenWith, board: FakeBoard, during: ExitStack, recorded: Path) -> None:
    endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace="max"))
    window = open_with(source=lambda: Scanner.open(endpoint.url, reconnect=AWAY))
    session, panel = window.session, window.device
    key(window, "F7")
    push(panel.connect_button)
    until(lambda: "FAKE-0003" in panel.identity.text() and panel.state.text() == "Connected")
    enter(panel.target, "123.4")
    until(lambda: panel.angle.text() == "123.4°" and idle(session, Phase.READY))
    window.commands.home.trigger()
    until(lambda: panel.angle.text() == "0.0°" and idle(session, Phase.READY))
    assert session.shown.readings == ()
    session.live.turn(math.radians(9999))  # beyond the cable
    until(lambda: idle(session, Phase.FAILED) and window.banner.message != "")
    session.live.home()
    until(lambda: idle(session, Phase.READY))
    assert session.status.link.statistics.reopened == 0

    for field, typed in ((panel.start, "30"), (panel.end, "90"), (panel.step, "15"), (panel.pings, "2")):
        enter(field, typed)
    enter(panel.max_range, "0.6")
    panel.traces.click()
    assert panel.summary.text().startswith("4 headings, 8 readings")
    sector_order = session.live.settings.order
    enter(panel.end, "30")
    assert "the sector is empty" in panel.summary.text()
    assert session.live.settings.order == sector_order
    window.commands.scan.trigger()
    scanned(session)
    readings = session.shown.readings
    assert sorted({round(math.degrees(reading.angle), 3) for reading in readings}) == [30, 45, 60, 75]
    assert len(readings) == 8
    assert all(reading.trace is None for reading in readings)
    assert 0 < max((reading.range for reading in readings if reading.range is not None), default=0.1) < 0.62

    session.open_file(str(recorded))
    until(lambda: session.replay is not None and not window.commands.home.isEnabled())
    assert not panel.turn.isEnabled()
    assert "Leave the replay" in panel.hint.text()
    session.leave_replay()

    url = session.status.link.url
    push(panel.disconnect_button)
    until(lambda: panel.state.text() == "Not connected" and window.status_bar.badge.text() == "away")
    with Scanner.open(url) as other:
        assert other.info.serial == "FAKE-0003"
    before = session.status.job.recording
    window.commands.scan.trigger()  # connects again
    before = scanned(session, before)
    assert (len(read_log(before).readings), read_log(before).metadata.source) == (8, endpoint.url)

    panel.endless.click()  # sweeps follow one another until Stop
    assert panel.summary.text() == "sweeps of 4 headings until Stop"
    assert not panel.sweeps.isEnabled()
    window.commands.scan.trigger()
    until(lambda: len(session.shown.readings) > 24)
    window.commands.stop.trigger()
    assert max(reading.sweep for reading in read_log(scanned(session, before)).readings) >= 3
    panel.endless.click()
    assert panel.sweeps.isEnabled()


def test_f6_stops_a_turning_turntable(open_with: OpenWith, echoes: RoomEchoes, during: ExitStack) -> None:
    endpoint = during.enter_context(serve(EndlessHoming(echoes), tcp="127.0.0.1:0", pace=4.0))
    window = open_with(source=lambda: Scanner.open(endpoint.url, reconnect=AWAY))
    dialog = QDialog(window)
    for front in (window, dialog):
        activate(front)
        window.session.live.home()
        until(lambda: window.session.status.job.phase is Phase.HOMING)
        key(front, "F6")
        until(lambda: idle(window.session, Phase.STOPPED))
    assert window.banner.message == ""


def test_a_descending_sector_has_a_negative_step() -> None:
    order = order_of_sector(90.0, 0.0, 10.0, sweeps=2, pings=3)
    assert order == ScanOrder(math.radians(90), math.radians(-10), 9, 2, 3)
    assert order_of_sector(0.0, 360.0, 5.0, 1, 1) == sector()
    assert scan_summary(order, None) == "9 headings, 54 readings"
    with pytest.raises(ValueError, match="are possible; reduce one"):
        order_of_sector(0.0, 360.0, 0.01, sweeps=10_000, pings=100)


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


def test_a_cable_pulled_during_a_scan(open_with: OpenWith, scene: Scene, during: ExitStack) -> None:
    echoes = PulledOnce(scene.room, scene.place, scene.board, 1, EXACT)
    echoes.prepare()
    board = echoes.board = FakeBoard(echoes, 3, scene.board.blanking)
    endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace=6.0))
    window = open_with(source=lambda: Scanner.open(endpoint.url, reconnect=AWAY), autostart=True, order=LONG)
    session, bar = window.session, window.status_bar
    until(lambda: "The scan then continues by itself" in window.banner.message)
    until(lambda: bar.activity.text().startswith("waiting for the scanner"))
    assert (bar.badge.text(), session.status.scanning, window.commands.stop.isEnabled()) == ("away", True, True)
    push(window.banner.close_button)
    session.tick()
    assert window.banner.message == ""  # a dismissed banner stays hidden
    board.plug = 0
    until(lambda: idle(session, Phase.DONE) and bar.badge.text() == "recorded")
    assert sorted(reading.number for reading in session.shown.readings) == list(range(LONG.readings))
    assert session.status.link.statistics.losses >= 1
    assert len(read_log(session.status.job.recording).readings) == LONG.readings


def test_a_cable_pulled_between(open_session: OpenSession, board: FakeBoard, during: ExitStack, scene: Scene) -> None:
    endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace="max"))
    session = open_session(lambda: Scanner.open(endpoint.url, reconnect=AWAY))
    session.scan()
    scanned(session)
    until(lambda: session.status.badge == "recorded")
    board.plug = None
    until(lambda: "plug the scanner in again" in text(session))
    assert state_text(session.status).startswith("Lost")
    board.plug = 0
    until(lambda: text(session) == "" and state_text(session.status) == "Connected")
    link = session.status.link
    for drift, shown in ((1e-4, "+100 ppm"), (-0.019, "-19000 ppm"), (-0.02, "–"), (0.02, "–")):
        figures = {name: figure for name, figure, _ in link_figures(replace(link, drift=drift))}
        assert figures["Clock drift"] == shown  # none for a scanner at another pace
    session.set_scene(replace(scene, room=replace(scene.room, name="elsewhere")))
    assert session.status.badge == "earlier scan"
    session.set_scene(scene)
    assert session.status.badge == "recorded"
    session.live.disconnect()
    until(lambda: session.status.badge == "away")
    session.live.connect()
    until(lambda: idle(session, Phase.READY) and session.status.badge == "recorded")
    session.live.use(None)  # as if another scanner was chosen
    until(lambda: session.status.badge == "away")
    for readings, badge in ((12, "lost"), (0, "no scan")):
        assert badge_text(Status(JobState(Phase.FAILED), chosen=True, readings=readings)) == badge


def test_a_waiting_scan_can_be_stopped(open_session: OpenSession, board: FakeBoard, during: ExitStack) -> None:
    endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace=4.0))
    session = open_session(lambda: Scanner.open(endpoint.url, reconnect=AWAY), order=ENDLESS)
    session.scan()
    until(lambda: len(session.shown.readings) >= 2)
    board.plug = None
    until(lambda: text(session) != "")
    session.stop()
    until(lambda: idle(session, Phase.STOPPED))
    assert len(read_log(session.status.job.recording).readings) >= 2
