"""Devices that print text: line formats and presets, their recognition, and `lines:` URLs."""

import json
import math
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal
from urllib.parse import unquote

from sonarhw.errors import InputError
from sonarhw.link import READ_PATIENCE, Link, PortFinder
from sonarhw.plugins.device_plugin import DeviceIdentity, DevicePlugin, Measurement
from sonarhw.readings import ScanOrder

# what a device prints on a line: a pattern, CSV or JSON


UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}  # m
MOST_HEADING = 720.0  # degrees, either side of 0; larger ones are not angles of a turntable
MOST_RANGE = 700.0  # m; larger ones do not fit into the frames of a log
_HEADINGS = ("heading", "angle", "bearing", "azimuth", "theta", "servo", "pan", "deg", "degrees", "a")
_RANGES = ("range", "distance", "dist", "d", "r", "m", "cm", "mm")
_UNIT_WORDS = {**UNITS, "metres": 1.0, "meters": 1.0, "inch": 0.0254, "inches": 0.0254, "centimeters": 0.01}
_NO_ECHO = ("out of range", "no echo", "none", "null", "nan", "inf", "timeout", "-", "--", "---")
# stricter than `float`, which accepts 1_0 and the digits of all scripts
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_SEPARATOR = re.compile(r"[,;\t]")


@dataclass(frozen=True)
class Printed:
    """The numbers of one line."""

    heading: float | None  # degrees, as printed; None: the device prints no angle
    range: float | None  # m; None: no echo
    restarted: bool = False  # whether a banner or another text was printed since the reading before


HEADER: Final = "header"  # instead of `Printed`: a line that names the columns of the following lines


@dataclass(frozen=True)
class RangeUnit:
    """Unit of the printed ranges, and the numbers that stand for no echo."""

    scale: float | None  # m; None: as the line or its header states, else centimetres
    no_echo: tuple[float, ...] = ()

    def printed(self, heading: str | None, distance: str | None, stated: float | None = None) -> Printed | None:
        """Return the numbers of a line; None if they are not numbers that a scanner can print.

        A `distance` of 0 or less, or of `no_echo`, means no echo. `stated` is the unit that the line states, m.
        """
        try:
            angle = None if heading is None else _number(heading)
            value = _range_value(distance)
        except ValueError:
            return None
        scale = next(scale for scale in (self.scale, stated, UNITS["cm"]) if scale is not None)
        if angle is not None and not abs(angle) <= MOST_HEADING:
            return None
        if value is None or value <= 0 or value in self.no_echo:
            return Printed(angle, None)
        return Printed(angle, value * scale) if value * scale <= MOST_RANGE else None


def _range_value(text: str | None) -> float | None:
    """Return a printed range; None if the text stands for no echo. Raises ValueError."""
    if text is None or text.strip().lower() in _NO_ECHO:
        return None
    value = _number(text)
    return value if math.isfinite(value) else None


def _number(text: str) -> float:
    if not _NUMBER.fullmatch(text.strip()):
        raise ValueError(text)
    return float(text)


@dataclass(frozen=True)
class LineFormat:
    """How the device prints a reading."""

    read: Callable[[str], Printed | Literal["header"] | None]  # of a line without its end; None: not a reading
    ends: re.Pattern[bytes]  # what separates lines


LINE_ENDS = re.compile(rb"[\r\n\0]+")


Groups = dict[str, str | None]  # the texts of the named groups of a match


def pattern_format(
    pattern: re.Pattern[str],
    unit: RangeUnit,
    ends: re.Pattern[bytes] = LINE_ENDS,
    groups_in: Callable[[str], Groups | None] | None = None,
) -> LineFormat:
    """Return the format of a regular expression with the groups of `check_pattern`, which matches a whole line.

    `groups_in` matches a line, in place of the pattern itself.
    """
    groups = set(pattern.groupindex)
    range_group = next(group for group in groups if group.partition("_")[0] == "range")
    named = UNITS.get(range_group.partition("_")[2])

    def match_here(line: str) -> Groups | None:
        match = pattern.fullmatch(line)
        return None if match is None else match.groupdict()

    matched = groups_in or match_here

    def read(line: str) -> Printed | None:
        texts = matched(line)
        if texts is None:
            return None
        word = texts.get("unit")
        stated = named if word is None else _UNIT_WORDS.get(word.lower())
        return unit.printed(texts.get("heading_deg"), texts[range_group], stated)

    return LineFormat(read, ends)


