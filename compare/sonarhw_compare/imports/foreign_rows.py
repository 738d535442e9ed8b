"""Readings from the rows of any file of another program: units, conventions, limits."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sonarhw.errors import InputError
from sonarhw.readings import Reading, Trace, speed_of_sound
from sonarhw.wire.messages import MOST_DEGREES

SPACING = 0.1  # s between readings of a file without times
# limits of the frames of a log
MOST_RANGE = 700.0  # m
LONGEST = 86_400.0  # s, between readings
LONGEST_SCAN = 1e8  # s
# limits of a file, so that nothing needs more than 1 GB
MOST_READINGS = 200_000
MOST_SAMPLES = 50_000_000  # of all traces
_PINGS = 256


@dataclass(frozen=True)
class Meaning:
    """Units and conventions of the numbers in a file."""

    scale: float = 1.0  # m per unit of range
    sign: float = 1.0  # 1: headings grow counter-clockwise, -1: clockwise
    zero: float = 0.0  # degrees, turntable angle at heading 0
    no_echo: float | None = None  # the range that stands for no echo
    speed_of_sound: float | None = None  # m/s; None: that of air at 20 °C
    threshold: float | None = None  # share of full scale at which a trace has its echo; None: traces have no echo
    blanking: float = 0.0  # s; earlier samples of a trace are no echo
    rate: float | None = None  # Hz, sampling rate of arrays of samples
    step: float = 0.0  # degrees, from one of their traces to the next, or from one sensor to the next
    topic: str | None = None  # of a ROS bag; None: all


@dataclass(frozen=True)
class ForeignRow:
    """One reading of a file, in the units of the file."""

    where: str  # in the file, for error messages
    heading: float  # degrees
    distance: float | None  # None: no echo
    time: float | None  # s
    sweep: int = 0
    trace: Trace | None = None


def readings_of(where: str, rows: Iterable[ForeignRow], meaning: Meaning) -> list[Reading]:
    """Return the readings of rows, numbered in their order. Raises InputError with the file `where` and the row."""
    speed = meaning.speed_of_sound or speed_of_sound()
    readings: list[Reading] = []
    samples = 0
    for number, row in enumerate(rows):
        angle = math.radians(meaning.zero + meaning.sign * row.heading)
        before = readings[-1] if readings else None
        if number >= MOST_READINGS:
            raise InputError(f"{where}: has more than {MOST_READINGS} readings; split it into several files")
        samples += 0 if row.trace is None else len(row.trace.samples)
        if samples > MOST_SAMPLES:
            raise InputError(f"{where}: traces of more than {MOST_SAMPLES} samples; split it into several files")
        reading = Reading(
            number=number,
            sweep=row.sweep,
            ping=(before.ping + 1) % _PINGS if before and (before.angle, before.sweep) == (angle, row.sweep) else 0,
            angle=angle,
            time=number * SPACING if row.time is None else row.time,
            echo_times=_echo_times(row, meaning, speed),
            speed_of_sound=speed,
            trace=row.trace,
        )
        _check(reading, before, readings[0].time if readings else reading.time, f"{where}, {row.where}")
        readings.append(reading)
    return readings


def _echo_times(row: ForeignRow, meaning: Meaning, speed: float) -> tuple[float, ...]:
    """Return the time of the echo, s: that of the range, or of the first sample of the trace over the threshold."""
    if row.distance is not None:
        return (2 * row.distance * meaning.scale / speed,)
    if row.trace is None or meaning.threshold is None:
        return ()
    loud = np.flatnonzero((np.abs(row.trace.samples) >= meaning.threshold) & (row.trace.times >= meaning.blanking))
    return (float(row.trace.times[loud[0]]),) if len(loud) else ()


def _check(reading: Reading, before: Reading | None, began: float, where: str) -> None:
    degrees = math.degrees(reading.angle)
    if abs(degrees) > MOST_DEGREES:
        raise InputError(f"{where}: turntable angle {degrees:g} degrees; expected at most {MOST_DEGREES:g}")
    if reading.range is not None and reading.range > MOST_RANGE:
        raise InputError(f"{where}: range {reading.range:g} m; expected at most {MOST_RANGE:g} m; check the scale")
    if before and reading.time < before.time:
        raise InputError(
            f"{where}: time {reading.time:g} s is before the reading above it at {before.time:g} s; "
            "sort the lines by time"
        )
    if before and reading.time - before.time > LONGEST:
        raise InputError(
            f"{where}: time {reading.time:g} s; expected seconds, at most {LONGEST:g} s after the reading above; "
            "convert other units to seconds"
        )
    if reading.time - began > LONGEST_SCAN:
        raise InputError(
            f"{where}: time {reading.time:g} s; expected at most {LONGEST_SCAN:g} s after the first reading"
        )
