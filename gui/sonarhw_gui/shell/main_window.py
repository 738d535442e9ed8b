"""The window: puts views, panels, toolbar and replay bar together and connects them with the session.

Takes a session; owns nothing but its parts. Gestures go to the session, changes come back from it to the views.
"""

from typing import cast

from PySide6.QtCore import QEvent, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QAction, QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QMainWindow,
    QSplitter,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from sonarhw_gui.bscan.bscan_view import BScanView
from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.commands.connect_commands import ConnectCommands
from sonarhw_gui.commands.file_commands import FileCommands
from sonarhw_gui.commands.help_commands import HelpCommands
from sonarhw_gui.commands.keep_commands import KeepCommands
from sonarhw_gui.commands.look_commands import LookCommands
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.legend import Legend
from sonarhw_gui.look.theme import apply_look
from sonarhw_gui.panels.device_panel import DevicePanel
from sonarhw_gui.panels.fit_panel import FitPanel
from sonarhw_gui.panels.replay_bar import ReplayBar
from sonarhw_gui.panels.room_panel import RoomPanel
from sonarhw_gui.parts.steady import Steady
from sonarhw_gui.plan.plan_panel import PlanPanel
from sonarhw_gui.plan.plan_view import PlanView
from sonarhw_gui.plan.side_by_side import SideBySide
from sonarhw_gui.readings.range_view import RangeView
from sonarhw_gui.readings.reading_table import ReadingTable
from sonarhw_gui.readings.sentence import Sentence
from sonarhw_gui.session.window_session import WindowSession
from sonarhw_gui.shell.banner import Banner
from sonarhw_gui.shell.docks import Docks
from sonarhw_gui.shell.menus import fill_menus
from sonarhw_gui.shell.status_bar import StatusBar
from sonarhw_gui.shell.toolbar import ToolBar
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.trace.trace_view import TraceView

_SIZE = 1280, 800
_PLAN_SHARE, _SIDE_SHARE = 690, 590
_READ = 100  # ms: while a scan runs, text is written so often; it takes as long as the plots, and nobody reads faster


