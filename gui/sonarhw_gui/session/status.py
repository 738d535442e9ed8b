"""The content of the status bar as frozen values: source, rate, lost readings, temperature."""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from sonarhw.errors import counted
from sonarhw.log import RecordedScan
from sonarhw.readings import ScanOrder, headings_between
from sonarhw.wire.messages import MOST_READINGS, microdegrees_of
from sonarhw.wire.readings_of_frames import MOST_DRIFT
from sonarhw_gui.session.notices import Compiled
from sonarhw_gui.session.scanner import LinkState, Phase, ScanSettings


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


# The number of readings per second over the last few seconds.


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


# The texts of the device panel: identity of the scanner, state of the link, size of a scan.


UNKNOWN = "–"


def order_of_sector(start: float, stop: float, step: float, sweeps: int, pings: int) -> ScanOrder:
    """Return the scan order of a sector in degrees, excluding `stop`, in either direction.

    Raises ValueError, with a message for the user, if the sector is empty or the protocol does not allow the scan.
    """
    if stop == start:
        raise ValueError("the sector is empty: “from” and “to” are equal")
    step = math.copysign(step, stop - start)
    order = ScanOrder(math.radians(start), math.radians(step), headings_between(start, stop, step), sweeps, pings)
    if microdegrees_of(order.step) == 0:
        raise ValueError("the step is too small for the protocol")
    if order.readings > MOST_READINGS:
        raise ValueError(f"{order.readings} readings: a scan can have {MOST_READINGS} at most")
    return order


def scan_summary(order: ScanOrder, link: LinkState | None) -> str:
    """Return the size of a scan, and its minimum duration if the device reports its ping period."""
    if link is not None and not link.takes_orders:
        return f"{counted(order.sweeps, 'sweep')}; the device turns by itself"
    device = link.device if link else None
    size = f"{order.headings} headings, {order.readings} readings"
    capabilities = device.capabilities if device else None
    if capabilities is None or not capabilities.ping_period:
        return size
    return f"{size}, {_duration(order.readings * capabilities.ping_period)} or more"


def state_text(status: Status) -> str:
    """Return the state of the scanner in a few words."""
    if not status.can_scan:
        return "No scanner chosen"
    if status.link is None:
        return "Connecting …" if status.scanning else "Not connected"
    if status.link.loss:
        return "Lost; searching"
    if status.source is Source.REPLAY or status.phase is None or not status.scanning:
        return "Connected"
    return f"{str(status.phase).capitalize()} …"


def identity_text(link: LinkState | None) -> str:
    """Return firmware, serial number, protocol and URL of the scanner."""
    if link is None:
        return UNKNOWN
    device = link.device
    if device.protocol == (0, 0):  # of a plug-in
        return f"{device.firmware}\nat {link.url}"
    major, minor = device.protocol
    return f"{device.firmware}, no. {device.serial}\nprotocol {major}.{minor}, at {link.url}"


def link_figures(link: LinkState | None) -> list[tuple[str, str, str]]:
    """Return the statistics of the link: name, value, and tooltip."""
    statistics = link.statistics if link else None

    def count(*names: str) -> str:
        return f"{sum(getattr(statistics, name) for name in names):,}".replace(",", " ") if statistics else UNKNOWN

    round_trip = statistics.round_trip if statistics else None
    return [
        ("Frames in · out", f"{count('frames_received')} · {count('frames_sent')}", "undamaged frames, each direction"),
        ("Lost", count("missing_frames"), "frames from the device that did not arrive: gaps in their numbers"),
        ("Corrupt", count("rejected_blocks", "rejected_messages"), "damaged frames and invalid messages, discarded"),
        ("Resent", count("resends", "repeated_commands"), "requested again by either side"),
        ("Measured again", count("lost_readings"), "lost readings that the device no longer had"),
        ("Times lost", count("losses"), "how often the connection was lost: unplugged, silent or reset"),
        (
            "Round trip",
            UNKNOWN if round_trip is None else f"{round_trip * 1e3:.1f} ms",
            "time from a command to its answer",
        ),
        ("Speed", f"{link.baud:,} baud".replace(",", " ") if link and link.baud else UNKNOWN, "– without a baud rate"),
        ("Clock drift", _drift(link), "host clock relative to the device clock; – at another pace"),
    ]


def _drift(link: LinkState | None) -> str:
    if link is None or abs(link.drift) >= MOST_DRIFT:
        return UNKNOWN
    return f"{link.drift * 1e6:+.0f} ppm"


def temperature_text(status: Status) -> str:
    """Return the air temperature at the board."""
    return UNKNOWN if status.temperature_c is None else f"{status.temperature_c:.1f} °C"


def angle_text(angle: float | None) -> str:
    """Return the last reported angle of the turntable."""
    return UNKNOWN if angle is None else f"{math.degrees(angle):.1f}°"


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
