"""A fake board with faults: lost and damaged bytes, resets, unplugged cables, silence, each at its time."""

import heapq
import itertools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

from sonarhw import arguments
from sonarhw.device.fake_board import BoardIdentity, FakeBoard, WiringFault, read_wiring_faults
from sonarhw.errors import InputError, did_you_mean
from sonarhw.wire.frames import Frame, FrameDecoder, encode_frame
from sonarhw.wire.messages import Accepted, Info, MessageError, ReadingMessage

# the option `--faults` and the key of `fake:ROOM?faults=`; `docs/devices/faults.md` documents the format


FOREVER = math.inf
_NO_WIRES = WiringFault(0)


_MOST_SLIP = 320_000.0  # microsteps; homing searches each turn for its mark


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
    """A fault with its time: once after `seconds` or `pings`, or repeatedly."""

    kind: FaultKind
    size: float  # see FaultKind
    seconds: float = 0.0  # after the start of the scanner; of a repeated one, the mean interval of random times
    pings: int | None = None  # reported pings, instead of `seconds`
    repeats: bool = False


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


@arguments.checked(spec=arguments.text)
def read_faults(spec: str) -> Faults:
    """Return the faults in a text such as `drop=1/5000,reset@r20,unplug=1@~30`. An empty text means no faults.

    Raises InputError for an unknown fault, value or time.
    """
    lasting: dict[str, float | tuple[int, int] | WiringFault] = {}
    events = []
    for entry in filter(None, map(str.strip, spec.split(","))):
        if " " in entry:
            raise InputError(f"fault {entry!r}: write commas between faults, such as drop=1/5000,reset@r20")
        what, separator, moment = entry.partition("@")
        name, equals, value = what.partition("=")
        if name in _KINDS:
            size = _size(_KINDS[name], value, entry) if equals else _KINDS[name].size
            events.append(_timed(Event(_KINDS[name], size), moment, entry) if separator else Event(_KINDS[name], size))
        elif name not in _LASTING:
            hint = did_you_mean(name, KNOWN) or ";"
            raise InputError(f"unknown fault {name!r}{hint} expected one of {', '.join(KNOWN)}")
        elif separator or name in lasting:
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
    if kind is FaultKind.SLIP and abs(size) > _MOST_SLIP:
        raise InputError(f"fault {entry!r}: expected at most {_MOST_SLIP:g} microsteps, a hundred turns")
    if size < 0 and kind is not FaultKind.SLIP:
        raise InputError(f"fault {entry!r}: expected a time of at least 0 s, such as {kind.text}=1")
    return size


def _timed(event: Event, text: str, entry: str) -> Event:
    if text.startswith("r") and text[1:].isdecimal():
        return replace(event, pings=int(text[1:]))
    repeats = text.startswith("~")
    seconds = _number(text.removeprefix("~"), entry)
    if seconds < 0 or (seconds == 0 and repeats):
        raise InputError(f"fault {entry!r}: expected a time: @12.5 (s), @r20 (pings) or @~30 (about every 30 s)")
    return replace(event, seconds=seconds, repeats=repeats)


def _number(text: str, entry: str) -> float:
    try:
        over, slash, under = text.partition("/")
        number = float(over) / float(under) if slash else float(over)
    except (ValueError, ZeroDivisionError):
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"fault {entry!r}: {text!r} is not a number; expected one such as 12.5 or 1/5000")
    return number


# damaged bytes of a bad line, and bytes of a device that is not a scanner


