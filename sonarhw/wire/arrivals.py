"""Records which readings have arrived, which to request again with Resend, and which to measure again.

`ReadingArrivals` covers one StartScan. `Progress` covers a whole scan, which may take several StartScans.
"""

from bisect import bisect_right

from sonarhw.wire.limits import KEPT_READINGS


class ReadingArrivals:
    """Arrivals of the readings `first` to `total` − 1. Stores only the numbers of missing readings."""

    def __init__(self, total: int, first: int = 0, kept: int = KEPT_READINGS) -> None:
        self.total = total
        self.made = first  # the device has made all readings before this number
        self.lost = 0  # number of missing readings that the device no longer keeps
        self._first = first
        self._kept = kept
        self._missing: set[int] = set()
        self._requested: tuple[int, int] | None = None  # by the newest Resend
        self._requests = 0  # for the same readings, one after another

    def arrived(self, number: int) -> bool:
        """Record the arrival of a reading. Return False if it arrived before or has an invalid number."""
        if not self._first <= number < self.total:
            return False
        new = number >= self.made
        self.device_made(number + 1)
        if new or number in self._missing:
            self._missing.discard(number)
            return True
        return False

    def device_made(self, count: int) -> None:
        """Record that the device has made the readings before `count`, whether they arrived or not."""
        count = min(count, self.total)
        if count > self.made:
            oldest = max(self.made, count - self._kept)
            self.lost += oldest - self.made
            self._missing.update(range(oldest, count))
            self.made = count
        self._give_up({number for number in self._missing if number < self.made - self._kept})

    def next_resend(self) -> tuple[int, int] | None:
        """Return first number and count (1 to `kept`) of the next Resend, or None if no reading is missing."""
        if not self._missing:
            return None
        first = min(self._missing)
        # at most `kept` readings are missing; older ones are lost
        return first, max(self._missing) - first + 1

    def request(self, most: int) -> tuple[int, int] | None:
        """Return what `next_resend` returns, as a request. After `most` for the same readings, they are lost: None."""
        wanted = self.next_resend()
        self._requests = self._requests + 1 if wanted == self._requested else 1
        self._requested = wanted
        if self._requests > most:
            self.give_up()
            return None
        return wanted

    def give_up(self) -> None:
        """Count all missing readings as lost."""
        self._give_up(set(self._missing))

    def _give_up(self, numbers: set[int]) -> None:
        self.lost += len(numbers)
        self._missing -= numbers


class Progress:
    """Progress of a scan of `total` readings over one or more StartScans. Stores the stretches of missing numbers."""

    def __init__(self, total: int) -> None:
        self.total = total
        self.received = 0
        self._next = 0  # one more than the highest number that has arrived
        self._holes: list[range] = []  # missing numbers below _next, in order

    @property
    def complete(self) -> bool:
        """Whether every reading has arrived."""
        return self.received == self.total

    @property
    def missing(self) -> int:
        """Number of missing readings with lower numbers than the highest that has arrived."""
        return self._next - self.received

    def take(self, number: int) -> bool:
        """Record the arrival of a reading. Return False if it arrived before or has an invalid number."""
        if self._next <= number < self.total:
            if number > self._next:
                self._holes.append(range(self._next, number))
            self._next = number + 1
        elif not self._fill(number):
            return False
        self.received += 1
        return True

    def _fill(self, number: int) -> bool:
        at = bisect_right(self._holes, number, key=lambda hole: hole.start) - 1
        if at < 0 or number not in self._holes[at]:
            return False
        hole = self._holes[at]
        rest = range(hole.start, number), range(number + 1, hole.stop)
        self._holes[at : at + 1] = [part for part in rest if part]
        return True

    def next_missing(self) -> tuple[int, int] | None:
        """Return first number and count of the next consecutive missing readings, or None if all have arrived."""
        if not self._holes:
            return (self._next, self.total - self._next) if self._next < self.total else None
        return self._holes[0].start, len(self._holes[0])
