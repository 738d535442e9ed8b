"""The plan: the room to scale, what is predicted and measured in it, the beam, and the rays of the chosen reading.

Takes what is shown; hands on which reading was clicked, where the hand points, and how it changes the scene. What the
hand does is in `plan.plan_hands` and `plan.plan_tools`, what is drawn in `plan.plan_layers`.
"""

from functools import partial
from typing import cast

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent, MouseDragEvent
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt, Signal, Slot
from PySide6.QtGui import QKeyEvent
from sonarhw_compare.pictures.points import points_at
from sonarhw_sim.predict.by_heading import standpoints

from sonarhw.readings import FloatArray
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plan.plan_hands import PlanHands
from sonarhw_gui.plan.plan_layers import CursorLayer, PathLayer, RoomLayer, RulerLayer, SensorLayer
from sonarhw_gui.plots.marks import NOWHERE, WHOLE, Outline, ReadingMarks
from sonarhw_gui.plots.pick import nearest_reading
from sonarhw_gui.plots.plot_look import dress_plot, label_length
from sonarhw_gui.plots.reading_tip import reading_tip
from sonarhw_gui.scene.plan_geometry import outline_points, seen_bounds
from sonarhw_gui.scene.scene_edit import bearing
from sonarhw_gui.shown.shown import Shown

_BEYOND = 0.17  # of the room's longer side: echoes by several walls seem to lie outside


