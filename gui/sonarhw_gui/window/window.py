"""The main window: creates its parts, connects them, and updates them when the session changes."""

import re
from collections.abc import Callable
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any, Protocol, cast

from PySide6.QtCore import QEvent, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import (
    QAction,
    QCloseEvent,
    QDragEnterEvent,
    QDropEvent,
    QKeyEvent,
    QKeySequence,
    QResizeEvent,
    QShowEvent,
)
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QDockWidget,
    QFormLayout,
    QLayout,
    QMainWindow,
    QScrollArea,
    QTabBar,
    QVBoxLayout,
    QWidget,
)

from sonarhw_gui.model.look import Look
from sonarhw_gui.model.scene import History
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.model.theme import apply_look
from sonarhw_gui.panels.device import DevicePanel
from sonarhw_gui.panels.replay import ReplayBar, SoundBar
from sonarhw_gui.panels.room import RoomPanel
from sonarhw_gui.panels.searches import CausesPanel, FindPanel, FitPanel, ScansPanel
from sonarhw_gui.session.session import Turns, WindowSession
from sonarhw_gui.session.source import Replay
from sonarhw_gui.session.status import Status
from sonarhw_gui.views.base import View
from sonarhw_gui.views.legend import Legend
from sonarhw_gui.views.table import BounceLine, Sentence
from sonarhw_gui.widgets import LabelSlot
from sonarhw_gui.window.bars import Banner, Hint, StatusBar, ToolBar
from sonarhw_gui.window.commands import (
    Commands,
    ConnectCommands,
    HelpCommands,
    LayoutMenu,
    LookCommands,
    NoteCommands,
    PrintCommand,
    UndoList,
    ViewMenus,
    fill_menus,
)
from sonarhw_gui.window.file_commands import FileCommands, SaveCommands
from sonarhw_gui.window.views import TabbedWindow, ViewArea

# The connections between the session and the commands, panels and bars of the window.


def connect_commands(commands: Commands, session: WindowSession) -> None:
    """Connect each command with its action in the session."""
    showing = session.showing
    for action, slot in (
        (commands.scan, session.scan),
        (commands.stop, session.stop),
        (commands.home, session.live.home),
        (commands.undo, showing.undo),
        (commands.redo, showing.redo),
        (commands.previous, showing.choose_previous),
        (commands.next, showing.choose_next),
        (commands.newest, showing.follow_newest),
        (commands.sound, session.play_sound),
        (commands.leave_replay, session.leave_replay),
    ):
        action.triggered.connect(slot)


def connect_device(panel: DevicePanel, session: WindowSession) -> None:
    """Connect the device panel with the scanner."""
    panel.connect_requested.connect(session.live.connect)
    panel.disconnect_requested.connect(session.live.disconnect)
    panel.turn_requested.connect(session.live.turn)
    panel.settings_changed.connect(session.live.set_settings)


def connect_fit(panel: FitPanel, session: WindowSession) -> None:
    """Connect the fit panel with the fits of the session."""
    panel.edited.connect(session.showing.edit)
    panel.requested.connect(session.fitting.start)
    panel.cancelled.connect(session.fitting.cancel)
    session.fitting.changed.connect(panel.show_fit)


def connect_causes(panel: CausesPanel, session: WindowSession) -> None:
    """Connect the panel of causes with the search of the session."""
    panel.requested.connect(session.causes.start)
    panel.cancelled.connect(session.causes.cancel)
    panel.edited.connect(session.showing.edit)
    panel.undone.connect(session.showing.undo)
    panel.proposed.connect(session.showing.propose)
    panel.picked.connect(session.showing.choose)
    session.causes.changed.connect(panel.show_causes)


def connect_scans(panel: ScansPanel, session: WindowSession) -> None:
    """Connect the panel of scans with their list."""
    panel.kept.connect(session.scans.keep)
    panel.sweeps_kept.connect(session.scans.keep_sweeps)
    panel.removed.connect(session.scans.remove)
    panel.switched.connect(session.scans.switch)
    panel.pair_chosen.connect(session.scans.compare)
    session.scans.changed.connect(panel.show_scans)


def connect_finding(panel: FindPanel, session: WindowSession) -> None:
    """Connect the panel "Find the room" with the search of the session."""
    finding, showing = session.finding, session.showing
    panel.requested.connect(finding.start)
    panel.continued.connect(finding.go_on)
    panel.cancelled.connect(finding.cancel)
    panel.rejected.connect(finding.reject)
    panel.accepted.connect(finding.note_accepted)
    panel.next_requested.connect(finding.plan_next)
    panel.edited.connect(showing.edit)
    panel.drawn.connect(showing.draw_found)
    finding.changed.connect(panel.show_search)


