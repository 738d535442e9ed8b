"""The plan with mouse and keys: edits follow the mouse, paths and arrows explain readings, sound is played."""

import gc
import itertools
import math
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PySide6.QtCore import QCoreApplication, QEvent, QPoint, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QImage, QPalette, QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QToolButton
from shiboken6 import Shiboken
from sonarhw_gui.jobs import forecast
from sonarhw_gui.jobs.forecast import PathsFound
from sonarhw_gui.model.edits import sensor_at
from sonarhw_gui.model.look import DARK, LIGHT, Look
from sonarhw_gui.model.scene import Scene, decibels_text, wall_lines
from sonarhw_gui.model.shown import Shown, bounces_text, chosen_path
from sonarhw_gui.views.base import png_pixels, svg_text
from sonarhw_gui.views.legend import SOUND, Legend
from sonarhw_gui.views.plan import PlanDrawing
from sonarhw_gui.views.plan_layers import edge_arrows
from sonarhw_gui.window.bars import Sentence
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.errors import heading_text
from sonarhw.log import read_log
from tests.system.gui import driving as ui
from tests.system.gui.conftest import OpenWith

Point = tuple[float, float]
FIGURE9 = 0.774, 0.085  # where the sensor stands


class Plan:
    """The plan of a window that the tests share, and what a user does in it."""

    def __init__(self, window: MainWindow) -> None:
        self.window, self.session, self.view = window, window.session, window.views.plan.drawing
        self.showing, self.box = window.session.showing, self.view.plot.vb

    @property
    def shown(self) -> Shown:
        return self.session.shown

    @property
    def sensor(self) -> Point:
        return self.shown.scene.pose.position

    @property
    def message(self) -> str:
        return self.window.views.plan.message.text()

    @property
    def left(self) -> float:
        return self.box.viewRange()[0][0]

    def key(self, *names: str) -> None:
        ui.key(self.window, *names)

    def drag(self, *way: Point) -> None:
        ui.drag(self.view, self.box, *way)

    def click(self, at: Point) -> None:
        ui.click(self.view, self.box, at)

    def hover(self, at: Point) -> str:
        pixel = ui.pixel_at(self.view, self.box, at)
        for k in range(40):  # until what is under the mouse is drawn
            QTest.mouseMove(self.view.viewport(), pixel + QPoint(k % 2, 0))
            ui.pause(15)
            if k and self.message:
                break
        return self.message

    def wall(self, name: str) -> list[float]:
        room = self.shown.scene.room
        return room.walls[room.names.index(name)].tolist()

    def labels(self) -> list[object]:
        """Return the visible labels of bounces."""
        return [label for label in self.view.path.labels if label.isVisible()]

    def outside(self) -> set[int]:
        """Return the readings that are drawn outside the visible part."""
        return {k for k, at in ui.drawn(self.view.marks).items() if not self.box.viewRect().contains(*at)}


@pytest.fixture(scope="module")
def shared(open_shared: OpenWith) -> MainWindow:
    return open_shared()


@pytest.fixture
def plan(shared: MainWindow, scene: Scene) -> Iterator[Plan]:
    """The plan of the simple room without readings, as after the room was opened."""
    session = shared.session
    session.leave_replay()
    session.notices.clear()
    session.showing.set_look(Look())
    session.showing.follow_newest()
    session.set_scene(scene)
    shared.resize(1280, 800)
    ui.key(shared, "1", "H", "Home")
    ui.until(lambda: ui.predicted(shared) and session.shown.asked is None)
    shared.views.plan.fit()
    yield Plan(shared)
    session.sound.close()


@pytest.fixture
def measured(plan: Plan, recorded: Path) -> Plan:
    """The plan with the readings of a log."""
    plan.session.show_log(read_log(recorded))
    ui.until(lambda: ui.predicted(plan.window) and len(ui.drawn(plan.view.marks)) > 30)
    return plan


# the sensor


def test_dragging_the_sensor_changes_the_prediction_and_one_undo_reverts_both(plan: Plan) -> None:
    outline = plan.shown.outline
    plan.drag(FIGURE9, (0.5, 0.2), (0.4, 0.3))
    assert plan.sensor == pytest.approx((0.4, 0.3), abs=0.003)
    ui.until(lambda: ui.predicted(plan.window))
    moved = plan.shown.outline
    assert moved.place.position == plan.sensor
    known = ~np.isnan(moved.ranges)
    assert np.nanmedian(np.abs(moved.ranges[known] - outline.ranges[known])) > 0.01
    plan.key("Ctrl+Z")
    assert (plan.sensor, plan.shown.scene.pose.name) == (FIGURE9, "figure9")
    assert not plan.showing.history.undo_label


