"""`sonarhw calibrate`: calibrate a board with a plate, now or from logs, or from scans of a known room."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.picture_file import PICTURES
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.errors import InputError, NoPlate, counted
from sonarhw_cli.inputs import check_one_of_each, connect_turntable, open_room, open_scan, place_of_pose, print_place
from sonarhw_cli.interruption import interruption
from sonarhw_cli.options import (
    LOG,
    ROOM_NAME,
    Force,
    Temperature,
    check_degrees,
    check_temperature,
    complete_board,
    order_in_degrees,
    print_line,
    refuse_given,
    warn,
)
from sonarhw_cli.outputs import checked_out, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.calibration.plate import PlateCalibration
    from sonarhw_compare.calibration.plate_readings import Calibration, PlateReadings
    from sonarhw_compare.calibration.room import RoomCalibration
    from sonarhw_compare.scans import GivenScan
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.host.scanner import Scanner
    from sonarhw.readings import Reading, ScanOrder

# `sonarhw calibrate LOG…`: a board profile from scans of a plate (--distance) or of a known room (--room).


def calibrate_with_plate(
    logs: Sequence[Path],
    distances: Sequence[float],
    directions: Sequence[float],
    board_name: str | None,
    out: Path,
    force: bool,
) -> None:
    """Write the profile that the logs give, and print each value. `directions` are degrees: none, one, or one a log.

    The calibration begins with the board of the logs if `board_name` is None.
    Raises InputError, and NoPlate if a log shows no plate, or if the logs determine no value.
    """
    from sonarhw_compare.calibration.plate import calibrate_with_plates, plate_profile
    from sonarhw_compare.scans import common_board

    given = [open_scan(log, board_name) for log in logs]
    board = common_board(given, board_name)
    _check_plates(logs, distances, directions, board)
    turns = list(directions) * (len(logs) if len(directions) == 1 else 1) or [0.0] * len(logs)
    scans = [_plate_readings(*one, board) for one in zip(logs, given, distances, turns, strict=True)]
    found = calibrate_with_plates(board, scans)
    if found.findings:
        write_text(out, plate_profile(board, found, scans, profile_name(out)).text, force)
    for line in [*_value_lines(found), *_kept_lines(found, board)]:
        print_line(line)
    for doubt in found.doubts:
        warn(doubt)
    if not found.findings:
        raise NoPlate(
            f"{out}: not written: the logs determine no value of the profile, for the reasons above; "
            "scan as they say, or calibrate with --room and scans of a known room"
        )


def calibrate_with_room(
    logs: Sequence[Path],
    room_name: str,
    places: Sequence[str],
    poses: Sequence[str],
    board_name: str | None,
    out: Path,
    room_out: Path | None,
    plot: Path | None,
    force: bool,
) -> None:
    """Write the profile that the logs give and a picture of the scans, and print each value. Raises InputError.

    The calibration begins with the board of the logs if `board_name` is None.
    With `room_out`, the reflectances of the room are calibrated too, and the room is written there.
    """
    from sonarhw_compare.calibration.room import (
        calibrate_board_and_room,
        calibrate_in_room,
        room_profile,
        with_provenance,
    )
    from sonarhw_compare.fit.fitting import placed_scans
    from sonarhw_compare.scans import common_board

    room, given = open_room(room_name), [open_scan(log, board_name) for log in logs]
    board = common_board(given, board_name)
    scans = placed_scans(given, _places(given, room, places, poses))
    with progress_of_share() as show:
        calibrate = calibrate_in_room if room_out is None else calibrate_board_and_room
        found = calibrate(board, scans, room, show)
    write_text(out, room_profile(board, found, scans, room.name, profile_name(out)).text, force)
    if room_out is not None:
        titles = [scan.title for scan in scans]
        write_text(room_out, with_provenance(found.room, found.reflectances, profile_name(out), titles).text, force)
    if plot is not None:
        from sonarhw_compare.drawings import draw_calibration

        write_figure(plot, draw_calibration(found, scans), force)
    for line in [*_value_lines(found), *_own_body_lines(found), *_kept_lines(found, board), *_room_lines(found)]:
        print_line(line)
    for scan, before, after in zip(scans, found.before, found.after, strict=True):
        print_line(f"{scan.name}: before {before.line}")
        print_line(f"{scan.name}: after {after.line}")
    for doubt in (*found.proposals, *found.doubts, *_room_doubts(found, room_name)):
        warn(doubt)


def profile_name(out: Path) -> str:
    """Return the name of the profile in a file: that of the file."""
    return out.stem.encode(errors="replace").decode()


def _check_plates(
    logs: Sequence[Path], distances: Sequence[float], directions: Sequence[float], board: "Board"
) -> None:
    """Raise InputError unless there is a distance for each log, and directions as the logs need them."""
    if board.ring is not None:
        raise InputError(f"--board {board.name}: has a ring of sensors; a plate calibrates a head on a turntable")
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
        check_degrees("--direction", direction)
    twice = {log for log in logs if sum(log.resolve() == other.resolve() for other in logs) > 1}
    if twice:
        raise InputError(f"{min(twice)}: is given twice; give each log once")


def _plate_readings(log: Path, scan: "GivenScan", distance: float, direction: float, board: "Board") -> "PlateReadings":
    from sonarhw_compare.calibration.plate_readings import plate_readings

    return plate_readings(log.name, scan.readings, distance, math.radians(direction), board, _blanked_until(scan))


def _blanked_until(scan: "GivenScan") -> float:
    """Return the blanking in the settings of the scanner, s; 0 if the log does not contain it."""
    from sonarhw.wire.messages import seconds_of

    settings = scan.log and scan.log.settings
    return seconds_of(settings.blanking_us) if settings else 0.0


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


def _value_lines(found: "PlateCalibration | RoomCalibration") -> list[str]:
    return [f"{one.key}: {one.text}, 95 % {one.interval_text}; before: {one.before:g}" for one in found.findings]


def _own_body_lines(found: "RoomCalibration") -> list[str]:
    if not found.own_body:
        return []
    parts = [
        f"own body: turntable angles {part.from_deg:g} to {part.to_deg:g} degrees, "
        f"{part.nearest:g} to {part.farthest:g} m"
        for part in found.own_body
    ]
    return [*parts, f"own body: {counted(found.own_echoes, 'reading')} left out"]


def _room_lines(found: "RoomCalibration") -> list[str]:
    """Return what the scans give for the room, and to which room the profile belongs."""
    from sonarhw_compare.calibration.room import reflectance_text

    used = (
        "used, and written with the room" if found.room_is_changed else "not used; the profile belongs to the room file"
    )
    return [f"{reflectance_text(one)}; {used}" for one in found.reflectances]


def _room_doubts(found: "RoomCalibration", room_name: str) -> list[str]:
    from sonarhw_compare.calibration.room import is_contradicted

    if found.room_is_changed:
        return []
    return [
        f"--room {room_name}: the scans contradict the reflectance {one.before:g} of {one.key!r}: {one.interval_text}; "
        "add --room-out FILE.toml to calibrate it too, and to write the room with it"
        for one in found.reflectances
        if is_contradicted(one)
    ]


def _kept_lines(found: "PlateCalibration | RoomCalibration", start: "Board") -> list[str]:
    return [f"{key}: stays {_present(start, key)}; {reason}" for key, reason in found.kept.items()]


def _present(start: "Board", key: str) -> str:
    """Return the value of a key, such as `mount.ahead`, or the number of its parts."""
    section, _, name = key.rpartition(".")
    value = getattr(getattr(start, section) if section else start, name)
    return f"{value:g}" if isinstance(value, float) else counted(len(value), "part")


# `sonarhw calibrate`: calibrate a board with a flat plate, now or from logs, and write a board profile.


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
    from sonarhw.sound_speed import ScanAir

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
