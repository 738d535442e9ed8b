"""Bring a scanner up: the checks of `sonarhw doctor`, and flashing of prebuilt firmware."""

import math
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.resources import as_file, files
from typing import Literal, TypeVar, get_args

import numpy as np

from sonarhw.controllers import POLAROID, STEP_DIR, Combination, Controller, Ranging, Turning
from sonarhw.errors import CommandRefused, DeviceError, InputError, LinkLost, SonarError
from sonarhw.host.scanner import DeviceCapabilities, DeviceInfo, Scanner
from sonarhw.link import LinkStatistics, serial_ports
from sonarhw.readings import Reading, ScanOrder, pings_in_place, sector
from sonarhw.scan_check import most_common_range
from sonarhw.wire.limits import PROTOCOL_MAJOR, PROTOCOL_MINOR
from sonarhw.wire.messages import Feature, Input, Refusal, ResetCause, Statistics

# the diagnoses of `sonarhw doctor`: each function judges what was measured, and states what to do


COLDEST, HOTTEST = -20.0, 60.0  # °C; outside, a wire is wrong rather than the air
MOST_AT_ONE_TIME = 0.65  # of the headings
BURST_END = 0.003  # s; later signals in a trace are echoes, not the burst itself
SAME_ECHO = 0.05  # of the time; more is another echo
MOST_CHANGED = 0.25  # of the headings
LOUD = 0.3  # of full scale; of an echo in a trace that the board should have reported
QUIET = 0.15  # of full scale; median of the end of a trace without echoes
PLATE_ERROR, PLATE_SPREAD = 0.05, 0.005  # of the distance; m
HEADING_ERROR = math.radians(20)
STEPS_ADVICE = "check the microstep jumpers and the current of the driver, the belt, and what blocks the table"


Verdict = Literal["pass", "FAIL", "skip"]  # skip: not checked


@dataclass(frozen=True)
class Diagnosis:
    """The result of one check."""

    check: str
    verdict: Verdict
    text: str  # what was found
    advice: str = ""  # what to do; empty if it passed


def passed(check: str, text: str) -> Diagnosis:
    """Return the diagnosis that all is well."""
    return Diagnosis(check, "pass", text)


def failed(check: str, text: str, advice: str) -> Diagnosis:
    """Return the diagnosis that something is wrong."""
    return Diagnosis(check, "FAIL", text, advice)


def skipped(check: str, text: str, advice: str = "") -> Diagnosis:
    """Return the diagnosis that something was not checked."""
    return Diagnosis(check, "skip", text, advice)


def line(counted: LinkStatistics, rejected: int, baud: int | None) -> Diagnosis:
    """Judge the counters of an exchange of commands, of which the scanner has `rejected` some frames.

    `baud` is the rate of the line; None: it has none.
    """
    rate = f"{baud} baud, " if baud else ""
    damaged = counted.rejected_blocks + counted.missing_frames + rejected
    if damaged or counted.repeated_commands:
        text = f"{rate}{damaged} damaged or lost frames, {counted.repeated_commands} repeated commands"
        return failed("line", text, "use a short USB cable, no hub, and keep it away from the wires of the motor")
    round_trip = "" if counted.round_trip is None else f", {counted.round_trip * 1e3:.1f} ms"
    return passed("line", f"{rate}{counted.frames_received} frames, none damaged{round_trip}")


def firmware(info: DeviceInfo) -> Diagnosis:
    """Judge the version of the firmware, and state the parts for which it is built."""
    parts = [info.board, info.capabilities.turning if info.capabilities else ""]
    text = ", ".join([info.firmware, f"protocol {info.protocol[0]}.{info.protocol[1]}", *filter(None, parts)])
    if info.protocol < (PROTOCOL_MAJOR, PROTOCOL_MINOR):
        newest = f"{PROTOCOL_MAJOR}.{PROTOCOL_MINOR}"
        return failed(
            "firmware",
            f"{text}; {newest} has all checks",
            "write the firmware of this version: `sonarhw flash PORT`; for your own: `sonarhw doctor URL --protocol`",
        )
    return passed("firmware", text)


