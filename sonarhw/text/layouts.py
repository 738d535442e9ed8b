"""Layouts of text: how a device prints its readings, as a pattern or a preset."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from sonarhw.errors import InputError, did_you_mean
from sonarhw.text.numbers import LINE_ENDS, LineFormat, Read, Units, ends_of
from sonarhw.text.patterns import FIELD, MatchingProcess, check_regex, parse_template, regex_format, template_format
from sonarhw.text.tables import ColumnNames, csv_format, json_format
from sonarhw.text.words import ANGLE_UNITS, RANGE_UNITS, STEP, plain_text

_RADAR = re.compile(r"(?P<heading_deg>-?\d{1,3})[,*](?P<range>-?\d{1,5})", re.ASCII)
_RADAR_ENDS = re.compile(rb"[.#\0]")
ANGLE_DISTANCE = re.compile(
    r"angle\W*?(?P<heading_deg>-?\d+(?:\.\d+)?)\s*(?:°|deg(?:rees?|s)?\b)?\W*?"
    r"(?:distance|dist|range)\W*?(?P<range>-?\d+(?:\.\d+)?|out of range|no echo|nan|inf|timeout)"
    r"\s*(?P<unit>mm|cm|m|in|inch|inches|ft|feet|yd|yards?|us)?\W*",
    re.ASCII | re.IGNORECASE,
)
_MAXBOTIX = re.compile(r"R(?P<range>\d{3,4})(?P<flag> P[01])?", re.ASCII)


_MILLIMETRES = (5000.0, 9999.0)  # of a MaxBotix rangefinder without an echo


def maxbotix_format(units: Units) -> LineFormat:
    """Return the format of MaxBotix rangefinders: four digits are millimetres, three with a flag P inches."""

    def read(line: str) -> Read:
        match = _MAXBOTIX.fullmatch(line.strip())
        if match is None:
            return None
        digits = match["range"]
        silent = _MILLIMETRES if len(digits) == 4 and not units.no_echo else units.no_echo
        unit = "mm" if len(digits) == 4 else "in" if match["flag"] else None
        printed = replace(units, no_echo=silent).printed(None, [digits], unit)
        return None if printed is None else (printed,)

    return LineFormat(read, LINE_ENDS, lambda line: bool(_MAXBOTIX.fullmatch(line)))


@dataclass(frozen=True)
class BinaryFrame:
    """A message of a sensor that prints no text: `header`, two bytes of the range, and the sum of all bytes before.

    A message without a header has no sum either; its ranges are then within `limits`.
    """

    header: bytes
    limits: tuple[int, int] = (0, 65535)
    request: bytes = b""  # that the sensor answers with a message; empty: it sends by itself

    @property
    def size(self) -> int:
        """Bytes of a message."""
        return len(self.header) + 3 if self.header else 2

    def number(self, message: bytes) -> int | None:
        """Return the range in a message; None for other bytes."""
        start = len(self.header)
        number = int.from_bytes(message[start : start + 2], "big")
        summed = not self.header or sum(message[:-1]) & 0xFF == message[-1]
        inside = self.limits[0] <= number <= self.limits[1]
        return number if message.startswith(self.header) and summed and inside else None


@dataclass(frozen=True)
class Preset:
    """A format, and what the devices that print it have in common."""

    example: str
    make: Callable[[Units], LineFormat] | BinaryFrame
    unit: str | None = None  # of the range; None: as printed
    no_echo: tuple[float, ...] = ()  # in that unit; 0 and negative numbers always mean no echo
    board: str = ""  # name of the board profile of the usual sensor
    prints_angle: bool = True


PRESETS = {
    "arduino-radar": Preset("90,23.", lambda units: regex_format(_RADAR, units, _RADAR_ENDS), "cm", board="hc-sr04"),
    "angle-distance": Preset(
        "Angle: 90 Distance: 23 cm", lambda units: regex_format(ANGLE_DISTANCE, units), board="hc-sr04"
    ),
    "maxbotix": Preset("R0123", lambda units: maxbotix_format(units), prints_angle=False),
    "a02yyuw": Preset("the bytes FF H L SUM", BinaryFrame(b"\xff"), "mm", prints_angle=False),
    "urm37": Preset(
        "the bytes 22 H L SUM", BinaryFrame(b"\x22", request=b"\x22\0\0\x22"), "cm", (65535.0,), prints_angle=False
    ),
    "us100": Preset("the bytes H L", BinaryFrame(b"", (20, 4600), b"\x55"), "mm", prints_angle=False),
    "jsonl": Preset('{"heading_deg": 90, "range_cm": 23}', json_format),
    "csv": Preset("heading_deg,range_cm, then 90,23", csv_format),
}


@dataclass(frozen=True)
class Layout:
    """How a device prints, as the query of a URL or the options of an import state it."""

    preset: str = ""  # one of PRESETS; empty: a pattern
    pattern: str = ""
    unit: str | None = None  # of RANGE_UNITS
    angle: str | None = None  # of ANGLE_UNITS
    no_echo: tuple[float, ...] | None = None
    step: float | None = None  # degrees
    ends: str = ""  # characters between readings; empty: line ends
    columns: ColumnNames | None = None  # of the preset csv; None: by the words in the header
    scale: float | None = None  # m, unit of the ranges as a number

    @property
    def board(self) -> str:
        """Name of the board profile that suits the usual sensor, empty if unknown."""
        return PRESETS[self.preset].board if self.preset else ""

    @property
    def is_regex(self) -> bool:
        """Whether the pattern is a regular expression."""
        return "(?P<" in self.pattern or not FIELD.search(self.pattern)

    @property
    def turns_itself(self) -> bool:
        """Whether angles whose name says clockwise are reversed while they are read."""
        return self.preset in ("csv", "jsonl")

    @property
    def prints_angle(self) -> bool:
        """Whether readings have angles."""
        return self._properties()[0]

    @property
    def example(self) -> str:
        """A line that the layout reads, or the pattern."""
        return PRESETS[self.preset].example if self.preset else self.pattern

    @property
    def frame(self) -> BinaryFrame | None:
        """The messages of a sensor that prints no text; None for text."""
        make = PRESETS[self.preset].make if self.preset else None
        return make if isinstance(make, BinaryFrame) else None

    @property
    def units(self) -> Units:
        """What the layout states about the numbers."""
        preset = PRESETS[self.preset] if self.preset else None
        no_echo = preset.no_echo if preset and self.no_echo is None else self.no_echo or ()
        unit = self.unit or (preset.unit if preset else None)
        return Units(unit, self.angle, no_echo, self.step, self.scale)

    def make_format(self, matching: "MatchingProcess | None" = None) -> LineFormat:
        """Return a fresh format of the lines. Raises InputError for an invalid pattern. `matching` matches lines."""
        units = self.units
        if self.columns is not None:
            return csv_format(units, self.columns)
        if self.preset:
            make = PRESETS[self.preset].make
            assert not isinstance(make, BinaryFrame)
            return make(units)
        ends = ends_of(self.ends) if self.ends else LINE_ENDS
        if self.is_regex:
            return regex_format(check_regex(self.pattern), units, ends, matching)
        return template_format(parse_template(self.pattern), units, ends)

    def check(self) -> None:
        """Raise InputError for settings that do not fit together."""
        if bool(self.preset) == bool(self.pattern):
            which = "give only one of them" if self.preset else f"{', '.join(PRESETS)}; {_GUESS}"
            raise InputError(f"expected preset=NAME or pattern=PATTERN: {which}")
        if self.preset and self.preset not in PRESETS:
            hint = did_you_mean(self.preset, PRESETS)
            raise InputError(f"preset={self.preset}: expected {', '.join(PRESETS)}{hint}")
        if self.preset and self.ends:
            raise InputError("ends: only with a pattern; remove it")
        prints_angle, needs_step, states_unit = self._properties()
        if prints_angle and not needs_step and self.step is not None and self.preset not in ("csv", "jsonl"):
            raise InputError("step: the device prints its angle; remove step")
        if not prints_angle and self.step is None:
            raise InputError(
                "the device prints no angle: add step=DEGREES, the turn of the table between two readings, or from one "
                "sensor to the next"
            )
        if needs_step and self.step is None:
            raise InputError("the angle is counted in steps: add step=DEGREES, the turn of one step")
        if self.unit and states_unit:
            raise InputError("unit: the pattern names the unit already; remove one of them")

    def _properties(self) -> tuple[bool, bool, bool]:
        """Return whether readings have angles, whether these are steps, and whether the pattern states the unit."""
        if self.preset:
            return PRESETS[self.preset].prints_angle, self.angle == STEP, False
        if self.is_regex:
            groups = check_regex(self.pattern).groupindex
            return any(name.startswith("heading") for name in groups), False, any("range_" in name for name in groups)
        template = parse_template(self.pattern)
        return template.prints_angle, template.has_steps or self.angle == STEP, template.states_unit

    def with_unit(self, unit: str) -> "Layout":
        """Return the layout with this unit of the ranges."""
        return replace(self, unit=unit)


_GUESS = "`sonarhw ports --guess` proposes one"


def layout_of(values: Mapping[str, str]) -> Layout:
    """Return the layout that the keys of a URL, or the options of an import, state. Raises InputError."""
    layout = Layout(
        preset=values.get("preset", ""),
        pattern=plain_text(values.get("pattern", "")),
        unit=one_of("unit", values["unit"], tuple(RANGE_UNITS)) if "unit" in values else None,
        angle=one_of("angle", values["angle"], (*ANGLE_UNITS, STEP)) if "angle" in values else None,
        no_echo=_numbers("no_echo", values["no_echo"]) if "no_echo" in values else None,
        step=_step(values["step"]) if "step" in values else None,
        ends=values.get("ends", ""),
    )
    layout.check()
    return layout


def one_of(key: str, value: str, choices: tuple[str, ...]) -> str:
    """Return a value. Raises InputError unless it is one of the choices."""
    if value not in choices:
        raise InputError(f"{key}={value}: expected {', '.join(choices)}{did_you_mean(value, choices)}")
    return value


def degrees_of(key: str, text: str) -> float:
    """Return degrees. Raises InputError."""
    value = _number_of_parameter(key, text)
    if abs(value) > 360:
        raise InputError(f"{key}={text}: expected degrees from -360 to 360")
    return value


def _step(text: str) -> float:
    if not 0 < (degrees := degrees_of("step", text)) <= 180:
        raise InputError(f"step={text}: expected degrees above 0, up to 180; for a clockwise turn add turn=cw")
    return degrees


def _numbers(key: str, text: str) -> tuple[float, ...]:
    return tuple(_number_of_parameter(key, part) for part in text.split(","))


def _number_of_parameter(key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{key}={text}: expected a number")
    return value
