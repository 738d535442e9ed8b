"""Devices that print text, at `lines:` URLs: settings, recognition by listening, and the plug-in that reads them."""

import math
import re
import shlex
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from urllib.parse import unquote

from sonarhw.errors import InputError, did_you_mean
from sonarhw.link import READ_PATIENCE, Link, PortFinder
from sonarhw.plugins.device_plugin import DeviceIdentity, DevicePlugin, Measurement
from sonarhw.readings import ScanOrder
from sonarhw.text.decoder import NOISE, make_decoder, text_of
from sonarhw.text.evidence import DEGREES_ASSUMED, TURN_ASSUMED, UnitChoice, angle_question, turns_back
from sonarhw.text.layouts import Layout, degrees_of, layout_of, one_of
from sonarhw.text.numbers import Printed
from sonarhw.text.patterns import parse_template
from sonarhw.text.proposals import NOTHING, LayoutProposal, propose, sweep_text
from sonarhw.text.words import RANGE_UNITS, UNIT_NAMES, ColumnKind

# the URL of a device that prints text: `lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar`


SCHEME = "lines"
FIRST_BAUD = 9600
_MOST_BAUD = 4_000_000
_KEYS = ("baud", "preset", "pattern", "unit", "angle", "turn", "zero", "no_echo", "step", "ends")


@dataclass(frozen=True)
class LinesUrl:
    """The settings in a `lines:` URL."""

    url: str
    port: str
    baud: int
    layout: Layout
    sign: float  # 1: printed angles grow counter-clockwise, -1: clockwise
    turn_stated: bool  # whether the URL states the direction
    zero: float  # rad, printed angle at which the turntable angle is 0

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
            baud=_baud(values.get("baud", str(FIRST_BAUD))),
            layout=layout_of(values),
            sign=-1.0 if one_of("turn", values.get("turn", "ccw"), ("ccw", "cw")) == "cw" else 1.0,
            turn_stated="turn" in values,
            zero=math.radians(degrees_of("zero", values.get("zero", "0"))),
        )
    except InputError as error:
        raise InputError(f"{url}: {error}") from error
    return read


def _values(url: str, query: str) -> dict[str, str]:
    if not query and (key := re.search(rf"[,;&]({'|'.join(_KEYS)})=", url)):
        meant = url.replace(key[0], f"?{key[0][1:]}", 1)
        raise InputError(f"{url}: write ? before the first key; did you mean '{meant}'?")
    if not query and (rate := re.search(r"[,;:@ ](\d{4,6})$", url)):
        meant = f"{url[: rate.start()]}?baud={rate[1]}&preset=NAME"
        raise InputError(f"{url}: expected the baud rate as a key; did you mean '{meant}'?")
    if "&" not in query and re.search(rf"[?,;]({'|'.join(_KEYS)})=", query):
        raise InputError(f"{url}: expected & between two keys, such as baud=9600&preset=csv")
    pairs = [part.partition("=") for part in query.split("&") if part]
    values = {unquote(key): unquote(value) for key, _, value in pairs}
    if unknown := sorted(set(values) - set(_KEYS)):
        meant = did_you_mean(unknown[0], _KEYS) or ";"
        raise InputError(f"{url}: unknown key {', '.join(unknown)}{meant} known: {', '.join(_KEYS)}")
    if len(values) < len(pairs):
        raise InputError(f"{url}: a key occurs twice; give each key once")
    return values


def _baud(text: str) -> int:
    if not (text.isascii() and text.isdecimal()) or not 0 < int(text) <= _MOST_BAUD:
        raise InputError(f"baud={text}: expected a baud rate, such as 9600 or 115200")
    return int(text)


# recognition of the baud rate and the layout, by listening


BAUDS = (9600, 115200, 57600, 38400, 19200, 230400, 250000, 4800, 76800)
LISTEN = 3.0  # s at the first baud rate: a board that was reset by the opening needs time to start
LISTEN_MORE = 1.0  # s at each other one
LISTEN_TO_SWEEP = 30.0  # s, until a sweep has passed; also while few lines of legible text have arrived
_ENOUGH = 8  # readings
_FEW_LINES = 8  # of text that is not recognised; a device that prints a sweep a line needs seconds for each
_LEGIBLE = 0.8  # of its bytes; a board may print noise when it starts
_AGAIN = 0.5  # s between two proposals from the growing text


