"""The main window: creates its parts, connects them, and updates them when the session changes."""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, cast

from PySide6 import QtGui, QtWidgets
from PySide6.QtCore import QEvent, QSize, Qt, QTimer, Signal, Slot

from sonarhw_gui.model.look import Look
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.model.theme import apply_look
from sonarhw_gui.panels.device import DevicePanel
from sonarhw_gui.panels.replay import ReplayBar, SoundBar
from sonarhw_gui.panels.room import RoomPanel
from sonarhw_gui.panels.searches import CausesPanel, FindPanel, FitPanel, ScansPanel, TrackPanel
from sonarhw_gui.session.session import Turns, WindowSession
from sonarhw_gui.session.status import Status
from sonarhw_gui.views.base import ViewEntry
from sonarhw_gui.views.legend import Legend
from sonarhw_gui.widgets import ArrowRow, LayoutBarrier, arranged, close_dialogs
from sonarhw_gui.window.bars import Banner, Card, Hint, StartPage, StatusBar, ToolBar
from sonarhw_gui.window.commands import Commands, CommandSlots, LayoutMenu, offer_view_menus, undo_menu
from sonarhw_gui.window.dialogs import HelpPage, open_dialog
from sonarhw_gui.window.file_commands import FileCommands, SaveCommands
from sonarhw_gui.window.views import Drawing, OpenedDock, ViewArea

# The docks: panels at the side of the window that the user can open, close and move.


_LEAST_WIDTH = 290  # pixels


class VerticalScrollArea(QtWidgets.QScrollArea):
    """Scrolls vertically; never narrower than its content."""

    def __init__(self, panel: QtWidgets.QWidget) -> None:
        super().__init__()
        self.setWidgetResizable(True)
        self.setFrameShape(QtWidgets.QScrollArea.Shape.NoFrame)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        panel.setMinimumWidth(_LEAST_WIDTH)
        self.setWidget(panel)
        self._panel = panel

    def minimumSizeHint(self) -> QSize:
        """Return the width of the panel and the scroll bar."""
        width = max(self._panel.minimumSizeHint().width(), self._panel.minimumWidth())
        return QSize(width + self.verticalScrollBar().sizeHint().width(), super().minimumSizeHint().height())


class PanelDock(OpenedDock):
    """A dock with a panel, which is updated while it is visible."""

    def __init__(
        self,
        name: str,
        key: str,
        about: str,
        panel: QtWidgets.QWidget,
        show: Callable[[Shown], None],
        views: ViewArea,
    ) -> None:
        """`key` opens and closes it, `about` says what it is for, and `show` updates the panel."""
        super().__init__(name, VerticalScrollArea(panel), views, key)
        self._panel, self._drawing, self._views = panel, Drawing(show), views
        self._shown: Shown | None = None
        self.opener.setToolTip(f"{about} ({key})")

    def show_state(self, shown: Shown) -> None:
        """Update the panel if it is visible; else release what it has drawn of another scan or scene."""
        self._shown = shown
        if self._panel.isVisibleTo(self._views):
            self._drawing.show_state(shown)
        else:
            self._drawing.release(shown)

    def bring_to_front(self) -> None:
        """Open it in front of the others."""
        if self._shown is not None:
            self._drawing.show_state(self._shown)
            for layout in reversed(self.findChildren(QtWidgets.QLayout)):  # inner ones first
                layout.activate()  # else the first paint has the height from before
        super().bring_to_front()
        self._views.make_room(self)


# Names of all tab stops for screen readers, from what the window shows beside them.
#
# A widget that shows no text of its own takes the name from its label in a form, from its view, or from its tooltip.


def name_tab_stops(window: QtWidgets.QMainWindow) -> None:
    """Name every tab stop of a window that has no name yet."""
    for form in window.findChildren(QtWidgets.QFormLayout):
        for row in range(form.rowCount()):
            _name_row(form, row)
    for stop in window.findChildren(QtWidgets.QWidget):
        if stop.focusPolicy() & Qt.FocusPolicy.TabFocus and not spoken_name(stop):
            stop.setAccessibleName(_derived_name(stop))


def spoken_name(widget: QtWidgets.QWidget) -> str:
    """Return what a screen reader says: the accessible name, or the text of a button."""
    text = widget.text().replace("&", "") if isinstance(widget, QtWidgets.QAbstractButton) else ""
    return widget.accessibleName() or text


def _name_row(form: QtWidgets.QFormLayout, row: int) -> None:
    item = form.itemAt(row, QtWidgets.QFormLayout.ItemRole.FieldRole)
    field = item.widget() if item is not None else None
    label = form.labelForField(field) if field is not None else None
    text = str(label.property("text") or "") if label is not None else ""
    if field is None or not text:
        return
    for widget in (field, *field.findChildren(QtWidgets.QWidget)):
        if widget.focusPolicy() & Qt.FocusPolicy.TabFocus and not spoken_name(widget):
            widget.setAccessibleName(text.replace("&", "").rstrip(":"))


