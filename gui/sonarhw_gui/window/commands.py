"""The commands of the window, as one table. Menus, keys, tooltips, palette, help and enabled states follow from it."""

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from operator import attrgetter
from typing import cast

import PySide6
from PySide6.QtCore import QByteArray, QObject, QPoint, QRect, QSize, Qt, Slot, qVersion
from PySide6.QtGui import QAction, QActionGroup, QImage, QKeySequence, QPageLayout, QPainter
from PySide6.QtPrintSupport import QPrinter, QPrintPreviewDialog
from PySide6.QtWidgets import QMainWindow, QMenu, QMenuBar, QMessageBox, QWidget
from sonarhw_compare.scans import MOST_CHARACTERS, note_text

from sonarhw.errors import heading_text
from sonarhw.export import export_suffixes
from sonarhw.readings import Reading
from sonarhw_gui.model.look import DARK, LIGHT, LengthUnit, Look
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.session.showing import ShownModel
from sonarhw_gui.views.base import View, ViewEntry
from sonarhw_gui.widgets import show_alone
from sonarhw_gui.window.dialogs import CommandPalette, ConnectDialog, HelpPage, NewRoomDialog, ask_text, open_dialog

_FORMATS = " or ".join(suffix[1:].upper() for suffix in export_suffixes())
_LARGER = 1.1  # factor of the text size
_MOST_STEPS = 30  # of undo in the menu; a longer menu would not fit a screen
_RESOLUTION = 300  # dots per inch, of a printed view
_FRAME = QSize(16, 48)  # pixels, for the frame of a dialog
_LINE = ""  # between two parts of a menu
Layout = tuple[QByteArray, QByteArray]  # panels of the window, and views, as Qt saves them


@dataclass(frozen=True)
class WindowCommand:
    """One command: what it runs, its texts, and when it is enabled and checked."""

    method: str  # path from the window to the method that it runs; its last part names the command in the code
    text: str
    key: str  # or several, separated by "; "
    tip: str
    enabled: Callable[[WindowSession], bool] = lambda _: True
    checked: Callable[[WindowSession], bool] | None = None  # None: not checkable, or checked by its group alone
    label: Callable[[WindowSession], str] | None = None  # a text that changes
    group: str = ""  # of commands of which exactly one is checked, at first the first one
    argument: object = None  # of the method; None: it has none

    @property
    def name(self) -> str:
        """The name of the command in the code."""
        name = self.method.rpartition(".")[2]
        return name if self.argument is None else f"{name} {self.argument}"


def _idle(session: WindowSession) -> bool:
    return not session.status.scanning


def _scans(session: WindowSession) -> bool:
    return session.status.scanning


def _can_scan(session: WindowSession) -> bool:
    return session.status.can_scan


def _can_turn(session: WindowSession) -> bool:
    return session.status.can_turn


def _can_connect(session: WindowSession) -> bool:
    return session.scanners.possible


def _has_room(session: WindowSession) -> bool:
    return _idle(session) and session.shown.scene.room is not None


def _can_fake(session: WindowSession) -> bool:
    return _can_connect(session) and _has_room(session)


def _has_readings(session: WindowSession) -> bool:
    return _idle(session) and (session.replay is not None or bool(session.live.readings))


def _replays(session: WindowSession) -> bool:
    return session.replay is not None


def _loops(session: WindowSession) -> bool:
    return session.replay is not None and session.replay.loop


def _skips(session: WindowSession) -> bool:
    return session.replay is not None and session.replay.skip_gaps


def _undo(session: WindowSession) -> str:
    return f"Undo {session.showing.history.undo_label}".strip()


def _redo(session: WindowSession) -> str:
    return f"Redo {session.showing.history.redo_label}".strip()


def _can_undo(session: WindowSession) -> bool:
    return bool(session.showing.history.undo_label)


def _can_redo(session: WindowSession) -> bool:
    return bool(session.showing.history.redo_label)


def _can_note(session: WindowSession) -> bool:
    return session.shown.chosen is not None and session.shown.asked is None


def _is_noted(session: WindowSession) -> bool:
    return _can_note(session) and bool(session.shown.notes.of(session.shown.chosen))


def _note(session: WindowSession) -> str:
    return "Edit note…" if session.shown.notes.of(session.shown.chosen) else "Add note…"


def _is_dark(session: WindowSession) -> bool:
    return session.shown.look.palette is DARK


