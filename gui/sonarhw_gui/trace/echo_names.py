"""The names of the predicted echoes, in a few rows above the trace, without overlap.

The reported echo is placed first, then the others by level. A line connects each name with its echo. Names that do
not fit appear after a zoom, or as a tooltip.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QFont, QFontMetricsF

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.plots.spots import PlotLine, TipSpots
from sonarhw_gui.trace.trace_axes import EMPTY, Heights
from sonarhw_gui.work.chosen_trace import NamedEcho

_ROWS = 5  # at most; fewer if there is little room
_SHARE = 0.4  # of the plot's height, at most
_ROW = 15.0  # pixels at the default text size
_GAP = 9.0  # pixels between two names in a row
_LONGEST = 30  # characters; the middle of a longer name is left out
_LONGEST_REPORTED = 64
_POINTS = 8.0  # font size


@dataclass(frozen=True)
class _Name:
    echo: NamedEcho
    text: str
    row: int
    leftward: bool  # the text ends at its stem instead of beginning there


class EchoNames:
    """Names and stems of the echoes of one trace. The rows are above the highest level, so they hide no trace."""

    def __init__(self, view: pg.ViewBox) -> None:
        self._view = view
        self._look = Look()
        self._font = QFont()
        self._metrics = QFontMetricsF(self._font)
        self._echoes: tuple[NamedEcho, ...] = ()
        self._visible = True
        self._heights = EMPTY
        self._rows, self._per_pixel = _ROWS, 1.0
        self._items: list[pg.TextItem] = []
        self._stems = PlotLine(connect="pairs")
        # by whether the echo is detectable
        self._heads = {detected: TipSpots(size=7, symbol="t", pen=None) for detected in (False, True)}
        for item in (self._stems, *self._heads.values()):
            view.addItem(item, ignoreBounds=True)
        view.sigXRangeChanged.connect(self._lay_out)
        view.sigResized.connect(self._lay_out)

    def set_look(self, look: Look) -> None:
        """Use the colours and text size of `look`."""
        self._look = look
        self._font.setPointSizeF(_POINTS * look.scale)
        self._metrics = QFontMetricsF(self._font)
        self._stems.setPen(cosmetic_pen(look.palette.predicted, width=1, style=Qt.PenStyle.DotLine))
        for detected, heads in self._heads.items():
            heads.setBrush(self._colour(detected))
        for item in self._items:
            item.setFont(self._font)
            item.fill = pg.mkBrush(look.palette.paper)

    def draw(self, echoes: Sequence[NamedEcho], heights: Heights) -> None:
        """Draw the names of these echoes and set the height range of the plot."""
        self._echoes = tuple(sorted(echoes, key=lambda echo: (not echo.first, -echo.level_db)))
        self._heights = heights
        for detected, heads in self._heads.items():
            some = [echo for echo in self._echoes if echo.detectable is detected]
            levels = [heights.of(echo.level_db) for echo in some]
            heads.setData([echo.time for echo in some], levels, [self._tip(echo) for echo in some])
        self._lay_out()

    def set_visible(self, visible: bool) -> None:
        """Show or hide all names and stems."""
        if visible is not self._visible:
            self._visible = visible
            self._lay_out()

    def _lay_out(self, *_: object) -> None:
        height, row = max(self._view.height(), 1.0), _ROW * self._look.scale
        bottom, top = self._heights.bottom, self._heights.top
        self._rows = max(1, min(_ROWS, int(_SHARE * height / row)))
        self._per_pixel = (top - bottom) / max(height - self._rows * row, (1 - _SHARE) * height)
        self._view.setYRange(bottom, bottom + height * self._per_pixel, padding=0)
        names = self._fitting() if self._visible else []
        for heads in self._heads.values():
            heads.setVisible(self._visible)
        self._stems.setData(*self._stem_ends(names).T)
        while len(self._items) < len(names):
            item = pg.TextItem(fill=pg.mkBrush(self._look.palette.paper))
            item.setFont(self._font)
            item.textItem.document().setDocumentMargin(1)  # rows are close together
            self._view.addItem(item, ignoreBounds=True)
            self._items.append(item)
        for item in self._items[len(names) :]:
            item.setVisible(False)
        for item, name in zip(self._items, names, strict=False):
            colour = self._colour(name.echo.detectable)
            # laying out a text takes long
            if (item.textItem.toPlainText(), item.color.name()) != (name.text, colour.lower()):
                item.setText(name.text, color=colour)
            item.setAnchor((1.0 if name.leftward else 0.0, 0.5))
            item.setPos(name.echo.time, self._middle(name.row))
            item.setVisible(True)

    def _middle(self, row: int) -> float:
        """Return the height of the middle of a row; row 0 is the highest."""
        return self._heights.top + (self._rows - row - 0.5) * _ROW * self._look.scale * self._per_pixel

    def _colour(self, detectable: bool) -> str:
        return self._look.palette.predicted if detectable else self._look.palette.ink

    def _fitting(self) -> list[_Name]:
        """Return the names that fit: first the reported echo, then by level."""
        rows: list[list[tuple[float, float]]] = [[] for _ in range(self._rows)]
        names = (self._placed(echo, rows) for echo in self._echoes)
        return [name for name in names if name is not None]

    def _placed(self, echo: NamedEcho, rows: list[list[tuple[float, float]]]) -> _Name | None:
        """Place the name in the first row with room, right or left of its stem, and add it to `rows`."""
        left, right = self._view.viewRange()[0]
        whole = self._view.width()
        at = (echo.time - left) * whole / (right - left)
        if not 0 <= at <= whole:
            return None
        for text in (shortened(echo.via, _LONGEST_REPORTED if echo.first else _LONGEST), shortened(echo.via, _LONGEST)):
            width = self._metrics.horizontalAdvance(text) + _GAP
            for leftward, begin in ((False, at), (True, at - width)):
                end = begin + width
                row = next((k for k in range(self._rows) if all(end <= b or begin >= e for b, e in rows[k])), None)
                if begin >= 0 and end <= whole and row is not None:
                    rows[row].append((begin, end))
                    return _Name(echo, text, row, leftward)
        return None

    def _stem_ends(self, names: Sequence[_Name]) -> np.ndarray:
        ends = [
            (name.echo.time, height)
            for name in names
            for height in (self._heights.of(name.echo.level_db), self._middle(name.row))
        ]
        return np.array(ends).reshape(-1, 2)

    def _tip(self, echo: NamedEcho) -> str:
        state = "reported" if echo.first else "detected later" if echo.detectable else "within blanking"
        at = f"{self._look.unit.text(echo.range)}, {echo.time * 1e3:.2f} ms"
        level = f"{echo.level_db:.1f} dB" + (", sum of all arrivals within one wavelength" if echo.summed else "")
        return f"{echo.via}\n{at}, {state}\n{level}"


def shortened(via: str, longest: int) -> str:
    """Return the name of a path, without its middle if it is longer than `longest`."""
    if len(via) <= longest:
        return via
    half = (longest - 1) // 2
    return f"{via[:half]}…{via[-half:]}"
