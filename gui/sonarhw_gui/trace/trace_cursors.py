"""Two cursors in the trace that show time, range and their differences. Mouse and keys move them."""

import pyqtgraph as pg
from PySide6.QtCore import QObject, Qt, Signal

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.plots.plot_look import cosmetic_pen
from sonarhw_gui.work.chosen_trace import ChosenTrace

_AT = 1 / 3, 2 / 3  # initial positions, shares of the visible trace
_NAMES = "AB"


class TraceCursors(QObject):
    """Cursors A and B of one plot."""

    moved = Signal()

    def __init__(self, plot: pg.PlotItem, parent: QObject) -> None:
        super().__init__(parent)
        self._lines = [_line(name) for name in _NAMES]
        self._duration = 0.0
        for line in self._lines:
            line.setVisible(False)
            plot.addItem(line, ignoreBounds=True)
            line.sigPositionChanged.connect(self.moved)

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        for line in self._lines:
            line.setPen(cosmetic_pen(look.palette.chosen, width=1))
            line.setHoverPen(cosmetic_pen(look.palette.chosen, width=3))
            line.label.setColor(look.palette.paper)
            line.label.fill = pg.mkBrush(look.palette.chosen)

    def show(self, shown: bool) -> None:
        """Show or hide them."""
        for line in self._lines:
            line.setVisible(shown)

    @property
    def times(self) -> list[float]:
        """The positions, s."""
        return [line.value() for line in self._lines]

    def fit(self, duration: float, seen: float) -> None:
        """Keep the cursors within `duration`, s. The first call places them in the visible part, `seen` s."""
        if self._duration == 0:
            for line, share in zip(self._lines, _AT, strict=True):
                line.setValue(share * seen)
        self._duration = duration
        for line in self._lines:
            line.setBounds((0.0, duration))

    def step(self, which: int, by: float) -> None:
        """Move one cursor by a time, s."""
        self._lines[which].setValue(self._lines[which].value() + by)

    def text(self, trace: ChosenTrace, look: Look) -> str:
        """Return time and range of both cursors and their differences."""
        texts = [f"{name} {_read(trace, time, look)}" for name, time in zip(_NAMES, self.times, strict=True)]
        first, second = self.times
        return "   ".join([*texts, f"B − A {_read(trace, second - first, look)}"])


def _read(trace: ChosenTrace, time: float, look: Look) -> str:
    return f"{time * 1e3:.2f} ms, {look.unit.text(trace.range_at(time))}".replace("-", "−")


def _line(name: str) -> pg.InfiniteLine:
    line = pg.InfiniteLine(angle=90, movable=True, label=name, labelOpts={"position": 0.06, "movable": False})
    line.setCursor(Qt.CursorShape.SizeHorCursor)
    line.setZValue(20)
    return line
