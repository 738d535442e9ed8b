"""The `View` protocol: what the window needs of everything that draws readings and their prediction.

A view lives in a folder of its own. `shell/view_area.py` lists all views, one line each; nothing else names them.
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
    tip: str = ""  # of the command that shows it
    key: str = ""  # shows it; of large views
    picture_key: str = ""  # keeps a picture of it; of views beside the large one
    menu: str = ""  # of its actions; the view of that name comes first in it
    is_text: bool = False  # redrawn ten times a second only while a scan runs


class Gestures(QObject):
    """What a person does in a view. The window connects every gesture of every view with the session."""

    picked = Signal(int)  # a reading
    pointed = Signal(object)  # Cursor, or None where nothing is pointed at
    edited = Signal(object, str, object)  # Scene, what was done, the gesture that it belongs to or None
    cancelled = Signal(object)  # the gesture whose edits are taken back
    surface_chosen = Signal(object)  # name of a wall or post, or None
    bscan_requested = Signal(object)  # BScanSettings, or None while no B-scan is visible


@runtime_checkable
class View(Protocol):
    """A widget that draws what is shown. Every method is called in the window's thread."""

    entry: ViewEntry
    gestures: Gestures

    def show_state(self, shown: Shown) -> None:
        """Draw what differs from the last call; called while the view is visible."""

    def fit(self) -> None:
        """Reset the range of its plots."""

    def picture(self) -> QWidget | None:
        """Return the widget that a picture of this view contains; None: there is no such picture."""

    def actions(self) -> Sequence[QAction]:
        """Return the commands of this view, for the menus. Every QWidget has this."""

    def isVisibleTo(self, ancestor: QWidget) -> bool:
        """Return whether it is visible when `ancestor` is. Every QWidget has this."""
