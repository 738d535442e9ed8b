"""Printed numbers, and the readings they are."""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from dataclasses import field as of_dataclass
from typing import Final, Literal

from sonarhw.text.words import ANGLE_UNITS, RANGE_UNITS, STEP, is_no_echo

MOST_HEADING = 720.0  # degrees, either side of 0; larger ones are not angles of a turntable
MOST_RANGE = 700.0  # m; larger ones do not fit into the frames of a log
_SMALLEST_UNIT = min(RANGE_UNITS.values())  # m
# stricter than `float`, which accepts 1_0 and the digits of all scripts
NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


@dataclass(frozen=True)
class Printed:
    """The numbers of one reading."""

    heading: float | None  # degrees, as printed; None: the device prints no angle
    numbers: tuple[float, ...]  # ranges of the echoes as printed; empty: no echo
    scale: float | None = 1.0  # m, unit of the ranges; None: not stated
    restarted: bool = False  # whether a banner or another text was printed since the reading before
    time: float | None = None  # s, as printed; None: the text states none
    pose: tuple[float, float, float] | None = None  # of a robot: x, y (m) and heading (rad); None: none is stated
    degrees_assumed: bool = of_dataclass(default=False, compare=False)  # whether nothing states the unit of the heading

    @property
    def ranges(self) -> tuple[float, ...]:
        """Ranges of the echoes, m, nearest first. The unit must be known, if there are any."""
        assert self.scale is not None or not self.numbers
        return tuple(sorted(number * (self.scale or 1.0) for number in self.numbers))


HEADER: Final = "header"  # instead of readings: a line that names the columns of the following lines
PART: Final = "part"  # a line that begins or continues a reading on several lines
Read = tuple[Printed, ...] | Literal["header", "part"] | None  # None: not a reading


@dataclass(frozen=True)
class Units:
    """What the user states about the numbers."""

    range: str | None = None  # of RANGE_UNITS; None: as the text states
    angle: str | None = None  # of ANGLE_UNITS; None: as the text states, else degrees
    no_echo: tuple[float, ...] = ()  # numbers that stand for no echo
    step: float | None = None  # degrees between two readings without an angle, or of one step
    scale: float | None = None  # m, unit of the ranges as a number; None: `range`

    def printed(
        self, heading: float | None, texts: Sequence[str | None], range_unit: str | None, offset: float = 0.0
    ) -> Printed | None:
        """Return a reading of a heading (degrees) and texts of ranges; None if a scanner cannot print them.

        A range of 0 or less, or of `no_echo`, means no echo.
        """
        unit = self.range or range_unit
        try:
            values = [value for text in texts if (value := _range_value(text, unit)) is not None]
        except ValueError:
            return None
        scale = self.scale if self.scale or unit is None else RANGE_UNITS[unit]
        if heading is not None and not abs(heading) <= MOST_HEADING:
            return None
        echoes = tuple(value for value in values if value > 0 and value not in self.no_echo)
        if any(value * (scale or _SMALLEST_UNIT) > MOST_RANGE for value in echoes):
            return None
        return Printed(None if heading is None else heading + offset, echoes, scale)

    def heading(self, text: str, unit: str | None) -> float:
        """Return an angle, degrees. Raises ValueError."""
        stated = self.angle or unit or "deg"
        if stated == STEP:
            return number_of(text) * (self.step or 0.0)
        return number_of(text) * ANGLE_UNITS[stated]


def _range_value(text: str | None, unit: str | None) -> float | None:
    """Return a printed range; None if the text stands for no echo. Raises ValueError.

    Small units have no thousandths: in millimetres, 1,234 is 1234.
    """
    if text is None or is_no_echo(text):
        return None
    value = number_of(text)
    if unit in ("mm", "us") and _ONE_GROUP.fullmatch(text.strip()):
        value *= 1000
    return value if math.isfinite(value) else None


_ONE_GROUP = re.compile(r"[1-9]\d{0,2}[.,]\d{3}", re.ASCII)
_MARKS = ((",", r"\."), (r"\.", ","), ("['’]", "[.,]"))  # of thousands and decimals
GROUPS_TEXT = "|".join(rf"[1-9]\d{{0,2}}(?:{mark}\d{{3}})+(?:{point}\d+)?" for mark, point in _MARKS)
# thousands: 1,234.5 and 1.234,5 and 1,234,567 and 1 234 and 1'234
_GROUPED = re.compile(
    r"[+-]?(?:[1-9]\d{0,2}(?:,\d{3})+\.\d+|[1-9]\d{0,2}(?:\.\d{3})+,\d+|[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})+"
    r"|[1-9]\d{0,2}(?:[ '’]\d{3})+(?:[.,]\d+)?)",
    re.ASCII,
)


def numbers_of(texts: Sequence[str]) -> list[float]:
    """Return a column of printed numbers. Whole ones beside 1,234 show that it is 1234. Raises ValueError."""
    others = [text for text in texts if not _ONE_GROUP.fullmatch(text) and number_of(text)]
    thousands = bool(others) and all(map(str.isdigit, others))
    return [number_of(text) * (1000 if thousands and _ONE_GROUP.fullmatch(text) else 1) for text in texts]


_HEX = re.compile(r"0[xX][0-9A-Fa-f]{1,8}")


def number_of(text: str) -> float:
    """Return a printed number: decimal with a point or comma, in thousands, or hexadecimal. Raises ValueError."""
    plain = text.strip()
    if _HEX.fullmatch(plain):
        return float(int(plain, 16))
    if grouped := _GROUPED.fullmatch(plain):
        marks = [char for char in plain if char in ",."]
        point = "" if grouped[1] or not marks else marks[-1]  # of the decimals
        plain = "".join("." if char == point else char for char in plain if char in f"+-{point}" or char.isdigit())
    plain = plain.replace(",", ".")
    if not NUMBER.fullmatch(plain):
        raise ValueError(text)
    return float(plain)


def is_number(text: str) -> bool:
    """Return whether a text is a printed number."""
    try:
        number_of(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class LineFormat:
    """How the device prints a reading."""

    read: Callable[[str], Read]  # of a line without its end; may remember the line before
    ends: re.Pattern[bytes]  # what separates lines
    fits: Callable[[str], bool]  # whether a line is a reading by itself, or its first line; remembers nothing
    close: Callable[[], None] = lambda: None  # ends the process that matches lines, if any


LINE_ENDS = re.compile(rb"[\r\n\0]+")


def ends_of(characters: str) -> re.Pattern[bytes]:
    """Return what separates readings: these characters, and a NUL."""
    return re.compile(b"[" + re.escape(characters.encode()) + rb"\0]+")
