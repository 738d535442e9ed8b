"""Commands for one scanner: move, ask, fake or replay it, find its port, check its wiring, and flash its firmware."""

import math
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from itertools import chain, repeat
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.controllers import POLAROID, STEP_DIR, Combination, Controller, Ranging, Turning
from sonarhw.errors import CommandRefused, ExitStatus, InputError, SonarError, counted
from sonarhw_cli import inputs, options
from sonarhw_cli.interruption import sigterm_exits

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sonarhw.bringup import Diagnosis, Plate
    from sonarhw.host.scanner import DeviceCapabilities, DeviceInfo, Scanner
    from sonarhw.link import Link, LinkStatistics, Port
    from sonarhw.plugins.device_plugin import CheckedPlugin
    from sonarhw.text_device import LineGuess
    from sonarhw.wire.frames import Frame, Rejected
    from sonarhw.wire.messages import Outcome, Statistics, Wiring

# Manual control of a scanner: `sonarhw home`, `turn`, `stop` and `monitor`.


_MOST_JOG = 10.0  # degrees
_SHOWN = 24  # bytes of a rejected block


def home(url: inputs.ScannerUrl) -> None:
    """Find the zero of the turntable."""
    with inputs.connect_turntable(url) as scanner:
        outcome = scanner.home()
    options.print_note(f"{url}: {_ended(outcome, 'the turntable is at its zero')}")


Jog = Annotated[
    bool, typer.Option("--jog", help="Turn by DEG, at most 10 degrees, from the present angle, without homing.")
]


def turn(
    url: inputs.ScannerUrl,
    degrees: Annotated[float, typer.Argument(help="Turntable angle, degrees, counter-clockwise.", metavar="DEG")],
    zero_here: options.ZeroHere = False,
    jog: Jog = False,
) -> None:
    """Turn to an angle. If the zero of the turntable is unknown, it is found first."""
    options.check_degrees("--jog" if jog else "DEG", degrees, _MOST_JOG if jog else None)
    with inputs.connect_turntable(url) as scanner:
        if zero_here:
            scanner.home(here=True)
        done = f"turned {'by' if jog else 'to'} {degrees:.1f}°"
        outcome = scanner.jog(math.radians(degrees)) if jog else scanner.turn(math.radians(degrees))
    options.print_note(f"{url}: {_ended(outcome, done)}")


def stop(url: inputs.ScannerUrl) -> None:
    """Stop turning and pinging."""
    with inputs.connect_turntable(url) as scanner:
        scanner.stop()
    options.print_note(f"{url}: stopped")


def _ended(outcome: "Outcome", done: str) -> str:
    """Return what an action did: `done`, or that it was stopped."""
    return "stopped before it had finished" if outcome else done


def monitor(url: inputs.ScannerUrl) -> None:
    """Print frames as they arrive, until Ctrl-C (to measure: `ping`).

    Rejected bytes are printed too, and the numbers of both follow at the end. The scanner is stopped first. Of a device
    that prints text, the received bytes and the readings in them are printed.
    """
    from sonarhw.link import Link
    from sonarhw.plugins.device_plugin import is_plugin, make_plugin

    if is_plugin(url):
        with make_plugin(url) as plugin:
            _monitor_plugin(plugin)
    with inputs.resolve(url) as find, Link(find()) as link:
        arrived = _Arrived()
        try:
            _show(link, arrived)
        finally:
            options.print_note(f"{url}: {arrived}")


def _monitor_plugin(plugin: "CheckedPlugin") -> NoReturn:
    """Print what a plug-in reads, until Ctrl-C."""
    began, readings = time.monotonic(), 0
    plugin.open()
    try:
        while True:
            received, measurements = plugin.read()
            now = f"{time.monotonic() - began:10.3f}"
            if received:
                options.print_line(f"{now}  {received!r}")
            for measurement in measurements:
                ranges = " ".join(f"{distance:.3f} m" for distance in measurement.ranges) or "no echo"
                options.print_line(f"{now}  {math.degrees(measurement.angle):.1f}°  {ranges}")
            readings += len(measurements)
    finally:
        plugin.close()
        ignored = "".join(f", {kind} ({count})" for kind, count in plugin.ignored.items() if count)
        options.print_note(f"{plugin.url}: {counted(readings, 'reading')}{ignored}")


