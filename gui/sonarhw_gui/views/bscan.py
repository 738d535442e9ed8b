"""The view "B-scan": heading by range as an image, measured, predicted and their difference, flat or polar.

`work/bscan_picture.py` computes the images in a worker thread; this view displays them.
"""

import math
from functools import partial
from weakref import ref

import numpy as np
import pyqtgraph as pg
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6.QtCore import QMargins, QPointF, QRectF, Qt, Slot
from PySide6.QtGui import QActionGroup, QHideEvent, QShowEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget
from sonarhw_compare.pictures import RangeCells
from sonarhw_sim.air import Air
from sonarhw_sim.predict.predicted_scan import arm

from sonarhw.errors import heading_text
from sonarhw.readings import FloatArray
from sonarhw_gui.jobs.traces import Arm, BScans, BScanSettings, ColourScale, Pane, flat_area, polar_area
from sonarhw_gui.model.look import Look, ViewLayer
from sonarhw_gui.model.scene import wall_lines
from sonarhw_gui.model.shown import Cursor, Shown, initial_range
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views import base
from sonarhw_gui.widgets import ElidedLabel, FlowLayout, arranged

# One pane of the B-scan: an image with axes, colour bar, blanking and cursor; a polar image also has the walls.
#
# Coordinates of a flat image are degrees and metres, those of a polar image metres.


_FIGURES = 48  # pixels for tick values and label of an axis at the default text size
_BAR = 16  # pixels, width of the colour bar with its frame
_BESIDE = 6  # pixels between image and colour bar
_RING, _HALO = (11, 1.5), (11, 4.5)  # pixels, size and line width of the cursor and of its contrasting border
_MARGIN = 0.02  # around a polar image, share of its width
_AROUND_ROOM = 0.25  # of its larger side
_HEADINGS = -20.0, 380.0  # degrees, limits of the zoom of a flat image
_ROUND = np.linspace(0.0, math.tau, 181)


class BScanPane:
    """Image, axes and lines of one pane."""

    def __init__(self, kind: Pane) -> None:
        self.kind = kind
        self.plot = base.new_plot()
        self._ground, self._blanking = pg.PlotCurveItem(fillLevel="enclosed"), pg.PlotCurveItem()
        self._image = pg.ImageItem(axisOrder="row-major")
        self._walls = pg.PlotCurveItem(connect="pairs")
        self._chosen, self.cursor = pg.PlotCurveItem(), pg.ScatterPlotItem(symbol="o", brush=None)
        self._bar = pg.ColorBarItem(values=(0, 1), colorMap="cividis", width=12, interactive=False)
        self.plot.layout.addItem(self._bar, 2, 5)
        self.plot.layout.setColumnFixedWidth(4, _BESIDE)
        for item in (self._ground, self._image, self._walls, self._blanking, self._chosen, self.cursor):
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
        base.style_plot(self.plot, look, grid=False)
        self._ground.setBrush(colours.blanking)
        self._ground.setPen(None)
        self._walls.setPen(base.cosmetic_pen(colours.wall, width=1))
        self._walls.setShadowPen(base.cosmetic_pen(colours.paper, width=2.5))
        self._blanking.setPen(base.cosmetic_pen(colours.threshold, width=1, style=Qt.PenStyle.DashLine))
        self._chosen.setPen(base.cosmetic_pen(colours.chosen, width=1, style=Qt.PenStyle.DashLine))
        self._chosen.setShadowPen(base.cosmetic_pen(colours.paper, width=2.5))
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
        (pixels, scale), self._cells = bscan.pictures[self.kind], bscan.rows.cells
        self._middle, self._arm = shown.scene.pose.position, Arm(*arm(shown.scene.board))
        area = QRectF(*self._area(self._cells))
        self._image.setImage(pixels, autoLevels=False, levels=None)
        self._image.setRect(area)
        self._ground.setData(*self._at_range(self._cells.reach, closed=True).T)
        self._blanking.setData(*self._at_range(_blanked(shown)).T)
        room = shown.scene.room
        self._walls.setVisible(self._polar)
        self._walls.setData(*(wall_lines(room) if room else np.empty((0, 2))).T)
        if self._scale is not scale:
            self._scale = scale
            self._draw_bar(scale)

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
            self.cursor.clear()
        else:
            colours = self._look.palette
            ((x, y),) = self._plot_points(np.array([cursor.heading]), np.array([cursor.range]))
            pens = [
                base.cosmetic_pen(colour, width=line)
                for colour, (_, line) in ((colours.paper, _HALO), (colours.chosen, _RING))
            ]
            self.cursor.setData([x, x], [y, y], size=[_HALO[0], _RING[0]], pen=pens)

    def cursor_at(self, position: QPointF) -> Cursor | None:
        """Return heading and range at a point in scene coordinates; None outside the image."""
        if not self.plot.vb.sceneBoundingRect().contains(position):
            return None
        point = self.plot.vb.mapSceneToView(position)
        if self._polar:
            heading, away = self._arm.headings_and_ranges(
                np.array(point.x() - self._middle[0]), np.array(point.y() - self._middle[1])
            )
            cursor = Cursor(float(heading) % math.tau, float(away))
        else:
            cursor = Cursor(math.radians(point.x()) % math.tau, point.y())
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
            base.label_length(bottom, "x", self._look)
            base.label_length(left, "y", self._look)
            bottom.setTickSpacing()
        else:
            bottom.setScale(1.0)
            bottom.setTickSpacing(90, 30)
            base.label_axis(bottom, "heading in the room (°)")
            base.label_length(left, "range", self._look)
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


