"""The command that opens the help page, whose groups are the menus."""

from typing import cast

from PySide6.QtCore import QEvent, QObject, QSize, Qt, Slot
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QMainWindow, QMenu

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.dialogs.command_palette import CommandPalette
from sonarhw_gui.dialogs.help_page import HelpPage
from sonarhw_gui.dialogs.one_dialog import close_dialogs
from sonarhw_gui.session.window_session import WindowSession

_FRAME = QSize(16, 48)  # pixels, for the frame of a dialog


class HelpCommands(QObject):
    """Opens and closes the help page."""

    def __init__(self, commands: Commands, session: WindowSession, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._session = session
        self.page: HelpPage | None = None
        commands.help.triggered.connect(self._open_or_close)
        commands.palette.triggered.connect(self._open_palette)
        self.palette: CommandPalette | None = None

    @Slot()
    def _open_or_close(self) -> None:
        if self.page is not None:
            self.page.close()
            return
        menus = (entry.menu() for entry in self._window.menuBar().actions())
        groups = {menu.title().replace("&", ""): _with_keys(menu) for menu in menus if isinstance(menu, QMenu)}
        room = self._window.screen().availableSize() - _FRAME
        self.page = HelpPage(groups, self._session.shown.look, self._window, room)
        self.page.destroyed.connect(self._forget)
        self._window.installEventFilter(self)
        close_dialogs(self._window, but=self.page)
        self.page.show()

    @Slot()
    def _open_palette(self) -> None:
        """Open the palette with all commands of window, views and docks."""
        actions = [action for action in self._window.findChildren(QAction) if _is_command(action)]
        close_dialogs(self._window)
        self.palette = CommandPalette(actions, self._window)
        self.palette.show()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let Esc in the window close an open help page first."""
        escape = event.type() is QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Escape
        if not escape or self.page is None:
            return False
        self.page.close()
        event.accept()
        return True

    @Slot()
    def _forget(self) -> None:
        self.page = None
        self._window.removeEventFilter(self)


def _is_command(action: QAction) -> bool:
    return bool(action.statusTip()) or not action.shortcut().isEmpty()


def _with_keys(menu: QMenu) -> list[QAction]:
    return [action for action in menu.actions() if not action.shortcut().isEmpty()]