@dataclass
class _Arrived:
    """The number of frames and rejected blocks since the start."""

    began: float = field(default_factory=time.monotonic)  # s
    frames: int = 0
    rejected: int = 0

    def __str__(self) -> str:
        after = f"in {self.seconds:.1f} s"
        if not self.frames:
            return f"no frame {after}, {counted(self.rejected, 'rejected block')}; check that this is a scanner"
        return f"{counted(self.frames, 'frame')} and {counted(self.rejected, 'rejected block')} {after}"

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.began


def _show(link: "Link", arrived: _Arrived) -> NoReturn:
    from sonarhw.host.driver import SIGN_OF_LIFE
    from sonarhw.wire.frames import DELIMITER, Frame, FrameDecoder, encode_frame
    from sonarhw.wire.limits import PROTOCOL_MAJOR, PROTOCOL_MINOR
    from sonarhw.wire.messages import AskStatistics, Hello, Info, Message

    decoder = FrameDecoder()
    sequence, next_message, greeted = 0, arrived.began + link.quiet, False
    while True:
        now = time.monotonic()
        if now >= next_message:
            # a scanner that receives nothing releases its motor and stops sending
            sent: Message = AskStatistics() if greeted else Hello(PROTOCOL_MAJOR, PROTOCOL_MINOR)
            link.write(DELIMITER + encode_frame(Frame(sent.TYPE, sequence, 0, sent.pack())))
            sequence, next_message = (sequence + 1) % 0x10000, now + SIGN_OF_LIFE
        for item in decoder.feed(link.read()):
            if isinstance(item, Frame):
                greeted = greeted or item.type == Info.TYPE
                arrived.frames += 1
                shown = _described(item)
            else:
                arrived.rejected += 1
                shown = _rejected(item)
            options.print_line(f"{arrived.seconds:10.3f}  {shown}")


def _described(frame: "Frame") -> str:
    from sonarhw.wire.messages import MessageError, unpack_message

    try:
        content = unpack_message(frame.type, frame.payload)
    except MessageError as error:
        return f"#{frame.sequence} type 0x{frame.type:02x} malformed: {error}"
    what = content if content is not None else f"type 0x{frame.type:02x} unknown, payload {frame.payload.hex(' ')}"
    return f"#{frame.sequence} {frame.time_us / 1e6:.6f} s  {what}"


def _rejected(rejected: "Rejected") -> str:
    more = " ..." if len(rejected.block) > _SHOWN else ""
    return f"rejected {len(rejected.block)} bytes ({rejected.reason}): {rejected.block[:_SHOWN].hex(' ')}{more}"


# `sonarhw info`: print identity, capabilities and link quality of a scanner.


_EXCHANGES = 20  # commands sent for the link statistics


Watch = Annotated[bool, typer.Option("--watch", help="Also print the link statistics once a second, until Ctrl-C.")]


def info(
    url: inputs.ScannerUrl,
    watch: Watch = False,
    as_json: options.AsJson = False,
) -> None:
    """Print identity and link quality of a scanner (to test it: `doctor`). Its capabilities are printed too."""
    with inputs.connect(url) as scanner:
        device = _exercise_link(scanner)
        if as_json:
            options.print_json(_figures(scanner, device))
            return
        facts = [*_identity(scanner.info), *_capabilities(scanner.info), *_link(scanner, device)]
        if not _protocol(scanner.info):
            ignored = ", ".join(f"{kind} ({count})" for kind, count in scanner.ignored.items())
            facts.append(("ignored", ignored or "nothing"))
        if url.endswith(".mcap"):
            facts.append(("readings", f"`sonarhw log info {quote(url)}` describes the log"))
        for name, value in facts:
            options.print_line(f"{name:<14}{value}")
        while watch:
            time.sleep(1.0)
            device = _device_statistics(scanner)
            clock = f"; clock drift {scanner.clock_drift * 1e6:+.0f} ppm"
            options.print_line(f"{scanner.state:<14}{_host_counts(scanner.statistics)}{_device_counts(device)}{clock}")


