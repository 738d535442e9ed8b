"""The window: puts the views, the replay bar and the toolbar together and connects them with the session.

Takes a session; owns nothing but its parts. Gestures go to the session, changes come back from it to the views.
"""

from PySide6.QtCore import Qt, Slot
from PySide6.QtGui import QAction, QCloseEvent, QKeySequence, QShortcut
from PySide6.QtWidgets import QComboBox, QFileDialog, QLabel, QMainWindow, QSplitter, QToolBar, QVBoxLayout, QWidget

from gui.banner import Banner
from gui.legend import Legend
from gui.plan_view import PlanView
from gui.range_view import RangeView
from gui.replay_bar import ReplayBar
from gui.sentence import Sentence
from gui.session import Session
from gui.shown import Shown
from gui.status import Status
from gui.status_bar import StatusBar
from gui.trace_view import TraceView

_SIZE = 1280, 800
_PLAN_SHARE, _SIDE_SHARE = 690, 590


class MainWindow(QMainWindow):
    """The parts of the window and what connects them."""

    def __init__(self, session: Session) -> None:
        super().__init__()
        self.session = session
        self.plan, self.trace, self.ranges = PlanView(), TraceView(), RangeView()
        self.banner, self.legend, self.sentence = Banner(), Legend(), Sentence()
        self.replay_bar, self.status_bar = ReplayBar(), StatusBar()
        self.place = QComboBox()
        self.place.setToolTip("Where in the room the scanner stands")
        self._add_toolbar()
        self.setCentralWidget(self._arranged())
        self.setStatusBar(self.status_bar)
        self._connect()
        self._add_keys()
        self.resize(*_SIZE)
        self._show_status(session.status)
        self._show(session.shown)
        self.replay_bar.show_state(session.replay.state)

    def closeEvent(self, event: QCloseEvent) -> None:
        """End the session too: the board stops, the log is closed."""
        self.hide()  # what a thread is at may take a moment to finish
        self.session.close()
        event.accept()

    def _arranged(self) -> QWidget:
        side = QSplitter(Qt.Orientation.Vertical)
        side.addWidget(self.trace)
        side.addWidget(self.ranges)
        side.setSizes([300, 330])
        views = QSplitter(Qt.Orientation.Horizontal)
        views.addWidget(self.plan)
        views.addWidget(side)
        views.setSizes([_PLAN_SHARE, _SIDE_SHARE])
        for splitter in (side, views):
            splitter.setChildrenCollapsible(False)
        centre = QWidget()
        column = QVBoxLayout(centre)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for part in (self.banner, self.legend, views, self.sentence, self.replay_bar):
            column.addWidget(part, stretch=1 if part is views else 0)
        return centre

    def _add_toolbar(self) -> None:
        bar = QToolBar("Main", movable=False)
        bar.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        bar.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self.open_room = self._action("Open room…", "Ctrl+R", "Show the readings in the room of a file")
        self.open_log = self._action("Open log…", "Ctrl+O", "Show a recorded scan and play it back")
        self.scan = self._action("▶ Scan", "F5", "Home the turntable, scan a whole turn, record")
        self.stop = self._action("■ Stop", "F6", "Stop the scan; what was measured is kept")
        self.fit = self._action("Fit view", "F", "Show the whole room in the plan")
        bar.addActions([self.open_room, self.open_log])
        bar.addSeparator()
        bar.addActions([self.scan, self.stop])
        bar.addSeparator()
        bar.addAction(self.fit)
        bar.addWidget(QLabel("  Place "))
        bar.addWidget(self.place)
        self.addToolBar(bar)

    def _action(self, text: str, key: str, tip: str) -> QAction:
        return QAction(text, self, shortcut=QKeySequence(key), toolTip=f"{tip} ({key})")

    def _connect(self) -> None:
        session = self.session
        self.scan.triggered.connect(session.scan)
        self.stop.triggered.connect(session.stop)
        self.fit.triggered.connect(self.plan.fit)
        self.open_log.triggered.connect(lambda: self._ask_file("Open log", "Logs (*.mcap)", session.open_log))
        self.open_room.triggered.connect(lambda: self._ask_file("Open room", "Rooms (*.toml)", session.open_room))
        self.place.textActivated.connect(session.set_place)
        self.plan.picked.connect(session.choose)
        self.ranges.picked.connect(session.choose)
        self.replay_bar.toggled.connect(session.replay.toggle)
        self.replay_bar.sought.connect(session.replay.seek)
        self.replay_bar.speed_chosen.connect(session.replay.set_speed)
        session.replay.changed.connect(self.replay_bar.show_state)
        session.shown_changed.connect(self._show)
        session.status_changed.connect(self._show_status)
        session.warned.connect(self.banner.tell)

    def _add_keys(self) -> None:
        keys = {
            "Left": lambda: self.session.step(-1),
            "Right": lambda: self.session.step(1),
            "Esc": self.session.follow_newest,
            "Space": self.session.replay.toggle,
        }
        for key, action in keys.items():
            QShortcut(QKeySequence(key), self).activated.connect(action)

    def _ask_file(self, title: str, pattern: str, chosen: object) -> None:
        # not modal: what runs goes on, and the window still answers
        dialog = QFileDialog(self, title, "", pattern)
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.fileSelected.connect(chosen)
        dialog.show()

    @Slot(object)
    def _show(self, shown: Shown) -> None:
        for view in (self.plan, self.trace, self.ranges, self.sentence):
            view.show_state(shown)
        self.setWindowTitle(f"sonarhw — {shown.scene.title}")
        self._show_places(shown)

    def _show_places(self, shown: Shown) -> None:
        names = [*shown.scene.room.places] if shown.scene.room else []
        here = shown.scene.standing.name
        if here and here not in names:
            names.append(here)  # a place given as X,Y
        if [self.place.itemText(k) for k in range(self.place.count())] != names:
            self.place.clear()
            self.place.addItems(names)
        self.place.setCurrentText(here)

    @Slot(object)
    def _show_status(self, status: Status) -> None:
        self.status_bar.show_state(status)
        self.scan.setEnabled(status.can_scan and not status.scanning)
        self.stop.setEnabled(status.scanning)
        for widget in (self.open_log, self.open_room):
            widget.setEnabled(not status.scanning)
        self.place.setEnabled(not status.scanning and self.place.count() > 0)