def test_dragging_the_beam_turns_the_sensor_and_all_readings(measured: Plan) -> None:
    plan, before = measured, measured.shown
    for chosen in (27, 5):
        plan.showing.choose(chosen)
        (x, y), end = plan.sensor, plan.view.sensor.handle_at
        apart = math.atan2(end[1] - y, end[0] - x) - plan.shown.heading(chosen)
        assert math.remainder(apart, math.tau) == pytest.approx(0, abs=1e-9)
    away, angle = math.dist((x, y), end), math.atan2(end[1] - y, end[0] - x) + math.radians(30)
    plan.drag(end, (x + away * math.cos(angle), y + away * math.sin(angle)))
    assert math.degrees(plan.shown.heading(3) - before.heading(3)) % 360 == pytest.approx(30, abs=1)
    assert plan.sensor == (x, y)
    plan.key("Ctrl+Z")
    plan.showing.choose(18)  # no reading is near the handle, which is filled unlike the ring of a selected one
    for palette in (DARK, LIGHT):
        plan.showing.set_look(Look(palette=palette))
        ui.pause(50)
        at, image = ui.pixel_at(plan.view, plan.box, plan.view.sensor.handle_at), plan.view.grab().toImage()
        around = {image.pixelColor(at + QPoint(x, y)).name() for x in (-2, 0, 2) for y in (-2, 0, 2)}
        assert around == {palette.ink.lower()}


def test_the_sensor_follows_a_drag_that_arrives_at_once_to_the_edge_of_the_plan_and_out_of_the_room(plan: Plan) -> None:
    start, end = (ui.pixel_at(plan.view, plan.box, at) for at in (plan.sensor, (0.5, 0.2)))
    viewport = plan.view.viewport()
    for pixel in (start - QPoint(30, 0), start):  # moves without a pause, as after a stall
        QTest.mouseMove(viewport, pixel)
    QTest.mousePress(viewport, ui.LEFT, pos=start)
    QTest.mouseMove(viewport, end)  # Qt has merged all moves of the drag
    QTest.mouseRelease(viewport, ui.LEFT, pos=end)
    assert plan.sensor == pytest.approx((0.5, 0.2), abs=0.003)
    left = plan.left
    plan.drag(plan.sensor, (left - 5.0, 0.3))
    assert plan.sensor[0] == pytest.approx(left, abs=0.01)
    assert plan.left == pytest.approx(left)
    plan.drag(plan.sensor, (0.85, 0.3), (0.98, 0.3))
    assert plan.sensor == pytest.approx((0.98, 0.3), abs=0.003)
    assert "outside the walls" in plan.message
    assert "outside the walls" in plan.hover(plan.sensor)
    ui.until(lambda: ui.predicted(plan.window))
    assert plan.shown.outline.place.position == plan.sensor
    plan.key(*["Shift+Right"] * 40)
    assert plan.sensor[0] == pytest.approx(1.38, abs=0.01)
    plan.key("F")  # includes a sensor outside the room
    ((left, right), _) = plan.box.viewRange()
    assert left < 0 < plan.sensor[0] < right


def test_esc_cancels_a_drag_with_any_tool_without_an_undo_step(plan: Plan) -> None:
    plan.drag(plan.sensor, (0.6, 0.3))
    plan.showing.undo()  # leaves a step for Redo
    history = plan.showing.history
    for tool, way in (
        ("H", [FIGURE9, (0.5, 0.2), (0.4, 0.3)]),
        ("E", [(0.0, 0.742), (0.1, 0.6)]),  # a corner
        ("E", [(0.3, 0.742), (0.3, 0.6)]),  # a wall
        ("W", [(0.3, 0.6), (0.3, 0.3)]),
        ("P", [(0.3, 0.4), (0.36, 0.4)]),
        ("M", [(0.3, 0.4), (0.36, 0.4)]),
    ):
        plan.key(tool)
        before, seen = plan.shown.scene, plan.box.viewRange()
        ui.begin_drag(plan.view, plan.box, *way)
        assert (plan.shown.scene is before) == (tool == "M")
        ui.key(plan.view, "Esc")
        assert plan.shown.scene is before
        end = ui.pixel_at(plan.view, plan.box, (0.2, 0.2))
        QTest.mouseMove(plan.view.viewport(), end)
        QTest.mouseRelease(plan.view.viewport(), ui.LEFT, pos=end)
        assert (plan.shown.scene is before, plan.box.viewRange()) == (True, seen)
        assert (history.undo_label, history.redo_label) == ("", "moving the sensor")
        assert not plan.view.ruler.label.isVisible()


