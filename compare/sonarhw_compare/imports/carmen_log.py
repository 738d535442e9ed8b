"""Sonar readings of CARMEN logs, as `carmen_logwrite_write_base_sonar` of CARMEN's logger writes them.

    SONAR cone_angle num_sonars range... (x y theta)... ipc_timestamp ipc_hostname logger_timestamp

Each line is one sweep over all sensors of a robot; theta is the direction of a sensor in the robot's frame, rad, and
the angle of its reading. Other lines are ignored.
"""

import math
import re
import warnings
from collections.abc import Iterator
from pathlib import Path

from sonarhw.errors import InputError
from sonarhw.readings import Reading
from sonarhw_compare.imports.foreign_csv import opened, short_lines
from sonarhw_compare.imports.foreign_rows import ForeignRow, Meaning, readings_of

_COUNT = re.compile(r"\d{1,6}", re.ASCII)
_MOVED = 0.05  # m; the ranges of a robot that moved farther do not belong to one place
_AFTER = 3  # fields after the offsets: timestamp of the message, host, timestamp of the logger


def read_carmen_log(file: Path, meaning: Meaning) -> list[Reading]:
    """Return the sonar readings of a log, at least one. Raises InputError with the line.

    Warns if the robot moves between them, by the ODOM lines of the log.
    """
    path: list[tuple[float, float]] = []
    readings = readings_of(str(file), _rows(file, meaning.no_echo, path), meaning)
    if not readings:
        raise InputError(f"{file}: has no SONAR line; expected a CARMEN log with sonar readings")
    moved = max((math.dist(at, path[0]) for at in path), default=0.0)
    if moved > _MOVED:
        warnings.warn(
            f"{file}: the robot moves by {moved:.2f} m between the readings, which have no common place; split the log",
            stacklevel=2,
        )
    return readings


def _rows(file: Path, no_echo: float | None, path: list[tuple[float, float]]) -> Iterator[ForeignRow]:
    """Yield the readings; positions of the robot from the first SONAR line on are appended to `path`."""
    sweep, at = 0, None
    with opened(file, "a CARMEN log") as text:
        for number, line in enumerate(short_lines(file, text, "a CARMEN log"), 1):
            words, where = line.split(), f"line {number}"
            if words[:1] == ["ODOM"]:
                at = _numbers(file, where, words[1:3], 2)
                path += [(at[0], at[1])] if path else []
            elif words[:1] == ["SONAR"]:
                path += [(at[0], at[1])] if at and not path else []
                yield from _sweep(file, where, words[1:], sweep, no_echo)
                sweep += 1


def _sweep(file: Path, where: str, words: list[str], sweep: int, no_echo: float | None) -> Iterator[ForeignRow]:
    """Yield the readings of one SONAR line."""
    count = int(words[1]) if len(words) > 1 and _COUNT.fullmatch(words[1]) else 0
    if not 1 <= count <= len(words):
        raise InputError(f"{file}, {where}: expected the cone angle and the number of sonars after SONAR")
    expected = 2 + 4 * count + _AFTER
    if len(words) != expected:
        found = f"has {len(words)} fields after SONAR; expected {expected} for {count} sonars"
        raise InputError(f"{file}, {where}: {found}")
    values = _numbers(file, where, words[2:-2], 4 * count + 1)
    time = values[-1]
    for k, distance in enumerate(values[:count]):
        if distance != no_echo and distance < 0:
            raise InputError(f"{file}, {where}: range {distance:g}; expected 0 or more, or the value for no echo")
        heading = math.degrees(values[count + 3 * k + 2])
        yield ForeignRow(where, heading, None if distance == no_echo else distance, time, sweep)


def _numbers(file: Path, where: str, words: list[str], count: int) -> list[float]:
    try:
        values = [float(word) for word in words]
    except ValueError as error:
        raise InputError(f"{file}, {where}: {error}; expected numbers") from error
    if len(values) != count or not all(map(math.isfinite, values)):
        raise InputError(f"{file}, {where}: expected {count} finite numbers")
    return values
