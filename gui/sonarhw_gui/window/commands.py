"""The commands of the window, with names, keys and tooltips, and the menus made of them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import cast

from PySide6.QtCore import QByteArray, QEvent, QObject, QPoint, QRect, QSize, Qt, Slot
from PySide6.QtGui import QAction, QActionGroup, QImage, QKeyEvent, QKeySequence, QPageLayout, QPainter
from PySide6.QtPrintSupport import QPrinter, QPrintPreviewDialog
from PySide6.QtWidgets import QInputDialog, QLineEdit, QMainWindow, QMenu, QMenuBar, QWidget
from sonarhw_compare.headings import heading_text
from sonarhw_compare.scans import MOST_CHARACTERS, note_text

from sonarhw.export import export_suffixes
from sonarhw.readings import Reading
from sonarhw_gui.model.look import DARK, LIGHT, LengthUnit, Look
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session.scanner import ScannerChoice
from sonarhw_gui.session.session import ShownModel, WindowSession
from sonarhw_gui.views.base import View, ViewEntry
from sonarhw_gui.window.dialogs import CommandPalette, ConnectDialog, HelpPage, close_dialogs, open_connect_dialog

# Every command of the window, with its name, key and tooltip.


_FORMATS = " or ".join(suffix[1:].upper() for suffix in export_suffixes())


class Commands:
    """The commands of the window."""

    def __init__(self, owner: QWidget, views: Sequence[ViewEntry] = ()) -> None:
        """`views`: the views of the window; each has a command that shows it or one that saves a picture of it."""
        self._owner = owner
        self.all: list[QAction] = []
        self.open_room = self._add("Open room…", "Ctrl+R", "Show the readings in a room from a file")
        self.save_room = self._add("Save room", "Ctrl+S", "Save the room with its edits, in its file if it has one")
        self.save_room_as = self._add("Save room as…", "Ctrl+Shift+S", "Save the room with its edits in another file")
        self.open_log = self._add("Open log…", "Ctrl+O", "Open a recorded scan for replay")
        self.import_scan = self._add("Import scan…", "Ctrl+I", "Read a CSV scan of another program, after a preview")
        self.recordings = self._add("Recordings…", "Ctrl+Shift+O", "Search earlier recordings")
        self.save_view = self._add("Picture of the large view…", "Ctrl+P", "Save the large view as PNG or SVG")
        self.save_beside = {view.name: self._save_picture(view) for view in views if view.picture_key}
        self.save_window = self._add("Picture of the window…", "Ctrl+Shift+P", "Save the whole window as PNG")
        self.save_film = self._add("Film of the sound…", "Ctrl+Alt+F", "Save the sound of this heading as a film")
        self.export_data = self._add(
            "Export data…", "Ctrl+E", f"Save the readings as {_FORMATS}, or the summary as JSON"
        )
        self.report = self._add("Report…", "Ctrl+Shift+E", "One HTML file: pictures, summary, every reading, settings")
        self.connect_scanner = self._add("Connect…", "Ctrl+K", "Choose a scanner: a port of this computer, or a URL")
        self.help = self._add("Help", "F1", "All keys on one page")
        self.first_steps = self._add("First steps", "Shift+F1", "What is measured, what is predicted, where to click")
        self.palette = self._add("Commands…", "Ctrl+Shift+A", "Search all commands by words, and run one")
        self.copy_view = self._add("Copy picture", "Ctrl+Shift+C", "Copy the large view as a picture")
        self.print_view = self._add("Print…", "Ctrl+Alt+Shift+P", "Print the large view, after a preview")
        self.reset_layout = self._add("Reset layout", "Ctrl+Alt+0", "Put all views back in their places")
        self.close = self._add("Close", "Ctrl+Q", "Stop the scan and close the window")
        self.scan = self._add("▶ Scan", "F5", "Home the turntable, scan, record")
        self.stop = self._add("■ Stop", "F6", "Stop the scanner at once; readings so far are kept")
        self.stop.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)  # from a dialog in front, too
        self.home = self._add("Home", "Ctrl+H", "Find the zero of the turntable")
        self.find = self._add("Find pose", "Ctrl+J", "Fit the pose of the scanner to its readings")
        self.undo = self._add("Undo", "Ctrl+Z", "Undo the last edit")
        self.redo = self._add("Redo", "Ctrl+Shift+Z", "Repeat the edit that was undone last")
        self.previous = self._add("Previous reading", "Left", "Select the previous reading")
        self.next = self._add("Next reading", "Right", "Select the next reading")
        self.newest = self._add("Newest reading", "Esc", "Select and follow the newest reading")
        self.note = self._add("Add note…", "N", "Pin a note to the selected reading; it is kept beside the log")
        self.delete_note = self._add("Delete note", "Shift+N", "Delete the note of the selected reading")
        self.play = self._add("Play or pause", "Space", "Replay the log, or pause")
        self.back = self._add("Step back", ",", "Pause at the previous reading")
        self.forward = self._add("Step forward", ".", "Pause at the next reading")
        self.previous_scan = self._add("Previous scan", "Ctrl+Left", "Go back to the start of a scan")
        self.next_scan = self._add("Next scan", "Ctrl+Right", "Go to the start of the next scan")
        self.loop = self._add("Loop", "Ctrl+L", "Restart the replay at its end")
        self.skip_gaps = self._add("Skip gaps", "Ctrl+G", "Skip long waits without readings")
        for action in (self.loop, self.skip_gaps):
            action.setCheckable(True)
        self.leave_replay = self._add("Leave replay", "Ctrl+W", "Close the log, and return to the live scan")
        self.views = self._choice(*[self._add(view.name, view.key, view.tip) for view in views if view.key])
        self.fit = self._add("Fit view", "F", "Show the whole room, all headings and the whole trace")
        self.sound = self._add("Play sound", "S", "Show the sound of this heading on its way, in slow motion")
        self.dark = self._add("Dark", "Ctrl+D", "Switch between dark and light")
        self.dark.setCheckable(True)
        self.units = self._choice(
            self._add("Metres", "Ctrl+1", "Show lengths in metres"),
            self._add("Centimetres", "Ctrl+2", "Show lengths in centimetres"),
            self._add("Feet", "Ctrl+3", "Show lengths in feet"),
        )
        self.larger = self._add("Larger text", "Ctrl++", "Enlarge all text")
        self.larger.setShortcuts([QKeySequence("Ctrl++"), QKeySequence("Ctrl+=")])
        self.smaller = self._add("Smaller text", "Ctrl+-", "Shrink all text")
        self.default_size = self._add("Default text", "Ctrl+0", "Reset the text size")

    def _add(self, text: str, key: str, tip: str) -> QAction:
        action = QAction(text, self._owner, shortcut=QKeySequence(key), toolTip=f"{tip} ({key})", statusTip=tip)
        self._owner.addAction(action)
        self.all.append(action)
        return action

    def _save_picture(self, view: ViewEntry) -> QAction:
        name = view.name.lower()
        return self._add(f"Picture of the {name}…", view.picture_key, f"Save the {name} as PNG or SVG")

    def _choice(self, *actions: QAction) -> QActionGroup:
        """Group commands of which exactly one is checked, initially the first."""
        group = QActionGroup(self._owner)
        for action in actions:
            action.setCheckable(True)
            group.addAction(action)
        for first in actions[:1]:
            first.setChecked(True)
        return group


# The menus, which list every command.


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
    run = [commands.scan, commands.stop, commands.home]
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


# The context menus of the views: the view's own commands, its range, its picture, and hidden layers.


class ViewMenus(QObject):
    """Opens the context menu of a view where the user asks for it."""

    def __init__(self, views: Sequence[View], commands: Commands, showing: ShownModel) -> None:
        super().__init__()
        self.opened: QMenu | None = None  # the last menu
        self._commands, self._showing = commands, showing
        for view in views:
            widget = cast(QWidget, view)
            widget.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
            widget.customContextMenuRequested.connect(partial(self._open, view))

    def menu_of(self, view: View) -> QMenu:
        """Return a new menu with the commands of a view."""
        widget = cast(QWidget, view)
        menu = QMenu(widget)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.aboutToHide.connect(menu.deleteLater)  # a chosen action or a click elsewhere hides it without closing
        menu.addActions(view.actions())
        menu.addSeparator()
        menu.addActions([self._commands.note, self._commands.delete_note])
        menu.addSeparator()
        menu.addAction(_action(menu, "Fit this view", view.fit))
        show_all = _action(menu, "Show all layers", self._showing.show_all)
        show_all.setEnabled(bool(self._showing.shown.hidden))
        menu.addAction(show_all)
        if view.picture() is not None:
            menu.addSeparator()
            menu.addAction(self._commands.save_beside.get(view.entry.name, self._commands.save_view))
        return menu

    def _open(self, view: View, at: QPoint) -> None:
        self.opened = self.menu_of(view)
        self.opened.popup(cast(QWidget, view).mapToGlobal(at))


def _action(menu: QMenu, text: str, slot: object) -> QAction:
    action = QAction(text, menu)
    action.triggered.connect(slot)
    return action


# The menu of undo steps: every edit that can be undone, newest first. A click undoes it and all later ones.


_MOST = 30  # steps; a longer menu would not fit a screen


class UndoList(QMenu):
    """Lists the steps when it opens."""

    def __init__(self, showing: ShownModel, parent: QWidget) -> None:
        super().__init__("Undo steps", parent)
        self._showing = showing
        self.aboutToShow.connect(self.show_steps)
        self.triggered.connect(self._undo)
        self.show_steps()

    @Slot()
    def show_steps(self) -> None:
        """List the edits that can be undone."""
        self.clear()
        steps = self._showing.history.steps[:_MOST]
        for number, label in enumerate(steps, start=1):
            self.addAction(label.replace("&", "&&")).setData(number)
        if not steps:
            self.addAction("nothing to undo").setEnabled(False)

    @Slot(QAction)
    def _undo(self, action: QAction) -> None:
        self._showing.undo_steps(action.data())


# The menu of named layouts: save the arrangement of views and panels under a name, use it again, delete it.


Layout = tuple[QByteArray, QByteArray]  # panels of the window, and views, as Qt saves them


class LayoutMenu(QMenu):
    """Lists the layouts when it opens."""

    def __init__(self, window: QMainWindow, views: QMainWindow) -> None:
        super().__init__("Layouts", window)
        self._window, self._views = window, views
        self.layouts: dict[str, Layout] = {}
        self.dialog: QInputDialog | None = None
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
        for name in sorted(self.layouts):
            self.addAction(_as_text(name)).triggered.connect(partial(self.use, name))
        self.addSeparator()
        self.addAction("Save layout…").triggered.connect(self._ask_name)
        self.addMenu(self.deleting)
        self.deleting.clear()
        self.deleting.setEnabled(bool(self.layouts))
        for name in sorted(self.layouts):
            self.deleting.addAction(_as_text(name)).triggered.connect(partial(self._delete, name))

    @Slot()
    def use(self, name: str) -> None:
        """Arrange views and panels as in a layout; a part that Qt refuses stays as it is."""
        panels, views = self.layouts[name]
        self._window.restoreState(panels)
        self._views.restoreState(views)

    @Slot()
    def _ask_name(self) -> None:
        close_dialogs(self._window)
        self.dialog = dialog = QInputDialog(self._window)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle("Save layout")
        dialog.setLabelText("Name of the layout; a layout with this name is replaced")
        dialog.textValueSelected.connect(self._save)
        dialog.show()

    @Slot(str)
    def _save(self, name: str) -> None:
        if name.strip():
            self.layouts[name.strip()] = self._window.saveState(), self._views.saveState()
            self.show_names()

    @Slot()
    def _delete(self, name: str) -> None:
        del self.layouts[name]


def _as_text(name: str) -> str:
    """Return a name as the text of an action, in which & marks a key."""
    return name.replace("&", "&&")


# The commands for the look: light or dark, unit of length, size of text.


_STEP = 1.1  # factor of the text size


class LookCommands(QObject):
    """Connects the commands for the look with the session."""

    def __init__(self, commands: Commands, session: WindowSession, parent: QObject) -> None:
        super().__init__(parent)
        self._commands = commands
        self._session = session
        for unit, action in zip(LengthUnit, commands.units.actions(), strict=True):
            action.setData(unit.name)
        commands.units.triggered.connect(self._choose_unit)
        commands.dark.triggered.connect(self._choose_palette)
        commands.larger.triggered.connect(self._enlarge)
        commands.smaller.triggered.connect(self._shrink)
        commands.default_size.triggered.connect(self._reset_size)

    def show_look(self, look: Look) -> None:
        """Check the commands of the current look."""
        self._commands.dark.setChecked(look.palette is DARK)
        for action in self._commands.units.actions():
            action.setChecked(action.data() == look.unit.name)

    @property
    def _look(self) -> Look:
        return self._session.shown.look

    @Slot(QAction)
    def _choose_unit(self, action: QAction) -> None:
        self._session.showing.set_look(replace(self._look, unit=LengthUnit[action.data()]))

    @Slot(bool)
    def _choose_palette(self, dark: bool) -> None:
        self._session.showing.set_look(replace(self._look, palette=DARK if dark else LIGHT))

    @Slot()
    def _enlarge(self) -> None:
        self._session.showing.set_look(self._look.scaled(self._look.scale * _STEP))

    @Slot()
    def _shrink(self) -> None:
        self._session.showing.set_look(self._look.scaled(self._look.scale / _STEP))

    @Slot()
    def _reset_size(self) -> None:
        self._session.showing.set_look(self._look.scaled(1.0))


# The commands for notes on readings: add, edit and delete the note of the selected reading.


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
            self._session.notices.warn(f"other readings are shown now; this note was not saved: {note_text(typed)}")

    @Slot()
    def _delete(self) -> None:
        shown = self._session.shown
        if shown.chosen is not None:
            self._session.showing.pin(shown.chosen, "")


# The command that connects a scanner: opens the dialog and lists the ports in it.


class ConnectCommands(QObject):
    """Opens at most one dialog at a time."""

    def __init__(self, commands: Commands, scanners: ScannerChoice, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._scanners = scanners
        self.dialog: ConnectDialog | None = None
        commands.connect_scanner.setEnabled(scanners.possible)
        commands.connect_scanner.triggered.connect(self._open)

    @Slot()
    def _open(self) -> None:
        if self.dialog is None:
            self.dialog = dialog = open_connect_dialog(self._window)
            dialog.show_urls(self._scanners.urls)
            dialog.chosen.connect(self._scanners.choose)
            dialog.refreshed.connect(self._scanners.list_ports)
            dialog.probe_all_requested.connect(self._scanners.probe_all)
            dialog.listen_requested.connect(self._scanners.listen)
            self._scanners.ports_changed.connect(dialog.show_ports)
            dialog.destroyed.connect(self._forget)
            dialog.show_ports(())
            self._scanners.list_ports()
        close_dialogs(self._window, but=self.dialog)
        self.dialog.show()
        self.dialog.raise_()

    @Slot()
    def _forget(self) -> None:
        self.dialog = None


# The command that prints the large view, with a preview.


_RESOLUTION = 300  # dots per inch


class PrintCommand(QObject):
    """Prints the picture that *Copy picture* copies, as large as the page allows."""

    def __init__(self, commands: Commands, picture: Callable[[], QImage | None], window: QWidget) -> None:
        """`picture`: returns the picture of the large view; None if it has none."""
        super().__init__(window)
        self._window, self._picture = window, picture
        self._image = QImage()
        self.preview: QPrintPreviewDialog | None = None
        commands.print_view.triggered.connect(self._show_preview)

    @Slot()
    def _show_preview(self) -> None:
        image = self._picture()
        if image is None:
            return
        self._image = image
        close_dialogs(self._window)
        # the dialog owns its printer; one of our own would be freed before a preview that is closed at once
        self.preview = dialog = QPrintPreviewDialog(self._window)
        dialog.printer().setResolution(_RESOLUTION)
        dialog.printer().setPageOrientation(QPageLayout.Orientation.Landscape)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setWindowTitle("Print")
        dialog.paintRequested.connect(self.draw)
        dialog.show()

    @Slot(QPrinter)
    def draw(self, printer: QPrinter) -> None:
        """Draw the picture on the page."""
        with QPainter(printer) as painter:
            page = painter.viewport()
            size = self._image.size().scaled(page.size(), Qt.AspectRatioMode.KeepAspectRatio)
            painter.drawImage(QRect(page.topLeft(), size), self._image)


# The command that opens the help page, whose groups are the menus.


_FRAME = QSize(16, 48)  # pixels, for the frame of a dialog


class HelpCommands(QObject):
    """Opens and closes the help page."""

    def __init__(self, commands: Commands, session: WindowSession, window: QMainWindow) -> None:
        super().__init__(window)
        self._window = window
        self._session = session
        self.page: HelpPage | None = None
        commands.help.triggered.connect(self._open_or_close)
        commands.palette.triggered.connect(self._open_palette)
        self.palette: CommandPalette | None = None

    @Slot()
    def _open_or_close(self) -> None:
        if self.page is not None:
            self.page.close()
            return
        menus = (entry.menu() for entry in self._window.menuBar().actions())
        groups = {menu.title().replace("&", ""): _with_keys(menu) for menu in menus if isinstance(menu, QMenu)}
        room = self._window.screen().availableSize() - _FRAME
        self.page = HelpPage(groups, self._session.shown.look, self._window, room)
        self.page.destroyed.connect(self._forget)
        self._window.installEventFilter(self)
        close_dialogs(self._window, but=self.page)
        self.page.show()

    @Slot()
    def _open_palette(self) -> None:
        """Open the palette with all commands of window, views and docks."""
        actions = [action for action in self._window.findChildren(QAction) if _is_command(action)]
        close_dialogs(self._window)
        self.palette = CommandPalette(actions, self._window)
        self.palette.show()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let Esc in the window close an open help page first."""
        escape = event.type() is QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Escape
        if not escape or self.page is None:
            return False
        self.page.close()
        event.accept()
        return True

    @Slot()
    def _forget(self) -> None:
        self.page = None
        self._window.removeEventFilter(self)


def _is_command(action: QAction) -> bool:
    return bool(action.statusTip()) or not action.shortcut().isEmpty()


def _with_keys(menu: QMenu) -> list[QAction]:
    return [action for action in menu.actions() if not action.shortcut().isEmpty()]
