"""`sonarhw calibrate`: calibrate a board with a flat plate, now or from logs, and write a board profile."""

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.pictures import PICTURES
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.errors import InputError, counted
from sonarhw_cli.comparison.calibrate_logs import calibrate_with_plate, calibrate_with_room, profile_name
from sonarhw_cli.console.completions import complete_board
from sonarhw_cli.console.connect import connect_turntable
from sonarhw_cli.console.interruption import interruption
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.options import (
    LOG,
    ROOM_NAME,
    Force,
    Temperature,
    check_temperature,
    order_in_degrees,
    refuse_given,
)
from sonarhw_cli.console.output import checked_out, write_text

if TYPE_CHECKING:
    from sonarhw_compare.calibration.plate_readings import Calibration
    from sonarhw_sim.board.profile import Board

    from sonarhw.host.scanner import Scanner
    from sonarhw.readings import Reading, ScanOrder

PROFILE = ROOM = ".toml"
_OF_A_SCAN = {name: f"--{name}" for name in ("width", "step", "pings", "temperature")}
_LEVEL_DB = 5.0  # by which the threshold of a profile may be wrong, and a plate may be fainter than a perfect one


Sources = Annotated[
    list[str],
    typer.Argument(help="URL of a scanner, which scans the plate now, or logs of scans of a plate.", metavar="URL|LOG"),
]
PlateDistances = Annotated[
    list[float] | None,
    typer.Option("--distance", help="From the transducer's face to the plate, metres; once for each log.", metavar="M"),
]
PlateDirections = Annotated[
    list[float] | None,
    typer.Option(
        "--direction",
        help="Turntable angle that should face the plate, degrees; once, or once for each log. Default: 0.",
        metavar="DEG",
    ),
]
StartingBoard = Annotated[
    str | None,
    typer.Option(
        "--board",
        help=f"Board profile to begin with: name or file; default: the logs', with a URL {DEFAULT_BOARD}.",
        metavar="NAME|FILE.toml",
        autocompletion=complete_board,
    ),
]
KnownRoom = Annotated[
    str | None,
    typer.Option(
        "--room", help="Room that the logs are scans of: name or file, without --distance.", metavar=ROOM_NAME
    ),
]
PlacesOfLogs = Annotated[
    list[str] | None,
    typer.Option(
        "--place",
        help="With --room: place, or X,Y in metres; once for each log. Default: those of the logs.",
        metavar="P",
    ),
]
PosesOfLogs = Annotated[
    list[str] | None,
    typer.Option(
        "--pose",
        help="In place of --place: X,Y in metres and the heading of the turntable's zero in degrees.",
        metavar="X,Y,DEG",
    ),
]
FoundRoom = Annotated[
    Path | None,
    typer.Option(
        "--room-out",
        help="With --room: also find the reflectances of its materials, and write the room with them. "
        "Use it with the profile.",
        metavar="ROOM.toml",
    ),
]
CalibrationPicture = Annotated[
    Path | None,
    typer.Option(help="With --room: picture of the scans and their predictions, before and after.", metavar="FILE.png"),
]
SectorWidth = Annotated[float, typer.Option(help="Sector to scan around the plate, degrees.", min=2, max=180)]
SectorStep = Annotated[float, typer.Option(help="Step from one angle to the next, degrees.", min=0.05, max=10)]


def calibrate(
    context: typer.Context,
    sources: Sources,
    out: Annotated[Path, typer.Option(help="Board profile to write.", metavar="BOARD.toml")],
    distances: PlateDistances = None,
    directions: PlateDirections = None,
    room_name: KnownRoom = None,
    places: PlacesOfLogs = None,
    poses: PosesOfLogs = None,
    room_out: FoundRoom = None,
    plot: CalibrationPicture = None,
    board: StartingBoard = None,
    width: SectorWidth = 60.0,
    step: SectorStep = 0.5,
    pings: Annotated[int, typer.Option(help="Pings at each angle.", min=1, max=255)] = 3,
    temperature: Temperature = None,
    force: Force = False,
) -> None:
    """Write the profile of a board, from a plate or a known room.

    A URL: scan the plate, and measure range offset and home angle. Logs of a plate at several distances: find aperture,
    gain steps, threshold, swelling, ring-down and blanking. Logs with --room: find threshold, aperture, their spreads,
    range offset and slope, turntable, axis, the carrier's own body, and the room's reflectances. Each value has an
    interval.
    """
    checked_out(out, (PROFILE,), force, *sources, board, room_name)
    of_room = {"--place": places, "--pose": poses, "--room-out": room_out, "--plot": plot}
    _check_method(room_name, distances, directions, of_room)
    logs = [Path(source) for source in sources if Path(source).suffix == LOG]
    if len(logs) < len(sources):
        _check_scanner(sources, room_name)
        check_temperature(temperature)
        # of an option that is given twice, the last one counts, as in other commands
        distance, direction = (distances or [0.0])[-1], (directions or [0.0])[-1]
        profile = board or DEFAULT_BOARD
        _calibrate_scanner(sources[0], distance, direction, out, profile, (width, step, pings), temperature, force)
        return
    refuse_given(context, _OF_A_SCAN, "is for a scan by a scanner; remove it, or give a URL in place of logs")
    if room_name is None:
        calibrate_with_plate(logs, distances or [], directions or [], board, out, force)
        return
    if room_out is not None:
        checked_out(room_out, (ROOM,), force, *sources, board, room_name, option="--room-out")
        if room_out.resolve() == out.resolve():
            raise InputError(f"--room-out {room_out}: is also --out; choose another name")
    if plot is not None:
        checked_out(plot, PICTURES, force, *sources, board, option="--plot")
    calibrate_with_room(logs, room_name, places or [], poses or [], board, out, room_out, plot, force)