def _exercise_link(scanner: "Scanner") -> "Statistics | None":
    device = None
    for _ in range(_EXCHANGES if _protocol(scanner.info) else 0):
        device = _device_statistics(scanner)
        if device is None:
            scanner.stop()  # older firmware answers this command
    return device


def _device_statistics(scanner: "Scanner") -> "Statistics | None":
    if scanner.info.protocol < (1, 1):
        return None
    try:
        return scanner.device_statistics()
    except CommandRefused:
        return None


def _figures(scanner: "Scanner", device: "Statistics | None") -> dict[str, Any]:
    """Return the scanner under the keys of `info --json`; angles in degrees, None for what it does not state."""
    from sonarhw.readings import origin_of

    info, can = scanner.info, scanner.info.capabilities
    return {
        "url": scanner.url,
        "origin": origin_of("scan", info.firmware, info.serial),
        "firmware": info.firmware,
        "protocol": _protocol(info),
        "serial": info.serial or None,
        "starts": info.boot or None,
        "board": info.board or None,
        "trace_rate_hz": info.trace_rate or None,
        "microsteps": info.microsteps or None,
        "temperature_c": info.temperature_c,
        "capabilities": None
        if can is None
        else {
            "features": _features(can),
            "lowest_angle_deg": round(math.degrees(can.lowest_angle), 6),
            "highest_angle_deg": round(math.degrees(can.highest_angle), 6),
            "fastest_deg_s": round(math.degrees(can.fastest), 6),
            "longest_listen_s": round(can.longest_listen, 6),
            "ping_period_s": round(can.ping_period, 6),
            "fastest_baud": can.fastest_baud or None,
            "turning": can.turning or None,
        },
        "baud": scanner.baud,
        "link": asdict(scanner.statistics),
        "device": None
        if device is None
        else {"frames": device.frames, "rejected": device.rejected, "overruns": device.overruns},
    }


def _protocol(device: "DeviceInfo") -> str | None:
    """Return the version of the wire protocol; None for a device that does not speak it."""
    return f"{device.protocol[0]}.{device.protocol[1]}" if device.protocol[0] else None


def _features(can: "DeviceCapabilities") -> list[str]:
    from sonarhw.wire.messages import Feature

    return [(feature.name or "").lower().replace("_", " ") for feature in Feature if feature in can.features]


def _identity(device: "DeviceInfo") -> list[tuple[str, str]]:
    return [
        ("firmware", device.firmware),
        ("protocol", _protocol(device) or "none; it prints readings"),
        ("serial", device.serial or "none"),
        ("started", counted(device.boot, "time") if device.boot else "not counted"),
        ("board", device.board or "not stated"),
        ("traces", f"{device.trace_rate / 1000:g} kHz" if device.trace_rate else "none"),
        ("turntable", f"{360 / device.microsteps:.4g} degrees a microstep" if device.microsteps else "not stated"),
        ("temperature", "no thermometer" if device.temperature_c is None else f"{device.temperature_c:.1f} °C"),
    ]