def _unit(name: str, unit: LengthUnit, key: str) -> WindowCommand:
    def is_used(session: WindowSession) -> bool:
        return session.shown.look.unit is unit

    tip = f"Show lengths in {name.lower()}"
    return WindowCommand("slots.use_unit", name, key, tip, checked=is_used, group="units", argument=unit)


# by the titles of the menus; a text stands for actions that are not in this table
_MENUS: dict[str, Sequence[WindowCommand | str]] = {
    "File": (
        WindowCommand(
            "slots.new_room", "New room…", "Ctrl+N", "Draw a room: name and size, then walls and posts", _idle
        ),
        WindowCommand("files.open_room", "Open room…", "Ctrl+R", "Show the readings in a room from a file", _idle),
        "shipped rooms",
        WindowCommand("files.open_log", "Open log…", "Ctrl+O", "Open a recorded scan for replay", _idle),
        WindowCommand(
            "files.import_scan", "Import scan…", "Ctrl+I", "Read scans of other programs, after a preview", _idle
        ),
        WindowCommand("files.show_recordings", "Recordings…", "Ctrl+Shift+O", "Search earlier recordings", _idle),
        "recent files",
        WindowCommand(
            "files.save_room", "Save room", "Ctrl+S", "Save the room with its edits, in its file if it has one"
        ),
        WindowCommand(
            "files.save_room_as", "Save room as…", "Ctrl+Shift+S", "Save the room with its edits in another file"
        ),
        WindowCommand("session.close_room", "Close room", "Ctrl+Shift+R", "Show readings without a room", _has_room),
        WindowCommand(
            "session.close_readings",
            "Close readings",
            "Ctrl+Shift+W",
            "Show no readings; their recording is kept",
            _has_readings,
        ),
        _LINE,
        WindowCommand(
            "saving.save_view", "Picture of the large view…", "Ctrl+P", "Save the large view as PNG, PDF or SVG"
        ),
        "pictures of small views",
        WindowCommand("saving.copy_view", "Copy picture", "Ctrl+Shift+C", "Copy the large view as a picture"),
        WindowCommand("slots.print_view", "Print…", "Ctrl+Alt+Shift+P", "Print the large view, after a preview"),
        WindowCommand("saving.save_window", "Picture of the window…", "Ctrl+Shift+P", "Save the whole window as PNG"),
        WindowCommand(
            "saving.save_film", "Film of the sound…", "Ctrl+Alt+F", "Save the sound of this heading as a film"
        ),
        WindowCommand(
            "saving.export_data", "Export data…", "Ctrl+E", f"Save the readings as {_FORMATS}, or the summary as JSON"
        ),
        WindowCommand(
            "saving.save_report", "Report…", "Ctrl+Shift+E", "One HTML file: pictures, summary, every reading, settings"
        ),
        _LINE,
        WindowCommand("close", "Close", "Ctrl+Q", "Stop the scan and close the window"),
    ),
    "Scan": (
        WindowCommand(
            "slots.connect_scanner",
            "Connect…",
            "Ctrl+K",
            "Choose a scanner: a port of this computer, or a URL",
            _can_connect,
        ),
        WindowCommand(
            "session.connect_fake",
            "Fake scanner in this room",
            "Ctrl+Shift+K",
            "Scan without hardware: each scan is made in the room and at the place that the plan shows",
            _can_fake,
        ),
        _LINE,
        WindowCommand("session.scan", "▶ Scan", "F5", "Home the turntable, scan, record", _can_scan),
        WindowCommand("session.stop", "■ Stop", "F6", "Stop the scanner at once; readings so far are kept", _scans),
        WindowCommand("session.live.home", "Home", "Ctrl+H", "Find the zero of the turntable", _can_turn),
    ),
    "Edit": (
        WindowCommand("session.showing.undo", "Undo", "Ctrl+Z", "Undo the last edit", _can_undo, label=_undo),
        WindowCommand(
            "session.showing.redo",
            "Redo",
            "Ctrl+Shift+Z",
            "Repeat the edit that was undone last",
            _can_redo,
            label=_redo,
        ),
        "undo steps",
        _LINE,
        WindowCommand("session.showing.choose_previous", "Previous reading", "Left", "Select the previous reading"),
        WindowCommand("session.showing.choose_next", "Next reading", "Right", "Select the next reading"),
        WindowCommand("session.showing.follow_newest", "Newest reading", "Esc", "Select and follow the newest reading"),
        _LINE,
        WindowCommand(
            "slots.edit_note",
            "Add note…",
            "N",
            "Pin a note to the selected reading; it is kept beside the log",
            _can_note,
            label=_note,
        ),
        WindowCommand(
            "slots.delete_note", "Delete note", "Shift+N", "Delete the note of the selected reading", _is_noted
        ),
    ),
    "": (),  # the menus of the views
    "Analyse": (
        WindowCommand("find_pose", "Find pose", "Ctrl+J", "Fit the pose of the scanner to its readings"),
        WindowCommand(
            "find_causes", "Find the cause", "Ctrl+Shift+J", "Search for changes of the room that explain the misfits"
        ),
        WindowCommand(
            "list_echoes", "All echoes", "Ctrl+Shift+L", "List all echoes that the model predicts at this heading"
        ),
        "analyses",
    ),
    "Replay": (
        WindowCommand("slots.toggle", "Play or pause", "Space", "Replay the log, or pause", _replays),
        WindowCommand("slots.step_back", "Step back", ",", "Pause at the previous reading", _replays),
        WindowCommand("slots.step_forward", "Step forward", ".", "Pause at the next reading", _replays),
        WindowCommand("slots.previous_scan", "Previous scan", "Ctrl+Left", "Go back to the start of a scan", _replays),
        WindowCommand("slots.next_scan", "Next scan", "Ctrl+Right", "Go to the start of the next scan", _replays),
        WindowCommand("slots.set_loop", "Loop", "Ctrl+L", "Restart the replay at its end", _replays, _loops),
        WindowCommand(
            "slots.set_skip_gaps", "Skip gaps", "Ctrl+G", "Skip long waits without readings", _replays, _skips
        ),
        _LINE,
        WindowCommand(
            "session.leave_replay", "Leave replay", "Ctrl+W", "Close the log, and return to the live scan", _replays
        ),
    ),
    "View": (
        "large views",
        WindowCommand("views.fit", "Zoom to all", "F", "Show the whole room, all headings and the whole trace"),
        WindowCommand(
            "session.play_sound", "Play sound", "S", "Show the sound of this heading on its way, in slow motion"
        ),
        _LINE,
        "docks",
        WindowCommand("views.reset_layout", "Reset layout", "Ctrl+Alt+0", "Put all views back in their places"),
        "layouts",
        _LINE,
        WindowCommand("slots.switch_palette", "Dark", "Ctrl+D", "Switch between dark and light", checked=_is_dark),
        _unit("Metres", LengthUnit.M, "Ctrl+1"),
        _unit("Centimetres", LengthUnit.CM, "Ctrl+2"),
        _unit("Feet", LengthUnit.FT, "Ctrl+3"),
        WindowCommand("slots.scale_text", "Larger text", "Ctrl++; Ctrl+=", "Enlarge all text", argument=_LARGER),
        WindowCommand("slots.scale_text", "Smaller text", "Ctrl+-", "Shrink all text", argument=1 / _LARGER),
        WindowCommand("slots.reset_text", "Default text", "Ctrl+0", "Reset the text size"),
    ),
    "Help": (
        WindowCommand("slots.show_help", "Help", "F1", "All keys on one page"),
        WindowCommand(
            "hint.show_first_steps", "First steps", "Shift+F1", "What is measured, what is predicted, where to click"
        ),
        WindowCommand("slots.show_palette", "Commands…", "Ctrl+Shift+A", "Search all commands by words, and run one"),
        WindowCommand(
            "session.watch_demo", "Demo", "Ctrl+Shift+D", "Watch a fake scanner in the demo room", _can_connect
        ),
        WindowCommand("slots.show_about", "About sonarhw", "Ctrl+F1", "The versions of sonarhw, Python and Qt"),
    ),
}


