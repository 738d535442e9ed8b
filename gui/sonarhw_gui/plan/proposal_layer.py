"""The proposed change of the room in the plan: dashed surfaces, and rings around the readings that it explains."""

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plots.marks import ReadingMarks
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, Spots
from sonarhw_gui.scene.plan_geometry import surface_outlines
from sonarhw_gui.shown.proposal import Proposal

_WIDTH = 4  # pixels
_SMALLEST = 18  # pixels, of the cross at a post, which may be smaller than a pixel


class ProposalLayer:
    """Dashed walls and posts, and rings."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.surfaces = PlotLine(connect="finite")
        self._posts = Spots(size=_SMALLEST, symbol="+", brush=None)
        self.rings = Spots(size=15, symbol="o", brush=None)
        for z, item in ((35, self.surfaces), (35, self._posts), (34, self.rings)):
            item.setZValue(z)
            plot.addItem(item, ignoreBounds=True)

    def set_look(self, look: Look) -> None:
        """Use the colours and sizes of `look`."""
        pen = cosmetic_pen(look.palette.predicted, width=_WIDTH, style=Qt.PenStyle.DashLine)
        self.surfaces.setPen(pen)
        self._posts.setPen(cosmetic_pen(look.palette.predicted, width=2))
        self.rings.setPen(cosmetic_pen(look.palette.predicted, width=2))

    def draw(self, proposal: Proposal | None, marks: ReadingMarks) -> None:
        """Draw a proposal, and rings around its readings at their marks; None: nothing."""
        walls, posts = (np.empty((0, 4)), np.empty((0, 3))) if proposal is None else (proposal.walls, proposal.posts)
        self.surfaces.setData(*surface_outlines(walls, posts).T)
        self._posts.setData(*posts[:, :2].T)
        draw_rings(self.rings, proposal, marks)


def draw_rings(rings: Spots, proposal: Proposal | None, marks: ReadingMarks) -> None:
    """Draw rings around the readings of a proposal."""
    found = [] if proposal is None else [marks.position_of(reading) for reading in proposal.readings]
    positions = [position for position in found if position is not None]
    rings.setData(*np.array(positions).reshape(-1, 2).T)