def check_pattern(text: str, prints_angle: bool) -> re.Pattern[str]:
    """Return the compiled pattern. Raises InputError if it is invalid or lacks a group."""
    try:
        pattern = re.compile(text, re.ASCII)
    except (re.error, RecursionError, OverflowError) as error:
        raise InputError(f"pattern {text!r}: invalid regular expression: {error}") from error
    ranges = [group for group in pattern.groupindex if re.fullmatch("range(_m|_cm|_mm|_in)?", group)]
    if len(ranges) != 1:
        raise InputError(f"pattern {text!r}: expected one group (?P<range_cm>...), or range_m, range_mm, range_in")
    if prints_angle and "heading_deg" not in pattern.groupindex:
        raise InputError(f"pattern {text!r}: expected a group (?P<heading_deg>...); without an angle, add step=DEGREES")
    return pattern


_MATCHED_WITHIN = 1.0  # s for one line
_MOST_SLOW = 3  # lines one after another
# what the process executes: it ends within a match that takes too long, and when its input ends
_MATCH = """
import faulthandler, json, os, re, sys
nowhere = open(os.devnull, "w")
text, within = json.loads(sys.stdin.readline())
pattern = re.compile(text, re.ASCII)
for line in sys.stdin:
    faulthandler.dump_traceback_later(within, exit=True, file=nowhere)
    match = pattern.fullmatch(json.loads(line))
    faulthandler.cancel_dump_traceback_later()
    print(json.dumps(match and match.groupdict()), flush=True)
"""


class MatchingProcess:
    """Matches lines with a pattern of the user, in a process that ends if a match takes longer than 1 s.

    A match cannot be interrupted, and no other thread of its process runs meanwhile.
    """

    def __init__(self, pattern: str) -> None:
        self._pattern = pattern
        self._slow = 0  # newest lines, one after another, whose match took too long
        self._process: subprocess.Popen[str] | None = None

    def groups(self, line: str) -> Groups | None:
        """Return the groups of the line; None without a match.

        Raises TimeoutError if it takes too long, and InputError for the third such line one after another.
        """
        try:
            answer = self._answer(line)
        except OSError:
            answer = ""
        if answer:
            self._slow = 0
            groups: Groups | None = json.loads(answer)
            return groups
        self.close()
        self._slow += 1
        if self._slow >= _MOST_SLOW:
            raise InputError(
                f"pattern {self._pattern!r}: matching takes more than {_MATCHED_WITHIN:g} s for lines such as "
                f"{line[:_SHOWN]!r}; write it without a repetition within a repetition"
            )
        raise TimeoutError

    def close(self) -> None:
        """End the process. The next line starts it again."""
        process, self._process = self._process, None
        if process:
            process.kill()
            process.communicate()

    def _answer(self, line: str) -> str:
        """Return the answer to a line as JSON; empty if the process has ended."""
        if self._process is None:
            self._process = _started_matching()
            print(json.dumps((self._pattern, _MATCHED_WITHIN)), file=self._process.stdin, flush=True)
        assert self._process.stdout is not None
        print(json.dumps(line), file=self._process.stdin, flush=True)
        return self._process.stdout.readline()


def _started_matching() -> "subprocess.Popen[str]":
    hidden: dict[str, Any] = {"start_new_session": True}  # Ctrl-C in a terminal does not reach it
    if sys.platform == "win32":
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW}
    return subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", _MATCH],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        encoding="ascii",
        **hidden,
    )


