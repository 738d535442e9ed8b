"""A slider over the time of a log, in whole milliseconds, with a mark at the start of each scan."""

from PySide6.QtCore import QRect, QRectF, QSignalBlocker, Qt, Signal
from PySide6.QtGui import QMouseEvent, QPainter, QPaintEvent
from PySide6.QtWidgets import QSlider, QStyle, QStyleOptionSlider

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.session.replay_control import ReplayState

_STEPS_PER_SECOND = 1000
_MOST_STEPS = 2**31 - 1
_MARK = 3.0  # pixels
_MOST_MARKS = 400  # more marks would merge into a bar


class TimeSlider(QSlider):
    """The position in the log."""

    sought = Signal(float)  # s

    def __init__(self) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._look = Look()
        self._scans: tuple[float, ...] = ()
        self.setMinimumWidth(60)
        self.setToolTip("Position in the log; drag or click to move. Marks show where scans begin")
        self.valueChanged.connect(self._seek)

    def show_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        self._look = look
        self.update()

    def show_state(self, state: ReplayState) -> None:
        """Show the state of the replay."""
        with QSignalBlocker(self):  # not a request to seek
            self.setMaximum(min(round(state.duration * _STEPS_PER_SECOND), _MOST_STEPS))
            self.setPageStep(max(1, self.maximum() // 20))
            self.setValue(round(state.position * _STEPS_PER_SECOND))
        if state.scans != self._scans:
            self._scans = state.scans
            self.update()

    @property
    def marks(self) -> list[float]:
        """The positions of the marks, pixels from the left."""
        return [self._pixel(begin) for begin in self._scans]

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Move the handle to the mouse; Qt's own slider would move by one page."""
        if event.button() is Qt.MouseButton.LeftButton and not self._handle().contains(event.position().toPoint()):
            left, span = self._groove()
            self.setValue(
                QStyle.sliderValueFromPosition(
                    self.minimum(), self.maximum(), round(event.position().x() - left), round(span)
                )
            )
        super().mousePressEvent(event)  # a drag continues from there

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the marks below the slider."""
        if 1 < len(self._scans) <= _MOST_MARKS:
            with QPainter(self) as painter:
                for at in self.marks:
                    painter.fillRect(QRectF(at - _MARK / 2, 0, _MARK, self.height()), self._look.palette.predicted)
        super().paintEvent(event)

    def _seek(self, value: int) -> None:
        self.sought.emit(value / _STEPS_PER_SECOND)

    def _pixel(self, position: float) -> float:
        left, span = self._groove()
        return left + span * position * _STEPS_PER_SECOND / max(self.maximum(), 1)

    def _groove(self) -> tuple[float, float]:
        """Return the leftmost position of the handle's middle, and the distance that it can move, pixels."""
        handle = self._handle().width()
        return handle / 2, max(1.0, self.width() - handle)

    def _handle(self) -> QRect:
        option = QStyleOptionSlider()
        self.initStyleOption(option)
        return self.style().subControlRect(
            QStyle.ComplexControl.CC_Slider, option, QStyle.SubControl.SC_SliderHandle, self
        )
