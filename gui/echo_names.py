"""Names at the predicted echoes of the trace: upright, the important ones first, no two over each other.

Takes echoes; draws the names that fit at this zoom. Those that do not fit appear when one zooms in or hovers.
"""

from collections.abc import Sequence

import pyqtgraph as pg

from gui.chosen_trace import NamedEcho
from gui.palette import INK, PREDICTED

_APART = 15.0  # pixels between two names
_LONGEST = 26  # characters; the middle gives way


class EchoNames:
    """The names of one trace."""

    def __init__(self, view: pg.ViewBox, top: float) -> None:
        self._view = view
        self._top = top  # level at which a name begins, dB
        self._echoes: tuple[NamedEcho, ...] = ()
        self._items: list[pg.TextItem] = []
        view.sigXRangeChanged.connect(self._lay_out)
        view.sigResized.connect(self._lay_out)

    def draw(self, echoes: Sequence[NamedEcho]) -> None:
        """Name these echoes from now on."""
        self._echoes = tuple(sorted(echoes, key=lambda echo: (not echo.first, -echo.level_db)))
        self._lay_out()

    def _lay_out(self, *_: object) -> None:
        shown = self._fitting()
        while len(self._items) < len(shown):
            item = pg.TextItem(anchor=(0, 0.5), angle=-90)
            self._view.addItem(item, ignoreBounds=True)
            self._items.append(item)
        for item in self._items[len(shown) :]:
            item.setVisible(False)
        for item, echo in zip(self._items, shown, strict=False):
            item.setText(shortened(echo.via), color=PREDICTED if echo.heard else INK)
            item.setPos(echo.range, self._top)
            item.setVisible(True)

    def _fitting(self) -> list[NamedEcho]:
        """The most important echoes in view that leave room for one another."""
        left, right = self._view.viewRange()[0]
        apart = _APART * (right - left) / max(self._view.width(), 1.0)
        named: list[NamedEcho] = []
        for echo in self._echoes:
            inside = left <= echo.range <= right
            if inside and all(abs(echo.range - other.range) >= apart for other in named):
                named.append(echo)
        return named


def shortened(via: str) -> str:
    """A long path with its middle left out."""
    if len(via) <= _LONGEST:
        return via
    half = (_LONGEST - 1) // 2
    return f"{via[:half]}…{via[-half:]}"
