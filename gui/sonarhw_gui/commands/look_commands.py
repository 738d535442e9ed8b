"""The commands for the look: light or dark, unit of length, size of text."""

from dataclasses import replace

from PySide6.QtCore import QObject, Slot
from PySide6.QtGui import QAction

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.look.appearance import LengthUnit, Look
from sonarhw_gui.look.palette import DARK, LIGHT
from sonarhw_gui.session.window_session import WindowSession

_STEP = 1.1  # factor of the text size


class LookCommands(QObject):
    """Connects the commands for the look with the session."""

    def __init__(self, commands: Commands, session: WindowSession, parent: QObject) -> None:
        super().__init__(parent)
        self._commands = commands
        self._session = session
        for unit, action in zip(LengthUnit, commands.units.actions(), strict=True):
            action.setData(unit.name)
        commands.units.triggered.connect(self._choose_unit)
        commands.dark.triggered.connect(self._choose_palette)
        commands.larger.triggered.connect(self._enlarge)
        commands.smaller.triggered.connect(self._shrink)
        commands.default_size.triggered.connect(self._reset_size)

    def show_look(self, look: Look) -> None:
        """Check the commands of the current look."""
        self._commands.dark.setChecked(look.palette is DARK)
        for action in self._commands.units.actions():
            action.setChecked(action.data() == look.unit.name)

    @property
    def _look(self) -> Look:
        return self._session.shown.look

    @Slot(QAction)
    def _choose_unit(self, action: QAction) -> None:
        self._session.showing.set_look(replace(self._look, unit=LengthUnit[action.data()]))

    @Slot(bool)
    def _choose_palette(self, dark: bool) -> None:
        self._session.showing.set_look(replace(self._look, palette=DARK if dark else LIGHT))

    @Slot()
    def _enlarge(self) -> None:
        self._session.showing.set_look(self._look.scaled(self._look.scale * _STEP))

    @Slot()
    def _shrink(self) -> None:
        self._session.showing.set_look(self._look.scaled(self._look.scale / _STEP))

    @Slot()
    def _reset_size(self) -> None:
        self._session.showing.set_look(self._look.scaled(1.0))
