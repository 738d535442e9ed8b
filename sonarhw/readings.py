"""Readings, traces and scan orders: the values that all other parts of the project exchange."""

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]


class Origin(StrEnum):
    """The origin of readings; the value is the adjective in titles, legends, tables and JSON."""

    MEASURED = "measured"  # by a scanner
    FAKE = "fake"  # by the fake scanner or the emulated board, which simulate their echoes
    SIMULATED = "simulated"  # by `sonarhw simulate`
    IMPORTED = "imported"  # from a CSV file of another program, which does not state its source


class Trace:
    """The sampled receive signal of one ping (A-scan), its envelope or its carrier; 1.0 is the converter's full scale.

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
        """The samples, (n,) float, from 0 to 1 for an envelope and from −1 to 1 for a carrier."""
        return self._samples

    @property
    def rate(self) -> float:
        """Samples per second, Hz."""
        return self._rate

    @property
    def start(self) -> float:
        """Time from the start of transmission to the first sample, s."""
        return self._start

    @property
    def carrier(self) -> bool:
        """Whether the samples are the signal itself rather than its envelope."""
        return self._carrier

    @property
    def times(self) -> FloatArray:
        """Time of each sample since the start of transmission, (n,) float, s."""
        return self.start + np.arange(len(self.samples), dtype=np.float64) / self.rate


@dataclass(frozen=True)
class Reading:
    """The result of one ping."""

    number: int  # counts from 0 within its scan
    sweep: int
    ping: int  # counts from 0 at each heading
    angle: float  # turntable angle, rad
    time: float  # start of transmission, s on the device's clock, continued after a reset of the device
    echo_times: tuple[float, ...]  # s after the start of transmission, earliest first; empty: no echo
    speed_of_sound: float  # m/s
    temperature_c: float | None = None
    trace: Trace | None = None
    host_time: float | None = field(default=None, compare=False)  # `time` on the host's clock, s since the epoch
    origin: Origin | None = field(default=None, compare=False)  # None: the device has not identified itself

    @property
    def echo_ranges(self) -> tuple[float, ...]:
        """Range of each echo, m: speed of sound × time of flight / 2."""
        return tuple(self.speed_of_sound * time / 2 for time in self.echo_times)

    @property
    def range(self) -> float | None:
        """Range of the first echo, m; None if the board detected no echo."""
        return self.speed_of_sound * self.echo_times[0] / 2 if self.echo_times else None


@dataclass(frozen=True)
class ScanOrder:
    """The pings of a scan, at `headings` turntable angles from `start` in steps of `step`. Odd sweeps run backwards."""

    start: float  # rad
    step: float  # rad
    headings: int
    sweeps: int = 1
    pings: int = 1  # at each heading
    in_place: bool = False  # all pings at the present angle, without homing or turning; `start` is ignored

    @property
    def readings(self) -> int:
        """Number of readings of the whole scan."""
        return self.headings * self.sweeps * self.pings

    def angles(self) -> FloatArray:
        """Return the turntable angles of one sweep, (headings,) float, rad."""
        return self.start + self.step * np.arange(self.headings, dtype=np.float64)

    def ping_at(self, number: int) -> tuple[int, float, int]:
        """Return sweep, turntable angle (rad) and ping of reading `number`. Odd sweeps run backwards."""
        heading, ping = divmod(number, self.pings)
        sweep, index = divmod(heading, self.headings)
        if sweep % 2:
            index = self.headings - 1 - index
        return sweep, self.start + self.step * index, ping


def pings_in_place(count: int) -> ScanOrder:
    """Return the order of `count` pings, 1 to 65 535, at the present angle. Each is a sweep of one heading."""
    return ScanOrder(0.0, 1.0, headings=1, sweeps=count, in_place=True)


def headings_between(start: float, stop: float, step: float) -> int:
    """Return the number of angles `start`, `start + step`, … before `stop`, which is excluded; at least 1.

    0 to 360 by 5 is 72.

    Raises ValueError if the step is zero, not finite, or leads away from `stop`.
    """
    if not all(map(math.isfinite, (start, stop, step))) or step == 0 or not 0 < (stop - start) / step < math.inf:
        raise ValueError(f"there is no angle from {start:g} to below {stop:g} in steps of {step:g}")
    # rounding may make the quotient too large: without 1e-9, 0 to 360 by 0.1 could give 3601 headings instead of 3600
    return max(1, math.ceil((stop - start) / step - 1e-9))


def sector(start_deg: float = 0.0, stop_deg: float = 360.0, step_deg: float = 5.0, pings: int = 1) -> ScanOrder:
    """Return the order of one sweep from `start_deg` in steps of `step_deg`; `stop_deg` is excluded. All are degrees.

    0 to 360 by 5 is 72 headings. Angles of readings and of all other functions are in radians. Raises ValueError if
    there is no such heading.
    """
    headings = headings_between(start_deg, stop_deg, step_deg)
    return ScanOrder(math.radians(start_deg), math.radians(step_deg), headings, pings=pings)