class PlanView(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Draws the plan of what is shown: all of it, or only what was measured, or only what is predicted."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor or None
    edited = Signal(object, str, object)  # Scene, what was done, gesture
    cancelled = Signal(object)  # gesture that is not to have been
    surface_chosen = Signal(object)  # name of a wall or post, or None
    told = Signal(str)  # what lies under the hand, what it measures, or why something cannot be

    def __init__(self, measured: bool = True, predicted: bool = True) -> None:
        box = _Box()
        super().__init__(viewBox=box)
        self.setViewportUpdateMode(WHOLE)
        self.shown: Shown | None = None
        self._measured, self._predicted = measured, predicted
        self._by_hand = False  # whether a person has moved the paper or zoomed
        self.setAspectLocked(True)
        self.hideButtons()
        self.room, self.sensor = RoomLayer(self.plotItem), SensorLayer(self.plotItem)
        self._outline = Outline()
        self.addItem(self._outline)
        self.path, self.pointer = PathLayer(self.plotItem), CursorLayer(self.plotItem)
        self._marks = ReadingMarks(self.plotItem, self._tip)
        self.ruler = RulerLayer(self.plotItem)
        self.hands = PlanHands(self)
        box.hands = self.hands
        box.sigRangeChangedManually.connect(self._keep_range)
        self.scene().sigMouseClicked.connect(self.hands.click)
        self.scene().sigMouseMoved.connect(self.hands.hover)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
        before, self.shown = self.shown, shown
        if before is None or before.look != shown.look:
            self._dress(shown.look)
        if before is None or before.scene.room is not shown.scene.room:
            self.draw_room()
        if self._predicted:
            self._draw_predicted(before, shown)
        if self._measured:
            self._draw_measured(before, shown)
        if _differ(before, shown, "scene", "readings", "chosen", "look"):
            self.sensor.draw(shown)
        if _differ(before, shown, "scene", "cursor"):
            self.pointer.draw(shown)
        if before is None or _is_elsewhere(before, shown) or (not before.readings and not shown.scene.room):
            self._fit()
        if before is None or before.chosen != shown.chosen:
            self._reach(self._marks.place_of(shown.chosen))

    def fit(self) -> None:
        """Show the room, the sensor and the chosen reading, and some way beyond; without a room everything."""
        self._fit(self._marks.place_of(self.shown.chosen) if self.shown else None)

    def _reach(self, reading: FloatArray | None) -> None:
        """See the chosen reading too, unless a person has said by hand what they want to see."""
        seen = self.plotItem.vb.viewRect()
        if reading is not None and not self._by_hand and not seen.contains(QPointF(*reading)):
            self._fit(reading, besides=seen)

    def _fit(self, reading: FloatArray | None = None, besides: QRectF | None = None) -> None:
        self._by_hand = False
        scene = self.hands.scene if self.shown else None
        if scene is None or scene.room is None:
            self.plotItem.vb.autoRange(padding=0.05)
            return
        points = [scene.standing.position] if reading is None else [scene.standing.position, reading]
        (left, bottom), (right, top) = seen_bounds(scene.room, np.array(points))
        beyond = _BEYOND * max(right - left, top - bottom)
        area = QRectF(left - beyond, bottom - beyond, right - left + 2 * beyond, top - bottom + 2 * beyond)
        self.plotItem.vb.setRange(area.united(besides or area), padding=0)

    def zoom(self, scale: float) -> None:
        """See `scale` times as much, about the middle."""
        self._by_hand = True
        self.plotItem.vb.scaleBy((scale, scale))

    def pan(self, right: int, up: int) -> None:
        """See what lies so many tenths of the view further on."""
        self._by_hand = True
        (left, far_right), (low, high) = self.plotItem.vb.viewRange()
        self.plotItem.vb.translateBy((right * (far_right - left) / 10, up * (high - low) / 10))

    def draw_room(self) -> None:
        """Draw the room, as the tool in the hand wants to see it."""
        if self.shown is not None:
            self.room.draw(self.shown.scene.room, self.hands.chosen, self.hands.tool.edits)

    def pick(self, event: MouseClickEvent) -> None:
        """Ask about the reading nearest to a click, if one is near; where none is drawn, of that heading."""
        if self._measured:
            index = nearest_reading(self.plotItem.vb, self._marks.placed, event.scenePos())
        else:
            index = self._towards(event)
        if index is not None:
            event.accept()
            self.picked.emit(index)

    def _towards(self, event: MouseClickEvent) -> int | None:
        if self.shown is None or not self.shown.readings:
            return None
        at = self.plotItem.vb.mapSceneToView(event.scenePos())
        heading = bearing(self.shown.scene.standing.position, (at.x(), at.y()))
        apart = np.abs(np.mod(np.radians(self.shown.rows.headings) - heading + np.pi, 2 * np.pi) - np.pi)
        return int(np.argmin(apart))

    def event(self, event: QEvent) -> bool:
        """Esc lets go of what is being dragged; else it is for the window."""
        asked = event.type() == QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Escape
        if asked and self.hands.let_go():
            event.accept()
            return True
        return bool(super().event(event))

    @Slot()
    def _keep_range(self) -> None:
        self._by_hand = True

    def leaveEvent(self, event: QEvent) -> None:
        """Nothing is pointed at any more."""
        self.hands.leave()
        super().leaveEvent(event)

    def _dress(self, look: Look) -> None:
        self.setBackground(look.palette.paper)
        dress_plot(self.plotItem, look)
        for side, what in (("bottom", "x"), ("left", "y")):
            label_length(self.getAxis(side), what, look)
        for layer in (self.room, self.sensor, self.path, self.pointer, self.ruler):
            layer.dress(look)
        self._outline.dress(look.palette)
        self._marks.dress(look.palette)

    def _draw_predicted(self, before: Shown | None, shown: Shown) -> None:
        if before is None or before.outline is not shown.outline:
            self._outline.draw(outline_points(shown.outline) if shown.outline else NOWHERE)
        if _differ(before, shown, "scene", "compared", "readings", "chosen", "look"):
            self.path.draw(shown)

    def _draw_measured(self, before: Shown | None, shown: Shown) -> None:
        fresh = before is None or not shown.same_readings(before)
        if fresh:
            stands = partial(standpoints, shown.scene.board, shown.scene.standing)
            self._marks.draw(
                {
                    kind: (points, points_at(stands(points.headings), points.headings, points.ranges))
                    for kind, points in shown.classes.items()
                }
            )
        if fresh or _differ(before, shown, "chosen"):
            self._marks.ring(shown.chosen)

    def _tip(self, index: int) -> str:
        return reading_tip(self.shown, index) if self.shown else ""


class _Box(pg.ViewBox):  # type: ignore[misc]  # pyqtgraph has no types
    """Where the plan is drawn: a drag with the left button is offered to the hand before it moves the paper."""

    hands: PlanHands | None = None

    def __init__(self) -> None:
        super().__init__(enableMenu=False)

    def mouseDragEvent(self, ev: MouseDragEvent, axis: int | None = None) -> None:
        """Offer it; what nobody takes moves the paper."""
        if axis is None and self.hands and ev.button() == Qt.MouseButton.LeftButton and self.hands.drag(ev):
            ev.accept()
        else:
            super().mouseDragEvent(ev, axis)


def _differ(before: Shown | None, shown: Shown, *parts: str) -> bool:
    """Whether any of those parts is another one than before."""
    return before is None or any(getattr(before, part) is not getattr(shown, part) for part in parts)


def _is_elsewhere(before: Shown, shown: Shown) -> bool:
    """Whether another room was opened: an edited one stays where it is on the screen."""
    was, now = before.scene, shown.scene
    if was.room is None or now.room is None:
        return was.room is not now.room
    if was.room.text == now.room.text:
        return False  # saved under another name
    return (was.room_file, was.room.name) != (now.room_file, now.room.name)
