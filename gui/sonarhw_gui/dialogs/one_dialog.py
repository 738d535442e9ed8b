"""One dialog at a time: opening a dialog closes the others of the window."""

from PySide6.QtWidgets import QDialog, QWidget


def close_dialogs(window: QWidget, but: QDialog | None = None) -> None:
    """Close every open dialog of `window`, except `but`."""
    for dialog in window.findChildren(QDialog):
        if dialog is not but and dialog.isVisible():
            dialog.close()
