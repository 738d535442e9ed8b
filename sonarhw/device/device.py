"""The interface that fake scanners and replayed logs share.

A device has no threads, ports or clock. The caller passes the time and the bytes, and receives bytes.
"""

from typing import Protocol


class Device(Protocol):
    """A device that answers as a scanner."""

    plug: int | None
    """Number of the socket at the host into which the cable is plugged, from 0; None while it is unplugged."""

    speedup: float
    """Ratio of device time to real time. The device allows the host to be silent for this many times its usual limit,
    because the host uses real time. Infinite: any silence is allowed."""

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans. An idle device only sends heartbeats."""

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host. `now` is in s on any monotonic clock."""

    def next_event(self) -> float | None:
        """Return the time when `advance` is next needed, s; None if nothing is due until bytes arrive."""

    def advance(self, now: float) -> bytes:
        """Do the work due by `now`, and return the bytes sent to the host since the last call."""

    def hang_up(self) -> None:
        """Handle a host that has disconnected: stop, end the conversation, wait for the next Hello."""