def test_keys_move_and_turn_the_sensor_and_quick_presses_are_one_step(plan: Plan) -> None:
    now, controller = 0.0, plan.view.controller
    own, controller.clock = controller.clock, lambda: now
    x, y = plan.sensor
    plan.key("Shift+Left", "Shift+Left", "Shift+Up")
    assert plan.sensor == pytest.approx((x - 0.02, y + 0.01))
    now = 5.0
    plan.key("Shift+PgUp")
    assert math.degrees(plan.shown.scene.pose.heading) == pytest.approx(1)
    assert plan.showing.history.steps == ("turning the sensor", "moving the sensor")
    plan.key("Ctrl+Z")
    assert plan.shown.scene.pose.heading == 0.0
    assert plan.sensor == pytest.approx((x - 0.02, y + 0.01))
    plan.key("Ctrl+Z")
    assert plan.sensor == (x, y)
    controller.clock = own


def is_faint(sentence: Sentence) -> bool:
    """Return whether the whole sentence is grey."""
    image = sentence.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
    darkest = min(image.pixelColor(x, y).red() for y in range(0, image.height(), 2) for x in range(0, image.width(), 2))
    return darkest > QColor(sentence.palette().color(QPalette.ColorRole.WindowText)).red() + 60


def test_old_values_are_grey(measured: Plan, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> None:
    window, table, activity = measured.window, measured.window.views.table.model, measured.window.status_bar.activity
    outdated, ink = "grey values belong to the previous prediction", Qt.ItemDataRole.ForegroundRole
    cell = table.index(0, table.columnCount() - 1)
    assert (table.data(cell, ink), is_faint(window.sentence)) == (None, False)
    gate, find_paths = threading.Event(), forecast.find_paths

    def find_late(*args: object) -> PathsFound:
        gate.wait()
        return find_paths(*args)

    monkeypatch.setattr(forecast, "find_paths", find_late)
    request.addfinalizer(gate.set)  # otherwise the window would not close
    before = measured.shown.compared
    measured.showing.edit(*sensor_at(measured.shown.scene, (0.4, 0.3)))
    ui.until(lambda: outdated in activity.text())
    assert measured.shown.compared is before
    assert table.data(cell, ink).color() == QColor(measured.shown.look.palette.faint)
    assert is_faint(window.sentence)
    gate.set()
    ui.until(lambda: ui.predicted(window) and outdated not in activity.text())
    assert (table.data(cell, ink), is_faint(window.sentence)) == (None, False)


# the room


def test_hovering_names_what_is_under_the_mouse_and_the_ruler_measures_from_corner_to_corner(plan: Plan) -> None:
    assert plan.hover((0.5, 0.742)) == "top · shelving, reflectance 0.95 (−0.4 dB)"
    plan.hover((0.3, 0.3))
    cursor, (x, y) = plan.shown.cursor, plan.sensor
    assert cursor.range == pytest.approx(math.dist((x, y), (0.3, 0.3)), abs=0.005)
    assert cursor.heading == pytest.approx(math.atan2(0.3 - y, 0.3 - x), abs=0.02)
    plan.key("M")
    plan.drag((0.004, 0.003), (0.925, 0.739))
    assert plan.shown.cursor is None  # it does not stay where the drag began
    assert plan.message == plan.view.ruler.label.toPlainText() == "1.188 m at 38.6°"  # √(0.928² + 0.742²)
    assert plan.wall("top") == [0.928, 0.742, 0.0, 0.742]
    plan.key("H")
    assert not plan.view.ruler.label.isVisible()


def test_corners_and_walls_are_dragged_added_removed_and_split(plan: Plan) -> None:
    outline, seen = plan.shown.outline, plan.box.viewRange()
    plan.key("E")
    plan.drag((0.0, 0.742), (0.1, 0.6))
    assert plan.wall("top") == pytest.approx([0.928, 0.742, 0.1, 0.6], abs=0.003)
    assert plan.wall("left")[:2] == plan.wall("top")[2:]
    assert plan.box.viewRange() == seen  # the plan does not move on the screen
    ui.until(lambda: ui.predicted(plan.window) and plan.shown.outline is not outline)
    assert plan.shown.outline.room is plan.shown.scene.room
    assert plan.showing.history.undo_label == "moving a corner"
    plan.key("Ctrl+Z", "W")
    plan.drag((0.003, 0.739), (0.3, 0.3), (0.3, 0.2))
    assert plan.wall("wall 1") == pytest.approx([0.0, 0.742, 0.3, 0.2], abs=0.003)
    assert plan.wall("wall 1")[:2] == [0.0, 0.742]  # exactly: the end has snapped
    for select in ((), ("E",)):  # the new wall is chosen; later it is clicked
        plan.key(*select)
        if select:
            plan.click((0.15, 0.471))
        plan.key("Del")
        assert plan.shown.scene.room.names == ("bottom", "right", "top", "left")
        plan.key("Ctrl+Z")
        assert "wall 1" in plan.shown.scene.room.names
    pixel = ui.pixel_at(plan.view, plan.box, (0.5, 0.742))
    ui.push(plan.view.viewport(), pixel)
    QTest.mouseDClick(plan.view.viewport(), ui.LEFT, pos=pixel)
    QTest.mouseRelease(plan.view.viewport(), ui.LEFT, pos=pixel)
    assert {"top", "top 2"} < set(plan.shown.scene.room.names)
    assert plan.wall("top")[2] == pytest.approx(0.5, abs=0.003)


def test_a_post_is_added_moved_and_resized_and_the_sensor_cannot_be_dragged_into_it(plan: Plan) -> None:
    plan.key("P")
    plan.drag((0.3, 0.4), (0.36, 0.4))
    plan.key("E")
    plan.drag((0.3, 0.4), (0.4, 0.5))
    plan.drag((0.46, 0.5), (0.5, 0.5))
    ((x, y, radius),) = plan.shown.scene.room.posts
    assert (x, y, radius) == pytest.approx((0.4, 0.5, 0.1), abs=0.005)
    plan.key("H")
    plan.drag(plan.sensor, (0.6, 0.3), (0.4, 0.5))
    assert "cannot be inside post 1" in plan.message
    assert math.dist(plan.sensor, (0.4, 0.5)) > 0.1
    assert plan.window.banner.message == ""


def test_keys_move_the_chosen_wall_zoom_and_pan(plan: Plan) -> None:
    plan.key("E")
    plan.click((0.5, 0.742))
    plan.key(*["Shift+Up"] * 3)
    assert plan.wall("top") == pytest.approx([0.928, 0.772, 0.0, 0.772])
    ((left, right), _) = plan.box.viewRange()
    plan.key("+")
    ((closer_left, closer_right), _) = plan.box.viewRange()
    assert closer_right - closer_left == pytest.approx((right - left) / 1.25)
    plan.key("-")
    assert plan.box.viewRange()[0] == pytest.approx([left, right])
    plan.key("Ctrl+Shift+Right")
    assert plan.left == pytest.approx(left + (right - left) / 10)
    plan.key("H", "F")
    left = plan.left
    plan.drag((0.3, 0.3), (0.5, 0.3))  # a drag of nothing pans
    assert plan.left == pytest.approx(left - 0.2, abs=0.01)


def test_clicks_draw_a_post_or_a_chain_of_walls_until_a_second_click_on_its_end_or_esc(plan: Plan) -> None:
    corners = [(0.3, 0.6), (0.3, 0.3), (0.5, 0.3)]

    def surfaces() -> tuple[int, int]:
        room = plan.shown.scene.room
        return len(room.walls), len(room.posts)

    def waiting() -> bool:
        return plan.view.controller.tool.waiting

    plan.key("P")
    plan.click(corners[0])
    ui.until(lambda: "click again" in plan.message)
    assert surfaces() == (4, 0)
    plan.click(corners[1])
    ui.until(lambda: surfaces() == (4, 1))
    plan.key("Ctrl+Z", "W")
    for count, at in enumerate(corners):
        plan.click(at)
        ui.until(lambda count=count: waiting() and surfaces() == (4 + count, 0))
    first, second = plan.shown.scene.room.walls[-2:]
    assert tuple(first[2:]) == tuple(second[:2])
    plan.click(corners[-1])
    ui.until(lambda: not waiting())
    assert surfaces() == (6, 0)
    for left in (5, 4):  # each wall is an undo step
        plan.key("Ctrl+Z")
        assert surfaces() == (left, 0)
    plan.click(corners[0])
    ui.until(lambda: waiting())
    ways = itertools.cycle([(0.4, 0.3), (0.42, 0.3)])  # a first motion may arrive before the click is handled

    def previewed() -> bool:
        QTest.mouseMove(plan.view.viewport(), ui.pixel_at(plan.view, plan.box, next(ways)))
        return surfaces() == (5, 0)

    ui.until(previewed)
    plan.view.setFocus()
    ui.key(plan.view, "Esc")
    ui.until(lambda: surfaces() == (4, 0))
    assert not waiting()
    assert not plan.showing.history.undo_label


def test_walls_and_posts_are_added_by_typed_coordinates_and_an_impossible_one_is_explained(plan: Plan) -> None:
    tools = plan.window.views.plan
    for shortcut, typed in (("Ctrl+Alt+W", ("0.2", "0.5", "0.6", "0.5")), ("Ctrl+Alt+P", ("0.3", "0.3", "0.05"))):
        plan.key(shortcut)
        dialog = tools.typed
        for field, text in zip(dialog.fields, typed, strict=True):
            field.selectAll()
            QTest.keyClicks(field, text)
        ui.key(dialog.fields[-1], "Return")
        ui.until(lambda dialog=dialog: not Shiboken.isValid(dialog) or not dialog.isVisible())
    room = plan.shown.scene.room
    assert room.walls[-1].tolist() == pytest.approx([0.2, 0.5, 0.6, 0.5])
    assert room.posts[-1].tolist() == pytest.approx([0.3, 0.3, 0.05])
    assert plan.showing.history.steps == ("adding a post", "adding a wall")
    plan.key("Ctrl+Alt+P")
    dialog = tools.typed
    assert dialog.fields[-1].value() == pytest.approx(0.05)
    ui.key(dialog.fields[-1], "Return")  # around the sensor, where the fields begin
    ui.until(lambda: "lies inside post" in dialog.problem.text())
    assert dialog.isVisible()
    dialog.close()
    plan.session.set_scene(plan.shown.scene)
    plan.view.controller.choose_surface(None)
    ui.push(next(button for button in tools.findChildren(QToolButton) if button.defaultAction() is tools.remove))
    assert "Edit (E) selects" in plan.message
    assert tools.message.fontMetrics().horizontalAdvance(plan.message) <= tools.message.width()


# paths and arrows


def test_each_bounce_has_a_number_that_covers_nothing_and_its_wall_and_loss_are_listed(measured: Plan) -> None:
    plan, losses, most = measured, [], 0
    sensor = plan.box.mapViewToScene(QPointF(*plan.sensor))
    for chosen in range(len(plan.shown.readings)):
        plan.showing.choose(chosen)
        path, labels = chosen_path(plan.shown), plan.labels()
        written = sorted(int(n) for label in labels for n in label.toPlainText().split(", "))
        assert written == list(range(1, 1 + (len(path.names) if path else 0)))
        boxes = [label.mapRectToScene(label.boundingRect()).adjusted(1, 1, -1, -1) for label in labels]
        most = max(most, len(boxes))
        assert not any(one.contains(sensor) for one in boxes)
        assert not any(one.intersects(other) for one, other in itertools.combinations(boxes, 2))
        losses += [] if path is None else [loss for loss in path.losses if loss is not None]
    assert most > 1
    assert losses
    assert {decibels_text(loss) for loss in losses} == {"−0.4 dB"}
    plan.showing.choose(27)
    assert [label.toPlainText() for label in plan.labels()] == ["1, 3", "2"]
    listed = "1 bottom −0.4 dB · 2 top −0.4 dB · 3 bottom −0.4 dB"
    ui.until(lambda: plan.window.bounces.text() == bounces_text(plan.shown) == listed)
    x, y = plan.view.path.rays.getData()
    assert len(x) == 5  # sensor, bottom, top, bottom, sensor
    assert (x[0], y[0]) == (x[-1], y[-1]) == plan.sensor
    before = {widget for widget in QApplication.allWidgets() if isinstance(widget, Legend)}
    picture = svg_text(plan.view, "title", plan.shown)
    png_pixels(plan.view, "title", plan.shown)
    assert all(word in picture for word in listed.split(" · ")[0].split())
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    gc.collect()
    assert {widget for widget in QApplication.allWidgets() if isinstance(widget, Legend)} <= before


def test_the_frame_holds_the_room_and_arrows_at_the_edge_point_to_the_readings_outside(measured: Plan) -> None:
    plan, arrows, frame = measured, measured.view.arrows, measured.box.viewRect()
    walls = wall_lines(plan.shown.scene.room)
    assert all(frame.contains(x, y) for x, y in walls)
    assert max(np.ptp(walls, axis=0) / (frame.width(), frame.height())) > 0.7
    assert sum(arrow.count for arrow in arrows.arrows) == len(plan.outside()) > 0
    (x, y), positions = plan.sensor, ui.drawn(plan.view.marks)
    for arrow in arrows.arrows:
        assert arrows.boundingRect().contains(*arrow.middle)
        assert arrow.distance == pytest.approx(math.dist((x, y), positions[arrow.reading]))
        assert f"{arrow.distance:.1f} m" in arrows.text(arrow)
    for chosen in sorted(plan.outside()):
        plan.showing.choose(chosen)
        assert plan.box.viewRect() == frame
        arrow = next(arrow for arrow in arrows.arrows if arrow.reading == chosen)
        at, heading = plan.box.mapToView(QPointF(*arrow.middle)), plan.shown.heading(chosen)
        off = math.atan2(at.y() - y, at.x() - x) - heading
        assert math.remainder(off, math.tau) == pytest.approx(0, abs=math.radians(1))
        assert arrows.text(arrow).startswith(heading_text(heading))

    # readings close together share an arrow, and the selected one comes first
    few = edge_arrows(plan.view.marks.placed, QRectF(-0.01, -0.01, 0.02, 0.02), (200.0, 200.0), (0.0, 0.0), chosen)
    assert sum(arrow.count for arrow in few) > len(few)
    assert few[0].reading == chosen
    assert all(math.dist(one.middle, other.middle) >= 50 for one, other in itertools.combinations(few, 2))

    plan.showing.choose(0)
    arrow = next(arrow for arrow in arrows.arrows if arrow.reading != 0)
    at = plan.view.mapFromScene(arrows.mapToScene(QPointF(*arrow.middle)))
    QTest.mouseMove(plan.view.viewport(), at)
    ui.push(plan.view.viewport(), at)
    ui.until(lambda: plan.shown.chosen == arrow.reading)
    plan.key("Shift+F")
    ui.until(lambda: not plan.outside() and not arrows.arrows)
    plan.key("Home")
    ui.until(lambda: bool(plan.outside()))
    assert plan.box.viewRect() == frame

    # texts cover neither the room nor each other
    plan.showing.choose(None)
    for size in ((1024, 552), (1280, 752)):
        plan.window.resize(*size)
        ui.pause(50)
        corners = (arrows.mapFromItem(plan.box.childGroup, QPointF(*end(walls, axis=0))) for end in (np.min, np.max))
        room, texts = QRectF(*corners).normalized(), arrows.text_areas()
        assert len(texts) > len(arrows.arrows) / 2
        assert [arrows.text(arrow) for arrow, area in texts if area.intersects(room)] == []
        areas = [area for _, area in texts]
        assert not any(one.intersects(other) for one, other in itertools.combinations(areas, 2))
        assert all(arrows.boundingRect().contains(*arrow.middle) for arrow in arrows.arrows)


# questions


def answered(plan: Plan, degrees: float) -> bool:
    answer = plan.shown.answer
    return answer is not None and math.degrees(answer.headings[0]) == pytest.approx(degrees, abs=1e-6)


def test_a_heading_without_a_reading_is_explained_by_mouse_and_keys(plan: Plan) -> None:
    window, before = plan.window, plan.shown.scene
    plan.key(*"----")  # the false wall, below the room, where heading 270° reads
    ui.pause(50)
    plan.click((0.774, 0.085 - 0.827))
    ui.until(lambda: plan.shown.answer is not None)
    assert math.degrees(plan.shown.asked) == pytest.approx(270, abs=1)
    assert window.sentence.text().startswith("0.827 m predicted at 2")
    explained = "three reflections, bottom, top, bottom; the near wall (0.085 m) lies within blanking"
    assert explained in window.sentence.text()
    assert (plan.shown.scene, plan.shown.trace.measured) == (before, None)  # the turntable stays
    assert plan.shown.trace.predicted is not None
    assert window.views.trace.title.text().endswith("predicted only")
    plan.key("Esc")
    ui.until(lambda: plan.shown.asked is None)
    assert plan.shown.answer is None
    for pressed, degrees in (("[", 1), ("[", 2), ("]", 1)):
        plan.key(pressed)
        ui.until(lambda degrees=degrees: answered(plan, degrees))
    plan.key("Home", "Q")  # the tool Ask turns the beam
    plan.drag((0.774, 0.5), (0.3, 0.085))
    ui.until(lambda: plan.shown.answer is not None and abs(plan.shown.asked - math.pi) < 0.02)
    ui.until(lambda: plan.view.sensor.handle_at[0] < FIGURE9[0])  # the beam points left
    plan.key("H")
    plan.drag(plan.view.sensor.handle_at, (0.774, 0.3))  # the beam of the question, not the turntable
    ui.until(lambda: abs(plan.shown.asked - math.pi / 2) < 0.05)
    assert plan.shown.scene is before
    plan.showing.ask(math.radians(90))
    ui.until(lambda: answered(plan, 90))
    plan.key("Shift+Up")  # the sensor, 1 cm nearer to the top
    scene = plan.shown.scene
    expected = predict_scan(scene.room, scene.pose, scene.board, np.radians([90.0]), scene.options).ranges[0]
    ui.until(lambda: plan.shown.answer.place == scene.pose)
    assert plan.shown.answer.ranges[0] == pytest.approx(expected)


def test_the_list_of_echoes_is_ranked_and_draws_the_path_pointed_at(measured: Plan) -> None:
    plan, listed = measured, measured.window.views.echo_list
    table, pointed = listed.table, measured.view.path.pointed
    plan.window.views.docks[3].opener.trigger()
    plan.showing.choose(27)  # at 270°
    ui.until(lambda: listed.title.text().startswith("270.0° · ") and "the runner-up" in listed.note.text())
    plan.showing.ask(math.radians(180))
    ui.until(lambda: answered(plan, 180))
    plan.key("Right")  # back to the readings
    assert (plan.shown.asked, plan.shown.chosen) == (None, 28)
    plan.showing.ask(math.radians(270))
    ui.until(lambda: answered(plan, 270) and table.rowCount() > 3 and "predicted" in plan.window.sentence.text())
    texts = [[table.item(row, column).text() for column in range(4)] for row in range(table.rowCount())]
    assert texts[0] == ["0.827 m", "−1.3 dB", "wins", "bottom>top>bottom"]
    assert texts[1][2] == "0.014 m behind the winner"
    assert [texts[-1][0], *texts[-1][2:]] == ["0.085 m", "blanked", "bottom"]
    assert listed.note.text().startswith("the runner-up (0.841 m) would win with right 0.0")
    pixel = table.visualItemRect(table.item(1, 3)).center()
    for at in (pixel, pixel + QPoint(1, 0)):
        QTest.mouseMove(table.viewport(), at)
    ui.until(lambda: plan.shown.pointed_path is not None and len(pointed.getData()[0]) > 0)
    answer, path = plan.shown.answer, plan.shown.pointed_path
    assert answer.paths.via(path, answer.room) == ("bottom", "right", "top", "bottom")
    assert np.column_stack(pointed.getData()) == pytest.approx(answer.paths.outline(path))
    table.setFocus()
    ui.key(table, "Down", "Ctrl+End")
    assert table.currentRow() == table.rowCount() - 1
    assert listed.note.text().startswith("this echo (0.085 m) would win with blanking 0.1")
    plan.window.commands.reset_layout.trigger()


# sound


def test_sound_is_played_moved_with_the_slider_and_shown_in_plan_and_trace(plan: Plan, tmp_path: Path) -> None:
    window, bar, sound, marks = plan.window, plan.window.sound_bar, plan.session.sound, plan.window.views.trace.marks

    def seek(time: float) -> None:
        bar.slider.setValue(round(time * 1e6))
        ui.until(lambda: marks.sound.value() == pytest.approx(time, abs=1e-6))

    plan.showing.ask(math.radians(270))  # where the near wall is blanked
    ui.until(lambda: plan.shown.answer is not None)
    plan.key("S")
    ui.until(lambda: plan.shown.sound is not None)
    assert bar.isVisible()
    legend = window.legend.explained
    window.legend.more.setChecked(True)
    ui.until(lambda: all(legend[name].isVisible() and legend[name].toolTip() for name in SOUND))
    first = plan.shown.sound.time
    ui.until(lambda: plan.shown.sound.time > first)
    bar.play.click()
    assert (sound.state.playing, bar.play.text()) == (False, "Play")
    ping, layer = sound.state.ping, plan.view.sound
    seek(1.35e-3)
    # 0.463 m along the path: down to the wall, and 0.293 m beyond the sensor
    assert np.nanmax(layer.winner.getData()[1]) == pytest.approx(1.35e-3 * ping.speed - 0.085, abs=1e-3)
    assert bar.caption.text() == "1.35 ms: the board listens"
    assert not marks.crossing.isVisible()
    seek(ping.duration)
    assert marks.crossing.isVisible()
    heard = FIGURE9[1] - float(ping.prediction.distances[0])
    assert layer.counted.getData()[1][0] == pytest.approx(heard, abs=1e-3)
    assert "the board would report 0.8" in bar.caption.text()
    low, high = plan.view.plot.viewRange()[1]
    assert low < FIGURE9[1] - 0.82 < high  # the false wall is visible
    sound.toggle()  # at the end: again
    assert sound.state.time == 0
    for _ in range(2):
        sound.advance(10.0)
    assert sound.state.time < ping.duration  # looped
    bar.loop.click()
    for _ in range(3):
        sound.advance(10.0)
    assert (sound.state.time, sound.state.playing) == (pytest.approx(ping.duration), False)
    bar.loop.click()
    seek(1e-3)
    bar.slider.setFocus()
    ui.key(bar.slider, "PgUp")
    assert sound.state.time == pytest.approx(1.2e-3)

    bar.film.click()
    ui.dialog_of(window).fileSelected.emit(str(tmp_path / "sound.gif"))
    ui.dialog_of(window).close()
    ui.until(lambda: (tmp_path / "sound.gif").exists() and not plan.session.jobs.busy("save files"))
    with Image.open(tmp_path / "sound.gif") as film:
        assert film.n_frames > 50
        assert film.size[0] > 700
    bar.every.click()
    assert len(sound.state.ping.ways) > len(ping.ways)
    plan.key("[")
    ui.until(lambda: math.degrees(sound.state.ping.heading) == pytest.approx(271))
    assert sound.state.ping.every
    bar.every.click()
    plan.key("S")
    ui.until(lambda: not bar.isVisible() and not marks.sound.isVisible())
    assert plan.shown.sound is None
    assert not any(legend[name].isVisible() for name in SOUND)


# side by side


def turn_wheel(view: PlanDrawing, at: Point, notches: int) -> None:
    pixel, nothing, none = ui.pixel_at(view, view.plot.vb, at), QPoint(), Qt.MouseButton.NoButton
    place, angle = QPointF(view.viewport().mapToGlobal(pixel)), QPoint(0, 120 * notches)
    modifiers, phase = Qt.KeyboardModifier.NoModifier, Qt.ScrollPhase.NoScrollPhase
    wheel = QWheelEvent(QPointF(pixel), place, nothing, angle, none, modifiers, phase, False)
    QApplication.sendEvent(view.viewport(), wheel)


def test_one_plan_shows_readings_the_other_the_prediction_with_common_pan_zoom_and_sensor(measured: Plan) -> None:
    plan, window = measured, measured.window
    plan.key("2")
    one, other = window.views.side_by_side.measured, window.views.side_by_side.predicted
    ui.until(lambda: other.shown is plan.shown)
    rows = plan.shown.rows
    assert len(ui.drawn(one.marks)) == np.count_nonzero(np.isfinite(rows.measured) | np.isfinite(rows.predicted)) > 30
    assert not ui.drawn(other.marks)
    outlined = [np.isfinite(view.outline.getData()[1]).sum() for view in (one, other)]
    assert outlined == [0, np.isfinite(plan.shown.outline.ranges).sum()]
    assert [len(view.room.walls.getData()[0]) for view in (one, other)] == [8, 8]
    ui.pause(50)
    plan.key("F")
    (left, right), _ = one.plot.vb.viewRange()
    turn_wheel(other, (0.4, 0.4), 3)
    ui.drag(one, one.plot.vb, (0.3, 0.3), (0.35, 0.35))
    middles = [np.mean(view.plot.vb.viewRange(), axis=1) for view in (one, other)]
    pixels = [view.plot.vb.viewPixelSize() for view in (one, other)]
    assert middles[0] == pytest.approx(middles[1])
    assert pixels[0] == pytest.approx(pixels[1], rel=0.005)  # one may be a pixel wider
    closer_left, closer_right = one.plot.vb.viewRange()[0]
    assert closer_right - closer_left < 0.8 * (right - left)
    plan.key("F")
    assert one.plot.vb.viewRange()[0] == pytest.approx([left, right], abs=0.01)
    x, y = plan.sensor
    ui.click(other, other.plot.vb, (x - 0.3, y + 0.02))  # selects the reading at that heading
    assert plan.shown.heading(plan.shown.chosen) == pytest.approx(np.pi)
    ui.until(lambda: "at 180.0°" in window.sentence.text())
    ui.drag(other, other.plot.vb, (x, y), (0.5, 0.3))
    ui.until(lambda: ui.predicted(window))
    ui.until(lambda: all(v.sensor.spot.getData()[0][0] == pytest.approx(0.5, abs=0.005) for v in (one, other)))
