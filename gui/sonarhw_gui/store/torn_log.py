"""The report that a log is torn, which waits while another program may still write the log."""

import math
from pathlib import Path

from sonarhw_gui.store.file_watch import is_being_written

TORN_AFTER = 3.0  # s without growth, after which a log that was just written is reported as torn


class TornLog:
    """The message about a torn log until it is reported."""

    def __init__(self) -> None:
        self._message, self._due = "", math.inf

    def hold(self, message: str, path: Path | None, now: float) -> None:
        """Report the message soon, or as soon as the file has stopped to grow; None: the log is in no file."""
        wait = TORN_AFTER if path is not None and is_being_written(path) else 0.0
        self._message, self._due = message, now + wait

    def forget(self) -> None:
        """Report nothing: the log has grown, or another one is shown."""
        self._due = math.inf

    def report(self, now: float) -> list[str]:
        """Return the message if it is due, once."""
        if now < self._due:
            return []
        self.forget()
        return [self._message]
