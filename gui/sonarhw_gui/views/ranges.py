"""The view "Ranges": measured and predicted range over heading, with the residuals below."""

import math
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QPointF, QRectF, Qt, Slot
from PySide6.QtGui import QColor, QFontMetrics, QPainterPath, QPolygonF, QResizeEvent
from PySide6.QtWidgets import QWidget
from sonarhw_compare.match import TOLERANCE, Kind

from sonarhw.readings import FloatArray
from sonarhw_gui.model.look import Class, Look, ViewLayer
from sonarhw_gui.model.scene import outline_ranges
from sonarhw_gui.model.shown import Cursor, Shown
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views import base
from sonarhw_gui.views.marks import (
    ABOVE_MARKS,
    NO_MARKS,
    NO_POSITIONS,
    Outline,
    OverlayMarks,
    Placed,
    ReadingMarks,
    Spots,
    reading_tip,
)

if TYPE_CHECKING:
    from sonarhw_compare.pictures import RangeShading

# Shading of the range view: ranges that the board may report, the more opaque, the more probable.


_BEHIND = -30  # z value, below grid, outline and marks
_LEAST = 0.01  # smaller opacities are not drawn


def _shade(image: pg.ImageItem, chances: "RangeShading", colour: str) -> None:
    """Draw probabilities over heading and range in one colour."""
    # heading 0 again at 360°, so that both ends of the axis are shaded
    opacities = np.vstack((chances.opacities, chances.opacities[:1]))
    opacities = np.where(opacities < _LEAST, 0.0, opacities)
    pixels = np.empty((*opacities.T.shape, 4), dtype=np.uint8)
    shade = QColor(colour)
    pixels[..., :3] = shade.red(), shade.green(), shade.blue()
    pixels[..., 3] = np.round(255 * opacities.T)
    image.setImage(pixels, autoLevels=False)
    step = 360.0 / len(chances.headings)
    image.setRect(QRectF(-step / 2, 0.0, 360.0 + step, chances.reach))


_MOST_RESIDUAL = 0.25  # m; a larger residual is an arrow at the edge
_BEYOND = 18  # pixels, size of an arrow; it covers the mark of its reading
_ARROW = (-0.1, -0.5), (0.1, -0.5), (0.1, -0.25), (0.36, -0.25), (0.0, 0.3), (-0.36, -0.25), (-0.1, -0.25)
_HEADINGS = -20.0, 380.0  # degrees, limits of the zoom
_LEAST_LINES = 8  # of text, least height
_WIDEST = "-000.0"  # tick value on a left axis
_ANY_DISTANCE = 1e6  # pixels: a click anywhere selects the nearest point


