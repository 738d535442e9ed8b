"""The main window: creates its parts, connects them, and updates them when the session changes."""

from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import cast

from PySide6.QtCore import QEvent, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QAction, QCloseEvent, QDragEnterEvent, QDropEvent, QKeyEvent, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QAbstractButton, QApplication, QVBoxLayout, QWidget

from sonarhw_gui.bars.banner import Banner
from sonarhw_gui.bars.hint import Hint
from sonarhw_gui.bars.menus import fill_menus
from sonarhw_gui.bars.status_bar import StatusBar
from sonarhw_gui.bars.toolbar import ToolBar
from sonarhw_gui.bars.view_menus import ViewMenus
from sonarhw_gui.causes.causes_panel import CausesPanel
from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.commands.connect_commands import ConnectCommands
from sonarhw_gui.commands.file_commands import FileCommands
from sonarhw_gui.commands.help_commands import HelpCommands
from sonarhw_gui.commands.layout_menu import LayoutMenu
from sonarhw_gui.commands.look_commands import LookCommands
from sonarhw_gui.commands.note_commands import NoteCommands
from sonarhw_gui.commands.print_command import PrintCommand
from sonarhw_gui.commands.save_commands import SaveCommands
from sonarhw_gui.commands.undo_list import UndoList
from sonarhw_gui.finding.find_panel import FindPanel
from sonarhw_gui.fitting.fit_panel import FitPanel
from sonarhw_gui.live.window_status import Status
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import apply_look
from sonarhw_gui.panels.device_panel import DevicePanel
from sonarhw_gui.panels.replay_bar import ReplayBar
from sonarhw_gui.panels.room_panel import RoomPanel
from sonarhw_gui.parts.label_slot import LabelSlot
from sonarhw_gui.plots.legend import Legend
from sonarhw_gui.readings.sentence import BounceLine, Sentence
from sonarhw_gui.scans.scans_panel import ScansPanel
from sonarhw_gui.session.turns import Turns
from sonarhw_gui.session.window_session import WindowSession
from sonarhw_gui.shell.accessible_names import name_tab_stops
from sonarhw_gui.shell.command_states import show_history, show_scanner
from sonarhw_gui.shell.docks import Docks
from sonarhw_gui.shell.tabbed_window import TabbedWindow
from sonarhw_gui.shell.view_area import ViewArea
from sonarhw_gui.shell.wiring import (
    connect_banner,
    connect_causes,
    connect_commands,
    connect_device,
    connect_finding,
    connect_fit,
    connect_replay,
    connect_scans,
    connect_sound,
)
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.sound.sound_bar import SoundBar

_SIZE = QSize(1280, 800)
_FRAME = QSize(16, 48)  # pixels, for the frame of the window
_LOW = 640  # pixels
_NO_PAINT = 500  # ms
# ms. During a scan or a drag, each frame updates the large view and one other part: a plot beside it or a third of the
# text. So much later, the next part follows if there is no other frame.
_TURN = 40