def _capabilities(device: "DeviceInfo") -> list[tuple[str, str]]:
    can = device.capabilities
    if can is None:
        return [("capabilities", "not stated")]
    low, high = math.degrees(can.lowest_angle), math.degrees(can.highest_angle)
    return [
        ("capabilities", ", ".join(_features(can)) or "none"),
        ("turned by", can.turning or "not stated"),
        ("turns", f"{low:.6g} to {high:.6g} degrees, at most {math.degrees(can.fastest):.4g} degrees a second"),
        ("listens", f"{can.longest_listen * 1000:.4g} ms, a ping every {can.ping_period * 1000:.4g} ms"),
        ("line", f"up to {can.fastest_baud} baud" if can.fastest_baud else "no baud rate"),
    ]


def _link(scanner: "Scanner", device: "Statistics | None") -> list[tuple[str, str]]:
    can = scanner.info.capabilities
    speed = f", {scanner.baud} baud" if scanner.baud and can and can.fastest_baud else ""
    return [("link", f"{_host_counts(scanner.statistics)}{speed}{_device_counts(device)}")]


def _host_counts(link: "LinkStatistics") -> str:
    trip = "" if link.round_trip is None else f", round trip {link.round_trip * 1000:.1f} ms"
    return (
        f"{link.frames_received} frames, {link.missing_frames} missing, {link.rejected_blocks} rejected, "
        f"{link.repeated_commands} commands repeated, lost {counted(link.losses, 'time')}{trip}"
    )


def _device_counts(device: "Statistics | None") -> str:
    if device is None:
        return ""
    return f"; the scanner: {device.frames} frames, {device.rejected} rejected, {device.overruns} bytes overrun"


# `sonarhw ports`: list the serial ports of this computer, and the scanners that answer there.


AskAll = Annotated[
    bool, typer.Option("--ask", help="Check every port for a scanner, not only those with known USB ids.")
]
Guess = Annotated[
    bool,
    typer.Option("--guess", help="Listen for text, and propose the URL of a device that prints readings."),
]


def ports(
    port: Annotated[list[str] | None, typer.Argument(help="Only these ports; default: all.", metavar="PORT")] = None,
    ask: AskAll = False,
    guess: Guess = False,
    as_json: options.AsJson = False,
) -> None:
    """List serial ports and what is there: a scanner, or text (`--guess`). The check may reset the device at a port."""
    from sonarhw.link import Port, serial_ports

    by_name = {found_port.device: found_port for found_port in serial_ports()}
    for name in port or ():
        if re.fullmatch("[a-z-]+", name) and name not in by_name:
            raise InputError(f"{name}: expected a port such as /dev/ttyUSB0; without one, `sonarhw ports` lists all")
    chosen = [by_name.get(name, Port(name, "")) for name in port] if port else [*by_name.values()]
    if not chosen:
        options.print_note("no serial ports")
    listed = []
    for candidate in chosen:
        wanted = bool(ask or port or candidate.known)
        listed.append(
            _described_port(candidate) | (_guessed(candidate, wanted) if guess else _probed(candidate, wanted))
        )
        if not as_json:
            answer = listed[-1]["answer"] or f"not checked; {'name the port' if guess else '--ask checks all'}"
            options.print_line(
                "  ".join(filter(None, (candidate.device, candidate.known or candidate.description, answer)))
            )
            for fact in listed[-1].get("evidence") or ():
                options.print_line(f"    {fact}")
            if guess:
                _print_next(listed[-1])
    if as_json:
        options.print_json({"ports": listed})


def _print_next(guessed: dict[str, Any]) -> None:
    """Print the command that scans at a proposed URL, with each answer to what is undecided."""
    first = "next, with your answer" if guessed["undecided"] else "next"
    for label, url in zip(chain([first], repeat("or")), guessed["answered_urls"], strict=False):
        options.print_note(f"{label}: sonarhw scan '{url}' --out scan.mcap")


def _described_port(port: "Port") -> dict[str, Any]:
    """Return a port under the keys of `ports --json`."""
    usb = port.usb
    return {
        "url": port.device,
        "description": port.description,
        "known_as": port.known,
        "usb_id": None if usb is None else f"{usb.vendor:04x}:{usb.product:04x}",
        "usb_serial": None if usb is None else usb.serial_number,
    }


