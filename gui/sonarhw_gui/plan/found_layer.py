"""The search for the room in the plan: dashed walls, readings for and against one of them, the next place to scan."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt

from sonarhw.readings import FloatArray
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, Spots
from sonarhw_gui.scene.plan_geometry import surface_outlines
from sonarhw_gui.shown.found_drawing import NO_POINTS, FoundDrawing, NextScan

_GAP = np.full((1, 2), np.nan)
_WIDTH, _CLEARED = 3, 9  # pixels: dashes, and a strip below them without the outline, which has their colour
_REACH = 0.18  # of the diagonal of the found walls: radius of the sectors of the next scan


class FoundLayer:
    """Dashed surfaces, marks at readings, and the next place with its headings."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.surfaces, self.chosen = (PlotLine(connect="finite") for _ in range(2))
        self.sectors = PlotLine(connect="finite")
        self.speaking_for = Spots(size=15, symbol="o", brush=None)
        self.against = Spots(size=15, symbol="x", brush=None)
        self.next_scan = Spots(size=20, symbol="star")
        self._label = pg.TextItem("scan next", anchor=(0.5, -0.5))
        self._posts = Spots(size=16, symbol="+", brush=None)  # a post may be smaller than a pixel
        for z, item in (
            (4, self.surfaces),  # over walls and outline, below readings of all scans
            (4, self._posts),
            (4.5, self.chosen),
            (34, self.speaking_for),
            (34, self.against),
            (33, self.sectors),
            (37, self.next_scan),
            (37, self._label),
        ):
            item.setZValue(z)
            plot.addItem(item, ignoreBounds=True)
        self.draw(None)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        colours = look.palette
        self.surfaces.setPen(cosmetic_pen(colours.predicted, width=_WIDTH, style=Qt.PenStyle.DashLine))
        self.surfaces.setShadowPen(cosmetic_pen(colours.paper, width=_CLEARED))
        self.chosen.setPen(cosmetic_pen(colours.predicted, width=5))
        self._posts.setPen(cosmetic_pen(colours.predicted, width=2))
        self.speaking_for.setPen(cosmetic_pen(colours.predicted, width=2))
        self.against.setPen(cosmetic_pen(colours.long, width=3))
        self.sectors.setPen(cosmetic_pen(colours.ink, width=1, style=Qt.PenStyle.DotLine))
        self.next_scan.setPen(cosmetic_pen(colours.ink, width=1))
        self.next_scan.setBrush(pg.mkBrush(colours.extra))
        self._label.setColor(colours.ink)
        self._label.fill = pg.mkBrush(colours.paper)
        self._label.setFont(text_font(look, 0.9))

    def draw(self, found: FoundDrawing | None) -> None:
        """Draw the state of a search; None: nothing."""
        walls, posts = (np.empty((0, 4)), np.empty((0, 3))) if found is None else (found.walls, found.posts)
        _set(self.surfaces, surface_outlines(walls, posts))
        _set(self.chosen, NO_POINTS if found is None else surface_outlines(found.chosen_walls, found.chosen_posts))
        _set(self._posts, posts[:, :2])
        _set(self.speaking_for, NO_POINTS if found is None else found.speaking_for)
        _set(self.against, NO_POINTS if found is None else found.against)
        self._draw_next(None if found is None else found.next_scan, walls)

    def _draw_next(self, place: NextScan | None, walls: FloatArray) -> None:
        at = NO_POINTS if place is None else np.array([place.position])
        _set(self.next_scan, at)
        self._label.setVisible(place is not None)
        if place is None:
            _set(self.sectors, NO_POINTS)
            return
        self._label.setPos(*place.position)
        ends = walls.reshape(-1, 2)
        reach = _REACH * float(np.hypot(*np.ptp(ends, axis=0))) if len(ends) else 1.0
        _set(self.sectors, _sectors(place, reach))


def _set(item: PlotLine | Spots, points: FloatArray) -> None:
    item.setData(*points.T)
    item.setVisible(len(points) > 0)


def _sectors(place: NextScan, reach: float) -> FloatArray:
    """Return the outlines of the sectors, (n, 2) m, with NaN between them."""
    middle, parts = np.array([place.position]), []
    for begin, end in place.sectors:
        angles = np.linspace(begin, end, 25)
        arc = middle + reach * np.column_stack((np.cos(angles), np.sin(angles)))
        parts += [middle, arc, middle, _GAP]
    return np.vstack(parts) if parts else NO_POINTS
