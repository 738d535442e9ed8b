"""The timer of the window: it ticks regularly, and sooner when a reading has arrived."""

import time

from PySide6.QtCore import QObject, Qt, QTimer, Signal, Slot

TICK = 30  # ms
# ms between two ticks for readings; each paints the window. The fastest board makes 50 readings per second.
_READING_TICK = 18
_DRAG_TICK = 5  # ms: a draft that waits for its tick is late for the hand; a tick without news takes 0.3 ms


class TickTimer(QObject):
    """Emits `due` every TICK ms, more often during a drag, and soon after `wake`."""

    due = Signal()
    _woken = Signal()

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._last = -TICK / 1000  # time of the last tick, s
        self._waking = False  # whether `_woken` was emitted since the last tick
        self._timer = QTimer(self, interval=TICK, timerType=Qt.TimerType.PreciseTimer)
        self._timer.timeout.connect(self._tick)
        self._woken.connect(self._hurry, Qt.ConnectionType.QueuedConnection)
        self.start, self.stop = self._timer.start, self._timer.stop

    def wake(self) -> None:
        """Tick as soon as _READING_TICK has passed since the last tick. Any thread may call this."""
        if not self._waking:
            self._waking = True
            self._woken.emit()

    @Slot()
    def _hurry(self) -> None:
        if self._timer.isActive():
            since = 1000 * (time.monotonic() - self._last)
            self._timer.start(max(0, round(_READING_TICK - since)))

    @Slot()
    def _tick(self) -> None:
        self._last, self._waking = time.monotonic(), False
        self._timer.start(TICK)
        self.due.emit()

    def follow_drag(self, dragging: bool) -> None:
        """Tick more often during a drag."""
        interval = _DRAG_TICK if dragging else TICK
        if self._timer.isActive() and not self._waking and self._timer.interval() != interval:
            self._timer.start(interval)