_LINES = (b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n", b"ok\r\n", b"T:21.3 /0.0 @:0\r\n")
_UNUSED_TYPE = 0xE5  # no message has this type


class LineNoise:
    """Drops bytes, flips bits and inserts bytes, each at its rate. The same seed damages the same bytes."""

    def __init__(self, faults: Faults, seed: int) -> None:
        self._chance = random.Random(seed)
        self._rates = (faults.drop, faults.flip, faults.insert)
        self._rate = min(1.0, sum(self._rates))
        self._intact = self._until_next()  # bytes before the next damaged one

    def damage(self, data: bytes) -> bytes:
        """Return the bytes as they arrive."""
        if self._intact >= len(data):
            self._intact -= len(data)
            return data
        arriving, position = bytearray(), 0
        while self._intact < len(data) - position:
            victim = position + int(self._intact)
            arriving += data[position:victim] + self._damaged(data[victim])
            position = victim + 1
            self._intact = self._until_next()
        self._intact -= len(data) - position
        return bytes(arriving + data[position:])

    def _damaged(self, byte: int) -> bytes:
        (what,) = self._chance.choices(("drop", "flip", "insert"), self._rates)
        if what == "drop":
            return b""
        if what == "flip":
            return bytes([byte ^ (1 << self._chance.randrange(8))])
        return bytes([byte, self._chance.randrange(256)])

    def _until_next(self) -> float:
        # the gaps between independently damaged bytes have a geometric distribution
        if self._rate in (0.0, 1.0):
            return math.inf if self._rate == 0 else 0
        return math.floor(math.log(1 - self._chance.random()) / math.log(1 - self._rate))


def nonsense(chance: random.Random) -> bytes:
    """Return random bytes that no scanner sends: text, noise or meaningless frames."""
    stray = Accepted(chance.randrange(0x10000)).pack()
    return chance.choice(
        [
            chance.choice(_LINES),
            chance.randbytes(chance.randrange(1, 600)),
            bytes(chance.randrange(1, 20)),
            _frame(chance, _UNUSED_TYPE, chance.randbytes(20)),
            _frame(chance, Info.TYPE, chance.randbytes(5)),
            _frame(chance, ReadingMessage.TYPE, chance.randbytes(10)),
            _frame(chance, Accepted.TYPE, stray),
        ]
    )


def _frame(chance: random.Random, kind: int, payload: bytes) -> bytes:
    return encode_frame(Frame(kind, chance.randrange(0x10000), chance.randrange(2**40), payload))


_NONSENSE_EVERY = 0.05  # s between two pieces of nonsense

Action = Callable[[float], None]  # called with the time at which it is due, s


def faulty_identity(identity: BoardIdentity, faults: Faults) -> BoardIdentity:
    """Return the identity that a board with these faults reports."""
    major, minor = faults.protocol or (identity.major, identity.minor)
    return replace(identity, major=major, minor=minor)


class FaultyDevice:
    """A fake board with a schedule of faults. Random values depend only on the seed and on the order of the bytes."""

    def __init__(self, make_board: Callable[[int], FakeBoard], faults: Faults, seed: int = 0) -> None:
        """`make_board` returns a board that was just switched on. Its argument is the number of earlier starts."""
        self._make_board = make_board
        self._faults = faults
        self._chance = random.Random(seed)
        self._up, self._down = LineNoise(faults, seed + 1), LineNoise(faults, seed + 2)
        self._boots = 0
        self._board: FakeBoard | None = make_board(0)  # None while it starts
        self._started: float | None = None
        self._due: list[tuple[float, int, Action]] = []
        self._order = itertools.count()
        self._waiting = [(event.pings, event) for event in faults.events if event.pings is not None]
        self._pings = 0  # reported so far
        self._decoder = FrameDecoder()  # of the frames with pings
        self._newest = -1  # device clock of the newest ping, µs
        self._wedged_until = self._nonsense_until = self._stalled_until = -math.inf
        self._deaf_until = self._mute_until = -math.inf
        self._stalled = False
        self._held_up, self._held_down = bytearray(), bytearray()
        self._leaving = bytearray()
        self.plug: int | None = 0
        self._speedup = 1.0

    # Device

    @property
    def speedup(self) -> float:
        """Ratio of device time to real time."""
        return self._speedup

    @speedup.setter
    def speedup(self, factor: float) -> None:
        self._speedup = factor
        if self._board is not None:
            self._board.speedup = factor

    @property
    def busy(self) -> bool:
        """Whether it homes, turns or scans."""
        return self._board is not None and self._board.busy

    def receive(self, data: bytes, now: float) -> None:
        """Process bytes from the host."""
        self._pass_time(now)
        if self.plug is None or now < self._deaf_until:
            return
        if self._stalled:
            self._held_down += data
        else:
            self._to_board(data, now)

    def next_event(self) -> float | None:
        """Return the time when `advance` is next needed, s."""
        due = [self._due[0][0]] if self._due else []
        if self._board is not None and (event := self._board.next_event()) is not None:
            due.append(self._host_time(event))
        return min(due, default=None)

    def advance(self, now: float) -> bytes:
        """Do the work due by `now`, and return the bytes that have reached the host since the last call."""
        self._pass_time(now)
        data = bytes(self._leaving)
        self._leaving.clear()
        return data

    def hang_up(self) -> None:
        """Handle a host that has disconnected."""
        if self._board is not None:
            self._board.hang_up()
        self._held_down.clear()
        self._held_up.clear()
        self._leaving.clear()

    # time

    def _pass_time(self, now: float) -> None:
        if self._started is None:
            self._started = now
            for event in self._faults.events:
                self._schedule(event, now)
        plug = self.plug
        while self._due and self._due[0][0] <= now:
            due, _, action = heapq.heappop(self._due)
            self._run_board(due)
            action(due)
            if self.plug != plug:
                return  # the caller must notice each change of the cable; the next call does the rest
        self._run_board(now)

    def _run_board(self, now: float) -> None:
        # one event at a time, so that a fault after a number of pings starts before the next ping
        while self._board is not None:
            event = self._board.next_event()
            due = now if event is None else min(now, self._host_time(event))
            self._from_board(self._board.advance(self._board_time(due)), due)
            if event is None or due >= now:
                break

    def _board_time(self, now: float) -> float:
        start = self._started or 0.0
        return start + (now - start) * (1 + self._faults.drift * 1e-6)

    def _host_time(self, board_time: float) -> float:
        start = self._started or 0.0
        now = start + (board_time - start) / (1 + self._faults.drift * 1e-6)
        # rounding must not make this time earlier than that of the board
        while self._board_time(now) < board_time:
            now = math.nextafter(now, math.inf)
        return now

    # bytes

    def _to_board(self, data: bytes, now: float) -> None:
        if self._board is not None:
            self._board.receive(self._down.damage(data), self._board_time(now))

    def _from_board(self, data: bytes, now: float) -> None:
        if data and now >= max(self._nonsense_until, self._mute_until):
            self._send(data)
        if self._waiting and data:
            self._count_pings(data)
            due = [event for count, event in self._waiting if count <= self._pings]
            self._waiting = [(count, event) for count, event in self._waiting if count > self._pings]
            for event in due:
                self._apply(event, now)

    def _count_pings(self, data: bytes) -> None:
        """Count the reported pings. Readings that are sent again do not count."""
        for frame in self._decoder.feed(data):
            if not isinstance(frame, Frame) or frame.type not in (ReadingMessage.TYPE, Info.TYPE):
                continue
            if frame.type == Info.TYPE:  # after a reset the clock of the device starts at 0
                self._newest = -1
                continue
            try:
                fired = ReadingMessage.unpack(frame.payload).fired_us
            except MessageError:
                continue
            if fired > self._newest:
                self._newest, self._pings = fired, self._pings + 1

    def _send(self, data: bytes) -> None:
        if self.plug is None:
            return
        (self._held_up if self._stalled else self._leaving).extend(self._up.damage(data))

    # faults

    def _schedule(self, event: Event, now: float) -> None:
        if event.repeats:
            wait = self._chance.expovariate(1 / event.seconds)
            self._at(now + wait, lambda due: self._apply_again(event, due))
        elif event.pings is None:
            self._at(now + event.seconds, lambda due: self._apply(event, due))

    def _at(self, due: float, action: Action) -> None:
        if due < math.inf:
            heapq.heappush(self._due, (due, next(self._order), action))

    def _apply_again(self, event: Event, now: float) -> None:
        self._apply(event, now)
        self._schedule(event, now + event.size if event.kind is not FaultKind.SLIP else now)

    def _apply(self, event: Event, now: float) -> None:
        until = now + event.size
        match event.kind:
            case FaultKind.STALL:
                self._stalled, self._stalled_until = True, max(self._stalled_until, until)
                self._at(until, self._end_stall)
            case FaultKind.DEAF:
                self._deaf_until = max(self._deaf_until, until)
            case FaultKind.MUTE:
                self._mute_until = max(self._mute_until, until)
            case FaultKind.RESET:
                self._board = None
                self._at(until, self._boot)
            case FaultKind.WEDGE:
                self._wedged_until = max(self._wedged_until, until)
                self._wedge(now)
            case FaultKind.SLIP:
                if self._board is not None:
                    self._board.slip(event.size)
            case FaultKind.NONSENSE:
                self._nonsense_until = max(self._nonsense_until, until)
                self._send_nonsense(now)
            case FaultKind.UNPLUG | FaultKind.MOVE:
                self._unplug(event, now)

    def _end_stall(self, now: float) -> None:
        if now < self._stalled_until:
            return
        self._stalled = False
        self._leaving += self._held_up
        self._held_up.clear()
        data = bytes(self._held_down)
        self._held_down.clear()
        self._to_board(data, now)

    def _boot(self, now: float) -> None:
        if self._board is None:
            self._boots += 1
            self._board = self._make_board(self._boots)
            self._board.speedup = self._speedup
            self._wedge(now)

    def _wedge(self, now: float) -> None:
        if self._board is not None and now < self._wedged_until:
            self._board.wedge(self._wedged_until - now)

    def _send_nonsense(self, now: float) -> None:
        if now < self._nonsense_until:
            self._send(nonsense(self._chance))
            self._at(now + _NONSENSE_EVERY, self._send_nonsense)

    def _unplug(self, event: Event, now: float) -> None:
        if self.plug is None:
            return
        back = self.plug + (event.kind is FaultKind.MOVE)
        self.plug = None
        for bytes_on_the_way in (self._leaving, self._held_up, self._held_down):
            bytes_on_the_way.clear()

        def put_back(_: float) -> None:
            self.plug = back

        self._at(now + event.size, put_back)
