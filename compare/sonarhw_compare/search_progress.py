"""Progress of a search whose number of steps is unknown."""

from collections.abc import Callable

_STEP = 0.01  # of what is left of a part


class SearchProgress:
    """The completed share of a search, 0..1, which never decreases.

    A search has parts that end at known shares. Each step of a part takes the same share of what is left of it.
    """

    def __init__(self, tick: Callable[[float], None] | None = None) -> None:
        """`tick` receives the share at each step; it can end the search by an exception."""
        self._tick, self._share, self._end = tick, 0.0, 0.0

    def begin(self, end: float) -> None:
        """Begin the part that ends at this share of the search, where the part before it ends."""
        self._share, self._end = self._end, end
        self.repeat()

    def step(self) -> None:
        """Report one more step."""
        self._share += _STEP * (self._end - self._share)
        self.repeat()

    def repeat(self) -> None:
        """Report the share again."""
        if self._tick is not None:
            self._tick(self._share)

    def inner(self, part: float) -> Callable[[float], None]:
        """Return the `tick` of a search that is a step of this one, and takes this part of what is left."""
        begin, width = self._share, part * (self._end - self._share)

        def tick(share: float) -> None:
            self._share = begin + width * share
            self.repeat()

        return tick
