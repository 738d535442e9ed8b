"""The one list of messages for the user, and what else the window remembers of small events.

The current state, such as a lost cable, comes first, then errors, then warnings and offers; of each kind the newest
first.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_sim.compilation import Watcher

from sonarhw.errors import SonarError

_MOST = 20  # a user who has not read the first of them does not need more


# what ends a message: a scanner is connected, another room or log is opened, the scans or the scene of a search change,
# the readings are shown at a place that was chosen or found, the log grows
Until: TypeAlias = Literal["connected", "scene replaced", "search changed", "placed", "grown"]


class NoticeButton(NamedTuple):
    """A button of a notice."""

    text: str
    act: Callable[[Any], object]  # is called with `subject`; may raise SonarError
    subject: object


@dataclass(frozen=True)
class Notice:
    """A message, with up to two buttons."""

    text: str
    accept: NoticeButton | None = None
    decline: NoticeButton | None = None
    error: bool = False  # False: a warning or an offer
    until: Until | None = None  # what ends it; None: only the user, or a new scan


NOTHING = Notice("")


class Notices(QObject):
    """Messages that were not read yet, and which of them is shown. The state disappears when it ends."""

    changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._state = ""
        self._dismissed = False  # whether the current state was read
        self._events: deque[Notice] = deque(maxlen=_MOST)  # oldest first
        self._place = 0  # of the message shown, among all

    @property
    def all(self) -> list[Notice]:
        """All messages, in their order."""
        state = [Notice(self._state)] if self._state and not self._dismissed else []
        newest = list(reversed(self._events))
        errors, others = ([notice for notice in newest if notice.error is kind] for kind in (True, False))
        return [*state, *errors, *others]

    @property
    def shown(self) -> Notice:
        """The message that is shown; `NOTHING` if there is none."""
        waiting = self.all
        return waiting[self._place % len(waiting)] if waiting else NOTHING

    @property
    def more(self) -> int:
        """The number of other messages."""
        return max(0, len(self.all) - 1)

    def warn(self, message: str) -> None:
        """Add a warning."""
        self.add(Notice(message))

    @Slot(str)
    def fail(self, message: str, until: Until | None = None) -> None:
        """Add an error."""
        self.add(Notice(message, error=True, until=until))

    def add(self, notice: Notice) -> None:
        """Add an event and show the first message; an event that is already waiting becomes the newest."""
        if notice in self._events:
            self._events.remove(notice)
        self._events.append(notice)
        self._place = 0
        self.changed.emit()

    def set_state(self, message: str) -> None:
        """Set the current state; empty: it has ended. A dismissed state stays dismissed until it ends."""
        if message != self._state:
            self._dismissed = self._dismissed and bool(message)
            self._state, self._place = message, 0
            self.changed.emit()

    def end(self, until: Until) -> None:
        """Remove the messages that this ends."""
        self._keep(lambda notice: notice.until != until)

    def clear(self) -> None:
        """Remove all events; the current state stays."""
        self._keep(lambda _: False)

    def _keep(self, kept: Callable[[Notice], bool]) -> None:
        before, self._events = self._events, deque(filter(kept, self._events), maxlen=_MOST)
        if len(self._events) < len(before):
            self.changed.emit()

    # the buttons of the banner

    @Slot()
    def show_next(self) -> None:
        """Show the next message; after the last, the first."""
        self._place = (self._place + 1) % max(1, len(self.all))
        self.changed.emit()

    @Slot()
    def dismiss(self) -> None:
        """Remove the message that is shown."""
        if self.shown in self._events:
            self._events.remove(self.shown)
        else:
            self._dismissed = bool(self._state)
        self.changed.emit()

    @Slot()
    def accept(self) -> None:
        """Carry out the first offer of the message that is shown."""
        self._carry_out(self.shown.accept)

    @Slot()
    def decline(self) -> None:
        """Carry out the second offer of the message that is shown."""
        self._carry_out(self.shown.decline)

    def _carry_out(self, offer: NoticeButton | None) -> None:
        self.dismiss()
        if offer is not None:
            try:
                offer.act(offer.subject)
            except SonarError as error:
                self.fail(str(error))


class Preparation(Watcher):
    """Progress of the compilation at the first start, which reports from its threads."""

    def __init__(self) -> None:
        self.progress: tuple[int, int] | None = None  # compiled and all kernels; None while nothing is compiled
        self._doubt = ""

    def compiling(self, done: int, kernels: int) -> None:
        """Note the progress."""
        self.progress = done, kernels

    def compiled(self) -> None:
        """Note that compilation has ended for now."""
        self.progress = None

    def not_stored(self, reason: str) -> None:
        """Note that the next start compiles again."""
        self._doubt = reason

    def take_doubt(self) -> str:
        """Return once why the next start compiles again; else empty."""
        doubt, self._doubt = self._doubt, ""
        return doubt
