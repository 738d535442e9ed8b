"""Check the firmware of a new scanner against the protocol, stage by stage: `sonarhw doctor URL --protocol`.

The first message that is missing or wrong ends the check, and is named with its likely cause. A device of version 1.0
receives nothing that version 1.0 forbids.
"""

import re
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields
from typing import TypeVar

from cobs import cobs

from sonarhw.bringup import Diagnosis, failed, passed, skipped
from sonarhw.link import Link
from sonarhw.readings import Origin, origin_of
from sonarhw.wire import limits, messages
from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, Rejected, encode_frame
from sonarhw.wire.readings_of_frames import (
    broken_reading_rule,
    broken_settings_rule,
    broken_start_rule,
    readings_requested,
)

_TRIES, _ANSWER_WITHIN = 3, 0.5  # s
_HELLO_TRIES = 6
_SILENT = 0.5  # s after which the host sends a sign of life
_BEAT_WITHIN = 1.5  # s; a heartbeat is due every 0.25 s
_IDLE_WITHIN = 2.0  # s without the end of an action, while the device does not say that it is busy
_READING_WITHIN = 8  # heartbeats, 2 s, between two readings of a scan
_ENDS_WITHIN = 480  # heartbeats, 120 s, of Home by the protocol
_SENT_WITHIN = 2_000_000  # µs from the start of a transmission to the frame with its reading
_TEXT = re.compile(rb"[\x20-\x7e\r\n]{4,}")  # the start of a frame from a device is none
_HEADER = 11  # bytes: type, sequence and time
_STEP = 10_000_000  # µdeg
_ORDER = messages.StartScan(start=0, step=_STEP, headings=2, sweeps=2, pings=1)
_LONG_ORDER = messages.StartScan(start=0, step=_STEP, headings=2, sweeps=1, pings=250)  # is stopped
_THERMOMETERS = -5000, 10_000  # 0.01 °C
_CLOCK_WITHIN = 2.0  # factor by which the clock of the device may differ
_MEASURED = 1.0  # s between two frames from which its clock is judged
M = TypeVar("M", bound=messages.Message)


class _Fault(Exception):
    """What is missing or wrong, and what to do."""

    def __init__(self, text: str, advice: str) -> None:
        super().__init__(text)
        self.text, self.advice = text, advice


def check_protocol(url: str, turns: bool) -> Iterator[Diagnosis]:
    """Yield the diagnosis of each stage, up to the first that fails. Without `turns`, nothing is homed or scanned.

    Raises InputError and LinkError if the link cannot be opened or is lost.
    """
    with Link(url) as link:
        talk = _Talk(link)
        talk.wait(link.quiet, lambda: talk.frames > 0)
        for name, stage in _STAGES.items():
            if name in _MOVING and not turns:
                yield skipped(name, "not wanted")
                continue
            try:
                yield passed(name, stage(talk))
            except _Fault as fault:
                yield failed(name, fault.text, fault.advice)
                return


# What is exchanged.


