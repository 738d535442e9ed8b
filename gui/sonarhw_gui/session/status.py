"""The status of the session in four parts, job, link, replay and prediction, and the texts about the scanner."""

import math
from dataclasses import dataclass

from sonarhw.errors import InputError, counted
from sonarhw.readings import ScanOrder, check_order, headings_between
from sonarhw.wire.readings_of_frames import MOST_DRIFT
from sonarhw_gui.session.scanner import IDLE, JobState, LinkState, Phase, ScanSettings, trouble


@dataclass(frozen=True)
class ReplayState:
    """The log that is replayed."""

    name: str
    lost: int = 0  # readings
    temperature_c: float | None = None  # at the newest reading
    following: bool = False  # whether the log is being written


@dataclass(frozen=True)
class PredictionState:
    """The prediction for the scene that is shown."""

    searching: bool = False
    outdated: bool = False  # whether the values shown are of the previous prediction
    uncompared: int = 0  # readings that are not compared with the newest prediction yet
    # compiled and all kernels, at the first start; a prediction does not need all of them
    preparing: tuple[int, int] | None = None


@dataclass(frozen=True)
class Status:
    """The state of the scanner's job, its link, the replay and the prediction."""

    job: JobState = IDLE
    link: LinkState | None = None  # None: no connection to a scanner
    replay: ReplayState | None = None  # None: the readings of the scanner are shown
    prediction: PredictionState = PredictionState()
    chosen: bool = False  # whether a scanner was chosen
    settings: ScanSettings | None = None  # of the next scan
    scan_due: bool = False  # whether a scan waits for the prediction
    readings: int = 0
    rate: float = 0.0  # readings per second
    own_readings: bool = False  # whether the readings come from the connected scanner, in the shown room
    fake: tuple[str, str] | None = None  # text and tooltip on the fake scanner of the readings; None: it is another

    @property
    def badge(self) -> str:
        """The text of the badge, the state of the readings: live only while a connected scanner works.

        An earlier scan is of another scanner, or in another room.
        """
        if self.replay is not None:
            return "replay"
        if self.trouble:
            return "away"
        if self.link is None:
            gone = "lost" if self.job.phase is Phase.FAILED else "away"
            return gone if self.readings else "no scan"
        if self.scanning:
            return "live"
        if self.readings:
            return "recorded" if self.own_readings else "earlier scan"
        return "no scan"

    @property
    def trouble(self) -> str:
        """A message about a lost connection; empty if it works."""
        return trouble(self.link, self.job.phase)

    @property
    def scanning(self) -> bool:
        """Whether a scanner works: connects, homes, turns or scans."""
        return not self.job.ended

    @property
    def can_turn(self) -> bool:
        """Whether the turntable may turn: a scanner was chosen and is idle, and no log is replayed."""
        return self.can_scan and self.replay is None

    @property
    def can_scan(self) -> bool:
        """Whether a scanner was chosen and is idle."""
        return self.chosen and not self.scanning

    @property
    def lost(self) -> int:
        """Readings lost on the link, or missing in the log."""
        return self.job.lost if self.replay is None else self.replay.lost

    @property
    def temperature_c(self) -> float | None:
        """The air temperature at the board."""
        return self.job.temperature_c if self.replay is None else self.replay.temperature_c


# The texts of the device panel: identity of the scanner, state of the link, size of a scan.


UNKNOWN = "–"


def order_of_sector(start: float, stop: float, step: float, sweeps: int, pings: int) -> ScanOrder:
    """Return the scan order of a sector in degrees, excluding `stop`, in either direction.

    Raises InputError if the sector is empty or the protocol cannot state the order.
    """
    if stop == start:
        raise InputError("the sector is empty: “from” and “to” are equal")
    step = math.copysign(step, stop - start)
    order = ScanOrder(math.radians(start), math.radians(step), headings_between(start, stop, step), sweeps, pings)
    check_order(order)
    return order


def scan_summary(order: ScanOrder, link: LinkState | None, until_stopped: bool = False) -> str:
    """Return the size of a scan, and its minimum duration if the device reports its ping period."""
    if link is not None and not link.takes_orders:
        sweeps = "sweeps until Stop" if until_stopped else counted(order.sweeps, "sweep")
        return f"{sweeps}; the device turns by itself"
    if until_stopped:
        return f"sweeps of {order.headings} headings until Stop"
    device = link.device if link else None
    size = f"{order.headings} headings, {order.readings} readings"
    capabilities = device.capabilities if device else None
    if capabilities is None or not capabilities.ping_period:
        return size
    return f"{size}, {_duration(order.readings * capabilities.ping_period)} or more"


def state_text(status: Status) -> str:
    """Return the state of the scanner in a few words."""
    if not status.chosen:
        return "No scanner chosen"
    if status.link is None:
        return "Connecting …" if status.scanning else "Not connected"
    if status.link.loss:
        return "Lost; searching"
    if status.replay is not None or not status.scanning:
        return "Connected"
    return f"{str(status.job.phase).capitalize()} …"


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