_WRITE_PATTERN, _FIELD = "write a pattern=", "{-}"
_PATTERN_ADVICE = f"{_WRITE_PATTERN}; for a sweep a line such as SCAN:[{{cm}},]..."


@dataclass(frozen=True)
class LineGuess:
    """What a device prints."""

    port: str
    baud: int | None = None
    proposal: LayoutProposal = NOTHING
    received: int = 0  # bytes, at all baud rates

    @property
    def preset(self) -> str | None:
        """The name of the preset; None without one."""
        layout = self.proposal.layout
        return layout.preset or None if layout else None

    @property
    def url(self) -> str | None:
        """The URL to scan with, also if a question is open; None if no readings were recognised."""
        return self._url_with(()) if self.proposal.layout else None

    @property
    def answered_urls(self) -> tuple[str, ...]:
        """The URL with each answer to the questions; empty if one has none, or no readings were recognised."""
        answers = product(*(question.answers for question in self.proposal.questions))
        return tuple(map(self._url_with, answers)) if self.proposal.layout else ()

    def _url_with(self, answers: Iterable[Mapping[str, str]]) -> str:
        layout = self.proposal.layout
        assert layout is not None
        turns = self.proposal.clockwise and not layout.turns_itself
        keys = {
            "preset": layout.preset,
            "pattern": layout.pattern,
            "unit": layout.unit,
            "angle": layout.angle,
            "ends": layout.ends,
            "step": "" if layout.step is None else f"{layout.step:g}",
            "no_echo": ",".join(f"{number:g}" for number in layout.no_echo or ()),
            "turn": "cw" if turns else "",
        }
        for answer in answers:
            keys |= answer
        query = "".join(f"&{key}={_quoted(value)}" for key, value in keys.items() if value)
        return f"{SCHEME}:{self.port}?baud={self.baud}{query}"

    @property
    def text(self) -> str:
        """The result in words."""
        proposal = self.proposal
        if self.url is not None:
            name = self.preset or "readings"
            asked = "".join(f"; undecided: {question}" for question in proposal.questions)
            return f"prints {name} at {self.baud} baud{asked}: '{self.url}'"
        if proposal.example:
            asked = "".join(f"; {question}" for question in proposal.questions) or f"; {_PATTERN_ADVICE}"
            asked = with_pattern_of(proposal.example, asked)
            return f"prints text that no preset matches, such as {proposal.example!r}{asked}"
        return f"prints no text; {self.received} bytes were received" if self.received else "prints nothing"

    @property
    def details(self) -> tuple[str, ...]:
        """How the layout was decided, and the sweep that it reads."""
        turn = (TURN_ASSUMED,) if self.proposal.turn_assumed else ()
        return (*self.proposal.evidence, *turn, *sweep_text(self.proposal))


_ECHOES_OF_A_PING = (
    "several ranges in a reading are taken for the echoes of one ping; {cm@90} states the direction of another sensor"
)


def _has_several_ranges(layout: Layout) -> bool:
    """Return whether a pattern has several ranges in one reading, none of which has a direction."""
    if not layout.pattern or layout.is_regex:
        return False
    fields = parse_template(layout.pattern).fields
    return sum(field.kind is ColumnKind.RANGE and field.mount is None for field in fields) > 1


def with_pattern_of(example: str, asked: str) -> str:
    """Return the advice to write a pattern with the one of an example of the lines; other text is unchanged."""
    skeleton = _skeleton(example)
    if _WRITE_PATTERN not in asked or _FIELD not in skeleton:
        return asked
    fields = "{deg} and {cm} in place of the {-} of angle and range"
    of_line = f"{_WRITE_PATTERN}{shlex.quote(skeleton)} with {fields}"
    return asked.replace(_WRITE_PATTERN, of_line, 1)


def _skeleton(example: str) -> str:
    """Return a pattern for a line, without its angle and its range."""
    point = r"\." if re.search(r"\d,-?\d+,-?\d", example) else "[.,]"  # a comma between many numbers separates them
    return re.sub(rf"(?:(?<=[\s:=,;|])-)?\d+(?:{point}\d+)?", "{-}", example)


