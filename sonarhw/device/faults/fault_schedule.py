"""The faults of a fake scanner and their times, as in the option `--faults` and in `fake:ROOM?faults=`.

`sonarhw.device.faults.faulty_board` applies them. `docs/devices/faults.md` documents the format.

    drop=1/5000,reset@r20,unplug=1@~30        loses 1 of 5000 bytes, resets after 20 pings, unplugs about every 30 s
"""

import math
from dataclasses import dataclass
from enum import Enum

from sonarhw.device.wiring_faults import WiringFault, read_wiring_faults
from sonarhw.errors import InputError

FOREVER = math.inf
_NO_WIRES = WiringFault(0)


@dataclass(frozen=True)
class At:
    """Once, this time after the start of the scanner, s."""

    seconds: float


@dataclass(frozen=True)
class AfterPings:
    """Once, after this number of reported pings."""

    count: int


@dataclass(frozen=True)
class NowAndThen:
    """Repeatedly at random times, with this mean interval, s."""

    seconds: float


When = At | AfterPings | NowAndThen


class FaultKind(Enum):
    """A fault: its name in a specification, its default size, and the meaning of the size."""

    STALL = ("stall", 1.0, "s for which the line delays all bytes; it then delivers them at once")
    DEAF = ("deaf", 1.0, "s for which bytes from the host are lost")
    MUTE = ("mute", 1.0, "s for which bytes from the scanner are lost")
    RESET = ("reset", 0.5, "s for a restart; conversation, zero and readings are lost")
    WEDGE = ("wedge", FOREVER, "s for which the turntable is blocked and misses all steps")
    SLIP = ("slip", 16.0, "microsteps that the turntable misses at once (below 0: on a backward move)")
    NONSENSE = ("nonsense", FOREVER, "s of text, noise and meaningless frames instead of answers")
    UNPLUG = ("unplug", 1.0, "s for which the cable is unplugged; it comes back under the same name")
    MOVE = ("move", 1.0, "s for which the cable is unplugged; it comes back under another name")

    def __init__(self, text: str, size: float, meaning: str) -> None:
        self.text, self.size, self.meaning = text, size, meaning


@dataclass(frozen=True)
class Event:
    """A fault with its time."""

    kind: FaultKind
    size: float  # see FaultKind
    when: When = At(0.0)


@dataclass(frozen=True)
class Faults:
    """All faults of one scanner. `drop`, `flip` and `insert` are shares of the bytes in each direction."""

    drop: float = 0.0
    flip: float = 0.0  # one bit of the byte
    insert: float = 0.0
    drift: float = 0.0  # ppm; above 0: its clock runs too fast
    protocol: tuple[int, int] | None = None  # protocol version; None: the current one
    miswire: WiringFault = _NO_WIRES
    events: tuple[Event, ...] = ()


NO_FAULTS = Faults()
_RATES = ("drop", "flip", "insert")
_LASTING = (*_RATES, "drift", "protocol", "miswire")
_KINDS = {kind.text: kind for kind in FaultKind}
KNOWN = (*_LASTING, *_KINDS)


def read_faults(spec: str) -> Faults:
    """Return the faults in a text such as `drop=1/5000,reset@r20,unplug=1@~30`. An empty text means no faults.

    Raises InputError for an unknown fault, value or time.
    """
    lasting: dict[str, float | tuple[int, int] | WiringFault] = {}
    events = []
    for entry in filter(None, map(str.strip, spec.split(","))):
        what, at, moment = entry.partition("@")
        name, equals, value = what.partition("=")
        if name in _KINDS:
            size = _size(_KINDS[name], value, entry) if equals else _KINDS[name].size
            events.append(Event(_KINDS[name], size, _moment(moment, entry) if at else At(0.0)))
        elif name not in _LASTING:
            raise InputError(f"unknown fault {name!r}; expected one of {', '.join(KNOWN)}")
        elif at or name in lasting:
            raise InputError(f"fault {entry!r}: {name} is permanent; specify it once, without a time")
        else:
            lasting[name] = _lasting(name, value, entry)
    return Faults(**lasting, events=tuple(events))  # type: ignore[arg-type]  # each value has the type of its field


def _lasting(name: str, value: str, entry: str) -> float | tuple[int, int] | WiringFault:
    if name == "miswire":
        try:
            return read_wiring_faults(value)
        except InputError as error:
            raise InputError(f"fault {entry!r}: {error}") from None
    if name == "protocol":
        major, dot, minor = value.partition(".")
        if not (dot and major.isdecimal() and minor.isdecimal() and int(major) <= 0xFF and int(minor) <= 0xFF):
            raise InputError(f"fault {entry!r}: expected a version such as protocol=0.9")
        return int(major), int(minor)
    number = _number(value, entry)
    if name in _RATES and not 0 <= number <= 1:
        raise InputError(f"fault {entry!r}: expected a share of the bytes from 0 to 1, such as {name}=1/5000")
    if name == "drift" and abs(number) > 100_000:
        raise InputError(f"fault {entry!r}: expected a drift in ppm, from -100000 to 100000")
    return number


def _size(kind: FaultKind, value: str, entry: str) -> float:
    size = _number(value, entry)
    if size < 0 and kind is not FaultKind.SLIP:
        raise InputError(f"fault {entry!r}: expected a time of at least 0 s, such as {kind.text}=1")
    return size


def _moment(text: str, entry: str) -> When:
    if text.startswith("r") and text[1:].isdecimal():
        return AfterPings(int(text[1:]))
    seconds = _number(text.removeprefix("~"), entry)
    if seconds < 0 or (seconds == 0 and text.startswith("~")):
        raise InputError(f"fault {entry!r}: expected a time: @12.5 (s), @r20 (pings) or @~30 (about every 30 s)")
    return NowAndThen(seconds) if text.startswith("~") else At(seconds)


def _number(text: str, entry: str) -> float:
    try:
        over, slash, under = text.partition("/")
        number = float(over) / float(under) if slash else float(over)
    except (ValueError, ZeroDivisionError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"fault {entry!r}: {text!r} is not a number; expected one such as 12.5 or 1/5000")
    return number
