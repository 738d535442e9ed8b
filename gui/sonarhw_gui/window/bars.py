"""The bars around the views: banner, hint, card of the selected reading, status bar and toolbar."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path

from PySide6 import QtGui, QtWidgets
from PySide6.QtCore import QMargins, QSize, Qt, QTimer, Signal, Slot
from PySide6.QtGui import QAction
from sonarhw_compare.match import Kind
from sonarhw_compare.scanner_url import is_fake

from sonarhw.errors import shortened
from sonarhw.readings import Origin
from sonarhw_gui.model.look import LIGHT, MARKS, Class, Look
from sonarhw_gui.model.shown import Shown, bounces_text
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.session.scanner import FAKE_NOTE
from sonarhw_gui.session.status import Status
from sonarhw_gui.views.legend import mark_picture
from sonarhw_gui.widgets import ElidedLabel, FlowLayout, LayoutBarrier, PlainLabel, arranged, title_label
from sonarhw_gui.window.commands import Commands

# The banner: a line above the views with errors, warnings and offers.
#
# A message stays until the user dismisses it, its cause is gone, or a new scan begins. It is never a dialog, so it
# does not block a running scan.


class Banner(QtWidgets.QFrame):
    """Shows one notice at a time, the newest of the most severe kind; hidden without notices."""

    opened = Signal(bool)  # before it is shown: True; after it is hidden: False

    def __init__(self, notices: Notices) -> None:
        super().__init__()
        self.setObjectName("banner")
        self._notices = notices
        self._label = PlainLabel()
        self._label.setWordWrap(True)
        self._label.setSizePolicy(QtWidgets.QSizePolicy.Policy.Expanding, QtWidgets.QSizePolicy.Policy.Preferred)
        self.more_button = QtWidgets.QToolButton(autoRaise=True)
        self.more_button.setToolTip("Show the next message")
        self.more_button.clicked.connect(notices.show_next)
        self.accept_button = QtWidgets.QPushButton()
        self.accept_button.clicked.connect(notices.accept)
        self.decline_button = QtWidgets.QPushButton()
        self.decline_button.clicked.connect(notices.decline)
        self.close_button = QtWidgets.QToolButton(autoRaise=True)
        self.close_button.setText("×")
        self.close_button.setToolTip("Dismiss this message")
        self.close_button.clicked.connect(notices.dismiss)
        row = QtWidgets.QHBoxLayout(self)
        row.setContentsMargins(10, 4, 6, 4)
        for part in (self._label, self.accept_button, self.decline_button, self.more_button, self.close_button):
            row.addWidget(part)
        notices.changed.connect(self._show)
        self.hide()
        self._show()

    @property
    def message(self) -> str:
        """The visible text; empty while the banner is hidden."""
        return self._label.text() if not self.isHidden() else ""

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        ink, paper = look.palette.warning_ink, look.palette.warning_paper
        self.setStyleSheet(
            f"#banner {{ background: {paper}; }} #banner QLabel, #banner QToolButton {{ color: {ink}; }}"
        )

    @Slot()
    def _show(self) -> None:
        notice, more = self._notices.shown, self._notices.more
        self._label.setText(f"⚠ {notice.text}" if notice.text else "")
        for button, offer in ((self.accept_button, notice.accept), (self.decline_button, notice.decline)):
            button.setText(offer.text if offer else "")
            button.setVisible(offer is not None)
        self.more_button.setText(f"{more} more ▸")
        self.more_button.setVisible(more > 0)
        if notice.text:
            self.opened.emit(True)  # before it needs its place: Qt enlarges the window at once
            self.show()
        else:
            self.hide()
            self.opened.emit(False)


# The hint of the first start: what is measured, what is predicted, and where to click. It goes away by itself.


_LASTS = 120_000  # ms
_MARKS = {
    Origin.MEASURED: "Orange marks: measured by the sonar.",
    Origin.FAKE: "Orange marks: from a fake scanner, which hides one post.",
    Origin.SIMULATED: "Orange marks: simulated readings.",
    Origin.IMPORTED: "Orange marks: readings imported from another program.",
}
_NO_MARKS = "Orange marks: readings. There are none yet; Scan (F5) makes them."
_LINE, _NO_LINE = "Blue line: predicted by the model.", "Blue line: a prediction. It needs a room (Ctrl+R)."
_CLICK = "Click {}: the sentence below says why."
_COLOURS = "measured", "predicted", "chosen"  # of the steps


class Hint(QtWidgets.QFrame):
    """Three steps in one line, shown until a reading is selected, or for two minutes."""

    ended = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setObjectName("hint")
        steps = QtWidgets.QWidget()
        row = FlowLayout(steps, QMargins(6, 2, 6, 2), gap=18)
        self.labels = [PlainLabel() for _ in _COLOURS]
        for label in self.labels:
            row.addWidget(label)
        self.close_button = QtWidgets.QToolButton(autoRaise=True)
        self.close_button.setText("×")
        self.close_button.setToolTip("Close this hint; Help > First steps shows it again")
        self.close_button.clicked.connect(self.end)
        line = QtWidgets.QHBoxLayout(self)
        line.setContentsMargins(4, 0, 6, 0)
        line.addWidget(steps, stretch=1)
        line.addWidget(self.close_button)
        self.timer = QTimer(self, singleShot=True, interval=_LASTS)
        self.timer.timeout.connect(self.end)
        self.is_open = False  # until it has ended, also while it gives way to a message
        self._gives_way = False
        self.hide()

    def show_state(self, shown: Shown) -> None:
        """Name what made the marks; without readings, and without a room, say that something is missing."""
        empty, room = not shown.readings, shown.scene.room is not None
        marks = _NO_MARKS if empty else _MARKS[shown.origin]
        click = _CLICK.format("the blue line" if empty and room else "a mark")
        for number, text in enumerate((marks, _LINE if room else _NO_LINE, click)):
            self.labels[number].setText(f"{number + 1}  {text}")

    def set_look(self, look: Look) -> None:
        """Give each step the colour of what it describes."""
        for label, colour in zip(self.labels, _COLOURS, strict=True):
            label.setStyleSheet(f"color: {getattr(look.palette, colour)}; font-weight: bold")

    @Slot()
    def show_first_steps(self) -> None:
        """Show the hint."""
        self.timer.start()
        self.is_open = True
        self.setVisible(not self._gives_way)

    @Slot()
    def end(self) -> None:
        """Hide the hint."""
        self.timer.stop()
        if self.is_open:
            self.is_open = False
            self.hide()
            self.ended.emit()

    def give_way(self, wanted: bool) -> None:
        """Hide the hint for as long as a message needs its place."""
        self._gives_way = wanted
        self.setVisible(self.is_open and not wanted)


# The start page: what can be opened, while nothing is.


_MOST_RECENT = 5
_PAGE_WIDTH = 460  # pixels
PICTURE = QSize(128, 96)  # pixels, of a recent file
_STARTS = ("watch_demo", "new_room", "open_room", "open_log", "import_scan", "connect_scanner")


class StartPage(QtWidgets.QScrollArea):
    """Takes the place of the views while there is no room, no reading and no scanner but a fake one."""

    def __init__(self, commands: Commands, recent: QtWidgets.QMenu) -> None:
        """`recent`: the menu of recent files."""
        super().__init__()
        self.setWidgetResizable(True)
        self.setFrameShape(QtWidgets.QFrame.Shape.NoFrame)
        self._recent = recent
        page = QtWidgets.QWidget()
        self._files = QtWidgets.QVBoxLayout()
        column = QtWidgets.QVBoxLayout()
        column.addStretch(1)
        column.addWidget(title_label("Start"))
        for name in _STARTS:
            column.addWidget(_start_button(commands.actions[name]))
        column.addLayout(self._files)
        column.addWidget(PlainLabel("Or drop files here: a room, a log, or scans of other programs.", wordWrap=True))
        column.addStretch(2)
        row = QtWidgets.QHBoxLayout(page)
        row.addStretch(1)
        row.addLayout(column)
        row.addStretch(1)
        self.setWidget(page)
        self.hide()

    def show_state(self, empty: bool) -> None:
        """Show the page if nothing is open."""
        if empty and self.isHidden():
            self.show_recent()
        self.setVisible(empty)

    @Slot()
    def show_recent(self) -> None:
        """List the files of the menu again."""
        while (item := self._files.takeAt(0)) is not None:
            item.widget().deleteLater()
        for action in self._recent.actions()[:_MOST_RECENT]:
            self._files.addWidget(_start_button(action, "Open recent: "))


def _start_button(action: QAction, before: str = "") -> QtWidgets.QPushButton:
    """Return a wide button that runs a command and says what it is for."""
    button = QtWidgets.QPushButton(f"{before}{action.text()}\n{action.statusTip() or action.data()}")
    button.setMinimumWidth(_PAGE_WIDTH)
    button.setStyleSheet("text-align: left; padding: 6px 12px")
    button.setToolTip(action.toolTip())
    button.setIcon(action.icon())
    button.setIconSize(PICTURE)
    button.clicked.connect(action.trigger)
    return button


# The card below the large view: why the selected reading has its range, and what to do next.


_LINES, _HEAD_LINES = 3, 2  # fixed height, so that a longer sentence does not move the views
_CARD_MARGIN = 12
_HEAD_SIZE, _WHY_SIZE = 1.15, 1.0  # of the default text size
MISFITS = Kind.SHORT, Kind.LONG, Kind.EXTRA, Kind.MISSED


def chosen_class(shown: Shown) -> Class | None:
    """Return the class of the selected reading; None without one, before it is compared, or for an asked heading."""
    if shown.chosen is None or shown.asked is not None:
        return None
    row = shown.row(shown.chosen)
    return None if row is None else row.kind


class Sentence(QtWidgets.QWidget):
    """Explains the selected reading: what it is in one or two bold lines, and why in the rest of three lines.

    The tooltip has the whole sentence if it does not fit.
    """

    def __init__(self) -> None:
        super().__init__()
        self._whole = ""
        self._look: Look | None = None
        self.head, self.why = PlainLabel(wordWrap=True), PlainLabel(wordWrap=True)
        for label in (self.head, self.why):
            label.setParent(self)  # without a layout: a second line of the head would lay out the window again
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)

    def text(self) -> str:
        """Return the whole sentence."""
        return self._whole

    def show_state(self, shown: Shown) -> None:
        """Show the sentence of the selected reading, in grey while it belongs to an older prediction."""
        for label in (self.head, self.why):
            _fade(label, shown.outdated)
        if self._look is None or self._look.scale != shown.look.scale:
            self._look = shown.look
            head = text_font(shown.look, _HEAD_SIZE)
            head.setBold(True)
            self.head.setFont(head)
            self.why.setFont(text_font(shown.look, _WHY_SIZE))
            most = _height_of(self.head, _HEAD_LINES) + _height_of(self.why, _LINES - _HEAD_LINES)
            self.setFixedHeight(max(most, _height_of(self.head, 1) + _height_of(self.why, _LINES - 1)))
            self._fit()
        if self._whole != shown.sentence:
            self._whole = shown.sentence
            self._fit()

    def resizeEvent(self, event: QtGui.QResizeEvent) -> None:
        """Fit the sentence into the new width."""
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        whole_head, _, whole_why = self._whole.partition("; ")
        one_line = shortened_to_lines(whole_head, self.head.font(), self.width(), 1) == whole_head
        lines = 1 if one_line else _HEAD_LINES
        head = shortened_to_lines(whole_head, self.head.font(), self.width(), lines)
        why = shortened_to_lines(whole_why, self.why.font(), self.width(), _LINES - lines)
        height = _height_of(self.head, lines)
        for label, text, top, below in (
            (self.head, head, 0, height),
            (self.why, why, height, height + _height_of(self.why, _LINES - lines)),
        ):
            label.setText(text)
            label.setGeometry(0, top, self.width(), below - top)
            label.heightForWidth(self.width())  # lays out now: during the paint, it would ask for another one
        self.setToolTip(self._whole if (head, why) != (whole_head, whole_why) else "")


class BounceLine(ElidedLabel):
    """The note on the selected reading, and the bounces of its path, numbered as in the plan, with the loss of each."""

    def __init__(self) -> None:
        super().__init__()
        self.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self._look: Look | None = None

    def show_state(self, shown: Shown) -> None:
        """Show note and bounces, in grey while they belong to an older prediction."""
        _fade(self, shown.outdated)
        if self._look is None or self._look.scale != shown.look.scale:
            self._look = shown.look
            _set_font(self, text_font(shown.look), 1)
        note = "" if shown.asked is not None else shown.notes.of(shown.chosen)
        text = " — ".join(filter(None, (f"note: {note}" if note else "", bounces_text(shown))))
        self.setText(text)


class Card(QtWidgets.QFrame):
    """The sentence and the bounces, with the mark of the reading's class, and buttons for what to do next."""

    def __init__(self, for_misfits: Sequence[QAction], for_all: Sequence[QAction]) -> None:
        """`for_misfits`: the actions that are offered only for a reading that does not match."""
        super().__init__()
        self.sentence, self.bounces = Sentence(), BounceLine()
        self._mark = PlainLabel()
        self._drawn: tuple[Class | None, Look] | None = None
        self.misfit_buttons = [_card_button(action) for action in for_misfits]
        buttons = [*self.misfit_buttons, *map(_card_button, for_all)]
        bounces = LayoutBarrier(self.bounces)
        lower = arranged(QtWidgets.QHBoxLayout(), bounces, *buttons, rest=bounces, gap=4)
        text = arranged(QtWidgets.QVBoxLayout(), self.sentence, lower, gap=2)
        row = QtWidgets.QHBoxLayout(self)
        row.setContentsMargins(_CARD_MARGIN, 3, 6, 4)
        row.addWidget(self._mark, alignment=Qt.AlignmentFlag.AlignTop)
        row.addLayout(text, stretch=1)
        self.setAutoFillBackground(True)

    def show_state(self, shown: Shown) -> None:
        """Show the selected reading, its mark, and what can be done."""
        self.sentence.show_state(shown)
        self.bounces.show_state(shown)
        kind = chosen_class(shown)
        if self._drawn == (kind, shown.look):
            return
        self._drawn = kind, shown.look
        misfit = kind in MISFITS
        for button in self.misfit_buttons:
            button.setVisible(misfit)
        colours, palette = shown.look.palette, self.palette()
        paper = colours.warning_paper if misfit else colours.window
        palette.setColor(QtGui.QPalette.ColorRole.Window, QtGui.QColor(paper))
        self.setPalette(palette)
        self._mark.setVisible(kind in MARKS)
        if kind is not None and kind in MARKS:
            self._mark.setPixmap(mark_picture(kind, colours, self.devicePixelRatioF()))
            self._mark.setToolTip(f"{MARKS[kind].name}: {MARKS[kind].meaning}")


