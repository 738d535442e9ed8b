"""The number of readings per second over the last few seconds."""

from collections import deque

_SPAN = 3.0  # s


class RateMeter:
    """Measures a rate over a sliding window of 3 s."""

    def __init__(self) -> None:
        self._counts: deque[tuple[float, int]] = deque()

    def add(self, count: int, now: float) -> None:
        """Count readings that have arrived at `now`, s."""
        if count:
            self._counts.append((now, count))

    def rate(self, now: float) -> float:
        """Return the readings per second; 0 before the second arrival."""
        while self._counts and self._counts[0][0] < now - _SPAN:
            self._counts.popleft()
        if len(self._counts) < 2:
            return 0.0
        # the window begins with the first arrival, whose readings were made before it
        arrived = sum(count for _, count in self._counts) - self._counts[0][1]
        return arrived / max(now - self._counts[0][0], 1e-3)