def connect_replay(bar: ReplayBar, commands: Commands, session: WindowSession) -> None:
    """Connect the replay bar and the commands of a replay with the log that is replayed, if there is one."""

    def slot(act: Callable[[Replay, Any], object]) -> Callable[..., None]:
        return lambda value=None: session.in_replay(lambda replay: act(replay, value))

    for signal, act in (
        (commands.play.triggered, lambda replay, _: replay.toggle()),
        (commands.back.triggered, lambda replay, _: replay.step(-1)),
        (commands.forward.triggered, lambda replay, _: replay.step(1)),
        (commands.previous_scan.triggered, lambda replay, _: replay.previous_scan()),
        (commands.next_scan.triggered, lambda replay, _: replay.next_scan()),
        (commands.loop.triggered, _set_loop),
        (commands.skip_gaps.triggered, _set_skip_gaps),
        (bar.toggled, lambda replay, _: replay.toggle()),
        (bar.sought, Replay.seek),
        (bar.speed_chosen, _set_speed),
    ):
        signal.connect(slot(act))
    session.replay_changed.connect(bar.show_state)
    bar.show_state(session.replay)


def _set_loop(replay: Replay, loop: bool) -> None:
    replay.loop = loop


def _set_skip_gaps(replay: Replay, skip: bool) -> None:
    replay.skip_gaps = skip


def _set_speed(replay: Replay, speed: float) -> None:
    replay.speed = speed


def connect_sound(bar: SoundBar, session: WindowSession) -> None:
    """Connect the sound bar with the playback."""
    sound = session.sound
    bar.toggled.connect(sound.toggle)
    bar.sought.connect(sound.seek)
    bar.slowness_chosen.connect(sound.set_slowness)
    bar.loop_changed.connect(sound.set_loop)
    bar.every_changed.connect(sound.set_every)
    bar.closed.connect(sound.close)
    sound.changed.connect(bar.show_state)


# The enabled commands, and the labels of Undo and Redo.


def show_history(commands: Commands, history: History) -> None:
    """Label Undo and Redo with their edits; disable a command without an edit."""
    for action, name, label in (
        (commands.undo, "Undo", history.undo_label),
        (commands.redo, "Redo", history.redo_label),
    ):
        action.setText(f"{name} {label}".strip())
        action.setEnabled(bool(label))


def show_scanner(commands: Commands, status: Status) -> None:
    """Enable the commands that are possible in this state of the scanner."""
    commands.scan.setEnabled(status.can_scan)
    commands.stop.setEnabled(status.scanning)
    commands.home.setEnabled(status.can_turn)
    for action in (commands.open_log, commands.open_room, commands.import_scan, commands.recordings):
        action.setEnabled(not status.scanning)


# The docks: panels at the side of the window that the user can open, close and move.


_LEAST_WIDTH = 290  # pixels


class Panel(Protocol):
    """A widget that shows a part of a `Shown`."""

    def show_state(self, shown: Shown) -> None:
        """Show the changes since the last call."""

    def isVisibleTo(self, ancestor: QWidget) -> bool:
        """Return whether it is visible when `ancestor` is. Implemented by QWidget."""


