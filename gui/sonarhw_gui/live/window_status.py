"""The content of the status bar as frozen values: source, rate, lost readings, temperature."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from sonarhw.log import RecordedScan
from sonarhw_gui.live.scanner_jobs import ScanSettings
from sonarhw_gui.live.scanner_state import LinkState, Phase


class Source(StrEnum):
    """Where the readings come from."""

    NONE = "no scan"
    LIVE = "live"
    REPLAY = "replay"


class Badge(StrEnum):
    """How it stands with what is shown, in the word of the badge."""

    NONE = "no scan"
    LIVE = "live"
    RECORDED = "recorded"
    AWAY = "away"
    LOST = "lost"
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
    outdated: bool = False  # whether the figures shown belong to the prediction before
    scan_settings: ScanSettings | None = None  # what the next scan does
    link: LinkState | None = None  # the connection to a scanner
    trouble: str = ""  # what is being done about a scanner that is away
    angle: float | None = None  # of the turntable, rad, as last told
    own_readings: bool = False  # whether those shown come from the connected scanner, in the room that is shown

    @property
    def badge(self) -> Badge:
        """What the badge says: live only while the scanner is there and at work."""
        if self.source is Source.REPLAY:
            return Badge.REPLAY
        if self.trouble:
            return Badge.AWAY
        if self.link is None:
            gone = Badge.LOST if self.phase is Phase.FAILED else Badge.AWAY
            return gone if self.readings else Badge.NONE
        if self.scanning:
            return Badge.LIVE
        return Badge.RECORDED if self.own_readings else Badge.NONE

    @property
    def scanning(self) -> bool:
        """Whether a scanner is at work."""
        return self.phase is not None and self.phase.busy

    @property
    def can_turn(self) -> bool:
        """Whether the turntable may be sent somewhere: there is a scanner, it is idle, and no log is looked at."""
        return self.can_scan and self.source is not Source.REPLAY and not self.scanning


def lost_in(scan: RecordedScan) -> int:
    """How many of the readings that a scan made its log does not have; where it does not say how many, the gaps."""
    numbers = {reading.number for reading in scan.readings}
    made = scan.finished.readings if scan.finished else max(numbers, default=-1) + 1
    return max(0, made - len(numbers))
