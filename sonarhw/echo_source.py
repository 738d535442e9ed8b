"""What a fake scanner hears through: heading in, echo times and trace out.

The instrument knows no physics, so whoever builds a fake hands it one of these; `sim` has the one that hears a room.
"""

from dataclasses import dataclass
from typing import Protocol

from sonarhw.readings import Trace


@dataclass(frozen=True)
class Ping:
    """One transmit and listen cycle as the board carries it out."""

    angle: float  # turntable angle, rad
    sweep: int
    index: int  # of the ping at this heading
    listen: float  # s; echoes later than this are not reported
    trace: bool  # whether the receive signal is wanted too


@dataclass(frozen=True)
class PingResult:
    """What one ping brought back."""

    echo_times: tuple[float, ...]  # s, earliest first
    trace: Trace | None = None


class EchoSource(Protocol):
    """The world in front of a fake transducer."""

    @property
    def temperature_c(self) -> float | None:
        """What the board's thermometer says; None where it has none."""

    def receive(self, ping: Ping) -> PingResult:
        """Answer one ping; depends on nothing but the ping (and a seed), not on the order of calls."""