def _probed(port: "Port", wanted: bool) -> dict[str, Any]:
    """Return whether a scanner answers at a port, and its answer; None if it was not checked."""
    from sonarhw.host.scanner import probe_port

    scanner, answer = probe_port(port.device) if wanted else (None, None)
    return {"scanner": scanner, "answer": answer}


def _guessed(port: "Port", wanted: bool) -> dict[str, Any]:
    """Return what the device at a port prints; None if it was not checked."""
    from sonarhw.errors import LinkError
    from sonarhw.text_device import LineGuess, guess_lines

    guess = LineGuess(port.device)
    try:
        guess = guess_lines(port.device, drafted=_print_draft) if wanted else guess
        answer = guess.text if wanted else None
    except LinkError as error:
        answer = str(error).removeprefix(f"{port.device}: ")
    questions = guess.proposal.questions
    return {
        "answer": answer,
        "proposed_url": guess.url,
        "preset": guess.preset,
        "baud": guess.baud,
        "evidence": [*guess.details],
        "undecided": [str(question) for question in questions],
        "questions": [
            {"problem": question.problem, "answers": [*map(dict, question.answers)]} for question in questions
        ],
        "answered_urls": [*guess.answered_urls],
    }


def _print_draft(guess: "LineGuess") -> None:
    """Print the first proposal, while the command listens until a sweep has passed."""
    options.print_note(f"{guess.port}: {guess.text}; listening on")


# `sonarhw board`, behind `make board`: the real firmware on an emulated board in the demo room.
#
# The command is not listed by --help, because it needs a checkout and compilers.


BuiltCombination = Annotated[
    str, typer.Option(help="Controller, ranging and turning, as the firmware is built.", metavar="NAME")
]


def board(
    pty: options.PtyLink = None,
    pace: Annotated[str, typer.Option(help="Real time, or N times faster.", metavar="real|N")] = "real",
    seed: Annotated[int, typer.Option(help="Seed of all random values in the room.", min=0)] = 0,
    combination: BuiltCombination = "mega-polaroid-step-dir",
) -> None:
    """Run the firmware on an emulated board. The first line of standard output is its URL."""
    from sonarhw_compare.scanner_url import DEMO_PLACE, DEMO_ROOM
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.predict.room_echoes import RoomEchoes
    from sonarhw_sim.room.room import load_room

    from sonarhw.device.emulated_board import emulated_board
    from sonarhw.device.served import read_pace

    room = load_room(DEMO_ROOM)
    echoes = RoomEchoes(
        room, room.place(DEMO_PLACE), load_board("hc-sr04" if "-hc-sr04-" in combination else DEFAULT_BOARD), seed
    )
    # now, before a client can connect: the emulated board stops while it waits for the echoes of a ping
    echoes.prepare()
    with sigterm_exits(), emulated_board(echoes, pty, read_pace(pace), combination=combination) as running:
        options.print_line(running.url)
        running.wait()


# `sonarhw fake`: serve a fake scanner on a pseudo-terminal or a TCP port.


Pace = Annotated[str, typer.Option(help="Real time, N times faster, or without waiting.", metavar="real|N|max")]
Faults = Annotated[
    str,
    typer.Option(help="Faults, such as drop=1/5000,reset@r20; see docs/devices/faults.md.", metavar="SPEC"),
]


