"""Poses of scans with their uncertainty, from a CSV file."""

import csv
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError
from sonarhw_compare.imports.foreign_csv import opened, other_separator, short_lines
from sonarhw_compare.locate.pose_spread import PoseSpread

HEADER = "log,x_m,y_m,heading_deg,sd_xy_m,sd_heading_deg"
_WHAT = "a table of poses (CSV)"
_MOST_XY, _MOST_DEG = 100.0, 180.0  # standard deviations, m and °; what is known no better is unknown
_SHOWN = 4  # names of rows, in an error

_Poses = dict[str, tuple[Place, PoseSpread]]  # by the name of the log in its row


def read_poses(path: Path, logs: Sequence[Path]) -> list[tuple[Place, PoseSpread]]:
    """Return place and spread for each of `logs`; an empty standard deviation is exact.

    A row names a log by its path as in `logs`, or by its file name if no other log has this name. Without x and y, the
    position is unknown; without a heading, the heading is.

    Raises InputError with file and line if the file is unreadable or not of this form, or lacks a log.
    """
    with opened(path, _WHAT) as text:
        poses = _poses(path, short_lines(path, text, _WHAT))
    chosen = [_pose_of(log, logs, poses, path) for log in logs]
    if chosen and not chosen[0][1].is_whole:
        raise InputError(
            f"{path}: {logs[0].name}: expected position and heading of the first log; others may be unknown"
        )
    return chosen


def _pose_of(log: Path, logs: Sequence[Path], poses: _Poses, path: Path) -> tuple[Place, PoseSpread]:
    """Return place and spread of a log. Raises InputError if no row names it, or not it alone."""
    if (pose := poses.get(str(log))) is not None:
        return pose
    rows = [name for name in poses if Path(name).name == log.name]
    alike = [str(other) for other in logs if other.name == log.name]
    if rows and (len(rows) > 1 or len(alike) > 1):
        named = " and ".join(alike if len(alike) > 1 else rows)
        raise InputError(f"{path}: {named} have the same file name; expected rows with their paths, such as {log}")
    if not rows:
        some = ", ".join([*list(poses)[:_SHOWN], *(["…"] if len(poses) > _SHOWN else [])]) or "no log"
        raise InputError(
            f"{path}: no row for {log.name}; expected one for each log, with its name in the first column; "
            f"the rows are for {some}"
        )
    return poses[rows[0]]


def _poses(path: Path, lines: Iterator[str]) -> _Poses:
    """Return place and spread of each line below the header."""
    header = next(lines, None)
    if header is None:
        raise InputError(f"{path}: the file is empty; expected the header {HEADER} and one line per log")
    if header.strip() != HEADER:
        raise InputError(f"{path}: line 1: {_other_header(header.strip())}")
    poses: _Poses = {}
    for number, row in enumerate(csv.reader(lines), start=2):
        if row:
            name, pose = _pose(row, f"{path}: line {number}")
            if name in poses:
                raise InputError(f"{path}: line {number}: {name} was given before")
            poses[name] = pose
    return poses


def _other_header(header: str) -> str:
    """Return what is wrong with a header."""
    other = other_separator(header.split(","))
    if other is None:
        return f"expected the header {HEADER}, got {header!r}"
    return f"the columns are separated by {other}; expected commas, points in numbers, and the header {HEADER}"


def _pose(row: Sequence[str], where: str) -> tuple[str, tuple[Place, PoseSpread]]:
    if len(row) != len(HEADER.split(",")):
        extra = "; write numbers with a point, not a comma" if len(row) > len(HEADER.split(",")) else ""
        raise InputError(f"{where}: expected {len(HEADER.split(','))} columns ({HEADER}), got {len(row)}{extra}")
    name, *cells = (cell.strip() for cell in row)
    x, y, heading, xy, turn = (_number(cell, where) for cell in cells)
    if min(xy, turn) < 0:
        raise InputError(f"{where}: expected standard deviations of 0 or more, got {min(xy, turn):g}")
    if xy > _MOST_XY or turn > _MOST_DEG:
        raise InputError(
            f"{where}: expected standard deviations of at most {_MOST_XY:g} m and {_MOST_DEG:g}°, got {xy:g} m and "
            f"{turn:g}°; leave position or heading, and its standard deviation, empty if it is unknown"
        )
    has_position, has_heading = bool(cells[0] and cells[1]), bool(cells[2])
    if not has_position and (cells[0] or cells[1] or cells[3]):
        raise InputError(f"{where}: expected x and y, or neither and no sd_xy_m: the position is unknown")
    if not has_heading and cells[4]:
        raise InputError(f"{where}: expected a heading, or no sd_heading_deg: the heading is unknown")
    spread = PoseSpread(xy if has_position else math.inf, math.radians(turn) if has_heading else math.inf)
    return str(Path(name)), (Place(Path(name).stem, (x, y), math.radians(heading)), spread)


def _number(text: str, where: str) -> float:
    try:
        value = float(text or 0)
    except ValueError as error:
        raise InputError(f"{where}: expected a number, such as 1.5, got {text!r}") from error
    if not math.isfinite(value):
        raise InputError(f"{where}: expected a finite number, got {text}")
    return value
