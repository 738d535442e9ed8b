"""The `View` protocol: the interface between the window and a widget that draws readings and their prediction.

`shell/view_area.py` lists all views, one line each. No other module names them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QWidget

from sonarhw_gui.shown.shown import Shown


@dataclass(frozen=True)
class ViewEntry:
    """How commands, menus and file names list a view."""

    name: str
    tip: str = ""  # tooltip of the command that shows the view
    key: str = ""  # key that shows the view; large views only
    picture_key: str = ""  # key that saves a picture of the view; small views only
    menu: str = ""  # menu of its actions; the view of the same name comes first in it
    is_text: bool = False  # whether it is updated only ten times a second during a scan
    width: float = 0.54  # share of the width that a large view gets at first


class Gestures(QObject):
    """User actions in a view. The window connects all of them with the session."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor, or None when the mouse points at nothing
    edited = Signal(object, str, object)  # Scene, label for Undo, gesture or None; edits of one gesture are one step
    cancelled = Signal(object)  # the gesture whose edits are undone
    surface_chosen = Signal(object)  # name of a wall or post, or None
    switched = Signal(object, bool)  # a class or layer, and whether it becomes visible
    asked = Signal(float)  # a heading to explain without a reading, rad in the room
    turned_question = Signal(float)  # angle by which to turn the asked heading, rad
    path_pointed = Signal(object)  # row of a path of `Shown.question`, or None
    bscan_requested = Signal(object)  # BScanSettings, or None while no B-scan is visible


@runtime_checkable
class View(Protocol):
    """A widget that draws a `Shown`. Every method is called in the window's thread."""

    entry: ViewEntry
    gestures: Gestures

    def show_state(self, shown: Shown) -> None:
        """Draw the changes since the last call. Called only while the view is visible."""

    def fit(self) -> None:
        """Reset the range of its plots."""

    def picture(self) -> QWidget | None:
        """Return the widget to save as a picture, or None if this view has no picture."""

    def actions(self) -> Sequence[QAction]:
        """Return the commands of this view, for the menus. Implemented by QWidget."""

    def isVisibleTo(self, ancestor: QWidget) -> bool:
        """Return whether it is visible when `ancestor` is. Implemented by QWidget."""
