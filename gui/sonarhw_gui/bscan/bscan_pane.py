"""One pane of the B-scan: an image with axes, colour bar, blanking and cursor; a polar image also has the walls.

Coordinates of a flat image are degrees and metres, those of a polar image metres.
"""

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from sonarhw_compare.pictures import RangeCells
from sonarhw_sim.air import Air
from sonarhw_sim.predict.predicted_scan import arm

from sonarhw.readings import FloatArray
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import ViewLayer
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.plots.canvas import new_plot
from sonarhw_gui.plots.plot_look import cosmetic_pen, label_axis, label_length, style_plot
from sonarhw_gui.scene.plan_geometry import wall_lines
from sonarhw_gui.shown.shown import Cursor, Shown
from sonarhw_gui.work.bscan_picture import Arm, BScans, ColourScale, Pane, flat_area, polar_area

_FIGURES = 48  # pixels for tick values and label of an axis at the default text size
_BAR = 16  # pixels, width of the colour bar with its frame
_BESIDE = 6  # pixels between image and colour bar
_RING, _HALO = (11, 1.5), (11, 4.5)  # pixels, size and line width of the cursor and of its contrasting border
_MARGIN = 0.02  # around a polar image, share of its width
_HEADINGS = -20.0, 380.0  # degrees, limits of the zoom of a flat image
_ROUND = np.linspace(0.0, math.tau, 181)


