"""Export of readings as named arrays in an .npz file, one row per reading.

Traces are written one by one, because the traces of an hour do not fit into memory.
"""

import math
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray, Reading

if TYPE_CHECKING:
    from sonarhw.log import Log

_TRACE_TYPE = np.dtype("<f4")  # represents 16-bit samples exactly
_FAST = 1  # deflate level; the highest level saves less than a tenth and takes many times as long


def write_npz(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:
    """Write the readings of all scans to `file`.

    One row per reading: `scan`, `number`, `sweep`, `ping`; `time_s` since the start of its scan; `heading_deg`, the
    turntable angle; `range_m`, NaN without an echo; `echoes_s` (n, most echoes), padded with NaN; `temperature_c`, NaN
    without a thermometer; `speed_of_sound`. With poses also `x_m`, `y_m` and `yaw_deg`, NaN without one. With traces
    also `traces` (n, longest) float32, padded with NaN, `trace_rate_hz` and `trace_start_s`. With `notes`, by the place
    of their reading in the log, also `notes`, empty for readings without one. Raises NotALog if a trace can no
    longer be read.
    """
    rows = [(index, scan, reading) for index, scan in enumerate(log.scans) for reading in scan.readings]
    readings = [reading for _, _, reading in rows]
    columns = {
        "scan": np.array([index for index, _, _ in rows], np.int64),
        "number": np.array([reading.number for reading in readings], np.int64),
        "sweep": np.array([reading.sweep for reading in readings], np.int64),
        "ping": np.array([reading.ping for reading in readings], np.int64),
        "time_s": np.array([reading.time - scan.began for _, scan, reading in rows], np.float64),
        "heading_deg": np.array([math.degrees(reading.angle) for reading in readings], np.float64),
        "range_m": _floats([reading.range for reading in readings]),
        "echoes_s": _padded([reading.echo_times for reading in readings]),
        "temperature_c": _floats([reading.temperature_c for reading in readings]),
        "speed_of_sound": np.array([reading.speed_of_sound for reading in readings], np.float64),
    }
    if any(reading.pose for reading in readings):
        poses = np.array([reading.pose or (math.nan,) * 3 for reading in readings], np.float64)
        columns |= {"x_m": poses[:, 0], "y_m": poses[:, 1], "yaw_deg": np.degrees(poses[:, 2])}
    if notes:
        columns["notes"] = np.array([notes.get(place, "") for place in range(len(rows))], np.str_)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=_FAST) as archive:
        for name, column in columns.items():
            write_array(archive, name, column.shape, column.dtype, [column])
        if any(reading.trace for reading in readings):
            _write_traces(archive, readings)


def _write_traces(archive: zipfile.ZipFile, readings: Sequence[Reading]) -> None:
    traces = [reading.trace for reading in readings]
    facts = [(len(trace.samples), trace.rate, trace.start) if trace else (0, math.nan, math.nan) for trace in traces]
    sizes, rates, starts = np.array(facts, np.float64).T
    write_array(archive, "trace_rate_hz", rates.shape, rates.dtype, [rates])
    write_array(archive, "trace_start_s", starts.shape, starts.dtype, [starts])
    longest = int(sizes.max())

    def rows() -> Iterator[NDArray[np.float32]]:
        for trace in traces:
            row = np.full(longest, np.nan, _TRACE_TYPE)
            if trace:
                row[: len(trace.samples)] = trace.samples
            yield row

    write_array(archive, "traces", (len(traces), longest), _TRACE_TYPE, rows())


def write_array(
    archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], kind: np.dtype[Any], pieces: Iterable[NDArray[Any]]
) -> None:
    """Write an array of shape `shape` piece by piece, in the format of `np.savez`."""
    header = {"shape": shape, "fortran_order": False, "descr": np.lib.format.dtype_to_descr(kind)}
    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
        np.lib.format.write_array_header_2_0(cast(BinaryIO, member), header)
        for piece in pieces:
            member.write(np.ascontiguousarray(piece).tobytes())


def _floats(values: Sequence[float | None]) -> FloatArray:
    return np.array([math.nan if value is None else value for value in values], np.float64)


def _padded(rows: Sequence[Sequence[float]]) -> FloatArray:
    table = np.full((len(rows), max(map(len, rows), default=0)), np.nan)
    for line, row in zip(table, rows, strict=True):
        line[: len(row)] = row
    return table
