"""Names at the predicted echoes of the trace, in a few rows above it: the important ones first, none over another.

Takes echoes; draws a stem to each, and the names that fit at this zoom. The others appear when one zooms in or hovers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QFont, QFontMetricsF

from gui.chosen_trace import NamedEcho
from gui.look import Look

_ROWS = 5
_ROW = 15.0  # pixels at the usual size of text
_GAP = 9.0  # pixels between two names in a row
_LONGEST = 30  # characters; the middle gives way
_LONGEST_REPORTED = 64
_POINTS = 8.0  # of the font


@dataclass(frozen=True)
class _Name:
    echo: NamedEcho
    text: str
    row: int
    leftward: bool  # it ends at its stem instead of beginning there


class EchoNames:
    """Names and stems of the echoes of one trace; the rows lie above 0 dB, where no trace is."""

    def __init__(self, view: pg.ViewBox) -> None:
        self._view = view
        self._look = Look()
        self._font = QFont()
        self._metrics = QFontMetricsF(self._font)
        self._echoes: tuple[NamedEcho, ...] = ()
        self._floor = -50.0  # dB
        self._items: list[pg.TextItem] = []
        self._stems = pg.PlotCurveItem(connect="pairs")
        self._heads = pg.ScatterPlotItem(size=7, symbol="t", pen=None, hoverable=True, tip=_tip)
        for item in (self._stems, self._heads):
            view.addItem(item, ignoreBounds=True)
        view.sigXRangeChanged.connect(self._lay_out)
        view.sigResized.connect(self._lay_out)

    def dress(self, look: Look) -> None:
        """Write in the colours and the size of this look from now on."""
        self._look = look
        self._font.setPointSizeF(_POINTS * look.scale)
        self._metrics = QFontMetricsF(self._font)
        self._stems.setPen(pg.mkPen(look.palette.predicted, width=1, style=Qt.PenStyle.DotLine))
        for item in self._items:
            item.setFont(self._font)
            item.fill = pg.mkBrush(look.palette.paper)

    def draw(self, echoes: Sequence[NamedEcho], floor: float) -> None:
        """Name these echoes from now on; the level axis begins at `floor`, dB."""
        self._echoes = tuple(sorted(echoes, key=lambda echo: (not echo.first, -echo.level_db)))
        self._floor = floor
        self._heads.setData(
            np.array([echo.range for echo in self._echoes]),
            np.array([max(echo.level_db, floor) for echo in self._echoes]),
            data=self._echoes,
            brush=[pg.mkBrush(self._colour(echo)) for echo in self._echoes],
        )
        self._lay_out()

    def _lay_out(self, *_: object) -> None:
        height = max(self._view.height(), 1.0)
        per_pixel = -self._floor / max(height - _ROWS * _ROW, 0.3 * height)  # dB
        self._view.setYRange(self._floor, self._floor + height * per_pixel, padding=0)
        names = self._fitting()
        self._stems.setData(*self._stem_ends(names, per_pixel).T)
        while len(self._items) < len(names):
            item = pg.TextItem(fill=pg.mkBrush(self._look.palette.paper))
            item.setFont(self._font)
            self._view.addItem(item, ignoreBounds=True)
            self._items.append(item)
        for item in self._items[len(names) :]:
            item.setVisible(False)
        for item, name in zip(self._items, names, strict=False):
            item.setText(name.text, color=self._colour(name.echo))
            item.setAnchor((1.0 if name.leftward else 0.0, 0.5))
            item.setPos(name.echo.range, _level(name.row, per_pixel))
            item.setVisible(True)

    def _colour(self, echo: NamedEcho) -> str:
        return self._look.palette.predicted if echo.heard else self._look.palette.ink

    def _fitting(self) -> list[_Name]:
        """A row for every echo in view that finds room in one, the most important first."""
        rows: list[list[tuple[float, float]]] = [[] for _ in range(_ROWS)]
        names = (self._placed(echo, rows) for echo in self._echoes)
        return [name for name in names if name is not None]

    def _placed(self, echo: NamedEcho, rows: list[list[tuple[float, float]]]) -> _Name | None:
        """The name in the first row with room for it, right of its stem or left of it; `rows` then has it too."""
        left, right = self._view.viewRange()[0]
        whole = self._view.width()
        at = (echo.range - left) * whole / (right - left)
        if not 0 <= at <= whole:
            return None
        for text in (shortened(echo.via, _LONGEST_REPORTED if echo.first else _LONGEST), shortened(echo.via, _LONGEST)):
            width = self._metrics.horizontalAdvance(text) + _GAP
            for leftward, begin in ((False, at), (True, at - width)):
                end = begin + width
                row = next((k for k in range(_ROWS) if all(end <= b or begin >= e for b, e in rows[k])), None)
                if begin >= 0 and end <= whole and row is not None:
                    rows[row].append((begin, end))
                    return _Name(echo, text, row, leftward)
        return None

    def _stem_ends(self, names: Sequence[_Name], per_pixel: float) -> np.ndarray:
        ends = [
            (name.echo.range, level)
            for name in names
            for level in (max(name.echo.level_db, self._floor), _level(name.row, per_pixel))
        ]
        return np.array(ends).reshape(-1, 2)


def _level(row: int, per_pixel: float) -> float:
    """The middle of a row, dB; row 0 is the highest."""
    return (_ROWS - row - 0.5) * _ROW * per_pixel


def shortened(via: str, longest: int) -> str:
    """A long path with its middle left out."""
    if len(via) <= longest:
        return via
    half = (longest - 1) // 2
    return f"{via[:half]}…{via[-half:]}"


def _tip(x: float, y: float, data: NamedEcho) -> str:
    state = "reported" if data.first else "heard later" if data.heard else "within blanking"
    return f"{data.via}\n{data.range:.3f} m, {data.level_db:.1f} dB, {state}"
