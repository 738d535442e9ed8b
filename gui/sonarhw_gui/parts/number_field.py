"""A field for a figure: a comma is a decimal point, nothing groups digits, and a half typed figure is none yet.

Takes what is typed; hands on the value once it is entered or the field is left.
"""

from typing import Any

from PySide6.QtCore import QLocale
from PySide6.QtWidgets import QDoubleSpinBox

from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus


class NumberField(QDoubleSpinBox):
    """A figure with decimals, written alike on every system."""

    def __init__(self, low: float, high: float, decimals: int = 2, suffix: str = "") -> None:
        super().__init__(decimals=decimals, minimum=low, maximum=high, suffix=suffix)
        plain = QLocale.c()
        plain.setNumberOptions(QLocale.NumberOption.OmitGroupSeparator | QLocale.NumberOption.RejectGroupSeparator)
        self.setLocale(plain)
        self.setKeyboardTracking(False)
        ignore_wheel_without_focus(self)

    def validate(self, text: str, at: int) -> Any:
        """Read a comma as a decimal point; the field then shows one."""
        return super().validate(text.replace(",", "."), at)