def temperature(celsius: float | None) -> Diagnosis:
    """Judge the temperature of the air at the board; None: no thermometer."""
    if celsius is None:
        advice = "if there is a thermistor, check its wires to A1 and to ground"
        return skipped("thermometer", "none, or its wire is open", advice)
    if not COLDEST < celsius < HOTTEST:
        advice = "check the thermistor and its resistor; without a thermistor, leave A1 pulled up to 5 V"
        return failed("thermometer", f"{celsius:.1f} °C", advice)
    return passed("thermometer", f"{celsius:.1f} °C")


def echo_idle(levels: Input | None) -> Diagnosis:
    """Judge the level of ECHO while the board does not listen; None: not reported."""
    if levels is None:
        return skipped("ECHO at rest", "the device does not report its inputs")
    if Input.ECHO in levels:
        advice = "ECHO is stuck: check that INIT reaches the ranging board, and ECHO for a short to 5 V"
        return failed("ECHO at rest", "high while INIT is low", advice)
    return passed("ECHO at rest", "low")


def echoes(readings: Sequence[Reading]) -> Diagnosis:
    """Judge whether the board detects echoes at all."""
    heard = sum(bool(reading.echo_times) for reading in readings)
    if not heard and _loudest(readings) > LOUD:
        return failed(
            "echoes",
            f"none in {len(readings)} pings, but the traces show some",
            "the board transmits and receives: check the wire of ECHO and its pull-up (4.7 kΩ to 5 V)",
        )
    if not heard:
        advice = (
            "hold a plate at 1 m; check the 5 V supply of the ranging board, INIT, the pull-up of ECHO (4.7 kΩ), "
            "and that you hear a click at each ping"
        )
        return failed("echoes", f"none in {len(readings)} pings", advice)
    ranges = [reading.range for reading in readings if reading.range is not None]
    return passed("echoes", f"in {heard} of {len(readings)} pings, the first at {np.median(ranges):.3f} m")


def _loudest(readings: Sequence[Reading]) -> float:
    """Return the loudest sample after the burst in any trace, of full scale; 0 without traces."""
    traces = [reading.trace for reading in readings if reading.trace is not None]
    after = [trace.samples[max(0, round((BURST_END - trace.start) * trace.rate)) :] for trace in traces]
    return max((float(np.nanmax(np.abs(samples), initial=0.0)) for samples in after), default=0.0)


def rearming(readings: Sequence[Reading], can_rearm: bool) -> Diagnosis:
    """Judge whether the board detects a second echo, which needs BLNK."""
    if not can_rearm:
        return skipped("BLNK", "this board detects one echo only")
    most = max((len(reading.echo_times) for reading in readings), default=0)
    if most == 0:
        return skipped("BLNK", "no echo")
    if most == 1:
        advice = "check the wire of BLNK; in an empty hall or outdoors one echo may be all there is"
        return failed("BLNK", f"no second echo in {len(readings)} pings", advice)
    return passed("BLNK", f"up to {most} echoes of a ping")


