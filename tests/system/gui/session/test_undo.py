"""What is done to the scene can be undone: one gesture at once, by key, and the prediction follows."""

from dataclasses import replace

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.scene.history import History
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shell.main_window import MainWindow

from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

CONTROL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


def moved(scene: Scene, by: float) -> Scene:
    x, y = scene.place.position
    return replace(scene, place=replace(scene.place, position=(x - by, y)))


def drag(window: MainWindow, scene: Scene, gesture: object) -> None:
    for k in range(1, 5):
        window.session.showing.edit(moved(scene, 0.02 * k), "moving the sensor", gesture)


def test_a_gesture_is_undone_at_once_and_done_again(qtbot: QtBot, open_with: OpenWith, scene: Scene) -> None:
    window = open_with()
    drag(window, scene, object())
    there = window.session.shown.scene
    assert there.place.position == moved(scene, 0.08).place.position
    until(qtbot, lambda: predicted(window))
    assert window.commands.undo.text() == "Undo moving the sensor"
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL)
    assert window.session.shown.scene is scene
    until(qtbot, lambda: predicted(window))
    assert window.session.shown.outline.place.position == scene.place.position
    assert not window.commands.undo.isEnabled()
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL | SHIFT)
    assert window.session.shown.scene is there
    assert not window.commands.redo.isEnabled()


def test_two_gestures_are_two_steps(open_with: OpenWith, scene: Scene) -> None:
    window = open_with()
    drag(window, scene, object())
    between = window.session.shown.scene
    drag(window, between, object())
    window.session.showing.undo()
    assert window.session.shown.scene is between
    window.session.showing.undo()
    assert window.session.shown.scene is scene


def test_whatever_moves_the_views_are_told_once_a_tick(open_with: OpenWith, scene: Scene) -> None:
    window = open_with()
    window.session._timer.stop()
    told = []
    window.session.showing.changed.connect(told.append)
    drag(window, scene, object())
    assert told == []
    window.session.tick()
    assert [shown.scene for shown in told] == [window.session.shown.scene]


def test_what_is_done_after_an_undo_ends_what_could_be_done_again(scene: Scene) -> None:
    history = History()
    history.remember(scene, "one thing")
    other = moved(scene, 0.1)
    assert history.undo(other) is scene
    history.remember(scene, "another thing")
    assert (history.undo_label, history.redo_label) == ("another thing", "")


def test_a_long_session_keeps_its_last_steps_only(scene: Scene) -> None:
    history = History()
    for k in range(1000):
        history.remember(scene, f"step {k}")
    undone = 0
    while history.undo(scene) is not None:
        undone += 1
    assert 100 <= undone < 1000
