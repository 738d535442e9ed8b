"""A dock with one small view, under a thin title bar: it can be moved, floated, stacked as a tab and closed."""

from typing import cast

from PySide6.QtCore import QSize, Qt, Slot
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QDockWidget, QHBoxLayout, QStyle, QStyleOptionDockWidget, QToolButton, QWidget

from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.view import View

_BUTTON = 10  # pixels, icons of the title bar
_TEXT = 0.8  # of the default text size


class ViewDock(QDockWidget):
    """A dock with one view. Its name is the key of the stored layout."""

    def __init__(self, view: View, parent: QWidget) -> None:
        super().__init__(view.entry.name, parent)
        self.view = view
        self.in_front = False  # whether it is visible, and not behind another tab
        self.setObjectName(view.entry.name)
        self.setWidget(cast(QWidget, view))
        self._title = _TitleBar(self)
        self.setTitleBarWidget(self._title)
        self.opener = QAction(view.entry.name, self, checkable=True)
        self.opener.setStatusTip(f"Open, bring to the front or close the view {view.entry.name}")
        self.opener.triggered.connect(self._open_or_close)
        self.visibilityChanged.connect(self._note_visibility)

    def show_look(self, look: Look) -> None:
        """Use the text size of `look`."""
        self._title.name.setFont(text_font(look, _TEXT))

    @Slot(bool)
    def _note_visibility(self, visible: bool) -> None:
        self.in_front = visible
        self.opener.setChecked(visible)

    @Slot(bool)
    def _open_or_close(self, wanted: bool) -> None:
        self.setVisible(wanted)
        if wanted:
            self.raise_()


class _TitleBar(QWidget):
    """The name of a view, and buttons that float and close it; a drag of it moves the dock."""

    def __init__(self, dock: QDockWidget) -> None:
        super().__init__(dock)
        self.name = PlainLabel(dock.windowTitle())
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 0, 2, 0)
        row.setSpacing(0)
        row.addWidget(self.name, stretch=1)
        self.setToolTip("Drag to move this view: beside or onto another view, or out of the window")
        pixmap = QStyle.StandardPixmap
        for what, tip, icon in (
            ("float", "Float this view in a window of its own, or put it back", pixmap.SP_TitleBarNormalButton),
            ("close", "Close this view; the View menu opens it again", pixmap.SP_TitleBarCloseButton),
        ):
            button = QToolButton(autoRaise=True)
            button.setIcon(self.style().standardIcon(icon, QStyleOptionDockWidget(), dock))
            button.setIconSize(QSize(_BUTTON, _BUTTON))
            button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            button.setToolTip(tip)
            button.setAccessibleName(f"{what} {dock.windowTitle()}")
            button.clicked.connect(dock.close if what == "close" else self._float)
            row.addWidget(button)
        self._dock = dock

    @Slot()
    def _float(self) -> None:
        self._dock.setFloating(not self._dock.isFloating())
