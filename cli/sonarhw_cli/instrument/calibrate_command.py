"""`sonarhw calibrate`: measure range offset and home angle with a flat plate, and write a board profile."""

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_sim.choices import DEFAULT_BOARD

from sonarhw.errors import InputError, OutputError
from sonarhw_cli.console.connect import ScannerUrl, connect
from sonarhw_cli.console.interruption import interruption, sigterm_raises
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import (
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
        float, typer.Option(help="Turntable angle that should face the plate, degrees.", metavar="DEG")
    ] = 0.0,
    board: BoardName = DEFAULT_BOARD,
    width: Annotated[float, typer.Option(help="Sector to scan around the plate, degrees.", min=2, max=180)] = 60.0,
    step: Annotated[float, typer.Option(help="Step from one angle to the next, degrees.", min=0.05, max=10)] = 0.5,
    pings: Annotated[int, typer.Option(help="Pings at each angle.", min=1, max=255)] = 3,
    temperature: Annotated[
        float | None, typer.Option(help="Temperature of the air, °C; default: the scanner's thermometer, else 20.")
    ] = None,
    force: Force = False,
) -> None:
    """Measure range offset and home angle with a flat plate. The result is written to a board profile."""
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import load_board

    checked_out(out, (PROFILE,), force, url, board)
    check_temperature(temperature)
    profile = load_board(board)
    nearest = profile.blanked_range(Air())
    if not nearest < distance < profile.max_range:
        raise InputError(
            f"--distance {distance:g}: expected {nearest:.2g} to {profile.max_range:g} m, this board's range"
        )
    order = order_in_degrees(direction - width / 2, direction + width / 2, step, pings=pings)
    _check_sector(order, width, step)
    with sigterm_raises(), connect(url) as scanner:
        readings = _scan(scanner, order, profile, temperature)
    from sonarhw.calibration import calibrate

    found = calibrate(readings, distance, math.radians(direction))
    _write(out, _with_calibration(profile.text, out.stem, found))
    typer.echo(_result_line(found, distance))


def _check_sector(order: "ScanOrder", width: float, step: float) -> None:
    from sonarhw.calibration import FEWEST

    needed = FEWEST + 2
    if order.headings < needed:
        raise InputError(
            f"--width {width:g}, --step {step:g}: {counted(order.headings, 'heading')}; expected at least {needed}, "
            f"{FEWEST} with an echo of the plate and one without on each side; widen the sector or give smaller steps"
        )


def _scan(scanner: "Scanner", order: "ScanOrder", board: "Board", temperature: float | None) -> "list[Reading]":
    from sonarhw_sim.air import Air

    from sonarhw.scan_recording import ScanAir

    speed = ScanAir(Air().speed_at, Air().temperature_c, temperature).speed_of_sound(scanner)
    scanner.configure(2 * board.max_range / speed, board.blanking_end, False, speed)
    with interruption(scanner.stop):
        return list(scanner.scan(order))


def _with_calibration(text: str, name: str, found: "Calibration") -> str:
    """Return the text of the profile with a new name and the two measured keys, otherwise unchanged."""
    values = {
        "name": f'"{name}"',
        "range_offset": f"{found.range_offset:.5f}       # m, measured minus true",
        "home_angle_deg": f"{math.degrees(found.home_angle):.3f}     # direction of the turntable's zero",
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


def _result_line(found: "Calibration", distance: float) -> str:
    return (
        f"plate at {distance:g} m: range offset {found.range_offset * 1000:+.1f} mm "
        f"(spread {found.range_spread * 1000:.1f} mm), home angle {math.degrees(found.home_angle):+.2f} degrees "
        f"(± {math.degrees(found.home_uncertainty):.2f}); echo over {math.degrees(found.arc):.1f} degrees, "
        f"{counted(found.headings, 'heading')}"
    )
