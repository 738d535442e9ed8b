"""The commands for notes on readings: add, edit and delete the note of the selected reading."""

from PySide6.QtCore import QObject, Qt, Slot
from PySide6.QtWidgets import QInputDialog, QLineEdit, QWidget
from sonarhw_compare.scans import MOST_CHARACTERS, heading_text, note_text

from sonarhw.readings import Reading
from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.dialogs.one_dialog import close_dialogs
from sonarhw_gui.session.window_session import WindowSession
from sonarhw_gui.shown.shown import Shown

_WIDTH = 420  # pixels


class NoteCommands(QObject):
    """Asks for the text of a note in a dialog that is not modal."""

    def __init__(self, commands: Commands, session: WindowSession, window: QWidget) -> None:
        super().__init__(window)
        self._commands, self._session, self._window = commands, session, window
        self.dialog: QInputDialog | None = None
        self._about: tuple[int, Reading] | None = None  # the reading of the dialog
        commands.note.triggered.connect(self._ask)
        commands.delete_note.triggered.connect(self._delete)

    def show_state(self, shown: Shown) -> None:
        """Enable the commands that are possible with the selected reading."""
        noted = bool(shown.notes.of(shown.chosen))
        text = "Edit note…" if noted else "Add note…"
        if self._commands.note.text() != text:
            self._commands.note.setText(text)
        self._commands.note.setEnabled(shown.chosen is not None and shown.asked is None)
        self._commands.delete_note.setEnabled(noted and shown.asked is None)

    @Slot()
    def _ask(self) -> None:
        shown = self._session.shown
        if shown.chosen is None:
            return
        close_dialogs(self._window)
        self._about = shown.chosen, shown.readings[shown.chosen]
        self.dialog = dialog = QInputDialog(self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle(self._commands.note.text().strip("…"))
        dialog.setLabelText(f"Note on reading {shown.chosen} at {heading_text(shown.heading(shown.chosen))}")
        dialog.setTextValue(shown.notes.of(shown.chosen))
        dialog.resize(_WIDTH, dialog.sizeHint().height())
        dialog.textValueSelected.connect(self._pin)
        field = dialog.findChild(QLineEdit)
        if field is not None:
            field.setMaxLength(MOST_CHARACTERS)
            field.setAccessibleName("Note")
        dialog.show()

    @Slot(str)
    def _pin(self, typed: str) -> None:
        if self._about is not None and self._session.showing.has_reading(*self._about):
            self._session.showing.pin(self._about[0], note_text(typed))
        else:
            self._session.warned.emit(f"other readings are shown now; this note was not saved: {note_text(typed)}")

    @Slot()
    def _delete(self) -> None:
        shown = self._session.shown
        if shown.chosen is not None:
            self._session.showing.pin(shown.chosen, "")
