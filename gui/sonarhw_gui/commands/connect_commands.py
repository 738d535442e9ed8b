"""The command that connects a scanner: opens the dialog and lists the ports in it."""

from PySide6.QtCore import QObject, Slot
from PySide6.QtWidgets import QMainWindow

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.dialogs.connect_dialog import ConnectDialog, open_connect_dialog
from sonarhw_gui.dialogs.one_dialog import close_dialogs
from sonarhw_gui.session.scanner_choice import ScannerChoice


class ConnectCommands(QObject):
    """Opens at most one dialog at a time."""

    def __init__(self, commands: Commands, scanners: ScannerChoice, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._scanners = scanners
        self.dialog: ConnectDialog | None = None
        commands.connect_scanner.setEnabled(scanners.possible)
        commands.connect_scanner.triggered.connect(self._open)

    @Slot()
    def _open(self) -> None:
        if self.dialog is None:
            self.dialog = dialog = open_connect_dialog(self._window)
            dialog.show_urls(self._scanners.urls)
            dialog.chosen.connect(self._scanners.choose)
            dialog.refreshed.connect(self._scanners.list_ports)
            dialog.probe_all_requested.connect(self._scanners.probe_all)
            dialog.listen_requested.connect(self._scanners.listen)
            self._scanners.ports_changed.connect(dialog.show_ports)
            dialog.destroyed.connect(self._forget)
            dialog.show_ports(())
            self._scanners.list_ports()
        close_dialogs(self._window, but=self.dialog)
        self.dialog.show()
        self.dialog.raise_()

    @Slot()
    def _forget(self) -> None:
        self.dialog = None
