"""The marks of notes: a small sheet above the mark of each reading that has one."""

import numpy as np
import pyqtgraph as pg

from sonarhw_gui.look.note_symbol import NOTE_SIZE, note_symbol
from sonarhw_gui.look.palette import Palette
from sonarhw_gui.plots.marks import ABOVE_MARKS, NO_POSITIONS, ReadingMarks
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import Spots
from sonarhw_gui.scene.note_texts import NoteTexts


class NoteMarks:
    """One mark for each note on a visible reading."""

    def __init__(self, plot: pg.PlotItem) -> None:
        self.spots = Spots(size=NOTE_SIZE, symbol=note_symbol())
        self.spots.setZValue(ABOVE_MARKS)
        plot.addItem(self.spots, ignoreBounds=True)

    def set_look(self, colours: Palette) -> None:
        """Use these colours."""
        self.spots.setPen(cosmetic_pen(colours.note_ink, width=1))
        self.spots.setBrush(colours.note_paper)

    def draw(self, notes: NoteTexts, marks: ReadingMarks) -> None:
        """Draw the notes on the readings that `marks` draws."""
        noted = list(notes.by_reading)
        if not noted:
            self.spots.clear()
            return
        drawn = marks.placed.values()
        places = np.vstack([NO_POSITIONS, *(at[np.isin(points.readings, noted)] for points, at in drawn)])
        places = places[np.isfinite(places).all(axis=1)]
        self.spots.setData(*places.T)
