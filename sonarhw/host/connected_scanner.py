"""The interface of a connected scanner for scans, commands and the window, whatever the protocol of its device."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from types import TracebackType
from typing import Protocol, Self

from sonarhw.errors import SonarError
from sonarhw.host.device_info import DeviceInfo, PingSettings
from sonarhw.host.recorder import Recorder
from sonarhw.host.session import Connection
from sonarhw.link.link_statistics import LinkStatistics
from sonarhw.readings import Reading, ScanOrder
from sonarhw.wire.codes import Outcome


class ConnectedScanner(Protocol):
    """What `Scanner` and `PluginScanner` have in common. `Scanner` describes each member."""

    url: str

    @property
    def takes_orders(self) -> bool:
        """Whether the angles of a scan can be chosen; else the device turns by itself."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
    @property
    def state(self) -> Connection:
        """State of the connection."""

    @property
    def loss(self) -> SonarError | None:
        """Reason of a loss, while the device is lost."""

    @property
    def info(self) -> DeviceInfo:
        """Identity of the device."""

    @property
    def settings(self) -> PingSettings | None:
        """Ping settings in force."""

    @property
    def baud(self) -> int | None:
        """Baud rate of the line."""

    @property
    def statistics(self) -> LinkStatistics:
        """Counters of the traffic."""

    @property
    def clock_drift(self) -> float:
        """By how much the host's clock runs faster than the device's."""

    @property
    def scan_began(self) -> float:
        """Start of the last scan, s."""

    @property
    def unverified_angles(self) -> str | None:
        """Clause with the angles of the last scan that could not be checked."""

    def record(self, recorder: Recorder | None) -> None:
        """Pass everything received to `recorder`."""

    def configure(self, listen: float, blanking: float, trace: bool, speed_of_sound: float | None) -> PingSettings:
        """Set the parameters of the next pings; return those in use."""

    def home(self, here: bool = False) -> Outcome:
        """Home the turntable, set its zero by hand, or wait for the start of a sweep; return how that ended."""

    def turn(self, angle: float) -> Outcome:
        """Turn to `angle`, rad; return how that ended."""

    def scan(self, order: ScanOrder | None = None) -> Iterator[Reading]:
        """Scan, and yield each reading."""

    def sequence(self) -> AbstractContextManager[None]:
        """Combine actions, so that a stop ends all of them."""

    def stop(self) -> None:
        """Stop the running action."""

    def close(self) -> None:
        """Close the link."""
