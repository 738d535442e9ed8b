"""The menus, which list every command."""

from collections.abc import Iterator, Sequence

from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QMenuBar

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.view import View

_Group = Sequence[QAction]  # separated from the next one by a line


def fill_menus(
    bar: QMenuBar,
    commands: Commands,
    shipped: QMenu,
    recent: QMenu,
    steps: QMenu,
    layouts: QMenu,
    views: Sequence[View],
    docks: _Group,
) -> None:
    """Add every action to its menu. Actions of a view go to the menu that its `ViewEntry` names.

    `shipped`, `recent`: the menus of shipped rooms and of recent files; `steps`: that of undo steps; `layouts`: that of
    named layouts.
    """
    for name, groups in (
        *_menus_of_scans(commands, shipped, recent, steps),
        *_menus_of_views(views),
        *_menus_of_the_window(commands, [*docks, commands.reset_layout, layouts.menuAction()]),
    ):
        menu = bar.addMenu(f"&{name}")
        for number, group in enumerate(groups):
            if number:
                menu.addSeparator()
            menu.addActions(group)


def _menus_of_scans(
    commands: Commands, shipped: QMenu, recent: QMenu, steps: QMenu
) -> Iterator[tuple[str, list[_Group]]]:
    found = [commands.open_log, commands.import_scan, commands.recordings]
    rooms = [commands.open_room, shipped.menuAction()]
    opened = [*rooms, *found, recent.menuAction(), commands.save_room, commands.save_room_as]
    pictures = [
        commands.save_view,
        *commands.save_beside.values(),
        commands.copy_view,
        commands.print_view,
        commands.save_window,
        commands.save_film,
    ]
    yield "File", [opened, [*pictures, commands.export_data, commands.report], [commands.close]]
    run = [commands.scan, commands.stop, commands.home, commands.move_fake]
    yield "Scan", [[commands.connect_scanner], run, [commands.find]]
    yield (
        "Edit",
        [
            [commands.undo, commands.redo, steps.menuAction()],
            [commands.previous, commands.next, commands.newest],
            [commands.note, commands.delete_note],
        ],
    )


def _menus_of_views(views: Sequence[View]) -> list[tuple[str, list[_Group]]]:
    menus: dict[str, list[_Group]] = {}
    for view in sorted(views, key=lambda view: view.entry.name != view.entry.menu):
        if view.entry.menu:
            menus.setdefault(view.entry.menu, []).append(view.actions())
    return list(menus.items())


def _menus_of_the_window(commands: Commands, docks: _Group) -> Iterator[tuple[str, list[_Group]]]:
    steps = [commands.play, commands.back, commands.forward, commands.previous_scan, commands.next_scan]
    yield "Replay", [[*steps, commands.loop, commands.skip_gaps], [commands.leave_replay]]
    look = [commands.dark, *commands.units.actions(), commands.larger, commands.smaller, commands.default_size]
    yield "View", [[*commands.views.actions(), commands.fit, commands.sound], docks, look]
    yield "Help", [[commands.help, commands.first_steps, commands.palette]]
