"""The bar that plays sound: play, time in milliseconds, slow motion, all echoes, loop, film, close."""

from PySide6.QtCore import QSignalBlocker, Qt, Signal, Slot
from PySide6.QtWidgets import QCheckBox, QComboBox, QHBoxLayout, QPushButton, QSlider, QToolButton, QVBoxLayout

from sonarhw_gui.look.appearance import LengthUnit, Look
from sonarhw_gui.parts.elided import ElidedLabel
from sonarhw_gui.parts.media_icons import PAUSE, PLAY, media_icon
from sonarhw_gui.parts.narrow_bar import GAP, NarrowBar
from sonarhw_gui.parts.plain_label import PlainLabel
from sonarhw_gui.sound.sound_control import SLOWNESSES, SoundState

_PER_SECOND = 1_000_000  # steps of the slider, µs
_STEP, _PAGE = 20, 200  # µs


class SoundBar(NarrowBar):
    """Controls the playback of sound. Visible only while it is open."""

    toggled = Signal()
    sought = Signal(float)  # s
    slowness_chosen = Signal(float)
    loop_changed = Signal(bool)
    every_changed = Signal(bool)
    film_requested = Signal()
    closed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._look, self._unit = Look(), LengthUnit.M
        self._playing: bool | None = None
        self.caption, self.time = ElidedLabel(), PlainLabel()
        self.caption.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        self.play, self.film, self.close_button = QPushButton(), QPushButton("Film…"), QToolButton(autoRaise=True)
        self.film.setToolTip("Save as GIF, MP4 or WebM")
        self.close_button.setText("×")
        self.close_button.setToolTip("Close this bar (S)")
        self.close_button.setAccessibleName("Close the sound bar")
        self.slider = QSlider(Qt.Orientation.Horizontal)
        self.slider.setSingleStep(_STEP)
        self.slider.setPageStep(_PAGE)
        self.slider.setToolTip("Time since transmission; drag, or use the arrow keys")
        self.slider.setAccessibleName("Time since transmission")
        self.slowness = QComboBox()
        self.slowness.setToolTip("Slow motion")
        self.slowness.setAccessibleName("Slow motion")
        for slowness in SLOWNESSES:
            self.slowness.addItem(f"1 ms in {slowness / 1000:g} s", slowness)
        self.every, self.loop = QCheckBox("All echoes"), QCheckBox("Loop")
        self.every.setToolTip("Also the sound of every later echo over the threshold")
        self._arrange()
        self._connect()
        self.hide()

    def show_look(self, look: Look) -> None:
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
            shape, text = (PAUSE, "Pause") if state.playing else (PLAY, "Play")
            self.play.setMinimumWidth(self.play.fontMetrics().horizontalAdvance("Pause") + 48)
            self.play.setIcon(
                media_icon(shape, self._look.palette.ink, self._look.palette.faint, self.devicePixelRatioF())
            )
            self.play.setText(text)

    def _arrange(self) -> None:
        row = QHBoxLayout()
        row.setSpacing(GAP)
        # the menu has the film, and the caption the time
        self.dispensable = ((self.film, self.time),)
        parts = (self.play, self.slider, self.time, self.slowness, self.every, self.loop, self.film, self.close_button)
        for part in parts:
            row.addWidget(part, stretch=1 if part is self.slider else 0)
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 2, 12, 4)
        column.setSpacing(2)
        column.addWidget(self.caption)
        column.addLayout(row)

    def _connect(self) -> None:
        self.play.clicked.connect(self.toggled)
        self.slider.valueChanged.connect(self._seek)
        self.slowness.activated.connect(self._choose_slowness)
        self.loop.toggled.connect(self.loop_changed)
        self.every.toggled.connect(self.every_changed)
        self.film.clicked.connect(self.film_requested)
        self.close_button.clicked.connect(self.closed)

    @Slot(int)
    def _seek(self, value: int) -> None:
        self.sought.emit(value / _PER_SECOND)

    @Slot(int)
    def _choose_slowness(self, index: int) -> None:
        self.slowness_chosen.emit(SLOWNESSES[index])
