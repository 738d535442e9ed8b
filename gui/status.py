"""What the status bar says, as values: where readings come from, how fast, how many were lost, how warm it is.

Takes nothing; hands on frozen dataclasses that the session fills in.
"""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from gui.live_scan import Phase


class Source(StrEnum):
    """Where the readings come from."""

    NONE = "no scan"
    LIVE = "live"
    REPLAY = "replay"


@dataclass(frozen=True)
class Status:
    """How things stand."""

    source: Source = Source.NONE
    phase: Phase | None = None  # of a live scan
    can_scan: bool = False
    readings: int = 0
    rate: float = 0.0  # readings a second
    lost: int = 0  # readings
    temperature_c: float | None = None
    recording: Path | None = None
    log_name: str = ""  # of the log that is replayed
    predicting: bool = False

    @property
    def scanning(self) -> bool:
        """Whether a live scan runs."""
        return self.phase in (Phase.CONNECTING, Phase.HOMING, Phase.SCANNING)


def lost_in(expected: int | None, numbers: set[int]) -> int:
    """How many readings of a scan are missing: of those announced, or else below the highest number there is."""
    return max(expected or 0, max(numbers, default=-1) + 1) - len(numbers)
