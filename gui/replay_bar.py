"""The replay bar: play and pause, a slider over the time of the log, the speed.

Takes how the replay stands; hands on what the person wants of it.
"""

import math
from typing import TypeVar

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QPushButton, QSlider, QStyle, QWidget

from gui.playback import SPEEDS
from gui.replay import ReplayState

_Widget = TypeVar("_Widget", bound=QWidget)
_STEPS_PER_SECOND = 1000  # of the slider
_MOST_STEPS = 2**31 - 1


class ReplayBar(QWidget):
    """Seen only while a log is shown."""

    toggled = Signal()
    sought = Signal(float)  # s
    speed_chosen = Signal(float)

    def __init__(self) -> None:
        super().__init__()
        self.play = _with_tip(QPushButton(), "Play the log on its recorded schedule, or pause (space)")
        self.play.setMinimumWidth(92)
        self.slider = _with_tip(QSlider(Qt.Orientation.Horizontal), "Where in the log; drag to scrub")
        self.time = QLabel()
        self.speed = _with_tip(QComboBox(), "How many times as fast as it was recorded")
        for speed in SPEEDS:
            self.speed.addItem(speed_name(speed), speed)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 2, 12, 6)
        row.setSpacing(10)
        for part in (self.play, self.slider, self.time, QLabel("Speed"), self.speed):
            row.addWidget(part, stretch=1 if part is self.slider else 0)
        self.play.clicked.connect(self.toggled)
        self.slider.valueChanged.connect(lambda value: self.sought.emit(value / _STEPS_PER_SECOND))
        self.speed.activated.connect(lambda index: self.speed_chosen.emit(SPEEDS[index]))
        self.hide()

    def show_state(self, state: ReplayState | None) -> None:
        """Show how the replay stands; without one the bar goes away."""
        self.setVisible(state is not None)
        if state is None:
            return
        self._show_playing(state.playing)
        self.time.setText(f"{clock(state.position)} / {clock(state.duration)}")
        self.speed.setCurrentIndex(SPEEDS.index(state.speed))
        with QSignalBlocker(self.slider):  # it follows here, it does not ask
            self.slider.setMaximum(min(round(state.duration * _STEPS_PER_SECOND), _MOST_STEPS))
            self.slider.setPageStep(max(1, self.slider.maximum() // 20))
            self.slider.setValue(round(state.position * _STEPS_PER_SECOND))

    def _show_playing(self, playing: bool) -> None:
        if self.play.text() != (wanted := "Pause" if playing else "Play"):
            # the style's own icons: not every font has the signs
            icon = QStyle.StandardPixmap.SP_MediaPause if playing else QStyle.StandardPixmap.SP_MediaPlay
            self.play.setIcon(self.style().standardIcon(icon))
            self.play.setText(wanted)


def _with_tip(widget: _Widget, tip: str) -> _Widget:
    widget.setToolTip(tip)
    return widget


def clock(seconds: float) -> str:
    """Minutes, seconds and tenths."""
    tenths = math.floor(seconds * 10 + 1e-6)
    return f"{tenths // 600:02d}:{tenths // 10 % 60:02d}.{tenths % 10}"


def speed_name(speed: float) -> str:
    """A speed as it stands in the list."""
    return "all at once" if math.isinf(speed) else f"{speed:g}×"