def csv_format(unit: RangeUnit) -> LineFormat:
    """Return the format of lines of numbers after a header line, which names their columns.

    Columns are separated by commas, semicolons, tabs or spaces.

    Before the header, a line of exactly two numbers is an angle and a range.
    """
    columns: _Columns = (0, 1, None)
    count = 2

    def read(line: str) -> Printed | Literal["header"] | None:
        nonlocal columns, count
        parts = _SEPARATOR.split(line) if _SEPARATOR.search(line) else line.split()
        cells = [cell.strip().strip('"') for cell in parts]
        if header := _columns(cells):
            columns, count = header, len(cells)
            return HEADER
        heading, distance, scale = columns
        return unit.printed(cells[heading], cells[distance], scale) if len(cells) == count else None

    return LineFormat(read, LINE_ENDS)


def json_format(unit: RangeUnit) -> LineFormat:
    """Return the format of JSON objects, one a line, with keys for angle and range."""

    def read(line: str) -> Printed | None:
        if not line.startswith("{"):
            return None
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            return None
        columns = _columns(record)
        if columns is None:
            return None
        values = [*record.values()]
        heading, distance, scale = values[columns[0]], values[columns[1]], columns[2]
        if not _is_number(heading) or not (distance is None or _is_number(distance) or isinstance(distance, str)):
            return None
        return unit.printed(str(heading), None if distance is None else str(distance), scale)

    return LineFormat(read, LINE_ENDS)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


_Columns = tuple[int, int, float | None]  # indices of angle and range, and the unit in the name of the range, m


def _columns(names: Iterable[str]) -> _Columns | None:
    """Return the columns with these names; None if no name, or more than one, is that of an angle or of a range."""
    words = [re.findall(r"[a-z]+", name.lower()) for name in names]
    heading, distance = _index(words, _HEADINGS), _index(words, _RANGES)
    if heading is None or distance is None:
        return None
    return heading, distance, _UNIT_WORDS.get(words[distance][-1])


def _index(words: list[list[str]], names: tuple[str, ...]) -> int | None:
    """Return the index of the column whose name starts with one of `names`, the earliest of them that occurs."""
    for name in names:
        indices = [index for index, column in enumerate(words) if column[:1] == [name]]
        if indices:
            return indices[0] if len(indices) == 1 else None
    return None


MOST_LINE = 400  # bytes; more without the end of a line are noise
MOST_PAUSE = 1.25  # s within a line: longer than the 1 s that pulseIn() waits for an echo, shorter than a bootloader
_SHOWN = 60  # characters of an example
_CUT = "0123456789.-+"  # characters that may be missing at the start of a number
_NUMBERS_ONLY = re.compile(r"[\d.,;:*+\-\s]*", re.ASCII)


# kinds of lines that are no readings
HALF_LINES = "half lines"  # the first line after opening, and lines with missing characters
OTHER_TEXT = "lines of other text"  # banners, messages
SLOW = "lines that take more than 1 s to match"
NOISE = "noise"  # lines with bytes that are not text