def noise(readings: Sequence[Reading]) -> Diagnosis:
    """Judge the end of the traces, where no echo is expected."""
    traces = [reading.trace for reading in readings if reading.trace is not None]
    if not traces:
        return skipped("noise", "the device sends no traces")
    ends = np.concatenate([trace.samples[-len(trace.samples) // 5 :] for trace in traces])
    level = float(np.nanmedian(np.abs(ends)))
    if level > QUIET:
        advice = "check the ground and the buffer of the tap, and keep A0 away from the wires of the motor"
        return failed("noise", f"{level:.0%} of full scale at the end of the traces", advice)
    return passed("noise", f"{level:.1%} of full scale at the end of the traces")


def echo_moves(readings: Sequence[Reading], marked: bool) -> Diagnosis:
    """Judge whether the first echo depends on the heading. `readings` are of headings all around.

    A turntable that is `marked` has proved by its home switches that it turns.
    """
    times = [reading.echo_times[0] for reading in readings if reading.echo_times]
    if len(times) < len(readings) / 2 or len(times) < 3:
        return skipped("echo moves", f"{len(times)} of {len(readings)} headings have an echo")
    _, same = most_common_range(np.array([reading.echo_ranges[0] for reading in readings if reading.echo_times]))
    if same >= MOST_AT_ONE_TIME * len(times):
        advice = (
            "this is noise on INIT or on the supply, not a wall: keep INIT away from the wires of the motor, and put "
            "470 µF at the supply of the ranging board"
        )
        if not marked:
            advice = f"if the table does not turn, check its motor and supply; if it turns, {advice}"
        return failed(
            "echo moves", f"first echo at {np.median(times) * 1e3:.3f} ms at {same} of {len(times)} headings", advice
        )
    return passed("echo moves", f"first echo from {min(times) * 1e3:.1f} to {max(times) * 1e3:.1f} ms all around")


def switches(failure: str | None, levels: Input | None, one_switch: bool = False) -> Diagnosis:
    """Judge a Home; `failure` is the device's reason. With `one_switch`, there is no cam."""
    if failure is None:
        return passed("zero", "found")
    parts = [Input.MARK] if one_switch else [Input.MARK, Input.CAM]
    shown = [] if levels is None else [f"{str(part.name).lower()} {_level(part, levels)}" for part in parts]
    text = "; ".join([failure, ", ".join(shown)] if shown else [failure])
    return failed("zero", text, _home_advice(failure))


def _level(item: Input, levels: Input) -> str:
    return "high" if item in levels else "low"


def _home_advice(failure: str) -> str:
    if "mark never came" in failure:
        return (
            "if the table did not turn, check the motor, its supply and ENABLE; if it did, turn it by hand: "
            "if `sonarhw wiring URL` shows the mark change, run `sonarhw wiring URL --invert mark`, else "
            "check the wire of the mark"
        )
    if "cam never changed" in failure:
        return (
            "`sonarhw turn URL 5 --jog` must turn counter-clockwise, seen from above, else `sonarhw wiring URL "
            "--invert motor`; 30° counter-clockwise of zero `sonarhw wiring URL` must show the cam high, else "
            "`sonarhw wiring URL --invert cam`; if the cable is wound by more than a turn, run this again"
        )
    if "wrong way" in failure:
        return (
            "`sonarhw turn URL 5 --jog` must turn counter-clockwise, seen from above, else `sonarhw wiring URL "
            "--invert motor`; if it does, `sonarhw wiring URL --invert mark`"
        )
    return "check that the table turns freely and that the cable is not wound; see docs/building/building.md"


def judge_steps(failure: str | None) -> Diagnosis:
    """Judge a turn over two zero marks; `failure` is the device's reason."""
    if failure is None:
        return passed("steps", "none lost in a whole turn")
    return failed("steps", failure, STEPS_ADVICE)


def same_echoes(readings: Sequence[Reading], moves: Diagnosis) -> Diagnosis:
    """Judge the steps of a turntable without a mark: both sweeps must have the same echoes at the same headings.

    `moves` is the diagnosis of `echo_moves`. Steps that both sweeps lose alike are not found.
    """
    if moves.verdict != "pass":
        return skipped("steps", "the echoes do not show whether steps are lost")
    times: dict[int, list[float]] = {}
    for reading in readings:
        first = reading.echo_times[0] if reading.echo_times else math.inf
        times.setdefault(round(math.degrees(reading.angle) * 100), []).append(first)
    pairs = [times_of_heading for times_of_heading in times.values() if len(times_of_heading) == 2]
    other = sum(not math.isclose(*pair, rel_tol=SAME_ECHO) for pair in pairs)
    text = f"{other} of {len(pairs)} headings have another echo on the way back"
    if other >= MOST_CHANGED * len(pairs):
        return failed("steps", text, f"{STEPS_ADVICE}; if something moved in the room, run this again")
    return passed("steps", text)


def direction(readings: Sequence[Reading], plate: float, mirrored: Sequence[str]) -> Diagnosis:
    """Judge whether the nearest echo is on the side of the plate. `plate` is its heading, rad.

    `mirrored` are the parts to invert if the table turns the other way.
    """
    heard = [reading for reading in readings if reading.range is not None]
    if not heard:
        return failed("direction", "no echo around zero", "hold the plate at a right angle to the line to the board")
    nearest = min(heard, key=lambda reading: reading.range or math.inf)
    text = f"the nearest echo is at {math.degrees(nearest.angle):+.0f}°, the plate at {math.degrees(plate):+.0f}°"
    if abs(nearest.angle - plate) <= HEADING_ERROR:
        return passed("direction", text)
    if abs(nearest.angle + plate) <= HEADING_ERROR:
        inverts = " and ".join(f"`sonarhw wiring URL --invert {part}`" for part in mirrored)
        return failed("direction", text, f"the table turns the other way: {inverts}")
    return failed("direction", text, "take away what is nearer than the plate, and check zero and gear")


def judge_plate(readings: Sequence[Reading], distance: float) -> Diagnosis:
    """Judge the ranges of a plate. `distance` is from the transducer, m."""
    ranges = [reading.range for reading in readings if reading.range is not None]
    if not ranges:
        return failed("plate", "no echo", "hold the plate at a right angle to the line to the board")
    median, spread = float(np.median(ranges)), float(np.std(ranges))
    text = f"{median:.4f} m, standard deviation {spread * 1e3:.1f} mm; {distance:g} m expected"
    if abs(median - distance) > PLATE_ERROR * distance:
        return failed("plate", text, "check the distance and the gear; then `sonarhw calibrate` finds the offset")
    if spread > PLATE_SPREAD:
        return failed("plate", text, "the plate moves, or the threshold is hardly reached: use a larger plate")
    return passed("plate", text)


def supply(device: Statistics | None, resets: int) -> Diagnosis:
    """Judge the cause of the last start, and restarts during the checks. `device` is None if it does not answer."""
    code = device.reset_cause if device else ResetCause.UNKNOWN
    cause = ResetCause(code) if code in [*ResetCause] else ResetCause.UNKNOWN
    advice = (
        "the 6500 draws 2 A during a ping, and a servo 1 A: give it a supply of 5 V and 3 A of its own with a common "
        "ground, and 470 µF close to it"
    )
    if cause is ResetCause.BROWNOUT:
        return failed("supply", "the last start followed a drop of the supply", advice)
    if resets:
        return failed("supply", f"the device restarted {resets} times during the checks", advice)
    return passed("supply", "no restart during the checks")


# the checks, step by step


EXCHANGES = 50  # commands
PINGS = 20
HEADINGS = 12  # all around
BESIDE = math.radians(60)  # searched on both sides of zero for the plate
_COUNTING = (1, 1)  # first protocol with AskStatistics
_PINGS_IN_PLACE = (1, 2)  # first protocol with pings before a Home
_OVER_TWO_MARKS = math.radians(-20), math.radians(380)
_MIRRORED = "mark", "cam", "motor"  # what is inverted on a turntable that turns the other way


@dataclass(frozen=True)
class Plate:
    """A plate in front of the scanner, nearer than anything else."""

    heading: float  # turntable angle, rad; counter-clockwise
    distance: float  # from the transducer, m


def examine(scanner: Scanner, turns: bool, plate: Plate | None) -> Iterator[Diagnosis]:
    """Yield the diagnoses as they are made. Without `turns`, the motor stays off.

    A scanner that restarts again and again ends the checks. Raises NoAnswer and LinkLost if the scanner is lost.
    """
    try:
        yield from _checks(scanner, turns, plate)
    except LinkLost:
        if not scanner.statistics.resets:
            raise
        yield supply(_statistics(scanner), scanner.statistics.resets)


def _statistics(scanner: Scanner) -> Statistics | None:
    if scanner.info.protocol < _COUNTING:
        return None
    try:
        return scanner.device_statistics()
    except DeviceError:
        return None


def _checks(scanner: Scanner, turns: bool, plate: Plate | None) -> Iterator[Diagnosis]:
    info = scanner.info
    # the scanner counts since its start, also what others have sent
    before = _exchange(scanner)
    for _ in range(EXCHANGES):
        rejected = _exchange(scanner) - before
    yield line(scanner.statistics, rejected, scanner.baud)
    yield firmware(info)
    yield temperature(info.temperature_c)
    yield echo_idle(scanner.inputs())
    scanner.configure(trace=bool(info.trace_rate))
    if info.protocol >= _PINGS_IN_PLACE:
        yield from _ranging(scanner)
    if turns:
        yield from _turntable(scanner, plate)
    else:
        yield skipped("turntable", "not wanted")
    yield supply(_statistics(scanner), scanner.statistics.resets)


def _exchange(scanner: Scanner) -> int:
    """Exchange a command and its answer. Return how many frames the scanner has rejected; 0 if it does not count."""
    if scanner.info.protocol < _COUNTING:
        scanner.configure()
        return 0
    return scanner.device_statistics().rejected


def _ranging(scanner: Scanner) -> Iterator[Diagnosis]:
    features = _features(scanner.info.capabilities, Feature(0))
    pings = [*scanner.scan(pings_in_place(PINGS))]
    yield echoes(pings)
    yield rearming(pings, Feature.REARM in features)
    yield noise(pings)


def _features(capabilities: DeviceCapabilities | None, unknown: Feature) -> Feature:
    return capabilities.features if capabilities else unknown


def _turntable(scanner: Scanner, plate: Plate | None) -> Iterator[Diagnosis]:
    features = _features(scanner.info.capabilities, Feature.HOME_MARK | Feature.LOST_STEPS)
    marked = Feature.HOME_MARK in features
    scanner.configure(trace=False)
    one_switch = Feature.ONE_SWITCH in features
    zero = _zero(scanner, marked, one_switch)
    yield zero
    if zero.verdict == "FAIL":
        yield from (skipped(check, "the zero is unknown") for check in ("steps", "echo moves", "direction", "plate"))
        return
    detects_loss = Feature.LOST_STEPS in features
    if detects_loss:
        before, beyond = _over_marks(scanner.info.capabilities)
        steps = _turned(scanner, lambda: (scanner.turn(before), scanner.turn(beyond)))
        yield steps
    around = _scanned(scanner, replace(_around(scanner.info.capabilities), sweeps=1 if detects_loss else 2))
    if isinstance(around, Diagnosis):
        if not detects_loss or steps.verdict == "pass":
            yield around
        reason = "steps are lost" if around.verdict == "FAIL" else "the table does not turn as far as the check"
        yield from (skipped(check, reason) for check in ("echo moves", "direction", "plate"))
        return
    moves = echo_moves(around, marked)
    if not detects_loss:
        yield same_echoes(around, moves)
    yield moves
    if plate is None:
        advice = (
            "put a plate 1 m from the transducer, 30° counter-clockwise of zero, and run "
            "`sonarhw doctor URL --plate 30 --distance 1`"
        )
        yield from (skipped("direction", "no plate"), skipped("plate", "no plate", advice))
        return
    mirrored = [part for part in _MIRRORED if part == "motor" or (marked and not (one_switch and part == "cam"))]
    yield from _plate(scanner, plate, mirrored)


def _over_marks(capabilities: DeviceCapabilities | None) -> tuple[float, float]:
    """Return the ends of a turn over two marks, or over the one mark of a table that cannot turn as far, rad."""
    before, beyond = _OVER_TWO_MARKS
    if capabilities and capabilities.highest_angle < beyond:
        return capabilities.lowest_angle, capabilities.highest_angle
    return before, beyond


def _zero(scanner: Scanner, marked: bool, one_switch: bool) -> Diagnosis:
    """Home. A turntable without a mark, which may refuse to home, takes its present angle as zero."""
    try:
        scanner.home()
    except CommandRefused as error:
        if marked:
            return switches(_reason(scanner, error), scanner.inputs(), one_switch)
        scanner.home(here=True)
        return skipped("zero", "no home switches: the present angle is zero")
    except DeviceError as error:
        return switches(_reason(scanner, error), scanner.inputs(), one_switch)
    return switches(None, scanner.inputs(), one_switch)


def _around(capabilities: DeviceCapabilities | None) -> ScanOrder:
    """Return an order for headings all around, or over the whole range of a table that cannot turn as far."""
    lowest = math.degrees(capabilities.lowest_angle) if capabilities else -360.0
    highest = math.degrees(capabilities.highest_angle) if capabilities else 360.0
    if highest >= 360:
        lowest, highest = 0.0, 360.0
    return sector(lowest, highest, (highest - lowest) / HEADINGS)


def _plate(scanner: Scanner, plate: Plate, mirrored: Sequence[str]) -> Iterator[Diagnosis]:
    beside = _scanned(scanner, sector(-math.degrees(BESIDE), math.degrees(BESIDE) + 5, 5))
    if isinstance(beside, Diagnosis):
        yield beside
        return
    yield direction(beside, plate.heading, mirrored)
    at_plate = _scanned(scanner, ScanOrder(plate.heading, math.radians(1), 1, 1, PINGS))
    yield at_plate if isinstance(at_plate, Diagnosis) else judge_plate(at_plate, plate.distance)


def _turned(scanner: Scanner, act: Callable[[], object]) -> Diagnosis:
    """Return the diagnosis of the steps after turns."""
    try:
        act()
    except DeviceError as error:
        return _not_turned(scanner, error)
    return judge_steps(None)


def _not_turned(scanner: Scanner, error: DeviceError) -> Diagnosis:
    """Return the diagnosis that steps were lost, or that the device, which states no limits, turns less far."""
    reason = _reason(scanner, error)
    if isinstance(error, CommandRefused) and error.code == Refusal.OUT_OF_RANGE:
        return skipped("steps", reason, "state the limits of the table in Capabilities (version 1.1)")
    return judge_steps(reason)


def _reason(scanner: Scanner, error: DeviceError) -> str:
    return str(error).removeprefix(f"{scanner.url}: ")


def _scanned(scanner: Scanner, order: ScanOrder) -> list[Reading] | Diagnosis:
    """Return the readings of a scan, or the diagnosis of the steps if it failed."""
    try:
        return [*scanner.scan(order)]
    except DeviceError as error:
        return _not_turned(scanner, error)


# flashing: `make -C firmware images` builds `images/*.hex`, and a test compares them with a fresh build


PATIENCE = 5.0  # s for the greeting of a board before it is flashed
_Part = TypeVar("_Part", bound=str)
_LINES = 3  # of avrdude's output that an error contains


@dataclass(frozen=True)
class _Target:
    """How avrdude reaches a controller, and how the controller is recognised."""

    usb_name: str | None  # in KNOWN_USB_IDS; None: the board has the USB chip of many others
    firmware: str  # begin of the name in Info
    part: str
    programmer: str
    baud: int


_TARGETS: dict[Controller, _Target] = {
    "mega": _Target("Arduino Mega 2560", "sonarhw-mega", "atmega2560", "wiring", 115_200),
    "uno": _Target("Arduino Uno", "sonarhw-uno", "atmega328p", "arduino", 115_200),
    "nano": _Target(None, "sonarhw-uno", "atmega328p", "arduino", 57_600),  # its older bootloader
}
_PROFILES: dict[Ranging, str] = {POLAROID: "polaroid-6500", "hc-sr04": "hc-sr04"}


def ranging_of(profile: str) -> Ranging:
    """Return the ranging board with a profile; a 6500 if it is empty. Raises InputError if there is no firmware."""
    ranging = {name: ranging for ranging, name in _PROFILES.items()}
    return _part("`sonarhw flash PORT --ranging NAME`", profile, {"": POLAROID, **ranging})


def turning_of(turntable: str) -> Turning:
    """Return what turns a board; step/direction if it is empty. Raises InputError if there is no firmware for it."""
    turning: dict[str, Turning] = {name: name for name in get_args(Turning)}
    return _part("`sonarhw flash PORT --turning NAME`", turntable, {"": STEP_DIR, **turning})


def _part(command: str, said: str, parts: dict[str, _Part]) -> _Part:
    if said not in parts:
        raise InputError(
            f"no prebuilt firmware for {said!r}, for which the board is built; to change that, run {command}"
        )
    return parts[said]


def find_board(port: str) -> tuple[Controller | None, str, str]:
    """Return the controller of a board, the name of its profile, and what turns it, each None or empty if unknown.

    The controller is recognised by its USB identity, or by the firmware that runs on it. Raises LinkError if the port
    cannot be opened.
    """
    info = _identity(port)
    name = next((each.known for each in serial_ports() if each.device == port), None)
    by_usb = (each for each, target in _TARGETS.items() if name is not None and name == target.usb_name)
    by_firmware = (each for each, target in _TARGETS.items() if info and info.firmware.startswith(target.firmware))
    turntable = info.capabilities.turning if info and info.capabilities else ""
    return next(by_usb, None) or next(by_firmware, None), info.board if info else "", turntable


def same_chip(controller: Controller, other: Controller) -> bool:
    """Return whether two controllers run the same images."""
    return _TARGETS[controller].part == _TARGETS[other].part


def _identity(port: str) -> DeviceInfo | None:
    """Return the identity of the scanner at a port; None if none answers."""
    try:
        with Scanner.open(port, patience=PATIENCE) as scanner:
            return scanner.info
    except DeviceError:
        return None


def find_avrdude() -> str:
    """Return the path of avrdude. Raises InputError if it is not installed."""
    path = shutil.which("avrdude")
    if path is None:
        raise InputError(
            "avrdude: not found; install it: apt install avrdude (Debian, Ubuntu), brew install avrdude (macOS), "
            "winget install AVRDudes.AVRDUDE (Windows)"
        )
    return path


def write_firmware(port: str, combination: Combination) -> None:
    """Write the image of a combination to the flash memory of its controller and verify it. The EEPROM is unchanged.

    avrdude refuses a chip of another type. Raises InputError without avrdude, and SonarError with avrdude's last lines
    if it fails.
    """
    avrdude, target = find_avrdude(), _TARGETS[combination.controller]
    with as_file(files("sonarhw").joinpath(f"images/{combination.image}.hex")) as image:
        command = [avrdude, "-q", "-p", target.part, "-c", target.programmer, "-P", port, "-b", str(target.baud)]
        done = subprocess.run(
            [*command, "-D", "-U", f"flash:w:{image}:i"], stdin=subprocess.DEVNULL, capture_output=True, text=True
        )
    if done.returncode:
        raise SonarError(f"{port}: avrdude ends with exit status {done.returncode}: {_avrdude_errors(done.stderr)}")


def _avrdude_errors(printed: str) -> str:
    """Return the errors that avrdude printed, or else its last lines."""
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    errors = [line.partition("error: ")[2] for line in lines if "error: " in line and "OS error" not in line]
    return "; ".join(errors or lines[-_LINES:]) or "it prints nothing"


def ask_identity(port: str, combination: Combination) -> DeviceInfo:
    """Return the identity of a board after it was flashed. Raises DeviceError if another firmware answers."""
    with Scanner.open(port) as scanner:
        info = scanner.info
    firmware, parts = _TARGETS[combination.controller].firmware, (_PROFILES[combination.ranging], combination.turning)
    stated = (info.board, info.capabilities.turning if info.capabilities else "")
    if not info.firmware.startswith(firmware) or stated != parts:
        answers = f"the firmware {info.firmware!r} for {stated[0]!r} and {stated[1]!r} answers"
        raise DeviceError(f"{port}: {answers}; expected {firmware} for {parts[0]} and {parts[1]}; flash it again")
    return info
