"""Mouse and waiting for the tests of the window."""

from collections.abc import Callable

import pyqtgraph as pg
from PySide6.QtCore import QPointF, Qt
from pytestqt.qtbot import QtBot

from gui.main_window import MainWindow
from gui.marks import ReadingMarks

PATIENCE = 30_000  # ms


def until(qtbot: QtBot, condition: Callable[[], bool]) -> None:
    qtbot.waitUntil(condition, timeout=PATIENCE)


def predicted(window: MainWindow) -> bool:
    """Whether nothing better is still to come, with every reading compared."""
    shown, status = window.session.shown, window.session.status
    compared = all(shown.row(k) is not None for k in range(len(shown.readings)))
    draft = shown.compared is not None and shown.compared.draft
    return compared and not draft and not status.predicting and shown.outline is not None


def ended(window: MainWindow) -> bool:
    """Whether a live scan has run and is over."""
    phase = window.session.status.phase
    return phase is not None and not window.session.status.scanning


def place_of(marks: ReadingMarks, reading: int) -> tuple[float, float]:
    """Where a reading is drawn."""
    for points, places in marks.placed.values():
        if reading in points.readings:
            return tuple(places[points.readings.index(reading)])
    raise AssertionError(f"reading {reading} is not drawn")


def click(qtbot: QtBot, view: pg.GraphicsView, box: pg.ViewBox, at: tuple[float, float]) -> None:
    """Click a point of a plot, given in its own coordinates, with the mouse."""
    pixel = view.mapFromScene(box.mapViewToScene(QPointF(*at)))
    qtbot.mouseMove(view.viewport(), pixel)
    qtbot.mouseClick(view.viewport(), Qt.MouseButton.LeftButton, pos=pixel)