@dataclass
class _Talk:
    """The exchange with a device: sends commands, and collects what arrives."""

    link: Link
    sequence: int = 1  # of the next command
    asked: int = 0  # sequence of the newest command that was asked
    info: messages.Info | None = None
    settings: messages.Settings | None = None
    made: list[messages.ReadingMessage] = field(default_factory=list)  # of the newest scan
    sent: dict[int, int] = field(default_factory=dict)  # time of the frame with each of them, µs, by number
    answered: str = ""  # the newest command that was answered
    frames: int = 0
    received: int = 0  # bytes
    start: bytes = b""  # the first of them
    rejected: list[Rejected] = field(default_factory=list)
    strays: list[messages.Message] = field(default_factory=list)  # since the newest command
    unknown: set[int] = field(default_factory=set)  # types of frames without a message
    _arrived: list[messages.Message] = field(default_factory=list)
    _decoder: FrameDecoder = field(default_factory=FrameDecoder)
    _newest: Frame | None = None
    _spoke: float = 0.0  # time of the newest command
    _first: tuple[float, int] | None = None  # host and device time of the first frame, s and µs
    _last: tuple[float, int] | None = None

    @property
    def minor(self) -> int:
        """The lower of both minor versions."""
        return min(self.info.minor if self.info else 0, limits.PROTOCOL_MINOR)

    def send(self, message: messages.CommandMessage, sequence: int) -> None:
        """Send a command."""
        payload = message.pack(self.minor if self.info else limits.PROTOCOL_MINOR)
        wire = encode_frame(Frame(message.TYPE, sequence, time.monotonic_ns() // 1000, payload))
        self.link.write(DELIMITER + wire)
        self._spoke = time.monotonic()

    def ask(self, message: messages.CommandMessage, expected: type[M], tries: int = _TRIES) -> M:
        """Send a command, and return its answer. Raises _Fault."""
        self.asked = self._next_sequence()
        return self.ask_again(message, expected, tries)

    def ask_again(self, message: messages.CommandMessage, expected: type[M], tries: int = _TRIES) -> M:
        """Send a command with the number of the newest one, and return its answer. Raises _Fault."""
        name, sequence = type(message).__name__, self.asked
        self.rejected, self.strays = [], []
        began, received = time.monotonic(), self.received

        def answers_it(got: messages.Message) -> bool:
            return getattr(got, "command", None) == sequence and _answers(got)

        for number in range(tries):
            if number >= _TRIES and self.received > received:
                break
            self.send(message, sequence)
            answer = self.await_message(answers_it)
            if answer is not None:
                after = time.monotonic() - began
                # what waits for a device that starts late is answered later, too
                if 0 < number < _TRIES and self.info and self.await_message(answers_it, _ANSWER_WITHIN):
                    raise _Fault(f"answers {name} after {after:.1f} s", _AT_ONCE)
                self._check_order(name, expected, sequence)
                return self._checked(answer, expected, name)
        self._check_order(name, expected, sequence)
        raise self._missing(name, expected, sequence)

    def _next_sequence(self) -> int:
        sequence = self.sequence
        self.sequence += 1
        return sequence

    def await_message(
        self, wanted: Callable[[messages.Message], object], within: float = _ANSWER_WITHIN
    ) -> messages.Message | None:
        """Return the next message that is wanted; None after `within` s. Others are kept in `strays`."""
        until = time.monotonic() + within
        last = False  # what arrived while this process could not run is read, too
        while True:
            while self._arrived:
                message = self._arrived.pop(0)
                if wanted(message):
                    return message
                self.strays.append(message)
            if last:
                return None
            last = time.monotonic() > until
            self._receive()
            # a device of version 1.1 stops when the host is silent
            if self.minor >= 1 and time.monotonic() > self._spoke + _SILENT:
                self.send(messages.AskStatistics(), self._next_sequence())

    def wait(self, seconds: float, done: Callable[[], bool]) -> None:
        """Receive for some time, or until `done`."""
        until = time.monotonic() + seconds
        while time.monotonic() < until and not done():
            self._receive()

    def clock_rate(self) -> float | None:
        """Return by how much the clock of the device runs faster than that of the host; None: too little time."""
        if self._first is None or self._last is None or self._last[0] - self._first[0] < _MEASURED:
            return None
        return (self._last[1] - self._first[1]) * 1e-6 / (self._last[0] - self._first[0])

    def _receive(self) -> None:
        data = self.link.read()
        self.received += len(data)
        self.start = (self.start + data)[:_HEADER]
        for frame in self._decoder.feed(data):
            if isinstance(frame, Rejected):
                self.rejected.append(frame)
            else:
                self._take(frame)

    def _take(self, frame: Frame) -> None:
        self.frames += 1
        before, self._newest = self._newest, frame
        if frame.type < 0x80:
            raise _Fault(
                f"a frame of type {frame.type:#04x}, which only a host sends",
                "if the line returns what the host sends, separate TX and RX; types of a device are 0x80 to 0xFF",
            )
        if before and not self.rejected and (frame.sequence - before.sequence) % 0x10000 != 1:
            order = "send numbers with the low byte first; " if frame.sequence - before.sequence == 0x100 else ""
            raise _Fault(
                f"sequence {frame.sequence} follows {before.sequence}",
                f"{order}count the sequence up by one with each frame that is sent, answers and heartbeats alike",
            )
        if before and frame.time_us < before.time_us:
            raise _Fault(
                f"the time of a frame is {frame.time_us} µs, after {before.time_us} µs",
                "extend the clock to 64 bits; it must not run backwards, also when micros() overflows",
            )
        now = time.monotonic()
        self._first, self._last = self._first or (now, frame.time_us), (now, frame.time_us)
        kind = messages.BY_TYPE.get(frame.type)
        if kind is None:
            self.unknown.add(frame.type)  # of a newer version
            return
        try:
            message = kind.unpack(frame.payload)
        except messages.MessageError as error:
            advice = _fields_advice(kind, frame.payload, self.minor) if before else _payload_advice(kind, frame)
            raise _Fault(f"{kind.__name__}: {error}", advice) from error
        self._check_content(message, frame)
        self._arrived.append(message)

    def _check_content(self, message: messages.Message, frame: Frame) -> None:
        info, name = message if isinstance(message, messages.Info) else self.info, type(message).__name__
        if info is not None and (info.major, info.minor) <= (limits.PROTOCOL_MAJOR, limits.PROTOCOL_MINOR):
            expected = len(message.pack(info.minor))
            if len(frame.payload) > expected:
                raise _Fault(
                    f"{name}: {len(frame.payload)} bytes; its fields have {expected} in version 1.{info.minor}",
                    _fields_advice(type(message), frame.payload, info.minor),
                )
        degrees: int = getattr(message, "temperature", messages.NO_TEMPERATURE)
        lowest, highest = _THERMOMETERS
        if degrees != messages.NO_TEMPERATURE and not lowest <= degrees <= highest:
            raise _Fault(
                f"{name}: a temperature of {degrees / 100:g} °C",
                f"it is in 0.01 °C; {messages.NO_TEMPERATURE}: no thermometer",
            )
        if isinstance(message, messages.ReadingMessage):
            self.sent.setdefault(message.number, frame.time_us)

    def _check_order(self, name: str, expected: type[messages.Message], sequence: int) -> None:
        if any(isinstance(item, messages.Finished) and item.command == sequence for item in self.strays):
            raise _Fault(
                f"Finished of {name} without {expected.__name__} before it",
                f"send {expected.__name__} (0x{expected.TYPE:02X}) when {name} begins, and Finished when it has ended",
            )

    def _checked(self, answer: messages.Message, expected: type[M], name: str) -> M:
        if isinstance(answer, messages.Refused):
            code = messages.Refusal(answer.code).name if answer.code in [*messages.Refusal] else str(answer.code)
            advice = _REFUSALS.get(code, "expected a refusal code from 1 to 6")
            if self.answered == name:
                advice = _AGAIN
            elif code == "UNKNOWN" and _type_of(name) <= messages.Resend.TYPE:
                advice = f"every version has this command: answer it with {expected.__name__} (0x{expected.TYPE:02X})"
            raise _Fault(f"refuses {name} with {code}: {answer.text!r}", advice)
        if not isinstance(answer, expected):
            raise _Fault(
                f"answers {name} with {type(answer).__name__}; expected {expected.__name__}",
                f"answer {name} (0x{_type_of(name):02X}) with {expected.__name__} (0x{expected.TYPE:02X})",
            )
        self.answered = name
        return answer

    def _missing(self, name: str, expected: type[messages.Message], sequence: int) -> _Fault:
        if self.rejected:
            return _fault_of_block(self.rejected[0])
        answers = [item for item in self.strays if isinstance(item, messages.AnswerMessage)]
        # answers to repeated commands may be late
        numbers = [item.command for item in answers if not 1 <= item.command < sequence]
        if numbers:
            swapped = int.from_bytes(sequence.to_bytes(2, "little"), "big")
            order = "send numbers with the low byte first; " if numbers[-1] == swapped else ""
            return _Fault(
                f"answers {name} number {sequence} with the number {numbers[-1]} in `command`",
                f"{order}`command` is the sequence of the frame with the command",
            )
        if self.answered == name:
            return _Fault(f"does not answer a repeated {name}", _AGAIN)
        if answers:
            return _Fault(f"still answers {self.answered}, not {name}", _AT_ONCE)
        if self.answered:
            return _Fault(
                f"answers {self.answered}, not {name}",
                f"answer {name} (0x{_type_of(name):02X}) with {expected.__name__} (0x{expected.TYPE:02X}) within 50 "
                "ms; answer commands that are not implemented with Refused, UNKNOWN",
            )
        if self.received and not self.frames:
            if printed := _TEXT.match(self.start):
                return _printed(printed[0])
            return _Fault(
                f"{self.received} bytes without a zero byte", "end each frame with a zero byte, after byte stuffing"
            )
        if self.frames:
            kinds = [*sorted({type(item).__name__ for item in self.strays}), *map("{:#04x}".format, self.unknown)]
            return _Fault(
                f"no answer to {name}; messages that arrive: {', '.join(kinds)}",
                f"answer it with {expected.__name__} (0x{expected.TYPE:02X}) at once, and send nothing before Hello",
            )
        return _Fault(
            f"no byte in answer to {name}",
            "check that the firmware reads from this port at 250 000 baud and answers Hello (0x01) with Info (0x81); "
            "swap TX and RX; discard what is not a valid frame up to the next zero byte",
        )


def _answers(message: messages.Message) -> bool:
    return isinstance(message, messages.AnswerMessage)


def _type_of(name: str) -> int:
    kind: type[messages.Message] = getattr(messages, name)
    return kind.TYPE


# The stages: each returns what is right, or raises _Fault.


_AT_ONCE = "answer each command within 50 ms: read commands in each pass of the main loop, also while something runs"
_AGAIN = "a repeated command has the same sequence: send its answer and its Finished again, and do not carry it out"
_REFUSALS = {
    "MALFORMED": "accept payloads that are longer than in your version, and ignore the rest",
    "NO_HELLO": "remember that a Hello has arrived, until the next start",
    "NOT_HOMED": "a Home that has ended with DONE makes the zero known",
    "UNKNOWN": "the version that Info states has this command; state 1.0 if the device has only the core",
    "BUSY": "an action has ended once its Finished is sent",
    "OUT_OF_RANGE": "accept this order, or state the limits in Capabilities (version 1.1)",
}


def _hello(talk: _Talk) -> str:
    talk.info = info = talk.ask(
        messages.Hello(limits.PROTOCOL_MAJOR, limits.PROTOCOL_MINOR), messages.Info, _HELLO_TRIES
    )
    if info.major != limits.PROTOCOL_MAJOR:
        raise _Fault(f"version {info.major}.{info.minor}", f"state major version {limits.PROTOCOL_MAJOR} in Info")
    if not info.firmware:
        raise _Fault("Info has no name of the firmware", "state name and version of the firmware, as text")
    return f"Info: {info.firmware}, version {info.major}.{info.minor}, serial number {info.serial or 'none'}"


def _capabilities(talk: _Talk) -> str:
    if talk.minor < 1:
        return "not part of version 1.0"
    able = talk.ask(messages.AskCapabilities(), messages.Capabilities)
    if able.lowest_angle > 0 or able.highest_angle < _STEP:
        raise _Fault(f"angles from {able.lowest_angle} to {able.highest_angle} µdeg", "state angles in µdeg, around 0")
    return f"angles from {able.lowest_angle / 1e6:g} to {able.highest_angle / 1e6:g} degrees"


def _configure(talk: _Talk) -> str:
    request = messages.Configure(listen_us=20_000, blanking_us=2_380, trace=0, speed_of_sound=343_200)
    talk.settings = talk.ask(request, messages.Settings)
    if rule := broken_settings_rule(request, talk.settings):
        raise _Fault(rule, "return the settings in force; the device only stores speed_of_sound")
    return f"Settings: listens for {talk.settings.listen_us} µs"


def _heartbeat(talk: _Talk) -> str:
    for _ in range(2):
        beat = talk.await_message(lambda message: isinstance(message, messages.Heartbeat), _BEAT_WITHIN)
        if not isinstance(beat, messages.Heartbeat):
            raise _Fault("no Heartbeat", "send Heartbeat (0x89) every 250 ms, from Info on, in every state")
        if beat.state not in [*messages.State]:
            raise _Fault(f"Heartbeat with the state {beat.state}", "expected 0 to 3: idle, homing, turning, scanning")
        if _is_busy(beat):
            raise _Fault(
                f"Heartbeat with the state {messages.State(beat.state).name}, but nothing was commanded",
                "Hello stops what runs; then the state is 0, IDLE",
            )
    return "Heartbeat arrives"


def _clock(talk: _Talk) -> str:
    talk.wait(_MEASURED + _BEAT_WITHIN, lambda: talk.clock_rate() is not None)
    rate = talk.clock_rate()
    if rate is None:
        raise _Fault("no frames for a second", "send Heartbeat (0x89) every 250 ms, from Info on, in every state")
    if not 1 / _CLOCK_WITHIN < rate < _CLOCK_WITHIN:
        raise _Fault(f"the clock of the device runs {rate:.3g} times as fast as that of the host", "it counts µs")
    return "it counts µs"


def _home(talk: _Talk) -> str:
    talk.ask(messages.Home(), messages.Accepted)
    _finished(talk, "Home", talk.asked, _ENDS_WITHIN)
    return "Accepted, then Finished DONE"


def _finished(talk: _Talk, name: str, sequence: int, beats: int) -> list[messages.ReadingMessage]:
    """Wait for the Finished of an action, and return the readings before it.

    Raises _Fault if neither it nor a reading arrives within a number of heartbeats.
    """
    made: list[messages.ReadingMessage] = []
    busy = 0
    while True:
        message = talk.await_message(
            lambda got: isinstance(got, messages.Finished | messages.ReadingMessage) or _is_busy(got), _IDLE_WITHIN
        )
        if isinstance(message, messages.ReadingMessage):
            made.append(message)
            busy = 0
        elif isinstance(message, messages.Finished):
            break
        elif message is None or busy == beats:
            raise _not_finished(talk, name, message is not None, made)
        else:
            busy += 1
    if message.command != sequence:
        raise _Fault(
            f"Finished of command {message.command}; {name} has the number {sequence}",
            "`command` in Finished is the sequence of the frame that began the action",
        )
    if message.outcome != messages.Outcome.DONE:
        raise _Fault(f"{name} ends with outcome {message.outcome}: {message.text!r}", "0 is DONE")
    if message.readings != len(made):
        arrived = ", ".join(str(reading.number) for reading in made) or "none"
        raise _Fault(
            f"Finished of {name} with {message.readings} readings; those that arrived: {arrived}",
            "send each reading; Finished contains the number of the first one that is not made, 0 after Home and Turn",
        )
    return made


def _not_finished(talk: _Talk, name: str, busy: bool, made: list[messages.ReadingMessage]) -> _Fault:
    if talk.rejected:
        return _fault_of_block(talk.rejected[0])
    if busy and name == "StartScan":
        return _Fault(
            f"{len(made)} readings of StartScan, then none and no Finished, while the state is busy",
            "send ReadingMessage (0x87) after each ping, and Finished (0x86) after the last one",
        )
    if busy:
        return _Fault(
            f"no Finished for {name} after {_ENDS_WITHIN} Heartbeats with a busy state",
            "send Finished (0x86) when the action has ended or failed",
        )
    return _Fault(
        f"no Finished for {name}, and no Heartbeat that says what the device does",
        "send Finished (0x86) when the action has ended; until then, Heartbeat with its state every 250 ms",
    )


def _is_busy(message: messages.Message) -> bool:
    return isinstance(message, messages.Heartbeat) and message.state != messages.State.IDLE


def _scan(talk: _Talk) -> str:
    talk.sent.clear()
    started = talk.ask(_ORDER, messages.Started)
    if rule := broken_start_rule(_ORDER, started):
        raise _Fault(rule, "announce headings × sweeps × pings readings")
    simulated = talk.info and origin_of("", talk.info.firmware, talk.info.serial) is Origin.FAKE
    # the first echo of a simulated scanner may have to wait for a compilation
    talk.made = made = _finished(talk, "StartScan", talk.asked, _ENDS_WITHIN if simulated else _READING_WITHIN)
    expected = [*range(readings_requested(_ORDER))]
    if [reading.number for reading in made] != expected:
        numbers = ", ".join(str(reading.number) for reading in made) or "none"
        raise _Fault(
            f"readings with the numbers {numbers}; expected {', '.join(map(str, expected))}",
            "count the readings of each scan from 0, and send each",
        )
    for reading in made:
        _check_reading(talk, reading)
    if len({reading.fired_us for reading in made}) < len(made):
        raise _Fault("two readings have the same fired_us", _FIRED)
    return f"Started, {len(made)} readings, Finished DONE"


_FIRED = "it is the device clock at the start of each transmission, µs, as in the header of a frame"


def _check_reading(talk: _Talk, reading: messages.ReadingMessage) -> None:
    rule = broken_reading_rule(reading, _ORDER, talk.settings, talk.info.microsteps if talk.info else 0)
    if rule:
        raise _Fault(rule, next(advice for word, advice in _READING_ADVICE.items() if word in rule))
    sent = talk.sent[reading.number]
    if not 0 <= sent - reading.fired_us <= _SENT_WITHIN:
        raise _Fault(
            f"reading {reading.number}: fired_us {reading.fired_us}, in a frame with the time {sent} µs", _FIRED
        )


# by a word of the broken rule
_READING_ADVICE = {
    "its number means sweep": "number the sweeps, and the pings at each heading, from 0",
    "angle": "angles are in µdeg, counter-clockwise, and those of the order; every second sweep runs backwards",
    "": "echo times are in ns, in order, and within the listening time; a reading without an echo has none",
}


def _repeated(talk: _Talk) -> str:
    """The newest command keeps its number when it is repeated."""
    if not talk.made:
        talk.ask(messages.Stop(), messages.Accepted)
        talk.ask_again(messages.Stop(), messages.Accepted)
        return "Stop is answered again"
    talk.ask_again(_ORDER, messages.Started)
    after = talk.await_message(lambda got: isinstance(got, messages.Finished | messages.ReadingMessage))
    if not isinstance(after, messages.Finished):
        what = "begins another scan" if after else "no Finished follows Started"
        raise _Fault(
            f"repeated StartScan: {what}",
            _AGAIN,
        )
    return "a repeated StartScan is answered, and not carried out again"


def _resend(talk: _Talk) -> str:
    talk.ask(messages.Resend(first=1, count=1), messages.Accepted)
    again = talk.await_message(lambda message: isinstance(message, messages.ReadingMessage))
    if not isinstance(again, messages.ReadingMessage) or again.number != 1:
        raise _Fault("Resend is accepted, but reading 1 does not follow", "keep the newest readings, at least one")
    if again != talk.made[1]:
        raise _Fault("reading 1 differs from the one before", "send the kept reading again; do not measure again")
    return "Accepted, then reading 1"


def _stop(talk: _Talk) -> str:
    talk.ask(messages.Stop(), messages.Accepted)
    if not talk.made:
        return "Accepted, if nothing runs"
    talk.ask(_LONG_ORDER, messages.Started)
    scan = talk.asked
    talk.await_message(lambda message: isinstance(message, messages.ReadingMessage), _IDLE_WITHIN)
    try:
        talk.ask(messages.Stop(), messages.Accepted)
    except _Fault as fault:
        if not any(isinstance(message, messages.ReadingMessage) for message in talk.strays):
            raise
        raise _Fault(
            f"during a scan: {fault.text}",
            "make one reading in each pass of the main loop, and read commands between two of them",
        ) from fault
    if not any(isinstance(message, messages.Finished) and message.command == scan for message in talk.strays):
        raise _Fault(
            "Stop is accepted during a scan, but the scan does not end before",
            "send Finished (0x86) with outcome 1, STOPPED, for the scan, then Accepted",
        )
    return "Accepted, after Finished STOPPED of a scan"


def _greeting(talk: _Talk) -> str:
    talk.ask(messages.Hello(limits.PROTOCOL_MAJOR, limits.PROTOCOL_MINOR), messages.Info)
    return "another Hello is answered"


_STAGES: dict[str, Callable[[_Talk], str]] = {
    "Hello": _hello,
    "Capabilities": _capabilities,
    "Configure": _configure,
    "Heartbeat": _heartbeat,
    "clock": _clock,
    "Home": _home,
    "StartScan": _scan,
    "repetition": _repeated,
    "Resend": _resend,
    "Stop": _stop,
    "greeting": _greeting,
}
_MOVING = ("Home", "StartScan", "Resend")


# Why a block is not a frame.


def _fault_of_block(rejected: Rejected) -> _Fault:
    """Return why a block is rejected, and its likely cause."""
    block = rejected.block
    if printed := _TEXT.match(block):
        return _printed(printed[0])
    try:
        body: bytes = cobs.decode(block)
    except cobs.DecodeError:
        return _Fault(
            f"a block that is not byte-stuffed (COBS): {_hex(block)}",
            "stuff type, sequence, time, payload and CRC together, and end them with one zero byte; if all bytes look "
            "random, the baud rate is not 250 000",
        )
    if len(body) < _HEADER + 4:
        return _Fault(
            f"a frame of {len(body)} bytes: {_hex(body)}",
            "a frame has at least 15: type u8, sequence u16, time u64, payload, CRC u32",
        )
    content, crc = body[:-4], body[-4:]
    sent = int.from_bytes(crc, "little")
    for value, text, advice in _crc_mistakes(content):
        if value == sent:
            return _Fault(text, advice)
    right = zlib.crc32(content).to_bytes(4, "little")
    return _Fault(
        f"a CRC-32 of {_hex(crc)} after {len(content)} bytes; expected {_hex(right)}",
        "compute it over type, sequence, time and payload, before byte stuffing; of `123456789` it is 26 39 F4 CB, low "
        "byte first",
    )


def _printed(text: bytes) -> _Fault:
    return _Fault(
        f"text instead of frames: {text[:40].decode('ascii')!r}",
        "print nothing on this line besides frames; a device that prints text is scanned with `lines:PORT`",
    )


def _crc_mistakes(content: bytes) -> Iterator[tuple[int, str, str]]:
    """Yield CRCs that firmware computes by mistake, each with the mistake and what to do."""
    right = zlib.crc32(content)
    yield int.from_bytes(right.to_bytes(4, "little"), "big"), "CRC in big-endian order", "send its low byte first"
    yield right ^ 0xFFFFFFFF, "a CRC that is not inverted at its end", "invert the result: crc ^ 0xFFFFFFFF"
    yield _crc(content, 0, 0xFFFFFFFF), "a CRC that starts with 0", "start with 0xFFFFFFFF"
    yield (
        _crc(content, 0, 0),
        "a CRC that starts with 0 and is not inverted",
        "start with 0xFFFFFFFF, and invert the end",
    )
    yield zlib.crc32(content[_HEADER:]), "a CRC of the payload only", "begin with the type of the frame"
    yield zlib.crc32(content[1:]), "a CRC without the type of the frame", "begin with the type of the frame"
    yield zlib.crc32(cobs.encode(content)), "a CRC of the stuffed bytes", "compute the CRC before byte stuffing"
    yield 0, "a CRC of 0", "compute the CRC-32 of zlib over type, sequence, time and payload"


def _crc(data: bytes, start: int, end: int) -> int:
    """Return the reflected CRC-32 with another start and another final XOR."""
    return zlib.crc32(data, start ^ 0xFFFFFFFF) ^ 0xFFFFFFFF ^ end


def _payload_advice(kind: type[messages.Message], frame: Frame) -> str:
    """Return the likely cause of a payload that is too short, in the first frame of a device."""
    payload = frame.time_us.to_bytes(8, "little")[4:] + frame.payload
    try:
        message = kind.unpack(payload)
    except messages.MessageError:
        return _fields_advice(kind, frame.payload, 0)
    if payload not in (message.pack(later) for later in range(limits.PROTOCOL_MINOR + 1)):
        return _fields_advice(kind, frame.payload, 0)
    return "the time in the header of a frame has 8 bytes, not 4"


def _fields_advice(kind: type[messages.Message], payload: bytes, minor: int) -> str:
    sent = (item for item in fields(kind) if item.metadata["since"] <= minor)
    listed = ", ".join(f"{item.name} {item.metadata['wire'].name}" for item in sent)
    return f"send its fields in order, without padding: {listed}; its payload is {_hex(payload) or 'empty'}"


def _hex(data: bytes) -> str:
    shown = data[:24].hex(" ").upper()
    return f"{shown} …" if len(data) > 24 else shown
