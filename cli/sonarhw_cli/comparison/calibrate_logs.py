"""`sonarhw calibrate LOG… --distance D…`: a board profile from scans of a plate at several distances."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw.errors import InputError
from sonarhw_cli.console.lines import print_line, warn
from sonarhw_cli.console.log_input import open_scan
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.output import written_file

if TYPE_CHECKING:
    from sonarhw_compare.imports.given_scan import GivenScan
    from sonarhw_compare.plate.plate_calibration import PlateCalibration
    from sonarhw_compare.plate.plate_readings import PlateReadings
    from sonarhw_sim.board.profile import Board


def calibrate_logs(
    logs: Sequence[Path],
    distances: Sequence[float],
    directions: Sequence[float],
    board_name: str,
    out: Path,
    force: bool,
) -> None:
    """Write the profile that the logs give, and print each value. `directions` are degrees: none, one, or one a log.

    Raises InputError, and NoPlate if a log shows no plate.
    """
    from sonarhw_compare.plate.plate_calibration import calibrate_with_plates
    from sonarhw_compare.plate.plate_profile import plate_profile
    from sonarhw_sim.board.profile import load_board

    board = load_board(board_name)
    _check(logs, distances, directions, board)
    turns = list(directions) * (len(logs) if len(directions) == 1 else 1) or [0.0] * len(logs)
    scans = [_readings(*one, board) for one in zip(logs, distances, turns, strict=True)]
    found = calibrate_with_plates(board, scans)
    name = out.stem.encode(errors="replace").decode()
    text = plate_profile(board, found, scans, name).text
    with written_file(out, overwrite=force) as file:
        file.write(text.encode())
    for line in _lines(found, board):
        print_line(line)
    for doubt in found.doubts:
        warn(doubt)


def _check(logs: Sequence[Path], distances: Sequence[float], directions: Sequence[float], board: "Board") -> None:
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
        if not math.isfinite(direction):
            raise InputError(f"--direction {direction:g}: expected degrees")
    twice = {log for log in logs if sum(log.resolve() == other.resolve() for other in logs) > 1}
    if twice:
        raise InputError(f"{min(twice)}: is given twice; give each log once")


def _readings(log: Path, distance: float, direction: float, board: "Board") -> "PlateReadings":
    from sonarhw_compare.plate.plate_readings import plate_readings

    scan = open_scan(log, board.name)
    return plate_readings(log.name, scan.readings, distance, math.radians(direction), board, _blanked_until(scan))


def _blanked_until(scan: "GivenScan") -> float:
    """Return the blanking in the settings of the scanner, s; 0 if the log does not contain it."""
    from sonarhw.wire.units import seconds_of

    settings = scan.log and scan.log.settings
    return seconds_of(settings.blanking_us) if settings else 0.0


def _lines(found: "PlateCalibration", start: "Board") -> list[str]:
    """Return one line for each value, found or kept."""
    from sonarhw_compare.plate.plate_profile import interval_text, value_text

    lines = [
        f"{one.key}: {value_text(one)}, 95 % {interval_text(one)}; before: {one.before:g}" for one in found.findings
    ]
    return lines + [f"{key}: stays {getattr(start, key):g}; {reason}" for key, reason in found.kept.items()]
