"""The replay bar and the sound bar: play, pause, step, speed, and a slider of time."""

import math
from collections.abc import Callable

from PySide6 import QtWidgets
from PySide6.QtCore import QRect, QRectF, QSignalBlocker, Qt, Signal, Slot
from PySide6.QtGui import QAction, QIcon, QMouseEvent, QPainter, QPaintEvent

from sonarhw_gui import widgets
from sonarhw_gui.model.look import LengthUnit, Look
from sonarhw_gui.model.shown import SoundState
from sonarhw_gui.model.theme import text_font
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.session.sound import SLOWNESSES, SoundControl
from sonarhw_gui.session.source import SPEEDS, Replay
from sonarhw_gui.window.commands import Commands

# A slider over the time of a log, in whole milliseconds, with a mark at the start of each scan.


_STEPS_PER_SECOND = 1000
_MOST_STEPS = 2**31 - 1
_MARK = 3.0  # pixels
_MOST_MARKS = 400  # more marks would merge into a bar


class TimeSlider(QtWidgets.QSlider):
    """The position in the log."""

    sought = Signal(float)  # s

    def __init__(self) -> None:
        super().__init__(Qt.Orientation.Horizontal)
        self._look = Look()
        self._scans: tuple[float, ...] = ()
        self.setMinimumWidth(60)
        self.setToolTip("Position in the log; drag or click to move. Marks show where scans begin")
        self.valueChanged.connect(self._seek)

    def set_look(self, look: Look) -> None:
        """Use the colours of `look`."""
        self._look = look
        self.update()

    def show_state(self, state: Replay) -> None:
        """Show the state of the replay."""
        with QSignalBlocker(self):  # not a request to seek
            self.setMaximum(min(round(state.duration * _STEPS_PER_SECOND), _MOST_STEPS))
            self.setPageStep(max(1, self.maximum() // 20))
            self.setValue(round(state.position * _STEPS_PER_SECOND))
        if state.scan_starts != self._scans:
            self._scans = state.scan_starts
            self.update()

    @property
    def marks(self) -> list[float]:
        """The positions of the marks, pixels from the left."""
        return [self._pixel(begin) for begin in self._scans]

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Move the handle to the mouse; Qt's own slider would move by one page."""
        if event.button() is Qt.MouseButton.LeftButton and not self._handle().contains(event.position().toPoint()):
            left, span = self._groove()
            self.setValue(
                QtWidgets.QStyle.sliderValueFromPosition(
                    self.minimum(), self.maximum(), round(event.position().x() - left), round(span)
                )
            )
        super().mousePressEvent(event)  # a drag continues from there

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the marks below the slider."""
        if 1 < len(self._scans) <= _MOST_MARKS:
            with QPainter(self) as painter:
                for mark in self.marks:
                    painter.fillRect(QRectF(mark - _MARK / 2, 0, _MARK, self.height()), self._look.palette.predicted)
        super().paintEvent(event)

    def _seek(self, value: int) -> None:
        self.sought.emit(value / _STEPS_PER_SECOND)

    def _pixel(self, position: float) -> float:
        left, span = self._groove()
        return left + span * position * _STEPS_PER_SECOND / max(self.maximum(), 1)

    def _groove(self) -> tuple[float, float]:
        """Return the leftmost position of the handle's middle, and the distance that it can move, pixels."""
        handle = self._handle().width()
        return handle / 2, max(1.0, self.width() - handle)

    def _handle(self) -> QRect:
        option = QtWidgets.QStyleOptionSlider()
        self.initStyleOption(option)
        return self.style().subControlRect(
            QtWidgets.QStyle.ComplexControl.CC_Slider, option, QtWidgets.QStyle.SubControl.SC_SliderHandle, self
        )


# The replay bar: play, pause, step, previous and next scan, time slider, loop, skip gaps, speed, leave.


_ICON = Qt.ToolButtonStyle.ToolButtonIconOnly


class ReplayBar(widgets.NarrowBar):
    """Controls the replay. Visible only while a log is shown."""

    def __init__(self, commands: Commands, session: WindowSession) -> None:
        super().__init__()
        self._commands, self._session = commands, session
        self._look = Look()
        self._playing = False
        self._widest = ""  # longest text of the time
        self.badge = widgets.PlainLabel("REPLAY")
        self.badge.setToolTip("The readings come from a log; the scanner is not in use")
        self.play = QtWidgets.QPushButton()
        self.play.setToolTip(commands.toggle.toolTip())
        self.slider = TimeSlider()
        self.time = widgets.PlainLabel()
        self.time.setToolTip("Time in the log · readings up to this time of all readings")
        self.speed = QtWidgets.QComboBox()
        self.speed.setToolTip("Speed relative to the recording")
        for speed in SPEEDS:
            self.speed.addItem(speed_name(speed), speed)
        self._arrange()
        self.play.clicked.connect(commands.toggle.trigger)
        self.slider.sought.connect(self._seek)
        self.speed.activated.connect(self._choose_speed)
        session.replay_changed.connect(self.show_state)
        self.show_state(session.replay)

    def set_look(self, look: Look) -> None:
        """Use the colours and text size of `look`."""
        self._look = look
        self.slider.set_look(look)
        self.badge.setStyleSheet(
            f"color: white; background: {look.palette.replay}; border-radius: 4px; padding: 2px 8px; font-weight: bold;"
        )
        for action, shape in (
            (self._commands.previous_scan, widgets.PREVIOUS_SCAN),
            (self._commands.step_back, widgets.STEP_BACK),
            (self._commands.step_forward, widgets.STEP_FORTH),
            (self._commands.next_scan, widgets.NEXT_SCAN),
        ):
            action.setIcon(self._icon(shape))
        self.time.setFont(text_font(look))
        self._reserve_time()
        self._show_playing()
        self.hide_what_does_not_fit()

    @Slot(object)
    def show_state(self, state: Replay | None) -> None:
        """Show the state of the replay; None hides the bar."""
        self.setVisible(state is not None)
        if state is None:
            return
        if self._playing != state.playing:
            self._playing = state.playing
            self._show_playing()
        self.slider.show_state(state)
        self.time.setText(time_text(state))
        self._widest = _time_text(state.duration, state.duration, len(state.readings), len(state.readings))
        self._reserve_time()
        self.speed.setCurrentIndex(SPEEDS.index(state.speed) if state.speed in SPEEDS else -1)

    def _reserve_time(self) -> None:
        # width of the longest text; otherwise the slider moves at every additional digit
        self.time.setMinimumWidth(self.time.fontMetrics().horizontalAdvance(self._widest))

    def _arrange(self) -> None:
        commands = self._commands
        loop, gaps, leave = (
            _button(action, Qt.ToolButtonStyle.ToolButtonTextOnly)
            for action in (commands.set_loop, commands.set_skip_gaps, commands.leave_replay)
        )
        previous, following = (_button(action, _ICON) for action in (commands.previous_scan, commands.next_scan))
        back, forth = (_button(action, _ICON, repeats=True) for action in (commands.step_back, commands.step_forward))
        # a narrow bar hides the first group, a narrower one the second too: menu and status bar have them
        self.dispensable = (loop, gaps, leave), (self.badge, previous, following)
        steps = self.badge, previous, back, self.play, forth, following
        parts = (*steps, self.slider, self.time, self.speed, loop, gaps, leave)
        widgets.arranged(QtWidgets.QHBoxLayout(self), *parts, rest=self.slider, margins=(12, 2, 12, 6), gap=widgets.GAP)

    @Slot(float)
    def _seek(self, position: float) -> None:
        self._session.in_replay(lambda replay: replay.seek(position))

    @Slot(int)
    def _choose_speed(self, index: int) -> None:
        self._session.in_replay(lambda replay: setattr(replay, "speed", SPEEDS[index]))

    def _show_playing(self) -> None:
        # width of the longer word; otherwise the widgets beside it move at every click
        self.play.setMinimumWidth(self.play.fontMetrics().horizontalAdvance("Pause") + 48)
        self.play.setIcon(self._icon(widgets.PAUSE if self._playing else widgets.PLAY))
        self.play.setText("Pause" if self._playing else "Play")

    def _icon(self, shape: widgets.Shape) -> QIcon:
        return widgets.media_icon(shape, self._look.palette.ink, self._look.palette.faint, self.devicePixelRatioF())


def _button(action: QAction, style: Qt.ToolButtonStyle, repeats: bool = False) -> QtWidgets.QToolButton:
    button = QtWidgets.QToolButton(toolButtonStyle=style)
    button.setDefaultAction(action)
    button.setAutoRepeat(repeats)  # repeats while held down
    return button


def time_text(replay: Replay) -> str:
    """Return position and duration of a replay, and the number of readings so far and in total."""
    return _time_text(replay.position, replay.duration, replay.count, len(replay.readings))


def _time_text(position: float, duration: float, count: int, total: int) -> str:
    return f"{clock(position)} / {clock(duration)} · {count} of {total}"


def clock(seconds: float) -> str:
    """Return minutes, seconds and tenths as text."""
    tenths = math.floor(seconds * 10 + 1e-6)
    return f"{tenths // 600:02d}:{tenths // 10 % 60:02d}.{tenths % 10}"


def speed_name(speed: float) -> str:
    """Return the name of a speed in the list."""
    return "all at once" if math.isinf(speed) else f"{speed:g}×"


# The bar that plays sound: play, time in milliseconds, slow motion, all echoes, loop, film, close.


_PER_SECOND = 1_000_000  # steps of the slider, µs
_STEP, _PAGE = 20, 200  # µs


class SoundBar(widgets.NarrowBar):
    """Controls the playback of sound. Visible only while it is open."""

    def __init__(self, sound: SoundControl, save_film: Callable[[], None]) -> None:
        """`save_film`: asks where to save the sound as a film."""
        super().__init__()
        self._sound = sound
        self._look, self._unit = Look(), LengthUnit.M
        self._playing: bool | None = None
        self.caption, self.time = widgets.ElidedLabel(), widgets.PlainLabel()
        self.caption.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.play, self.film, self.close_button = (
            QtWidgets.QPushButton(),
            QtWidgets.QPushButton("Film…"),
            QtWidgets.QToolButton(autoRaise=True),
        )
        self.film.setToolTip("Save as GIF, MP4 or WebM")
        self.close_button.setText("×")
        self.close_button.setToolTip("Close this bar (S)")
        self.close_button.setAccessibleName("Close the sound bar")
        self.slider = QtWidgets.QSlider(Qt.Orientation.Horizontal)
        self.slider.setSingleStep(_STEP)
        self.slider.setPageStep(_PAGE)
        self.slider.setToolTip("Time since transmission; drag, or use the arrow keys")
        self.slider.setAccessibleName("Time since transmission")
        self.slowness = QtWidgets.QComboBox()
        self.slowness.setToolTip("Slow motion")
        self.slowness.setAccessibleName("Slow motion")
        for slowness in SLOWNESSES:
            self.slowness.addItem(f"1 ms in {slowness / 1000:g} s", slowness)
        self.every, self.loop = QtWidgets.QCheckBox("All echoes"), QtWidgets.QCheckBox("Loop")
        self.every.setToolTip("Also the sound of every later echo over the threshold")
        self._arrange()
        self._connect()
        self.film.clicked.connect(save_film)
        self.hide()

    def set_look(self, look: Look) -> None:
        """Use the colours and the unit of `look`."""
        self._look, self._unit, self._playing = look, look.unit, None
        self.hide_what_does_not_fit()

    @Slot(object)
    def show_state(self, state: SoundState | None) -> None:
        """Show the state of the playback; None hides the bar."""
        self.setVisible(state is not None)
        if state is None:
            return
        ping = state.ping
        for part in (self.play, self.slider, self.film):
            part.setEnabled(ping is not None)
        duration = 0.0 if ping is None else ping.duration
        with QSignalBlocker(self.slider):  # not a request to seek
            self.slider.setMaximum(round(duration * _PER_SECOND))
            self.slider.setValue(round(state.time * _PER_SECOND))
        self.time.setText(f"{state.time * 1e3:.2f} / {duration * 1e3:.2f} ms")
        self.time.setMinimumWidth(self.time.fontMetrics().horizontalAdvance("00.00 / 00.00 ms"))
        self.caption.setText(state.caption(self._unit))
        for box, value in ((self.loop, state.loop), (self.every, ping is not None and ping.every)):
            with QSignalBlocker(box):
                box.setChecked(value)
        self.slowness.setCurrentIndex(SLOWNESSES.index(state.slowness))
        if self._playing is not state.playing:
            self._playing = state.playing
            shape, text = (widgets.PAUSE, "Pause") if state.playing else (widgets.PLAY, "Play")
            self.play.setMinimumWidth(self.play.fontMetrics().horizontalAdvance("Pause") + 48)
            self.play.setIcon(
                widgets.media_icon(shape, self._look.palette.ink, self._look.palette.faint, self.devicePixelRatioF())
            )
            self.play.setText(text)

    def _arrange(self) -> None:
        # the menu has the film, and the caption the time
        self.dispensable = ((self.film, self.time),)
        parts = (self.play, self.slider, self.time, self.slowness, self.every, self.loop, self.film, self.close_button)
        row = widgets.arranged(QtWidgets.QHBoxLayout(), *parts, rest=self.slider, gap=widgets.GAP)
        widgets.arranged(QtWidgets.QVBoxLayout(self), self.caption, row, margins=(12, 2, 12, 4), gap=2)

    def _connect(self) -> None:
        self._sound.changed.connect(self.show_state)
        self.play.clicked.connect(self._sound.toggle)
        self.slider.valueChanged.connect(self._seek)
        self.slowness.activated.connect(self._choose_slowness)
        self.loop.toggled.connect(self._sound.set_loop)
        self.every.toggled.connect(self._sound.set_every)
        self.close_button.clicked.connect(self._sound.close)

    @Slot(int)
    def _seek(self, value: int) -> None:
        self._sound.seek(value / _PER_SECOND)

    @Slot(int)
    def _choose_slowness(self, index: int) -> None:
        self._sound.set_slowness(SLOWNESSES[index])
