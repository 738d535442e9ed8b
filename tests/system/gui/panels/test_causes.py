"""The dock "Causes" with mouse and keys: a plate that the room lacks is found, shown, tried and undone."""

import os
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, Qt
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import Kind
from sonarhw_gui.model.rows import CLASSES
from sonarhw_gui.model.scene import scene_with
from sonarhw_gui.panels.searches import CausesPanel
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.log import read_log
from tests.fixtures.rooms_for_tests import write_yard
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_yard(tmp_path_factory.mktemp("yard")).parent


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, folder: Path) -> MainWindow:
    room = load_room(folder / "yard.toml")
    scene = scene_with(load_board("polaroid-6500"), room, room.place(None), "yard.toml")
    window = open_with(scene=scene, source=read_log(folder / "scan.mcap"))
    until(qtbot, lambda: predicted(window))
    qtbot.keyClick(window, Qt.Key.Key_F11)
    until(qtbot, window.causes.isVisible)
    return window


def click_row(qtbot: QtBot, window: MainWindow, row: int) -> None:
    cause = window.causes.list.visualItemRect(window.causes.list.item(row))
    qtbot.mouseClick(window.causes.list.viewport(), LEFT, pos=cause.center() + QPoint(0, 1))


def gained_share(panel: CausesPanel) -> float:
    """Return how many more percent of the echoes are within 5 cm now, as the panel says."""
    before, now = (float(part.split("%")[0].split()[-1]) for part in panel.shares.text().split(","))
    return now - before


def test_a_cause_is_shown_tried_and_undone(qtbot: QtBot, window: MainWindow) -> None:
    panel, session, plan = window.causes, window.session, window.views.plan.drawing
    before = session.shown.scene
    qtbot.mouseClick(panel.begin, LEFT)
    assert panel.progress.isVisible()
    until(qtbot, lambda: session.causes.state.answer is not None)
    assert "a wall" in panel.list.item(0).text()
    assert not panel.try_it.isEnabled()

    click_row(qtbot, window, 0)
    until(qtbot, lambda: session.shown.proposal is not None and len(plan.proposal.rings.getData()[0]) > 0)
    cause = session.causes.state.answer.result.causes[0]
    rows = session.shown.rows
    misfits = [row for row in cause.readings if CLASSES[rows.classes[row]] is not Kind.MATCH]
    assert session.shown.chosen == misfits[0]
    assert len(plan.proposal.rings.getData()[0]) == len(cause.readings)
    x, _ = plan.proposal.surfaces.getData()
    assert x[0] == pytest.approx(0.8, abs=0.02)  # of the plate
    keep_picture(window, "causes")

    qtbot.mouseClick(panel.try_it, LEFT)
    assert session.shown.scene.room.names[-1] == "wall 1"
    assert window.commands.undo.text() == "Undo trying a cause"
    until(qtbot, lambda: predicted(window) and gained_share(panel) > 10)
    assert not panel.try_it.isEnabled()
    assert panel.list.item(0).text().endswith("tried")
    keep_picture(window, "causes_tried")

    qtbot.mouseClick(panel.undo, LEFT)
    assert session.shown.scene is before
    until(qtbot, panel.try_it.isEnabled)

    # with keys: the list, then Return
    panel.list.setFocus()
    qtbot.keyClick(panel.list, Qt.Key.Key_Return)
    until(qtbot, lambda: session.shown.scene is not before)
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: session.shown.scene is before)


def test_a_search_is_cancelled(qtbot: QtBot, window: MainWindow) -> None:
    panel = window.causes
    qtbot.mouseClick(panel.begin, LEFT)
    qtbot.mouseClick(panel.cancel, LEFT)
    assert panel.begin.isEnabled()
    assert window.session.causes.state.answer is None
    assert not panel.list.isVisible()


def keep_picture(window: MainWindow, name: str) -> None:
    """Save a picture of the window, if the folder of pictures is given."""
    if folder := os.environ.get("SONARHW_SCREENSHOTS"):
        window.grab().save(str(Path(folder) / f"{name}.png"))
