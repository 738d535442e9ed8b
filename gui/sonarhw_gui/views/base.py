"""What all views share: the `View` protocol, plot axes, picking, actions and pictures."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar, cast, runtime_checkable

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from pyqtgraph.GraphicsScene.mouseEvents import MouseClickEvent
from PySide6 import QtWidgets
from PySide6.QtCore import (
    QBuffer,
    QEvent,
    QIODevice,
    QMarginsF,
    QObject,
    QPoint,
    QPointF,
    QRect,
    QRectF,
    QSize,
    QSizeF,
    Qt,
    Signal,
    Slot,
)
from PySide6.QtGui import (
    QAction,
    QBrush,
    QColor,
    QGuiApplication,
    QImage,
    QKeySequence,
    QMouseEvent,
    QPageSize,
    QPainter,
    QPdfWriter,
    QPen,
)
from PySide6.QtSvg import QSvgGenerator

from sonarhw.readings import FloatArray, angle_difference
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.shown import ClassPoints, Shown, bounces_text
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.views.legend import Legend
from sonarhw_gui.widgets import PlainLabel

# The `View` protocol: the interface between the window and a widget that draws readings and their prediction.
#
# `window/views.py` lists all views, one line each. No other module names them.

_Item = TypeVar("_Item", bound=QtWidgets.QGraphicsItem)


@dataclass(frozen=True)
class ViewEntry:
    """How commands, menus and file names list a view."""

    name: str
    tip: str = ""  # tooltip of the command that shows the view
    key: str = ""  # key that shows the view; large views only
    picture_key: str = ""  # key that saves a picture of the view; small views only
    menu: str = ""  # menu of its actions; the view of the same name comes first in it
    is_text: bool = False  # whether it is updated only ten times a second during a scan
    width: float = 0.54  # share of the width that a large view gets at first
    not_drawn: tuple[str, ...] = ()  # names of the legend that a picture of the view does not explain


NOT_IN_PLOTS = "rays", "beam", "wall", "sensor", "newest", "turntable zero", "pointer"  # but in plans
NOT_IN_PLANS = "trace", "threshold", "blanking", "pointer"


class Gestures(QObject):
    """User actions in a view. The window connects all of them with the session."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor, or None when the mouse points at nothing
    edited = Signal(object, str, object)  # Scene, label for Undo, gesture or None; edits of one gesture are one step
    cancelled = Signal(object)  # the gesture whose edits are undone
    surface_chosen = Signal(object)  # name of a wall or post, or None
    switched = Signal(object, bool)  # a class or layer, and whether it becomes visible
    asked = Signal(float)  # a heading to explain without a reading, rad in the room
    turned_question = Signal(float)  # angle by which to turn the asked heading, rad
    path_pointed = Signal(object)  # row of a path of `Shown.question`, or None
    bscan_requested = Signal(object)  # BScanSettings, or None while no B-scan is visible


