"""The menus: every command by name, where a person looks for it."""

from collections.abc import Sequence

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QMenuBar

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.view import View


def fill_menus(
    bar: QMenuBar,
    commands: Commands,
    recent: QMenu,
    views: Sequence[View],
    docks: Sequence[QAction],
) -> None:
    """Add every action to its menu. A view with actions of its own has a menu by its name, or a part of one."""
    file = bar.addMenu("&File")
    file.addActions([commands.open_room, commands.open_log, commands.recordings])
    file.addMenu(recent)
    file.addAction(commands.save_room)
    file.addSeparator()
    file.addActions([commands.keep_view, *commands.keep_beside.values(), commands.keep_window])
    file.addActions([commands.keep_data, commands.report])
    file.addSeparator()
    file.addAction(commands.close)
    scan = bar.addMenu("&Scan")
    scan.addAction(commands.connect_scanner)
    scan.addSeparator()
    scan.addActions([commands.scan, commands.stop, commands.home])
    scan.addSeparator()
    scan.addAction(commands.find)
    edit = bar.addMenu("&Edit")
    edit.addActions([commands.undo, commands.redo])
    edit.addSeparator()
    edit.addActions([commands.previous, commands.next, commands.newest])
    _fill_view_menus(bar, views)
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
    bar.addMenu("&Help").addAction(commands.help)


def _fill_view_menus(bar: QMenuBar, views: Sequence[View]) -> None:
    menus: dict[str, QMenu] = {}
    for view in sorted(views, key=lambda view: view.entry.name != view.entry.menu):
        name = view.entry.menu
        if name in menus:
            menus[name].addSeparator()
        elif name:
            menus[name] = bar.addMenu(f"&{name}")
        if name:
            menus[name].addActions(view.actions())