class RangeView(base.Canvas):
    """Draws ranges and residuals over heading."""

    entry = base.ViewEntry(
        "Ranges", picture_key="Ctrl+Alt+R", not_drawn=("trace", "threshold", "blanking", *base.NOT_IN_PLOTS)
    )

    def __init__(self) -> None:
        self.ranges, self.residuals = base.new_plot(), base.new_plot()
        self._shown: Shown | None = None
        self._low = False  # whether the axes are labelled with their units only
        super().__init__(self.ranges, self.residuals)
        self.gestures = base.Gestures(self)
        self._top = 0.0  # m, of the range axis
        self.residuals.setXLink(self.ranges)
        for plot in (self.ranges, self.residuals):
            plot.getAxis("bottom").setTickSpacing(90, 30)
            plot.setLimits(xMin=_HEADINGS[0], xMax=_HEADINGS[1])
        self.ranges.getAxis("bottom").setStyle(showValues=False)
        self.ci.layout.setRowStretchFactor(0, 3)
        self.ci.layout.setRowStretchFactor(1, 2)
        self.shading = pg.ImageItem(axisOrder="row-major")
        self.shading.setZValue(_BEHIND)
        self.shading.setVisible(False)
        self.ranges.addItem(self.shading, ignoreBounds=True)
        self.outline = Outline()
        self.ranges.addItem(self.outline)
        self._tolerance = self._add_tolerance()
        self.marks = tuple(ReadingMarks(plot, self._tip) for plot in (self.ranges, self.residuals))
        self.overlays = OverlayMarks(self.ranges)
        self.beyond = {
            Kind.SHORT: self._add_arrows(1),
            Kind.LONG: self._add_arrows(-1),
        }  # arrows at the ends of the scale
        self._chosen = [self._add_line(plot, 90) for plot in (self.ranges, self.residuals)]
        self._pointer = [self._add_line(plot, 90) for plot in (self.ranges, self.residuals)]
        self._pointer.append(self._add_line(self.ranges, 0))
        self.clicked.connect(self._click)
        self.menu_pressed.connect(self._pick_for_menu)
        self.hovered.connect(self._move)
        self.fit()

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        self.repaint_whole()
        if shown.changed_since(before, lambda new: (new.look,)):
            self._set_look(shown.look)
        if shown.changed_since(before, lambda new: (new.outline,)):
            self._draw_outline(shown)
        if shown.chances is not None and shown.changed_since(before, lambda new: (new.chances, new.look)):
            _shade(self.shading, shown.chances, shown.look.palette.predicted)
        self.outline.setVisible(shown.draws(ViewLayer.PREDICTED))
        self.shading.setVisible(shown.chances is not None and shown.draws(ViewLayer.PREDICTED))
        if not shown.same_readings(before):
            self.marks[0].draw(_ranges(shown))
            self.marks[1].draw(_residuals(shown))
            self._draw_beyond(shown)
        if shown.changed_since(before, lambda new: (new.notes,)) or not shown.same_readings(before):
            self.marks[0].draw_notes(shown.notes)
        if shown.changed_since(before, lambda new: (new.overlays,)):
            visible = [scan for scan in shown.overlays if scan.visible]
            self.overlays.draw(
                {scan.style: _over_heading(scan.series.headings, scan.series.ranges) for scan in visible}
            )
        self._extend_range_axis(shown)
        for marks in self.marks:
            marks.ring(shown.chosen)
        for line in self._chosen:
            line.setVisible(shown.chosen is not None)
            if shown.chosen is not None:
                line.setValue(math.degrees(shown.heading(shown.chosen)) % 360)
        self._point(shown.cursor)

    def fit(self) -> None:
        """Show all headings, ranges and residuals on the scale."""
        self.ranges.setXRange(0, 360, padding=0.01)
        self.residuals.setYRange(-_MOST_RESIDUAL, _MOST_RESIDUAL, padding=0.08)
        self._top = 0.0
        if self._shown is not None:
            self._extend_range_axis(self._shown)

    def picture(self) -> QWidget:
        """Return both plots."""
        return self

    def _extend_range_axis(self, shown: Shown) -> None:
        """Fit the range axis to what is drawn, if anything. A small change keeps it, so that it does not jump."""
        drawn = [float(np.max(points.ranges)) for points in shown.classes.values()]
        if shown.outline is not None and not np.isnan(shown.outline.ranges).all():
            drawn.append(float(np.nanmax(shown.outline.ranges)))
        if shown.chances is not None:
            drawn.append(shown.chances.reach)
        most = max(drawn, default=self._top or 1.0)
        if not 0.5 * self._top < most <= self._top:
            self._top = 1.15 * most
            self.ranges.setYRange(0.0, self._top, padding=0.05)

    def _set_look(self, look: Look) -> None:
        self.set_look(look)
        metrics = QFontMetrics(text_font(look, 0.9))
        for plot in (self.ranges, self.residuals):
            # the same for both plots, to align them
            plot.getAxis("left").setWidth(metrics.horizontalAdvance(_WIDEST) + metrics.height() + 8)
        self._style_residuals(look)
        self._label_axes(look)
        self.setMinimumHeight(_LEAST_LINES * metrics.height())
        for marks in self.marks:
            marks.set_look(look)
        self.overlays.set_look(look)
        self.outline.set_look(look)
        for kind, arrows in self.beyond.items():
            arrows.setPen(base.cosmetic_pen(look.palette.paper, width=1))
            arrows.setBrush(look.palette.of(kind))
        for line in self._chosen:
            line.setPen(base.cosmetic_pen(look.palette.chosen, width=1, style=Qt.PenStyle.DotLine))
        for line in self._pointer:
            line.setPen(base.cosmetic_pen(look.palette.ink, width=1))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Shorten the labels of the axes in a low view."""
        if self._shown is not None and self._low != self._is_low(self._shown.look):
            self._label_axes(self._shown.look)  # first, because the plots get no less than their least heights
        super().resizeEvent(event)

    def _is_low(self, look: Look) -> bool:
        """Return whether the labels of the axes do not fit."""
        height: int = self.height()  # pyqtgraph has no types
        return height < sum(_heights(look)) + 2 * QFontMetrics(text_font(look, 0.9)).height()

    def _label_axes(self, look: Look) -> None:
        """Label the axes; in a low view, only with their units."""
        self._low = self._is_low(look)
        for plot, height in zip((self.ranges, self.residuals), _heights(look), strict=True):
            plot.setMinimumHeight(0 if self._low else height)
        unit, axis = look.unit.small, self.residuals.getAxis("left")
        axis.setScale(unit.per_metre)
        base.label_axis(axis, unit.label if self._low else f"residual ({unit.label})")
        base.label_length(self.ranges.getAxis("left"), "range", look)
        if self._low:
            base.label_axis(self.ranges.getAxis("left"), look.unit.label)
        base.label_axis(self.residuals.getAxis("bottom"), "" if self._low else "heading in the room (°)")

    def _style_residuals(self, look: Look) -> None:
        unit = look.unit.small
        edge = f"{_MOST_RESIDUAL * unit.per_metre:.3g} {unit.label}"
        self.residuals.setToolTip(f"measured minus predicted; a residual beyond ±{edge} is an arrow at the edge")
        self._tolerance.setBrush(look.palette.tolerance)
        for line in self._tolerance.lines:
            line.setPen(base.cosmetic_pen(look.palette.tolerance))

    def _add_tolerance(self) -> pg.LinearRegionItem:
        band = pg.LinearRegionItem((-TOLERANCE, TOLERANCE), orientation="horizontal", movable=False)
        band.setZValue(-20)
        self.residuals.addItem(band, ignoreBounds=True)
        return band

    def _add_arrows(self, down: int) -> Spots:
        polygon = QPolygonF([QPointF(x, down * y) for x, y in _ARROW])
        arrow = QPainterPath()
        arrow.addPolygon(polygon)
        arrow.closeSubpath()
        arrows = Spots(size=_BEYOND, symbol=arrow)
        arrows.setZValue(ABOVE_MARKS)
        self.residuals.addItem(arrows, ignoreBounds=True)
        return arrows

    def _draw_beyond(self, shown: Shown) -> None:
        residuals = shown.rows.residuals
        for kind, arrows in self.beyond.items():
            points, places = self.marks[1].placed.get(kind, NO_MARKS)
            beyond = np.abs(residuals[list(points.readings)]) > _MOST_RESIDUAL
            arrows.setVisible(bool(beyond.any()))
            arrows.setData(*places[beyond].T)

    def _add_line(self, plot: pg.PlotItem, angle: float) -> pg.InfiniteLine:
        line = pg.InfiniteLine(angle=angle)
        line.setVisible(False)
        plot.addItem(line, ignoreBounds=True)
        return line

    def _draw_outline(self, shown: Shown) -> None:
        if shown.outline is None:
            self.outline.draw(NO_POSITIONS)
            return
        headings, ranges = outline_ranges(shown.outline).T
        self.outline.draw(np.column_stack((np.degrees(headings), ranges)))

    def _tip(self, index: int) -> str:
        return reading_tip(self._shown, index) if self._shown else ""

    def _click(self, event: MouseClickEvent) -> None:
        if self._shown is None:
            return
        index = self._under(event.scenePos())
        if index is not None:
            event.accept()
            self.gestures.picked.emit(index)

    @Slot(object)
    def _pick_for_menu(self, position: QPointF) -> None:
        index = self._under(position, base.PICK_DISTANCE)
        if index is not None:
            self.gestures.picked.emit(index)

    def _move(self, place: QPointF | None) -> None:
        """Link the cursor of all views; over the residuals, use the range of the nearest reading."""
        for plot in (self.ranges, self.residuals):
            if place is not None and self._shown is not None and plot.vb.sceneBoundingRect().contains(place):
                point = plot.vb.mapSceneToView(place)
                far = point.y() if plot is self.ranges else self._range_near(point.x())
                self.gestures.pointed.emit(Cursor(math.radians(point.x()), max(far, 0.0)))
                return
        self.gestures.pointed.emit(None)

    def _range_near(self, heading: float) -> float:
        """Return the range, m, of the reading nearest to a heading, degrees; 0 without readings."""
        near, far = math.inf, 0.0
        for _, places in self.marks[0].placed.values():
            away = np.abs((places[:, 0] - heading + 180) % 360 - 180)
            k = int(np.argmin(away))
            if away[k] < near:
                near, far = float(away[k]), float(places[k, 1])
        return far

    def _point(self, cursor: Cursor | None) -> None:
        for line in self._pointer:
            line.setVisible(cursor is not None)
        if cursor is not None:
            heading = math.degrees(cursor.heading) % 360
            for line, value in zip(self._pointer, (heading, heading, cursor.range), strict=True):
                line.setValue(value)

    def _under(self, click: QPointF, within: float = _ANY_DISTANCE) -> int | None:
        for plot, marks in zip((self.ranges, self.residuals), self.marks, strict=True):
            if plot.sceneBoundingRect().contains(click):
                return base.nearest_reading(plot.vb, marks.placed, click, within)
        return None


def _over_heading(headings: FloatArray, values: FloatArray) -> FloatArray:
    return np.column_stack((np.degrees(headings) % 360, values))


def _heights(look: Look) -> tuple[int, int]:
    """Return the heights that the labels of the two left axes need, pixels."""
    metrics = QFontMetrics(text_font(look, 0.9))
    upper = metrics.horizontalAdvance("range (m)") + 8
    return upper, metrics.horizontalAdvance("residual (mm)") + 3 * metrics.height()


def _ranges(shown: Shown) -> dict[Class, Placed]:
    return {kind: (points, _over_heading(points.headings, points.ranges)) for kind, points in shown.classes.items()}


def _residuals(shown: Shown) -> dict[Class, Placed]:
    """Return measured minus predicted, m, of readings that have both, clipped to the scale."""
    placed: dict[Class, Placed] = {}
    residuals = np.clip(shown.rows.residuals, -_MOST_RESIDUAL, _MOST_RESIDUAL)
    for kind in (Kind.MATCH, Kind.SHORT, Kind.LONG):
        points = shown.classes.get(kind)
        if points is not None:
            placed[kind] = points, _over_heading(points.headings, residuals[list(points.readings)])
    return placed