def _card_button(action: QAction) -> QtWidgets.QToolButton:
    button = QtWidgets.QToolButton()
    button.setDefaultAction(action)
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # each has a key and a place in a menu
    return button


def _set_font(label: PlainLabel, font: QtGui.QFont, lines: int) -> None:
    label.setFont(font)
    label.setFixedHeight(_height_of(label, lines))


def _height_of(label: PlainLabel, lines: int) -> int:
    """Return the height of some lines of a label, pixels."""
    return lines * ceil(QtGui.QFontMetricsF(label.font()).lineSpacing()) + 2


def _fade(label: PlainLabel, outdated: bool) -> None:
    """Show a text in grey or in black. Qt sends a change of the palette even if the role is the same."""
    role = QtGui.QPalette.ColorRole.PlaceholderText if outdated else QtGui.QPalette.ColorRole.WindowText
    if label.foregroundRole() != role:
        label.setForegroundRole(role)


def shortened_to_lines(text: str, font: QtGui.QFont, width: float, lines: int) -> str:
    """Return the text that fits into `lines` lines of `width` pixels; a shortened text ends in …."""
    layout = QtGui.QTextLayout(text, font)
    layout.beginLayout()
    starts = []
    while (line := layout.createLine()).isValid():
        line.setLineWidth(max(width, 1.0))
        starts.append(line.textStart())
    layout.endLayout()
    if len(starts) <= lines:
        return text
    last = starts[lines - 1]
    metrics = QtGui.QFontMetricsF(font)
    return text[:last] + metrics.elidedText(text[last:], Qt.TextElideMode.ElideRight, width)


