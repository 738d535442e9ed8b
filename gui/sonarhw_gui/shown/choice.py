"""The selected reading: one that the user picked, or the newest."""


class Choice:
    """Selects the newest reading until the user picks one."""

    def __init__(self) -> None:
        self._picked: int | None = None

    def among(self, count: int, compared: int = 0) -> int | None:
        """Return the selected one of `count` readings; None if there are none.

        The newest reading is the newest of the first `compared`, if any, because it can be explained.
        """
        if count == 0:
            return None
        newest = min(compared, count) - 1 if compared else count - 1
        return newest if self._picked is None else min(self._picked, count - 1)

    def pick(self, index: int) -> None:
        """Select one reading."""
        self._picked = index

    def follow_newest(self) -> None:
        """Select the newest reading again."""
        self._picked = None

    def step(self, by: int, now: int | None, count: int) -> None:
        """Pick the reading `by` after `now` among `count`, wrapping around."""
        if now is not None:
            self._picked = (now + by) % count