def fake(
    room_name: options.RoomName,
    place: options.PlaceName = None,
    board: options.BoardName = DEFAULT_BOARD,
    pty: options.PtyLink = None,
    tcp: options.TcpAddress = None,
    seed: Annotated[int, typer.Option(help="Seed of all random values.", min=0)] = 0,
    pace: Pace = "real",
    faults: Faults = "",
) -> None:
    """Serve a fake scanner for other programs (to watch one: `demo`).

    The first line of standard output is its URL.

    --faults: drop, flip, insert=SHARE of the bytes; drift=PPM; protocol=0.9; miswire=WIRE; stall, deaf, mute, reset,
    nonsense, unplug, move=SECONDS; wedge=SECONDS, slip=MICROSTEPS of the turntable. Faults with SECONDS or MICROSTEPS
    start @SECONDS, @rPINGS or, repeatedly, @~SECONDS. After `move` the new URL is printed.
    """
    from sonarhw_compare.scanner_url import fake_device
    from sonarhw_sim.board.profile import load_board

    from sonarhw.device.faults import read_faults
    from sonarhw.device.served import Endpoint, host_and_port, open_server_port, read_pace

    if tcp is not None:
        host_and_port(tcp)
    profile, room = load_board(board), inputs.open_room(room_name)
    here = inputs.chosen_place(room, place)
    chosen_pace, schedule = read_pace(pace), read_faults(faults)
    with sigterm_exits(), open_server_port(pty, tcp) as port:
        options.print_line(port.url)
        # clients can connect from now on, during the slow preparation
        device, echoes = fake_device(room, here, profile, seed, schedule)
        endpoint = Endpoint(device, port, chosen_pace, moved=options.print_line)
        with _prepared_meanwhile(echoes.prepare, endpoint.stop):
            endpoint.run()


@contextmanager
def _prepared_meanwhile(prepare: Callable[[], None], stop: Callable[[], None]) -> Iterator[None]:
    """Run `prepare` in a thread; if it fails, call `stop`, and raise its error at the end of the block."""
    failures: list[BaseException] = []

    def run() -> None:
        try:
            prepare()
        except BaseException as failure:  # noqa: BLE001 - raised again in the main thread
            failures.append(failure)
            stop()

    # a daemon thread, so that the process can end during a compilation
    threading.Thread(target=run, name="prepare", daemon=True).start()
    yield
    if failures:
        raise failures[0]


# `sonarhw replay`: serve a log as a live scanner, on a pseudo-terminal or a TCP port.


Speed = Annotated[
    float, typer.Option(help="Factor on the recorded speed; inf: as fast as the client reads.", metavar="F")
]


def replay(
    log: inputs.LogFile,
    speed: Speed = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat the log until the requested scan is complete.")] = False,
    pty: options.PtyLink = None,
    tcp: options.TcpAddress = None,
) -> None:
    """Serve a log as a live scanner (to look at a log: `gui`).

    Each scan command replays it. The first line of standard output is its URL.
    """
    from sonarhw.device.replayed_log import ReplayDevice
    from sonarhw.device.served import Endpoint, open_server_port
    from sonarhw_cli.interruption import sigterm_exits

    if not speed > 0:
        raise InputError(f"--speed {speed:g}: expected a factor above 0, such as 2, or inf")
    recorded = inputs.open_log(log)
    if not recorded.readings:
        raise InputError(f"{log}: contains no readings; nothing to replay")
    # for inf the endpoint does not wait, and the readings keep their recorded times
    at_once = math.isinf(speed)
    device = ReplayDevice(recorded, 1.0 if at_once else speed, loop)
    with sigterm_exits(), open_server_port(pty, tcp) as port:
        endpoint = Endpoint(device, port, "max" if at_once else "real")
        options.print_line(port.url)
        endpoint.run()


# `sonarhw doctor`: check a new scanner step by step.


_WIDTH = 14  # characters of the name of a check


WithTurning = Annotated[
    bool, typer.Option("--turn/--no-turn", help="Also check motor and home switches; the table turns.")
]
PlateAngle = Annotated[
    float | None, typer.Option(help="Turntable angle of a plate, degrees, counter-clockwise.", metavar="DEG")
]
ProtocolOnly = Annotated[
    bool, typer.Option("--protocol", help="Check the messages of a new firmware instead, one after another.")
]
PlateDistance = Annotated[float | None, typer.Option(help="Distance of this plate from the transducer, metres.")]


