"""Which readings of a scan have come, and which the device must be asked for again.

Takes the numbers of readings that came and the counts that heartbeats tell; hands on the next stretch to ask for.
"""

KEPT = 64  # readings that a device holds ready to be sent again


class Arrivals:
    """Books of one scan of `total` readings; holds only what is missing."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.made = 0  # readings known to have been made
        self.lost = 0  # readings the device no longer has
        self._missing: set[int] = set()

    def arrived(self, number: int) -> bool:
        """Book a reading; False where it had come before or belongs to no such scan."""
        if not 0 <= number < self.total:
            return False
        new = number >= self.made
        self.device_made(number + 1)
        if new or number in self._missing:
            self._missing.discard(number)
            return True
        return False

    def device_made(self, count: int) -> None:
        """Book that readings 0 to `count` − 1 have been made, whether they came or not."""
        count = min(count, self.total)
        if count > self.made:
            oldest = max(self.made, count - KEPT)
            self.lost += oldest - self.made
            self._missing.update(range(oldest, count))
            self.made = count
        self._give_up({number for number in self._missing if number < self.made - KEPT})

    def wanted(self) -> tuple[int, int] | None:
        """First number and count (1 to KEPT) of the next stretch to ask for; None where nothing is missing."""
        if not self._missing:
            return None
        first = min(self._missing)
        last = max(number for number in self._missing if number < first + KEPT)
        return first, last - first + 1

    def give_up(self) -> None:
        """Count what is missing as lost: the device was asked often enough."""
        self._give_up(set(self._missing))

    def _give_up(self, numbers: set[int]) -> None:
        self.lost += len(numbers)
        self._missing -= numbers