# The status bar: activity, recording file, number and rate of readings, lost readings, temperature, live or replay.


# badges have the same background in both palettes
_BADGE_COLOURS = {"live": LIGHT.live, "replay": LIGHT.replay}

_FEW = 360  # readings; so many are compared within a moment, as during a scan
_MESSAGE_TIME = 10_000  # ms


class StatusBar(QtWidgets.QStatusBar):
    """The line at the bottom of the window."""

    def __init__(self) -> None:
        super().__init__()
        self.setSizeGripEnabled(False)
        self.activity = ElidedLabel()
        self.activity.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.fake = PlainLabel()
        self.badge = PlainLabel()
        self.figures = PlainLabel()
        self.figures.setToolTip("Readings shown · readings per second · readings lost on the link · air temperature")
        # width of the longest text; otherwise an additional digit is cut off until the next layout
        widest = self.figures.fontMetrics().horizontalAdvance("00000 readings · 000.0 Hz · 0000 lost · -00.0 °C")
        self.figures.setMinimumWidth(widest)
        self.figures.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.progress = QtWidgets.QProgressBar()
        self.progress.setFixedWidth(self.progress.fontMetrics().horizontalAdvance("000 of at most 000 parts") + 16)
        self.progress.setFormat("%v of at most %m parts")
        self.progress.setToolTip("Parts of the model that are compiled; this prediction may not need all of them")
        self.setContentsMargins(8, 0, 4, 0)
        self.addWidget(self.progress)
        self.addWidget(LayoutBarrier(self.activity), 1)
        self.addPermanentWidget(self.fake)
        self.addPermanentWidget(LayoutBarrier(self.figures))
        self.addPermanentWidget(self.badge)
        self.show_state(Status())

    @Slot(str)
    def show_briefly(self, message: str) -> None:
        """Show a message for 10 s."""
        self.showMessage(message, _MESSAGE_TIME)

    def set_look(self, look: Look) -> None:
        """Set the text colour; with a style sheet, Qt would keep the colour of the previous palette."""
        ink = look.palette.ink
        self.setStyleSheet(f"QStatusBar::item {{ border: none; }} QLabel {{ color: {ink}; }}")

    def show_state(self, status: Status) -> None:
        """Show the status."""
        self.activity.setText(activity_text(status))
        preparing = status.prediction.preparing
        self.progress.setVisible(preparing is not None)
        if preparing is not None:
            compiled, kernels = preparing
            self.progress.setRange(0, kernels)
            self.progress.setValue(compiled)
        self.fake.setVisible(status.fake is not None)
        text, tip = status.fake or FAKE_NOTE
        self.fake.setText(text)
        self.fake.setToolTip(tip)
        self.figures.setText(figures_text(status))
        self.badge.setText(badge_text(status))
        background = _BADGE_COLOURS.get(status.badge, LIGHT.idle)
        style = f"color: white; background: {background}; border-radius: 4px; padding: 1px 8px; margin: 2px;"
        if self.badge.styleSheet() != style:  # setting a style sheet triggers a new layout of the window
            self.badge.setStyleSheet(style)