def _derived_name(stop: QtWidgets.QWidget) -> str:
    if isinstance(stop, QtWidgets.QTabBar):
        return "tabs"
    tip = re.sub(r"<[^>]*>", "", stop.toolTip())
    if tip:
        return re.split(r"[;(.]", tip)[0].strip()
    parent: QtWidgets.QWidget | None = stop
    while parent is not None:
        entry = getattr(parent, "entry", None)
        if isinstance(entry, ViewEntry):
            return f"{entry.name} plot"
        parent = parent.parentWidget()
    if isinstance(stop, QtWidgets.QScrollArea):
        return "panel"
    above = stop.parentWidget()
    return above.accessibleName() or above.windowTitle() or type(above).__name__ if above is not None else ""


_ANALYSES = ("Causes", "Fit", "Scans", "Find the room", "Track")  # docks of the menu Analyse; the others are in View
_Connection = tuple[Any, Callable[..., object]]  # a signal and its slot
_SIZE = QSize(1280, 800)
_FRAME = QSize(16, 48)  # pixels, for the frame of the window
_LOW = 640  # pixels
_NO_PAINT = 500  # ms
# ms. During a scan or a drag, each frame updates the large view and one other part: a plot beside it or a third of the
# text. So much later, the next part follows if there is no other frame.
_TURN = 40


# The order of the tab stops.


def tab_stops(
    window: QtWidgets.QWidget, parts: Sequence[QtWidgets.QWidget], rows: Sequence[ArrowRow]
) -> list[QtWidgets.QWidget]:
    """Return what Tab visits: the stops of each part in turn, then the others; one stop in each row of buttons.

    Qt would also visit what is behind another tab.
    """
    chain = [window]
    while (widget := cast(QtWidgets.QWidget, chain[-1].nextInFocusChain())) is not window:
        chain.append(widget)
    possible = [stop for stop in chain if stop.window() is window and _can_have_focus(stop)]
    stops = [stop for stop in possible if not any(row.skips(stop) for row in rows)]
    places = {stop: [part is stop or part.isAncestorOf(stop) for part in parts] for stop in stops}
    return sorted(stops, key=lambda stop: [*places[stop], True].index(True))


def _can_have_focus(widget: QtWidgets.QWidget) -> bool:
    """Return whether Tab can visit a widget that is not behind another tab."""
    if not widget.focusPolicy() & Qt.FocusPolicy.TabFocus or widget.focusProxy() is not None:
        return False
    parent: QtWidgets.QWidget | None = widget
    while parent is not None and not isinstance(parent, OpenedDock):
        parent = parent.parentWidget()
    return widget.isVisible() and widget.isEnabled() and (parent is None or parent.in_front)


