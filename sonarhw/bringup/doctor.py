"""Check a new scanner step by step: line, firmware, ranging board, turntable, first plate."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from sonarhw.bringup import diagnoses
from sonarhw.bringup.diagnoses import Diagnosis, failed, skipped
from sonarhw.errors import DeviceError
from sonarhw.host.scanner import Scanner
from sonarhw.readings import Reading, ScanOrder, pings_in_place, sector
from sonarhw.wire.messages import Feature

EXCHANGES = 50  # commands
PINGS = 20
HEADINGS = 12  # all around
BESIDE = math.radians(60)  # searched on both sides of zero for the plate
_PINGS_IN_PLACE = (1, 2)  # first protocol with pings before a Home
_BEFORE, _BEYOND = math.radians(-20), math.radians(380)  # a turn over two marks


@dataclass(frozen=True)
class Plate:
    """A plate in front of the scanner, nearer than anything else."""

    heading: float  # turntable angle, rad; counter-clockwise
    distance: float  # from the transducer, m


def examine(scanner: Scanner, turns: bool, plate: Plate | None) -> Iterator[Diagnosis]:
    """Yield the diagnoses as they are made. Without `turns`, the motor stays off.

    Raises NoAnswer and LinkLost if the scanner is lost.
    """
    info = scanner.info
    for _ in range(EXCHANGES):
        device = scanner.device_statistics()
    yield diagnoses.line(scanner.statistics, device, scanner.baud)
    yield diagnoses.firmware(info.firmware, info.protocol)
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
    capabilities = scanner.info.capabilities
    features = capabilities.features if capabilities else Feature(0)
    pings = [*scanner.scan(pings_in_place(PINGS))]
    yield diagnoses.echoes(pings)
    yield diagnoses.rearming(pings, Feature.REARM in features)
    yield diagnoses.noise(pings)


def _turntable(scanner: Scanner, plate: Plate | None) -> Iterator[Diagnosis]:
    failure = _failure(scanner, lambda: scanner.home())
    yield diagnoses.switches(failure, scanner.inputs())
    if failure is not None:
        yield from (skipped(check, "the zero is unknown") for check in ("steps", "echo moves", "direction", "plate"))
        return
    yield diagnoses.steps(_failure(scanner, lambda: (scanner.turn(_BEFORE), scanner.turn(_BEYOND))))
    around = _scanned(scanner, sector(0, 360, 360 / HEADINGS))
    if isinstance(around, Diagnosis):
        yield around
        return
    yield diagnoses.noise_on_init(around)
    if plate is None:
        advice = (
            "put a plate 1 m from the transducer, 30° counter-clockwise of zero, and run "
            "`sonarhw doctor URL --plate 30 --distance 1`"
        )
        yield from (skipped("direction", "no plate"), skipped("plate", "no plate", advice))
        return
    yield from _plate(scanner, plate)


def _plate(scanner: Scanner, plate: Plate) -> Iterator[Diagnosis]:
    beside = _scanned(scanner, sector(-math.degrees(BESIDE), math.degrees(BESIDE) + 5, 5))
    if isinstance(beside, Diagnosis):
        yield beside
        return
    yield diagnoses.direction(beside, plate.heading)
    at_plate = _scanned(scanner, ScanOrder(plate.heading, math.radians(1), 1, 1, PINGS))
    yield at_plate if isinstance(at_plate, Diagnosis) else diagnoses.plate(at_plate, plate.distance)


def _failure(scanner: Scanner, act: Callable[[], object]) -> str | None:
    """Return why an action failed; None if it succeeded."""
    try:
        act()
    except DeviceError as error:
        return str(error).removeprefix(f"{scanner.url}: ")
    return None


def _scanned(scanner: Scanner, order: ScanOrder) -> list[Reading] | Diagnosis:
    """Return the readings of a scan, or the diagnosis that steps were lost."""
    try:
        return [*scanner.scan(order)]
    except DeviceError as error:
        return failed("steps", str(error).removeprefix(f"{scanner.url}: "), "check what blocks the table")
