"""A slider with a number field for the same value. One drag of the slider is one gesture, and so one undo step."""

from PySide6.QtCore import QSignalBlocker, Qt, Signal, Slot
from PySide6.QtWidgets import QHBoxLayout, QSizePolicy, QSlider, QWidget

from sonarhw_gui.parts.number_field import NumberField
from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus


class SliderField(QWidget):
    """A slider and a number field for one value between two bounds."""

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
            part.setAccessibleName(tip)
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
        """The current value."""
        return self.field.value()

    def show_value(self, value: float) -> None:
        """Show a value, except while the user drags the slider."""
        if self.slider.isSliderDown() or abs(value - self.field.value()) < self._step / 2:
            return
        self._set_both(value)

    def _set_both(self, value: float) -> None:
        with QSignalBlocker(self.slider), QSignalBlocker(self.field):
            self.slider.setValue(round((value - self._low) / self._step))
            self.field.setValue(value)

    @Slot()
    def _begin(self) -> None:
        self._gesture = object()

    @Slot(int)
    def _slid(self, steps: int) -> None:
        if not self.slider.isSliderDown():
            self._begin()  # changed by key or wheel
        self._set(self._low + steps * self._step)

    @Slot(float)
    def _typed(self, value: float) -> None:
        self._begin()
        self._set(value)

    def _set(self, value: float) -> None:
        self._set_both(value)
        self.changed.emit(self.field.value(), self._gesture)