def _quoted(text: str) -> str:
    """Return a text for the query of a URL in single quotes."""
    return "".join(f"%{ord(char):02X}" if char in "%&'" or ord(char) < 32 else char for char in text)


def guess_lines(
    port: str, stopped: Callable[[], bool] = lambda: False, drafted: Callable[[LineGuess], None] = lambda guess: None
) -> LineGuess:
    """Return what a device prints. Listens at one baud rate after the other, until `stopped`.

    At the right one it listens until a sweep has passed; `drafted` receives the first proposal. Raises LinkError if
    the port cannot be opened.
    """
    best, for_slow_text = LineGuess(port), LISTEN_TO_SWEEP
    with Link(port) as link:
        for baud in BAUDS if link.bauds else BAUDS[:1]:
            link.set_baud(baud)
            patience = LISTEN if baud == BAUDS[0] else LISTEN_MORE, for_slow_text
            guess = _listen(link, LineGuess(port, baud), patience, stopped, drafted)
            if guess.url is not None or stopped():
                return guess
            if guess.proposal.example:  # a pseudo-terminal has the same text at each rate
                for_slow_text = 0.0
            better = best.proposal if best.proposal.example else guess.proposal
            best = LineGuess(port, proposal=better, received=best.received + guess.received)
    return best


def _listen(
    link: Link,
    guess: LineGuess,
    patience: tuple[float, float],
    stopped: Callable[[], bool],
    drafted: Callable[[LineGuess], None],
) -> LineGuess:
    """Return what arrives at the baud rate of a guess. `patience`: for any text, and for slow text, s."""
    data, began = b"", time.monotonic()
    pauses, newest = list[tuple[int, float]](), began
    next_look, reported = began + _AGAIN, False
    while not stopped():
        piece = link.read()
        now = time.monotonic()
        if piece:
            pauses.append((len(data), now - newest))
            data, newest = data + piece, now
        wait = LISTEN_TO_SWEEP if guess.url else max(patience) if _is_slow_text(data) else patience[0]
        over = now > began + wait
        if now < next_look and not over and len(data) < 4 * max(guess.received, 200):
            continue
        next_look = now + _AGAIN
        guess = replace(guess, proposal=propose(data, pauses=pauses), received=len(data))
        if guess.url and not reported and len(guess.proposal.readings) < _ENOUGH * 4:
            drafted(guess)
            reported = True
        if over or _is_enough(guess.proposal):
            break
    return guess


def _is_slow_text(data: bytes) -> bool:
    """Return whether legible text has arrived, but few lines; at a wrong baud rate no line is legible."""
    lines = data.splitlines()
    legible = sum(len(line) for line in lines if text_of(line)[0] is not None)
    return len(lines) < _FEW_LINES and legible > _LEGIBLE * len(data)


