"""The view "Plan": the plan, its tools, and a line that describes the object under the mouse."""

import math
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import cast

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent, MouseDragEvent
from PySide6 import QtWidgets
from PySide6.QtCore import QEvent, QPoint, QPointF, QRect, QRectF, QSize, Qt, Signal, Slot
from PySide6.QtGui import (
    QAction,
    QActionGroup,
    QFontMetrics,
    QIcon,
    QKeyEvent,
    QPainter,
    QPalette,
    QPixmap,
    QResizeEvent,
)
from PySide6.QtSvg import QSvgRenderer
from sonarhw_compare.edits import Point
from sonarhw_compare.sound import counted_position
from sonarhw_sim.predict.predicted_scan import standpoints
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_file import MAX_COORDINATE

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, points_at
from sonarhw_gui import widgets
from sonarhw_gui.model.edits import Edit, bearing, with_post, with_wall
from sonarhw_gui.model.look import LengthUnit, Look, ViewLayer
from sonarhw_gui.model.scene import Scene, outline_points, plan_bounds
from sonarhw_gui.model.shown import NO_PROPOSAL, Parts, Shown, marked_parts
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views import base, plan_layers
from sonarhw_gui.views.marks import NO_POSITIONS, Outline, OverlayMarks, ReadingMarks, reading_tip
from sonarhw_gui.views.plan_tools import REMOVE, TOOLS, PlanController, Tool

# The plan: the room to scale, predicted and measured points, the beam, and the rays of the selected reading.
#
# `plan_tools` handles mouse and keys; `plan_layers` draws the parts.


_WIDEST = "-00.00"  # tick value on the left axis
_OUTLINE_REACH = 8.0  # pixels
_BEYOND = 0.08  # margin, share of the room's longer side
_AROUND_READINGS = 0.04  # likewise, share of the extent of all readings


