"""Readings and scans: the plain values that everything else hands round.

A reading is what one ping gave; a scan order says which pings to make. Nothing here knows bytes, files or physics.
"""

import math
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]


class Trace:
    """The sampled receive signal of one ping (A-scan): its envelope, 1.0 is the converter's full scale.

    A subclass may read or compute the samples on demand.
    """

    def __init__(self, samples: FloatArray, rate: float, start: float, carrier: bool = False) -> None:
        self._samples = samples
        self._rate = rate
        self._start = start
        self._carrier = carrier

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.samples!r}, {self.rate!r}, {self.start!r}, {self.carrier!r})"

    @property
    def samples(self) -> FloatArray:
        """The samples, (n,) float from 0 to 1; of a carrier from −1 to 1."""
        return self._samples

    @property
    def rate(self) -> float:
        """Samples per second, Hz."""
        return self._rate

    @property
    def start(self) -> float:
        """From the start of transmission to the first sample, s."""
        return self._start

    @property
    def carrier(self) -> bool:
        """Whether it is the signal itself rather than its envelope."""
        return self._carrier

    @property
    def times(self) -> FloatArray:
        """Time of every sample since the start of transmission, (n,) float, s."""
        return self.start + np.arange(len(self.samples), dtype=np.float64) / self.rate


@dataclass(frozen=True)
class Reading:
    """What one ping gave."""

    number: int  # counts from 0 within its scan
    sweep: int
    ping: int  # counts from 0 at each heading
    angle: float  # turntable angle, rad
    time: float  # s on the device's clock, start of transmission; goes on where the device was reset
    echo_times: tuple[float, ...]  # s after the start of transmission, earliest first; empty: no echo
    speed_of_sound: float  # m/s
    temperature_c: float | None = None
    trace: Trace | None = None
    host_time: float | None = field(default=None, compare=False)  # `time` on the host's clock, s since the epoch

    @property
    def echo_ranges(self) -> tuple[float, ...]:
        """Range of every echo, m: speed of sound × time of flight / 2."""
        return tuple(self.speed_of_sound * time / 2 for time in self.echo_times)

    @property
    def range(self) -> float | None:
        """Range of the first echo, m; None where the board heard nothing."""
        return self.speed_of_sound * self.echo_times[0] / 2 if self.echo_times else None


@dataclass(frozen=True)
class ScanOrder:
    """Which pings a scan makes: `headings` turntable angles from `start` in steps of `step`, to and fro."""

    start: float  # rad
    step: float  # rad
    headings: int
    sweeps: int = 1
    pings: int = 1  # at each heading

    @property
    def readings(self) -> int:
        """How many readings the whole scan has."""
        return self.headings * self.sweeps * self.pings

    def angles(self) -> FloatArray:
        """Turntable angles of one sweep, (headings,) float, rad."""
        return self.start + self.step * np.arange(self.headings, dtype=np.float64)

    def ping_at(self, number: int) -> tuple[int, float, int]:
        """Sweep, turntable angle (rad) and ping of reading `number`; odd sweeps run backwards."""
        place, ping = divmod(number, self.pings)
        sweep, index = divmod(place, self.headings)
        if sweep % 2:
            index = self.headings - 1 - index
        return sweep, self.start + self.step * index, ping


def headings_between(start: float, stop: float, step: float) -> int:
    """How many angles A, A+S, … lie below B (above it for a negative step); 0 to 360 by 5 are 72.

    Raises ValueError where the step is zero, not finite, or leads away from `stop`.
    """
    if not all(map(math.isfinite, (start, stop, step))) or step == 0 or not 0 < (stop - start) / step < math.inf:
        raise ValueError(f"no angle lies from {start:g} below {stop:g} in steps of {step:g}")
    # a hair less, so that 0 to 360 by 0.1 is 3600 and not 3601 where the division lands just above
    return math.ceil((stop - start) / step - 1e-9)


def sector(start_deg: float = 0.0, stop_deg: float = 360.0, step_deg: float = 5.0, pings: int = 1) -> ScanOrder:
    """One sweep over the angles A, A+S, … below B, in degrees as a person types them; 0 to 360 by 5 are 72.

    Raises ValueError where there is no such angle.
    """
    headings = headings_between(start_deg, stop_deg, step_deg)
    return ScanOrder(math.radians(start_deg), math.radians(step_deg), headings, pings=pings)
