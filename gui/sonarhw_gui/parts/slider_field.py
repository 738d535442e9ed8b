"""An amount that a hand sets: a slider for the feel, a field for the figure.

Takes a value to show; hands on the value that a hand set and the gesture it belongs to: one drag of the slider is one.
"""

from PySide6.QtCore import QSignalBlocker, Qt, Signal, Slot
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QSlider, QWidget

from sonarhw_gui.parts.number_field import NumberField
from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus


class SliderField(QWidget):
    """One amount between two bounds."""

    changed = Signal(float, object)  # the value, the gesture

    def __init__(self, low: float, high: float, decimals: int, suffix: str, tip: str) -> None:
        super().__init__()
        self._step = 10.0**-decimals
        self._low = low
        self._gesture = object()
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setRange(0, round((high - low) / self._step))
        self.slider.setPageStep(max(1, self.slider.maximum() // 10))
        ignore_wheel_without_focus(self.slider)
        self.field = NumberField(low, high, decimals, suffix)
        self.field.setSingleStep(self._step)
        self.field.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        for part in (self.slider, self.field):
            part.setToolTip(tip)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.slider, stretch=1)
        row.addWidget(self.field)
        self.setFocusProxy(self.slider)
        self.slider.sliderPressed.connect(self._begin)
        self.slider.valueChanged.connect(self._slid)
        self.field.valueChanged.connect(self._typed)

    @property
    def value(self) -> float:
        """What it stands at."""
        return self.field.value()

    def show_value(self, value: float) -> None:
        """Stand at a value; a hand that is just setting it is left alone."""
        if self.slider.isSliderDown() or abs(value - self.field.value()) < self._step / 2:
            return
        self._stand_at(value)

    def _stand_at(self, value: float) -> None:
        with QSignalBlocker(self.slider), QSignalBlocker(self.field):
            self.slider.setValue(round((value - self._low) / self._step))
            self.field.setValue(value)

    @Slot()
    def _begin(self) -> None:
        self._gesture = object()

    @Slot(int)
    def _slid(self, steps: int) -> None:
        if not self.slider.isSliderDown():
            self._begin()  # a key or the wheel
        self._set(self._low + steps * self._step)

    @Slot(float)
    def _typed(self, value: float) -> None:
        self._begin()
        self._set(value)

    def _set(self, value: float) -> None:
        self._stand_at(value)
        self.changed.emit(self.field.value(), self._gesture)
