"""Editing in the plan with mouse and keys: dragged parts follow the mouse, and the prediction follows the edit."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QPointF, Qt
from pytestqt.qtbot import QtBot
from sonarhw_gui.model.look import DARK, LIGHT, Look, Palette
from sonarhw_gui.window.window import MainWindow

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import begin_drag, click, drag, pixel_at, predicted, until

Point = tuple[float, float]
_STROKES = 40
FIGURE9 = 0.774, 0.085  # where the sensor stands


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith) -> MainWindow:
    window = open_with()
    until(qtbot, lambda: predicted(window))
    return window


def key(qtbot: QtBot, window: MainWindow, key: Qt.Key, *modifiers: Qt.KeyboardModifier) -> None:
    pressed = Qt.KeyboardModifier.NoModifier
    for modifier in modifiers:
        pressed |= modifier
    qtbot.keyClick(window, key, pressed)


def drag_in_plan(qtbot: QtBot, window: MainWindow, *way: Point) -> None:
    drag(qtbot, window.views.plan.drawing, window.views.plan.drawing.plot.vb, *way)


def click_in_plan(qtbot: QtBot, window: MainWindow, at: Point) -> None:
    click(qtbot, window.views.plan.drawing, window.views.plan.drawing.plot.vb, at)


def hover(qtbot: QtBot, window: MainWindow, at: Point) -> str:
    pixel = pixel_at(window.views.plan.drawing, window.views.plan.drawing.plot.vb, at)
    for k in range(_STROKES):  # until what is under the mouse is drawn
        qtbot.mouseMove(window.views.plan.drawing.viewport(), pixel + QPoint(k % 2, 0))
        qtbot.wait(15)
        if k and window.views.plan.message.text():
            break
    return window.views.plan.message.text()


def wall(window: MainWindow, name: str) -> list[float]:
    room = window.session.shown.scene.room
    return room.walls[room.names.index(name)].tolist()


def sensor_position(window: MainWindow) -> Point:
    return window.session.shown.scene.pose.position


def test_dragging_the_sensor_changes_the_prediction_and_one_undo_reverts_both(qtbot: QtBot, window: MainWindow) -> None:
    before, outline = sensor_position(window), window.session.shown.outline
    drag_in_plan(qtbot, window, before, (0.5, 0.2), (0.4, 0.3))
    assert sensor_position(window) == pytest.approx((0.4, 0.3), abs=0.003)
    until(qtbot, lambda: predicted(window))
    moved = window.session.shown.outline
    assert moved.place.position == sensor_position(window)
    known = ~np.isnan(moved.ranges)
    assert np.nanmedian(np.abs(moved.ranges[known] - outline.ranges[known])) > 0.01
    key(qtbot, window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert sensor_position(window) == before
    assert window.session.shown.scene.pose.name == "figure9"
    assert not window.session.showing.history.undo_label


def test_dragging_the_beam_turns_the_sensor_and_all_readings(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    shown = window.session.shown
    x, y = sensor_position(window)
    end = window.views.plan.drawing.sensor.handle_at
    away = math.dist((x, y), end)
    angle = math.atan2(end[1] - y, end[0] - x) + math.radians(30)
    drag_in_plan(qtbot, window, end, (x + away * math.cos(angle), y + away * math.sin(angle)))
    turned = window.session.shown
    assert math.degrees(turned.heading(3) - shown.heading(3)) % 360 == pytest.approx(30, abs=1)
    assert sensor_position(window) == (x, y)


def test_a_drag_that_reaches_a_busy_window_all_at_once_moves_the_sensor(qtbot: QtBot, window: MainWindow) -> None:
    view = window.views.plan.drawing
    start, end = (pixel_at(view, view.plot.vb, at) for at in (sensor_position(window), (0.5, 0.2)))
    for pixel in (start - QPoint(30, 0), start):  # moves without a pause, as after a stall
        qtbot.mouseMove(view.viewport(), pixel)
    qtbot.mousePress(view.viewport(), Qt.MouseButton.LeftButton, pos=start)
    qtbot.mouseMove(view.viewport(), end)  # Qt has merged all moves of the drag
    qtbot.mouseRelease(view.viewport(), Qt.MouseButton.LeftButton, pos=end)
    assert sensor_position(window) == pytest.approx((0.5, 0.2), abs=0.003)


DRAGS = [
    (Qt.Key.Key_H, [FIGURE9, (0.5, 0.2), (0.4, 0.3)]),
    (Qt.Key.Key_E, [(0.0, 0.742), (0.1, 0.6)]),  # a corner
    (Qt.Key.Key_E, [(0.3, 0.742), (0.3, 0.6)]),  # a wall
    (Qt.Key.Key_W, [(0.3, 0.6), (0.3, 0.3)]),
    (Qt.Key.Key_P, [(0.3, 0.4), (0.36, 0.4)]),
    (Qt.Key.Key_M, [(0.3, 0.4), (0.36, 0.4)]),
]


def test_esc_cancels_a_drag_without_an_undo_step(qtbot: QtBot, window: MainWindow) -> None:
    drag_in_plan(qtbot, window, sensor_position(window), (0.6, 0.3))
    window.session.showing.undo()  # leaves a step for Redo
    for tool, way in DRAGS:
        assert_esc_cancels_drag(qtbot, window, tool, way)


def assert_esc_cancels_drag(qtbot: QtBot, window: MainWindow, tool: Qt.Key, way: list[Point]) -> None:
    """Drag with a tool, cancel with Esc, and assert that nothing has changed."""
    key(qtbot, window, tool)
    before, seen = window.session.shown.scene, window.views.plan.drawing.plot.vb.viewRange()
    box = window.views.plan.drawing.plot.vb
    begin_drag(qtbot, window.views.plan.drawing, box, *way)
    assert (window.session.shown.scene is before) == (tool == Qt.Key.Key_M)
    qtbot.keyClick(window.views.plan.drawing, Qt.Key.Key_Escape)
    assert window.session.shown.scene is before
    end = pixel_at(window.views.plan.drawing, box, (0.2, 0.2))
    qtbot.mouseMove(window.views.plan.drawing.viewport(), end)
    qtbot.mouseRelease(window.views.plan.drawing.viewport(), Qt.MouseButton.LeftButton, pos=end)
    assert window.session.shown.scene is before
    assert box.viewRange() == seen
    assert not window.session.showing.history.undo_label
    assert window.session.showing.history.redo_label == "moving the sensor"
    assert not window.views.plan.drawing.ruler.label.isVisible()


def test_keys_move_and_turn_the_sensor(qtbot: QtBot, window: MainWindow) -> None:
    now = 0.0
    window.views.plan.drawing.controller.clock = lambda: now
    x, y = sensor_position(window)
    shift = Qt.KeyboardModifier.ShiftModifier
    for pressed in (Qt.Key.Key_Left, Qt.Key.Key_Left, Qt.Key.Key_Up):
        key(qtbot, window, pressed, shift)
    assert sensor_position(window) == pytest.approx((x - 0.02, y + 0.01))
    now = 5.0
    key(qtbot, window, Qt.Key.Key_PageUp, shift)
    assert math.degrees(window.session.shown.scene.pose.heading) == pytest.approx(1)
    until(qtbot, window.commands.undo.isEnabled)
    key(qtbot, window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert window.session.shown.scene.pose.heading == 0.0
    assert sensor_position(window) == pytest.approx((x - 0.02, y + 0.01))
    key(qtbot, window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert sensor_position(window) == (x, y)  # quick key presses are one undo step


def test_a_sensor_cannot_be_dragged_into_a_post(qtbot: QtBot, window: MainWindow) -> None:
    key(qtbot, window, Qt.Key.Key_P)
    drag_in_plan(qtbot, window, (0.3, 0.4), (0.4, 0.4))
    key(qtbot, window, Qt.Key.Key_H)
    drag_in_plan(qtbot, window, sensor_position(window), (0.5, 0.3), (0.3, 0.4))
    assert "cannot be inside post 1" in window.views.plan.message.text()
    assert math.dist(sensor_position(window), (0.3, 0.4)) > 0.1
    assert window.banner.message == ""


def test_a_sensor_outside_the_walls_is_accepted_and_reported(qtbot: QtBot, window: MainWindow) -> None:
    drag_in_plan(qtbot, window, sensor_position(window), (0.85, 0.3), (0.98, 0.3))
    assert sensor_position(window) == pytest.approx((0.98, 0.3), abs=0.003)
    assert "outside the walls" in window.views.plan.message.text()
    assert "outside the walls" in hover(qtbot, window, sensor_position(window))
    until(qtbot, lambda: predicted(window))
    assert window.session.shown.outline.place.position == sensor_position(window)


def test_a_sensor_dragged_off_the_screen_stays_at_the_edge(qtbot: QtBot, window: MainWindow) -> None:
    (left, _), _ = window.views.plan.drawing.plot.vb.viewRange()
    drag_in_plan(qtbot, window, sensor_position(window), (left - 5.0, 0.3))
    assert sensor_position(window)[0] == pytest.approx(left, abs=0.01)
    assert window.views.plan.drawing.plot.vb.viewRange()[0][0] == pytest.approx(left)


def test_fit_view_includes_a_sensor_outside_the_room(qtbot: QtBot, window: MainWindow) -> None:
    drag_in_plan(qtbot, window, sensor_position(window), (0.98, 0.3))
    for _ in range(40):
        key(qtbot, window, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    assert sensor_position(window)[0] == pytest.approx(1.38, abs=0.01)
    key(qtbot, window, Qt.Key.Key_F)
    ((left, right), _) = window.views.plan.drawing.plot.vb.viewRange()
    assert left < 0 < sensor_position(window)[0] < right


def test_hovering_names_wall_and_material_and_links_the_cursor_of_all_views(qtbot: QtBot, window: MainWindow) -> None:
    assert hover(qtbot, window, (0.5, 0.742)) == "top · shelving, reflectance 0.95 (−0.4 dB)"
    hover(qtbot, window, (0.3, 0.3))
    cursor, (x, y) = window.session.shown.cursor, sensor_position(window)
    assert cursor.range == pytest.approx(math.dist((x, y), (0.3, 0.3)), abs=0.005)
    assert cursor.heading == pytest.approx(math.atan2(0.3 - y, 0.3 - x), abs=0.02)


def test_the_ruler_shows_distance_and_angle_from_corner_to_corner(qtbot: QtBot, window: MainWindow) -> None:
    key(qtbot, window, Qt.Key.Key_M)
    drag_in_plan(qtbot, window, (0.004, 0.003), (0.925, 0.739))
    assert window.views.plan.message.text() == "1.188 m at 38.6°"  # √(0.928² + 0.742²)
    assert window.views.plan.drawing.ruler.label.toPlainText() == "1.188 m at 38.6°"
    assert wall(window, "top") == [0.928, 0.742, 0.0, 0.742]
    key(qtbot, window, Qt.Key.Key_H)
    assert not window.views.plan.drawing.ruler.label.isVisible()


def test_dragging_a_corner_moves_both_walls_and_updates_the_prediction(qtbot: QtBot, window: MainWindow) -> None:
    outline = window.session.shown.outline
    view = window.views.plan.drawing.plot.vb.viewRange()
    key(qtbot, window, Qt.Key.Key_E)
    drag_in_plan(qtbot, window, (0.0, 0.742), (0.1, 0.6))
    assert wall(window, "top") == pytest.approx([0.928, 0.742, 0.1, 0.6], abs=0.003)
    assert wall(window, "left")[:2] == wall(window, "top")[2:]
    assert window.views.plan.drawing.plot.vb.viewRange() == view  # the plan does not move on the screen
    until(qtbot, lambda: predicted(window) and window.session.shown.outline is not outline)
    assert window.session.shown.outline.room is window.session.shown.scene.room
    assert window.session.showing.history.undo_label == "moving a corner"


def test_a_wall_is_added_from_corner_to_corner_and_removed(qtbot: QtBot, window: MainWindow) -> None:
    key(qtbot, window, Qt.Key.Key_W)
    drag_in_plan(qtbot, window, (0.003, 0.739), (0.3, 0.3), (0.3, 0.2))
    assert wall(window, "wall 1") == pytest.approx([0.0, 0.742, 0.3, 0.2], abs=0.003)
    assert wall(window, "wall 1")[:2] == [0.0, 0.742]  # exactly: the end has snapped
    key(qtbot, window, Qt.Key.Key_Delete)  # the new wall is chosen
    assert "wall 1" not in window.session.shown.scene.room.names
    until(qtbot, window.commands.undo.isEnabled)
    key(qtbot, window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    key(qtbot, window, Qt.Key.Key_E)
    click_in_plan(qtbot, window, (0.15, 0.471))
    key(qtbot, window, Qt.Key.Key_Delete)
    assert window.session.shown.scene.room.names == ("bottom", "right", "top", "left")
    key(qtbot, window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    assert "wall 1" in window.session.shown.scene.room.names


def test_a_post_is_added_moved_and_resized(qtbot: QtBot, window: MainWindow) -> None:
    key(qtbot, window, Qt.Key.Key_P)
    drag_in_plan(qtbot, window, (0.3, 0.4), (0.36, 0.4))
    key(qtbot, window, Qt.Key.Key_E)
    drag_in_plan(qtbot, window, (0.3, 0.4), (0.4, 0.5))
    drag_in_plan(qtbot, window, (0.46, 0.5), (0.5, 0.5))
    ((x, y, radius),) = window.session.shown.scene.room.posts
    assert (x, y, radius) == pytest.approx((0.4, 0.5, 0.1), abs=0.005)


def test_keys_move_the_chosen_wall_zoom_and_pan(qtbot: QtBot, window: MainWindow) -> None:
    key(qtbot, window, Qt.Key.Key_E)
    click_in_plan(qtbot, window, (0.5, 0.742))
    for _ in range(3):
        key(qtbot, window, Qt.Key.Key_Up, Qt.KeyboardModifier.ShiftModifier)
    assert wall(window, "top") == pytest.approx([0.928, 0.772, 0.0, 0.772])
    ((left, right), _) = window.views.plan.drawing.plot.vb.viewRange()
    key(qtbot, window, Qt.Key.Key_Plus)
    ((closer_left, closer_right), _) = window.views.plan.drawing.plot.vb.viewRange()
    assert closer_right - closer_left == pytest.approx((right - left) / 1.25)
    key(qtbot, window, Qt.Key.Key_Minus)
    assert window.views.plan.drawing.plot.vb.viewRange()[0] == pytest.approx([left, right])
    key(qtbot, window, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier, Qt.KeyboardModifier.ControlModifier)
    tenth = (right - left) / 10
    assert window.views.plan.drawing.plot.vb.viewRange()[0] == pytest.approx([left + tenth, right + tenth])


def test_a_double_click_on_a_wall_adds_a_corner(qtbot: QtBot, window: MainWindow) -> None:
    key(qtbot, window, Qt.Key.Key_E)
    pixel = pixel_at(window.views.plan.drawing, window.views.plan.drawing.plot.vb, (0.5, 0.742))
    qtbot.mouseClick(window.views.plan.drawing.viewport(), Qt.MouseButton.LeftButton, pos=pixel)
    qtbot.mouseDClick(window.views.plan.drawing.viewport(), Qt.MouseButton.LeftButton, pos=pixel)
    qtbot.mouseRelease(window.views.plan.drawing.viewport(), Qt.MouseButton.LeftButton, pos=pixel)
    assert {"top", "top 2"} < set(window.session.shown.scene.room.names)
    assert wall(window, "top")[2] == pytest.approx(0.5, abs=0.003)


def test_a_drag_of_nothing_pans(qtbot: QtBot, window: MainWindow) -> None:
    (left, _), _ = window.views.plan.drawing.plot.vb.viewRange()
    drag_in_plan(qtbot, window, (0.3, 0.3), (0.5, 0.3))
    assert window.views.plan.drawing.plot.vb.viewRange()[0][0] == pytest.approx(left - 0.2, abs=0.01)
    key(qtbot, window, Qt.Key.Key_F)
    assert window.views.plan.drawing.plot.vb.viewRange()[0][0] == pytest.approx(left)


def test_each_bounce_is_numbered_and_listed_with_its_loss(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    window.session.showing.choose(27)  # bottom, top, bottom
    texts = [label.toPlainText() for label in window.views.plan.drawing.path._labels if label.isVisible()]
    assert texts == ["1, 3", "2"]
    assert window.bounces.text() == "1 bottom −0.4 dB · 2 top −0.4 dB · 3 bottom −0.4 dB"


def test_without_a_room_an_edit_is_rejected_with_a_message(qtbot: QtBot, open_with: OpenWith, scene: object) -> None:
    window = open_with(scene=replace(scene, room=None, place=None))
    key(qtbot, window, Qt.Key.Key_W)
    drag_in_plan(qtbot, window, (0.1, 0.1), (0.5, 0.5))
    assert "open a room file" in window.views.plan.message.text()
    key(qtbot, window, Qt.Key.Key_Left, Qt.KeyboardModifier.ShiftModifier)
    assert window.session.shown.scene.room is None


def test_the_beam_has_the_heading_of_the_chosen_reading(qtbot: QtBot, open_with: OpenWith, recorded: Path) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    for chosen in (27, 5):
        window.session.showing.choose(chosen)
        (x, y), end = sensor_position(window), window.views.plan.drawing.sensor.handle_at
        apart = math.atan2(end[1] - y, end[0] - x) - window.session.shown.heading(chosen)
        assert math.remainder(apart, 2 * math.pi) == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("palette", [LIGHT, DARK])
def test_the_handle_of_the_beam_is_filled_unlike_the_ring_of_the_selected_reading(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, palette: Palette
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    window.session.showing.set_look(Look(palette=palette))
    window.session.showing.choose(18)  # no reading is near the handle
    view = window.views.plan.drawing
    qtbot.wait(50)
    at, drawn = pixel_at(view, view.plot.vb, view.sensor.handle_at), view.grab().toImage()
    around = [drawn.pixelColor(at + QPoint(x, y)).name() for x in (-2, 0, 2) for y in (-2, 0, 2)]
    assert around == [palette.ink.lower()] * 9


def test_labels_of_bounces_cover_neither_each_other_nor_the_sensor(
    qtbot: QtBot, open_with: OpenWith, recorded: Path
) -> None:
    window = open_with(source=read_log(recorded))
    until(qtbot, lambda: predicted(window))
    box = window.views.plan.drawing.plot.vb
    sensor = box.mapViewToScene(QPointF(*sensor_position(window)))
    most = 0
    for chosen in range(len(window.session.shown.readings)):
        window.session.showing.choose(chosen)
        labels = [label for label in window.views.plan.drawing.path._labels if label.isVisible()]
        boxes = [label.mapRectToScene(label.boundingRect()).adjusted(1, 1, -1, -1) for label in labels]
        most = max(most, len(boxes))
        assert not any(one.contains(sensor) for one in boxes)
        assert not any(one.intersects(other) for k, one in enumerate(boxes) for other in boxes[:k])
    assert most > 1
