"""The marks of a view: drawing a growing scan step by step equals drawing it at once."""

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtGui import QImage, QPainter
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind
from sonarhw_gui.model.look import LIGHT, Look
from sonarhw_gui.model.shown import ClassPoints
from sonarhw_gui.views.marks import Placed, ReadingMarks, Spots


def _placed(*readings: int, shift: float = 0.0) -> Placed:
    along = np.array(readings, float)
    return ClassPoints(readings, along, along), np.column_stack((along + shift, along))


def test_marks_follow_added_moved_and_removed_readings(qtbot: QtBot) -> None:
    plot = pg.PlotWidget()
    qtbot.addWidget(plot)
    marks = ReadingMarks(plot.plotItem, str)
    marks.set_look(Look(LIGHT))
    scatter = marks.scatters[Kind.MATCH]
    steps = _placed(1), _placed(1, 4, 5), _placed(1, 4, 5), _placed(4, 5), _placed(4, 5, shift=0.1), _placed()
    for points, places in steps:
        marks.draw({Kind.MATCH: (points, places)})
        assert np.array_equal(np.column_stack(scatter.getData()), places)
        assert list(scatter.about) == list(points.readings)
        assert scatter.isVisible() == bool(points.readings)


def _picture(qtbot: QtBot, scatter: pg.GraphicsObject, colours: tuple[str, ...]) -> bytes:
    """Return the pixels of five spots, added in two steps, in the last of these colours."""
    plot = pg.PlotWidget(background="k")
    qtbot.addWidget(plot)
    plot.resize(300, 200)
    for axis in ("left", "bottom"):
        plot.hideAxis(axis)
    plot.setRange(xRange=(0, 6), yRange=(0, 4))
    plot.addItem(scatter)
    scatter.setData([1.0, 2.0, 3.0], [1.0, 3.0, 2.0])
    scatter.addPoints([4.0, 5.0], [2.0, 1.0])
    for colour in colours:
        scatter.setBrush(pg.mkBrush(colour))
    picture = QImage(300, 200, QImage.Format.Format_ARGB32)
    picture.fill(0)
    with QPainter(picture) as painter:
        plot.scene().render(painter)
    return bytes(picture.constBits())


@pytest.mark.parametrize("symbol", ["o", "t", "crosshair"])
def test_spots_look_as_those_of_pyqtgraph(qtbot: QtBot, symbol: str) -> None:
    style = {"symbol": symbol, "size": 11, "pen": pg.mkPen("y", width=2)}
    expected = _picture(qtbot, pg.ScatterPlotItem(**style), ("g", "r"))
    assert _picture(qtbot, Spots(**style), ("g", "r")) == expected
    assert _picture(qtbot, Spots(**style), ("r", "g")) != expected
