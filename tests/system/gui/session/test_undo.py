"""Edits of the scene can be undone and redone by key, one gesture at a time; the prediction follows."""

from dataclasses import replace

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.scene import History, Scene
from sonarhw_gui.window.window import MainWindow

from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import predicted, until

CONTROL, SHIFT = Qt.KeyboardModifier.ControlModifier, Qt.KeyboardModifier.ShiftModifier


def moved(scene: Scene, by: float) -> Scene:
    x, y = scene.place.position
    return replace(scene, place=replace(scene.place, position=(x - by, y)))


def drag(window: MainWindow, scene: Scene, gesture: object) -> None:
    for k in range(1, 5):
        window.session.showing.edit(moved(scene, 0.02 * k), "moving the sensor", gesture)


def test_a_gesture_is_undone_and_redone_as_one_step(qtbot: QtBot, open_with: OpenWith, scene: Scene) -> None:
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


def test_the_views_are_updated_once_per_tick_during_a_drag(open_with: OpenWith, scene: Scene) -> None:
    window = open_with()
    window.session._timer.stop()
    updates = []
    window.session.showing.changed.connect(updates.append)
    drag(window, scene, object())
    assert updates == []
    window.session.tick()
    assert [shown.scene for shown in updates] == [window.session.shown.scene]


def test_an_edit_after_an_undo_removes_the_redo_steps(scene: Scene) -> None:
    history = History()
    history.remember(scene, "one thing")
    other = moved(scene, 0.1)
    assert history.undo(other) is scene
    history.remember(scene, "another thing")
    assert (history.undo_label, history.redo_label) == ("another thing", "")


def test_the_history_keeps_only_the_last_steps(scene: Scene) -> None:
    history = History()
    for k in range(1000):
        history.remember(scene, f"step {k}")
    undone = 0
    while history.undo(scene) is not None:
        undone += 1
    assert 100 <= undone < 1000