class LineDecoder:
    """Splits the bytes of a device into lines, and decodes the readings in them. It has no port and no clock."""

    def __init__(self, line_format: LineFormat) -> None:
        self.ignored = Counter({HALF_LINES: 0, OTHER_TEXT: 0, NOISE: 0})  # lines
        self.readings = 0
        self.example = ""  # newest text that was not a reading
        self._format = line_format
        self._rest = b""
        self._paused = 0.0  # s since the newest byte
        self._cut = True  # whether the start of the line may be missing
        self._text = False  # whether another text was printed since the newest reading

    def feed(self, data: bytes) -> list[Printed]:
        """Return the readings that these bytes complete."""
        self._paused = 0.0
        *whole, self._rest = self._format.ends.split(self._rest + data)
        decoded = [line for raw in whole if (line := self._decode(raw))]
        if len(self._rest) > MOST_LINE:
            text = _text_of(self._rest)
            self._rest, self._cut = b"", True
            if text is None:
                self.ignored[NOISE] += 1
            else:
                self._note_text(text, cut=False)
        return decoded

    def idle(self, seconds: float) -> None:
        """Handle a time without bytes. After a long one, the line in progress is incomplete: its end was lost."""
        self._paused += seconds
        if self._paused > MOST_PAUSE and self._rest:
            self._rest = b""
            self.ignored[HALF_LINES] += 1

    def lost(self) -> None:
        """Handle a loss of bytes."""
        self._rest, self._cut = b"", True

    def _decode(self, raw: bytes) -> Printed | None:
        cut, self._cut = self._cut, False
        line = _text_of(raw)
        if line is None:
            self.ignored[NOISE] += 1
            return None
        if not line:
            return None
        try:
            read = self._format.read(line)
        except TimeoutError:
            self.ignored[SLOW] += 1
            return None
        if isinstance(read, str):  # a header
            self._text = self.readings > 0
            return None
        if read is None or (cut and self._may_be_cut(line)):
            self._note_text(line, cut)
            return None
        restarted, self._text = self._text, False
        self.readings += 1
        return replace(read, restarted=restarted)

    def _may_be_cut(self, line: str) -> bool:
        """Return whether the line is still a reading with one more character before it: 90,23 may be cut to 0,23."""
        try:
            return any(isinstance(self._format.read(f"{character}{line}"), Printed) for character in _CUT)
        except TimeoutError:
            return True

    def _note_text(self, line: str, cut: bool) -> None:
        self.example = line[:_SHOWN]
        if cut or _NUMBERS_ONLY.fullmatch(line):
            self.ignored[HALF_LINES] += 1
        else:
            self._text = True
            self.ignored[OTHER_TEXT] += 1


def _text_of(raw: bytes) -> str | None:
    """Return a line as text without spaces at its ends; None if it is not text."""
    try:
        line = raw.decode("utf-8").strip()
    except UnicodeDecodeError:
        return None
    return line if line.replace("\t", " ").replace("\r", " ").replace("\n", " ").isprintable() else None


# the presets: formats of lines that many sketches and sensors print


_RADAR = re.compile(r"(?P<heading_deg>-?\d{1,3})[,*](?P<range>-?\d{1,5})", re.ASCII)
_RADAR_ENDS = re.compile(rb"[.#\0]")
_ANGLE_DISTANCE = re.compile(
    r"angle\W*?(?P<heading_deg>-?\d+(?:\.\d+)?)\s*(?:°|deg(?:rees?|s)?\b)?\W*?"
    r"(?:distance|dist|range)\W*?(?P<range>-?\d+(?:\.\d+)?|out of range|no echo|nan|inf|timeout)"
    r"\s*(?P<unit>mm|cm|m|in|inch|inches)?\W*",
    re.ASCII | re.IGNORECASE,
)
_MAXBOTIX = re.compile(r"R(?P<range>\d{3,4})", re.ASCII)


@dataclass(frozen=True)
class Preset:
    """A format, and what the devices that print it have in common."""

    example: str
    make: Callable[[RangeUnit], LineFormat]
    unit: str | None = None  # of the range; None: as printed, else centimetres
    no_echo: tuple[float, ...] = ()  # in that unit; 0 and negative numbers always mean no echo
    board: str = ""  # name of the board profile of the usual sensor
    prints_angle: bool = True


PRESETS = {
    "arduino-radar": Preset("90,23.", lambda unit: pattern_format(_RADAR, unit, _RADAR_ENDS), "cm", board="hc-sr04"),
    "angle-distance": Preset(
        "Angle: 90 Distance: 23 cm", lambda unit: pattern_format(_ANGLE_DISTANCE, unit), board="hc-sr04"
    ),
    "maxbotix": Preset(
        "R0123", lambda unit: pattern_format(_MAXBOTIX, unit), "mm", (5000.0, 9999.0), prints_angle=False
    ),
    "jsonl": Preset('{"heading_deg": 90, "range_cm": 23}', json_format),
    "csv": Preset("heading_deg,range_cm, then 90,23", csv_format),
}