@runtime_checkable
class View(Protocol):
    """A widget that draws a `Shown`. Every method is called in the window's thread."""

    entry: ViewEntry
    gestures: Gestures

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call. Called only while the view is visible."""

    def fit(self) -> None:
        """Reset the range of its plots."""

    def picture(self) -> QtWidgets.QWidget | None:
        """Return the widget to save as a picture, or None if this view has no picture."""

    def actions(self) -> Sequence[QAction]:
        """Return the commands of this view, for the menus. Implemented by QWidget."""

    def isVisibleTo(self, ancestor: QtWidgets.QWidget) -> bool:
        """Return whether it is visible when `ancestor` is. Implemented by QWidget."""


# Appearance of plots: axes, grid and labels in the palette, unit and text size of a look.
#
# Plot coordinates stay in metres; only the tick values of the axes use the unit.


_AXES = ("left", "bottom", "right", "top")
# tick values and grid take a third of a repaint, and change only with the zoom
_CACHED = QtWidgets.QGraphicsItem.CacheMode.DeviceCoordinateCache


class PlotAxis(pg.AxisItem):  # type: ignore[misc]  # pyqtgraph has no types
    """An axis that computes its area only when it may have changed: Qt asks for it seven times in each repaint."""

    def __init__(self, side: str) -> None:
        self._area: QRectF | None = None
        super().__init__(side)

    def boundingRect(self) -> QRectF:
        """Return the area of axis and grid."""
        if self._area is None:
            self._area = super().boundingRect()
        return self._area

    def prepareGeometryChange(self) -> None:
        """Note a change of grid or style."""
        self._area = None
        super().prepareGeometryChange()

    def resizeEvent(self, ev: QtWidgets.QGraphicsSceneResizeEvent | None = None) -> None:
        """Note another size."""
        self._area = None
        super().resizeEvent(ev)

    def moveEvent(self, event: QtWidgets.QGraphicsSceneMoveEvent) -> None:
        """Note another position, relative to that of the grid."""
        self._area = None
        super().moveEvent(event)

    def linkedViewChanged(self, view: pg.ViewBox, newRange: object = None) -> None:
        """Note another size of the grid."""
        self._area = None
        super().linkedViewChanged(view, newRange)


def cosmetic_pen(colour: str, width: float = 1.0, style: Qt.PenStyle = Qt.PenStyle.SolidLine) -> QPen:
    """Return a pen whose `width` does not depend on the zoom; in pixels, scaled on high-resolution screens."""
    ratio = cast(QGuiApplication, QGuiApplication.instance()).devicePixelRatio()
    pen: QPen = pg.mkPen(colour, width=width * ratio, style=style)
    return pen


class PlotLayer:
    """A part of a plot: its items, each with its height over the plot, and with its colours in every palette."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self._plot = plot
        self._pens: list[tuple[Any, str, float, Qt.PenStyle]] = []  # item, colour, width, style
        self._brushes: list[tuple[Any, str]] = []
        self._label_colours: list[tuple[pg.TextItem, str, str, float]] = []  # item, colours of text and paper, size

    def _add(
        self,
        item: _Item,
        z: float | None = None,
        pen: str = "",
        width: float = 1.0,
        style: Qt.PenStyle = Qt.PenStyle.SolidLine,
        brush: str = "",
        bounds: bool = False,
    ) -> _Item:
        """Add and return an item. `pen`, `brush`: colours of the palette. `bounds`: whether automatic zoom shows it."""
        if z is not None:
            item.setZValue(z)
        self._plot.addItem(item, ignoreBounds=not bounds)
        if pen:
            self._pens.append((item, pen, width, style))
        if brush:
            self._brushes.append((item, brush))
        return item

    def _add_label(self, z: float, ink: str, paper: str, size: float = 1.0, **options: Any) -> pg.TextItem:
        """Add and return a label; `ink`, `paper`: colours of the palette."""
        label = self._add(pg.TextItem(**options), z)
        self._label_colours.append((label, ink, paper, size))
        return label

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        for item, colour, width, style in self._pens:
            item.setPen(cosmetic_pen(getattr(look.palette, colour), width, style))
        for item, colour in self._brushes:
            item.setBrush(pg.mkBrush(getattr(look.palette, colour)))
        for label, ink, paper, size in self._label_colours:
            label.setColor(getattr(look.palette, ink))
            label.fill = pg.mkBrush(getattr(look.palette, paper))
            label.setFont(text_font(look, size))


def with_gaps(lines: Iterable[FloatArray]) -> FloatArray:
    """Return lines of points, (n, 2) each, as one array with NaN between them."""
    gap = np.full((1, 2), np.nan)
    parts = [part for line in lines if len(line) for part in (line, gap)]
    return np.vstack(parts) if parts else np.empty((0, 2))


def style_plot(plot: pg.PlotItem, look: Look, grid: bool = True) -> None:
    """Use the colours and text size of a look for axes, tick values and grid."""
    font = text_font(look, 0.9)
    for name in _AXES:
        axis = plot.getAxis(name)
        axis.setCacheMode(_CACHED)
        axis.setPen(cosmetic_pen(look.palette.ink))
        axis.setTextPen(look.palette.ink)
        axis.setStyle(tickFont=font)
        axis.label.setFont(font)
        axis.labelStyle = {"color": look.palette.ink}
    plot.showGrid(x=grid, y=grid, alpha=look.palette.grid_alpha)


def remove_prefixes(plot: pg.PlotItem) -> None:
    """Remove SI prefixes from all axes: they would scale tick values, and lay out a label with every change of zoom."""
    for name in _AXES:
        axis = plot.getAxis(name)
        # disabling the prefixes computes one last prefix, which would stay; without ranges there is none
        axis.setSIPrefixEnableRanges(())
        axis.enableAutoSIPrefix(False)


def label_axis(axis: pg.AxisItem, text: str) -> None:
    """Set the label of an axis, without SI prefixes."""
    axis.setLabel(text, siPrefixEnableRanges=(), **axis.labelStyle)


def label_length(axis: pg.AxisItem, what: str, look: Look) -> None:
    """Label an axis over metres in the unit of the look."""
    axis.setScale(look.unit.per_metre)
    label_axis(axis, f"{what} ({look.unit.label})")