class MainWindow(QtWidgets.QMainWindow):
    """The main window with all its parts."""

    closing = Signal()  # emitted before anything is closed

    def __init__(self, session: WindowSession) -> None:
        super().__init__()
        self.session = session
        self.views = ViewArea()
        self.commands = Commands(self, [view.entry for view in self.views.all])
        self.files, self.saving = FileCommands(session, self), SaveCommands(session, self, self.views)
        self.layouts, self.slots = LayoutMenu(self, self.views), CommandSlots(session, self.saving.image, self)
        self.device, self.room = DevicePanel(self.commands, session.live), RoomPanel()
        self.fit_panel, self.causes, self.finding = FitPanel(session), CausesPanel(session), FindPanel(session)
        self.scans, self.track = ScansPanel(session, self.files.add_scan), TrackPanel(session)
        self.banner, self.legend, self.hint = Banner(session.notices), Legend(), Hint()
        actions = self.commands.actions
        self.card = Card(
            [actions["find_causes"]], [actions[name] for name in ("play_sound", "list_echoes", "edit_note")]
        )
        self.sentence, self.bounces = self.card.sentence, self.card.bounces
        self.replay_bar, self.status_bar = ReplayBar(self.commands, session), StatusBar()
        self.sound_bar = SoundBar(session.sound, self.saving.save_film)
        self.toolbar, self.start_page = ToolBar(self.commands, self.files.shipped), StartPage(self.commands, self.files)
        self.docks: list[PanelDock] = []  # the panels
        self._rows = ArrowRow(self.legend), ArrowRow(self.replay_bar)
        self._look: Look | None = None
        self._open = False  # each part that becomes visible reports it; together, they are updated once
        plots = [partial(self._show_plot, place) for place in range(self.views.plots_beside)]
        self._texts = (self._show_texts, self._show_sentence, self._show_figures)
        others: tuple[Callable[[], None], ...] = (*plots, self._show_sentence, self._show_figures)
        # to paint the table takes as long as several others
        self.turns = Turns((self._show_texts, *others, *others), _TURN, self)
        # once for all tabs and plots that are created when they are first visible
        self._names_timer = QTimer(self, singleShot=True, interval=0)
        self._names_timer.timeout.connect(self._name_tab_stops)
        self._arrange()
        self._connect()
        self._show(session.shown)
        self._show_status(session.status)
        self._names_timer.start()
        self.views.plan.drawing.setFocus()

    def _arrange(self) -> None:
        self.setAcceptDrops(True)
        self.addToolBar(self.toolbar)
        centre = QtWidgets.QWidget()
        self.views.frame_large_view(LayoutBarrier(self.legend), self.card)
        above, below = (self.banner, self.hint), (self.sound_bar, self.replay_bar)
        middle = QtWidgets.QWidget()
        arranged(QtWidgets.QVBoxLayout(middle), self.views, self.start_page)
        arranged(QtWidgets.QVBoxLayout(centre), *above, middle, *below, rest=middle)
        self.setCentralWidget(centre)
        self.setStatusBar(self.status_bar)
        for name, key, about, panel in (
            ("Device", "F7", "Connect, scan, turn and home the scanner", self.device),
            ("Room", "F8", "Materials, air, board and model", self.room),
            ("Fit", "F9", "Find pose, board and room values from the scan", self.fit_panel),
            ("Causes", "F11", "Find missing objects and other causes of misfits", self.causes),
            ("Scans", "F12", "Show several scans, and compare two", self.scans),
            ("Find the room", "Ctrl+M", "Find walls from scans, and the next place to scan", self.finding),
            ("Track", "Ctrl+Shift+T", "Where a robot was, by its odometry and its sonar", self.track),
        ):
            self._add_dock(PanelDock(name, key, about, panel, panel.show_state, self.views))
        offer_view_menus(self.views.all, self.commands, self.session.showing)
        added = {
            "shipped rooms": [self.files.shipped.menuAction()],
            "recent files": [self.files.menuAction()],
            "undo steps": [undo_menu(self.session.showing, self).menuAction()],
            "analyses": [dock.opener for dock in self.docks if dock.objectName() in _ANALYSES],
            "docks": [
                *self.views.openers,
                *(dock.opener for dock in self.docks if dock.objectName() not in _ANALYSES),
            ],
            "layouts": [self.layouts.menuAction()],
        }
        self.commands.fill(self.menuBar(), self.views.all, added)
        self.resize(_SIZE.boundedTo(self.screen().availableSize() - _FRAME))

    def _add_dock(self, dock: PanelDock) -> None:
        self.views.add_panel(dock)
        dock.visibilityChanged.connect(self._show_again)
        self.docks.append(dock)

    @property
    def dock_openers(self) -> list[QtGui.QAction]:
        """The actions that open and close the docks."""
        return [dock.opener for dock in self.docks]

    def open_dock(self, name: str) -> None:
        """Open a dock in front of the others."""
        next(dock for dock in self.docks if dock.objectName() == name).bring_to_front()

    def _connect(self) -> None:
        self.commands.connect(self)
        self.views.connect_gestures(self.session.showing)
        for signal, slot in (*self._panel_connections(), *self._bar_connections(), *self._window_connections()):
            signal.connect(slot)

    def _panel_connections(self) -> tuple[_Connection, ...]:
        session, room = self.session, self.room
        return (
            (room.edited, session.showing.edit),
            (room.surface.chosen, self.views.plan.drawing.controller.choose_surface),
            (room.model.board_file_requested, self.files.open_board),
            (self.views.plan.gestures.surface_chosen, room.surface.choose),
        )

    def _bar_connections(self) -> tuple[_Connection, ...]:
        session = self.session
        return (
            (session.replay_changed, self._show_commands),
            (session.recent_changed, self.start_page.show_recent),
            (self.banner.opened, self._make_room),
            (self.legend.switched, session.showing.switch),
            (self.toolbar.place.textActivated, session.showing.set_place),
        )

    def _window_connections(self) -> tuple[_Connection, ...]:
        session = self.session
        return (
            (self.views.uncovered, self._show_again),
            (self.views.answered, self.hint.end),
            (session.showing.changed, self._show),
            (session.showing.edited, self._show_title),
            (session.status_changed, self._show_status),
            (session.room_opened, self.views.plan.fit),
            (session.pose_asked, self.find_pose_anywhere),
            (session.saved, self.status_bar.show_briefly),
        )

    @Slot()
    def find_pose(self) -> None:
        """Fit the pose of the scanner, and show the panel of the fit."""
        self.open_dock("Fit")
        self.fit_panel.begin.click()

    @Slot()
    def find_pose_anywhere(self) -> None:
        """Find the pose of the scanner in the whole room, and show the panel of the fit."""
        self.fit_panel.where.setCurrentIndex(1)
        self.find_pose()

    @Slot()
    def find_causes(self) -> None:
        """Search for what explains the misfits, and show the panel of the causes."""
        self.open_dock("Causes")
        self.causes.begin.click()

    @Slot()
    def list_echoes(self) -> None:
        """List all echoes of the selected heading."""
        self.views.bring_to_front(self.views.echo_list)

    @Slot()
    def _show_commands(self) -> None:
        self.commands.show_state(self.session)

    @Slot(object)
    def _show(self, shown: Shown) -> None:
        if shown.look != self._look:
            self._set_look(shown.look)
        self.views.setVisible(not self.session.empty)
        self.start_page.show_state(self.session.empty)
        self.views.show_large(shown)
        for dock in self.docks:
            dock.show_state(shown)
        self.toolbar.show_state(shown)
        self._show_title()
        self.hint.show_state(shown)
        self._show_commands()  # at once: a key acts only on an enabled command, such as Undo after an edit
        if self._is_busy:
            self.turns.advance()
        else:
            self.turns.all_now()
            self.views.release_hidden(shown)

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
        self.card.show_state(self.session.shown)

    def _show_figures(self) -> None:
        self.legend.show_state(self.session.shown)
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

    def _set_look(self, look: Look) -> None:
        self._look = look
        apply_look(look)
        bars = self.banner, self.legend, self.hint, self.sound_bar, self.replay_bar, self.status_bar
        for part in (*bars, self.views):
            part.set_look(look)

    @Slot(object)
    def _show_status(self, status: Status) -> None:
        if self._is_busy:
            self.turns.soon()
        else:
            for show in self._texts:
                show()
        self._show_commands()
        target = self.session.live.target
        self.toolbar.show_scanner(None if target is None else target.url)
        self.files.shipped.setEnabled(not status.scanning)
        self.files.menuAction().setEnabled(not status.scanning)
        self.toolbar.place.setEnabled(not status.scanning and self.toolbar.place.count() > 0)

    def focusNextPrevChild(self, forward: bool) -> bool:
        """Move the focus with Tab: the plan is first, then what is beside and below it, at last the toolbar."""
        parts = self.views.stage, self.legend, self.views, self.sound_bar, self.replay_bar, self.banner, self.toolbar
        stops, focused = tab_stops(self, parts, self._rows), self.focusWidget()
        if stops:
            place = stops.index(focused) + (1 if forward else -1) if focused in stops else 0 if forward else -1
            reason = Qt.FocusReason.TabFocusReason if forward else Qt.FocusReason.BacktabFocusReason
            stops[place % len(stops)].setFocus(reason)
        return bool(stops)

    def showEvent(self, event: QtGui.QShowEvent) -> None:
        """Update what is visible. Begin to predict soon even if the window is never painted, as on another desktop."""
        super().showEvent(event)
        self._open = True
        self._show_again()
        QTimer.singleShot(_NO_PAINT, self.session.begin)

    def closeEvent(self, event: QtGui.QCloseEvent) -> None:
        """Close the session too: stop the board and close the log."""
        self.closing.emit()
        close_dialogs(self)  # which ends their threads
        self._open = False
        self.hide()  # a thread may take a moment to finish
        self.session.close()
        event.accept()

    def event(self, event: QEvent) -> bool:
        """Begin to predict after the first paint, and use keys that are more than commands.

        Hints of commands do not cover what the status bar says about a scan: the tooltips have the same text.
        """
        if event.type() == QEvent.Type.StatusTip and self.status_bar.activity.text():
            return True
        if event.type() == QEvent.Type.ShortcutOverride and self._uses_key(cast(QtGui.QKeyEvent, event).key()):
            event.accept()
            return True
        done = super().event(event)
        if event.type() is QEvent.Type.UpdateRequest:  # the window is painted
            self.session.begin()
        return done

    def _uses_key(self, key: int) -> bool:
        """Let Space press the button with the focus, not start the replay, and let Esc close an open help page."""
        if key == Qt.Key.Key_Escape and (page := open_dialog(self, HelpPage)) is not None:
            page.close()
            return True
        return key == Qt.Key.Key_Space and isinstance(QtWidgets.QApplication.focusWidget(), QtWidgets.QAbstractButton)

    def dragEnterEvent(self, event: QtGui.QDragEnterEvent) -> None:
        """Accept files that can be opened."""
        if self.files.can_drop(event.mimeData()):
            event.setDropAction(Qt.DropAction.CopyAction)  # a file manager would delete a file that was moved
            event.accept()

    def dropEvent(self, event: QtGui.QDropEvent) -> None:
        """Open the dropped file."""
        self.files.drop(event.mimeData())
        event.setDropAction(Qt.DropAction.CopyAction)
        event.accept()