class BScanPane:
    """Image, axes and lines of one pane."""

    def __init__(self, kind: Pane) -> None:
        self.kind = kind
        self.plot = new_plot()
        self._ground, self._blanking = pg.PlotCurveItem(fillLevel="enclosed"), pg.PlotCurveItem()
        self._image = pg.ImageItem(axisOrder="row-major")
        self._walls = pg.PlotCurveItem(connect="pairs")
        self._chosen, self._cursor = pg.PlotCurveItem(), pg.ScatterPlotItem(symbol="o", brush=None)
        self._bar = pg.ColorBarItem(values=(0, 1), colorMap="cividis", width=12, interactive=False)
        self.plot.layout.addItem(self._bar, 2, 5)
        self.plot.layout.setColumnFixedWidth(4, _BESIDE)
        for item in (self._ground, self._image, self._walls, self._blanking, self._chosen, self._cursor):
            self.plot.addItem(item, ignoreBounds=True)
        self._scale: ColourScale | None = None
        self._polar, self._lowest = False, True
        self._look = Look()
        self._cells = RangeCells(1.0, 1)
        self._middle, self._arm = (0.0, 0.0), Arm()

    def set_look(self, look: Look) -> None:
        """Use the colours, unit and text size of `look`."""
        self._look = look
        colours = look.palette
        style_plot(self.plot, look, grid=False)
        self._ground.setBrush(colours.blanking)
        self._ground.setPen(None)
        self._walls.setPen(cosmetic_pen(colours.wall, width=1))
        self._walls.setShadowPen(cosmetic_pen(colours.paper, width=2.5))
        self._blanking.setPen(cosmetic_pen(colours.threshold, width=1, style=Qt.PenStyle.DashLine))
        self._chosen.setPen(cosmetic_pen(colours.chosen, width=1, style=Qt.PenStyle.DashLine))
        self._chosen.setShadowPen(cosmetic_pen(colours.paper, width=2.5))
        self._scale = None
        self.plot.layout.setColumnFixedWidth(5, _BAR + round(_FIGURES * look.scale))
        self._label()

    def set_axes(self, polar: bool, pane_count: int, lowest: bool) -> None:
        """Set the axes for a polar or a flat image. The pane has a title if there are several panes.

        If there are several flat panes, only the lowest one labels the heading axis.
        """
        self._polar, self._lowest = polar, lowest
        title = self.kind.value if pane_count > 1 else None
        self.plot.setTitle(title, color=self._look.palette.ink, size=f"{10 * self._look.scale:.1f}pt")
        self.plot.setAspectLocked(polar)
        low, high = (None, None) if polar else _HEADINGS
        self.plot.setLimits(xMin=low, xMax=high)
        self._image.clear()
        self._label()

    def fit(self, limit: float | None = None) -> QRectF:
        """Show the image up to a range, m, and return its area; None shows all of it."""
        cells = self._cells if limit is None else RangeCells(min(limit, self._cells.reach), 1)
        area = QRectF(*self._area(cells))
        beside = _MARGIN * area.width() if self._polar else 0.0
        area.adjust(-beside, -beside, beside, beside)
        self.plot.vb.setRange(area, padding=0)
        return area

    def draw(self, bscan: BScans, shown: Shown) -> None:
        """Draw the picture, the walls and the blanking line."""
        picture, self._cells = bscan.pictures[self.kind], bscan.rows.cells
        self._middle, self._arm = shown.scene.pose.position, Arm(*arm(shown.scene.board))
        area = QRectF(*self._area(self._cells))
        self._image.setImage(picture.pixels, autoLevels=False, levels=None)
        self._image.setRect(area)
        self._ground.setData(*self._at_range(self._cells.reach, closed=True).T)
        self._blanking.setData(*self._at_range(_blanked(shown)).T)
        room = shown.scene.room
        self._walls.setVisible(self._polar)
        self._walls.setData(*(wall_lines(room) if room else np.empty((0, 2))).T)
        if self._scale is not picture.scale:
            self._scale = picture.scale
            self._draw_bar(picture.scale)

    def point(self, shown: Shown) -> None:
        """Draw the selected heading and the linked cursor, and show or hide the blanking line."""
        self._blanking.setVisible(shown.draws(ViewLayer.BLANKING))
        lines = np.empty((0, 2))
        if shown.chosen is not None:
            heading = shown.heading(shown.chosen)
            lines = self._plot_points(np.full(2, heading), np.array([0.0, self._cells.reach]))
        self._chosen.setData(*lines.T)
        cursor = shown.cursor
        if cursor is None or not 0 <= cursor.range <= self._cells.reach:
            self._cursor.clear()
        else:
            colours = self._look.palette
            ((x, y),) = self._plot_points(np.array([cursor.heading]), np.array([cursor.range]))
            pens = [
                cosmetic_pen(colour, width=line)
                for colour, (_, line) in ((colours.paper, _HALO), (colours.chosen, _RING))
            ]
            self._cursor.setData([x, x], [y, y], size=[_HALO[0], _RING[0]], pen=pens)

    def cursor_at(self, position: QPointF) -> Cursor | None:
        """Return heading and range at a point in scene coordinates; None outside the image."""
        if not self.plot.vb.sceneBoundingRect().contains(position):
            return None
        at = self.plot.vb.mapSceneToView(position)
        if self._polar:
            heading, away = self._arm.headings_and_ranges(
                np.array(at.x() - self._middle[0]), np.array(at.y() - self._middle[1])
            )
            cursor = Cursor(float(heading) % math.tau, float(away))
        else:
            cursor = Cursor(math.radians(at.x()) % math.tau, at.y())
        return cursor if 0 <= cursor.range <= self._cells.reach else None

    def _area(self, cells: RangeCells) -> tuple[float, float, float, float]:
        return polar_area(cells, self._middle, self._arm) if self._polar else flat_area(cells)

    def _plot_points(self, headings: FloatArray, ranges: FloatArray) -> FloatArray:
        """Return plot coordinates, (n, 2) float, of headings (rad) and ranges (m)."""
        if self._polar:
            return self._arm.points(headings, ranges) + self._middle
        return np.column_stack((np.degrees(headings) % 360, ranges))

    def _at_range(self, distance: float, closed: bool = False) -> FloatArray:
        """Return a line at one range, or, if `closed`, the outline of the area within it."""
        if self._polar:
            return self._plot_points(_ROUND, np.full(len(_ROUND), distance))
        left, _, width, _ = flat_area(self._cells)
        ends = [(left, distance), (left + width, distance)]
        return np.array([*ends, (left + width, 0.0), (left, 0.0)] if closed else ends)

    def _label(self) -> None:
        bottom, left = self.plot.getAxis("bottom"), self.plot.getAxis("left")
        left.setWidth(round(_FIGURES * self._look.scale))  # the same in all panes, so that linked plots are aligned
        if self._polar:
            label_length(bottom, "x", self._look)
            label_length(left, "y", self._look)
            bottom.setTickSpacing()
        else:
            bottom.setScale(1.0)
            bottom.setTickSpacing(90, 30)
            label_axis(bottom, "heading in the room (°)")
            label_length(left, "range", self._look)
            bottom.showLabel(self._lowest)

    def _draw_bar(self, scale: ColourScale) -> None:
        colours = self._look.palette
        self._bar.setColorMap(pg.ColorMap(None, scale.colours[:, :3]))
        self._bar.setLevels((scale.low, scale.high))
        axis = self._bar.axis
        for set_pen in (axis.setPen, axis.setTextPen):
            set_pen(colours.ink)
        font = text_font(self._look, 0.9)
        axis.setStyle(tickFont=font)
        axis.label.setFont(font)
        axis.setWidth(round(_FIGURES * self._look.scale))
        axis.setLabel(scale.label, color=colours.ink)


def _blanked(shown: Shown) -> float:
    """Return the range below which blanking suppresses echoes, m."""
    room = shown.scene.room
    return shown.scene.board.blanked_range(room.air if room else Air())