def _check_scanner(sources: list[str], room_name: str | None) -> None:
    """Raise InputError unless the source is the URL of one scanner, for a plate."""
    if room_name is not None:
        raise InputError(f"--room {room_name}: expected logs (*{LOG}), not the URL of a scanner; scan first")
    if len(sources) > 1:
        raise InputError(f"{', '.join(sources)}: expected the URL of one scanner, or logs (*{LOG})")


def _check_method(
    room_name: str | None,
    distances: list[float] | None,
    directions: list[float] | None,
    of_room: Mapping[str, object],
) -> None:
    """Raise InputError unless the options are those of one method, a plate or a room."""
    if room_name is None:
        if not distances:
            raise InputError("expected --distance of a plate, or --room with logs of scans of a known room")
        given = next((option for option, value in of_room.items() if value), None)
        if given is not None:
            raise InputError(f"{given}: needs --room")
    elif distances or directions:
        option = "--distance" if distances else "--direction"
        raise InputError(f"{option} and --room: expected one of them; a plate has a distance, a room has places")


def _calibrate_scanner(
    url: str,
    distance: float,
    direction: float,
    out: Path,
    board: str,
    sector: tuple[float, float, int],
    temperature: float | None,
    force: bool,
) -> None:
    """Scan a plate and write a profile with range offset and home angle; `sector` is width, step and pings."""
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import load_board

    profile, (width, step, pings) = load_board(board), sector
    nearest = profile.blanked_range(Air())
    if not nearest < distance < profile.max_range:
        raise InputError(
            f"--distance {distance:g}: expected {nearest:.2g} to {profile.max_range:g} m, this board's range"
        )
    order = order_in_degrees(direction - width / 2, direction + width / 2, step, pings=pings)
    _check_sector(order, width, step)
    with connect_turntable(url) as scanner:
        readings = _scan(scanner, order, profile, temperature)
    from sonarhw_compare.calibration import plate_readings
    from sonarhw_compare.edits import changed_profile
    from sonarhw_sim.predict.room_echoes import plate_echo

    found = plate_readings.calibrate(
        readings,
        distance,
        math.radians(direction),
        arcs=_arcs(profile, distance, step),
        delay=plate_echo(profile, Air(), distance).delay,
    )
    changed = changed_profile(profile, profile_name(out), partial(_set_calibration, profile, found))
    write_text(out, changed.text, force)
    print_line(_result_line(found, distance))


def _arcs(board: "Board", distance: float, step: float) -> tuple[float, float]:
    """Return the smallest and the largest plausible arc of a plate, rad; its ends are known within a step."""
    from sonarhw_sim.air import Air
    from sonarhw_sim.predict.room_echoes import plate_echo

    faint, loud = (plate_echo(board, Air(), distance, stronger) for stronger in (-_LEVEL_DB, _LEVEL_DB))
    return faint.early_arc - math.radians(step), loud.arc + math.radians(step)


def _check_sector(order: "ScanOrder", width: float, step: float) -> None:
    from sonarhw_compare.calibration.plate_readings import FEWEST

    needed = FEWEST + 2
    if order.headings < needed:
        raise InputError(
            f"--width {width:g}, --step {step:g}: {counted(order.headings, 'heading')}; expected at least {needed}, "
            f"{FEWEST} with an echo of the plate and one without on each side; widen the sector or give smaller steps"
        )


def _scan(scanner: "Scanner", order: "ScanOrder", board: "Board", temperature: float | None) -> "list[Reading]":
    from sonarhw.readings import ScanAir

    speed = ScanAir(chosen_temperature=temperature).speed_of_sound(scanner.info.temperature_c)
    scanner.configure(2 * board.max_range / speed, board.blanking_end, False, speed)
    with interruption(scanner.stop):
        return list(scanner.scan(order))


def _set_calibration(start: "Board", found: "Calibration", profile: Any) -> None:
    """Set the two measured keys in the document of a profile."""
    from sonarhw_compare.edits import set_marked

    # + 0.0 turns -0.0 into 0.0
    offset, home = round(found.range_offset, 5) + 0.0, round(math.degrees(found.home_angle), 3) + 0.0
    set_marked(profile, "range_offset", offset, start.range_offset, "m, measured minus true")
    set_marked(profile, "home_angle_deg", home, start.home_angle_deg, "direction of the turntable's zero")


def _result_line(found: "Calibration", distance: float) -> str:
    return (
        f"plate at {distance:g} m: range offset {found.range_offset * 1000:+.1f} mm "
        f"(spread {found.range_spread * 1000:.1f} mm), home angle {math.degrees(found.home_angle):+.2f} degrees "
        f"(± {math.degrees(found.home_uncertainty):.2f}); echo over {math.degrees(found.arc):.1f} degrees, "
        f"{counted(found.headings, 'heading')}"
    )
