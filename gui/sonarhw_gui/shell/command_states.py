"""Which commands are possible now, and what Undo and Redo would change."""

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.scene.history import History


def show_history(commands: Commands, history: History) -> None:
    """Name the edits that Undo and Redo would change; without one, disable the command."""
    for action, name, label in (
        (commands.undo, "Undo", history.undo_label),
        (commands.redo, "Redo", history.redo_label),
    ):
        action.setText(f"{name} {label}".strip())
        action.setEnabled(bool(label))


def show_scanner(commands: Commands, status: Status) -> None:
    """Enable the commands that the scanner can follow now, and those that are possible while no scan runs."""
    commands.scan.setEnabled(status.can_scan and not status.scanning)
    commands.stop.setEnabled(status.scanning)
    commands.home.setEnabled(status.can_turn)
    for action in (commands.open_log, commands.open_room, commands.recordings):
        action.setEnabled(not status.scanning)
