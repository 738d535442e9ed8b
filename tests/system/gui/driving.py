"""Mouse actions and waiting for the tests of the window."""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyqtgraph as pg
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtWidgets import QDialog, QWidget
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import DARK
from sonarhw_gui.views.marks import ReadingMarks
from sonarhw_gui.window.dialogs import open_dialog
from sonarhw_gui.window.window import MainWindow

from tests.hang_guard import HANG

PATIENCE = round(1000 * HANG)  # ms


def until(qtbot: QtBot, condition: Callable[[], bool]) -> None:
    qtbot.waitUntil(condition, timeout=PATIENCE)


def activate(qtbot: QtBot, window: QWidget) -> None:
    """Show a window and wait until keys go to it.

    Without a window manager, the X server can ignore a request for the focus, so the request is repeated.
    """
    window.show()

    def active() -> bool:
        window.activateWindow()
        return window.isActiveWindow()

    until(qtbot, active)


def dialog_of(window: MainWindow) -> Any:
    """Return the open dialog of a window; None without one."""
    return open_dialog(window, QDialog)


def predicted(window: MainWindow) -> bool:
    """Return whether the prediction is final and every reading is compared."""
    shown, status = window.session.shown, window.session.status
    compared = all(shown.row(k) is not None for k in range(len(shown.readings)))
    draft = shown.compared is not None and shown.compared.draft
    return compared and not draft and not status.prediction.searching and shown.outline is not None


def log_name(window: MainWindow) -> str:
    """Return the name of the replayed log; empty without one."""
    replay = window.session.status.replay
    return "" if replay is None else replay.name


def ended(window: MainWindow) -> bool:
    """Return whether a live scan has run and ended."""
    phase = window.session.status.job.phase
    return phase is not None and not window.session.status.scanning


def position_of(marks: ReadingMarks, reading: int) -> tuple[float, float]:
    """Return where a reading is drawn, in plot coordinates."""
    for points, places in marks.placed.values():
        if reading in points.readings:
            return tuple(places[points.readings.index(reading)])
    raise AssertionError(f"reading {reading} is not drawn")


def click(qtbot: QtBot, view: pg.GraphicsView, box: pg.ViewBox, at: tuple[float, float]) -> None:
    """Click a point given in plot coordinates."""
    pixel = view.mapFromScene(box.mapViewToScene(QPointF(*at)))
    qtbot.mouseMove(view.viewport(), pixel)
    qtbot.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=pixel)


def pixel_at(view: pg.GraphicsView, box: pg.ViewBox, at: tuple[float, float]) -> QPoint:
    """Return the pixel of a point given in plot coordinates."""
    return view.mapFromScene(box.mapViewToScene(QPointF(*at)))


def drag(qtbot: QtBot, view: pg.GraphicsView, box: pg.ViewBox, *way: tuple[float, float]) -> None:
    """Drag with the mouse through points given in plot coordinates."""
    end = begin_drag(qtbot, view, box, *way)
    qtbot.mouseRelease(view.viewport(), Qt.MouseButton.LeftButton, pos=end)


def begin_drag(qtbot: QtBot, view: pg.GraphicsView, box: pg.ViewBox, *way: tuple[float, float]) -> QPoint:
    """Drag without releasing the button; return the last pixel."""
    pixels = [pixel_at(view, box, at) for at in way]
    qtbot.mouseMove(view.viewport(), pixels[0])
    qtbot.mousePress(view.viewport(), Qt.MouseButton.LeftButton, pos=pixels[0])
    for pixel in pixels[1:]:
        for part in (0.5, 1.0):  # two moves: the first one begins the drag
            between = pixels[0] + (pixel - pixels[0]) * part
            qtbot.mouseMove(view.viewport(), between)
    return pixels[-1]


def keep_pictures(qtbot: QtBot, window: MainWindow, name: str) -> None:
    """Save pictures of the window, dark and light in two sizes, if SONARHW_SCREENSHOTS names a folder."""
    folder = os.environ.get("SONARHW_SCREENSHOTS")
    if folder is None:
        return
    light = window.session.shown.look
    for look in (light, replace(light, palette=DARK)):
        window.session.showing.set_look(look)
        for width, height in ((1024, 600), (1280, 800)):
            window.resize(width, height)
            qtbot.wait(300)  # only for pictures, which are looked at
            window.grab().save(str(Path(folder) / f"{name}_{look.palette.name}_{width}.png"))
    window.session.showing.set_look(light)
