"""The readings of one recorded scan as columns, about 100 bytes each.

Traces are not stored, only their positions in the log. They are read from the log on access.
"""

import math
from array import array
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import Origin, Reading, Trace

Columns = dict[str, NDArray[np.float64] | NDArray[np.int64]]
Span = tuple[int, int]  # offsets of the first and last chunk that contain a reading or its trace

_INTEGERS = ("number", "sweep", "ping", "echoes", "first_chunk", "last_chunk")
_FLOATS = ("angle", "time", "speed_of_sound", "temperature_c", "host_time")
NO_TRACE = -1
# limits of a frame
_MOST_ECHOES = 255
_ANGLES = -math.radians(2148), math.radians(2148)


class ReadingColumns:
    """Columns with one row per reading. The trace of a row may be added later."""

    def __init__(self) -> None:
        self._integers = {name: array("q") for name in _INTEGERS}
        self._floats = {name: array("d") for name in _FLOATS}
        self._echo_times = array("d")
        self._rows: dict[int, int] = {}  # by number

    def __len__(self) -> int:
        return len(self._integers["number"])

    def __contains__(self, number: int) -> bool:
        return number in self._rows

    @property
    def latest(self) -> float:
        """Time of the latest reading, s. There must be at least one."""
        return max(self._floats["time"])

    def add(self, reading: Reading, span: Span | None) -> None:
        """Append a reading. `span` is None as long as no part of its trace has been found."""
        self._rows[reading.number] = len(self)
        first, last = span or (NO_TRACE, NO_TRACE)
        integers = (reading.number, reading.sweep, reading.ping, len(reading.echo_times), first, last)
        maybe = (np.nan if value is None else value for value in (reading.temperature_c, reading.host_time))
        floats = (reading.angle, reading.time, reading.speed_of_sound, *maybe)
        for name, value in zip(_INTEGERS, integers, strict=True):
            self._integers[name].append(value)
        for name, number in zip(_FLOATS, floats, strict=True):
            self._floats[name].append(number)
        self._echo_times.extend(reading.echo_times)

    def extend_trace(self, number: int, began: int, chunk: int) -> None:
        """Extend the span of a reading to `chunk`, which contains a part of its trace. `began` contains the reading."""
        row = self._rows[number]
        if self._integers["first_chunk"][row] == NO_TRACE:
            self._integers["first_chunk"][row] = began
        self._integers["last_chunk"][row] = chunk

    def columns(self) -> Columns:
        """Return arrays in the order of the rows. `echo_times` has the echoes of all readings, one after another."""
        integers = {name: np.array(values, np.int64) for name, values in self._integers.items()}
        floats = {name: np.array(values, np.float64) for name, values in self._floats.items()}
        return {**integers, **floats, "echo_times": np.array(self._echo_times, np.float64)}


def check_columns(columns: Columns, end: int) -> None:
    """Raise ValueError unless `columns` may come from `ReadingColumns.columns`, for a log with chunks before `end`."""
    wanted = {**dict.fromkeys(_INTEGERS, np.int64), **dict.fromkeys((*_FLOATS, "echo_times"), np.float64)}
    if {name: column.dtype for name, column in columns.items()} != wanted:
        raise ValueError("other columns or types")
    count, echoes, times = len(columns["number"]), columns["echoes"], columns["echo_times"]
    first, last = columns["first_chunk"], columns["last_chunk"]
    if any(columns[name].shape != (count,) for name in (*_INTEGERS, *_FLOATS)):
        raise ValueError("columns of several lengths")
    if (echoes < 0).any() or (echoes > _MOST_ECHOES).any() or int(echoes.sum()) != len(times):
        raise ValueError("another number of echoes")
    for name, least, most in (("number", 0, 2**32), ("sweep", 0, 2**16), ("ping", 0, 2**8), ("angle", *_ANGLES)):
        if not ((columns[name] >= least) & (columns[name] < most)).all():
            raise ValueError(f"{name} out of range")
    if not np.isfinite(columns["time"]).all() or not (times >= 0).all() or np.isinf(times).any():
        raise ValueError("no times")
    if not ((first == NO_TRACE) | ((first >= 0) & (first <= last) & (last < end))).all():
        raise ValueError("traces outside the file")


def readings_of(columns: Columns, trace: Callable[[int, Span], Trace], origin: Origin) -> tuple[Reading, ...]:
    """Return the readings by number. `trace` returns the trace for a reading's number and span."""
    order = np.argsort(columns["number"], kind="stable").tolist()
    rows = [*_rows(columns, trace, origin)]
    return tuple(rows[row] for row in order)


def _rows(columns: Columns, trace: Callable[[int, Span], Trace], origin: Origin) -> Iterator[Reading]:
    echo_times = columns["echo_times"].tolist()
    used = 0
    names = (*_INTEGERS, *_FLOATS)
    for row in zip(*(columns[name].tolist() for name in names), strict=True):
        number, sweep, ping, echoes, first, last, angle, time, speed, *maybe = row
        temperature, host_time = (None if value != value else value for value in maybe)
        times = tuple(echo_times[used : used + echoes])
        used += echoes
        yield Reading(
            number=number,
            sweep=sweep,
            ping=ping,
            angle=angle,
            time=time,
            echo_times=times,
            speed_of_sound=speed,
            temperature_c=temperature,
            trace=None if first == NO_TRACE else trace(number, (first, last)),
            host_time=host_time,
            origin=origin,
        )