class PlanDrawing(base.Canvas):
    """Draws the plan with measured and predicted points, or with one of them only."""

    message_changed = Signal(str)  # the object under the mouse, the ruler's result, or why an edit is rejected

    def __init__(self, gestures: base.Gestures, measured: bool = True, predicted: bool = True) -> None:
        self._box = _Box()
        self.plot = base.new_plot(box=self._box)
        super().__init__(self.plot)
        self.shown: Shown | None = None
        self._measured, self._predicted = measured, predicted
        self.plot.setAspectLocked(True)
        self.room, self.sensor = plan_layers.RoomLayer(self.plot), plan_layers.SensorLayer(self.plot)
        self.outline = Outline()
        self.plot.addItem(self.outline)
        self.path = plan_layers.PathLayer(self.plot)
        self.marks = ReadingMarks(self.plot, self._tip)
        self.arrows = plan_layers.EdgeArrows(self._box)
        self.ruler = plan_layers.RulerLayer(self.plot)
        self.sound = plan_layers.SoundLayer(self.plot)
        self.proposal = plan_layers.SurfaceLayer(self.plot, z=35, width=4, cross=18)
        self.overlays = OverlayMarks(self.plot)
        self.found_room = plan_layers.FoundLayer(self.plot)
        self.track = plan_layers.TrackLayer(self.plot)
        self.gestures = gestures
        self.controller = PlanController(self, gestures)
        self._box.offer_drag = self.controller.drag
        self.clicked.connect(self.controller.click)
        self.menu_pressed.connect(self._pick_for_menu)
        self.hovered.connect(self.controller.hover)
        self._frame: QRectF | None = None  # m, visible in every size of the view
        self._fitted = True  # whether the user has not chosen another part since `fit`
        self._box.sigRangeChangedManually.connect(self._note_choice)
        self._box.sigResized.connect(self._show_frame)

    def _layer_table(self) -> Iterator[tuple[Parts, Callable[[Shown], None]]]:
        """Yield the parts that each layer depends on, and what draws it, in order."""
        yield _beam_parts, self.sensor.draw
        if self._predicted:
            yield lambda new: (new.outline, new.hidden), self._draw_outline
            yield _path_parts, self.path.draw
        if self._measured:
            yield marked_parts, self._draw_marks
            yield lambda new: (*marked_parts(new), new.notes), lambda new: self.marks.draw_notes(new.notes)
            yield lambda new: (*marked_parts(new), new.chosen), lambda new: self.marks.ring(new.chosen)
            yield lambda new: (new.overlays,), self._draw_overlays
        yield lambda new: (new.scene, new.cursor), self.sensor.draw_cursor
        yield _proposal_parts, self._draw_proposal
        yield lambda new: (new.found_room,), lambda new: self.found_room.draw(new.found_room)
        yield lambda new: (new.track,), lambda new: self.track.draw(new.track)
        yield lambda new: (new.sound, new.look), self.sound.draw
        yield lambda new: (*marked_parts(new), new.chosen, new.look), self._draw_arrows

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self.shown = self.shown, shown
        self.repaint_whole()
        if shown.changed_since(before, lambda new: (new.look,)):
            self._set_look(shown.look)
        if before is None or before.scene.room is not shown.scene.room:
            self.draw_room()
        for parts, draw in self._layer_table():
            if shown.changed_since(before, parts):
                draw(shown)
        ping = None if shown.sound is None else shown.sound.ping
        if ping is not None and (before is None or before.sound is None):
            self._show_also(counted_position(ping, ping.duration))
        if before is None or _is_another_room(before, shown) or self._grows(before, shown):
            self.fit()

    def _grows(self, before: Shown, shown: Shown) -> bool:
        """Return whether there are other readings, and no room to show instead of them."""
        return shown.scene.room is None and before.readings is not shown.readings and self._fitted

    def fit(self) -> None:
        """Show the room and the sensor with a margin; without a room, all points."""
        self._fitted = True
        scene = self.controller.scene if self.shown else None
        if scene is None or scene.room is None:
            self.fit_everything()
            return
        self._set_frame(self._room_area(scene))

    def fit_everything(self) -> None:
        """Show the room, the sensor and every reading."""
        points = [positions for _, positions in self.marks.placed.values() if len(positions)]
        scene = self.controller.scene if self.shown else None
        if scene is None or scene.room is None or not points:
            self._box.autoRange(padding=0.05)
            self.note_frame()
            return
        (left, bottom), (right, top) = np.vstack(points).min(axis=0), np.vstack(points).max(axis=0)
        beyond = _AROUND_READINGS * max(right - left, top - bottom)
        drawn = QRectF(left, bottom, right - left, top - bottom).adjusted(-beyond, -beyond, beyond, beyond)
        self._set_frame(drawn.united(self._room_area(scene)))

    def _note_choice(self, *_: object) -> None:
        self._fitted = False
        self.note_frame()

    def note_frame(self, *_: object) -> None:
        """Keep what is visible now in view when the size changes."""
        self._frame = self._box.viewRect()

    def _set_frame(self, frame: QRectF) -> None:
        self._frame = frame
        self._show_frame()

    def _show_frame(self, *_: object) -> None:
        """Show the frame as large as possible; pyqtgraph would make it smaller with each change of the size."""
        if self._frame is not None:
            self._box.setRange(self._frame, padding=0)

    def _room_area(self, scene: Scene) -> QRectF:
        assert scene.room is not None, "without a room there is nothing to measure"
        area = _plan_area(scene.room, scene.pose.position)
        beyond = _BEYOND * max(area.width(), area.height())
        return area.adjusted(-beyond, -beyond, beyond, beyond)

    def _show_also(self, point: FloatArray) -> None:
        """Extend the visible range to a point."""
        seen = self._box.viewRect()
        if not seen.contains(QPointF(*point)):
            margin = _BEYOND * max(seen.width(), seen.height())
            around = QRectF(point[0] - margin, point[1] - margin, 2 * margin, 2 * margin)
            self._set_frame(seen.united(around))

    def zoom(self, scale: float) -> None:
        """Scale the visible range by `scale` about its middle."""
        self._box.scaleBy((scale, scale))
        self._note_choice()

    def pan(self, right: int, up: int) -> None:
        """Move the visible range by tenths of its size."""
        (left, far_right), (low, high) = self._box.viewRange()
        self._box.translateBy((right * (far_right - left) / 10, up * (high - low) / 10))
        self._note_choice()

    # for the controller

    @property
    def pixel(self) -> float:
        """The length of a pixel, m."""
        return float(abs(self._box.viewPixelSize()[0]))

    def contains(self, position: QPointF) -> bool:
        """Return whether a point in scene coordinates lies in the plan."""
        return bool(self._box.sceneBoundingRect().contains(position))

    def point_at(self, position: QPointF) -> Point:
        """Return the visible plan point, m, nearest to a point in scene coordinates."""
        point = self._box.mapSceneToView(position)
        (left, right), (low, high) = self._box.viewRange()
        return min(max(point.x(), left), right), min(max(point.y(), low), high)

    def draw_room(self) -> None:
        """Draw the room, with handles if the active tool edits it."""
        if self.shown is not None:
            room = self.shown.scene.room
            self.room.draw(room, self.controller.chosen, self.controller.tool.can_edit)
            self.arrows.keep_clear(QRectF() if room is None else _plan_area(room))

    def pick(self, event: MouseClickEvent) -> bool:
        """Select the reading nearest to a click, if one is close. Without measured points, select by heading."""
        index = self._reading_at(event.scenePos()) if self._measured else self._towards(event)
        if index is not None:
            event.accept()
            self.gestures.picked.emit(index)
        return index is not None

    @Slot(object)
    def _pick_for_menu(self, position: QPointF) -> None:
        index = self._reading_at(position) if self._measured else None
        if index is not None:
            self.gestures.picked.emit(index)

    def _reading_at(self, position: QPointF) -> int | None:
        index = self.arrows.reading_at(position)
        return base.nearest_reading(self._box, self.marks.placed, position) if index is None else index

    def on_outline(self, point: Point) -> bool:
        """Return whether a point lies on the predicted outline."""
        if not self._predicted or self.shown is None or self.shown.outline is None:
            return False
        away = np.hypot(*(outline_points(self.shown.outline) - point).T)
        return bool((away <= _OUTLINE_REACH * self.pixel).any())

    def _towards(self, event: MouseClickEvent) -> int | None:
        if self.shown is None:
            return None
        point = self._box.mapSceneToView(event.scenePos())
        return base.reading_towards(self.shown, bearing(self.shown.scene.pose.position, (point.x(), point.y())))

    def event(self, event: QEvent) -> bool:
        """Let Esc cancel a drag; without a drag, the window handles it."""
        escape = event.type() == QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Escape
        if escape and self.controller.cancel_drag():
            event.accept()
            return True
        return bool(super().event(event))

    def _set_look(self, look: Look) -> None:
        self.set_look(look)
        for side, what in (("bottom", "x"), ("left", "y")):
            base.label_length(self.plot.getAxis(side), what, look)
        metrics = QFontMetrics(text_font(look, 0.9))
        # wider tick values would change the size of the plan, and with it the visible range
        self.plot.getAxis("left").setWidth(metrics.horizontalAdvance(_WIDEST) + metrics.height() + 8)
        drawn = self.room, self.sensor, self.path, self.ruler, self.sound, self.proposal, self.found_room
        for layer in (*drawn, self.track, self.overlays, self.outline, self.marks, self.arrows):
            layer.set_look(look)

    def _draw_outline(self, shown: Shown) -> None:
        self.outline.draw(outline_points(shown.outline) if shown.outline else NO_POSITIONS)
        self.outline.setVisible(shown.draws(ViewLayer.PREDICTED))

    def _draw_marks(self, shown: Shown) -> None:
        board, poses = shown.scene.board, shown.poses
        placed = {}
        for kind, points in shown.classes.items():
            where = shown.scene.pose if poses is None else poses[list(points.readings)]
            sensors = standpoints(board, where, points.headings)
            placed[kind] = points, points_at(sensors, points.headings, points.ranges)
        self.marks.draw(placed)

    def _draw_overlays(self, shown: Shown) -> None:
        self.overlays.draw({scan.style: scan.points for scan in shown.overlays if scan.visible})

    def _draw_proposal(self, shown: Shown) -> None:
        """Draw a proposed change of the room, and rings around the readings that it explains, at their marks."""
        proposal = shown.proposal or NO_PROPOSAL
        marks = [self.marks.position_of(reading) for reading in proposal.readings]
        explained = np.array([mark for mark in marks if mark is not None]).reshape(-1, 2)
        self.proposal.draw_surfaces(proposal.walls, proposal.posts, explained)

    def _draw_arrows(self, shown: Shown) -> None:
        self.arrows.draw(self.marks.placed, shown.sensor.position, shown.chosen)

    def _tip(self, index: int) -> str:
        return reading_tip(self.shown, index) if self.shown else ""


