"""An echo source for tests: one wall whose distance changes with the angle, and a trace with its peak there."""

import math

import numpy as np

from sonarhw.echo_source import Heard, Ping
from sonarhw.readings import Trace

RATE = 50_000.0


def echo_time(angle: float) -> float:
    """Time of flight of the first echo, s."""
    return 0.010 + 0.005 * math.cos(angle)


class PlainEchoes:
    """Two echoes at every heading."""

    def __init__(self, temperature_c: float | None = 21.3) -> None:
        self.temperature_c = temperature_c
        self.pings: list[Ping] = []

    def hear(self, ping: Ping) -> Heard:
        """One wall, heard twice."""
        self.pings.append(ping)
        first = echo_time(ping.angle)
        trace = Trace(np.linspace(0.0, 1.0, round(ping.listen * RATE)), RATE, 0.0) if ping.trace else None
        return Heard((first, 2 * first), trace)
