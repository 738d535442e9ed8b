"""The plot factory: creates the plots of the window and their canvas, with a common set-up of mouse and repaints."""

from collections.abc import Mapping

import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt, Signal, Slot
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QGraphicsView

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plots.pick import is_plain_click
from sonarhw_gui.plots.plot_look import PlotAxis, remove_prefixes, style_plot

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
        self.setViewportUpdateMode(QGraphicsView.ViewportUpdateMode.FullViewportUpdate)
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
    def _click(self, event: object) -> None:
        if is_plain_click(event):
            self.clicked.emit(event)