def _plan_area(room: Room, *others: Point) -> QRectF:
    """Return the area of a room and other points in the plan, m."""
    (left, bottom), (right, top) = plan_bounds(room, np.array(others).reshape(-1, 2))
    return QRectF(left, bottom, right - left, top - bottom)


def _beam_parts(shown: Shown) -> tuple[object, ...]:
    return shown.scene, shown.readings, shown.poses, shown.chosen, shown.asked, shown.look, shown.hidden


def _path_parts(shown: Shown) -> tuple[object, ...]:
    return *marked_parts(shown), shown.chosen, shown.asked, shown.answer, shown.pointed_path, shown.look


def _proposal_parts(shown: Shown) -> tuple[object, ...]:
    return *marked_parts(shown), shown.proposal, shown.look


class _Box(pg.ViewBox):  # type: ignore[misc]  # pyqtgraph has no types
    """View box that offers a drag with the left button to the tool before it pans."""

    offer_drag: Callable[[MouseDragEvent], bool] | None = None

    def __init__(self) -> None:
        super().__init__(enableMenu=False)

    def mouseDragEvent(self, ev: MouseDragEvent, axis: int | None = None) -> None:
        """Offer the drag to the tool; pan if the tool does not use it."""
        left = axis is None and ev.button() == Qt.MouseButton.LeftButton
        if left and self.offer_drag is not None and self.offer_drag(ev):
            ev.accept()
        else:
            super().mouseDragEvent(ev, axis)


