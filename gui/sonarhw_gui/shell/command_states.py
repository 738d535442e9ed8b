"""The enabled commands, and the labels of Undo and Redo."""

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.scene.history import History


def show_history(commands: Commands, history: History) -> None:
    """Label Undo and Redo with their edits; disable a command without an edit."""
    for action, name, label in (
        (commands.undo, "Undo", history.undo_label),
        (commands.redo, "Redo", history.redo_label),
    ):
        action.setText(f"{name} {label}".strip())
        action.setEnabled(bool(label))


def show_scanner(commands: Commands, status: Status) -> None:
    """Enable the commands that are possible in this state of the scanner."""
    commands.scan.setEnabled(status.can_scan and not status.scanning)
    commands.stop.setEnabled(status.scanning)
    commands.home.setEnabled(status.can_turn)
    commands.move_fake.setEnabled(bool(status.fake_still))
    for action in (commands.open_log, commands.open_room, commands.import_scan, commands.recordings):
        action.setEnabled(not status.scanning)
