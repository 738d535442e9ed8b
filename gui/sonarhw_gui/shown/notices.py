"""The messages of the banner: the current state, such as a lost cable, and events waiting to be read."""

from collections import deque
from dataclasses import dataclass

_MOST = 20  # whoever has not read the first of them does not need the others


@dataclass(frozen=True)
class Notice:
    """A message, perhaps with something that can be done about it."""

    text: str
    offer: str = ""  # what a button beside it says
    answer: object = None  # what is handed on where somebody takes the offer
    refusal: str = ""  # what a second button says
    refused: object = None  # what is handed on there


NOTHING = Notice("")


class Notices:
    """Messages that wait to be read. What stands comes first and goes by itself."""

    def __init__(self) -> None:
        self._standing = ""
        self._put_away = False  # whether what stands has been read
        self._told: deque[Notice] = deque(maxlen=_MOST)

    @property
    def first(self) -> Notice:
        """What is to be read; `NOTHING` where there is nothing."""
        return next(iter(self._all()), NOTHING)

    @property
    def now(self) -> str:
        """Its text."""
        return self.first.text

    @property
    def behind(self) -> int:
        """How many more there are."""
        return max(0, len(self._all()) - 1)

    def tell(self, message: str | Notice) -> None:
        """Something has happened; told once however often it is said."""
        notice = Notice(message) if isinstance(message, str) else message
        if notice not in self._told:
            self._told.append(notice)

    def stand(self, message: str) -> None:
        """This is so from now on; empty: it no longer is. What was put away stays so until it is over."""
        self._put_away = self._put_away and bool(message)
        self._standing = message

    def put_away(self) -> None:
        """The one to be read has been."""
        if self._standing and not self._put_away:
            self._put_away = True
        elif self._told:
            self._told.popleft()

    def forget(self) -> None:
        """What has happened no longer matters; what stands does."""
        self._told.clear()

    def _all(self) -> list[Notice]:
        standing = [Notice(self._standing)] if self._standing and not self._put_away else []
        return [*standing, *self._told]