def _is_another_room(before: Shown, shown: Shown) -> bool:
    """Return whether another room was opened. An edited room keeps its place on the screen."""
    was, now = before.scene, shown.scene
    if was.room is None or now.room is None:
        return was.room is not now.room
    if was.room.text == now.room.text:
        return False  # saved under another name
    return (was.room_file, was.room.name) != (now.room_file, now.room.name)


# The view "Side by side": measured left, predicted right, with one pan and zoom.


class SideBySide(QtWidgets.QWidget):
    """Two plans: measured readings and predicted readings."""

    entry = base.ViewEntry(
        "Side by side",
        "The scan on the left, its prediction on the right",
        key="2",
        width=0.72,
        not_drawn=base.NOT_IN_PLANS,
    )

    def __init__(self) -> None:
        super().__init__()
        self.gestures = base.Gestures(self)
        self._row = widgets.arranged(QtWidgets.QHBoxLayout(self), gap=1)
        self._created = False
        self.title = widgets.title_label("Measured")  # of the left plan: the origin of the readings

    @cached_property
    def measured(self) -> PlanDrawing:
        """The left plan. Both plans are created when first visible."""
        return PlanDrawing(self.gestures, predicted=False)

    @cached_property
    def predicted(self) -> PlanDrawing:
        """The right plan."""
        return PlanDrawing(self.gestures, measured=False)

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        if not self._created:
            self._created = True
            self._arrange()
        self.title.setText(shown.origin.capitalize())
        for view in (self.measured, self.predicted):
            view.show_state(shown)

    def fit(self) -> None:
        """Show the whole room in both plans."""
        if self._created:
            self.measured.fit()
            self.predicted.fit()

    def picture(self) -> QtWidgets.QWidget:
        """Return both plans."""
        return self

    def _arrange(self) -> None:
        for title, view in ((self.title, self.measured), (widgets.title_label("Predicted"), self.predicted)):
            self._row.addLayout(_titled(title, view), stretch=1)
        self.predicted.plot.setXLink(self.measured.plot)
        self.predicted.plot.setYLink(self.measured.plot)
        for moved, other in ((self.measured, self.predicted), (self.predicted, self.measured)):
            moved.plot.vb.sigRangeChangedManually.connect(other.note_frame)


def _titled(title: widgets.PlainLabel, view: PlanDrawing) -> QtWidgets.QVBoxLayout:
    message = widgets.ElidedLabel()
    view.message_changed.connect(message.setText)
    head = QtWidgets.QHBoxLayout()
    head.setContentsMargins(8, 3, 8, 3)
    head.addWidget(title)
    head.addWidget(message, stretch=1)
    column = QtWidgets.QVBoxLayout()
    column.setSpacing(0)
    column.addLayout(head)
    column.addWidget(view, stretch=1)
    return column


# A dialog that adds a wall or a post by typed coordinates, without the mouse.


_WALL, _POST = ("x of one end", "y of one end", "x of the other end", "y of the other end"), ("x", "y", "radius")

_RADIUS = 0.05  # m, of a post until another one is typed


