"""Every action of the window with its name, key and tooltip."""

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QActionGroup, QKeySequence
from PySide6.QtWidgets import QWidget

from sonarhw.export.export_formats import export_suffixes
from sonarhw_gui.view import ViewEntry

_FORMATS = " or ".join(suffix[1:].upper() for suffix in export_suffixes())


class Commands:
    """What can be done with one key."""

    def __init__(self, owner: QWidget, views: Sequence[ViewEntry] = ()) -> None:
        """`views`: of the window; each has a command that shows it or one that keeps a picture of it."""
        self._owner = owner
        self.all: list[QAction] = []
        self.open_room = self._add("Open room…", "Ctrl+R", "Show the readings in the room of a file")
        self.save_room = self._add("Save room as…", "Ctrl+Shift+S", "Write the room as it is now to a file")
        self.open_log = self._add("Open log…", "Ctrl+O", "Show a recorded scan and play it back")
        self.recordings = self._add("Recordings…", "Ctrl+Shift+O", "Find a scan that was recorded before")
        self.save_view = self._add("Picture of the large view…", "Ctrl+P", "Keep it as PNG or SVG")
        self.save_beside = {view.name: self._keep(view) for view in views if view.picture_key}
        self.save_window = self._add("Picture of the window…", "Ctrl+Shift+P", "Keep all that is seen as PNG")
        self.export_data = self._add(
            "Export data…", "Ctrl+E", f"Save the readings as {_FORMATS}, or the summary as JSON"
        )
        self.report = self._add("Report…", "Ctrl+Shift+E", "One HTML file: pictures, figures, every reading, settings")
        self.connect_scanner = self._add("Connect…", "Ctrl+K", "Choose a scanner: the ports of this machine, or a URL")
        self.help = self._add("Help", "F1", "Every key on one page")
        self.close = self._add("Close", "Ctrl+Q", "Stop the scan and close the window")
        self.scan = self._add("▶ Scan", "F5", "Home the turntable, scan, record")
        self.stop = self._add("■ Stop", "F6", "Stop the scanner at once; what was measured is kept")
        self.stop.setShortcutContext(Qt.ShortcutContext.ApplicationShortcut)  # from a dialog in front, too
        self.home = self._add("Home", "Ctrl+H", "Let the turntable find its zero")
        self.find = self._add("Find where I stood", "Ctrl+J", "Find the place from which the scan was taken: see Fit")
        self.undo = self._add("Undo", "Ctrl+Z", "Take back what was done to the room last")
        self.redo = self._add("Redo", "Ctrl+Shift+Z", "Do again what was taken back")
        self.previous = self._add("Previous reading", "Left", "Ask about the reading before this one")
        self.next = self._add("Next reading", "Right", "Ask about the reading after this one")
        self.newest = self._add("Newest reading", "Esc", "Follow the newest reading again")
        self.play = self._add("Play or pause", "Space", "Play the log on its recorded schedule, or pause")
        self.back = self._add("Step back", ",", "Let the replay stand still one reading before")
        self.forward = self._add("Step on", ".", "Let the replay stand still one reading further on")
        self.previous_scan = self._add("Previous scan", "Ctrl+Left", "Go back to the beginning of a scan")
        self.next_scan = self._add("Next scan", "Ctrl+Right", "Go to the beginning of the next scan in the log")
        self.loop = self._add("Loop", "Ctrl+L", "Begin the replay again at its end")
        self.skip_gaps = self._add("Skip gaps", "Ctrl+G", "Leave out long waits in which nothing was measured")
        for action in (self.loop, self.skip_gaps):
            action.setCheckable(True)
        self.leave_replay = self._add("Leave replay", "Ctrl+W", "Put the log away: back to the live scan, or to none")
        self.views = self._choice(*[self._add(view.name, view.key, view.tip) for view in views if view.key])
        self.fit = self._add("Fit view", "F", "Show the whole room, all headings and the whole trace")
        self.dark = self._add("Dark", "Ctrl+D", "Light on dark, or dark on light")
        self.dark.setCheckable(True)
        self.units = self._choice(
            self._add("Metres", "Ctrl+1", "Write lengths in metres"),
            self._add("Centimetres", "Ctrl+2", "Write lengths in centimetres"),
            self._add("Feet", "Ctrl+3", "Write lengths in feet"),
        )
        self.larger = self._add("Larger text", "Ctrl++", "Larger text everywhere")
        self.larger.setShortcuts([QKeySequence("Ctrl++"), QKeySequence("Ctrl+=")])
        self.smaller = self._add("Smaller text", "Ctrl+-", "Smaller text everywhere")
        self.usual_size = self._add("Usual text", "Ctrl+0", "Text in the system's own size")

    def _add(self, text: str, key: str, tip: str) -> QAction:
        action = QAction(text, self._owner, shortcut=QKeySequence(key), toolTip=f"{tip} ({key})", statusTip=tip)
        self._owner.addAction(action)
        self.all.append(action)
        return action

    def _keep(self, view: ViewEntry) -> QAction:
        name = view.name.lower()
        return self._add(f"Picture of the {name}…", view.picture_key, f"Keep the {name} as PNG or SVG")

    def _choice(self, *actions: QAction) -> QActionGroup:
        """Commands of which one is always chosen, at first the first."""
        group = QActionGroup(self._owner)
        for action in actions:
            action.setCheckable(True)
            group.addAction(action)
        for first in actions[:1]:
            first.setChecked(True)
        return group
