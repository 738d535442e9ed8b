"""`sonarhw calibrate LOG… --room ROOM`: a board profile from scans of a known room."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw.errors import InputError
from sonarhw_cli.console.lines import print_line, warn
from sonarhw_cli.console.log_input import open_scan
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.output import written_file
from sonarhw_cli.console.progress import progress_of_share
from sonarhw_cli.console.room_input import open_room, print_place

if TYPE_CHECKING:
    from sonarhw_compare.fit import PlacedScan
    from sonarhw_compare.known_room.room_calibration import RoomCalibration
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.model import Place, Room


def calibrate_with_room(
    logs: Sequence[Path],
    room_name: str,
    places: Sequence[str],
    poses: Sequence[str],
    board_name: str,
    out: Path,
    plot: tuple[Path, str] | None,
    force: bool,
) -> None:
    """Write the profile that the logs give, and print each value; `plot` is the file of a picture and its format.

    Raises InputError.
    """
    from sonarhw_compare.known_room.room_calibration import calibrate_in_room
    from sonarhw_compare.known_room.room_profile import room_profile
    from sonarhw_sim.board.profile import load_board

    board, room = load_board(board_name), open_room(room_name)
    scans = _placed(logs, room, places, poses, board_name)
    with progress_of_share() as show:
        found = calibrate_in_room(board, scans, room, show)
    name = out.stem.encode(errors="replace").decode()
    text = room_profile(board, found, scans, room.name, name).text
    with written_file(out, overwrite=force) as file:
        file.write(text.encode())
    if plot is not None:
        _write_picture(found, scans, plot, force)
    for line in _lines(found, scans, board):
        print_line(line)
    for doubt in (*found.proposals, *found.doubts):
        warn(doubt)


def _placed(
    logs: Sequence[Path], room: "Room", places: Sequence[str], poses: Sequence[str], board_name: str
) -> "list[PlacedScan]":
    """Return the scans at the given places or poses, or at those of the logs."""
    from sonarhw_compare.fit import PlacedScan

    given = [*places, *poses]
    if places and poses:
        raise InputError("--place and --pose: expected one of them")
    if given and len(given) != len(logs):
        option = "--place" if places else "--pose"
        raise InputError(f"{option}: expected one for each of {counted(len(logs), 'log')}, got {len(given)}")
    scans = []
    for k, log in enumerate(logs):
        scan = open_scan(log, board_name)
        here = _at_pose(room, poses[k]) if poses else scan.place(room, places[k] if places else None)
        print_place(room, here)
        scans.append(PlacedScan(scan.readings, here, log.stem, str(log)))
    return scans


def _at_pose(room: "Room", text: str) -> "Place":
    """Return the place of `X,Y,DEG`. Raises InputError for another form."""
    try:
        x, y, degrees = (float(part) for part in text.split(","))
    except ValueError as error:
        raise InputError(f"--pose {text}: expected X,Y,DEG: two metres and the heading of the zero, degrees") from error
    if not all(map(math.isfinite, (x, y, degrees))):
        raise InputError(f"--pose {text}: expected three finite numbers")
    return replace(room.place(f"{x},{y}"), heading=math.radians(degrees))


def _write_picture(
    found: "RoomCalibration", scans: "Sequence[PlacedScan]", plot: tuple[Path, str], force: bool
) -> None:
    from sonarhw_compare.known_room.calibration_picture import draw_calibration
    from sonarhw_compare.pictures.picture_file import write_picture

    with written_file(plot[0], overwrite=force) as file:
        write_picture(draw_calibration(found, scans), file, plot[1])


def _lines(found: "RoomCalibration", scans: "Sequence[PlacedScan]", start: "Board") -> list[str]:
    """Return one line for each value, found or kept, and for each scan before and after."""
    from sonarhw_compare.plate.plate_profile import interval_text, value_text

    lines = [
        f"{one.key}: {value_text(one)}, 95 % {interval_text(one)}; before: {one.before:g}" for one in found.findings
    ]
    lines += [
        f"own body: turntable angles {part.from_deg:g} to {part.to_deg:g} degrees, "
        f"{part.nearest:g} to {part.farthest:g} m"
        for part in found.own_body
    ]
    if found.own_body:
        lines.append(f"own body: {counted(found.own_echoes, 'reading')} left out")
    lines += [f"{key}: stays {_present(start, key)}; {reason}" for key, reason in found.kept.items()]
    for scan, before, after in zip(scans, found.before, found.after, strict=True):
        lines += [f"{scan.name}: before {before.line}", f"{scan.name}: after {after.line}"]
    return lines


def _present(start: "Board", key: str) -> str:
    section, _, name = key.rpartition(".")
    value = getattr(getattr(start, section) if section else start, name)
    return f"{value:g}" if isinstance(value, float) else counted(len(value), "part")
