"""A sentence in the middle of a plot that has nothing to draw, instead of its axes."""

import pyqtgraph as pg
from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QTextOption
from PySide6.QtWidgets import QGraphicsTextItem

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font

_WIDTH = 0.8  # of the plot


class PlotMessage(QGraphicsTextItem):
    """The sentence. As a part of the drawing it needs no space in the layout of the window."""

    def __init__(self, plot: pg.PlotItem) -> None:
        super().__init__(plot.vb)
        self._plot = plot
        self.document().setDefaultTextOption(QTextOption(Qt.AlignmentFlag.AlignCenter))
        plot.vb.sigResized.connect(self._place)

    def set_look(self, look: Look) -> None:
        """Use the colours and the text size of `look`."""
        self.setFont(text_font(look))
        self.setDefaultTextColor(look.palette.ink)
        self._place()

    def show_text(self, text: str) -> None:
        """Show `text` and hide the axes; the other way round if it is empty."""
        self.setPlainText(text)
        self.setVisible(bool(text))
        for side in ("left", "bottom"):
            self._plot.showAxis(side, not text)
        self._place()

    @Slot()
    def _place(self) -> None:
        box = self._plot.vb.rect()
        self.setTextWidth(_WIDTH * box.width())
        self.setPos(box.center() - self.boundingRect().center())
