"""The plan: the room to scale, what is predicted and measured in it, the beam, and the rays of the chosen reading.

Takes what is shown; hands on which reading was clicked.
"""

import math
from functools import partial

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QRectF, Qt, Signal
from PySide6.QtGui import QFont, QPainterPath
from PySide6.QtWidgets import QGraphicsPathItem

from compare.picture import points_at
from gui.marks import WHOLE, ReadingMarks, outline_item
from gui.palette import BEAM, CHOSEN, GRID_ALPHA, INK, PAPER, WALL
from gui.pick import is_plain_click, nearest_reading
from gui.plan_geometry import beam_wedge, bounce_labels, half_power_angle, outline_points, wall_lines
from gui.reading_tip import reading_tip
from gui.shown import Shown
from sim.by_heading import standpoints
from sim.room import Room
from sonarhw.readings import FloatArray

_BEAM_LENGTH = 0.3  # of the room's diagonal
_BEYOND = 0.17  # of the room's longer side
_MOST_NUMBERED = 9  # points; numbers at more would hide the rays


class PlanView(pg.PlotWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """Draws the plan of what is shown."""

    picked = Signal(int)  # a reading

    def __init__(self) -> None:
        super().__init__()
        self.setViewportUpdateMode(WHOLE)
        self._shown: Shown | None = None
        self.setAspectLocked(True)
        self.setLabel("bottom", "x (m)")
        self.setLabel("left", "y (m)")
        self.showGrid(x=True, y=True, alpha=GRID_ALPHA)
        self.hideButtons()
        self._beam = pg.PlotCurveItem(pen=None, brush=pg.mkBrush(BEAM), fillLevel="enclosed")
        self._axis = pg.PlotCurveItem(pen=pg.mkPen(INK, width=1, style=Qt.PenStyle.DashLine))
        self._walls = pg.PlotCurveItem(pen=pg.mkPen(WALL, width=2), connect="pairs")
        self._posts = QGraphicsPathItem()
        self._posts.setPen(pg.mkPen(None))
        self._posts.setBrush(pg.mkBrush(WALL))
        self._outline = outline_item()
        self._rays = pg.PlotCurveItem(pen=pg.mkPen(CHOSEN, width=1.5))
        self._bounces = [_number() for _ in range(_MOST_NUMBERED)]
        self._sensor = pg.ScatterPlotItem(size=13, symbol="d", pen=pg.mkPen("w"), brush=pg.mkBrush(INK))
        items = (self._beam, self._axis, self._walls, self._posts, self._outline, self._rays, self._sensor)
        for item in (*items, *self._bounces):
            self.addItem(item, ignoreBounds=item in (self._beam, self._axis))
        self._marks = ReadingMarks(self.plotItem, self._tip)
        self.scene().sigMouseClicked.connect(self._click)

    def show_state(self, shown: Shown) -> None:
        """Draw what has changed since the last call."""
        before, self._shown = self._shown, shown
        if before is None or before.scene is not shown.scene:
            self._draw_scene(shown)
        if before is None or before.outline is not shown.outline:
            points = outline_points(shown.outline) if shown.outline else np.empty((0, 2))
            self._outline.setData(*points.T)
        if before is None or not shown.same_readings(before):
            stands = partial(standpoints, shown.scene.board, shown.scene.standing)
            self._marks.draw(
                {
                    kind: (points, points_at(stands(points.headings), points.headings, points.ranges))
                    for kind, points in shown.classes.items()
                }
            )
        self._marks.ring(shown.chosen)
        self._draw_beam(shown)
        self._draw_rays(*_rays(shown))
        if before is None or before.scene is not shown.scene or (not before.readings and not shown.scene.room):
            self.fit()

    def fit(self) -> None:
        """Show the room and some way beyond, where echoes by several walls seem to lie; without a room everything."""
        room = self._shown.scene.room if self._shown else None
        if room is None:
            self.plotItem.vb.autoRange(padding=0.05)
            return
        corners = wall_lines(room)
        (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
        beyond = _BEYOND * max(right - left, top - bottom)
        area = QRectF(left - beyond, bottom - beyond, right - left + 2 * beyond, top - bottom + 2 * beyond)
        self.plotItem.vb.setRange(area, padding=0)

    def _draw_scene(self, shown: Shown) -> None:
        room = shown.scene.room
        self._walls.setData(*(wall_lines(room) if room else np.empty((0, 2))).T)
        self._posts.setPath(_posts_path(room) if room else QPainterPath())
        self._sensor.setData(*np.array([shown.scene.standing.position]).T)

    def _draw_beam(self, shown: Shown) -> None:
        scene = shown.scene
        heading = shown.heading(len(shown.readings) - 1) if shown.readings else scene.standing.heading
        if scene.room is None:
            self._beam.setData([], [])
            self._axis.setData([], [])
            return
        corners = scene.room.walls.reshape(-1, 2)
        length = _BEAM_LENGTH * math.hypot(*np.ptp(corners, axis=0))
        self._beam.setData(*beam_wedge(scene.standing, heading, half_power_angle(scene.board, scene.room), length).T)
        ahead = points_at(scene.standing.position, np.array([heading, heading]), np.array([0.0, length]))
        self._axis.setData(*ahead.T)

    def _draw_rays(self, corners: FloatArray, accounts: bool) -> None:
        style = Qt.PenStyle.SolidLine if accounts else Qt.PenStyle.DotLine
        self._rays.setPen(pg.mkPen(CHOSEN, width=1.5, style=style))
        self._rays.setData(*corners.T)
        labels = bounce_labels(corners)
        for k, number in enumerate(self._bounces):
            number.setVisible(k < len(labels))
            if k < len(labels):
                text, at = labels[k]
                number.setText(text)
                number.setPos(*at)

    def _tip(self, index: int) -> str:
        return reading_tip(self._shown, index) if self._shown else ""

    def _click(self, event: MouseClickEvent) -> None:
        if self._shown is None or not is_plain_click(event):
            return
        index = nearest_reading(self.plotItem.vb, self._marks.placed, event.scenePos())
        if index is not None:
            event.accept()
            self.picked.emit(index)


def _rays(shown: Shown) -> tuple[FloatArray, bool]:
    """The corners of the path that accounts for the chosen reading; where none does, of the one expected instead."""
    row = shown.chosen_row
    nothing = np.empty((0, 2))
    prediction = shown.prediction
    if row is None or prediction is None:
        return nothing, False
    path = row.path if row.path is not None else int(prediction.winners[row.index])
    return (prediction.paths.outline(path) if path >= 0 else nothing), row.path is not None


def _posts_path(room: Room) -> QPainterPath:
    path = QPainterPath()
    for x, y, radius in room.posts:
        path.addEllipse(QRectF(x - radius, y - radius, 2 * radius, 2 * radius))
    return path


def _number() -> pg.TextItem:
    # beside the bounce, where the reading may lie
    item = pg.TextItem(color=PAPER, anchor=(-0.4, 1.3), fill=pg.mkBrush(CHOSEN))
    item.setFont(_small_font())
    item.setZValue(30)
    item.setVisible(False)
    return item


def _small_font() -> QFont:
    font = QFont()
    font.setPointSizeF(7.5)
    return font
