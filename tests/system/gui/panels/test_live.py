"""Live scans in a real window: complete, stopped, broken or closed, each with a readable log."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.edits import with_sensor_at
from sonarhw_gui.model.look import MARKS, Unclassed
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.session import session as tick_timer
from sonarhw_gui.session.scanner import Phase, ScannerOpener
from sonarhw_sim.predict.room_echoes import RoomEchoes

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Endpoint, open_server_port, serve
from sonarhw.errors import LinkError
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from tests.fixtures.faulty_boards import faulty
from tests.hang_guard import HANG
from tests.system.gui.conftest import ENDLESS, ORDER, OpenFake, OpenWith
from tests.system.gui.driving import ended, predicted, until


def test_a_scan_fills_every_view(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window) and predicted(window))
    shown = window.session.shown
    assert len(shown.readings) == ORDER.readings
    drawn = sum(len(points.readings) for points, _ in window.views.plan.drawing._marks.placed.values())
    assert drawn == sum(reading.range is not None for reading in shown.readings)
    assert Unclassed.MEASURED not in shown.classes
    assert set(shown.classes) <= set(MARKS)
    until(qtbot, lambda: (trace := window.session.shown.trace) is not None and trace.predicted is not None)
    trace = window.session.shown.trace
    assert trace.measured is not None
    assert len(trace.predicted.envelope.times) > 500
    assert len(window.views.ranges._outline.getData()[0]) >= 360
    assert window.sentence.text() == shown.sentence
    assert window.windowTitle() == "sonarhw — Simple room · place figure9 · fake readings — simple.toml[*]"


def test_a_reading_is_shown_without_a_wait_for_the_regular_tick(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = open_with(source=fake(4.0), autostart=True, order=ENDLESS)
    until(qtbot, lambda: len(window.session.shown.readings) >= 3)
    monkeypatch.setattr(tick_timer, "TICK", 3_600_000)
    before = len(window.session.shown.readings)
    until(qtbot, lambda: len(window.session.shown.readings) >= before + 5)


def test_the_log_of_a_scan_contains_every_reading_and_the_place(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake
) -> None:
    window = open_with(source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window))
    path = window.session.status.job.recording
    log = read_log(path)
    assert log.torn is None
    assert len(log.readings) == ORDER.readings
    assert (log.metadata.place, log.metadata.room_file) == ("figure9", "simple.toml")
    assert path.name.endswith("_simple-room.mcap")
    assert f"recorded in {path}" in window.status_bar.activity.text()


def test_a_nearly_full_disk_is_reported_and_the_scan_continues(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sonarhw.files.free_bytes", lambda _: 20_000_000)
    window = open_with(source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window))
    assert "its disk is nearly full: 20.0 MB are free" in window.banner.message
    assert len(read_log(window.session.status.job.recording).readings) == ORDER.readings


def test_the_log_of_a_scan_contains_the_board(qtbot: QtBot, open_with: OpenWith, fake: OpenFake, scene: Scene) -> None:
    window = open_with(source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window))
    metadata = read_log(window.session.status.job.recording).metadata
    assert (metadata.board, metadata.board_text) == (scene.board.name, scene.board.text)
    assert scene_of_log(metadata).board.text == scene.board.text != ""


def test_stop_ends_a_scan_and_its_log_is_complete(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(source=fake(4.0), autostart=True, order=ENDLESS)
    until(qtbot, lambda: len(window.session.shown.readings) >= 3)
    until(qtbot, lambda: window.status_bar.badge.text() == "● live")
    assert not window.commands.scan.isEnabled()
    window.commands.stop.trigger()
    until(qtbot, lambda: ended(window))
    assert window.session.status.job.phase is Phase.STOPPED
    assert window.status_bar.badge.text() == "recorded"
    assert window.banner.message == ""
    assert window.commands.scan.isEnabled()
    log = read_log(window.session.status.job.recording)
    assert log.torn is None
    assert 3 <= len(log.readings) < ENDLESS.readings


def stopped_before(step: str, opener: ScannerOpener) -> ScannerOpener:
    """Return an opener of a scanner that begins a step, `home` or `scan`, only after a stop has arrived."""

    @contextmanager
    def opened() -> Iterator[Scanner]:
        stopped = threading.Event()
        with opener() as scanner:
            stop, begin = scanner.stop, getattr(scanner, step)

            def stop_and_signal() -> None:
                stop()
                stopped.set()

            def begin_later(*order: object) -> object:
                assert stopped.wait(HANG)
                return begin(*order)

            scanner.stop = stop_and_signal
            setattr(scanner, step, begin_later)
            yield scanner

    return opened


@pytest.mark.parametrize(("step", "phase"), [("home", Phase.HOMING), ("scan", Phase.SCANNING)])
def test_a_stop_before_the_first_reading_leaves_no_readings(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, step: str, phase: Phase
) -> None:
    window = open_with(source=stopped_before(step, fake("max")), autostart=True)
    until(qtbot, lambda: window.session.status.job.phase is phase)
    window.commands.stop.trigger()
    until(qtbot, lambda: ended(window))
    assert window.session.status.job.phase is Phase.STOPPED
    assert window.session.shown.readings == ()
    assert window.session.status.job.recording is None


def test_a_stop_before_the_scanner_answers_leaves_no_log(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    opening, proceed = threading.Event(), threading.Event()
    opener = fake("max")

    @contextmanager
    def slow() -> Iterator[Scanner]:
        opening.set()
        assert proceed.wait(HANG)
        with opener() as scanner:
            yield scanner

    window = open_with(source=slow, autostart=True)
    until(qtbot, opening.is_set)
    window.session.stop()
    proceed.set()
    until(qtbot, lambda: ended(window))
    assert window.session.status.job.phase is Phase.STOPPED
    assert window.session.status.job.recording is None


def test_a_stop_directly_after_scan_leaves_no_readings_and_the_next_scan_works(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake
) -> None:
    window = open_with(source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window) and predicted(window))
    first = window.session.status.job.recording
    window.commands.scan.trigger()
    window.session.stop()  # in the same event: the command is enabled later
    until(qtbot, lambda: ended(window) and window.session.status.job.phase is Phase.STOPPED)
    until(qtbot, lambda: window.session.shown.readings == ())
    assert (window.session.status.job.recording, window.banner.message) == (None, "")
    assert len(read_log(first).readings) == ORDER.readings
    window.commands.scan.trigger()
    until(qtbot, lambda: ended(window) and window.session.status.job.recording not in (None, first))
    assert len(window.session.shown.readings) == ORDER.readings


def test_a_second_scan_starts_without_old_readings(qtbot: QtBot, open_with: OpenWith, fake: OpenFake) -> None:
    window = open_with(source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window) and predicted(window))
    first = window.session.status.job.recording
    window.commands.scan.trigger()
    until(qtbot, lambda: window.session.status.job.recording not in (None, first))
    until(qtbot, lambda: ended(window) and predicted(window))
    assert len(window.session.shown.readings) == ORDER.readings
    assert len(read_log(first).readings) == ORDER.readings


def test_closing_during_a_scan_leaves_a_complete_log_and_no_thread(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake
) -> None:
    before = {thread.name for thread in threading.enumerate()}
    window = open_with(source=fake(4.0), autostart=True, order=ENDLESS)
    until(qtbot, lambda: len(window.session.shown.readings) >= 3)
    recording = window.session.status.job.recording
    window.close()
    left = {thread.name for thread in threading.enumerate()} - before
    assert [name for name in left if not name.startswith("serve")] == []
    log = read_log(recording)
    assert log.torn is None
    assert 3 <= len(log.readings) < ENDLESS.readings


def test_a_lost_link_shows_a_banner_and_keeps_the_readings(
    qtbot: QtBot, open_with: OpenWith, scene: Scene, echoes: RoomEchoes
) -> None:
    with vanishing(FakeBoard(echoes, 1, scene.board.blanking)) as (url, vanish):
        window = open_with(source=lambda: Scanner.open(url, reconnect=1.0), autostart=True, order=ENDLESS)
        until(qtbot, lambda: len(window.session.shown.readings) >= 3)
        vanish()
        until(qtbot, lambda: ended(window))
    assert window.session.status.job.phase is Phase.FAILED
    message = window.banner.message
    assert url in message
    assert "readings are kept in" in message
    assert len(window.session.shown.readings) >= 3
    log = read_log(window.session.status.job.recording)
    assert log.torn is None
    assert len(log.readings) >= 3


def test_angles_not_checked_because_of_a_reset_are_reported_after_the_scan(qtbot: QtBot, open_with: OpenWith) -> None:
    with serve(faulty("reset=0.1@r20"), tcp="127.0.0.1:0", pace=20) as endpoint:
        window = open_with(source=lambda: Scanner.open(endpoint.url), autostart=True)
        until(qtbot, lambda: ended(window))
    assert window.session.status.job.phase is Phase.DONE
    assert "20 of 36 angles, from 0° on, could not be checked for lost steps" in window.banner.message


def test_a_missing_scanner_shows_a_banner(qtbot: QtBot, open_with: OpenWith) -> None:
    window = open_with(source=lambda: Scanner.open("socket://127.0.0.1:9"), autostart=True)
    until(qtbot, lambda: ended(window))
    assert "127.0.0.1:9" in window.banner.message
    assert window.commands.scan.isEnabled()


def test_an_unwritable_folder_shows_a_banner(qtbot: QtBot, open_with: OpenWith, fake: OpenFake, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    window = open_with(source=fake("max"), autostart=True, recordings=tmp_path / "file" / "recordings")
    until(qtbot, lambda: ended(window))
    assert "recordings are stored there" in window.banner.message


def test_without_a_room_the_measured_points_are_shown(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake, scene: Scene
) -> None:
    window = open_with(scene=Scene(None, None, scene.board), source=fake("max"), autostart=True)
    until(qtbot, lambda: ended(window))
    assert set(window.session.shown.classes) == {Unclassed.MEASURED}
    named = {entry.text() for entry in window.legend.entries.values() if entry.isVisible()}
    assert window.session.shown.origin in named
    assert not any(": " in name for name in named)  # no class: there is nothing to match
    qtbot.mouseClick(window.legend.entries[Unclassed.MEASURED], Qt.MouseButton.LeftButton)
    assert not window.session.shown.classes
    assert "open a room file" in window.sentence.text()
    assert window.session.status.replay is None


def test_a_scanner_that_never_answers_does_not_hold_the_closing_window(qtbot: QtBot, open_with: OpenWith) -> None:
    opening, answered = threading.Event(), threading.Event()

    def open_it() -> Scanner:
        opening.set()
        answered.wait()
        raise LinkError("late")

    window = open_with(source=open_it, autostart=True)
    until(qtbot, opening.is_set)
    assert window.close()
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


def test_a_scan_from_a_moved_place_warns_that_the_scanner_has_not_moved(
    qtbot: QtBot, open_with: OpenWith, fake: OpenFake
) -> None:
    window = open_with(source=fake("max"))
    session = window.session
    session.scan()
    until(qtbot, lambda: ended(window))
    assert window.banner.message == ""
    session.showing.edit(with_sensor_at(session.shown.scene, (0.5, 0.3), 0.0), "moving the sensor")
    session.scan()
    assert "the sensor was moved only in the window" in window.banner.message
    until(qtbot, lambda: ended(window))
