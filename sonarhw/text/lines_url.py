"""The URL of a device that prints text: `lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar`."""

import math
from dataclasses import dataclass
from urllib.parse import unquote

from sonarhw.errors import InputError
from sonarhw.text.line_format import UNITS, LineFormat, RangeUnit, check_pattern, pattern_format
from sonarhw.text.presets import PRESETS, preset_format

SCHEME = "lines"
FIRST_BAUD = 9600
_MOST_BAUD = 4_000_000
_KEYS = ("baud", "preset", "pattern", "unit", "turn", "zero", "no_echo", "step")
_GUESS = "`sonarhw ports --guess` proposes one"


@dataclass(frozen=True)
class LinesUrl:
    """The settings in a `lines:` URL."""

    url: str
    port: str
    preset: str  # empty: a pattern of the user
    pattern: str
    baud: int
    unit: str | None
    no_echo: tuple[float, ...] | None
    sign: float  # 1: printed angles grow counter-clockwise, -1: clockwise
    zero: float  # rad, printed angle at which the turntable angle is 0
    step: float | None  # rad between two readings of a device that prints no angle

    @property
    def board(self) -> str:
        """Name of the board profile that suits the usual sensor, empty if unknown."""
        return PRESETS[self.preset].board if self.preset else ""

    def make_format(self) -> LineFormat:
        """Return the format of the lines. Raises InputError for an invalid pattern."""
        if self.preset:
            return preset_format(PRESETS[self.preset], self.unit, self.no_echo)
        scale = None if self.unit is None else UNITS[self.unit]
        return pattern_format(check_pattern(self.pattern, self.step is None), RangeUnit(scale, self.no_echo or ()))

    def turntable_angle(self, heading_deg: float) -> float:
        """Return the turntable angle at a printed angle, rad."""
        return self.sign * (math.radians(heading_deg) - self.zero)


def read_lines_url(url: str) -> LinesUrl:
    """Return the settings in a URL. Its query is percent-decoded, and `+` stays. Raises InputError."""
    port, _, query = url.removeprefix(f"{SCHEME}:").partition("?")
    if not port:
        raise InputError(f"{url}: port missing; expected 'lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar'")
    values = _values(url, query)
    try:
        read = LinesUrl(
            url=url,
            port=port,
            preset=values.get("preset", ""),
            pattern=values.get("pattern", ""),
            baud=_baud(values.get("baud", str(FIRST_BAUD))),
            unit=_one_of("unit", values["unit"], tuple(UNITS)) if "unit" in values else None,
            no_echo=_numbers("no_echo", values["no_echo"]) if "no_echo" in values else None,
            sign=-1.0 if _one_of("turn", values.get("turn", "ccw"), ("ccw", "cw")) == "cw" else 1.0,
            zero=math.radians(_degrees("zero", values.get("zero", "0"))),
            step=_step(values["step"]) if "step" in values else None,
        )
        _check_format(read)
    except InputError as error:
        raise InputError(f"{url}: {error}") from error
    return read


def _values(url: str, query: str) -> dict[str, str]:
    pairs = [part.partition("=") for part in query.split("&") if part]
    values = {unquote(key): unquote(value) for key, _, value in pairs}
    if unknown := sorted(set(values) - set(_KEYS)):
        raise InputError(f"{url}: unknown key {', '.join(unknown)}; known: {', '.join(_KEYS)}")
    if len(values) < len(pairs):
        raise InputError(f"{url}: a key occurs twice; give each key once")
    return values


def _check_format(read: LinesUrl) -> None:
    if bool(read.preset) == bool(read.pattern):
        which = "give only one of them" if read.preset else f"{', '.join(PRESETS)}; {_GUESS}"
        raise InputError(f"expected preset=NAME or pattern=REGEX: {which}")
    if read.preset:
        _one_of("preset", read.preset, tuple(PRESETS))
        prints_angle = PRESETS[read.preset].prints_angle
    else:
        prints_angle = "heading_deg" in check_pattern(read.pattern, read.step is None).groupindex
    if prints_angle and read.step is not None:
        raise InputError("step: the device prints its angle; remove step")
    if not prints_angle and read.step is None:
        raise InputError("the device prints no angle: add step=DEGREES, the turn of the table between two readings")
    if read.unit and any(f"(?P<range_{unit}>" in read.pattern for unit in UNITS):
        raise InputError("unit: the pattern names the unit already; remove one of them")


def _one_of(key: str, value: str, known: tuple[str, ...]) -> str:
    if value not in known:
        raise InputError(f"{key}={value}: expected {', '.join(known)}")
    return value


def _baud(text: str) -> int:
    if not (text.isascii() and text.isdecimal()) or not 0 < int(text) <= _MOST_BAUD:
        raise InputError(f"baud={text}: expected a baud rate, such as 9600 or 115200")
    return int(text)


def _degrees(key: str, text: str) -> float:
    value = _number(key, text)
    if abs(value) > 360:
        raise InputError(f"{key}={text}: expected degrees from -360 to 360")
    return value


def _step(text: str) -> float:
    if not 0 < (degrees := _degrees("step", text)) <= 180:
        raise InputError(f"step={text}: expected degrees above 0, up to 180; for a clockwise turn add turn=cw")
    return math.radians(degrees)


def _numbers(key: str, text: str) -> tuple[float, ...]:
    return tuple(_number(key, part) for part in text.split(","))


def _number(key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{key}={text}: expected a number")
    return value
