"""The board's side of the line, seen from the line: what a fake scanner and a replayed log have in common.

A device is a machine without threads, ports or clock: it is told the time, takes bytes and gives bytes.
"""

from typing import Protocol


class Device(Protocol):
    """Something that answers as a scanner."""

    plug: int | None
    """Which socket of the host its cable is in, counted from 0; None while it is in none."""

    hurry: float
    """How many times faster than real its time passes: a host, which lives in real time, may be silent for so much
    longer; infinite: for ever."""

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans; an idle device has only heartbeats to send."""

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes from the host; `now` in s on any clock that does not run backwards."""

    def next_event(self) -> float | None:
        """When `advance` next has something to do, s; None: only after bytes from the host."""

    def advance(self, now: float) -> bytes:
        """Do what is due by `now`; the bytes that have left for the host since the last call."""

    def hang_up(self) -> None:
        """The host has gone: stop, forget the conversation, wait for the next Hello."""