# Actions of a view, each with a key and a button. Menus and the help page list them too.


def view_action(owner: QtWidgets.QWidget, text: str, key: str, tip: str, checkable: bool = True) -> QAction:
    """Return an action of `owner` with a key that works in the whole window."""
    action = QAction(text, owner)
    action.setShortcut(QKeySequence(key))
    action.setToolTip(f"{tip} ({key})")
    action.setStatusTip(tip)
    action.setCheckable(checkable)
    owner.addAction(action)
    return action


def add_buttons(row: QtWidgets.QLayout, actions: Sequence[QAction]) -> None:
    """Add a flat button for each action."""
    for action in actions:
        button = QtWidgets.QToolButton()
        button.setAutoRaise(True)
        button.setDefaultAction(action)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the window keeps the keyboard focus
        row.addWidget(button)


# Pictures of views with title and legend, as pixels, SVG or PDF.
#
# Drawing needs the window's thread. The results are plain arrays and text, which another thread writes to files.


_RESOLUTION, _POINTS = 96, 72  # pixels per inch, the SVG standard; points of PDF per inch
_RATIO = 2  # picture pixels per screen pixel, for print


def png_pixels(widget: QtWidgets.QWidget, title: str, shown: Shown, not_drawn: Sequence[str] = ()) -> NDArray[np.uint8]:
    """Return the view with title and legend, (height, width, 4); without a title, the widget alone."""
    with _with_legend(widget, title, shown, not_drawn) as parts:
        size = _size(parts) * _RATIO
        image = QImage(size, QImage.Format.Format_RGBA8888)
        image.fill(QColor(shown.look.palette.paper))
        image.setDevicePixelRatio(_RATIO)
        with QPainter(image) as painter:
            _draw(painter, parts)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(size.height(), image.bytesPerLine())
    return rows[:, : 4 * size.width()].reshape(size.height(), size.width(), 4).copy()


def pdf_bytes(widget: QtWidgets.QWidget, title: str, shown: Shown, not_drawn: Sequence[str] = ()) -> bytes:
    """Return the view with title and legend as a PDF of one page in its size."""
    with _with_legend(widget, title, shown, not_drawn) as parts:
        size, buffer = _size(parts), QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        writer = QPdfWriter(buffer)
        points = QSizeF(size) * (_POINTS / _RESOLUTION)
        writer.setPageSize(QPageSize(points, QPageSize.Unit.Point, "", QPageSize.SizeMatchPolicy.ExactMatch))
        writer.setPageMargins(QMarginsF())
        writer.setResolution(_RESOLUTION)
        with QPainter(writer) as painter:
            painter.fillRect(QRect(QPoint(0, 0), size), QColor(shown.look.palette.paper))
            _draw(painter, parts)
    return bytes(buffer.data().data())


def svg_text(widget: QtWidgets.QWidget, title: str, shown: Shown, not_drawn: Sequence[str] = ()) -> str:
    """Return the view with title and legend as SVG. `sonarhw_gui.jobs.files` corrects Qt's line widths in it.

    Qt's generator does not clip, so the content of each plot is a nested SVG element.
    """
    boxes = [box for view in _graphics_views(widget) for box in _items(view, pg.ViewBox)]
    with _with_legend(widget, title, shown, not_drawn) as parts, _faded([box.childGroup for box in boxes]):
        size = _size(parts)
        whole = _svg(QRect(QPoint(0, 0), size), shown.look, partial(_draw, parts=parts))
    below = size.height() - widget.height()
    insets = []
    for view in _graphics_views(widget):
        offset = (QPoint(0, 0) if view is widget else view.mapTo(widget, QPoint(0, 0))) + QPoint(0, below)
        with _faded(_items(view, pg.AxisItem)):
            insets += [_inset(view, box, offset) for box in _items(view, pg.ViewBox)]
    return whole.replace("</svg>", "".join((*insets, "</svg>")))


def _inset(view: pg.GraphicsView, box: pg.ViewBox, offset: QPoint) -> str:
    """Return the content of a view box as an element that clips it."""
    seen = view.mapFromScene(box.sceneBoundingRect()).boundingRect()
    drawn = _svg(QRect(QPoint(0, 0), seen.size()), None, lambda painter: _draw_seen(painter, view, seen))
    corner = offset + seen.topLeft()
    place = f'x="{corner.x()}" y="{corner.y()}" width="{seen.width()}" height="{seen.height()}" overflow="hidden"'
    return re.sub(r'<svg width="[^"]*" height="[^"]*"', f"<svg {place}", drawn[drawn.index("<svg") :], count=1)