def badge_text(status: Status) -> str:
    """Return the text of the badge."""
    return f"● {status.badge}" if status.badge == "live" else status.badge


def figures_text(status: Status) -> str:
    """Return the numbers of readings, their rate, and the temperature."""
    rate = [f"{status.rate:.1f} Hz"] if status.rate else []  # no rate without new readings
    parts = [f"{status.readings} readings", *rate, f"{status.lost} lost"]
    if status.temperature_c is not None:
        parts.append(f"{status.temperature_c:.1f} °C")
    return " · ".join(parts)


def activity_text(status: Status) -> str:
    """Return the current activity."""
    parts, job, replay, prediction = [], status.job, status.replay, status.prediction
    if replay is not None:
        parts.append(f"{'following' if replay.following else 'replaying'} {replay.name}")
    elif job.phase is not None:
        parts.append("waiting for the scanner" if status.trouble else str(job.phase))
        if job.recording is not None:
            parts.append(f"{'recording to' if status.scanning else 'recorded in'} {_short(job.recording)}")
    if prediction.preparing:
        parts.append("preparing the model (first start only)")
    if status.scan_due:
        parts.append("the scan begins when its prediction is there")
    if prediction.outdated:
        parts.append("predicting … grey values belong to the previous prediction")
    elif prediction.searching and not prediction.preparing:
        parts.append("predicting …")
    if prediction.uncompared > _FEW:
        parts.append(f"{prediction.uncompared} readings to compare")
    return " · ".join(parts)


