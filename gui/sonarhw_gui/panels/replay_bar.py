"""The replay bar: play, pause, step, previous and next scan, time slider, loop, skip gaps, speed, leave."""

import math
from dataclasses import replace

from PySide6.QtCore import Qt, Signal, Slot
from PySide6.QtGui import QAction, QIcon
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QPushButton, QToolButton

from sonarhw_gui.commands.command_list import Commands
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.theme import text_font
from sonarhw_gui.panels.time_slider import TimeSlider
from sonarhw_gui.parts.media_icons import (
    NEXT_SCAN,
    PAUSE,
    PLAY,
    PREVIOUS_SCAN,
    STEP_BACK,
    STEP_FORTH,
    Shape,
    media_icon,
)
from sonarhw_gui.parts.narrow_bar import GAP, NarrowBar
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.session.replay_control import SPEEDS, ReplayState


class ReplayBar(NarrowBar):
    """Controls the replay. Visible only while a log is shown."""

    toggled = Signal()
    sought = Signal(float)  # s
    speed_chosen = Signal(float)

    def __init__(self, commands: Commands) -> None:
        super().__init__()
        self._commands = commands
        self._look = Look()
        self._playing = False
        self._widest = ""  # longest text of the time
        self.badge = PlainLabel("REPLAY")
        self.badge.setToolTip("The readings come from a log; the scanner is not in use")
        self.play = QPushButton()
        self.play.setToolTip(commands.play.toolTip())
        self.slider = TimeSlider()
        self.time = PlainLabel()
        self.time.setToolTip("Time in the log · readings up to this time of all readings")
        self.speed = QComboBox()
        self.speed.setToolTip("Speed relative to the recording")
        for speed in SPEEDS:
            self.speed.addItem(speed_name(speed), speed)
        self._arrange()
        self.play.clicked.connect(self.toggled)
        self.slider.sought.connect(self.sought)
        self.speed.activated.connect(self._choose_speed)
        self.hide()

    def show_look(self, look: Look) -> None:
        """Use the colours and text size of `look`."""
        self._look = look
        self.slider.show_look(look)
        self.badge.setStyleSheet(
            f"color: white; background: {look.palette.replay}; border-radius: 4px; padding: 2px 8px; font-weight: bold;"
        )
        for action, shape in (
            (self._commands.previous_scan, PREVIOUS_SCAN),
            (self._commands.back, STEP_BACK),
            (self._commands.forward, STEP_FORTH),
            (self._commands.next_scan, NEXT_SCAN),
        ):
            action.setIcon(self._icon(shape))
        self.time.setFont(text_font(look))
        self._reserve_time()
        self._show_playing()
        self.hide_what_does_not_fit()

    def show_state(self, state: ReplayState | None) -> None:
        """Show the state of the replay; None hides the bar."""
        self.setVisible(state is not None)
        commands = self._commands
        for action in (commands.play, commands.back, commands.forward, commands.loop, commands.skip_gaps):
            action.setEnabled(state is not None)
        for action in (commands.previous_scan, commands.next_scan, commands.leave_replay):
            action.setEnabled(state is not None)
        if state is None:
            return
        if self._playing != state.playing:
            self._playing = state.playing
            self._show_playing()
        self.slider.show_state(state)
        self.time.setText(time_text(state))
        self._widest = time_text(replace(state, position=state.duration, count=state.total))
        self._reserve_time()
        self.speed.setCurrentIndex(SPEEDS.index(state.speed) if state.speed in SPEEDS else -1)
        commands.loop.setChecked(state.loop)
        commands.skip_gaps.setChecked(state.skip_gaps)

    def _reserve_time(self) -> None:
        # width of the longest text; otherwise the slider moves at every additional digit
        self.time.setMinimumWidth(self.time.fontMetrics().horizontalAdvance(self._widest))

    def _arrange(self) -> None:
        commands = self._commands
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 2, 12, 6)
        row.setSpacing(GAP)
        loop, gaps, leave = (
            _button(action, Qt.ToolButtonStyle.ToolButtonTextOnly)
            for action in (commands.loop, commands.skip_gaps, commands.leave_replay)
        )
        previous, following = (
            _button(action, Qt.ToolButtonStyle.ToolButtonIconOnly)
            for action in (commands.previous_scan, commands.next_scan)
        )
        # a narrow bar hides the first group, a narrower one the second too: menu and status bar have them
        self.dispensable = (loop, gaps, leave), (self.badge, previous, following)
        for part in (
            self.badge,
            previous,
            _button(commands.back, Qt.ToolButtonStyle.ToolButtonIconOnly, repeats=True),
            self.play,
            _button(commands.forward, Qt.ToolButtonStyle.ToolButtonIconOnly, repeats=True),
            following,
            self.slider,
            self.time,
            self.speed,
            loop,
            gaps,
            leave,
        ):
            row.addWidget(part, stretch=1 if part is self.slider else 0)

    @Slot(int)
    def _choose_speed(self, index: int) -> None:
        self.speed_chosen.emit(SPEEDS[index])

    def _show_playing(self) -> None:
        # width of the longer word; otherwise the widgets beside it move at every click
        self.play.setMinimumWidth(self.play.fontMetrics().horizontalAdvance("Pause") + 48)
        self.play.setIcon(self._icon(PAUSE if self._playing else PLAY))
        self.play.setText("Pause" if self._playing else "Play")

    def _icon(self, shape: Shape) -> QIcon:
        return media_icon(shape, self._look.palette.ink, self._look.palette.faint, self.devicePixelRatioF())


def _button(action: QAction, style: Qt.ToolButtonStyle, repeats: bool = False) -> QToolButton:
    button = QToolButton(toolButtonStyle=style)
    button.setDefaultAction(action)
    button.setAutoRepeat(repeats)  # repeats while held down
    return button


def time_text(state: ReplayState) -> str:
    """Return position and duration of a replay, and the number of readings so far and in total."""
    return f"{clock(state.position)} / {clock(state.duration)} · {state.count} of {state.total}"


def clock(seconds: float) -> str:
    """Return minutes, seconds and tenths as text."""
    tenths = math.floor(seconds * 10 + 1e-6)
    return f"{tenths // 600:02d}:{tenths // 10 % 60:02d}.{tenths % 10}"


def speed_name(speed: float) -> str:
    """Return the name of a speed in the list."""
    return "all at once" if math.isinf(speed) else f"{speed:g}×"