def _draw_seen(painter: QPainter, view: pg.GraphicsView, seen: QRect) -> None:
    paper = view.backgroundBrush()
    view.setBackgroundBrush(QBrush())  # the grid is drawn below
    try:
        view.render(painter, QRectF(QPoint(0, 0), seen.size()), seen)
    finally:
        view.setBackgroundBrush(paper)


def _svg(area: QRect, look: Look | None, draw: Callable[[QPainter], None]) -> str:
    buffer, generator = QBuffer(), QSvgGenerator()
    buffer.open(QIODevice.OpenModeFlag.WriteOnly)
    generator.setOutputDevice(buffer)
    generator.setSize(area.size())
    generator.setViewBox(area)
    generator.setResolution(_RESOLUTION)
    with QPainter(generator) as painter:
        if look is not None:
            painter.fillRect(area, QColor(look.palette.paper))
        draw(painter)
    return bytes(buffer.data().data()).decode()


def _graphics_views(widget: QtWidgets.QWidget) -> list[pg.GraphicsView]:
    inside = [view for view in widget.findChildren(pg.GraphicsView) if view.isVisibleTo(widget)]
    return [widget, *inside] if isinstance(widget, pg.GraphicsView) else inside


def _items(view: pg.GraphicsView, kind: type[QtWidgets.QGraphicsItem]) -> list[Any]:
    return [item for item in view.scene().items() if isinstance(item, kind) and item.isVisible()]


@contextmanager
def _faded(items: Sequence[QtWidgets.QGraphicsItem]) -> Iterator[None]:
    """Make items invisible for a while, without signals to their observers."""
    before = [item.opacity() for item in items]
    for item in items:
        item.setOpacity(0.0)
    try:
        yield
    finally:
        for item, opacity in zip(items, before, strict=True):
            item.setOpacity(opacity)


@contextmanager
def _with_legend(
    widget: QtWidgets.QWidget, title: str, shown: Shown, not_drawn: Sequence[str]
) -> Iterator[Sequence[QtWidgets.QWidget]]:
    """Return the parts of a picture from top to bottom; those that are not `widget` are deleted afterwards."""
    added = _title_and_legend(title, widget.width(), shown, not_drawn) if title else []
    try:
        yield *added, widget
    finally:
        for part in added:
            part.deleteLater()  # no parent deletes it, and its connections would keep it


def _title_and_legend(title: str, width: int, shown: Shown, not_drawn: Sequence[str]) -> list[QtWidgets.QWidget]:
    head, legend = PlainLabel(title), Legend(shown.hidden, switches=False, left_out=not_drawn)
    head.setContentsMargins(8, 6, 8, 2)
    legend.show_state(shown)
    legend.set_look(shown.look)
    parts: list[QtWidgets.QWidget] = [head, legend]
    for text in filter(None, (shown.sentence if shown.chosen is not None else "", bounces_text(shown))):
        line = PlainLabel(text, wordWrap=True)
        line.setContentsMargins(8, 2, 8, 2)
        line.resize(width, line.heightForWidth(width))
        parts.append(line)
    head.resize(width, head.sizeHint().height())
    legend.resize(width, legend.heightForWidth(width))
    for part in parts:
        part.setAttribute(Qt.WidgetAttribute.WA_TranslucentBackground)
    return parts


def _size(parts: Sequence[QtWidgets.QWidget]) -> QSize:
    return QSize(max(part.width() for part in parts), sum(part.height() for part in parts))


def _draw(painter: QPainter, parts: Sequence[QtWidgets.QWidget]) -> None:
    top = 0
    for part in parts:
        painter.save()
        painter.translate(0, top)
        QtWidgets.QWidget.render(part, painter, QPoint(0, 0))  # QGraphicsView.render would draw the scene only
        painter.restore()
        top += part.height()


# Find the drawn reading that is nearest to a click.


PICK_DISTANCE = 14.0  # pixels


def nearest_reading(
    view: pg.ViewBox, drawn: Mapping[Any, tuple[ClassPoints, FloatArray]], click: QPointF, within: float = PICK_DISTANCE
) -> int | None:
    """Return the reading nearest to `click` (scene coordinates); None if no reading is within `within` pixels.

    `drawn` contains the readings of every class and their positions, (n, 2) float in view coordinates.
    """
    point = view.mapSceneToView(click)
    size = np.array([abs(length) for length in view.viewPixelSize()])
    best, nearest = None, within
    for points, positions in drawn.values():
        away = np.hypot(*((positions - (point.x(), point.y())) / size).T)
        k = int(np.nanargmin(away))
        if away[k] <= nearest:
            best, nearest = points.readings[k], float(away[k])
    return best