def _short(path: Path) -> str:
    """Return a path with the home folder as ~."""
    home = Path.home()
    return f"~/{path.relative_to(home).as_posix()}" if path.is_relative_to(home) else str(path)


# The toolbar: room, place and scanner, each a menu, then the most frequent commands.


_PLACE = 11  # characters of a place given as X,Y in metres, to the millimetre
_LONGEST = 24  # characters of a name
_ROOM_COMMANDS = "new_room", "open_room", "save_room", "close_room"
_SCANNER_COMMANDS = "connect_scanner", "connect_fake", "home"


class ToolBar(QtWidgets.QToolBar):
    """The room, the place and the scanner, and the most frequent commands."""

    def __init__(self, commands: Commands, shipped: QtWidgets.QMenu) -> None:
        """`shipped`: the menu of shipped rooms."""
        super().__init__("Main", movable=False)
        self.setObjectName("toolbar")
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.PreventContextMenu)
        self.place = QtWidgets.QComboBox()
        self.place.setToolTip("Place of the scanner in the room")
        self.place.setMinimumContentsLength(_PLACE)
        self.room = _menu_button("The room of the prediction", [commands.actions[name] for name in _ROOM_COMMANDS])
        self.room.menu().insertMenu(commands.save_room, shipped)
        self.scanner = _menu_button(
            "The scanner of the next scan", [commands.actions[name] for name in _SCANNER_COMMANDS]
        )
        self.addWidget(self.room)
        self.addWidget(self.place)
        self.addWidget(self.scanner)
        self.addSeparator()
        self.addActions([commands.scan, commands.stop])
        self.addSeparator()
        self.addAction(commands.open_log)
        self.addSeparator()
        self.addActions(commands.views)
        self.addSeparator()
        self.addAction(commands.fit)
        gap = QtWidgets.QWidget()
        gap.setSizePolicy(QtWidgets.QSizePolicy.Policy.Expanding, QtWidgets.QSizePolicy.Policy.Preferred)
        self.addWidget(gap)
        self.addAction(commands.switch_palette)
        begin = self.widgetForAction(commands.scan)
        style = f"background: {LIGHT.highlight}; color: white; border-radius: 4px; padding: 3px 14px"
        begin.setStyleSheet(f"QToolButton:enabled {{ {style} }}")

    def show_state(self, shown: Shown) -> None:
        """Name the room, and list its places."""
        room = shown.scene.room
        self.room.setText(shortened(room.name, _LONGEST) if room else "No room")
        names = [*room.places] if room else []
        here = shown.scene.pose.name
        if here and here not in names:
            names.append(here)  # a place given as X,Y
        if [self.place.itemText(k) for k in range(self.place.count())] != names:
            self.place.clear()
            self.place.addItems(names)
        self.place.setCurrentText(here)

    def show_scanner(self, url: str | None) -> None:
        """Name the scanner of the next scan; None: there is none."""
        name = "No scanner" if url is None else "Fake scanner" if is_fake(url) else url or "Scanner"
        self.scanner.setText(shortened(name, _LONGEST))
        self.scanner.setToolTip(f"The scanner of the next scan: {url or name}")


def _menu_button(tip: str, actions: Sequence[QAction]) -> QtWidgets.QToolButton:
    """Return a button of the toolbar that opens a menu."""
    button = QtWidgets.QToolButton()
    button.setPopupMode(QtWidgets.QToolButton.ToolButtonPopupMode.InstantPopup)
    button.setToolTip(tip)
    button.setAccessibleName(tip)
    menu = QtWidgets.QMenu(button)
    menu.addActions(actions)
    button.setMenu(menu)
    return button
