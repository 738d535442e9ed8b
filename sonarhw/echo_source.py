"""The interface between a fake scanner and the acoustics of its surroundings.

An echo source computes the echo times and the trace of each ping. The one in `sonarhw_sim` simulates a room.
"""

from dataclasses import dataclass
from typing import Protocol

from sonarhw.readings import Trace


@dataclass(frozen=True)
class Ping:
    """One cycle of transmitting and listening."""

    angle: float  # turntable angle, rad
    sweep: int
    index: int  # number of the ping at this heading, from 0
    listen: float  # s; echoes later than this are not reported
    trace: bool  # whether the receive signal is needed as well


@dataclass(frozen=True)
class PingResult:
    """The echoes of one ping, and its trace."""

    echo_times: tuple[float, ...]  # s, earliest first
    trace: Trace | None = None


class EchoSource(Protocol):
    """The surroundings of a fake transducer."""

    @property
    def temperature_c(self) -> float | None:
        """Reading of the board's thermometer, °C; None if it has none."""

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of one ping. They depend only on the ping and a seed, not on the order of calls.

        Raises InputError if the surroundings are too large to compute; a fake board then reports a failed scan.
        """