class MainWindow(QMainWindow):
    """The parts of the window and what connects them."""

    closing = Signal()  # everything is still as it was

    def __init__(self, session: WindowSession) -> None:
        super().__init__()
        self.session = session
        self.plan, self.side_by_side, self.bscan = PlanView(), SideBySide(), BScanView()
        self.plan_panel = PlanPanel(self.plan)
        self.trace, self.ranges, self.table = TraceView(), RangeView(), ReadingTable()
        self.commands = Commands(self)
        self.device, self.room, self.fit_panel = DevicePanel(self.commands), RoomPanel(), FitPanel()
        self.banner, self.legend, self.sentence = Banner(), Legend(), Sentence()
        self.replay_bar, self.status_bar = ReplayBar(self.commands), StatusBar()
        self.toolbar = ToolBar(self.commands)
        self.stage = QStackedWidget()
        self._views = (
            *(self.plan, self.side_by_side, self.bscan, self.trace, self.ranges),
            *(self.device, self.room, self.fit_panel, self.toolbar),
        )
        self._to_write = QTimer(self, singleShot=True, interval=_READ)
        self._to_write.timeout.connect(self._write)
        self.look_commands = LookCommands(self.commands, session, self)
        self.files = FileCommands(self.commands, session, self)
        large = self.plan, self.side_by_side, self.bscan
        self.keep = KeepCommands(self.commands, session, self, self.stage, large, self.trace, self.ranges)
        self.connecting = ConnectCommands(self.commands, session.scanners, self)
        self.help = HelpCommands(self.commands, session, self)
        self.setAcceptDrops(True)
        self._look: Look | None = None
        self._shown: Shown | None = None
        self.addToolBar(self.toolbar)
        self.setCentralWidget(self._arranged())
        self.setStatusBar(self.status_bar)
        self.docks = Docks(self)
        for name, key, panel in (
            ("Device", "F7", self.device),
            ("Room", "F8", self.room),
            ("Fit", "F9", self.fit_panel),
        ):
            self.docks.add(name, key, panel).visibilityChanged.connect(self._show_what_has_opened)
        choices = self.trace.actions(), self.bscan.actions()
        fill_menus(self.menuBar(), self.commands, self.files, self.plan_panel.actions(), *choices, self.docks.actions)
        self._connect_commands()
        self._connect_views()
        self.resize(*_SIZE)
        self._show(session.shown)
        self._show_status(session.status)
        self.replay_bar.show_state(session.replay.state)

    def closeEvent(self, event: QCloseEvent) -> None:
        """End the session too: the board stops, the log is closed."""
        self.closing.emit()
        self.hide()  # what a thread is at may take a moment to finish
        self.session.close()
        event.accept()

    def _arranged(self) -> QWidget:
        for large in (self.plan_panel, self.side_by_side, self.bscan):
            self.stage.addWidget(large)
        side = QSplitter(Qt.Orientation.Vertical)
        side.setObjectName("side")  # by which its sizes are remembered
        for view in (self.trace, self.ranges, self.table):
            side.addWidget(view)
        side.setSizes([215, 265, 165])
        views = QSplitter(Qt.Orientation.Horizontal)
        views.setObjectName("views")
        views.addWidget(self.stage)
        views.addWidget(side)
        views.setSizes([_PLAN_SHARE, _SIDE_SHARE])
        for splitter in (side, views):
            splitter.setChildrenCollapsible(False)
        centre = QWidget()
        column = QVBoxLayout(centre)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for part in (self.banner, self.legend, views, Steady(self.sentence), self.replay_bar):
            column.addWidget(part, stretch=1 if part is views else 0)
        return centre

    def _connect_commands(self) -> None:
        commands, session = self.commands, self.session
        commands.scan.triggered.connect(session.scan)
        commands.stop.triggered.connect(session.stop)
        commands.home.triggered.connect(session.live.home)
        commands.find.triggered.connect(self._find_place)
        commands.undo.triggered.connect(session.showing.undo)
        commands.redo.triggered.connect(session.showing.redo)
        commands.previous.triggered.connect(session.showing.choose_previous)
        commands.next.triggered.connect(session.showing.choose_next)
        commands.newest.triggered.connect(session.showing.follow_newest)
        commands.play.triggered.connect(session.replay.toggle)
        commands.back.triggered.connect(session.replay.step_back)
        commands.forth.triggered.connect(session.replay.step_forth)
        commands.previous_scan.triggered.connect(session.replay.previous_scan)
        commands.next_scan.triggered.connect(session.replay.next_scan)
        commands.loop.triggered.connect(session.replay.set_loop)
        commands.skip_gaps.triggered.connect(session.replay.set_skip_gaps)
        commands.leave_replay.triggered.connect(session.leave_replay)
        for view in (self.plan, self.side_by_side, self.bscan, self.trace):
            commands.fit.triggered.connect(view.fit)
        commands.close.triggered.connect(self.close)
        self.closing.connect(self.files.close_recordings)
        commands.views.triggered.connect(self._show_view)

    def _connect_views(self) -> None:
        session = self.session
        self.toolbar.place.textActivated.connect(session.showing.set_place)
        for picked in (self.plan, self.side_by_side, self.bscan, self.ranges, self.table):
            picked.picked.connect(session.showing.choose)
        for pointed in (self.plan, self.side_by_side, self.bscan, self.trace, self.ranges):
            pointed.pointed.connect(session.showing.point_at)
        self.bscan.wished.connect(session.showing.wish_bscan)
        for edited in (self.plan, self.side_by_side, self.room, self.fit_panel):
            edited.edited.connect(session.showing.edit)
        for cancelled in (self.plan, self.side_by_side):
            cancelled.cancelled.connect(session.showing.cancel)
        self.plan.surface_chosen.connect(self.room.choose_surface)
        self.room.hearing.board_file_wanted.connect(self.files.ask_board)
        self.room.surface_chosen.connect(self.plan.hands.choose_surface)
        self.fit_panel.wanted.connect(session.find_place)
        self.fit_panel.put_away.connect(session.fitting.forget)
        session.fitting.changed.connect(self.fit_panel.show_fit)
        self.replay_bar.toggled.connect(session.replay.toggle)
        self.replay_bar.sought.connect(session.replay.seek)
        self.replay_bar.speed_chosen.connect(session.replay.set_speed)
        session.replay.changed.connect(self.replay_bar.show_state)
        self.stage.currentChanged.connect(self._show_what_has_opened)
        self.device.connect_wanted.connect(session.live.connect)
        self.device.hang_up_wanted.connect(session.live.hang_up)
        self.device.turn_wanted.connect(session.live.turn)
        self.device.wished.connect(session.live.set_wish)
        session.showing.changed.connect(self._show)
        session.status_changed.connect(self._show_status)
        session.warned.connect(self.banner.tell)
        session.offered.connect(self.banner.offer)
        self.banner.taken.connect(session.take_up)
        session.keeping.kept.connect(self.status_bar.tell)

    @Slot(QAction)
    def _show_view(self, action: QAction) -> None:
        self.stage.setCurrentIndex(self.commands.views.actions().index(action))

    @Slot()
    def _find_place(self) -> None:
        self.docks.show("Fit")
        self.fit_panel.show_state(self.session.shown)  # it may not have been visible yet
        self.fit_panel.ask()

    def event(self, event: QEvent) -> bool:
        """Leave the space bar to the button or box that has the focus; else it plays."""
        button = isinstance(QApplication.focusWidget(), QAbstractButton)
        if button and event.type() == QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Space:
            event.accept()
            return True
        return super().event(event)

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Take files that can be opened."""
        if self.files.can_drop(event.mimeData()):
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open what was dropped."""
        self.files.drop(event.mimeData())
        event.acceptProposedAction()

    @Slot(object)
    def _show(self, shown: Shown) -> None:
        if shown.look != self._look:
            self._show_look(shown.look)
        before, self._shown = self._shown, shown
        still = before is not None and before.trace is shown.trace and before.cursor == shown.cursor
        for plot in (self.plan, self.ranges) if still else (self.plan, self.ranges, self.trace.plot):
            plot.scene().update()  # a scene that knows of parts only has the window painted by itself at once
            plot.viewport().update()
        for view in self._views:
            if view.isVisibleTo(self):
                view.show_state(shown)
        self.setWindowTitle(f"sonarhw — {shown.scene.title}")
        self._show_history()
        self._write_soon()

    def _write_soon(self) -> None:
        if not self.session.status.scanning:
            self._to_write.stop()
            self._write()
        elif not self._to_write.isActive():
            self._to_write.start()

    @Slot()
    def _write(self) -> None:
        for words in (self.table, self.sentence):
            if words.isVisibleTo(self):
                words.show_state(self.session.shown)
        self.status_bar.show_state(self.session.status)

    @Slot()
    def _show_what_has_opened(self) -> None:
        self._show(self.session.shown)

    def _show_look(self, look: Look) -> None:
        self._look = look
        apply_look(look)
        for part in (self.banner, self.legend, self.replay_bar, self.status_bar, self.look_commands):
            part.show_look(look)

    def _show_history(self) -> None:
        history = self.session.showing.history
        for action, name, label in (
            (self.commands.undo, "Undo", history.undo_label),
            (self.commands.redo, "Redo", history.redo_label),
        ):
            action.setText(f"{name} {label}".strip())
            action.setEnabled(bool(label))

    @Slot(object)
    def _show_status(self, status: Status) -> None:
        self._write_soon()
        self.banner.show_state(status)
        self.device.show_status(status)
        commands = self.commands
        commands.scan.setEnabled(status.can_scan and not status.scanning)
        self.commands.stop.setEnabled(status.scanning)
        self.commands.home.setEnabled(status.can_turn)
        for action in (commands.open_log, commands.open_room, commands.recordings, self.files.menuAction()):
            action.setEnabled(not status.scanning)
        self.toolbar.place.setEnabled(not status.scanning and self.toolbar.place.count() > 0)