def doctor(
    url: inputs.ScannerUrl,
    turn: WithTurning = True,
    plate: PlateAngle = None,
    distance: PlateDistance = None,
    protocol: ProtocolOnly = False,
) -> None:
    """Test a scanner part by part (identity only: `info`).

    The steps are line, firmware, ranging board, turntable, and a first plate. Each check is a line: pass, FAIL or skip,
    what was found, and what to do. Exit status 1 if any check fails. With --protocol, the firmware is checked message
    by message, up to the first that is missing or wrong.
    """
    wanted = _plate(plate, distance)
    made: list[Diagnosis] = []
    try:
        for diagnosis in _diagnoses(url, turn, wanted, protocol):
            made.append(diagnosis)
            _print(diagnosis)
    except InputError:
        raise
    except SonarError as error:
        from sonarhw.bringup import failed

        made.append(failed("line", str(error), "check port, cable and supply; `sonarhw ports` lists the ports"))
        _print(made[-1])
    failures = sum(diagnosis.verdict == "FAIL" for diagnosis in made)
    options.print_note(f"{url}: {counted(failures, 'check')} failed" if failures else f"{url}: no check failed")
    raise typer.Exit(ExitStatus.FAILED if failures else ExitStatus.DONE)


def _diagnoses(url: str, turn: bool, plate: "Plate | None", protocol: bool) -> "Iterator[Diagnosis]":
    from sonarhw.bringup import examine

    if not protocol:
        with inputs.connect_turntable(url) as scanner:
            yield from examine(scanner, turn, plate)
        return
    from sonarhw.protocol_check import check_protocol

    if plate:
        raise InputError("--protocol: checks no plate; remove --plate and --distance")
    with inputs.resolve(url) as find:
        yield from check_protocol(find(), turn)


def _plate(heading: float | None, distance: float | None) -> "Plate | None":
    from sonarhw.bringup import BESIDE, Plate

    if heading is None or distance is None:
        return None
    if not 10 <= abs(heading) <= math.degrees(BESIDE):
        raise InputError(f"--plate {heading:g}: expected 10 to {math.degrees(BESIDE):g} degrees on one side of zero")
    if not distance > 0:
        raise InputError(f"--distance {distance:g}: expected metres above 0")
    return Plate(math.radians(heading), distance)


def _print(diagnosis: "Diagnosis") -> None:
    options.print_line(f"{diagnosis.verdict}  {diagnosis.check:<{_WIDTH}}{diagnosis.text}")
    if diagnosis.advice:
        options.print_line(f"{'':{_WIDTH + 6}}→ {diagnosis.advice}")


# `sonarhw flash`: write the prebuilt firmware to a board.


FlashedPort = Annotated[str, typer.Argument(help="Serial port of the board, such as /dev/ttyACM0.", metavar="PORT")]
ControllerChoice = Annotated[
    Controller | None, typer.Option(help="Controller of the board; default: the one that is recognised.")
]
RangingChoice = Annotated[
    Ranging | None, typer.Option(help=f"Ranging board; default: as the board answers, else {POLAROID}.")
]
TurningChoice = Annotated[
    Turning | None, typer.Option(help=f"Turntable; default: as the board answers, else {STEP_DIR}.")
]
ForceUnknown = Annotated[
    bool, typer.Option("--force", help="Also flash a board that is not recognised; needs --controller.")
]

# a URL, a controller or a file of firmware
_NO_PORT = re.compile(r"^[^/]+:|^(uno|nano|mega|esp\w*|arduino)$|\.(hex|ino|bin|elf|uf2)$", re.IGNORECASE)


