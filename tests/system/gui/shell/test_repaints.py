"""Hundreds of repaints: the count of references to None stays level (some PySide6 versions lose or leak them)."""

import gc
import sys
from pathlib import Path

from pytestqt.qtbot import QtBot

from sonarhw.log import read_log
from tests.conftest import Count
from tests.system.gui.conftest import ORDER, OpenWith
from tests.system.gui.driving import predicted, until

REPAINTS = 120, 10_000  # every day, in a soak
NOISE = 60  # references that come and go by themselves; a leak is one or more for each of many items a repaint


def test_repaints_keep_the_references_to_none(qtbot: QtBot, open_with: OpenWith, recorded: Path, count: Count) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    views = (window.views.plan.drawing, window.views.trace.canvas, window.views.ranges)

    def repaint(times: int) -> None:
        for k in range(times):
            window.session.showing.choose(k % ORDER.readings)
            for view in views:
                view.viewport().repaint()

    repaint(ORDER.readings)
    gc.collect()
    before = sys.getrefcount(None)
    repaint(count(*REPAINTS))
    gc.collect()
    assert abs(sys.getrefcount(None) - before) < NOISE
