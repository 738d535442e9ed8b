"""Faults on request: what goes wrong with a fake scanner, and when.

Takes the text a person gives (`--faults`, `fake:ROOM?faults=`) or values from Python; hands on a schedule, which
`sonarhw.device.faulty_board` carries out. `docs/how_to/faults.md` has the same table for people.

    drop=1/5000,reset@r20,unplug=1@~30        every 5000th byte lost, a reset after 20 pings, and now and then no cable
"""

import math
from dataclasses import dataclass
from enum import Enum

from sonarhw.errors import InputError

FOREVER = math.inf


@dataclass(frozen=True)
class At:
    """Once, so long after the scanner was started."""

    seconds: float


@dataclass(frozen=True)
class AfterPings:
    """Once, when so many pings have been told."""

    count: int


@dataclass(frozen=True)
class NowAndThen:
    """Again and again at random moments, so far apart on average."""

    seconds: float


When = At | AfterPings | NowAndThen


class FaultKind(Enum):
    """What can happen; the value is its name in a text, the size it has where none is said, and what that counts."""

    STALL = ("stall", 1.0, "s: the line holds every byte back, then lets them all go at once")
    DEAF = ("deaf", 1.0, "s in which nothing that the host says arrives")
    MUTE = ("mute", 1.0, "s in which nothing that the scanner says arrives")
    RESET = ("reset", 0.5, "s it takes to start again: it forgets the conversation, its zero and its readings")
    WEDGE = ("wedge", FOREVER, "s for which the turntable does not move, whatever steps it is given")
    SLIP = ("slip", 16.0, "microsteps of a way forwards that the turntable misses at once (below 0: backwards)")
    NONSENSE = ("nonsense", FOREVER, "s of text, noise and senseless frames instead of answers")
    UNPLUG = ("unplug", 1.0, "s without a cable; it comes back under the same name")
    MOVE = ("move", 1.0, "s without a cable; it comes back under another name")

    def __init__(self, text: str, size: float, meaning: str) -> None:
        self.text, self.size, self.meaning = text, size, meaning


@dataclass(frozen=True)
class Event:
    """Something that happens at a moment, or again and again."""

    kind: FaultKind
    size: float  # see FaultKind
    when: When = At(0.0)


@dataclass(frozen=True)
class Faults:
    """All that is wrong with one scanner. The rates are shares of the bytes, each way."""

    drop: float = 0.0
    flip: float = 0.0  # one bit of the byte
    insert: float = 0.0
    drift: float = 0.0  # how much too fast its clock runs, ppm
    protocol: tuple[int, int] | None = None  # version it speaks; None: today's
    events: tuple[Event, ...] = ()


NO_FAULTS = Faults()
_RATES = ("drop", "flip", "insert")
_LASTING = (*_RATES, "drift", "protocol")
_KINDS = {kind.text: kind for kind in FaultKind}
KNOWN = (*_LASTING, *_KINDS)


def read_faults(spec: str) -> Faults:
    """The schedule in a text such as `drop=1/5000,reset@r20,unplug=1@~30`; an empty one is no faults.

    Raises InputError for a fault, a value or a moment that is not known.
    """
    lasting: dict[str, float | tuple[int, int]] = {}
    events = []
    for entry in filter(None, map(str.strip, spec.split(","))):
        what, at, moment = entry.partition("@")
        name, equals, value = what.partition("=")
        if name in _KINDS:
            size = _size(_KINDS[name], value, entry) if equals else _KINDS[name].size
            events.append(Event(_KINDS[name], size, _moment(moment, entry) if at else At(0.0)))
        elif name not in _LASTING:
            raise InputError(f"fault {entry!r}: {name} is not known; known: {', '.join(KNOWN)}")
        elif at or name in lasting:
            raise InputError(f"fault {entry!r}: {name} lasts; give it once, without a moment")
        else:
            lasting[name] = _lasting(name, value, entry)
    return Faults(**lasting, events=tuple(events))  # type: ignore[arg-type]  # each name has the value of its kind


def _lasting(name: str, value: str, entry: str) -> float | tuple[int, int]:
    if name == "protocol":
        major, dot, minor = value.partition(".")
        if not (dot and major.isdecimal() and minor.isdecimal() and int(major) <= 0xFF and int(minor) <= 0xFF):
            raise InputError(f"fault {entry!r}: expected a version such as protocol=0.9")
        return int(major), int(minor)
    number = _number(value, entry)
    if name in _RATES and not 0 <= number <= 1:
        raise InputError(f"fault {entry!r}: expected a share of the bytes from 0 to 1, such as {name}=1/5000")
    if name == "drift" and abs(number) > 100_000:
        raise InputError(f"fault {entry!r}: expected a drift in ppm, at most 100000 either way")
    return number


def _size(kind: FaultKind, value: str, entry: str) -> float:
    size = _number(value, entry)
    if size < 0 and kind is not FaultKind.SLIP:
        raise InputError(f"fault {entry!r}: expected a time from 0 s up, such as {kind.text}=1")
    return size


def _moment(text: str, entry: str) -> When:
    if text.startswith("r") and text[1:].isdecimal():
        return AfterPings(int(text[1:]))
    seconds = _number(text.removeprefix("~"), entry)
    if seconds < 0 or (seconds == 0 and text.startswith("~")):
        raise InputError(f"fault {entry!r}: expected a moment: @12.5 (s), @r20 (pings) or @~30 (every 30 s or so)")
    return NowAndThen(seconds) if text.startswith("~") else At(seconds)


def _number(text: str, entry: str) -> float:
    try:
        over, slash, under = text.partition("/")
        number = float(over) / float(under) if slash else float(over)
    except (ValueError, ZeroDivisionError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"fault {entry!r}: {text!r} is no number; expected one such as 12.5 or 1/5000")
    return number
