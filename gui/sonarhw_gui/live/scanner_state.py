"""The state of a live scanner as frozen values: its job, its identity and its link."""

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from sonarhw.host.device_info import DeviceInfo
from sonarhw.host.session import Connection
from sonarhw.link.link_statistics import LinkStatistics


class Phase(StrEnum):
    """How far an job is."""

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
        """Whether more is to come of it."""
        return self in (Phase.CONNECTING, Phase.HOMING, Phase.TURNING, Phase.SCANNING)


@dataclass(frozen=True)
class JobState:
    """What is known of an job besides its readings."""

    phase: Phase = Phase.CONNECTING
    made: int = 0  # readings
    lost: int = 0  # readings
    temperature_c: float | None = None
    angle: float | None = None  # of the turntable, rad, as last told
    recording: Path | None = None
    error: Exception | None = None

    @property
    def ended(self) -> bool:
        """Whether nothing more will come."""
        return not self.phase.busy


@dataclass(frozen=True)
class LinkState:
    """The connection to a scanner, looked at once."""

    url: str
    device: DeviceInfo
    connection: Connection
    statistics: LinkStatistics
    baud: int | None  # None: the line has no speed of its own
    drift: float  # how much faster the host's clock runs than the device's
    loss: str = ""  # why the scanner is away; empty: it is there


def trouble(link: LinkState | None, phase: Phase | None) -> str:
    """What to tell of a scanner that is away, and what is being done about it; empty where all is well."""
    if link is None or not link.loss:
        return ""
    greeted = link.connection in (Connection.GREETING, Connection.PREPARING)
    told = "The scanner is asked whether it is back" if greeted else "The scanner is away and looked for"
    goes_on = ", and the scan goes on by itself" if phase is Phase.SCANNING else ""
    return f"{told}{goes_on}. {link.loss}"
