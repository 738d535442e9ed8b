"""Changes of board profiles as text: a changed value keeps its former value and comment in a comment."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import tomlkit
from sonarhw_sim.board.profile import Board, OwnBodyPart, parse_board
from tomlkit.exceptions import TOMLKitError

from sonarhw.errors import InputError

Z95 = 1.96  # standard deviations to each side of a 95 % interval


@dataclass(frozen=True)
class CalibratedValue:
    """A value of a profile that a calibration has determined."""

    key: str  # of the profile
    value: float
    low: float  # 95 % interval
    high: float
    before: float
    unit: str

    @property
    def text(self) -> str:
        """The value with the decimals of its interval."""
        return f"{self.value:z.{self._digits}f}"

    @property
    def interval_text(self) -> str:
        """The 95 % interval with the decimals of its width, and the unit."""
        return f"{self.low:z.{self._digits}f} to {self.high:z.{self._digits}f} {self.unit}".rstrip()

    @property
    def _digits(self) -> int:
        """The decimals with which the interval has two significant digits."""
        return max(0, 1 - math.floor(math.log10((self.high - self.low) / 2)))


def calibrated_profile(
    start: Board,
    name: str,
    header: Sequence[str],
    values: Sequence[CalibratedValue],
    kept: Mapping[str, str],
    own_body: Sequence[OwnBodyPart] = (),
) -> Board:
    """Return the profile `start` with another name and these values; an empty own body stays.

    Comments state the 95 % intervals and the former values. The `header` and the reasons for the `kept` keys are at the
    top. Raises InputError if the text of the profile cannot be changed.
    """

    def change(profile: Any) -> None:
        for one in values:
            set_marked(profile, one.key, float(one.text), one.before, f"calibrated, 95 % {one.interval_text}")
        if own_body:
            profile["own_body"] = _tables(own_body)

    lines = [*header, *(f"# Kept: {key}; {reason}." for key, reason in kept.items())]
    return parse_board(below_header(lines, _changed_text(start, name, change), start.name), f"profile {name!r}")


def changed_profile(start: Board, name: str, change: Callable[[Any], None]) -> Board:
    """Return the profile `start` with another name after `change` of its TOML document.

    Raises InputError if the text of the profile cannot be changed.
    """
    return parse_board(_changed_text(start, name, change), f"profile {name!r}")


def _changed_text(start: Board, name: str, change: Callable[[Any], None]) -> str:
    try:
        profile: Any = tomlkit.parse(start.text)
        profile["name"] = name
        change(profile)
        return tomlkit.dumps(profile)
    except TOMLKitError as error:
        raise InputError(f"the board profile cannot be changed: {error}; choose another profile") from error


def _tables(own_body: Sequence[OwnBodyPart]) -> Any:
    parts = tomlkit.aot()
    for part in own_body:
        table = tomlkit.table()
        table.update(part.model_dump())
        parts.append(table)
    return parts


def set_marked(table: Any, key: str, value: float, before: float, mark: str) -> None:
    """Set a value with a comment: the mark, and the former value with its own comment."""
    said = table[key].trivia.comment.lstrip("# ") if key in table else ""
    table[key] = value
    table[key].comment(f"{mark}; before: {before:g}" + (f" ({said})" if said else ""))
    table[key].trivia.comment_ws = "  "


def below_header(header: Sequence[str], text: str, before: str) -> str:
    """Return the text of a profile below a new header; its old one is quoted as that of profile `before`."""
    lines = text.splitlines()
    behind = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    quoted = [f"#   {line.removeprefix('#').removeprefix(' ')}".rstrip() for line in lines[:behind]]
    if quoted:
        quoted.insert(0, f"# Header of profile {before!r}, for its own values only:")
    return "\n".join([*header, *quoted, *lines[behind:]]) + "\n"
