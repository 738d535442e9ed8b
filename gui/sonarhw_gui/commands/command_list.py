"""Every command of the window, with its name, key and tooltip."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QWidget

from sonarhw.export import export_suffixes
from sonarhw_gui.view import ViewEntry

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
        self.move_fake = self._add(
            "Move the fake scanner here",
            "Ctrl+Alt+M",
            "Move it to the place of the sensor in the window, and scan again",
        )
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
