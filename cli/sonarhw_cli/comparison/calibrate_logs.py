"""`sonarhw calibrate LOG…`: a board profile from scans of a plate (--distance) or of a known room (--room)."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw.errors import InputError, NoPlate, counted
from sonarhw_cli.console.lines import print_line, warn
from sonarhw_cli.console.log_input import open_scan
from sonarhw_cli.console.options import check_degrees
from sonarhw_cli.console.output import write_figure, write_text
from sonarhw_cli.console.progress import progress_of_share
from sonarhw_cli.console.room_input import check_one_of_each, open_room, place_of_pose, print_place

if TYPE_CHECKING:
    from sonarhw_compare.calibration.plate import PlateCalibration
    from sonarhw_compare.calibration.plate_readings import PlateReadings
    from sonarhw_compare.calibration.room import RoomCalibration
    from sonarhw_compare.scans import GivenScan
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room


def calibrate_with_plate(
    logs: Sequence[Path],
    distances: Sequence[float],
    directions: Sequence[float],
    board_name: str | None,
    out: Path,
    force: bool,
) -> None:
    """Write the profile that the logs give, and print each value. `directions` are degrees: none, one, or one a log.

    The calibration begins with the board of the logs if `board_name` is None.
    Raises InputError, and NoPlate if a log shows no plate, or if the logs determine no value.
    """
    from sonarhw_compare.calibration.plate import calibrate_with_plates, plate_profile
    from sonarhw_compare.scans import common_board

    given = [open_scan(log, board_name) for log in logs]
    board = common_board(given, board_name)
    _check_plates(logs, distances, directions, board)
    turns = list(directions) * (len(logs) if len(directions) == 1 else 1) or [0.0] * len(logs)
    scans = [_plate_readings(*one, board) for one in zip(logs, given, distances, turns, strict=True)]
    found = calibrate_with_plates(board, scans)
    if found.findings:
        write_text(out, plate_profile(board, found, scans, profile_name(out)).text, force)
    for line in [*_value_lines(found), *_kept_lines(found, board)]:
        print_line(line)
    for doubt in found.doubts:
        warn(doubt)
    if not found.findings:
        raise NoPlate(
            f"{out}: not written: the logs determine no value of the profile, for the reasons above; "
            "scan as they say, or calibrate with --room and scans of a known room"
        )


def calibrate_with_room(
    logs: Sequence[Path],
    room_name: str,
    places: Sequence[str],
    poses: Sequence[str],
    board_name: str | None,
    out: Path,
    room_out: Path | None,
    plot: Path | None,
    force: bool,
) -> None:
    """Write the profile that the logs give and a picture of the scans, and print each value. Raises InputError.

    The calibration begins with the board of the logs if `board_name` is None.
    With `room_out`, the reflectances of the room are calibrated too, and the room is written there.
    """
    from sonarhw_compare.calibration.room import (
        calibrate_board_and_room,
        calibrate_in_room,
        room_profile,
        with_provenance,
    )
    from sonarhw_compare.fit.fitting import placed_scans
    from sonarhw_compare.scans import common_board

    room, given = open_room(room_name), [open_scan(log, board_name) for log in logs]
    board = common_board(given, board_name)
    scans = placed_scans(given, _places(given, room, places, poses))
    with progress_of_share() as show:
        calibrate = calibrate_in_room if room_out is None else calibrate_board_and_room
        found = calibrate(board, scans, room, show)
    write_text(out, room_profile(board, found, scans, room.name, profile_name(out)).text, force)
    if room_out is not None:
        titles = [scan.title for scan in scans]
        write_text(room_out, with_provenance(found.room, found.reflectances, profile_name(out), titles).text, force)
    if plot is not None:
        from sonarhw_compare.drawings import draw_calibration

        write_figure(plot, draw_calibration(found, scans), force)
    for line in [*_value_lines(found), *_own_body_lines(found), *_kept_lines(found, board), *_room_lines(found)]:
        print_line(line)
    for scan, before, after in zip(scans, found.before, found.after, strict=True):
        print_line(f"{scan.name}: before {before.line}")
        print_line(f"{scan.name}: after {after.line}")
    for doubt in (*found.proposals, *found.doubts, *_room_doubts(found, room_name)):
        warn(doubt)


def profile_name(out: Path) -> str:
    """Return the name of the profile in a file: that of the file."""
    return out.stem.encode(errors="replace").decode()


def _check_plates(
    logs: Sequence[Path], distances: Sequence[float], directions: Sequence[float], board: "Board"
) -> None:
    """Raise InputError unless there is a distance for each log, and directions as the logs need them."""
    if board.ring is not None:
        raise InputError(f"--board {board.name}: has a ring of sensors; a plate calibrates a head on a turntable")
    if len(distances) != len(logs):
        raise InputError(
            f"--distance: expected one for each of {counted(len(logs), 'log')}, got {len(distances)}; repeat the option"
        )
    if len(directions) not in (0, 1, len(logs)):
        raise InputError(f"--direction: expected one for all logs, or {len(logs)}, got {len(directions)}")
    for distance in distances:
        if not 0 < distance <= board.max_range:
            raise InputError(f"--distance {distance:g}: expected more than 0 and at most {board.max_range:g} m")
    for direction in directions:
        check_degrees("--direction", direction)
    twice = {log for log in logs if sum(log.resolve() == other.resolve() for other in logs) > 1}
    if twice:
        raise InputError(f"{min(twice)}: is given twice; give each log once")


def _plate_readings(log: Path, scan: "GivenScan", distance: float, direction: float, board: "Board") -> "PlateReadings":
    from sonarhw_compare.calibration.plate_readings import plate_readings

    return plate_readings(log.name, scan.readings, distance, math.radians(direction), board, _blanked_until(scan))


def _blanked_until(scan: "GivenScan") -> float:
    """Return the blanking in the settings of the scanner, s; 0 if the log does not contain it."""
    from sonarhw.wire.messages import seconds_of

    settings = scan.log and scan.log.settings
    return seconds_of(settings.blanking_us) if settings else 0.0


def _places(given: "Sequence[GivenScan]", room: "Room", places: Sequence[str], poses: Sequence[str]) -> "list[Place]":
    """Return the place of each scan: of --pose, --place or the log."""
    check_one_of_each(places, poses, len(given))
    found = []
    for k, scan in enumerate(given):
        if poses:
            pose = place_of_pose(poses[k])
            here = replace(room.place(pose.position), heading=pose.heading)
        else:
            here = scan.place(room, places[k] if places else None)
        print_place(room, here)
        found.append(here)
    return found


def _value_lines(found: "PlateCalibration | RoomCalibration") -> list[str]:
    return [f"{one.key}: {one.text}, 95 % {one.interval_text}; before: {one.before:g}" for one in found.findings]


def _own_body_lines(found: "RoomCalibration") -> list[str]:
    if not found.own_body:
        return []
    parts = [
        f"own body: turntable angles {part.from_deg:g} to {part.to_deg:g} degrees, "
        f"{part.nearest:g} to {part.farthest:g} m"
        for part in found.own_body
    ]
    return [*parts, f"own body: {counted(found.own_echoes, 'reading')} left out"]


def _room_lines(found: "RoomCalibration") -> list[str]:
    """Return what the scans give for the room, and to which room the profile belongs."""
    from sonarhw_compare.calibration.room import reflectance_text

    used = (
        "used, and written with the room" if found.room_is_changed else "not used; the profile belongs to the room file"
    )
    return [f"{reflectance_text(one)}; {used}" for one in found.reflectances]


def _room_doubts(found: "RoomCalibration", room_name: str) -> list[str]:
    from sonarhw_compare.calibration.room import is_contradicted

    if found.room_is_changed:
        return []
    return [
        f"--room {room_name}: the scans contradict the reflectance {one.before:g} of {one.key!r}: {one.interval_text}; "
        "add --room-out FILE.toml to calibrate it too, and to write the room with it"
        for one in found.reflectances
        if is_contradicted(one)
    ]


def _kept_lines(found: "PlateCalibration | RoomCalibration", start: "Board") -> list[str]:
    return [f"{key}: stays {_present(start, key)}; {reason}" for key, reason in found.kept.items()]


def _present(start: "Board", key: str) -> str:
    """Return the value of a key, such as `mount.ahead`, or the number of its parts."""
    section, _, name = key.rpartition(".")
    value = getattr(getattr(start, section) if section else start, name)
    return f"{value:g}" if isinstance(value, float) else counted(len(value), "part")
