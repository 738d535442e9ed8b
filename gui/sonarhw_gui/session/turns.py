"""Updates that are done in turns, so that no frame has to wait for all of them."""

from collections.abc import Callable, Sequence

from PySide6.QtCore import QObject, QTimer, Slot


class Turns(QObject):
    """Parts of one update: all at once, or one after another with a pause."""

    def __init__(self, parts: Sequence[Callable[[], None]], interval: int, parent: QObject) -> None:
        """`interval`: pause between two parts, ms."""
        super().__init__(parent)
        self._parts = parts
        self._next = self._due = 0  # the next part, and how many are due
        self._timer = QTimer(self, singleShot=True, interval=interval)
        self._timer.timeout.connect(self._take_turn)

    def all_now(self) -> None:
        """Update all parts."""
        self._timer.stop()
        self._due = 0
        for part in self._parts:
            part()

    def soon(self) -> None:
        """Update each part once more, in turns."""
        self._due = len(self._parts)
        if not self._timer.isActive():
            self._timer.start()

    def advance(self) -> None:
        """Update each part once more, in turns, the first at once: one part with each frame, the last by the timer."""
        self._due = len(self._parts)
        self._take_turn()

    @Slot()
    def _take_turn(self) -> None:
        part = self._parts[self._next]
        self._next = (self._next + 1) % len(self._parts)
        self._due -= 1
        if self._due > 0:
            self._timer.start()
        else:
            self._timer.stop()
        part()
