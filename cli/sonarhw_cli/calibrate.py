"""`sonarhw calibrate`: calibrate a board with a plate, now or from logs, or from scans of a known room."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.picture_file import PICTURES
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.errors import InputError, NoPlate, counted
from sonarhw_cli import options
from sonarhw_cli.inputs import check_one_of_each, connect_turntable, open_room, open_scan, place_of_pose, print_place
from sonarhw_cli.interruption import interruption
from sonarhw_cli.outputs import checked_out, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.calibration.outcome import Calibration
    from sonarhw_compare.calibration.room import RoomCalibration
    from sonarhw_compare.scans import GivenScan
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.readings import Reading, ScanOrder

PROFILE = ROOM = ".toml"
_OF_A_SCAN = {name: f"--{name}" for name in ("width", "step", "pings", "temperature")}

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
        autocompletion=options.complete_board,
    ),
]
KnownRoom = Annotated[
    str | None,
    typer.Option(
        "--room", help="Room that the logs are scans of: name or file, without --distance.", metavar=options.ROOM_NAME
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
    temperature: options.Temperature = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    force: options.Force = False,
) -> None:
    """Write the profile of a board, from a plate or a known room.

    A URL: scan the plate, and measure range offset, home angle, aperture and threshold. Logs of a plate at several
    distances: find aperture, gain steps, threshold, swelling, ring-down and blanking. Logs with --room: find threshold,
    aperture, their spreads, range offset and slope, turntable, axis, the carrier's own body, and the room's
    reflectances. Each value has an interval.
    """
    checked_out(out, (PROFILE,), force, *sources, board, room_name)
    of_room = {"--place": places, "--pose": poses, "--room-out": room_out, "--plot": plot}
    _check_method(room_name, distances, directions, of_room)
    logs = [Path(source) for source in sources if Path(source).suffix == options.LOG]
    if len(logs) < len(sources):
        _check_scanner(sources, room_name)
        options.check_temperature(temperature)
        # of an option that is given twice, the last one counts, as in other commands
        distance, direction = (distances or [0.0])[-1], (directions or [0.0])[-1]
        plate = _of_plate_now(sources[0], distance, direction, board, (width, step, pings), temperature)
        _write_profile(plate, out, force)
        _print(plate, out, as_json)
        return
    options.refuse_given(context, _OF_A_SCAN, "is for a scan by a scanner; remove it, or give a URL in place of logs")
    if room_name is None:
        plates = _of_plates(logs, distances or [], directions or [], board)
        _write_profile(plates, out, force)
        _print(plates, out, as_json)
        return
    if room_out is not None:
        checked_out(room_out, (ROOM,), force, *sources, board, room_name, option="--room-out")
        if room_out.resolve() == out.resolve():
            raise InputError(f"--room-out {room_out}: is also --out; choose another name")
    if plot is not None:
        checked_out(plot, PICTURES, force, *sources, board, option="--plot")
    found = _of_room(logs, room_name, places or [], poses or [], board, reflectances=room_out is not None)
    name = _write_profile(found, out, force)
    if room_out is not None:
        write_text(room_out, found.room_with_header(name).text, force)
    if plot is not None:
        from sonarhw_compare.drawings import draw_calibration

        write_figure(plot, draw_calibration(found), force)
    _print(found, out, as_json)


def _check_scanner(sources: list[str], room_name: str | None) -> None:
    """Raise InputError unless the source is the URL of one scanner, for a plate."""
    if room_name is not None:
        raise InputError(f"--room {room_name}: expected logs (*{options.LOG}), not the URL of a scanner; scan first")
    if len(sources) > 1:
        raise InputError(f"{', '.join(sources)}: expected the URL of one scanner, or logs (*{options.LOG})")


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


def _of_plate_now(
    url: str,
    distance: float,
    direction: float,
    board_name: str | None,
    sector: tuple[float, float, int],
    temperature: float | None,
) -> "Calibration":
    """Scan a plate in a sector (width, step, pings), and return the calibration."""
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import load_board

    board, (width, step, pings) = load_board(board_name or DEFAULT_BOARD), sector
    _check_turntable(board)
    nearest = board.blanked_range(Air())
    if not nearest < distance < board.max_range:
        raise InputError(
            f"--distance {distance:g}: expected {nearest:.2g} to {board.max_range:g} m, this board's range"
        )
    order = options.order_in_degrees(direction - width / 2, direction + width / 2, step, pings=pings)
    _check_sector(order, width, step)
    readings = _scanned(url, order, board, temperature)
    from sonarhw_compare.calibration.plate import calibrate_facing_plate

    return calibrate_facing_plate(board, readings, distance, math.radians(direction))


def _check_turntable(board: "Board") -> None:
    if board.ring is not None:
        raise InputError(f"--board {board.name}: has a ring of sensors; a plate calibrates a head on a turntable")


def _check_sector(order: "ScanOrder", width: float, step: float) -> None:
    from sonarhw_compare.calibration.plate_readings import FEWEST

    needed = FEWEST + 2
    if order.headings < needed:
        raise InputError(
            f"--width {width:g}, --step {step:g}: {counted(order.headings, 'heading')}; expected at least {needed}, "
            f"{FEWEST} with an echo of the plate and one without on each side; widen the sector or give smaller steps"
        )


def _scanned(url: str, order: "ScanOrder", board: "Board", temperature: float | None) -> "list[Reading]":
    """Return the readings of a scan by a scanner, with the blanking of the board."""
    from sonarhw.sound_speed import ScanAir

    with connect_turntable(url) as scanner:
        speed = ScanAir(chosen_temperature=temperature).speed_of_sound(scanner.info.temperature_c)
        scanner.configure(2 * board.max_range / speed, board.blanking_end, False, speed)
        with interruption(scanner.stop):
            return list(scanner.scan(order))


def _of_plates(
    logs: Sequence[Path], distances: Sequence[float], directions: Sequence[float], board_name: str | None
) -> "Calibration":
    """Return the calibration from logs of a plate. `directions` are degrees: none, one, or one a log.

    It begins with the board of the logs if `board_name` is None. Raises InputError, and NoPlate if a log shows no
    plate.
    """
    from sonarhw_compare.calibration.plate import calibrate_with_plates
    from sonarhw_compare.calibration.plate_readings import plate_readings
    from sonarhw_compare.scans import common_board

    given = [open_scan(log, board_name) for log in logs]
    board = common_board(given, board_name)
    _check_plates(logs, distances, directions, board)
    turns = list(directions) * (len(logs) if len(directions) == 1 else 1) or [0.0] * len(logs)
    scans = [
        plate_readings(log.name, scan.readings, distance, math.radians(turn), board, _blanked_until(scan))
        for log, scan, distance, turn in zip(logs, given, distances, turns, strict=True)
    ]
    return calibrate_with_plates(board, scans)


def _check_plates(
    logs: Sequence[Path], distances: Sequence[float], directions: Sequence[float], board: "Board"
) -> None:
    """Raise InputError unless there is a distance for each log, and directions as the logs need them."""
    _check_turntable(board)
    if len(distances) != len(logs):
        raise InputError(
            f"--distance: expected one for each of {counted(len(logs), 'log')}, got {len(distances)}; repeat the option"
        )
    if len(directions) not in (0, 1, len(logs)):
        raise InputError(f"--direction: expected one for all logs, or {len(logs)}, got {len(directions)}")
    for distance in distances:
        if not 0 < distance <= board.max_range:
            raise InputError(f"--distance {distance:g}: expected more than 0 and at most {board.max_range:g} m")
    for direction in directions:
        options.check_degrees("--direction", direction)
    twice = {log for log in logs if sum(log.resolve() == other.resolve() for other in logs) > 1}
    if twice:
        raise InputError(f"{min(twice)}: is given twice; give each log once")


def _blanked_until(scan: "GivenScan") -> float:
    """Return the blanking in the settings of the scanner, s; 0 if the log does not contain it."""
    from sonarhw.wire.messages import seconds_of

    settings = scan.log and scan.log.settings
    return seconds_of(settings.blanking_us) if settings else 0.0


def _of_room(
    logs: Sequence[Path],
    room_name: str,
    places: Sequence[str],
    poses: Sequence[str],
    board_name: str | None,
    *,
    reflectances: bool,
) -> "RoomCalibration":
    """Return the calibration from logs of a known room, also of its reflectances if chosen. Raises InputError.

    It begins with the board of the logs if `board_name` is None.
    """
    from sonarhw_compare.calibration.room import calibrate_in_room
    from sonarhw_compare.fit.fitting import placed_scans
    from sonarhw_compare.scans import common_board

    room, given = open_room(room_name), [open_scan(log, board_name) for log in logs]
    board = common_board(given, board_name)
    scans = placed_scans(given, _places(given, room, places, poses))
    with progress_of_share() as show:
        found = calibrate_in_room(board, scans, room, show, reflectances=reflectances)
    remedy = "add --room-out FILE.toml to calibrate it too, and to write the room with it"
    found.doubts += [f"--room {room_name}: {doubt}; {remedy}" for doubt in found.contradictions]
    return found


def _places(given: "Sequence[GivenScan]", room: "Room", places: Sequence[str], poses: Sequence[str]) -> "list[Place]":
    """Return the place of each scan: of --pose, --place or the log."""
    check_one_of_each(places, poses, len(given))
    found = []
    for k, scan in enumerate(given):
        if poses:
            pose = place_of_pose(poses[k])
            here = replace(room.place(pose.position), heading=pose.heading)
        else:
            here = scan.place(room, places[k] if places else None)
        print_place(room, here)
        found.append(here)
    return found


def _write_profile(found: "Calibration", out: Path, force: bool) -> str:
    """Write the profile, if there is a value, and return its name: that of the file."""
    name = out.stem.encode(errors="replace").decode()
    if found.findings:
        write_text(out, found.profile(name).text, force)
    return name


def _print(found: "Calibration", out: Path, as_json: bool) -> None:
    """Print each value, and what stays and why. Raises NoPlate if there is no value."""
    if as_json:
        options.print_json(found.figures())
    else:
        for line in found.lines():
            options.print_line(line)
    for doubt in found.doubts:
        options.warn(doubt)
    if not found.findings:
        raise NoPlate(
            f"{out}: not written: the logs determine no value of the profile, for the reasons above; "
            "scan as they say, or calibrate with --room and scans of a known room"
        )
