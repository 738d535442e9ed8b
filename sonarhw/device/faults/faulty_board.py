"""A fake board with faults in the board and its line. It is a `Device`.

Random values depend only on the seed and on the order of the bytes.
"""

import heapq
import itertools
import math
import random
from collections.abc import Callable
from dataclasses import replace

from sonarhw.device.fake_board import BoardIdentity, FakeBoard
from sonarhw.device.faults.fault_schedule import AfterPings, At, Event, FaultKind, Faults, NowAndThen
from sonarhw.device.faults.line_noise import LineNoise, nonsense
from sonarhw.wire.frames import Frame, FrameDecoder
from sonarhw.wire.messages import Info, MessageError, ReadingMessage

_NONSENSE_EVERY = 0.05  # s between two pieces of nonsense

Action = Callable[[float], None]  # called with the time at which it is due, s


def faulty_identity(identity: BoardIdentity, faults: Faults) -> BoardIdentity:
    """Return the identity that a board with these faults reports."""
    major, minor = faults.protocol or (identity.major, identity.minor)
    return replace(identity, major=major, minor=minor)


class FaultyDevice:
    """A fake board with a schedule of faults."""

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
        self._pings = _Pings()
        self._waiting = [(event.when.count, event) for event in faults.events if isinstance(event.when, AfterPings)]
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
            self._pings.count(data)
            due = [event for count, event in self._waiting if count <= self._pings.seen]
            self._waiting = [(count, event) for count, event in self._waiting if count > self._pings.seen]
            for event in due:
                self._apply(event, now)

    def _send(self, data: bytes) -> None:
        if self.plug is None:
            return
        (self._held_up if self._stalled else self._leaving).extend(self._up.damage(data))

    # faults

    def _schedule(self, event: Event, now: float) -> None:
        match event.when:
            case At(seconds):
                self._at(now + seconds, lambda due: self._apply(event, due))
            case NowAndThen(seconds):
                self._at(now + self._chance.expovariate(1 / seconds), lambda due: self._apply_again(event, due))

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


class _Pings:
    """Counts the pings reported on a line. Readings that are sent again do not count."""

    def __init__(self) -> None:
        self.seen = 0
        self._decoder = FrameDecoder()
        self._newest = -1

    def count(self, data: bytes) -> None:
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
                self._newest, self.seen = fired, self.seen + 1
