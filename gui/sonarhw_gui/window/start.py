"""The application: opens the window with its display settings and layout, and returns the exit status."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from types import FrameType

from PySide6.QtCore import QByteArray, QTimer
from PySide6.QtWidgets import QApplication

from sonarhw.errors import SonarError
from sonarhw.files import recordings_folder
from sonarhw.log import Log
from sonarhw.readings import ScanOrder
from sonarhw_gui.jobs.files import with_newest
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.scene import Scene, SceneMemory
from sonarhw_gui.model.theme import apply_look
from sonarhw_gui.session.kept import Memory, read_memory
from sonarhw_gui.session.scanner import (
    WHOLE_TURN,
    ScannerFinder,
    ScannerOpener,
    ScannerTarget,
    ScanSettings,
)
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.window.display import check_display
from sonarhw_gui.window.garbage import collected_between_events, return_large_blocks
from sonarhw_gui.window.window import MainWindow

# The state of the window that the next start restores.


def memory_of(window: MainWindow) -> Memory:
    """Return the state of a window. Call this before the window is hidden."""
    session = window.session
    window.files.keep_picture(window.views.plan.drawing)
    return Memory(
        scene=SceneMemory.of(session.shown.scene),
        log=session.log_file,
        url=session.scanners.url,
        scan_settings=session.live.settings,
        recent=session.documents.recent,
        pictures=dict(window.files.pictures),
        urls=session.scanners.urls,
        look=session.shown.look,
        view=window.views.stage.currentIndex(),
        layout={
            "window": window.saveGeometry(),
            "docks": window.saveState(),
            "views": window.views.saveState(),
        },
        layouts=dict(window.layouts.layouts),
        introduced=not window.hint.is_open,
    )


def restore_window(window: MainWindow, memory: Memory) -> None:
    """Restore lists and layout; a part that no longer exists, or that Qt refuses, keeps its default."""
    window.files.pictures.update(memory.pictures)
    window.session.remember_used(memory.recent, memory.urls)
    window.restoreGeometry(memory.layout.get("window", QByteArray()))
    window.restoreState(memory.layout.get("docks", QByteArray()))
    window.views.restoreState(memory.layout.get("views", QByteArray()))
    window.layouts.restore(memory.layouts)
    views = window.commands.views
    if 0 <= memory.view < len(views):
        views[memory.view].trigger()


# The application: opens the window and returns the exit status.
#
# The status is 0 after the window was closed, and 130 after Ctrl-C or SIGTERM.


INTERRUPTED = 130


@dataclass(frozen=True)
class WindowStart:
    """The initial content of the window, and where it stores files."""

    scene: Scene
    source: ScannerTarget | ScannerOpener | Log | None = None  # a scanner, or a log to replay
    source_name: str = "the log"  # file name of the log
    source_file: Path | None = None  # path of the log; without a log, a file to open
    more_files: tuple[Path, ...] = ()  # to open after `source_file`
    used: tuple[Path, ...] = ()  # files named by the user, added to the recent files
    url: str = ""  # of the scanner
    takes_board: bool = False  # whether a board profile that the scanner names replaces that of the scene
    find_scanner: ScannerFinder | None = None  # opens any other scanner
    order: ScanOrder = WHOLE_TURN
    traces: bool = True
    autostart: bool = False  # start a scan at once
    recordings: Path = field(default_factory=recordings_folder)
    memory: Path | None = None  # file that stores the state of the window; None: not stored
    resume: bool = False  # restore the last state, if there is one
    when_open: Callable[[MainWindow], None] | None = None  # for tests and pictures


def run_window(start: WindowStart) -> int:
    """Show the window until it is closed. Raises NoDisplay without a display."""
    check_display()
    application = open_application()
    window = open_window(start)
    window.show()
    if start.when_open is not None:
        start.when_open(window)
    with _closed_by_signals(window) as signals, collected_between_events():
        status = application.exec()
    return INTERRUPTED if signals else status


def open_application() -> QApplication:
    """Return the application of this process, with the same style on every system."""
    return_large_blocks()
    running = QApplication.instance()
    application = running if isinstance(running, QApplication) else QApplication(["sonarhw"])
    application.setApplicationName("sonarhw")
    application.setStyle("Fusion")
    apply_look(Look())
    return application


def open_window(start: WindowStart) -> MainWindow:
    """Return a window with its session, not visible yet."""
    restored, memory, problem = _resumed(start)
    source = restored.source
    scanner = None if source is None or isinstance(source, Log) else source
    if scanner is not None and not isinstance(scanner, ScannerTarget):
        scanner = ScannerTarget(restored.url, scanner)
    scan_settings = ScanSettings(start.recordings, start.order, start.traces)
    if start.resume and memory.scan_settings is not None:
        scan_settings = replace(memory.scan_settings, folder=start.recordings)
    window = MainWindow(
        WindowSession(restored.scene, scanner, scan_settings, memory.look, start.find_scanner, start.memory)
    )
    window.session.takes_board = restored.takes_board
    restore_window(window, memory)
    recent = reduce(with_newest, (str(path.absolute()) for path in start.used), memory.recent)
    window.session.remember_used(recent, memory.urls)
    for path in start.used:
        if path.name == restored.scene.room_file:
            window.session.files.watch("room", path)
    if start.memory is not None:
        if not memory.introduced:
            window.hint.show_first_steps()
        window.session.kept.state = lambda: memory_of(window)
        window.closing.connect(window.session.kept.write)
    _open_source(window, restored, resumed=restored is not start)
    if problem:
        window.session.notices.warn(problem)
    return window


def _open_source(window: MainWindow, start: WindowStart, *, resumed: bool) -> None:
    """Show the log, open the file, or scan, if the start asks for one of these."""
    session = window.session
    if isinstance(start.source, Log):
        session.show_log(start.source, start.source_name, start.source_file)
    elif start.source_file is not None and resumed:
        session.open_log(start.source_file, start.scene)  # restores fit results and edits too
    elif start.source_file is not None:
        for path in (start.source_file, *start.more_files):
            session.open_file(str(path))
    elif start.autostart:
        session.scan_when_predicted()


def _resumed(start: WindowStart) -> tuple[WindowStart, Memory, str]:
    """Return the start with the last state if requested, the stored memory, and an error message or "".

    A restored start never moves a scanner.
    """
    memory = Memory()
    try:
        if start.memory is not None:
            memory = read_memory(start.memory)
        if not start.resume or memory.scene is None or start.find_scanner is None:
            return start, memory, ""
        scene = memory.scene.scene()
        again = memory.url == start.url  # then the same fake scanner follows the plan
        scanner = start.source if again else start.find_scanner(memory.url) if memory.url else None
    except SonarError as error:
        return start, memory, str(error)
    log = Path(memory.log) if memory.log else None
    resumed = replace(start, scene=scene, source=scanner, source_file=log, url=memory.url, autostart=False)
    return resumed, memory, ""


@contextmanager
def _closed_by_signals(window: MainWindow) -> Iterator[list[int]]:
    """Let Ctrl-C, SIGTERM and SIGHUP close the window. The list contains the received signals.

    Python handles a signal only while it runs Python code. The session's timer runs some at every tick.
    """
    received: list[int] = []

    def close(number: int, _frame: FrameType | None) -> None:
        received.append(number)
        QTimer.singleShot(0, window.close)

    hangup = getattr(signal, "SIGHUP", signal.SIGTERM)  # Windows has none
    endings = {number for number in (signal.SIGTERM, hangup) if signal.getsignal(number) != signal.SIG_IGN}
    before = {number: signal.signal(number, close) for number in (signal.SIGINT, *endings)}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