class Commands:
    """The actions of all commands, by name: `commands.scan`."""

    def __init__(self, owner: QWidget, views: Sequence[ViewEntry] = ()) -> None:
        """`views`: the views of the window; each has a command that shows it or one that saves a picture of it."""
        self._owner = owner
        self._menus = {
            menu: [view for entry in entries for view in _with_views(entry, views)] for menu, entries in _MENUS.items()
        }
        self._commands = [
            command for entries in self._menus.values() for command in entries if isinstance(command, WindowCommand)
        ]
        self._groups: dict[str, QActionGroup] = {}
        self.actions = {command.name: self._action(command) for command in self._commands}
        self._shown_states: dict[str, tuple[bool, str | None]] = {}  # enabled and label, by name
        self.stop.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)  # from a dialog in front, too

    def __getattr__(self, name: str) -> QAction:
        """Return the action of a command."""
        actions: dict[str, QAction] = self.__dict__.get("actions", {})
        if name not in actions:
            raise AttributeError(name)
        return actions[name]

    @property
    def views(self) -> list[QAction]:
        """The actions that show a large view."""
        return self._groups["views"].actions()

    def connect(self, window: object) -> None:
        """Let each command run its method of the window or of its parts."""
        for command in self._commands:
            method = attrgetter(command.method)(window)
            slot = method if command.argument is None else partial(method, command.argument)
            self.actions[command.name].triggered.connect(slot)

    def show_state(self, session: WindowSession) -> None:
        """Enable, check and label the commands."""
        for command, (name, action) in zip(self._commands, self.actions.items(), strict=True):
            if command.checked is not None:  # a click has changed it, even if it changed nothing else
                action.setChecked(command.checked(session))
            enabled, label = command.enabled(session), command.label(session) if command.label else None
            if self._shown_states.get(name) == (enabled, label):
                continue
            self._shown_states[name] = enabled, label
            action.setEnabled(enabled)
            if label is not None:
                action.setText(label)

    def fill(self, bar: QMenuBar, views: Sequence[View], added: Mapping[str, Sequence[QAction]]) -> None:
        """Add the menus; those of the views have the actions of the views. `added`: actions that the table names."""
        for title, entries in self._menus.items():
            if not title:
                _add_view_menus(bar, views)
                continue
            menu = bar.addMenu(f"&{title}")
            for entry in entries:
                if isinstance(entry, WindowCommand):
                    menu.addAction(self.actions[entry.name])
                elif entry == _LINE:
                    menu.addSeparator()
                else:
                    menu.addActions(added[entry])

    def _action(self, command: WindowCommand) -> QAction:
        first, *_ = keys = QKeySequence.listFromString(command.key)
        action = QAction(command.text, self._owner)
        action.setToolTip(f"{command.tip} ({first.toString()})")
        action.setStatusTip(command.tip)
        action.setShortcuts(keys)
        action.setCheckable(command.checked is not None or bool(command.group))
        if command.group:
            group = self._groups.setdefault(command.group, QActionGroup(self._owner))
            action.setChecked(not group.actions())
            group.addAction(action)
        self._owner.addAction(action)
        return action


