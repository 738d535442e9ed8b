"""The profile that a calibration in a known room writes: values with their intervals, own body, and the scans."""

from collections.abc import Sequence
from typing import Any

import tomlkit
from sonarhw_sim.board.profile import Board, parse_board
from tomlkit.exceptions import TOMLKitError

from sonarhw.errors import InputError
from sonarhw.harmless_text import harmless
from sonarhw_compare.fit.findings import below_header
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.known_room.room_calibration import RoomCalibration
from sonarhw_compare.plate.plate_profile import set_calibrated


def room_profile(start: Board, found: RoomCalibration, scans: Sequence[PlacedScan], room: str, name: str) -> Board:
    """Return the profile `start` with another name and what was found; all else is unchanged.

    Comments state the 95 % intervals and the former values, and name the scans and the `room`. Raises InputError if the
    text of the profile cannot be changed.
    """
    try:
        profile: Any = tomlkit.parse(start.text)
        profile["name"] = name
        for finding in found.findings:
            set_calibrated(profile, finding)
        if found.own_body:
            profile["own_body"] = _parts(found)
        text = below_header(_header(start, found, scans, room), tomlkit.dumps(profile), start.name)
    except TOMLKitError as error:
        raise InputError(f"the board profile cannot be changed: {error}; choose another profile") from error
    return parse_board(text, f"profile {name!r}")


def _parts(found: RoomCalibration) -> Any:
    """Return the own body as an array of tables."""
    parts = tomlkit.aot()
    for part in found.own_body:
        table = tomlkit.table()
        for key, value in part.model_dump().items():
            table[key] = value
        parts.append(table)
    return parts


def _header(start: Board, found: RoomCalibration, scans: Sequence[PlacedScan], room: str) -> list[str]:
    keys = [finding.key for finding in found.findings] + (["own_body"] if found.own_body else [])
    lines = [
        f"# Calibrated by `sonarhw calibrate` in room {harmless(room)!r}, beginning with profile {start.name!r}: "
        f"{', '.join(keys) or 'no value'}.",
        "# Threshold and aperture: most echoes within 5 cm, counted three times, and silence, counted once.",
        "# Spreads are those of readings, as they are in the logs.",
    ]
    for scan, after in zip(scans, found.after, strict=True):
        x, y = scan.place.position
        lines.append(f"#   {harmless(scan.title)}: at {x:g}, {y:g} m; {after.line}")
    lines += [f"# Kept: {key}; {reason}." for key, reason in found.kept.items()]
    return lines