def preset_format(preset: Preset, unit: str | None = None, no_echo: tuple[float, ...] | None = None) -> LineFormat:
    """Return the format of a preset, with another unit or other numbers for no echo if given."""
    scale = UNITS.get(unit or preset.unit or "")
    return preset.make(RangeUnit(scale, preset.no_echo if no_echo is None else no_echo))


# the URL of a device that prints text: `lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar`


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

    def make_format(self, matching: "MatchingProcess | None" = None) -> LineFormat:
        """Return the format of the lines. Raises InputError for an invalid pattern. `matching` matches its lines."""
        if self.preset:
            return preset_format(PRESETS[self.preset], self.unit, self.no_echo)
        scale = None if self.unit is None else UNITS[self.unit]
        pattern = check_pattern(self.pattern, self.step is None)
        unit = RangeUnit(scale, self.no_echo or ())
        return pattern_format(pattern, unit, groups_in=matching.groups if matching else None)

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


def _one_of(key: str, value: str, choices: tuple[str, ...]) -> str:
    if value not in choices:
        raise InputError(f"{key}={value}: expected {', '.join(choices)}")
    return value


def _baud(text: str) -> int:
    if not (text.isascii() and text.isdecimal()) or not 0 < int(text) <= _MOST_BAUD:
        raise InputError(f"baud={text}: expected a baud rate, such as 9600 or 115200")
    return int(text)


def _degrees(key: str, text: str) -> float:
    value = _number_of_parameter(key, text)
    if abs(value) > 360:
        raise InputError(f"{key}={text}: expected degrees from -360 to 360")
    return value


def _step(text: str) -> float:
    if not 0 < (degrees := _degrees("step", text)) <= 180:
        raise InputError(f"step={text}: expected degrees above 0, up to 180; for a clockwise turn add turn=cw")
    return math.radians(degrees)


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


# recognition of the baud rate and the preset, by listening


BAUDS = (9600, 115200, 57600, 38400, 19200, 230400, 250000, 4800, 76800)
LISTEN = 3.0  # s at the first baud rate: a board that was reset by the opening needs time to start
LISTEN_MORE = 1.0  # s at each other one
_ENOUGH = 8  # readings
_FEWEST = 3  # readings
_STEP = 10  # degrees, proposed for a device that prints no angle


@dataclass(frozen=True)
class LineGuess:
    """What a device prints."""

    port: str
    baud: int | None = None
    preset: str | None = None  # None: no preset matches
    readings: int = 0
    received: int = 0  # bytes, at all baud rates
    example: str = ""  # a line of text that no preset matches

    @property
    def url(self) -> str | None:
        """The URL to scan with; None without a preset."""
        if self.preset is None:
            return None
        step = "" if PRESETS[self.preset].prints_angle else f"&step={_STEP}"
        return f"{SCHEME}:{self.port}?baud={self.baud}&preset={self.preset}{step}"

    @property
    def text(self) -> str:
        """The result in words."""
        if self.url is not None:
            return f"prints {self.preset} at {self.baud} baud: '{self.url}'"
        if self.example:
            return f"prints text that no preset matches, such as {self.example!r}; write a pattern="
        return f"prints no text; {self.received} bytes were received" if self.received else "prints nothing"


def guess_lines(port: str, stopped: Callable[[], bool] = lambda: False) -> LineGuess:
    """Return what a device prints. Listens at one baud rate after the other, until `stopped`.

    Raises LinkError if the port cannot be opened.
    """
    best = LineGuess(port)
    with Link(port) as link:
        for baud in BAUDS if link.bauds else BAUDS[:1]:
            link.set_baud(baud)
            until = time.monotonic() + (LISTEN if baud == BAUDS[0] else LISTEN_MORE)
            guess = _listen(link, port, baud, lambda: stopped() or time.monotonic() > until)  # noqa: B023 - used at once
            if guess.preset is not None or stopped():
                return guess
            best = LineGuess(port, received=best.received + guess.received, example=best.example or guess.example)
    return best


