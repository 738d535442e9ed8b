"""A drop-down list of names that does not widen its panel."""

from collections.abc import Iterable

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QComboBox

from sonarhw_gui.parts.wheel_filter import ignore_wheel_without_focus

_SHORT = 8  # characters, minimum width of a list


def short_list() -> QComboBox:
    """Return an empty list that does not widen the panel for a long name."""
    field = QComboBox()
    field.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    field.setMinimumContentsLength(_SHORT)
    ignore_wheel_without_focus(field)
    return field


def show_names(field: QComboBox, names: Iterable[str], current: str) -> None:
    """Fill a list with names and choose `current` if it is among them."""
    wanted = [*names]
    with QSignalBlocker(field):
        if [field.itemText(k) for k in range(field.count())] != wanted:
            field.clear()
            field.addItems(wanted)
        field.setCurrentIndex(wanted.index(current) if current in wanted else 0)
