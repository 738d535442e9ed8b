"""Collects readings into whole sweeps. A lost reading may arrive after the next sweep has begun."""

from dataclasses import replace

from sonarhw.readings import Reading
from sonarhw.wire.limits import KEPT_READINGS


class OpenSweeps:
    """The sweeps that are not complete yet."""

    def __init__(self) -> None:
        self._sweeps: dict[int, list[Reading]] = {}  # without traces, by number

    def add(self, reading: Reading, of_each: int | None) -> list[list[Reading]]:
        """Add a reading, and return the readings of each sweep that is over now.

        `of_each` is the number of readings of a sweep. If it is None, a sweep is over when the device can no longer
        send a reading of it again.
        """
        self._sweeps.setdefault(reading.sweep, []).append(replace(reading, trace=None))
        over = [number for number in self._sweeps if self._is_over(number, reading, of_each)]
        return [self._sweeps.pop(number) for number in over]

    def end(self) -> list[list[Reading]]:
        """Return the readings of each sweep that has begun: no more will follow."""
        begun, self._sweeps = self._sweeps, {}
        return [begun[number] for number in sorted(begun)]

    def _is_over(self, number: int, newest: Reading, of_each: int | None) -> bool:
        readings = self._sweeps[number]
        if of_each is not None:  # readings of any sweep may be measured again until it is complete
            return len(readings) >= of_each
        return number < newest.sweep and newest.number - readings[-1].number >= KEPT_READINGS
