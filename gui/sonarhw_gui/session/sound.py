"""Plays the sound of the asked heading or selected reading in slow motion. The views draw `Shown.sound`."""

from dataclasses import replace

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.sound import PlayedPing

from sonarhw_gui.model.shown import Question, Shown, SoundState, is_same_question

SLOWNESSES = (500.0, 1000.0, 2000.0, 5000.0)  # seconds for each second of sound
_STEP = 1e-6  # s, of the slider
_HOLD = 1.0  # s between the end and the next round of a loop


class SoundControl(QObject):
    """The playback of one ping. Closed: state is None."""

    changed = Signal(object)  # SoundState or None

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.state: SoundState | None = None
        self._every = False
        self._question: Question | None = None
        self._held = 0.0  # s since the end

    @property
    def drawn(self) -> SoundState | None:
        """What the views draw; None while closed, and without a ping."""
        return self.state if self.state is not None and self.state.ping is not None else None

    @Slot(object)
    def follow(self, shown: Shown) -> None:
        """Play another heading from its begin if another one is asked or selected."""
        if self.state is None:
            return
        before, self._question = self._question, shown.question
        if not is_same_question(before, self._question):
            self._load()

    def open(self, shown: Shown) -> None:
        """Show the bar, and play."""
        if self.state is None:
            self.state, self._question = SoundState(None), shown.question
            self._load()

    @Slot()
    def close(self) -> None:
        """Hide the bar."""
        self.state, self._question = None, None
        self.changed.emit(None)

    @Slot()
    def toggle(self) -> None:
        """Play or pause; at the end, play again."""
        if self.state is not None:
            again = not self.state.playing and self._at_end(self.state)
            self._set(replace(self.state, playing=not self.state.playing, time=0.0 if again else self.state.time))

    @Slot(float)
    def seek(self, time: float) -> None:
        """Pause at a time, s of sound."""
        if self.state is not None:
            self._set(replace(self.state, time=time, playing=False))

    @Slot(float)
    def set_slowness(self, slowness: float) -> None:
        """Play with so many seconds for each second of sound."""
        if self.state is not None:
            self._set(replace(self.state, slowness=slowness))

    @Slot(bool)
    def set_loop(self, loop: bool) -> None:
        """Restart at the end, or stop there."""
        if self.state is not None:
            self._set(replace(self.state, loop=loop))

    @Slot(bool)
    def set_every(self, every: bool) -> None:
        """Show the sound of all echoes over the threshold, or only of the winner and of blanked ones."""
        self._every = every
        if self.state is not None and self.state.ping is not None:
            ping = replace(self.state.ping, every=every)
            self._set(replace(self.state, ping=ping, time=min(self.state.time, ping.duration)))

    def advance(self, elapsed: float) -> None:
        """Let `elapsed` s pass."""
        state = self.state
        if state is None or state.ping is None or not state.playing:
            return
        if not self._at_end(state):
            self._held = 0.0
            self._set(replace(state, time=min(state.time + elapsed / state.slowness, state.ping.duration)))
            return
        self._held += elapsed
        if not state.loop:
            self._set(replace(state, playing=False))
        elif self._held >= _HOLD:
            self._held = 0.0
            self._set(replace(state, time=0.0))

    @staticmethod
    def _at_end(state: SoundState) -> bool:
        return state.ping is not None and state.time >= state.ping.duration - _STEP

    def _load(self) -> None:
        assert self.state is not None
        question = self._question
        ping = None if question is None else PlayedPing(*question, every=self._every)
        self._held = 0.0
        self._set(replace(self.state, ping=ping, time=0.0, playing=True))

    def _set(self, state: SoundState) -> None:
        self.state = state
        self.changed.emit(state)
