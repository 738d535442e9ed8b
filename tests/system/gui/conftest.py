"""Fixtures for tests of real windows: a fake scanner on a loopback socket, a recorded log, windows without leaks."""

import gc
import re
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from math import radians
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session.scanner import ScannerFinder, ScannerOpener, ScannerTarget, ScanSettings
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.window.start import WindowStart, open_application, open_window
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.predict.room_echoes import RoomEchoes

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Pace, serve
from sonarhw.host.scanner import Scanner
from sonarhw.log import Log, read_log
from sonarhw.readings import ScanOrder
from tests.fixtures.leaks import working_threads
from tests.fixtures.window_scan import recorded_scan
from tests.hang_guard import HANG
from tests.system.gui.driving import activate, predicted, until

OpenFake = Callable[[Pace], ScannerOpener]
OpenWith = Callable[..., MainWindow]
OpenSession = Callable[..., WindowSession]
ORDER = ScanOrder(start=0.0, step=radians(10), headings=36)
# of the threads that a window must end; the far end of a line, `sonarhw.device`, belongs to the fixture that serves it
NEAR = re.compile(r"sonarhw(?!\.device\.)")
ENDLESS = replace(ORDER, sweeps=1000)  # every test stops it early


@pytest.fixture
def fake(scene: Scene, echoes: RoomEchoes) -> Iterator[OpenFake]:
    """Return a function that serves a fake scanner at a given pace until the test ends; homing takes one second."""
    with ExitStack() as during:

        def open_fake(pace: Pace) -> ScannerOpener:
            board = FakeBoard(echoes, 2, scene.board.blanking)
            endpoint = during.enter_context(serve(board, tcp="127.0.0.1:0", pace=pace))
            return lambda: Scanner.open(endpoint.url)

        yield open_fake


@pytest.fixture(autouse=True, scope="module")
def loaded_libraries_frozen() -> None:
    """Exclude loaded libraries from garbage collection, which would take 0.2 s longer after every test."""
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def garbage_collected_between_tests() -> Iterator[None]:
    """Collect garbage only between tests, as the application does between events: see `window.garbage`."""
    gc.disable()
    yield
    gc.collect()
    gc.enable()


@pytest.fixture
def open_with(qapp: object, scene: Scene, tmp_path: Path) -> Iterator[OpenWith]:
    """Return a function that opens a window. At the end, windows are closed and must leave no thread."""
    with opening(scene, tmp_path / "recordings") as open_it:
        yield open_it


@contextmanager
def opening(scene: Scene, recordings: Path) -> Iterator[OpenWith]:
    before = working_threads(NEAR)
    windows: list[MainWindow] = []

    def open_it(**start: object) -> MainWindow:
        open_application()
        settings = {"scene": scene, "order": ORDER, "recordings": recordings, **start}
        window = open_window(WindowStart(**settings))
        windows.append(window)
        activate(window)
        return window

    yield open_it
    for window in windows:
        window.close()
        window.deleteLater()
    assert_no_thread_is_left(before)


@pytest.fixture(scope="module")
def open_shared(qapp: object, scene: Scene, tmp_path_factory: pytest.TempPathFactory) -> Iterator[OpenWith]:
    """Return a function that opens a window for all tests of a module; each begins by bringing it to its own state."""
    with opening(scene, tmp_path_factory.mktemp("recordings")) as open_it:
        yield open_it


@pytest.fixture
def window(open_with: OpenWith, recorded: Path) -> MainWindow:
    """A window with a predicted log."""
    window = open_with(source=read_log(recorded), source_name=recorded.name, source_file=recorded)
    until(lambda: predicted(window))
    return window


@pytest.fixture
def open_session(qapp: object, scene: Scene, tmp_path: Path) -> Iterator[OpenSession]:
    """Return a function that begins the session of a window, without the window."""
    before, here, folder = working_threads(NEAR), scene, tmp_path / "recordings"
    sessions: list[WindowSession] = []

    def open_it(
        source: ScannerTarget | ScannerOpener | Log | None = None,
        *,
        scene: Scene = here,
        order: ScanOrder = ORDER,
        recordings: Path = folder,
        find_scanner: ScannerFinder | None = None,
        memory: Path | None = None,
    ) -> WindowSession:
        log = source if isinstance(source, Log) else None
        target = None if log is not None or source is None else source
        if target is not None and not isinstance(target, ScannerTarget):
            target = ScannerTarget("", target)
        session = WindowSession(scene, target, ScanSettings(recordings, order), None, find_scanner, memory)
        sessions.append(session)
        if log is not None:
            session.show_log(log)
        session.begin()
        return session

    yield open_it
    for session in sessions:
        session.close()
        session.deleteLater()
    assert_no_thread_is_left(before)


@pytest.fixture
def jobs(qapp: object) -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


def assert_no_thread_is_left(before: Mapping[threading.Thread, str]) -> None:
    for thread in working_threads(NEAR).keys() - before.keys():
        thread.join(HANG)  # on a busy machine, a window does not wait for all of them
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    assert not {thread.name: module for thread, module in working_threads(NEAR).items() if thread not in before}


@pytest.fixture(scope="session")
def recorded(scene: Scene, echoes: RoomEchoes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a log of a complete scan with traces."""
    settings = ScanSettings(tmp_path_factory.mktemp("recorded"), ORDER)
    return recorded_scan(FakeBoard(echoes, 1, scene.board.blanking), scene, settings)
