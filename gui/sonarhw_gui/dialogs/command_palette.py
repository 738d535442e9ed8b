"""The command palette: type words of a command's name or of its description, and run it with Enter."""

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QObject, Qt, Slot
from PySide6.QtGui import QAction, QKeyEvent
from PySide6.QtWidgets import QDialog, QLineEdit, QListWidget, QListWidgetItem, QVBoxLayout, QWidget

_SIZE = 420, 360  # pixels
_STEPS = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown)


class CommandPalette(QDialog):
    """Lists the enabled commands with all typed words: first those with the words in their names. Not modal."""

    def __init__(self, actions: Sequence[QAction], parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle("sonarhw — commands")
        self._actions = {plain_name(action): action for action in actions if action.isEnabled() and action.text()}
        self.words, self.list = QLineEdit(placeholderText="part of a command"), QListWidget()
        self.words.setAccessibleName("Part of a command")
        self.list.setAccessibleName("Commands")
        self.list.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # the arrow keys work while the words have the focus
        self.words.textChanged.connect(self._filter)
        self.words.returnPressed.connect(self._run)
        self.list.itemClicked.connect(self._run)
        self.words.installEventFilter(self)
        column = QVBoxLayout(self)
        column.addWidget(self.words)
        column.addWidget(self.list)
        self.resize(*_SIZE)
        self._filter("")

    @property
    def names(self) -> list[str]:
        """The names listed."""
        return [self.list.item(row).data(Qt.ItemDataRole.UserRole) for row in range(self.list.count())]

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let the arrow keys move in the list."""
        if event.type() is QEvent.Type.KeyPress and isinstance(event, QKeyEvent) and event.key() in _STEPS:
            self.list.event(event)
            return True
        return super().eventFilter(watched, event)

    @Slot(str)
    def _filter(self, text: str) -> None:
        self.list.clear()
        words = text.casefold().split()
        found = [one for one in self._actions.items() if _has(f"{one[0]} {one[1].toolTip()}", words)]
        for name, action in sorted(found, key=lambda one: not _has(one[0], words)):
            item = QListWidgetItem(f"{name}    {action.shortcut().toString()}".rstrip())
            item.setData(Qt.ItemDataRole.UserRole, name)
            self.list.addItem(item)
        self.list.setCurrentRow(0)

    @Slot()
    def _run(self) -> None:
        item = self.list.currentItem()
        if item is None:
            return
        action = self._actions[item.data(Qt.ItemDataRole.UserRole)]
        self.close()
        action.trigger()


def _has(text: str, words: Sequence[str]) -> bool:
    return all(word in text.casefold() for word in words)


def plain_name(action: QAction) -> str:
    """Return the name of a command without its symbols."""
    return action.text().replace("&", "").strip("▶■● …")
