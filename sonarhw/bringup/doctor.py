"""Check a new scanner step by step: line, firmware, ranging board, turntable, first plate."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from sonarhw.bringup import diagnoses
from sonarhw.bringup.diagnoses import Diagnosis, Verdict, skipped
from sonarhw.errors import CommandRefused, DeviceError, LinkLost
from sonarhw.host.device_info import DeviceCapabilities
from sonarhw.host.scanner import Scanner
from sonarhw.readings import Reading, ScanOrder, pings_in_place, sector
from sonarhw.wire.codes import Feature
from sonarhw.wire.messages import Statistics

EXCHANGES = 50  # commands
PINGS = 20
HEADINGS = 12  # all around
BESIDE = math.radians(60)  # searched on both sides of zero for the plate
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
        yield diagnoses.supply(_statistics(scanner), scanner.statistics.resets)


def _statistics(scanner: Scanner) -> Statistics | None:
    try:
        return scanner.device_statistics()
    except DeviceError:
        return None


def _checks(scanner: Scanner, turns: bool, plate: Plate | None) -> Iterator[Diagnosis]:
    info = scanner.info
    # the scanner counts since its start, also what others have sent
    before = scanner.device_statistics().rejected
    for _ in range(EXCHANGES):
        rejected = scanner.device_statistics().rejected - before
    yield diagnoses.line(scanner.statistics, rejected, scanner.baud)
    yield diagnoses.firmware(info)
    yield diagnoses.temperature(info.temperature_c)
    yield diagnoses.echo_idle(scanner.inputs())
    scanner.configure(trace=bool(info.trace_rate))
    if info.protocol >= _PINGS_IN_PLACE:
        yield from _ranging(scanner)
    if turns:
        yield from _turntable(scanner, plate)
    else:
        yield skipped("turntable", "not wanted")
    yield diagnoses.supply(scanner.device_statistics(), scanner.statistics.resets)


def _ranging(scanner: Scanner) -> Iterator[Diagnosis]:
    features = _features(scanner.info.capabilities, Feature(0))
    pings = [*scanner.scan(pings_in_place(PINGS))]
    yield diagnoses.echoes(pings)
    yield diagnoses.rearming(pings, Feature.REARM in features)
    yield diagnoses.noise(pings)


def _features(capabilities: DeviceCapabilities | None, unknown: Feature) -> Feature:
    return capabilities.features if capabilities else unknown


def _turntable(scanner: Scanner, plate: Plate | None) -> Iterator[Diagnosis]:
    features = _features(scanner.info.capabilities, Feature.HOME_MARK | Feature.LOST_STEPS)
    marked = Feature.HOME_MARK in features
    scanner.configure(trace=False)
    one_switch = Feature.ONE_SWITCH in features
    zero = _zero(scanner, marked, one_switch)
    yield zero
    if zero.verdict is Verdict.FAIL:
        yield from (skipped(check, "the zero is unknown") for check in ("steps", "echo moves", "direction", "plate"))
        return
    detects_loss = Feature.LOST_STEPS in features
    if detects_loss:
        before, beyond = _over_marks(scanner.info.capabilities)
        steps = diagnoses.steps(_failure(scanner, lambda: (scanner.turn(before), scanner.turn(beyond))))
        yield steps
    around = _scanned(scanner, replace(_around(scanner.info.capabilities), sweeps=1 if detects_loss else 2))
    if isinstance(around, Diagnosis):
        if not detects_loss or steps.verdict is not Verdict.FAIL:
            yield around
        yield from (skipped(check, "steps are lost") for check in ("echo moves", "direction", "plate"))
        return
    moves = diagnoses.echo_moves(around, marked)
    if not detects_loss:
        yield diagnoses.same_echoes(around, moves)
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
            return diagnoses.switches(_reason(scanner, error), scanner.inputs(), one_switch)
        scanner.home(here=True)
        return skipped("zero", "no home switches: the present angle is zero")
    except DeviceError as error:
        return diagnoses.switches(_reason(scanner, error), scanner.inputs(), one_switch)
    return diagnoses.switches(None, scanner.inputs(), one_switch)


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
    yield diagnoses.direction(beside, plate.heading, mirrored)
    at_plate = _scanned(scanner, ScanOrder(plate.heading, math.radians(1), 1, 1, PINGS))
    yield at_plate if isinstance(at_plate, Diagnosis) else diagnoses.plate(at_plate, plate.distance)


def _failure(scanner: Scanner, act: Callable[[], object]) -> str | None:
    """Return why an action failed; None if it succeeded."""
    try:
        act()
    except DeviceError as error:
        return _reason(scanner, error)
    return None


def _reason(scanner: Scanner, error: DeviceError) -> str:
    return str(error).removeprefix(f"{scanner.url}: ")


def _scanned(scanner: Scanner, order: ScanOrder) -> list[Reading] | Diagnosis:
    """Return the readings of a scan, or the diagnosis that steps were lost."""
    try:
        return [*scanner.scan(order)]
    except DeviceError as error:
        return diagnoses.steps(_reason(scanner, error))
