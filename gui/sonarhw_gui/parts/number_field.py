"""A number field without digit grouping that accepts a comma as the decimal point.

A value is applied on Enter or when the field loses the focus; incomplete input is not applied.
"""

from typing import Any

from PySide6.QtCore import QLocale
from PySide6.QtWidgets import QDoubleSpinBox

from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus


class NumberField(QDoubleSpinBox):
    """A number with decimals, in the same format on every system."""

    def __init__(self, low: float, high: float, decimals: int = 2, suffix: str = "") -> None:
        super().__init__(decimals=decimals, minimum=low, maximum=high, suffix=suffix)
        plain = QLocale.c()
        plain.setNumberOptions(QLocale.NumberOption.OmitGroupSeparator | QLocale.NumberOption.RejectGroupSeparator)
        self.setLocale(plain)
        self.setKeyboardTracking(False)
        ignore_wheel_without_focus(self)

    def validate(self, text: str, at: int) -> Any:
        """Accept a comma and replace it by a decimal point."""
        return super().validate(text.replace(",", "."), at)
