"""The application: opens the window on a scene and a source, and returns the exit status.

The status is 0 after the window was closed and 130 after Ctrl-C or SIGTERM.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from types import FrameType

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from sonarhw.errors import SonarError
from sonarhw.log import Log
from sonarhw.readings import ScanOrder
from sonarhw_gui.live.scanner_jobs import WHOLE_TURN, ScannerOpener, ScanSettings
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import apply_look
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.session.memory import Memory, read_memory
from sonarhw_gui.session.scanner_choice import ScannerFinder
from sonarhw_gui.session.window_session import WindowSession
from sonarhw_gui.shell.display import check_display
from sonarhw_gui.shell.garbage import collected_between_events
from sonarhw_gui.shell.main_window import MainWindow
from sonarhw_gui.shell.window_memory import MemoryWriter, restore_window
from sonarhw_gui.store.new_recording import recordings_folder
from sonarhw_gui.store.open_requests import OpenLogRequest
from sonarhw_gui.store.recent_names import with_newest

INTERRUPTED = 130


@dataclass(frozen=True)
class WindowStart:
    """What the window opens on."""

    scene: Scene
    source: ScannerOpener | Log | None = None  # how to get at a scanner, or a log to replay
    source_name: str = "the log"  # its file name
    source_file: Path | None = None  # where a log is found again
    used: tuple[Path, ...] = ()  # files that were named for it: the recent ones from now on
    url: str = ""  # of the scanner
    find_scanner: ScannerFinder | None = None  # to any other scanner
    order: ScanOrder = WHOLE_TURN
    traces: bool = True
    autostart: bool = False  # begin to scan at once
    recordings: Path = field(default_factory=recordings_folder)
    memory: Path | None = None  # where the window remembers how it was left; None: nowhere
    resume: bool = False  # open on what was open last, where there is such
    when_open: Callable[[MainWindow], None] | None = None  # for tests and pictures


def run_window(start: WindowStart) -> int:
    """Show the window until it is closed. Raises NoDisplay where none can be opened."""
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
    """The one application of this process, the same on every system."""
    running = QApplication.instance()
    application = running if isinstance(running, QApplication) else QApplication(["sonarhw"])
    application.setApplicationName("sonarhw")
    application.setStyle("Fusion")
    apply_look(Look())
    return application


def open_window(start: WindowStart) -> MainWindow:
    """A window, not shown yet, with its session."""
    begun, memory, complaint = _resumed(start)
    opener = None if isinstance(begun.source, Log) else begun.source
    scan_settings = ScanSettings(start.recordings, start.order, start.traces)
    if start.resume and memory.scan_settings is not None:
        scan_settings = replace(memory.scan_settings, folder=start.recordings)
    unsaved = start.memory.parent / "unsaved" if start.memory is not None else None
    window = MainWindow(WindowSession(begun.scene, opener, scan_settings, memory.look, start.find_scanner, unsaved))
    window.session.scanners.url = begun.url
    restore_window(window, memory)
    recent = reduce(with_newest, (str(path.absolute()) for path in start.used), memory.recent)
    window.session.remember_used(recent, memory.urls)
    if start.memory is not None:
        MemoryWriter(window, start.memory)
    if isinstance(begun.source, Log):
        window.session.show_log(begun.source, begun.source_name, begun.source_file)
    elif begun.source_file is not None and begun is not start:
        window.session.reopen(OpenLogRequest(begun.source_file, begun.scene))  # places found and edits come back too
    elif begun.source_file is not None:
        window.session.open_file(str(begun.source_file))
    elif begun.autostart:
        window.session.scan()
    if complaint:
        window.session.warned.emit(complaint)
    return window


def _resumed(start: WindowStart) -> tuple[WindowStart, Memory, str]:
    """The start with what was open last, where that is wanted; what is remembered; and what is to be told of both.

    A scanner is not moved until somebody says so.
    """
    memory = Memory()
    try:
        if start.memory is not None:
            memory = read_memory(start.memory)
        if not start.resume or memory.scene is None or start.find_scanner is None:
            return start, memory, ""
        scene = memory.scene.scene()
        opener = start.find_scanner(memory.url).opener if memory.url else None
    except SonarError as error:
        return start, memory, str(error)
    log = Path(memory.log) if memory.log else None
    resumed = replace(start, scene=scene, source=opener, source_file=log, url=memory.url, autostart=False)
    return resumed, memory, ""


@contextmanager
def _closed_by_signals(window: MainWindow) -> Iterator[list[int]]:
    """Let Ctrl-C and SIGTERM close the window; the list holds those that came.

    Python looks at signals between its own steps, and the session's timer makes it take one every tick.
    """
    came: list[int] = []

    def close(number: int, _frame: FrameType | None) -> None:
        came.append(number)
        QTimer.singleShot(0, window.close)

    before = {number: signal.signal(number, close) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield came
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
