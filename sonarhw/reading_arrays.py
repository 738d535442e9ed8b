"""Readings as named arrays in an .npz file, for NumPy and everything that reads it.

Takes the scans of a log; fills a file with plain arrays, one row a reading.
"""

import math
from collections.abc import Sequence
from typing import BinaryIO

import numpy as np

from sonarhw.log_contents import RecordedScan
from sonarhw.readings import FloatArray, Reading


def write_arrays(file: BinaryIO, scans: Sequence[RecordedScan]) -> None:
    """Write the readings of all scans to `file`.

    One row a reading: `scan`, `number`, `sweep`, `ping`; `time_s` since its scan began; `heading_deg`, the turntable
    angle; `range_m`, NaN without an echo; `echoes_s` (n, most echoes), padded with NaN; `temperature_c`, NaN without
    a thermometer; `speed_of_sound`. Where there are traces also `traces` (n, longest), padded with NaN,
    `trace_rate_hz` and `trace_start_s`.
    """
    rows = [(index, scan, reading) for index, scan in enumerate(scans) for reading in scan.readings]
    readings = [reading for _, _, reading in rows]
    columns = {
        "scan": np.array([index for index, _, _ in rows], np.int64),
        "number": np.array([reading.number for reading in readings], np.int64),
        "sweep": np.array([reading.sweep for reading in readings], np.int64),
        "ping": np.array([reading.ping for reading in readings], np.int64),
        "time_s": np.array([reading.time - scan.began for _, scan, reading in rows], np.float64),
        "heading_deg": np.array([math.degrees(reading.angle) for reading in readings], np.float64),
        "range_m": _floats([reading.range for reading in readings]),
        "echoes_s": _padded([np.array(reading.echo_times, np.float64) for reading in readings]),
        "temperature_c": _floats([reading.temperature_c for reading in readings]),
        "speed_of_sound": np.array([reading.speed_of_sound for reading in readings], np.float64),
        **_traces(readings),
    }
    np.savez_compressed(file, allow_pickle=False, **columns)


def _traces(readings: Sequence[Reading]) -> dict[str, FloatArray]:
    traces = [reading.trace for reading in readings]
    if not any(traces):
        return {}
    return {
        "traces": _padded([trace.samples if trace else np.empty(0) for trace in traces]),
        "trace_rate_hz": _floats([trace.rate if trace else None for trace in traces]),
        "trace_start_s": _floats([trace.start if trace else None for trace in traces]),
    }


def _floats(values: Sequence[float | None]) -> FloatArray:
    return np.array([math.nan if value is None else value for value in values], np.float64)


def _padded(rows: Sequence[FloatArray]) -> FloatArray:
    table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table
