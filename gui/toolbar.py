"""Toolbar and menus: the same actions, the ones that are always needed within one click, all of them by name.

Takes the actions and the docks; hands on a toolbar with the list of places in it.
"""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QComboBox, QLabel, QMenuBar, QSizePolicy, QToolBar, QWidget

from gui.commands import Commands
from gui.shown import Shown


class ToolBar(QToolBar):
    """What is always within one click."""

    def __init__(self, commands: Commands) -> None:
        super().__init__("Main", movable=False)
        self.setObjectName("toolbar")
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self.place = QComboBox()
        self.place.setToolTip("Where in the room the scanner stands")
        self.addActions([commands.open_room, commands.open_log])
        self.addSeparator()
        self.addActions([commands.scan, commands.stop])
        self.addSeparator()
        self.addActions(commands.views.actions())
        self.addSeparator()
        self.addAction(commands.fit)
        self.addWidget(QLabel("  Place "))
        self.addWidget(self.place)
        gap = QWidget()
        gap.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        self.addWidget(gap)
        self.addAction(commands.dark)

    def show_state(self, shown: Shown) -> None:
        """Offer the places of the room."""
        names = [*shown.scene.room.places] if shown.scene.room else []
        here = shown.scene.standing.name
        if here and here not in names:
            names.append(here)  # a place given as X,Y
        if [self.place.itemText(k) for k in range(self.place.count())] != names:
            self.place.clear()
            self.place.addItems(names)
        self.place.setCurrentText(here)


def fill_menus(bar: QMenuBar, commands: Commands, tools: Sequence[QAction], docks: Sequence[QAction]) -> None:
    """Every action by name, in the menu where one looks for it."""
    scan = bar.addMenu("&Scan")
    scan.addActions([commands.open_room, commands.save_room, commands.open_log])
    scan.addSeparator()
    scan.addActions([commands.scan, commands.stop, commands.home])
    scan.addSeparator()
    scan.addAction(commands.close)
    edit = bar.addMenu("&Edit")
    edit.addActions([commands.undo, commands.redo])
    edit.addSeparator()
    edit.addActions([commands.previous, commands.next, commands.newest])
    bar.addMenu("&Plan").addActions([*tools])
    replay = bar.addMenu("&Replay")
    replay.addActions([commands.play, commands.back, commands.forth, commands.previous_scan, commands.next_scan])
    replay.addActions([commands.loop, commands.skip_gaps])
    replay.addSeparator()
    replay.addAction(commands.leave_replay)
    view = bar.addMenu("&View")
    view.addActions([*commands.views.actions(), commands.fit])
    view.addSeparator()
    view.addActions([*docks])
    view.addSeparator()
    view.addAction(commands.dark)
    view.addActions(commands.units.actions())
    view.addActions([commands.larger, commands.smaller, commands.usual_size])
