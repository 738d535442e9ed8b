"""`sonarhw calibrate`: measure range offset and home angle with a flat plate, and write a board profile."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_sim.choices import DEFAULT_BOARD

from sonarhw.errors import InputError
from sonarhw_cli.console.connect import ScannerUrl, connect_turntable
from sonarhw_cli.console.interruption import interruption
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import (
    BoardName,
    Force,
    check_temperature,
    checked_out,
    order_in_degrees,
)
from sonarhw_cli.console.output import written_file

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board

    from sonarhw.host.scanner import Scanner
    from sonarhw.readings import Reading, ScanOrder
    from sonarhw.scanning.calibration import Calibration

PROFILE = ".toml"
_LEVEL_DB = 5.0  # by which the threshold of a profile may be wrong, and a plate may be fainter than a perfect one


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
    with connect_turntable(url) as scanner:
        readings = _scan(scanner, order, profile, temperature)
    from sonarhw_sim.predict.plate_echo import plate_echo

    from sonarhw.scanning.calibration import calibrate

    found = calibrate(
        readings,
        distance,
        math.radians(direction),
        arcs=_arcs(profile, distance, step),
        delay=plate_echo(profile, Air(), distance).delay,
    )
    name = out.stem.encode(errors="replace").decode()
    text = _with_calibration(profile.text, name, found)
    with written_file(out, overwrite=force) as file:
        file.write(text.encode())
    print_line(_result_line(found, distance))


def _arcs(board: "Board", distance: float, step: float) -> tuple[float, float]:
    """Return the smallest and the largest plausible arc of a plate, rad; its ends are known within a step."""
    from sonarhw_sim.air import Air
    from sonarhw_sim.predict.plate_echo import plate_echo

    faint, loud = (plate_echo(board, Air(), distance, stronger) for stronger in (-_LEVEL_DB, _LEVEL_DB))
    return faint.early_arc - math.radians(step), loud.arc + math.radians(step)


def _check_sector(order: "ScanOrder", width: float, step: float) -> None:
    from sonarhw.scanning.calibration import FEWEST

    needed = FEWEST + 2
    if order.headings < needed:
        raise InputError(
            f"--width {width:g}, --step {step:g}: {counted(order.headings, 'heading')}; expected at least {needed}, "
            f"{FEWEST} with an echo of the plate and one without on each side; widen the sector or give smaller steps"
        )


def _scan(scanner: "Scanner", order: "ScanOrder", board: "Board", temperature: float | None) -> "list[Reading]":
    from sonarhw.sound_speed import ScanAir

    speed = ScanAir(chosen_temperature=temperature).speed_of_sound(scanner.info.temperature_c)
    scanner.configure(2 * board.max_range / speed, board.blanking_end, False, speed)
    with interruption(scanner.stop):
        return list(scanner.scan(order))


def _with_calibration(text: str, name: str, found: "Calibration") -> str:
    """Return the text of the profile with a new name and the two measured keys, otherwise unchanged.

    Raises InputError if the text cannot be changed.
    """
    import tomlkit
    from sonarhw_sim.board.profile import parse_board
    from tomlkit.exceptions import TOMLKitError

    # + 0.0 turns -0.0 into 0.0
    offset = tomlkit.item(round(found.range_offset, 5) + 0.0)
    home = tomlkit.item(round(math.degrees(found.home_angle), 3) + 0.0)
    try:
        document = tomlkit.parse(text)
        document["name"] = name
        document["range_offset"] = offset.comment("m, measured minus true")
        document["home_angle_deg"] = home.comment("direction of the turntable's zero")
        return parse_board(tomlkit.dumps(document), f"profile {name!r}").text
    except TOMLKitError as error:
        raise InputError(f"the board profile cannot be changed: {error}; give another --board") from error


def _result_line(found: "Calibration", distance: float) -> str:
    return (
        f"plate at {distance:g} m: range offset {found.range_offset * 1000:+.1f} mm "
        f"(spread {found.range_spread * 1000:.1f} mm), home angle {math.degrees(found.home_angle):+.2f} degrees "
        f"(± {math.degrees(found.home_uncertainty):.2f}); echo over {math.degrees(found.arc):.1f} degrees, "
        f"{counted(found.headings, 'heading')}"
    )
