"""The window remembered when it closes, and put back as it was left.

Takes a window and what was remembered; hands on what is to be remembered of it.
"""

from contextlib import suppress
from pathlib import Path

from PySide6.QtCore import QByteArray, QObject, Slot
from PySide6.QtWidgets import QSplitter

from sonarhw.errors import OutputError
from sonarhw_gui.session.memory import LayoutMemory, LookMemory, Memory, SceneMemory, write_memory
from sonarhw_gui.shell.main_window import MainWindow


class Remembering(QObject):
    """Writes down how a window is left."""

    def __init__(self, window: MainWindow, path: Path) -> None:
        super().__init__(window)
        self._window = window
        self._path = path
        window.closing.connect(self._write)

    @Slot()
    def _write(self) -> None:
        with suppress(OutputError):  # nobody is there any more to be told, and the next window opens as usual
            write_memory(self._path, remembered(self._window))


def remembered(window: MainWindow) -> Memory:
    """What is to be remembered of a window, before it is hidden."""
    session = window.session
    return Memory(
        scene=SceneMemory.of(session.shown.scene),
        log=session.log_to_keep,
        url=session.scanners.url,
        wish=session.live.wish,
        recent=session.documents.recent,
        urls=session.scanners.urls,
        look=LookMemory.of(session.shown.look),
        layout=LayoutMemory(
            geometry=_text(window.saveGeometry()),
            docks=_text(window.saveState()),
            splitters={splitter.objectName(): _text(splitter.saveState()) for splitter in _splitters(window)},
            view=window.stage.currentIndex(),
        ),
    )


def put_back(window: MainWindow, memory: Memory) -> None:
    """Lists and layout as they were; what has no place any more is left as usual."""
    layout = memory.layout
    window.session.remember_used(memory.recent, memory.urls)
    window.restoreGeometry(_bytes(layout.geometry))
    window.restoreState(_bytes(layout.docks))
    for splitter in _splitters(window):
        if splitter.objectName() in layout.splitters:
            splitter.restoreState(_bytes(layout.splitters[splitter.objectName()]))
    views = window.commands.views.actions()
    if 0 <= layout.view < len(views):
        views[layout.view].trigger()


def _splitters(window: MainWindow) -> list[QSplitter]:
    return [splitter for splitter in window.findChildren(QSplitter) if splitter.objectName()]


def _text(data: QByteArray) -> str:
    return bytes(data.toBase64().data()).decode("ascii")


def _bytes(text: str) -> QByteArray:
    return QByteArray.fromBase64(text.encode("ascii", "replace"))
