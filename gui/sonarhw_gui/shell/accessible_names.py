"""Names of all tab stops for screen readers, from what the window shows beside them.

A widget that shows no text of its own takes the name from its label in a form, from its view, or from its tooltip.
"""

import re

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QFormLayout, QMainWindow, QScrollArea, QTabBar, QWidget

from sonarhw_gui.view import View


def name_tab_stops(window: QMainWindow) -> None:
    """Name every tab stop of a window that has no name yet."""
    for form in window.findChildren(QFormLayout):
        for row in range(form.rowCount()):
            _name_row(form, row)
    for stop in window.findChildren(QWidget):
        if stop.focusPolicy() & Qt.FocusPolicy.TabFocus and not spoken_name(stop):
            stop.setAccessibleName(_derived_name(stop))


def spoken_name(widget: QWidget) -> str:
    """Return what a screen reader says: the accessible name, or the text of a button."""
    text = widget.text().replace("&", "") if isinstance(widget, QAbstractButton) else ""
    return widget.accessibleName() or text


def _name_row(form: QFormLayout, row: int) -> None:
    item = form.itemAt(row, QFormLayout.ItemRole.FieldRole)
    field = item.widget() if item is not None else None
    label = form.labelForField(field) if field is not None else None
    text = str(label.property("text") or "") if label is not None else ""
    if field is None or not text:
        return
    for widget in (field, *field.findChildren(QWidget)):
        if widget.focusPolicy() & Qt.FocusPolicy.TabFocus and not spoken_name(widget):
            widget.setAccessibleName(text.replace("&", "").rstrip(":"))


def _derived_name(stop: QWidget) -> str:
    if isinstance(stop, QTabBar):
        return "tabs"
    tip = re.sub(r"<[^>]*>", "", stop.toolTip())
    if tip:
        return re.split(r"[;(.]", tip)[0].strip()
    parent: QWidget | None = stop
    while parent is not None and not isinstance(parent, View):  # slow, so only without a tooltip
        parent = parent.parentWidget()
    if parent is not None:
        return f"{parent.entry.name} plot"
    if isinstance(stop, QScrollArea):
        return "panel"
    above = stop.parentWidget()
    return above.accessibleName() or above.windowTitle() or type(above).__name__ if above is not None else ""
