"""Actions of a view, each with a key and a button. Menus and the help page list them too."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QLayout, QToolButton, QWidget


def view_action(owner: QWidget, text: str, key: str, tip: str, checkable: bool = True) -> QAction:
    """Return an action of `owner` with a key that works in the whole window."""
    action = QAction(text, owner)
    action.setShortcut(QKeySequence(key))
    action.setToolTip(f"{tip} ({key})")
    action.setStatusTip(tip)
    action.setCheckable(checkable)
    owner.addAction(action)
    return action


def add_buttons(row: QLayout, actions: Sequence[QAction]) -> None:
    """Add a flat button for each action."""
    for action in actions:
        button = QToolButton()
        button.setAutoRaise(True)
        button.setDefaultAction(action)
        button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the window keeps the keyboard focus
        row.addWidget(button)
