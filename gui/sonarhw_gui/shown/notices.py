"""The messages of the banner: the current state, such as a lost cable, and events waiting to be read."""

from collections import deque
from dataclasses import dataclass

_MOST = 20  # whoever has not read the first of them does not need the others


@dataclass(frozen=True)
class Notice:
    """A message, perhaps with something that can be done about it."""

    text: str
    accept_text: str = ""  # what a button beside it says
    accept_value: object = None  # what is handed on where somebody takes the offer
    decline_text: str = ""  # what a second button says
    decline_value: object = None  # what is handed on there


NOTHING = Notice("")


class Notices:
    """Messages that wait to be read. What stands comes first and goes by itself."""

    def __init__(self) -> None:
        self._state = ""
        self._dismissed = False  # whether what stands has been read
        self._events: deque[Notice] = deque(maxlen=_MOST)

    @property
    def first(self) -> Notice:
        """What is to be read; `NOTHING` where there is nothing."""
        return next(iter(self._all()), NOTHING)

    @property
    def now(self) -> str:
        """Its text."""
        return self.first.text

    @property
    def more(self) -> int:
        """How many more there are."""
        return max(0, len(self._all()) - 1)

    def add(self, message: str | Notice) -> None:
        """Something has happened; told once however often it is said."""
        notice = Notice(message) if isinstance(message, str) else message
        if notice not in self._events:
            self._events.append(notice)

    def set_state(self, message: str) -> None:
        """This is so from now on; empty: it no longer is. What was put away stays so until it is over."""
        self._dismissed = self._dismissed and bool(message)
        self._state = message

    def dismiss(self) -> None:
        """The one to be read has been."""
        if self._state and not self._dismissed:
            self._dismissed = True
        elif self._events:
            self._events.popleft()

    def clear(self) -> None:
        """What has happened no longer matters; what stands does."""
        self._events.clear()

    def _all(self) -> list[Notice]:
        state = [Notice(self._state)] if self._state and not self._dismissed else []
        return [*state, *self._events]
