"""The menus: every command by name, where one looks for it.

Takes the commands, the plan's tools, the choices of traces and B-scan, the docks and the menu of recent files; fills a
menu bar.
"""

from collections.abc import Sequence

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QMenuBar

from sonarhw_gui.commands.command_list import Commands


def fill_menus(
    bar: QMenuBar,
    commands: Commands,
    recent: QMenu,
    tools: Sequence[QAction],
    traces: Sequence[QAction],
    bscans: Sequence[QAction],
    docks: Sequence[QAction],
) -> None:
    """Every action by name, in the menu where one looks for it."""
    file = bar.addMenu("&File")
    file.addActions([commands.open_room, commands.open_log, commands.recordings])
    file.addMenu(recent)
    file.addAction(commands.save_room)
    file.addSeparator()
    file.addActions([commands.keep_view, commands.keep_trace, commands.keep_ranges, commands.keep_window])
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
    bar.addMenu("&Plan").addActions([*tools])
    trace = bar.addMenu("&Trace")
    trace.addActions([*traces])
    trace.addSeparator()
    trace.addActions([*bscans])
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
