"""Formats of `log export` and of the window, and readings as lines of CSV, in degrees and metres."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

from sonarhw.errors import number, text_cell

if TYPE_CHECKING:
    from sonarhw.log import Log
    from sonarhw.readings import Reading

# readings as lines of CSV: the output of `scan --print` and of `log export`


HEADER = "time_s,heading_deg,range_m,echoes_s"
POSE_HEADER = "x_m,y_m,yaw_deg"  # of a robot, in logs with poses
_QUOTED = tuple(',"')  # characters in a cell that needs quotes; line breaks are escaped


def row(reading: "Reading", began: float) -> str:
    """Return one line with the columns of HEADER. Echo times are separated by `;`.

    `time_s` counts from `began`, the start of the scan on the clock of `Reading.time`, s. Without an echo, range and
    echo times are empty.
    """
    distance = "" if reading.range is None else number(reading.range)
    echoes = ";".join(map(number, reading.echo_times))
    return f"{number(reading.time - began)},{number(math.degrees(reading.angle))},{distance},{echoes}"


def write_csv(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:
    """Write the readings of all scans to `file`: a header, then one line per reading.

    If any reading has a pose, the columns of POSE_HEADER follow. `notes`: by the place of their reading in the log,
    from 0. With any, `note` is the last column.
    """
    has_poses = any(reading.pose for scan in log.scans for reading in scan.readings)
    file.write(f"{HEADER}{f',{POSE_HEADER}' if has_poses else ''}{',note' if notes else ''}\n".encode())
    place = 0
    for scan in log.scans:
        for reading in scan.readings:
            note = f",{_quoted(text_cell(notes.get(place, '')))}" if notes else ""
            pose = _pose_cells(reading) if has_poses else ""
            file.write(f"{row(reading, scan.began)}{pose}{note}\n".encode())
            place += 1


def _pose_cells(reading: "Reading") -> str:
    """Return the pose of a reading as the last cells of a line, empty without one."""
    if reading.pose is None:
        return ",,,"
    x, y, heading = reading.pose
    return f",{number(x)},{number(y)},{number(math.degrees(heading))}"


def _quoted(cell: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if any(mark in cell for mark in _QUOTED) else cell


# file formats: an entry in FORMATS is all that the command and the window need


@dataclass(frozen=True)
class ExportFormat:
    """One file format."""

    suffix: str  # of the file name, in lower case
    title: str  # in a file dialog
    write: "Callable[[Log, BinaryIO, Mapping[int, str]], None]"  # notes by the place of their reading in the log


def _write_npz(log: "Log", file: BinaryIO, notes: Mapping[int, str]) -> None:
    from sonarhw.npz import write_npz  # loads NumPy, which the help of the command line does not need

    write_npz(log, file, notes)


# `--out -` writes the first format
FORMATS = (
    ExportFormat(".csv", "Readings", write_csv),
    ExportFormat(".npz", "Readings with traces, for NumPy", _write_npz),
)


def export_suffixes() -> tuple[str, ...]:
    """Return the suffix of every format, in order."""
    return tuple(entry.suffix for entry in FORMATS)


def export_format(suffix: str) -> ExportFormat:
    """Return the format with this suffix. Raises KeyError for any other."""
    return {entry.suffix: entry for entry in FORMATS}[suffix]
