"""The content of the status bar as frozen values: source, rate, lost readings, temperature."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from sonarhw.log import RecordedScan
from sonarhw_gui.live.scanner_jobs import ScanSettings
from sonarhw_gui.live.scanner_state import LinkState, Phase
from sonarhw_gui.shown.preparation import Compiled


class Source(StrEnum):
    """The source of the readings."""

    NONE = "no scan"
    LIVE = "live"
    REPLAY = "replay"


class Badge(StrEnum):
    """The text of the badge: the state of the readings."""

    NONE = "no scan"
    LIVE = "live"
    RECORDED = "recorded"
    EARLIER = "earlier scan"  # of another scanner, or in another room
    AWAY = "away"
    LOST = "lost"
    REPLAY = "replay"


@dataclass(frozen=True)
class Status:
    """The state of the scanner, the replay and the prediction."""

    source: Source = Source.NONE
    phase: Phase | None = None  # of a live scan
    can_scan: bool = False
    readings: int = 0
    rate: float = 0.0  # readings per second
    lost: int = 0  # readings
    temperature_c: float | None = None
    recording: Path | None = None
    log_name: str = ""  # of the replayed log
    following: bool = False  # whether the replayed log is being written
    predicting: bool = False
    preparing: Compiled | None = None  # progress of the compilation at the first start
    scan_due: bool = False  # whether a scan waits for the prediction
    uncompared: int = 0  # readings that are not compared with the newest prediction yet
    outdated: bool = False  # whether the values shown are of the previous prediction
    scan_settings: ScanSettings | None = None  # settings of the next scan
    link: LinkState | None = None  # the connection to a scanner
    trouble: str = ""  # message about a lost connection
    angle: float | None = None  # last reported angle of the turntable, rad
    fake: bool = False  # whether the readings come from a fake scanner
    fake_still: str = ""  # place or board of the fake scanner that makes them, if it is not the one shown
    own_readings: bool = False  # whether the readings come from the connected scanner, in the shown room

    @property
    def badge(self) -> Badge:
        """The badge: live only while a connected scanner works."""
        if self.source is Source.REPLAY:
            return Badge.REPLAY
        if self.trouble:
            return Badge.AWAY
        if self.link is None:
            gone = Badge.LOST if self.phase is Phase.FAILED else Badge.AWAY
            return gone if self.readings else Badge.NONE
        if self.scanning:
            return Badge.LIVE
        if self.readings:
            return Badge.RECORDED if self.own_readings else Badge.EARLIER
        return Badge.NONE

    @property
    def scanning(self) -> bool:
        """Whether a scanner works: connects, homes, turns or scans."""
        return self.phase is not None and self.phase.busy

    @property
    def can_turn(self) -> bool:
        """Whether the turntable may turn: a scanner was chosen and is idle, and no log is replayed."""
        return self.can_scan and self.source is not Source.REPLAY and not self.scanning


def lost_in(scan: RecordedScan) -> int:
    """Return the number of readings of a scan missing in its log; if its size is unknown, the number of gaps."""
    numbers = {reading.number for reading in scan.readings}
    made = scan.finished.readings if scan.finished else max(numbers, default=-1) + 1
    return max(0, made - len(numbers))
