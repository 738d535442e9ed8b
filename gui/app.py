"""The application: opens the window on a scene and a source, and ends it clean, however it is ended.

Takes a `WindowStart`; hands on an exit status: 0 after closing the window, 130 after Ctrl-C or SIGTERM.
"""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType

import pyqtgraph as pg
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from gui.display import check_display
from gui.garbage import collected_between_events
from gui.live_scan import WHOLE_TURN, ScannerOpener, ScanWish
from gui.look import Look
from gui.main_window import MainWindow
from gui.recording import recordings_folder
from gui.scene import Scene
from gui.session import Session
from gui.theme import apply_look
from sonarhw.log import Log
from sonarhw.readings import ScanOrder

INTERRUPTED = 130


@dataclass(frozen=True)
class WindowStart:
    """What the window opens on."""

    scene: Scene
    source: ScannerOpener | Log | None = None  # how to get at a scanner, or a log to replay
    source_name: str = "the log"  # its file name
    order: ScanOrder = WHOLE_TURN
    traces: bool = True
    autostart: bool = False  # begin to scan at once
    recordings: Path = field(default_factory=recordings_folder)
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
    pg.setConfigOptions(antialias=True)
    apply_look(Look())
    return application


def open_window(start: WindowStart) -> MainWindow:
    """A window, not shown yet, with its session."""
    wish = ScanWish(start.recordings, start.order, start.traces)
    if isinstance(start.source, Log):
        window = MainWindow(Session(start.scene, None, wish))
        window.session.show_log(start.source, start.source_name)
        return window
    window = MainWindow(Session(start.scene, start.source, wish))
    if start.autostart:
        window.session.scan()
    return window


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