def reading_towards(shown: Shown, heading: float) -> int | None:
    """Return the newest of the readings nearest to `heading`, rad; None without readings."""
    if not shown.readings:
        return None
    away = np.abs(angle_difference(np.radians(shown.rows.headings), heading))
    return int(np.flatnonzero(away <= away.min() + 1e-6)[-1])


# The plot factory: creates the plots of the window and their canvas, with a common set-up of mouse and repaints.


_WIDEST = 1e5  # m, ° or s; nothing larger is drawn, and ticks beyond are unreadable


def new_plot(
    axes: Mapping[str, pg.AxisItem] | None = None, box: pg.ViewBox | None = None, zooms_height: bool = True
) -> pg.PlotItem:
    """Return an empty plot.

    `axes`: axes by side, to replace or add to the default two. `zooms_height`: the mouse changes the y range.
    """
    # antialias: items read it when they are created. mouseRateLimit: pyqtgraph would drop moves within 10 ms of the
    # last one, and a drag whose events reach a busy window together would be a click; Qt already merges moves
    pg.setConfigOptions(antialias=True, mouseRateLimit=0)
    # the window has its own menus; pyqtgraph's would offer logarithmic headings and another export
    own = {side: PlotAxis(side) for side in ("left", "bottom")}
    plot = pg.PlotItem(axisItems={**own, **(axes or {})}, viewBox=box, enableMenu=False)
    remove_prefixes(plot)
    plot.hideButtons()
    plot.setLimits(maxXRange=_WIDEST, maxYRange=_WIDEST)
    plot.setMouseEnabled(x=True, y=zooms_height)
    for side in axes or ():
        plot.showAxis(side)
    return plot


class _Scene(pg.GraphicsScene):  # type: ignore[misc]  # pyqtgraph has no types
    """A scene in which nothing is hovered over during a drag: to search for it takes half of the time of a move."""

    def sendHoverEvents(self, ev: QEvent, exitOnly: bool = False) -> None:
        """Send what pyqtgraph sends, except during a drag."""
        if exitOnly or self.dragItem is None:
            super().sendHoverEvents(ev, exitOnly)


class Canvas(pg.GraphicsLayoutWidget):  # type: ignore[misc]  # pyqtgraph has no types
    """The widget that contains the plots of one view."""

    clicked = Signal(object)  # MouseClickEvent of the left button
    menu_pressed = Signal(object)  # QPointF in the scene, of the right button; a menu may follow
    hovered = Signal(object)  # QPointF in the scene; None when the mouse leaves

    def __init__(self, *plots: pg.PlotItem) -> None:
        """Arrange `plots` in one column. A single plot fills the canvas to its edges."""
        super().__init__()
        self.scene().removeItem(self.ci)
        self.centralWidget, self.sceneObj = None, _Scene(parent=self)
        self.setScene(self.sceneObj)
        # a scatter paints more than the area it reports, so partial updates would leave old points on the screen
        self.setViewportUpdateMode(QtWidgets.QGraphicsView.ViewportUpdateMode.FullViewportUpdate)
        self._plots = plots
        if len(plots) == 1:
            self.setCentralItem(plots[0])  # in a layout it would be resized one paint late
        else:
            self.setCentralItem(self.ci)
            for row, plot in enumerate(plots):
                self.addItem(plot, row=row, col=0)
        self.scene().sigMouseClicked.connect(self._click)
        self.scene().sigMouseMoved.connect(self.hovered)

    def set_look(self, look: Look) -> None:
        """Use the colours and text size of `look` for background, axes and grid."""
        self.setBackground(look.palette.paper)
        for plot in self._plots:
            style_plot(plot, look)

    def repaint_whole(self) -> None:
        """Ask for one repaint of everything, before items change: partial updates trigger an extra repaint."""
        self.scene().update()
        self.viewport().update()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Emit `menu_pressed` for the right button."""
        if event.button() is Qt.MouseButton.RightButton:
            self.menu_pressed.emit(self.mapToScene(event.position().toPoint()))
        super().mousePressEvent(event)

    def leaveEvent(self, event: QEvent) -> None:
        """Emit `hovered` with None."""
        self.hovered.emit(None)
        super().leaveEvent(event)

    @Slot(object)
    def _click(self, event: MouseClickEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:  # a mark below may have accepted the event already
            self.clicked.emit(event)
