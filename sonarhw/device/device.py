"""The interface that fake scanners and replayed logs share.

A device has no threads, ports or clock: the caller passes the time and the bytes, and gets bytes back.
"""

from typing import Protocol


class Device(Protocol):
    """A device that answers as a scanner."""

    plug: int | None
    """Number of the host's socket that its cable is in, from 0; None while it is unplugged."""

    speedup: float
    """By how much its time passes faster than real time. The host uses real time, so its silence may be that much
    longer in the device's time. If infinite, any silence is allowed."""

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans. An idle device only sends heartbeats."""

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host. `now` is in s on any monotonic clock."""

    def next_event(self) -> float | None:
        """Return the time when `advance` is next needed, s. None if only after bytes from the host."""

    def advance(self, now: float) -> bytes:
        """Do the work due by `now`, and return the bytes sent to the host since the last call."""

    def hang_up(self) -> None:
        """Handle the departure of the host: stop, drop the conversation, wait for the next Hello."""
