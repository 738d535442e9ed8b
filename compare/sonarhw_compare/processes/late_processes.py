"""Processes for work of unknown size: they start when so much is done that more is likely."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any

from sonarhw_sim.compiled import core_count

from sonarhw_compare.processes.compute_processes import ComputeProcesses


class LateProcesses(AbstractContextManager["LateProcesses"]):
    """Processes that start once `least` units of work are done; they end at the end of the context."""

    def __init__(self, most: int, least: int) -> None:
        """At most `most` processes, and one for each core; none on one core."""
        self._count, self._least, self._done = min(most, core_count()), least, 0
        self._started: ComputeProcesses | None = None
        self._owner: object = None  # of what the processes keep

    def __exit__(self, *_: object) -> None:
        if self._started is not None:
            self._started.close()

    def for_work(self, units: int, owner: object, kept: Callable[[], Any]) -> ComputeProcesses | None:
        """Return the processes for so many more units of work; None if it is still too little.

        `kept` returns what the processes receive when the owner of the work is another one (`ComputeProcesses`).
        """
        if self._started is None and self._count > 1 and self._done >= self._least:
            self._started, self._owner = ComputeProcesses(self._count, kept()), owner
        self._done += units
        if self._started is not None and self._owner is not owner:
            self._started.keep(kept())
            self._owner = owner
        return self._started