def _with_views(entry: WindowCommand | str, views: Sequence[ViewEntry]) -> Iterator[WindowCommand | str]:
    """Yield an entry of a menu; instead of the names of views, their commands."""
    if entry == "large views":
        for number, view in enumerate(view for view in views if view.key):
            yield WindowCommand("views.show_number", view.name, view.key, view.tip, group="views", argument=number)
    elif entry == "pictures of small views":
        for view in (view for view in views if view.picture_key):
            name = view.name.lower()
            tip = f"Save the {name} as PNG, PDF or SVG"
            yield WindowCommand(
                "saving.save_small", f"Picture of the {name}…", view.picture_key, tip, argument=view.name
            )
    else:
        yield entry


def _add_view_menus(bar: QMenuBar, views: Sequence[View]) -> None:
    """Add the actions of each view to the menu that its entry names; the view of the same name comes first."""
    menus: dict[str, QMenu] = {}
    for view in sorted(views, key=lambda view: view.entry.name != view.entry.menu):
        if not view.entry.menu:
            continue
        if view.entry.menu in menus:
            menus[view.entry.menu].addSeparator()
        else:
            menus[view.entry.menu] = bar.addMenu(f"&{view.entry.menu}")
        menus[view.entry.menu].addActions(view.actions())


class CommandSlots(QObject):
    """What commands do that is more than one call of the session: the look, notes, and dialogs."""

    def __init__(self, session: WindowSession, picture: Callable[[], QImage | None], window: QMainWindow) -> None:
        """`picture`: returns the picture of the large view; None if it has none."""
        super().__init__(window)
        self._session, self._picture, self._window = session, picture, window

    @Slot()
    def toggle(self) -> None:
        """Play the log, or pause."""
        self._session.in_replay(lambda replay: replay.toggle())

    @Slot()
    def step_back(self) -> None:
        """Pause at the previous reading."""
        self._session.in_replay(lambda replay: replay.step(-1))

    @Slot()
    def step_forward(self) -> None:
        """Pause at the next reading."""
        self._session.in_replay(lambda replay: replay.step(1))

    @Slot()
    def previous_scan(self) -> None:
        """Go back to the start of a scan."""
        self._session.in_replay(lambda replay: replay.previous_scan())

    @Slot()
    def next_scan(self) -> None:
        """Go to the start of the next scan."""
        self._session.in_replay(lambda replay: replay.next_scan())

    @Slot(bool)
    def set_loop(self, loop: bool) -> None:
        """Restart the replay at its end, or stop there."""
        self._session.in_replay(lambda replay: setattr(replay, "loop", loop))

    @Slot(bool)
    def set_skip_gaps(self, skip: bool) -> None:
        """Skip long waits without readings, or not."""
        self._session.in_replay(lambda replay: setattr(replay, "skip_gaps", skip))

    @property
    def _look(self) -> Look:
        return self._session.shown.look

    @Slot(bool)
    def switch_palette(self, dark: bool) -> None:
        """Use the dark or the light palette."""
        self._session.showing.set_look(replace(self._look, palette=DARK if dark else LIGHT))

    def use_unit(self, unit: LengthUnit) -> None:
        """Show lengths in a unit."""
        self._session.showing.set_look(replace(self._look, unit=unit))

    def scale_text(self, factor: float) -> None:
        """Enlarge or shrink all text."""
        self._session.showing.set_look(self._look.scaled(self._look.scale * factor))

    @Slot()
    def reset_text(self) -> None:
        """Show text in its default size."""
        self._session.showing.set_look(self._look.scaled(1.0))

    @Slot()
    def connect_scanner(self) -> None:
        """Open the dialog that connects a scanner."""
        scanners, window = self._session.scanners, self._window
        show_alone(open_dialog(window, ConnectDialog) or ConnectDialog(scanners, window))

    @Slot()
    def new_room(self) -> None:
        """Ask for name and size of a new room."""
        dialog = open_dialog(self._window, NewRoomDialog)
        if dialog is None:
            dialog = NewRoomDialog(self._window)
            dialog.accepted_as.connect(self._session.new_room)
        show_alone(dialog)

    @Slot()
    def edit_note(self) -> None:
        """Ask for the note on the selected reading."""
        shown = self._session.shown
        if shown.chosen is None:
            return
        place, note = shown.chosen, shown.notes.of(shown.chosen)
        label = f"Note on reading {place} at {heading_text(shown.heading(place))}"
        dialog = ask_text(self._window, "Edit note" if note else "Add note", label, note, MOST_CHARACTERS)
        dialog.textValueSelected.connect(partial(self._pin, place, shown.readings[place]))

    def _pin(self, place: int, reading: Reading, typed: str) -> None:
        if self._session.showing.has_reading(place, reading):
            self._session.showing.pin(place, note_text(typed))
        else:
            self._session.notices.warn(f"other readings are shown now; this note was not saved: {note_text(typed)}")

    @Slot()
    def delete_note(self) -> None:
        """Delete the note of the selected reading."""
        if self._session.shown.chosen is not None:
            self._session.showing.pin(self._session.shown.chosen, "")

    @Slot()
    def print_view(self) -> None:
        """Open a preview of the page with the picture of the large view."""
        image = self._picture()
        if image is None:
            return
        # the dialog owns its printer; one of our own would be freed before a preview that is closed at once
        preview = QPrintPreviewDialog(self._window)
        preview.printer().setResolution(_RESOLUTION)
        preview.printer().setPageOrientation(QPageLayout.Orientation.Landscape)
        preview.setWindowTitle("Print")
        preview.paintRequested.connect(partial(draw_page, image))
        show_alone(preview)

    @Slot()
    def show_help(self) -> None:
        """Open or close the page with all keys, whose groups are the menus."""
        if (page := open_dialog(self._window, HelpPage)) is not None:
            page.close()
            return
        menus = (entry.menu() for entry in self._window.menuBar().actions())
        groups = {menu.title().replace("&", ""): _with_keys(menu) for menu in menus if isinstance(menu, QMenu)}
        room = self._window.screen().availableSize() - _FRAME
        show_alone(HelpPage(groups, self._look, self._window, room))

    @Slot()
    def show_about(self) -> None:
        """Show the versions to name in a report of an error."""
        box = QMessageBox(QMessageBox.Icon.Information, "About sonarhw", _versions(), parent=self._window)
        box.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        show_alone(box)

    @Slot()
    def show_palette(self) -> None:
        """Open the palette with all commands of window, views and docks."""
        actions = [action for action in self._window.findChildren(QAction) if _is_command(action)]
        show_alone(CommandPalette(actions, self._window))