_CHOICES = (
    ("Recorded", "F2", (Pane.MEASURED,), "Traces of the scan"),
    ("Predicted", "F3", (Pane.PREDICTED,), "Traces that the model predicts"),
    ("Difference", "F4", (Pane.DIFFERENCE,), "Recorded minus predicted"),
    ("All three", "Shift+F4", tuple(Pane), "Recorded, predicted and difference, with common pan and zoom"),
)


class BScanView(QWidget):
    """Draws the traces of all headings as images."""

    entry = base.ViewEntry(
        "B-scan",
        "Heading by range as an image",
        key="3",
        menu="Trace",
        not_drawn=("trace", "threshold", *base.NOT_IN_PLOTS),
    )

    def __init__(self) -> None:
        super().__init__()
        self.gestures = base.Gestures(self)
        self._shown: Shown | None = None
        self._drawn: ref[BScans] | None = None
        self._laid_out: BScanSettings | None = None
        self._zoomed = False  # whether the zoom was set for these images
        self._cells: RangeCells | None = None
        self._frame: QRectF | None = None  # what is visible at least; more where a pane has other proportions
        self.choices = QActionGroup(self)
        for name, key, panes, tip in _CHOICES:
            choice = base.view_action(self, name, key, tip)
            choice.setData(panes)
            self.choices.addAction(choice)
        self.choices.actions()[0].setChecked(True)
        self._settled = False  # whether there were readings, or the user has chosen
        self.polar = base.view_action(self, "Polar", "O", "Polar, over the room; off: heading by range")
        self.decibels = base.view_action(self, "dB", "B", "Levels in dB of full scale; off: linear")
        self.decibels.setChecked(True)
        self.note = ElidedLabel()
        self.canvas = base.Canvas()
        self.panes: dict[Pane, BScanPane] = {}  # each is created when first visible
        self._arrange()
        self._connect()

    @property
    def settings(self) -> BScanSettings:
        """The selected panes, coordinates and scale."""
        return BScanSettings(self.choices.checkedAction().data(), self.polar.isChecked(), self.decibels.isChecked())

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call."""
        before, self._shown = self._shown, shown
        if shown.changed_since(before, lambda new: (new.look,)):
            self.canvas.set_look(shown.look)
            for pane in self.panes.values():
                pane.set_look(shown.look)
            self._make_panes(shown.look)
            self._lay_out()
            self._drawn = None
        if self.isVisible():
            self._choose_pane(shown)
            self._draw(shown)

    @Slot()
    def fit(self) -> None:
        """Show all of the images."""
        self._fit(None)

    def _fit(self, limit: float | None) -> None:
        for kind in self.settings.panes:
            if kind in self.panes:
                self._frame = self.panes[kind].fit(limit)

    def _zoom_to_room(self, shown: Shown) -> None:
        """Show polar images around the room; echoes by several reflections are farther away than its walls."""
        room = shown.scene.room
        if not self.settings.polar or room is None or not len(room.walls):
            return
        (left, bottom), (right, top) = (find(room.walls.reshape(-1, 2), axis=0).tolist() for find in (np.min, np.max))
        area = QRectF(left, bottom, right - left, top - bottom)
        around = _AROUND_ROOM * max(area.width(), area.height())
        self._frame = area.adjusted(-around, -around, around, around)
        self.panes[self.settings.panes[0]].plot.vb.setRange(self._frame, padding=0)

    def _keep_frame(self, pane: BScanPane, *_: object) -> None:
        """Remember what the user has zoomed to."""
        self._frame = pane.plot.vb.viewRect()

    def showEvent(self, event: QShowEvent) -> None:
        """Request the images, now that the view is visible."""
        if self._shown is None or not self._choose_pane(self._shown):
            self.gestures.bscan_requested.emit(self.settings)
        if self._shown is not None:
            self._draw(self._shown)

    def hideEvent(self, event: QHideEvent) -> None:
        """Cancel the request; hidden images are not computed."""
        self.gestures.bscan_requested.emit(None)

    def picture(self) -> QWidget:
        """Return the images with their buttons."""
        return self

    def _arrange(self) -> None:
        bar = QWidget()
        base.add_buttons(
            FlowLayout(bar, QMargins(8, 4, 8, 2), gap=3), (*self.choices.actions(), self.polar, self.decibels)
        )
        self.note.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.note.setContentsMargins(8, 0, 8, 2)
        arranged(QVBoxLayout(self), bar, self.canvas, self.note, rest=self.canvas)

    def _connect(self) -> None:
        self.choices.triggered.connect(self._settle)
        for chosen in (self.choices, self.polar, self.decibels):
            chosen.triggered.connect(self._request_bscan)
        self.canvas.clicked.connect(self._click)
        self.canvas.hovered.connect(self._point_at)

    @Slot()
    def _settle(self) -> None:
        self._settled = True

    def _choose_pane(self, shown: Shown) -> bool:
        """Show the prediction of a room until there are readings or the user chooses; return whether that is new."""
        if self._settled:
            return False
        self._settled = bool(shown.readings)
        recorded, predicted, *_ = self.choices.actions()
        choice = predicted if shown.scene.room is not None and not shown.readings else recorded
        if choice.isChecked():
            return False
        choice.setChecked(True)
        self._request_bscan()
        return True

    @Slot()
    def _request_bscan(self) -> None:
        if self._shown is not None:
            self._make_panes(self._shown.look)
            self._lay_out()
        self._drawn = None
        self.gestures.bscan_requested.emit(self.settings)

    def _make_panes(self, look: Look) -> None:
        for kind in self.settings.panes:
            if kind not in self.panes:
                self.panes[kind] = pane = BScanPane(kind)
                pane.set_look(look)
                pane.plot.vb.sigRangeChangedManually.connect(partial(self._keep_frame, pane))

    def _lay_out(self) -> None:
        """Arrange flat images in one column and polar images in two, with common pan and zoom."""
        settings, before = self.settings, self._laid_out
        first = self.panes[settings.panes[0]]
        if before is None or before.polar != settings.polar:
            self._zoomed, self._frame = False, None
        self._laid_out = settings
        self.canvas.clear()
        for number, kind in enumerate(settings.panes):
            pane = self.panes[kind]
            row, column = divmod(number, 2 if settings.polar else 1)
            self.canvas.addItem(pane.plot, row=row, col=column)
            pane.set_axes(settings.polar, len(settings.panes), kind is settings.panes[-1])
            pane.plot.setXLink(None if pane is first else first.plot)
            pane.plot.setYLink(None if pane is first else first.plot)
        if self._frame is not None:
            self.canvas.ci.layout.activate()  # the new size decides how much is visible around the frame
            first.plot.vb.setRange(self._frame, padding=0)

    def _draw(self, shown: Shown) -> None:
        bscan = shown.bscan
        if bscan is not None and bscan.settings == self.settings and shown.bscan_ref is not self._drawn:
            for kind in bscan.settings.panes:
                self.panes[kind].draw(bscan, shown)
            if not self._zoomed or self._cells != bscan.rows.cells:
                self._zoomed, self._cells = True, bscan.rows.cells
                self._fit(initial_range(shown))
                self._zoom_to_room(shown)
            self._drawn = shown.bscan_ref
        self.note.setText(_cursor_text(bscan, shown) or _note(bscan, self.settings, bool(shown.readings)))
        for kind in self.settings.panes:
            self.panes[kind].point(shown)

    def _click(self, event: MouseClickEvent) -> None:
        place = self._cursor_under(event.scenePos())
        if self._shown is None or place is None:
            return
        index = base.reading_towards(self._shown, place.heading)
        if index is not None:
            event.accept()
            self.gestures.picked.emit(index)

    @Slot(object)
    def _point_at(self, position: QPointF | None) -> None:
        self.gestures.pointed.emit(None if position is None else self._cursor_under(position))

    def _cursor_under(self, position: QPointF) -> Cursor | None:
        for kind in self.settings.panes:
            place = self.panes[kind].cursor_at(position)
            if place is not None:
                return place
        return None


def _cursor_text(bscan: BScans | None, shown: Shown) -> str:
    """Return measured and predicted level at the cursor; empty without a cursor."""
    cursor = shown.cursor
    if bscan is None or cursor is None:
        return ""
    texts = [f"{heading_text(cursor.heading)}, {shown.look.unit.text(cursor.range)}:"]
    for name, image in ((shown.origin.value, bscan.measured), ("predicted", bscan.predicted)):
        level = image.level_at(cursor.heading, cursor.range)
        if level is not None:
            texts.append(f"{name} {_decibels(level)}")
    return "  ".join(texts) if len(texts) > 1 else ""


def _decibels(level: float) -> str:
    return f"{20 * math.log10(level):.0f} dB".replace("-", "−") if level > 0 else "silent"


def _note(bscan: BScans | None, settings: BScanSettings, scanned: bool) -> str:
    if bscan is None:
        return "computing …"
    notes = []
    if Pane.MEASURED in settings.panes and not scanned:
        notes.append("no readings")
    elif Pane.MEASURED in settings.panes and not bscan.rows.traced and len(bscan.measured.headings):
        notes.append("no traces recorded: marks show the reported ranges, without a level")
    if Pane.DIFFERENCE in settings.panes and not bscan.rows.traced:
        notes.append("no difference: it needs recorded traces")
    if bscan.rows.outline is None:
        notes.append("no prediction")
    if bscan.rows.done < 1:
        notes.append(f"{bscan.rows.done:.0%} computed")
    return " · ".join(notes)