def _listen(link: Link, port: str, baud: int, over: Callable[[], bool]) -> LineGuess:
    decoders = {name: LineDecoder(preset_format(preset)) for name, preset in PRESETS.items()}
    before = dict.fromkeys(decoders, 0)  # lines before the first reading, such as CSV before its header
    received = 0
    while not over() and max(decoder.readings for decoder in decoders.values()) < _ENOUGH:
        data = link.read()
        received += len(data)
        for name, decoder in decoders.items():
            decoder.feed(data) if data else decoder.idle(READ_PATIENCE)
            if not decoder.readings:
                before[name] = decoder.ignored.total()
    scores = {name: decoder.readings + before[name] - decoder.ignored.total() for name, decoder in decoders.items()}
    name, best = max(decoders.items(), key=lambda item: scores[item[0]])
    if best.readings < _FEWEST or scores[name] <= 0:
        return LineGuess(port, received=received, example=decoders["csv"].example)
    return LineGuess(port, baud, name, best.readings, received)


class TextDevice(DevicePlugin):
    """A device that prints text on a serial line, as a plug-in. It decodes angle and range in each line."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self._settings = read_lines_url(url)
        self._find = PortFinder(self._settings.port)
        self._matching = MatchingProcess(self._settings.pattern)
        self._decoder = LineDecoder(self._settings.make_format(self._matching))
        self._link: Link | None = None
        self._steps = 0  # readings since the scan began, of a device that prints no angle
        self._bytes = 0

    @property
    def identity(self) -> DeviceIdentity:
        """The format, because the device does not identify itself."""
        return DeviceIdentity(f"text lines, {self._settings.preset or 'pattern'}", board=self._settings.board)

    def open(self) -> None:
        """Open the port."""
        self._link = Link(self._find())
        self._link.set_baud(self._settings.baud)
        self._decoder.lost()

    def read(self) -> list[Measurement]:
        """Return the readings of the lines that have arrived."""
        data = self._link.read() if self._link else b""
        if not data:
            self._decoder.idle(READ_PATIENCE)
            return []
        self._bytes += len(data)
        self.on_bytes(data)
        return [self._measurement(line) for line in self._decoder.feed(data)]

    def close(self) -> None:
        """Close the port."""
        self._matching.close()
        link, self._link = self._link, None
        if link:
            link.close()

    def begin(self, order: ScanOrder) -> bool:
        """Count the steps of a device that prints no angle from here.

        Returns whether earlier measurements may belong to the scan; their angle is known only if it is printed.
        """
        self._steps = 0
        return self._settings.step is None

    @property
    def ignored(self) -> Mapping[str, int]:
        """The lines that were no readings."""
        return dict(self._decoder.ignored)  # read in another thread

    @property
    def diagnosis(self) -> str:
        """What arrived instead of readings."""
        ignored, settings = self._decoder.ignored, self._settings
        total = ignored.total()
        if not self._bytes:
            return "nothing was received; check the cable, and that the sketch prints without a command"
        if 2 * ignored[NOISE] > total:
            return f"{self._bytes} bytes were received, mostly not text; the baud rate may not be {settings.baud}"
        example = f", such as {self._decoder.example!r}" if self._decoder.example else ""
        wanted = PRESETS[settings.preset].example if settings.preset else settings.pattern
        return (
            f"{self._bytes} bytes were received, {total} lines are no readings{example}; expected {wanted!r}; "
            "`sonarhw ports --guess` proposes a preset"
        )

    def _measurement(self, line: Printed) -> Measurement:
        heading, distance = line.heading, line.range
        if heading is None:
            heading = math.degrees(self._steps * (self._settings.step or 0.0)) % 360
            self._steps += 1
        angle = self._settings.turntable_angle(heading)
        return Measurement(angle, () if distance is None else (distance,), restarted=line.restarted)
