"""The context menus of the views: the view's own commands, its range, its picture, and hidden layers."""

from collections.abc import Sequence
from functools import partial
from typing import cast

from PySide6.QtCore import QObject, QPoint, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.session.shown_model import ShownModel
from sonarhw_gui.view import View


class ViewMenus(QObject):
    """Opens the context menu of a view where the user asks for it."""

    def __init__(self, views: Sequence[View], commands: Commands, showing: ShownModel) -> None:
        super().__init__()
        self.opened: QMenu | None = None  # the last menu
        self._commands, self._showing = commands, showing
        for view in views:
            widget = cast(QWidget, view)
            widget.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
            widget.customContextMenuRequested.connect(partial(self._open, view))

    def menu_of(self, view: View) -> QMenu:
        """Return a new menu with the commands of a view."""
        widget = cast(QWidget, view)
        menu = QMenu(widget)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.aboutToHide.connect(menu.deleteLater)  # a chosen action or a click elsewhere hides it without closing
        menu.addActions(view.actions())
        menu.addSeparator()
        menu.addActions([self._commands.note, self._commands.delete_note])
        menu.addSeparator()
        menu.addAction(_action(menu, "Fit this view", view.fit))
        show_all = _action(menu, "Show all layers", self._showing.show_all)
        show_all.setEnabled(bool(self._showing.shown.hidden))
        menu.addAction(show_all)
        if view.picture() is not None:
            menu.addSeparator()
            menu.addAction(self._commands.save_beside.get(view.entry.name, self._commands.save_view))
        return menu

    def _open(self, view: View, at: QPoint) -> None:
        self.opened = self.menu_of(view)
        self.opened.popup(cast(QWidget, view).mapToGlobal(at))


def _action(menu: QMenu, text: str, slot: object) -> QAction:
    action = QAction(text, menu)
    action.triggered.connect(slot)
    return action