class TypedSurface(QtWidgets.QDialog):
    """Asks for the coordinates of a wall (four) or of a post (three). Not modal."""

    def __init__(
        self,
        scene: Callable[[], Scene],
        unit: LengthUnit,
        gestures: base.Gestures,
        post: bool,
        parent: QtWidgets.QWidget,
    ) -> None:
        """`scene`: returns the present scene, which may change while the dialog is open."""
        super().__init__(parent)
        self.setWindowTitle("Add a post" if post else "Add a wall")
        self._scene, self._gestures, self._post, self._unit = scene, gestures, post, unit
        self.problem = widgets.PlainLabel(wordWrap=True)
        form = QtWidgets.QFormLayout(self)
        self.fields = [self._field(form, name, self._unit) for name in (_POST if post else _WALL)]
        for field, value in zip(self.fields, scene().pose.position, strict=False):
            field.setValue(self._unit.of(value))
        if post:
            self.fields[2].setValue(self._unit.of(_RADIUS))
        buttons = QtWidgets.QDialogButtonBox(
            QtWidgets.QDialogButtonBox.StandardButton.Ok | QtWidgets.QDialogButtonBox.StandardButton.Cancel
        )
        buttons.button(QtWidgets.QDialogButtonBox.StandardButton.Ok).setDefault(True)  # Enter in a field adds
        buttons.accepted.connect(self._add)
        buttons.rejected.connect(self.close)
        form.addRow(self.problem)
        form.addRow(buttons)

    @staticmethod
    def _field(form: QtWidgets.QFormLayout, name: str, unit: LengthUnit) -> widgets.NumberField:
        most = unit.of(MAX_COORDINATE)
        field = widgets.NumberField(0.0 if name == "radius" else -most, most, unit.decimals, f" {unit.label}")
        field.setAccessibleName(name)
        form.addRow(name, field)
        return field

    @Slot()
    def _add(self) -> None:
        for field in self.fields:
            field.interpretText()  # Enter may come before a field has lost the focus
        try:
            scene, label = self._edited(self._scene())
        except InputError as error:
            self.problem.setText(str(error))
            return
        self._gestures.edited.emit(scene, label, None)
        self.close()

    def _edited(self, scene: Scene) -> Edit:
        x, y, *others = (round(self._unit.metres(field.value()), 6) for field in self.fields)
        if self._post:
            return with_post(scene, (x, y), others[0])
        if [x, y] == others:
            raise InputError("the ends of the wall are the same point; give two different points")
        return with_wall(scene, (x, y), (others[0], others[1]))


_MOVES = {"Left": (-1, 0), "Right": (1, 0), "Down": (0, -1), "Up": (0, 1)}
_ZOOM = 1.25
_FITS = (
    ("Fit room", "Home", "Show the room and the sensor; readings outside are arrows at the edge", PlanDrawing.fit),
    ("Fit everything", "Shift+F", "Show the room, the sensor and every reading", PlanDrawing.fit_everything),
)
_QUESTIONS = (("Ask left", "[", 1.0), ("Ask right", "]", -1.0))  # °, counter-clockwise
_TURNS = {"left": ("Shift+PgUp", 1), "right": ("Shift+PgDown", -1)}


