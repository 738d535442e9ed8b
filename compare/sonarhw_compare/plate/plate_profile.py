"""The profile that a calibration with plates writes: values with their intervals, and the scans."""

import math
from collections.abc import Sequence
from typing import Any

import tomlkit
from sonarhw_sim.board.profile import Board, parse_board
from tomlkit.exceptions import TOMLKitError

from sonarhw.errors import InputError
from sonarhw.harmless_text import harmless
from sonarhw_compare.fit.findings import below_header
from sonarhw_compare.plate.plate_calibration import PlateCalibration, PlateFinding
from sonarhw_compare.plate.plate_readings import PlateReadings


def plate_profile(start: Board, found: PlateCalibration, scans: Sequence[PlateReadings], name: str) -> Board:
    """Return the profile `start` with another name and the values found; all else is unchanged.

    Comments state the 95 % intervals and the former values, and name the scans. Raises InputError if the text of the
    profile cannot be changed.
    """
    try:
        profile: Any = tomlkit.parse(start.text)
        profile["name"] = name
        for finding in found.findings:
            set_calibrated(profile, finding)
        text = below_header(_header(start, found, scans), tomlkit.dumps(profile), start.name)
    except TOMLKitError as error:
        raise InputError(f"the board profile cannot be changed: {error}; choose another profile") from error
    return parse_board(text, f"profile {name!r}")


def interval_text(finding: PlateFinding) -> str:
    """Return the 95 % interval with the decimals of its width, and the unit."""
    digits = _digits(finding)
    return f"{finding.low:z.{digits}f} to {finding.high:z.{digits}f} {finding.unit}".rstrip()


def value_text(finding: PlateFinding) -> str:
    """Return the value with the decimals of its interval."""
    return f"{finding.value:z.{_digits(finding)}f}"


def _digits(finding: PlateFinding) -> int:
    """Return the decimals with which an interval has two significant digits."""
    return max(0, 1 - math.floor(math.log10((finding.high - finding.low) / 2)))


def set_calibrated(profile: Any, finding: PlateFinding) -> None:
    """Set a value and mark it as calibrated; the comment of the old value is kept beside the old value."""
    key = finding.key
    said = profile[key].trivia.comment.lstrip("# ") if key in profile else ""
    profile[key] = float(value_text(finding))
    before = f"before: {finding.before:g}" + (f" ({said})" if said else "")
    profile[key].comment(f"calibrated, 95 % {interval_text(finding)}; {before}")
    profile[key].trivia.comment_ws = "  "


def _header(start: Board, found: PlateCalibration, scans: Sequence[PlateReadings]) -> list[str]:
    keys = ", ".join(finding.key for finding in found.findings) or "no value"
    lines = [f"# Calibrated by `sonarhw calibrate` with a plate, beginning with profile {start.name!r}: {keys}."]
    lines += [f"#   {harmless(scan.name)}: plate at {scan.distance:g} m" for scan in scans]
    lines += [f"# Kept: {key}; {reason}." for key, reason in found.kept.items()]
    return lines
