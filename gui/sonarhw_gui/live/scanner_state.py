"""The state of a live scanner as frozen values: its job, its identity and its link."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from sonarhw.host.scanner import DeviceInfo
from sonarhw.host.session import Connection
from sonarhw.link import LinkStatistics


class Phase(StrEnum):
    """The phase of a job."""

    CONNECTING = "connecting"
    READY = "connected"
    HOMING = "homing"
    TURNING = "turning"
    SCANNING = "scanning"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"

    @property
    def busy(self) -> bool:
        """Whether the job is running."""
        return self in (Phase.CONNECTING, Phase.HOMING, Phase.TURNING, Phase.SCANNING)


@dataclass(frozen=True)
class JobState:
    """The state of a job, without its readings."""

    phase: Phase = Phase.CONNECTING
    made: int = 0  # readings
    lost: int = 0  # readings
    temperature_c: float | None = None
    angle: float | None = None  # last reported angle of the turntable, rad
    recording: Path | None = None
    error: Exception | None = None

    @property
    def ended(self) -> bool:
        """Whether the job has ended."""
        return not self.phase.busy


@dataclass(frozen=True)
class LinkState:
    """The state of the connection to a scanner at one moment."""

    url: str
    device: DeviceInfo
    connection: Connection
    statistics: LinkStatistics
    baud: int | None  # None: the link has no baud rate
    drift: float  # how much faster the host clock runs than the device clock, as a ratio
    takes_orders: bool = True  # False: the device turns by itself
    loss: str = ""  # why the connection is lost; empty: it works


def trouble(link: LinkState | None, phase: Phase | None) -> str:
    """Return a message about a lost connection and the attempts to restore it; empty if it works."""
    if link is None or not link.loss:
        return ""
    greeted = link.connection in (Connection.GREETING, Connection.PREPARING)
    attempt = "Reconnecting to the scanner" if greeted else "The scanner is lost; searching for it"
    then = ". The scan then continues by itself" if phase is Phase.SCANNING else ""
    return f"{attempt}{then}. {link.loss}"
