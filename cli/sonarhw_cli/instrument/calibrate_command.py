"""`sonarhw calibrate`: range offset and home angle against a plate at a known distance, into a board profile."""

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError, OutputError
from sonarhw_cli.console.connect import ScannerUrl, connect
from sonarhw_cli.console.interruption import interruption, sigterm_raises
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import (
    DEFAULT_BOARD,
    BoardName,
    Force,
    check_temperature,
    checked_out,
    order_in_degrees,
)

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board

    from sonarhw.calibration import Calibration
    from sonarhw.host.scanner import Scanner
    from sonarhw.readings import Reading, ScanOrder

PROFILE = ".toml"


def calibrate_scanner(
    url: ScannerUrl,
    distance: Annotated[float, typer.Option(help="From the transducer's face to the plate, metres.", metavar="M")],
    out: Annotated[Path, typer.Option(help="Board profile to write.", metavar="BOARD.toml")],
    direction: Annotated[
        float, typer.Option(help="Turntable angle at which it should face the plate, degrees.", metavar="DEG")
    ] = 0.0,
    board: BoardName = DEFAULT_BOARD,
    width: Annotated[float, typer.Option(help="Sector to scan round the plate, degrees.", min=2, max=180)] = 60.0,
    step: Annotated[float, typer.Option(help="From one heading to the next, degrees.", min=0.05, max=10)] = 0.5,
    pings: Annotated[int, typer.Option(help="Pings at each heading.", min=1, max=255)] = 3,
    temperature: Annotated[float | None, typer.Option(help="Air, °C; default: the scanner's own, else 20.")] = None,
    force: Force = False,
) -> None:
    """Scan a flat plate at a known distance; write a board profile with range offset and home angle."""
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import load_board

    checked_out(out, (PROFILE,), force, url, board)
    check_temperature(temperature)
    profile = load_board(board)
    nearest = profile.blanked_range(Air())
    if not nearest < distance < profile.max_range:
        raise InputError(f"--distance {distance:g}: this board hears from {nearest:.2g} to {profile.max_range:g} m")
    order = order_in_degrees(direction - width / 2, direction + width / 2, step, pings=pings)
    _check_sector(order, width, step)
    with sigterm_raises(), connect(url) as scanner:
        readings = _scan(scanner, order, profile, temperature)
    from sonarhw.calibration import calibrate

    found = calibrate(readings, distance, math.radians(direction))
    _write(out, _with_calibration(profile.text, out.stem, found))
    typer.echo(_told(found, distance))


def _check_sector(order: "ScanOrder", width: float, step: float) -> None:
    from sonarhw.calibration import FEWEST

    needed = FEWEST + 2
    if order.headings < needed:
        raise InputError(
            f"--width {width:g}, --step {step:g}: {counted(order.headings, 'heading')}; expected at least {needed}, "
            f"{FEWEST} that hear the plate and one on either side that does not: widen the sector or take smaller steps"
        )


def _scan(scanner: "Scanner", order: "ScanOrder", board: "Board", temperature: float | None) -> "list[Reading]":
    from sonarhw_sim.air import Air

    from sonarhw.scan_recording import ScanAir

    speed = ScanAir(Air().speed_at, Air().temperature_c, temperature).speed_of_sound(scanner)
    scanner.configure(2 * board.max_range / speed, board.listens_from, False, speed)
    with interruption(scanner.stop):
        return list(scanner.scan(order))


def _with_calibration(text: str, name: str, found: "Calibration") -> str:
    """The profile with its name and these two keys, everything else as it was."""
    values = {
        "name": f'"{name}"',
        "range_offset": f"{found.range_offset:.5f}       # m, measured minus true",
        "home_angle_deg": f"{math.degrees(found.home_angle):.3f}     # where the turntable's zero points",
    }
    for key, value in values.items():
        line = f"{key} = {value}"
        text, replaced = re.subn(rf"^{key}\s*=.*$", lambda _, line=line: line, text, flags=re.M)  # type: ignore[misc]
        text = text if replaced else f"{text.rstrip()}\n{line}\n"
    return text


def _write(out: Path, text: str) -> None:
    try:
        out.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{out}: cannot be written: {error.strerror or error}") from error


def _told(found: "Calibration", distance: float) -> str:
    return (
        f"plate at {distance:g} m: range offset {found.range_offset * 1000:+.1f} mm "
        f"(spread {found.range_spread * 1000:.1f} mm), home angle {math.degrees(found.home_angle):+.2f} degrees "
        f"(± {math.degrees(found.home_uncertainty):.2f}); heard over {math.degrees(found.arc):.1f} degrees, "
        f"{counted(found.headings, 'heading')}"
    )
