"""Readings, traces and scan orders: the values that all other parts of the project exchange."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from enum import StrEnum
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sonarhw import arguments
from sonarhw.errors import InputError, MissingExtra
from sonarhw.wire.limits import MOST_HEADINGS, MOST_READINGS, MOST_SWEEPS

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
# of a robot or of the turntable's zero: x and y, m, and the heading, rad, counter-clockwise from x, as seen from above
RobotPose: TypeAlias = tuple[float, float, float]
_STILL, _STILL_TURN = 0.001, math.radians(0.1)  # m and rad; a robot that moves less stands still


def angle_difference(angles: FloatArray, reference: FloatArray | float) -> FloatArray:
    """Return `angles` minus `reference`, rad, each in [-π, π). Use `math.remainder` for single angles."""
    return np.asarray(np.remainder(angles - reference + math.pi, math.tau) - math.pi)


def moved_by(pose: RobotPose, step: RobotPose) -> RobotPose:
    """Return the pose after a step: ahead and to the left of `pose` (m), and the turn to the left (rad)."""
    (x, y, heading), (ahead, left, turn) = pose, step
    cosine, sine = math.cos(heading), math.sin(heading)
    return x + cosine * ahead - sine * left, y + sine * ahead + cosine * left, heading + turn


def step_between(before: RobotPose, after: RobotPose) -> RobotPose:
    """Return the step from one pose to another, as odometry states it; its turn is in [-π, π]."""
    dx, dy = after[0] - before[0], after[1] - before[1]
    cosine, sine = math.cos(before[2]), math.sin(before[2])
    turn = math.remainder(after[2] - before[2], math.tau)
    return cosine * dx + sine * dy, cosine * dy - sine * dx, turn


def same_values(one: object, other: object) -> bool:
    """Return whether two values are equal: arrays and dataclasses of arrays by their elements, and NaN equals NaN."""
    if one is other:
        return True
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same_values, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(same_values(value, other[key]) for key, value in one.items())
    if is_dataclass(one):
        compared = (part.name for part in fields(one) if part.compare)
        return all(same_values(getattr(one, name), getattr(other, name)) for name in compared)
    return bool(one == other)


class Origin(StrEnum):
    """The origin of readings; the value is the adjective in titles, legends, tables and JSON."""

    MEASURED = "measured"  # by a scanner
    FAKE = "fake"  # by the fake scanner or the emulated board, which simulate their echoes
    SIMULATED = "simulated"  # by `sonarhw simulate`
    IMPORTED = "imported"  # from a CSV file of another program, which does not state its source


# the origin follows from the writer of a log and the identity of its device, so old logs have one too
FAKE_FIRMWARE = "sonarhw-fake"  # first word in the firmware of a fake scanner
EMULATED_SERIAL = "EMULATED"  # serial number of the emulated board
_WRITER = "sonarhw {}"  # start of the firmware in a log that a command wrote without a scanner
_BY_WRITER = {"simulate": Origin.SIMULATED, "import": Origin.IMPORTED}


def origin_of(made_by: str, firmware: str, serial: str) -> Origin:
    """Return the origin of the readings in a log, from its writer and the identity of its device."""
    for writer, origin in _BY_WRITER.items():
        if made_by == writer or firmware.startswith(_WRITER.format(writer)):
            return origin
    if firmware.startswith(FAKE_FIRMWARE) or serial == EMULATED_SERIAL:
        return Origin.FAKE
    return Origin.MEASURED


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
    pose: RobotPose | None = None  # at this ping; None: the sensor does not move, or its poses are unknown

    @property
    def echo_ranges(self) -> tuple[float, ...]:
        """Range of each echo, m: speed of sound × time of flight / 2."""
        return tuple(self.speed_of_sound * time / 2 for time in self.echo_times)

    @property
    def range(self) -> float | None:
        """Range of the first echo, m; None if the board detected no echo."""
        return self.speed_of_sound * self.echo_times[0] / 2 if self.echo_times else None


def poses_from(start: RobotPose, readings: Sequence[Reading], first: RobotPose | None = None) -> FloatArray | None:
    """Return the pose of each reading, (n, 3) m, m and rad, if the robot was at `start` when its own pose was `first`.

    `first` is by default the pose of the first reading. None if a pose is unknown, or if the robot stands still there.
    """
    known = [reading.pose for reading in readings if reading.pose is not None]
    if not known or len(known) < len(readings):
        return None
    poses, origin = np.array(known), np.array(known[0] if first is None else first)
    moved = poses[:, :2] - origin[:2]
    turned = angle_difference(poses[:, 2], origin[2])
    if np.abs(moved).max() < _STILL and np.abs(turned).max() < _STILL_TURN:
        return None
    turn = start[2] - origin[2]
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.column_stack((start[:2] + moved @ np.array([[cosine, sine], [-sine, cosine]]), start[2] + turned))


def points_at(sensors: FloatArray | tuple[float, float], headings: FloatArray, ranges: FloatArray) -> FloatArray:
    """Return the points of readings, (n, 2) m, from `sensors`, (n, 2) m or one for all; NaN where the range is NaN."""
    return np.asarray(np.asarray(sensors) + ranges[:, None] * np.column_stack((np.cos(headings), np.sin(headings))))


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


MOST_ANGLE = 37.0  # rad; a message holds angles up to 2147 degrees
_ORDER_CHECKS = {
    "start": arguments.number(-MOST_ANGLE, MOST_ANGLE, "rad"),
    "step": arguments.number(-MOST_ANGLE, MOST_ANGLE, "rad"),
    "headings": arguments.whole(1, MOST_HEADINGS),
    "sweeps": arguments.whole(1, MOST_SWEEPS),
    "pings": arguments.whole(1, 255),
    "in_place": arguments.flag,
}


def check_order(order: ScanOrder) -> None:
    """Raise InputError if the protocol cannot state this order. A device may have narrower limits."""
    for name, check in _ORDER_CHECKS.items():
        check(name, getattr(order, name))
    if abs(step := math.degrees(order.step)) <= 0.5e-6:
        raise InputError(f"step {step:g}°: too fine; expected 0.000001° or more")
    if order.readings > MOST_READINGS:
        raise InputError(
            f"{order.readings} readings ({order.headings} headings, {order.sweeps} sweeps, {order.pings} pings): "
            f"at most {MOST_READINGS} are possible; reduce one of them"
        )


@arguments.checked(count=arguments.whole(1, MOST_SWEEPS))
def pings_in_place(count: int) -> ScanOrder:
    """Return the order of `count` pings, 1 to 65 535, at the present angle. Each is a sweep of one heading."""
    return ScanOrder(0.0, 1.0, headings=1, sweeps=count, in_place=True)


def headings_between(start: float, stop: float, step: float) -> int:
    """Return the number of angles `start`, `start + step`, … before `stop`, which is excluded; at least 1.

    0 to 360 by 5 is 72.

    Raises InputError if the step is zero, not finite, or leads away from `stop`.
    """
    if not all(map(math.isfinite, (start, stop, step))) or step == 0 or not 0 < (stop - start) / step < math.inf:
        raise InputError(f"there is no angle from {start:g} to below {stop:g} in steps of {step:g}")
    # rounding may make the quotient too large: without 1e-9, 0 to 360 by 0.1 could give 3601 headings instead of 3600
    return max(1, math.ceil((stop - start) / step - 1e-9))


@arguments.checked(
    start_deg=arguments.number(), stop_deg=arguments.number(), step_deg=arguments.number(), pings=arguments.whole(1)
)
def sector(start_deg: float = 0.0, stop_deg: float = 360.0, step_deg: float = 5.0, pings: int = 1) -> ScanOrder:
    """Return the order of one sweep from `start_deg` in steps of `step_deg`; `stop_deg` is excluded. All are degrees.

    0 to 360 by 5 is 72 headings. Angles of readings and of all other functions are in radians. Raises InputError if
    there is no such heading.
    """
    headings = headings_between(start_deg, stop_deg, step_deg)
    return ScanOrder(math.radians(start_deg), math.radians(step_deg), headings, pings=pings)


# the interface between a fake scanner and the acoustics of its surroundings


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


# Angles that may be wrong: a device checks the mark whenever it turns over it counter-clockwise, and reports a missing
# or misplaced one before it has turned MARK_OVERRUN past its position.


MARK_APPROACH = math.radians(3)  # before the mark, plus the backlash: the table then moves when it reaches the mark
MARK_OVERRUN = math.radians(6)
_BACKLASH = math.radians(3)  # assumed backlash of every gear
_TOLERANCE = 1e-6  # rad; less than a microstep


def nearest_mark(angle: float, lowest: float, highest: float) -> float | None:
    """Return the angle of the mark nearest to `angle`, rad. None if no mark lies between `lowest` and `highest`."""
    first, last = math.ceil(lowest / math.tau), math.floor(highest / math.tau)
    return None if first > last else min(max(round(angle / math.tau), first), last) * math.tau


def first_unverified(angles: FloatArray) -> int:
    """Return the index of the first reading that was made after the last check of the mark.

    `angles`, (n,) rad, are the angles of the readings in order of time. The turntable was homed just before the first
    reading. A device does not check marks that it passes clockwise.
    """
    run = unverified = 0  # `run`: index of the reading where the latest counter-clockwise movement began
    seen = -math.inf
    for index, angle in enumerate(angles):
        if index and angle < angles[index - 1]:
            run, seen = index, -math.inf
        mark = math.floor((angle - MARK_OVERRUN) / math.tau) * math.tau
        if mark > seen and mark >= angles[run] + MARK_APPROACH + _BACKLASH:
            seen, unverified = mark, run + int(np.searchsorted(angles[run:index], mark - _TOLERANCE))
    return unverified


def split_at_homings(times: Sequence[float], angles: Sequence[float], homings: Sequence[float]) -> list[FloatArray]:
    """Return the angles (rad) of the readings in order of their times (s), split at each homing.

    `homings` are the times of the newest reading before each homing, in ascending order. The result has one (n,) array
    more than `homings` has values.
    """
    order = np.argsort(times, kind="stable")
    in_order, angles_in_order = np.array(times, dtype=np.float64)[order], np.array(angles, dtype=np.float64)[order]
    return np.split(angles_in_order, np.searchsorted(in_order, homings, side="right"))


def lost_steps_clause(runs: Sequence[FloatArray]) -> str | None:
    """Return a clause that names the angles that may be wrong after steps were lost in the last of `runs`.

    `runs` are the angles of `split_at_homings`. None if the last run has no reading.
    """
    run, total = runs[-1], sum(map(len, runs))
    if not len(run):
        return None
    first = first_unverified(run)
    doubtful = len(run) - first
    these = f"all {total}" if doubtful == total else f"the last {doubtful} of {total}"
    return f"{these} angles may be wrong, from {math.degrees(run[first]):.6g}° on"


def unverified_clause(runs: Sequence[FloatArray]) -> str | None:
    """Return a clause that names the angles before a homing that no mark verified. None if there are none.

    `runs` are the angles of `split_at_homings`.
    """
    doubtful = [run[first_unverified(run)] for run in runs[:-1] if len(run)]
    if not doubtful:
        return None
    count, total = sum(len(run) - first_unverified(run) for run in runs[:-1]), sum(map(len, runs))
    return (
        f"{count} of {total} angles, from {math.degrees(doubtful[0]):.6g}° on, could not be checked for lost steps: "
        "the turntable had to home again"
    )


class Table:
    """A result with columns of equal length, as a table of pandas or xarray; the extra `study` installs both."""

    def columns(self) -> dict[str, Any]:
        """Return the columns by name, (n,) each."""
        raise NotImplementedError

    def to_dataframe(self) -> Any:
        """Return `columns` as a pandas.DataFrame. Raises MissingExtra without the extra `study`."""
        try:
            import pandas
        except ImportError as error:
            raise MissingExtra("tables need pandas", "study") from error
        return pandas.DataFrame(self.columns())

    def to_xarray(self) -> Any:
        """Return `columns` as an xarray.Dataset over their rows. Raises MissingExtra without the extra `study`."""
        try:
            import xarray
        except ImportError as error:
            raise MissingExtra("labelled arrays need xarray", "study") from error
        return xarray.Dataset({name: ("row", values) for name, values in self.columns().items()})
