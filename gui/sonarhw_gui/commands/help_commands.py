"""The command that opens the help page, which groups the actions as the menus do."""

from typing import cast

from PySide6.QtCore import QEvent, QObject, QSize, Qt, Slot
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QMainWindow, QMenu

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.commands.help_page import HelpPage
from sonarhw_gui.session.window_session import WindowSession

_FRAME = QSize(16, 48)  # pixels that the frame of a dialog may take


class HelpCommands(QObject):
    """Opens the page, and closes it again."""

    def __init__(self, commands: Commands, session: WindowSession, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._session = session
        self.page: HelpPage | None = None
        commands.help.triggered.connect(self._open_or_close)

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
        self.page.show()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Esc in the window closes the page that stands open beside it; only then has it its usual meaning."""
        asked = event.type() is QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Escape
        if not asked or self.page is None:
            return False
        self.page.close()
        event.accept()
        return True

    @Slot()
    def _forget(self) -> None:
        self.page = None
        self._window.removeEventFilter(self)


def _with_keys(menu: QMenu) -> list[QAction]:
    return [action for action in menu.actions() if not action.shortcut().isEmpty()]