class PlanView(QtWidgets.QWidget):
    """The plan with a column of tools beside it."""

    entry = base.ViewEntry("Plan", "The room to scale", key="1", menu="Plan", not_drawn=base.NOT_IN_PLANS)

    def __init__(self) -> None:
        super().__init__()
        self.gestures = base.Gestures(self)
        self.drawing = view = PlanDrawing(self.gestures)
        self.tools = QActionGroup(self)
        self.typed: TypedSurface | None = None  # the dialog for coordinates, opened last
        widgets.arranged(QtWidgets.QHBoxLayout(self), self._bar(), view, rest=view)
        self.message = widgets.ElidedLabel()  # over the free part of the lower axis, so that it moves nothing
        self.message.setParent(view)
        self.message.setAutoFillBackground(True)
        self.message.setBackgroundRole(QPalette.ColorRole.Base)
        self.message.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        view.message_changed.connect(self._show_message)
        self._look: Look | None = None
        self._add_keys()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        self.drawing.show_state(shown)
        if shown.look is not self._look:
            self._look = shown.look
            for action in (*self.tools.actions(), self.remove):
                action.setIcon(_icon(action.data(), shown.look, self.devicePixelRatioF()))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the message at the edge."""
        super().resizeEvent(event)
        self._place_message()

    def fit(self) -> None:
        """Show the whole room."""
        self.drawing.fit()

    def picture(self) -> QtWidgets.QWidget:
        """Return the plan without its tools."""
        return self.drawing

    def _bar(self) -> QtWidgets.QWidget:
        bar = QtWidgets.QWidget()
        for tool in TOOLS:
            action = base.view_action(self, tool.name, tool.key, f"{tool.name}: {tool.tip}")
            action.setData(tool)
            self.tools.addAction(action)
        self.remove = self._action("Remove", "Del", "Remove the selected wall or post")
        self.remove.triggered.connect(self.drawing.controller.remove_chosen)
        column = widgets.arranged(QtWidgets.QVBoxLayout(bar), margins=(2, 2, 0, 2))
        base.add_buttons(column, [*self.tools.actions(), self.remove])
        column.addStretch()
        self.tools.actions()[0].setChecked(True)
        self.tools.triggered.connect(self._set_tool)
        return bar

    @Slot(str)
    def _show_message(self, text: str) -> None:
        if text == self.message.text():
            return
        self.message.setText(text)
        self.message.setVisible(text != "")
        self._place_message()

    def _place_message(self) -> None:
        plan, size = self.drawing.rect(), self.message.sizeHint()
        size.setWidth(min(size.width(), plan.width()))
        self.message.setGeometry(QRect(plan.bottomRight() - QPoint(size.width(), size.height()), size))

    def _add_keys(self) -> None:
        controller = self.drawing.controller
        for side, by in _MOVES.items():
            tip = "Move the sensor by 1 cm; with Edit, the selected wall or post"
            self._action(f"Move {side.lower()}", f"Shift+{side}", tip).triggered.connect(partial(controller.nudge, *by))
        for side, (key, steps) in _TURNS.items():
            action = self._action(f"Turn {side}", key, "Turn the sensor by 1°")
            action.triggered.connect(partial(controller.turn, steps))
        for name, key, tip, fit in _FITS:
            self._action(name, key, tip).triggered.connect(partial(fit, self.drawing))
        for name, key, degrees in _QUESTIONS:
            action = self._action(name, key, "Explain the next heading on this side, without a scan")
            action.triggered.connect(partial(self._turn_question, math.radians(degrees)))
        for name, key, post in (("Add wall…", "Ctrl+Alt+W", False), ("Add post…", "Ctrl+Alt+P", True)):
            action = self._action(name, key, "Type the coordinates")
            action.triggered.connect(partial(self._type_surface, post))
        for name, key, scale in (("Zoom in", "+", 1 / _ZOOM), ("Zoom out", "-", _ZOOM)):
            action = self._action(name, key, "About the middle; the mouse wheel zooms about the pointer")
            action.triggered.connect(partial(self.drawing.zoom, scale))
        for side, by in _MOVES.items():
            action = self._action(f"Pan {side.lower()}", f"Ctrl+Shift+{side}", "Pan by a tenth of the view")
            action.triggered.connect(partial(self.drawing.pan, *by))

    def _action(self, text: str, key: str, tip: str) -> QAction:
        return base.view_action(self, text, key, tip, checkable=False)

    def _type_surface(self, post: bool) -> None:
        shown = self.drawing.shown
        if shown is None or shown.scene.room is None:
            self.message.setText("open a room first")
            return
        controller = self.drawing.controller
        self.typed = TypedSurface(lambda: controller.scene, shown.look.unit, self.gestures, post, self)
        widgets.show_alone(self.typed)

    def _turn_question(self, by: float) -> None:
        self.gestures.turned_question.emit(by)

    @Slot(QAction)
    def _set_tool(self, action: QAction) -> None:
        self.drawing.controller.set_tool(action.data())


_ICON = 20  # pixels


def _icon(tool: type[Tool] | None, look: Look, ratio: float) -> QIcon:
    """Return the picture of a tool, or of the button that removes a wall or post."""
    path = REMOVE if tool is None else tool.picture
    drawing = f"<path d='{path}' fill='none' stroke='{look.palette.ink}' stroke-width='1.8' stroke-linejoin='round'/>"
    svg = f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 24 24' stroke-linecap='round'>{drawing}</svg>"
    picture = QPixmap(QSize(_ICON, _ICON) * ratio)
    picture.fill(Qt.GlobalColor.transparent)
    with QPainter(picture) as painter:
        QSvgRenderer(svg.encode()).render(painter)
    picture.setDevicePixelRatio(ratio)
    return QIcon(picture)
