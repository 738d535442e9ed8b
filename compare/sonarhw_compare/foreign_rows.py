"""Readings from the rows of any file of another program: units, conventions, limits. Errors name file and row."""

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from io import TextIOWrapper
from itertools import count
from pathlib import Path
from typing import TextIO

import numpy as np

from sonarhw.errors import InputError
from sonarhw.files import open_input
from sonarhw.readings import Reading, RobotPose, Trace
from sonarhw.sound_speed import speed_of_sound
from sonarhw.text.decoder import encoding_of
from sonarhw.wire.messages import MOST_DEGREES

SPACING = 0.1  # s between readings of a file without times
# limits of the frames of a log
MOST_RANGE = 700.0  # m
MOST_COORDINATE = 1e6  # m, as in room files
LONGEST = 86_400.0  # s, between readings
LONGEST_SCAN = 1e8  # s
# limits of a file, so that nothing needs more than 1 GB
MOST_READINGS = 200_000
MOST_SAMPLES = 50_000_000  # of all traces
_MOST_BYTES = 2_000_000_000  # of a text file
_START = 65_536  # bytes of a text that show its encoding
_PINGS = 256
_POSE_WITHIN = 1.0  # s; poses are published several times a second


@dataclass(frozen=True)
class Meaning:
    """Units and conventions of the numbers in a file."""

    scale: float = 1.0  # m per unit of range
    sign: float | None = None  # 1: headings grow counter-clockwise, -1: clockwise; None: as the file says
    zero: float = 0.0  # degrees, turntable angle at heading 0
    no_echo: float | None = None  # the range that stands for no echo
    speed_of_sound: float | None = None  # m/s; None: that of air at 20 °C
    threshold: float | None = None  # share of full scale at which a trace has its echo; None: traces have no echo
    blanking: float = 0.0  # s; earlier samples of a trace are no echo
    rate: float | None = None  # Hz, sampling rate of arrays of samples
    step: float = 0.0  # degrees, from one of their traces to the next, or from one sensor to the next
    topic: str | None = None  # of a ROS bag; None: all
    variable: str | None = None  # of a MAT or NPZ file; None: the only array
    axis: str | None = None  # "rows" or "columns": what a ping is in a table of samples; None: rows, unless doubtful
    full_scale: float | None = None  # of samples, such as volts; None: that of their type
    unit_deg: float = 1.0  # degrees per unit of heading


@dataclass(frozen=True)
class ForeignRow:
    """One reading of a file, in the units of the file."""

    where: str  # in the file, for error messages
    heading: float  # degrees
    distance: float | None  # None: no echo
    time: float | None  # s
    sweep: int = 0
    trace: Trace | None = None
    more: tuple[float, ...] = ()  # ranges of later echoes
    pose: RobotPose | None = None  # m and rad


def readings_of(where: str, rows: Iterable[ForeignRow], meaning: Meaning) -> list[Reading]:
    """Return the readings of rows, numbered in their order. Raises InputError with the file `where` and the row."""
    speed = meaning.speed_of_sound or speed_of_sound()
    readings: list[Reading] = []
    samples = 0
    for number, row in enumerate(rows):
        angle = math.radians(meaning.zero + (meaning.sign or 1.0) * meaning.unit_deg * row.heading)
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
            pose=row.pose,
        )
        _check(reading, before, readings[0].time if readings else reading.time, f"{where}, {row.where}")
        readings.append(reading)
    return readings


def at_poses(rows: Iterable[ForeignRow], times: Sequence[float], poses: Sequence[RobotPose]) -> Iterator[ForeignRow]:
    """Yield rows with the pose at their time: between two poses on the straight line, none 1 s before or after all.

    `times` (s) are those of the poses; both are in any order.
    """
    stamps, known = np.array(times, np.float64), np.array(poses, np.float64).reshape(-1, 3)
    order = [row for row in np.argsort(stamps, kind="stable").tolist() if np.isfinite(known[row]).all()]
    stamps, known = stamps[order], known[order]
    turned = np.unwrap(known[:, 2])
    for row in rows:
        if not len(stamps) or row.time is None or not stamps[0] - _POSE_WITHIN <= row.time <= stamps[-1] + _POSE_WITHIN:
            yield row
            continue
        x, y, heading = (float(np.interp(row.time, stamps, part)) for part in (known[:, 0], known[:, 1], turned))
        yield replace(row, pose=(x, y, math.remainder(heading, math.tau)))


def _echo_times(row: ForeignRow, meaning: Meaning, speed: float) -> tuple[float, ...]:
    """Return the time of the echo, s: that of the range, or of the first sample of the trace over the threshold."""
    if row.distance is not None:
        return tuple(2 * distance * meaning.scale / speed for distance in (row.distance, *row.more))
    if row.trace is None or meaning.threshold is None:
        return ()
    loud = np.flatnonzero((np.abs(row.trace.samples) >= meaning.threshold) & (row.trace.times >= meaning.blanking))
    return (float(row.trace.times[loud[0]]),) if len(loud) else ()


def _check(reading: Reading, before: Reading | None, began: float, where: str) -> None:
    degrees = math.degrees(reading.angle)
    if reading.pose is not None and not max(map(abs, reading.pose)) <= MOST_COORDINATE:
        raise InputError(
            f"{where}: pose {', '.join(f'{part:g}' for part in reading.pose)}; expected metres and a heading in "
            f"radians, none over {MOST_COORDINATE:g}"
        )
    if abs(degrees) > MOST_DEGREES:
        raise InputError(f"{where}: turntable angle {degrees:g} degrees; expected at most {MOST_DEGREES:g}")
    if (farthest := max(reading.echo_ranges, default=0.0)) > MOST_RANGE:
        raise InputError(f"{where}: range {farthest:g} m; expected at most {MOST_RANGE:g} m; check the scale")
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


# Text, of which no line needs much memory.


MOST_CHARACTERS = 65_536  # of a line


@contextmanager
def opened(file: Path, expected: str = "text") -> Iterator[TextIO]:
    """Open a text file in UTF-8, UTF-16 or cp1252. Raises InputError for what is not text, or not `expected`."""
    try:
        with open_input(file, _MOST_BYTES) as data:
            encoding = encoding_of(data.read(_START)) or "utf-8"
            data.seek(0)
            with TextIOWrapper(data, encoding=encoding.replace("utf-8", "utf-8-sig"), newline="") as text:
                yield text
    except InputError:  # of the reader of the text
        raise
    except FileNotFoundError as error:
        raise InputError(f"{file}: no such file; give the name of {expected}") from error
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}; expected {expected}") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{file}: is not UTF-8 text: byte {error.object[error.start]:#04x}; expected {expected} in UTF-8"
        ) from error
    except (ValueError, csv.Error) as error:  # a NUL in the name
        raise InputError(f"{file}: is not {expected}: {error}") from error


def short_lines(file: Path, text: TextIO, expected: str = "text", most: int = MOST_CHARACTERS) -> Iterator[str]:
    """Yield the lines of at most `most` characters. Raises InputError before a line needs much memory."""
    for number in count(1):
        line = text.readline(most + 1)
        if not line:
            return
        if len(line) > most:
            raise InputError(f"{file}, line {number}: has more than {most} characters; expected {expected}")
        yield line