class MainWindow(TabbedWindow):
    """The main window with all its parts."""

    closing = Signal()  # emitted before anything is closed

    def __init__(self, session: WindowSession) -> None:
        super().__init__()
        self.session = session
        self.views = ViewArea()
        self.commands = Commands(self, [view.entry for view in self.views.all])
        self.device, self.room, self.fit_panel = DevicePanel(self.commands), RoomPanel(), FitPanel()
        self.causes, self.scans, self.finding = CausesPanel(), ScansPanel(), FindPanel()
        self.banner, self.legend, self.sentence = Banner(), Legend(), Sentence()
        self.bounces, self.hint = BounceLine(), Hint()
        self.replay_bar, self.status_bar = ReplayBar(self.commands), StatusBar()
        self.sound_bar = SoundBar()
        self.toolbar = ToolBar(self.commands)
        self.docks = Docks(self)
        self.look_commands = LookCommands(self.commands, session, self)
        self.files = FileCommands(self.commands, session, self)
        self.saving = SaveCommands(self.commands, session, self, lambda: self.views.large_view, self.views.beside)
        self.printing = PrintCommand(self.commands, self.saving.image, self)
        self.layouts = LayoutMenu(self, self.views)
        self.connecting = ConnectCommands(self.commands, session.scanners, self)
        self.notes = NoteCommands(self.commands, session, self)
        self.help = HelpCommands(self.commands, session, self)
        self._look: Look | None = None
        self._open = False  # each part that becomes visible reports it; together, they are updated once
        plots = [partial(self._show_plot, place) for place in range(self.views.plots_beside)]
        self._texts = (self._show_texts, self._show_sentence, self._show_figures)
        in_turns = (part for parts in zip_longest(plots, self._texts) for part in parts if part is not None)
        self._turns = Turns(tuple(in_turns), _TURN, self)
        # once for all tabs and plots that are created when they are first visible
        self._names_timer = QTimer(self, singleShot=True, interval=0)
        self._names_timer.timeout.connect(self._name_tab_stops)
        self._arrange()
        self._connect()
        self._show(session.shown)
        self._show_status(session.status)
        self._names_timer.start()

    def _arrange(self) -> None:
        self.setAcceptDrops(True)
        self.addToolBar(self.toolbar)
        centre = QWidget()
        column = QVBoxLayout(centre)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        sentence, bounces = LabelSlot(self.sentence), LabelSlot(self.bounces)
        for part in (
            self.banner,
            self.legend,
            self.hint,
            self.views,
            sentence,
            bounces,
            self.sound_bar,
            self.replay_bar,
        ):
            column.addWidget(part, stretch=1 if part is self.views else 0)
        self.setCentralWidget(centre)
        self.setStatusBar(self.status_bar)
        for name, key, about, panel in (
            ("Device", "F7", "Connect, scan, turn and home the scanner", self.device),
            ("Room", "F8", "Materials, air, board and model", self.room),
            ("Fit", "F9", "Find pose, board and room values from the scan", self.fit_panel),
            ("Causes", "F11", "Find missing objects and other causes of misfits", self.causes),
            ("Scans", "F12", "Show several scans, and compare two", self.scans),
            ("Find the room", "Ctrl+M", "Find walls from scans, and the next place to scan", self.finding),
        ):
            self.docks.add(name, key, about, panel).visibilityChanged.connect(self._show_again)
        self.view_menus = ViewMenus(self.views.all, self.commands, self.session.showing)
        fill_menus(
            self.menuBar(),
            self.commands,
            self.files.shipped,
            self.files,
            UndoList(self.session.showing, self),
            self.layouts,
            self.views.all,
            [*self.views.openers, *self.docks.actions],
        )
        self.resize(_SIZE.boundedTo(self.screen().availableSize() - _FRAME))

    def _connect(self) -> None:
        session, commands, views = self.session, self.commands, self.views
        connect_commands(commands, session)
        connect_device(self.device, session)
        connect_fit(self.fit_panel, session)
        connect_causes(self.causes, session)
        connect_scans(self.scans, session)
        connect_finding(self.finding, session)
        self.scans.add_requested.connect(self.files.ask_scan)
        connect_replay(self.replay_bar, session)
        connect_sound(self.sound_bar, session)
        self.sound_bar.film_requested.connect(commands.save_film.trigger)
        connect_banner(self.banner, session)
        self.banner.opened.connect(self._make_room)
        views.connect_gestures(session.showing)
        self.legend.switched.connect(session.showing.switch)
        views.uncovered.connect(self._show_again)
        views.answered.connect(self.hint.end)
        commands.first_steps.triggered.connect(self.hint.begin)
        views.plan.gestures.surface_chosen.connect(self.room.choose_surface)
        self.room.surface_chosen.connect(views.plan.drawing.controller.choose_surface)
        self.room.edited.connect(session.showing.edit)
        self.room.model.board_file_requested.connect(self.files.ask_board)
        self.toolbar.place.textActivated.connect(session.showing.set_place)
        commands.find.triggered.connect(self._find_pose)
        commands.fit.triggered.connect(views.fit)
        commands.reset_layout.triggered.connect(views.arrange)
        commands.views.triggered.connect(self._show_view)
        commands.close.triggered.connect(self.close)
        self.closing.connect(self.files.close_dialogs)
        session.showing.changed.connect(self._show)
        session.showing.edited.connect(self._show_title)
        session.status_changed.connect(self._show_status)
        session.room_opened.connect(views.plan.fit)
        session.saver.saved.connect(self.status_bar.show_briefly)

    @Slot(QAction)
    def _show_view(self, action: QAction) -> None:
        self.views.stage.setCurrentIndex(self.commands.views.actions().index(action))

    @Slot()
    def _find_pose(self) -> None:
        self.docks.show("Fit")
        self.fit_panel.request_fit()

    @Slot(object)
    def _show(self, shown: Shown) -> None:
        if shown.look != self._look:
            self._show_look(shown.look)
        self.views.show_large(shown)
        self.docks.show_state(shown)
        self.toolbar.show_state(shown)
        self._show_title()
        self.legend.show_state(shown)
        self.hint.show_state(shown)
        self.notes.show_state(shown)
        show_history(self.commands, self.session.showing.history)
        if self._is_busy:
            self._turns.advance()
        else:
            self._turns.all_now()

    @Slot()
    def _show_title(self) -> None:
        """Name room, place, files; Qt shows the star of unsaved changes at [*]."""
        session = self.session
        log = Path(session.log_file).name if session.replay.loaded else ""
        files = " · ".join(filter(None, (log, session.shown.scene.room_file)))
        title = f"sonarhw — {session.shown.title}{' — ' if files else ''}{files}[*]"
        if title != self.windowTitle():
            self.setWindowTitle(title)
        if session.unsaved.changed is not self.isWindowModified():
            self.setWindowModified(session.unsaved.changed)

    @property
    def _is_busy(self) -> bool:
        """Whether frames follow each other so fast that there is no time to update all parts with each."""
        return self.session.status.scanning or self.session.showing.forecast.dragging

    def _show_plot(self, place: int) -> None:
        self.views.show_plot_beside(place, self.session.shown)

    def _show_texts(self) -> None:
        self.views.show_texts(self.session.shown)

    def _show_sentence(self) -> None:
        self.sentence.show_state(self.session.shown)
        self.bounces.show_state(self.session.shown)

    def _show_figures(self) -> None:
        self.status_bar.show_state(self.session.status)
        self.device.show_status(self.session.status)

    @Slot()
    def _show_again(self) -> None:
        if self._open:
            self._show(self.session.shown)
            self._names_timer.start()

    @Slot(bool)
    def _make_room(self, message: bool) -> None:
        """Hide the hint for as long as a low window has a message: with both, it would be higher than the screen."""
        self.hint.give_way(message and self.height() < _LOW)

    @Slot()
    def _name_tab_stops(self) -> None:
        name_tab_stops(self)

    def _show_look(self, look: Look) -> None:
        self._look = look
        apply_look(look)
        for part in (
            self.banner,
            self.legend,
            self.hint,
            self.views,
            self.sound_bar,
            self.replay_bar,
            self.status_bar,
            self.look_commands,
        ):
            part.show_look(look)

    @Slot(object)
    def _show_status(self, status: Status) -> None:
        if self._is_busy:
            self._turns.soon()
        else:
            for show in self._texts:
                show()
        self.banner.show_state(status)
        show_scanner(self.commands, status)
        self.files.shipped.setEnabled(not status.scanning)
        self.files.menuAction().setEnabled(not status.scanning)
        self.toolbar.place.setEnabled(not status.scanning and self.toolbar.place.count() > 0)

    def showEvent(self, event: QShowEvent) -> None:
        """Update what is visible. Begin to predict soon even if the window is never painted, as on another desktop."""
        super().showEvent(event)
        self._open = True
        self._show_again()
        QTimer.singleShot(_NO_PAINT, self.session.begin)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Leave the place of a long legend to the plan where the window is low."""
        super().resizeEvent(event)
        self.legend.set_low(self.height() < _LOW)

    def closeEvent(self, event: QCloseEvent) -> None:
        """Close the session too: stop the board and close the log."""
        self.closing.emit()
        self._open = False
        self.hide()  # a thread may take a moment to finish
        self.session.close()
        event.accept()

    def event(self, event: QEvent) -> bool:
        """Let Space press the button or check box with the focus; otherwise it starts or pauses the replay.

        Hints of commands do not cover what the status bar says about a scan: the tooltips have the same text.
        """
        if event.type() == QEvent.Type.StatusTip and self.status_bar.activity.text():
            return True
        button = isinstance(QApplication.focusWidget(), QAbstractButton)
        if button and event.type() == QEvent.Type.ShortcutOverride and cast(QKeyEvent, event).key() == Qt.Key.Key_Space:
            event.accept()
            return True
        done = super().event(event)
        if event.type() is QEvent.Type.UpdateRequest:  # the window is painted
            self.session.begin()
        return done

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:
        """Accept files that can be opened."""
        if self.files.can_drop(event.mimeData()):
            event.setDropAction(Qt.DropAction.CopyAction)  # a file manager would delete a file that was moved
            event.accept()

    def dropEvent(self, event: QDropEvent) -> None:
        """Open the dropped file."""
        self.files.drop(event.mimeData())
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
