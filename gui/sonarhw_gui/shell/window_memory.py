"""Store the state of the window when it closes, and restore it."""

from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QByteArray, QObject, QTimer, Slot

from sonarhw.errors import OutputError
from sonarhw_gui.scene.scene_memory import SceneMemory
from sonarhw_gui.session.memory import Memory, write_memory
from sonarhw_gui.shell.main_window import MainWindow

_EVERY = 2000  # ms between two looks for changes


class MemoryWriter(QObject):
    """Stores the state of a window when it has changed, and when it closes."""

    def __init__(self, window: MainWindow, path: Path) -> None:
        super().__init__(window)
        self._window = window
        self._path = path
        self._written: Memory | None = None
        self._timer = QTimer(self, interval=_EVERY)
        self._timer.timeout.connect(self._write)
        self._timer.start()
        window.closing.connect(self._finish)

    @Slot()
    def _finish(self) -> None:
        self._timer.stop()
        self._write()

    @Slot()
    def _write(self) -> None:
        memory = memory_of(self._window)
        if memory != self._written:
            with suppress(OutputError):  # the next window opens with older settings
                write_memory(self._path, memory)
                self._written = memory


def memory_of(window: MainWindow) -> Memory:
    """Return the state of a window. Call this before the window is hidden."""
    session = window.session
    return Memory(
        scene=SceneMemory.of(session.shown.scene),
        log=session.log_file,
        url=session.scanners.url,
        scan_settings=session.live.scan_settings,
        recent=session.documents.recent,
        urls=session.scanners.urls,
        look=session.shown.look,
        view=window.views.stage.currentIndex(),
        layout={
            "window": window.saveGeometry(),
            "docks": window.saveState(),
            "views": window.views.saveState(),
        },
        layouts=dict(window.layouts.layouts),
        introduced=window.hint.isHidden(),
    )


def restore_window(window: MainWindow, memory: Memory) -> None:
    """Restore lists and layout; a part that no longer exists, or that Qt refuses, keeps its default."""
    window.session.remember_used(memory.recent, memory.urls)
    window.restoreGeometry(memory.layout.get("window", QByteArray()))
    window.restoreState(memory.layout.get("docks", QByteArray()))
    window.views.restoreState(memory.layout.get("views", QByteArray()))
    window.layouts.restore(memory.layouts)
    views = window.commands.views.actions()
    if 0 <= memory.view < len(views):
        views[memory.view].trigger()