class _VerticalScrollArea(QScrollArea):
    """Scrolls vertically; never narrower than its content."""

    def __init__(self, panel: QWidget) -> None:
        super().__init__()
        self.setWidgetResizable(True)
        self.setFrameShape(QScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        panel.setMinimumWidth(_LEAST_WIDTH)
        self.setWidget(panel)
        self._panel = panel

    def minimumSizeHint(self) -> QSize:
        """Return the width of the panel and the scroll bar."""
        width = max(self._panel.minimumSizeHint().width(), self._panel.minimumWidth())
        return QSize(width + self.verticalScrollBar().sizeHint().width(), super().minimumSizeHint().height())


class _Dock(QDockWidget):
    """A dock with a panel, and an action that opens it, brings it to the front, or closes it."""

    def __init__(self, name: str, key: str, about: str, panel: Panel, window: QMainWindow) -> None:
        super().__init__(name, window)
        self._panel, self._main_window = panel, window
        self._shown: Shown | None = None
        self.setWidget(_VerticalScrollArea(cast(QWidget, panel)))
        self.setObjectName(name)  # key of the stored layout
        self.opener = QAction(name, self, checkable=True, shortcut=QKeySequence(key))  # checked: it is in front
        self.opener.setToolTip(f"{about} ({key})")
        self.opener.triggered.connect(self._open_or_close)
        self.visibilityChanged.connect(self.opener.setChecked)

    def show_state(self, shown: Shown) -> None:
        """Update the panel if it is visible."""
        self._shown = shown
        if self._panel.isVisibleTo(self._main_window):
            self._panel.show_state(shown)

    def bring_to_front(self) -> None:
        """Open it in front of the others."""
        if self._shown is not None:
            self._panel.show_state(self._shown)
            for layout in reversed(self.findChildren(QLayout)):  # inner ones first
                layout.activate()  # else the first paint has the height from before
        self.show()
        self.raise_()

    @Slot(bool)
    def _open_or_close(self, wanted: bool) -> None:
        if wanted:
            self.bring_to_front()
        else:
            self.close()


class Docks:
    """The docks of one window, as tabs. All are closed initially."""

    def __init__(self, window: QMainWindow) -> None:
        self._window = window
        self._docks: list[_Dock] = []

    def add(self, name: str, key: str, about: str, panel: Panel) -> QDockWidget:
        """Return a new dock with `panel`; `key` opens and closes it, and `about` says what it is for."""
        dock = _Dock(name, key, about, panel, self._window)
        self._window.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, dock)
        if self._docks:
            self._window.tabifyDockWidget(self._docks[-1], dock)
        dock.hide()
        self._docks.append(dock)
        return dock

    def show(self, name: str) -> None:
        """Open a dock in front of the others."""
        next(dock for dock in self._docks if dock.objectName() == name).bring_to_front()

    def show_state(self, shown: Shown) -> None:
        """Update the visible panels."""
        for dock in self._docks:
            dock.show_state(shown)

    @property
    def actions(self) -> list[QAction]:
        """The actions that open and close the docks."""
        return [dock.opener for dock in self._docks]


# Names of all tab stops for screen readers, from what the window shows beside them.
#
# A widget that shows no text of its own takes the name from its label in a form, from its view, or from its tooltip.


def name_tab_stops(window: QMainWindow) -> None:
    """Name every tab stop of a window that has no name yet."""
    for form in window.findChildren(QFormLayout):
        for row in range(form.rowCount()):
            _name_row(form, row)
    for stop in window.findChildren(QWidget):
        if stop.focusPolicy() & Qt.FocusPolicy.TabFocus and not spoken_name(stop):
            stop.setAccessibleName(_derived_name(stop))


def spoken_name(widget: QWidget) -> str:
    """Return what a screen reader says: the accessible name, or the text of a button."""
    text = widget.text().replace("&", "") if isinstance(widget, QAbstractButton) else ""
    return widget.accessibleName() or text


def _name_row(form: QFormLayout, row: int) -> None:
    item = form.itemAt(row, QFormLayout.ItemRole.FieldRole)
    field = item.widget() if item is not None else None
    label = form.labelForField(field) if field is not None else None
    text = str(label.property("text") or "") if label is not None else ""
    if field is None or not text:
        return
    for widget in (field, *field.findChildren(QWidget)):
        if widget.focusPolicy() & Qt.FocusPolicy.TabFocus and not spoken_name(widget):
            widget.setAccessibleName(text.replace("&", "").rstrip(":"))


def _derived_name(stop: QWidget) -> str:
    if isinstance(stop, QTabBar):
        return "tabs"
    tip = re.sub(r"<[^>]*>", "", stop.toolTip())
    if tip:
        return re.split(r"[;(.]", tip)[0].strip()
    parent: QWidget | None = stop
    while parent is not None and not isinstance(parent, View):  # slow, so only without a tooltip
        parent = parent.parentWidget()
    if parent is not None:
        return f"{parent.entry.name} plot"
    if isinstance(stop, QScrollArea):
        return "panel"
    above = stop.parentWidget()
    return above.accessibleName() or above.windowTitle() or type(above).__name__ if above is not None else ""


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
        self.banner, self.legend, self.sentence = Banner(session.notices), Legend(), Sentence()
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
        connect_replay(self.replay_bar, commands, session)
        connect_sound(self.sound_bar, session)
        self.sound_bar.film_requested.connect(commands.save_film.trigger)
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
        session.saved.connect(self.status_bar.show_briefly)

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
        log = Path(session.log_file).name if session.replay is not None else ""
        files = " · ".join(filter(None, (log, session.shown.scene.room_file)))
        title = f"sonarhw — {session.shown.title}{' — ' if files else ''}{files}[*]"
        if title != self.windowTitle():
            self.setWindowTitle(title)
        if session.kept.rooms.changed is not self.isWindowModified():
            self.setWindowModified(session.kept.rooms.changed)

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
