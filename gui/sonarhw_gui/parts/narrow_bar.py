"""A bar that hides some of its parts where it is too narrow for all of them."""

from collections.abc import Iterable

from PySide6.QtCore import QSize
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

GAP = 6  # pixels between the parts


class NarrowBar(QWidget):
    """A bar with groups of parts that it can do without: a narrow bar hides the first, a narrower one the next too."""

    dispensable: tuple[tuple[QWidget, ...], ...] = ()

    def minimumSizeHint(self) -> QSize:
        """Return the size without the parts that a narrow bar hides."""
        whole = super().minimumSizeHint()
        shown = [part for group in self.dispensable for part in group if not part.isHidden()]
        return QSize(whole.width() - _width_of(shown), whole.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Hide what does not fit."""
        super().resizeEvent(event)
        self.hide_what_does_not_fit()

    def hide_what_does_not_fit(self) -> None:
        """Show the groups that fit into the width."""
        needed = self.minimumSizeHint().width()
        for group in reversed(self.dispensable):
            needed += _width_of(group)
            for part in group:
                part.setVisible(self.width() >= needed)


def _width_of(parts: Iterable[QWidget]) -> int:
    return sum(part.sizeHint().width() + GAP for part in parts)
