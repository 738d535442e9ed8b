"""The toolbar: the most frequent commands, and the list of places."""

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QSizePolicy, QToolBar, QWidget

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.shown.shown import Shown

_PLACE = 11  # characters of a place given as X,Y in metres, to the millimetre


class ToolBar(QToolBar):
    """The most frequent commands, and the list of places."""

    def __init__(self, commands: Commands) -> None:
        super().__init__("Main", movable=False)
        self.setObjectName("toolbar")
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self.place = QComboBox()
        self.place.setToolTip("Place of the scanner in the room")
        self.place.setMinimumContentsLength(_PLACE)
        self.addActions([commands.open_room, commands.open_log, commands.connect_scanner])
        self.addSeparator()
        self.addActions([commands.scan, commands.stop])
        self.addSeparator()
        self.addActions(commands.views.actions())
        self.addSeparator()
        self.addAction(commands.fit)
        self.addWidget(self._named_place())
        gap = QWidget()
        gap.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(gap)
        self.addAction(commands.dark)

    def _named_place(self) -> QWidget:
        """Return name and list in one part: on a narrow screen both move behind the arrow of the toolbar."""
        part = QWidget()
        row = QHBoxLayout(part)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(PlainLabel("  Place "))
        row.addWidget(self.place)
        return part

    def show_state(self, shown: Shown) -> None:
        """List the places of the room."""
        names = [*shown.scene.room.places] if shown.scene.room else []
        here = shown.scene.pose.name
        if here and here not in names:
            names.append(here)  # a place given as X,Y
        if [self.place.itemText(k) for k in range(self.place.count())] != names:
            self.place.clear()
            self.place.addItems(names)
        self.place.setCurrentText(here)
