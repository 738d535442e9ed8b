"""Keys, mouse actions and waiting for the tests of the window."""

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QEventLoop, QPoint, QPointF, Qt, QTimer
from PySide6.QtGui import QContextMenuEvent, QKeySequence
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QDialog, QMenu, QWidget
from sonarhw_gui.model.look import DARK
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.views.marks import ReadingMarks
from sonarhw_gui.window.dialogs import open_dialog
from sonarhw_gui.window.window import MainWindow

from tests.hang_guard import HANG

PATIENCE = round(1000 * HANG)  # ms
LEFT = Qt.MouseButton.LeftButton


def pause(duration: int) -> None:
    """Process events for a time, ms. `QTest.qWait` would keep the lock of the interpreter, so that no thread runs."""
    loop = QEventLoop()
    QTimer.singleShot(duration, loop.quit)
    loop.exec()


def until(condition: Callable[[], object]) -> None:
    """Process events until a condition holds."""
    deadline = time.monotonic() + HANG
    while not condition():
        assert time.monotonic() < deadline, "not so within the time after which something hangs"
        pause(10)


def key(widget: QWidget, *names: str) -> None:
    """Press keys, such as "Ctrl+Z", one after another."""
    for name in names:
        combination = QKeySequence(name)[0]
        QTest.keyClick(widget, combination.key(), combination.keyboardModifiers())


def enter(field: QWidget, text: str) -> None:
    """Replace the text of a field with the keyboard, and press Return."""
    field.setFocus()
    field.selectAll()
    QTest.keyClicks(field, text)
    key(field, "Return")


def push(widget: QWidget, at: QPoint | None = None) -> None:
    """Click a widget with the left button, by default in its middle."""
    QTest.mouseClick(widget, LEFT, pos=at or widget.rect().center())


def activate(window: QWidget) -> None:
    """Show a window and wait until keys go to it.

    Without a window manager, the X server can ignore a request for the focus, so the request is repeated.
    """
    window.show()

    def active() -> bool:
        window.activateWindow()
        return window.isActiveWindow()

    until(active)


def dialog_of(window: MainWindow) -> Any:
    """Return the open dialog of a window; None without one."""
    return open_dialog(window, QDialog)


def menu_of(below: QWidget, at: QPoint | None = None) -> QMenu:
    """Open and return the context menu of a widget."""
    at = at or below.rect().center()
    QApplication.sendEvent(below, QContextMenuEvent(QContextMenuEvent.Reason.Mouse, at, below.mapToGlobal(at)))
    return QApplication.activePopupWidget()


def predicted(of: MainWindow | WindowSession) -> bool:
    """Return whether the prediction is final and every reading is compared."""
    session = _session(of)
    shown, status = session.shown, session.status
    compared = all(shown.row(k) is not None for k in range(len(shown.readings)))
    draft = shown.compared is not None and shown.compared.draft
    return compared and not draft and not status.prediction.searching and shown.outline is not None


def log_name(of: MainWindow | WindowSession) -> str:
    """Return the name of the replayed log; empty without one."""
    replay = _session(of).status.replay
    return "" if replay is None else replay.name


def ended(of: MainWindow | WindowSession) -> bool:
    """Return whether a live scan has run and ended."""
    status = _session(of).status
    return status.job.phase is not None and not status.scanning


def _session(of: MainWindow | WindowSession) -> WindowSession:
    return of.session if isinstance(of, MainWindow) else of


def drawn(marks: ReadingMarks) -> dict[int, tuple[float, float]]:
    """Return where each reading is drawn, in plot coordinates."""
    placed = marks.placed.values()
    return {k: tuple(at) for points, places in placed for k, at in zip(points.readings, places, strict=True)}


def pixel_at(view: pg.GraphicsView, box: pg.ViewBox, at: tuple[float, float]) -> QPoint:
    """Return the pixel of a point given in plot coordinates."""
    return view.mapFromScene(box.mapViewToScene(QPointF(*at)))


def click(view: pg.GraphicsView, box: pg.ViewBox, at: tuple[float, float]) -> None:
    """Click a point given in plot coordinates."""
    pixel = pixel_at(view, box, at)
    QTest.mouseMove(view.viewport(), pixel)
    push(view.viewport(), pixel)


def drag(view: pg.GraphicsView, box: pg.ViewBox, *way: tuple[float, float]) -> None:
    """Drag with the mouse through points given in plot coordinates."""
    QTest.mouseRelease(view.viewport(), LEFT, pos=begin_drag(view, box, *way))


def begin_drag(view: pg.GraphicsView, box: pg.ViewBox, *way: tuple[float, float]) -> QPoint:
    """Drag without releasing the button; return the last pixel."""
    pixels = [pixel_at(view, box, at) for at in way]
    QTest.mouseMove(view.viewport(), pixels[0])
    QTest.mousePress(view.viewport(), LEFT, pos=pixels[0])
    for pixel in pixels[1:]:
        for part in (0.5, 1.0):  # two moves: the first one begins the drag
            QTest.mouseMove(view.viewport(), pixels[0] + (pixel - pixels[0]) * part)
    return pixels[-1]


def keep_pictures(window: MainWindow, name: str) -> None:
    """Save pictures of the window, dark and light in two sizes, if SONARHW_SCREENSHOTS names a folder."""
    folder = os.environ.get("SONARHW_SCREENSHOTS")
    if folder is None:
        return
    light = window.session.shown.look
    for look in (light, replace(light, palette=DARK)):
        window.session.showing.set_look(look)
        for width, height in ((1024, 600), (1280, 800)):
            window.resize(width, height)
            pause(300)  # only for pictures, which are looked at
            window.grab().save(str(Path(folder) / f"{name}_{look.palette.name}_{width}.png"))
    window.session.showing.set_look(light)
