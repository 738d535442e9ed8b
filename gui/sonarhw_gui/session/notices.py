"""The messages of the banner: the current state, such as a lost cable, and events that were not read yet."""

from collections import deque
from dataclasses import dataclass
from enum import Enum, auto

# The messages of the banner: the current state, such as a lost cable, and events that were not read yet.
#
# The current state comes first, then errors, then warnings and offers; of each kind the newest first.


_MOST = 20  # a user who has not read the first of them does not need more


class Until(Enum):
    """What ends a message."""

    CONNECTED = auto()  # a scanner is connected
    SEARCH_CHANGED = auto()  # the scans or the scene of a search for the room change


@dataclass(frozen=True)
class Notice:
    """A message, with up to two buttons."""

    text: str
    accept_text: str = ""  # of a first button; empty: no button
    accept_value: object = None  # sent when the first button is pressed
    decline_text: str = ""  # of a second button
    decline_value: object = None  # sent when the second button is pressed
    error: bool = False  # False: a warning or an offer
    until: Until | None = None  # what ends it; None: only the user, or a new scan


NOTHING = Notice("")


class Notices:
    """Messages that were not read yet, and which of them is shown. The state disappears when it ends."""

    def __init__(self) -> None:
        self._state = ""
        self._dismissed = False  # whether the current state was read
        self._events: deque[Notice] = deque(maxlen=_MOST)  # oldest first
        self._place = 0  # of the message shown, among all

    @property
    def shown(self) -> Notice:
        """The message that is shown; `NOTHING` if there is none."""
        waiting = self._all()
        return waiting[self._place % len(waiting)] if waiting else NOTHING

    @property
    def now(self) -> str:
        """The text of the message that is shown."""
        return self.shown.text

    @property
    def more(self) -> int:
        """The number of other messages."""
        return max(0, len(self._all()) - 1)

    def add(self, message: str | Notice) -> None:
        """Add an event and show the first message; an event that is already waiting becomes the newest."""
        notice = Notice(message) if isinstance(message, str) else message
        if notice in self._events:
            self._events.remove(notice)
        self._events.append(notice)
        self._place = 0

    def show_next(self) -> None:
        """Show the next message; after the last, the first."""
        self._place = (self._place + 1) % max(1, len(self._all()))

    def set_state(self, message: str) -> None:
        """Set the current state; empty: it has ended. A dismissed state stays dismissed until it ends."""
        self._dismissed = self._dismissed and bool(message)
        if message != self._state:
            self._place = 0
        self._state = message

    def dismiss(self) -> None:
        """Remove the message that is shown."""
        if self.shown in self._events:
            self._events.remove(self.shown)
        else:
            self._dismissed = bool(self._state)

    def end(self, until: Until) -> None:
        """Remove the messages that this ends."""
        for notice in [notice for notice in self._events if notice.until is until]:
            self._events.remove(notice)

    def clear(self) -> None:
        """Remove all events; the current state stays."""
        self._events.clear()

    def _all(self) -> list[Notice]:
        state = [Notice(self._state)] if self._state and not self._dismissed else []
        newest = list(reversed(self._events))
        return [*state, *(one for one in newest if one.error), *(one for one in newest if not one.error)]


# Progress of the compilation of kernels at the first start, for the status bar.


@dataclass(frozen=True)
class Compiled:
    """How many kernels are compiled; a prediction does not need all `known` ones."""

    done: int
    known: int


class Preparation:
    """Receives reports from the threads that compile. Implements `sonarhw_sim.compilation.Watcher`."""

    def __init__(self) -> None:
        self.progress: Compiled | None = None  # None while nothing is compiled
        self.messages: list[str] = []

    def compiling(self, done: int, known: int) -> None:
        """Note the progress."""
        self.progress = Compiled(done, known)

    def compiled(self) -> None:
        """Note that compilation has ended for now."""
        self.progress = None

    def not_stored(self, reason: str) -> None:
        """Note that the next start compiles again."""
        self.messages.append(reason)


# A short list of recently used names, newest first.


MOST = 10


def with_newest(names: tuple[str, ...], name: str) -> tuple[str, ...]:
    """Return the names with `name` in front, without duplicates."""
    return (name, *(other for other in names if other != name))[:MOST]
