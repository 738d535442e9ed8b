"""While a new prediction is computed, values of the old one are grey and the status bar says so."""

import threading
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QImage, QPalette
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs import forecast
from sonarhw_gui.jobs.forecast import PathsFound
from sonarhw_gui.model.edits import sensor_at
from sonarhw_gui.views.table import Sentence

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

OUTDATED = "grey values belong to the previous prediction"


def is_faint(sentence: Sentence) -> bool:
    """Return whether the whole sentence is grey."""
    image: QImage = sentence.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
    darkest = min(image.pixelColor(x, y).red() for y in range(0, image.height(), 2) for x in range(0, image.width(), 2))
    return darkest > QColor(sentence.palette().color(QPalette.ColorRole.WindowText)).red() + 60


def test_values_are_grey_from_an_edit_until_its_prediction(
    qtbot: QtBot,
    open_with: OpenWith,
    recorded: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    table = window.views.table.model
    cell = table.index(0, table.columnCount() - 1)
    assert table.data(cell, Qt.ItemDataRole.ForegroundRole) is None
    assert not is_faint(window.sentence)

    gate, find_paths = threading.Event(), forecast.find_paths

    def find_late(*args: object) -> PathsFound:
        gate.wait()
        return find_paths(*args)

    monkeypatch.setattr(forecast, "find_paths", find_late)
    request.addfinalizer(gate.set)  # otherwise the window would not close
    before = window.session.shown.compared
    window.session.showing.edit(*sensor_at(window.session.shown.scene, (0.4, 0.3)))
    until(qtbot, lambda: OUTDATED in window.status_bar.activity.text())
    assert window.session.shown.compared is before
    faint = QColor(window.session.shown.look.palette.faint)
    assert table.data(cell, Qt.ItemDataRole.ForegroundRole).color() == faint
    assert is_faint(window.sentence)

    gate.set()
    until(qtbot, lambda: window.session.shown.compared is not before)
    assert table.data(cell, Qt.ItemDataRole.ForegroundRole) is None
    until(qtbot, lambda: OUTDATED not in window.status_bar.activity.text())
    assert not is_faint(window.sentence)
    until(qtbot, lambda: predicted(window))
