"""Which readings have come, which the device must be asked for again, and which it must make again.

`ReadingArrivals` is the book of one order to the device: it takes the numbers of readings that came and the counts that
heartbeats tell; hands on the next stretch to ask for. `Progress` is the book of a whole scan, which may take several
orders: it hands on the next stretch to be made.
"""

from sonarhw.wire.limits import KEPT_READINGS


class ReadingArrivals:
    """Books of readings `first` to `total` − 1; holds only what is missing."""

    def __init__(self, total: int, first: int = 0, kept: int = KEPT_READINGS) -> None:
        self.total = total
        self.made = first  # readings before this one are known to have been made
        self.lost = 0  # readings the device no longer has
        self._first = first
        self._kept = kept
        self._missing: set[int] = set()

    def arrived(self, number: int) -> bool:
        """Book a reading; False where it had come before or belongs to no such scan."""
        if not self._first <= number < self.total:
            return False
        new = number >= self.made
        self.device_made(number + 1)
        if new or number in self._missing:
            self._missing.discard(number)
            return True
        return False

    def device_made(self, count: int) -> None:
        """Book that the readings before `count` have been made, whether they came or not."""
        count = min(count, self.total)
        if count > self.made:
            oldest = max(self.made, count - self._kept)
            self.lost += oldest - self.made
            self._missing.update(range(oldest, count))
            self.made = count
        self._give_up({number for number in self._missing if number < self.made - self._kept})

    def wanted(self) -> tuple[int, int] | None:
        """First number and count (1 to `kept`) of the next stretch to ask for; None where nothing is missing."""
        if not self._missing:
            return None
        first = min(self._missing)
        last = max(number for number in self._missing if number < first + self._kept)
        return first, last - first + 1

    def give_up(self) -> None:
        """Count what is missing as lost: the device was asked often enough."""
        self._give_up(set(self._missing))

    def _give_up(self, numbers: set[int]) -> None:
        self.lost += len(numbers)
        self._missing -= numbers


class Progress:
    """How far a scan of `total` readings has come, over however many orders; holds only what is missing."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.received = 0
        self._next = 0  # no reading from here on has come
        self._holes: set[int] = set()  # before that

    @property
    def complete(self) -> bool:
        """Whether every reading has come."""
        return self.received == self.total

    @property
    def missing(self) -> int:
        """Readings left out so far: later ones have come."""
        return len(self._holes)

    def take(self, number: int) -> bool:
        """Book a reading; False where it has come before or belongs to no such scan."""
        if number in self._holes:
            self._holes.discard(number)
        elif self._next <= number < self.total:
            self._holes.update(range(self._next, number))
            self._next = number + 1
        else:
            return False
        self.received += 1
        return True

    def stretch(self) -> tuple[int, int] | None:
        """First number and count of the next readings to be made without a gap; None where all have come."""
        if not self._holes:
            return (self._next, self.total - self._next) if self._next < self.total else None
        first = end = min(self._holes)
        while end in self._holes:
            end += 1
        return first, end - first
