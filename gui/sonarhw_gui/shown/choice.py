"""Which reading is chosen: one that a person picked, or the newest."""


class Choice:
    """Follows the newest reading until one is picked."""

    def __init__(self) -> None:
        self._picked: int | None = None

    def among(self, count: int, compared: int = 0) -> int | None:
        """The chosen one of `count` readings; None where there are none.

        The newest is the newest of the first `compared`, where there are such: there is more to say about it.
        """
        if count == 0:
            return None
        newest = min(compared, count) - 1 if compared else count - 1
        return newest if self._picked is None else min(self._picked, count - 1)

    def pick(self, index: int) -> None:
        """Stay with one reading."""
        self._picked = index

    def follow_newest(self) -> None:
        """Go with the newest one again."""
        self._picked = None

    def step(self, by: int, now: int | None, count: int) -> None:
        """Pick the one `by` further than `now` among `count`, round and round."""
        if now is not None:
            self._picked = (now + by) % count
