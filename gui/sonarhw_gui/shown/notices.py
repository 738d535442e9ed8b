"""The messages of the banner: the current state, such as a lost cable, and events that were not read yet."""

from collections import deque
from dataclasses import dataclass

_MOST = 20  # a user who has not read the first of them does not need more


@dataclass(frozen=True)
class Notice:
    """A message, with up to two buttons."""

    text: str
    accept_text: str = ""  # of a first button; empty: no button
    accept_value: object = None  # sent when the first button is pressed
    decline_text: str = ""  # of a second button
    decline_value: object = None  # sent when the second button is pressed


NOTHING = Notice("")


class Notices:
    """Messages that were not read yet. The current state comes first, and disappears when it ends."""

    def __init__(self) -> None:
        self._state = ""
        self._dismissed = False  # whether the current state was read
        self._events: deque[Notice] = deque(maxlen=_MOST)

    @property
    def first(self) -> Notice:
        """The first message; `NOTHING` if there is none."""
        return next(iter(self._all()), NOTHING)

    @property
    def now(self) -> str:
        """The text of the first message."""
        return self.first.text

    @property
    def more(self) -> int:
        """The number of messages after the first."""
        return max(0, len(self._all()) - 1)

    def add(self, message: str | Notice) -> None:
        """Add an event; one that is already waiting is not repeated."""
        notice = Notice(message) if isinstance(message, str) else message
        if notice not in self._events:
            self._events.append(notice)

    def set_state(self, message: str) -> None:
        """Set the current state; empty: it has ended. A dismissed state stays dismissed until it ends."""
        self._dismissed = self._dismissed and bool(message)
        self._state = message

    def dismiss(self) -> None:
        """Remove the first message."""
        if self._state and not self._dismissed:
            self._dismissed = True
        elif self._events:
            self._events.popleft()

    def clear(self) -> None:
        """Remove all events; the current state stays."""
        self._events.clear()

    def _all(self) -> list[Notice]:
        state = [Notice(self._state)] if self._state and not self._dismissed else []
        return [*state, *self._events]