def flash(
    port: FlashedPort,
    controller: ControllerChoice = None,
    ranging: RangingChoice = None,
    turning: TurningChoice = None,
    force: ForceUnknown = False,
) -> None:
    """Write the firmware to a board, and verify it.

    avrdude writes the firmware that comes with sonarhw. Then the identity that the board answers is printed. A board is
    recognised by its USB identity, or by a scanner firmware that runs on it. No compiler is needed. A Nano with a new
    bootloader is flashed as an Uno.
    """
    from sonarhw import bringup

    if _NO_PORT.search(port):
        raise InputError(
            f"{port}: expected a serial port such as /dev/ttyACM0; the firmware is included, and --controller "
            "selects it"
        )
    if controller and ranging and turning:
        Combination(controller, ranging, turning)  # refused before the port is opened
    bringup.find_avrdude()
    present, profile, turntable = bringup.find_board(port)
    wanted = Combination(
        controller if controller and force else _recognised(port, present, controller),
        ranging or bringup.ranging_of(profile),
        turning or bringup.turning_of(turntable),
    )
    options.print_note(f"{port}: writing the firmware {wanted.image}; this takes about 20 s")
    bringup.write_firmware(port, wanted)
    info = bringup.ask_identity(port, wanted)
    options.print_line(f"{port}: {info.firmware}, protocol {info.protocol[0]}.{info.protocol[1]}, {info.serial}")


def _recognised(port: str, present: Controller | None, wanted: Controller | None) -> Controller:
    """Return the controller to flash. Raises InputError if none is `present`, or not the `wanted` one."""
    from sonarhw.bringup import same_chip

    if present and wanted and same_chip(present, wanted):
        return wanted
    if present is None or wanted:
        what = "is not recognised" if present is None else f"has the controller {present}, not {wanted}"
        raise InputError(f"{port}: the board {what}; if you are sure, add --force and --controller")
    return present


# `sonarhw wiring`: the levels of the inputs of a scanner, what is inverted, and its switches.


class WiredPart(StrEnum):
    """A part that can be inverted."""

    MARK = "mark"
    CAM = "cam"
    MOTOR = "motor"


Inverted = Annotated[
    list[WiredPart] | None, typer.Option(help="Invert this switch or the direction of the motor; repeatable.")
]
NotInverted = Annotated[list[WiredPart] | None, typer.Option(help="Do not invert this part any more; repeatable.")]
OneSwitch = Annotated[
    bool | None,
    typer.Option(
        "--one-switch/--no-one-switch",
        help="Home by the mark alone, without a cam. The table then turns less than half a turn from zero. Put it "
        "within 45 degrees of zero, with the cable in its middle, before the first home.",
    ),
]


def wiring(
    url: inputs.ScannerUrl,
    invert: Inverted = None,
    normal: NotInverted = None,
    one_switch: OneSwitch = None,
) -> None:
    """Print the levels of the inputs and what is inverted. The scanner keeps what the options set.

    After a change, the next home searches the zero again.
    """
    from sonarhw.wire.messages import Input, Wiring

    wanted, plain = _wiring(invert or ()), _wiring(normal or ())
    if wanted & plain:
        raise InputError("--invert, --normal: the same part is in both; name it once")
    if one_switch is not None:
        wanted |= Wiring.ONE_SWITCH if one_switch else Wiring(0)
        plain |= Wiring.ONE_SWITCH & ~wanted
    with inputs.connect_turntable(url) as scanner:
        inverted = scanner.configure_wiring(wanted | plain, wanted)
        levels = scanner.inputs()
    for item in Input:
        level = "unknown" if levels is None else "high" if item in levels else "low"
        options.print_line(f"{str(item.name).lower():<10}{level}")
    names = ", ".join(part.value for part in WiredPart if _wiring([part]) in inverted)
    options.print_line(f"{'inverted':<10}{names or 'nothing'}")
    if Wiring.ONE_SWITCH in inverted:
        options.print_line(f"{'homes by':<10}mark")


def _wiring(parts: "Iterable[WiredPart]") -> "Wiring":
    from sonarhw.wire.messages import Wiring

    return Wiring(sum(Wiring[part.name] for part in {*parts}))
