"""The marks of a view: drawing a growing scan step by step equals drawing it at once."""

import numpy as np
import pyqtgraph as pg
from pytestqt.qtbot import QtBot
from sonarhw_compare.matching.match import Kind
from sonarhw_gui.look.palette import LIGHT
from sonarhw_gui.plots.marks import Placed, ReadingMarks
from sonarhw_gui.shown.shown import ClassPoints


def _placed(*readings: int, shift: float = 0.0) -> Placed:
    along = np.array(readings, float)
    return ClassPoints(readings, along, along), np.column_stack((along + shift, along))


def test_marks_follow_added_moved_and_removed_readings(qtbot: QtBot) -> None:
    plot = pg.PlotWidget()
    qtbot.addWidget(plot)
    marks = ReadingMarks(plot.plotItem, str)
    marks.set_look(LIGHT)
    scatter = marks.scatters[Kind.MATCH]
    steps = _placed(1), _placed(1, 4, 5), _placed(1, 4, 5), _placed(4, 5), _placed(4, 5, shift=0.1), _placed()
    for points, places in steps:
        marks.draw({Kind.MATCH: (points, places)})
        assert np.array_equal(np.column_stack(scatter.getData()), places)
        assert list(scatter.data["data"]) == list(points.readings)
        assert scatter.isVisible() == bool(points.readings)