def _versions() -> str:
    return (
        f"sonarhw {version('sonarhw')}\nPython {platform.python_version()}, Qt {qVersion()}, "
        f"PySide {PySide6.__version__}\n{platform.platform()}\n\nMIT licence"
    )


def draw_page(image: QImage, printer: QPrinter) -> None:
    """Draw a picture on a page, as large as the page allows."""
    with QPainter(printer) as painter:
        page = painter.viewport()
        size = image.size().scaled(page.size(), Qt.AspectRatioMode.KeepAspectRatio)
        painter.drawImage(QRect(page.topLeft(), size), image)


def _is_command(action: QAction) -> bool:
    return bool(action.statusTip()) or not action.shortcut().isEmpty()


def _with_keys(menu: QMenu) -> list[QAction]:
    return [action for action in menu.actions() if not action.shortcut().isEmpty()]


def offer_view_menus(views: Sequence[View], commands: Commands, showing: ShownModel) -> None:
    """Open a context menu on request in each view: its own commands, its range, its picture, and hidden layers."""
    for view in views:
        widget = cast(QWidget, view)
        widget.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        widget.customContextMenuRequested.connect(partial(_open_view_menu, view, commands, showing))


def _open_view_menu(view: View, commands: Commands, showing: ShownModel, place: QPoint) -> None:
    widget = cast(QWidget, view)
    menu = QMenu(widget)
    menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    menu.aboutToHide.connect(menu.deleteLater)  # a chosen action or a click elsewhere hides it without closing
    menu.addActions(view.actions())
    menu.addSeparator()
    menu.addActions([commands.edit_note, commands.delete_note])
    menu.addSeparator()
    menu.addAction("Fit this view").triggered.connect(view.fit)
    show_all = menu.addAction("Show all layers")
    show_all.triggered.connect(showing.show_all)
    show_all.setEnabled(bool(showing.shown.hidden))
    if view.picture() is not None:
        menu.addSeparator()
        menu.addAction(commands.actions.get(f"save_small {view.entry.name}", commands.save_view))
    menu.popup(widget.mapToGlobal(place))