def _is_enough(proposal: LayoutProposal) -> bool:
    """Return whether a sweep has passed, or a sweep and the one back if a question is open; or none is expected."""
    headings = [reading.heading for reading in proposal.readings if reading.heading is not None]
    if len(proposal.readings) < _ENOUGH:
        return False
    first = headings[: len(headings) // 2] if proposal.questions else headings
    return not headings or (turns_back(first) and len(headings) > 2 * _ENOUGH)


_MOST_HEARD = 2000  # headings
_BETWEEN_REQUESTS = 0.1  # s; a sensor needs 60 ms for its longest range


class TextDevice(DevicePlugin):
    """A device that prints text on a serial line, as a plug-in. It decodes angle and range in each line."""

    def __init__(self, url: str) -> None:
        super().__init__(url)
        self._settings = read_lines_url(url)
        self._find = PortFinder(self._settings.port)
        self._decoder = make_decoder(self._settings.layout)
        self._unit = UnitChoice()
        self._link: Link | None = None
        self._heard = deque[float](maxlen=_MOST_HEARD)  # headings for which degrees are assumed
        self._scale: float | None = None  # m, of the newest range
        self._newest = time.monotonic()  # time of the newest byte
        self._next_request = 0.0  # time of the monotonic clock
        self._steps = 0  # readings since the scan began, of a device that prints no angle
        self._bytes = 0

    @property
    def identity(self) -> DeviceIdentity:
        """The format, because the device does not identify itself."""
        layout = self._settings.layout
        return DeviceIdentity(f"text lines, {layout.preset or 'pattern'}", board=layout.board)

    def open(self) -> None:
        """Open the port."""
        self._link = Link(self._find())
        self._link.set_baud(self._settings.baud)
        self._decoder.lost()

    def read(self) -> list[Measurement]:
        """Return the readings of the lines that have arrived."""
        frame = self._settings.layout.frame
        if frame and frame.request and self._link and time.monotonic() >= self._next_request:
            self._next_request = time.monotonic() + _BETWEEN_REQUESTS
            self._link.write(frame.request)
        data = self._link.read() if self._link else b""
        if not data:
            self._decoder.idle(READ_PATIENCE)
            return []
        self._bytes += len(data)
        self.on_bytes(data)
        now, before, self._newest = time.time(), self._newest, time.monotonic()
        readings = self._decoder.feed(data, self._newest - before)
        self._heard += [reading.heading or 0.0 for reading in readings if reading.degrees_assumed]
        self._scale = next((reading.scale for reading in readings if reading.numbers), self._scale)
        try:
            decided = self._unit.add([(now, printed) for printed in readings])
        except InputError as error:
            raise InputError(f"{self.url}: {error}") from error
        return [self._measurement(printed, None if when == now else when) for when, printed in decided]

    def close(self) -> None:
        """Close the port."""
        self._decoder.close()
        link, self._link = self._link, None
        if link:
            link.close()

    def begin(self, order: ScanOrder) -> bool:
        """Count the steps of a device that prints no angle from here.

        Returns whether earlier measurements may belong to the scan; their angle is known only if it is printed.
        """
        self._steps = 0
        return self._settings.layout.step is None

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
        wanted = settings.layout.example
        return (
            f"{self._bytes} bytes were received, {total} lines are no readings{example}; expected {wanted!r}; "
            "`sonarhw ports --guess` proposes a preset"
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """How the numbers are read, with the evidence, and what is doubtful."""
        layout = self._settings.layout
        names = [name for name, scale in RANGE_UNITS.items() if scale == self._scale and not layout.units.range]
        by_text = names and layout.preset in ("csv", "jsonl", "angle-distance") and not self._unit.notes
        stated = (f"range in {UNIT_NAMES[names[0]]}: as the text states",) if by_text else ()
        named = layout.preset == "jsonl" or self._decoder.has_header
        angle = (str(angle_question(self._heard, named=named) or DEGREES_ASSUMED),) if self._heard else ()
        begins = "no angle is printed: the first reading of the scan is at angle 0; `sonarhw locate` finds its heading"
        counted = (begins,) if self._steps else ()
        turn = (TURN_ASSUMED,) if layout.pattern and layout.prints_angle and not self._settings.turn_stated else ()
        several = (_ECHOES_OF_A_PING,) if _has_several_ranges(layout) else ()
        return (*stated, *self._unit.notes, *angle, *turn, *counted, *several, *self._order_notes())

    def _order_notes(self) -> tuple[str, ...]:
        """Return whether the pauses of the device agree with the order of lines in the pattern."""
        first, *others = self._settings.layout.pattern.split("\\n")
        if not others:
            return ()
        if self._decoder.pauses.agree is False:
            order = "\\n".join([*others, first])
            return (
                f"the device pauses within readings, not before {first!r}: angles and ranges are probably combined "
                f"wrongly; write pattern={order}",
            )
        how = "the device pauses before it" if self._decoder.pauses.agree else "as the pattern states"
        return (f"a reading begins with the line {first!r}: {how}",)

    def _measurement(self, printed: Printed, when: float | None) -> Measurement:
        heading = printed.heading
        if heading is None:
            heading = self._steps * (self._settings.layout.step or 0.0) % 360
            self._steps += 1
        angle = self._settings.turntable_angle(heading)
        return Measurement(angle, printed.ranges, time=when, restarted=printed.restarted)