def undo_menu(showing: ShownModel, parent: QWidget) -> QMenu:
    """Return a menu of every edit that can be undone, newest first. A click undoes it and all later ones."""
    menu = QMenu("Undo steps", parent)

    def show_steps() -> None:
        menu.clear()
        steps = showing.history.steps[:_MOST_STEPS]
        for number, label in enumerate(steps, start=1):
            menu.addAction(_as_text(label)).setData(number)
        if not steps:
            menu.addAction("nothing to undo").setEnabled(False)

    menu.aboutToShow.connect(show_steps)
    menu.triggered.connect(lambda action: showing.undo_steps(action.data()))
    show_steps()
    return menu


class LayoutMenu(QMenu):
    """The named layouts: saves the arrangement of views and panels under a name, uses it again, deletes it."""

    def __init__(self, window: QMainWindow, views: QMainWindow) -> None:
        super().__init__("Layouts", window)
        self._window, self._views = window, views
        self.layouts: dict[str, Layout] = {}
        self.deleting = QMenu("Delete layout", self)
        self.aboutToShow.connect(self.show_names)
        self.show_names()

    def restore(self, layouts: Mapping[str, Layout]) -> None:
        """Offer these layouts, as saved before."""
        self.layouts = dict(layouts)
        self.show_names()

    @Slot()
    def show_names(self) -> None:
        """List the layouts, and the commands that save and delete one."""
        self.clear()
        self.deleting.clear()
        self.deleting.setEnabled(bool(self.layouts))
        for name in sorted(self.layouts):
            self.addAction(_as_text(name)).triggered.connect(partial(self.use, name))
            self.deleting.addAction(_as_text(name)).triggered.connect(partial(self.layouts.pop, name))
        self.addSeparator()
        self.addAction("Save layout…").triggered.connect(self._ask_name)
        self.addMenu(self.deleting)

    @Slot()
    def use(self, name: str) -> None:
        """Arrange views and panels as in a layout; a part that Qt refuses stays as it is."""
        panels, views = self.layouts[name]
        self._window.restoreState(panels)
        self._views.restoreState(views)

    @Slot()
    def _ask_name(self) -> None:
        label = "Name of the layout; a layout with this name is replaced"
        ask_text(self._window, "Save layout", label).textValueSelected.connect(self._save)

    @Slot(str)
    def _save(self, name: str) -> None:
        if name.strip():
            self.layouts[name.strip()] = self._window.saveState(), self._views.saveState()
            self.show_names()


def _as_text(name: str) -> str:
    """Return a name as the text of an action, in which & marks a key."""
    return name.replace("&", "&&")
