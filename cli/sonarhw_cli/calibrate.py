"""`sonarhw calibrate`: calibrate a board with a plate, now or from logs, or from scans of a known room."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.picture_file import PICTURES
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.errors import InputError, NoPlate
from sonarhw_cli import options
from sonarhw_cli.inputs import (
    check_one_of_each,
    connect_turntable,
    note_assumed_heading,
    open_room,
    open_scan,
    place_of_pose,
)
from sonarhw_cli.interruption import interruption
from sonarhw_cli.outputs import checked_out, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.calibration.outcome import Calibration
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.host.scanner import Scanner

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
    if room_out is not None:
        checked_out(room_out, (ROOM,), force, *sources, board, room_name, option="--room-out")
        if room_out.resolve() == out.resolve():
            raise InputError(f"--room-out {room_out}: is also --out; choose another name")
    if plot is not None:
        checked_out(plot, PICTURES, force, *sources, board, option="--plot")
    for direction in directions or []:
        options.check_degrees("--direction", direction)
    logs = [Path(source) for source in sources if Path(source).suffix == options.LOG]
    if len(logs) < len(sources):
        options.check_temperature(temperature)
        # of an option that is given twice, the last one counts, as in other commands
        distance, direction = (distances or [])[-1:], (directions or [0.0])[-1]
        calibration = _with_scanner(sources, distance, direction, room_name, board, (width, step, pings), temperature)
    else:
        reason = "is for a scan by a scanner; remove it, or give a URL in place of logs"
        options.refuse_given(context, _OF_A_SCAN, reason)
        if room_name is None:
            calibration = _with_plates(logs, distances or [], directions or [], board)
        else:
            calibration = _in_room(logs, room_name, places or [], poses or [], board, reflectances=room_out is not None)
    name = out.stem.encode(errors="replace").decode()
    if calibration.findings:
        write_text(out, calibration.profile(name).text, force)
    if room_name is not None:
        _write_room_and_picture(calibration, name, room_out, plot, force)
    _print(calibration, out, as_json)


def _with_scanner(
    sources: list[str],
    distance: list[float],
    direction: float,
    room_name: str | None,
    board: str | None,
    sector: tuple[float, float, int],
    temperature: float | None,
) -> "Calibration":
    """Scan a plate in a sector (width and step in degrees, pings), and return the calibration."""
    from sonarhw_compare import one_call

    width, step, pings = sector
    order = options.order_in_degrees(direction - width / 2, direction + width / 2, step, pings=pings)
    one_call.check_sector(order, f"--width {width:g}, --step {step:g}")
    return one_call.calibrate(
        sources,
        board,
        distances=distance,
        directions=math.radians(direction) if distance else (),
        room=room_name,
        order=order,
        temperature=temperature,
        connect=_connected,
        warn=options.warn,
    )


@contextmanager
def _connected(url: str) -> "Iterator[Scanner]":
    """Yield the connected scanner at `url`, which Ctrl-C stops."""
    with connect_turntable(url) as scanner, interruption(scanner.stop):
        yield scanner


def _with_plates(
    logs: Sequence[Path], distances: Sequence[float], directions: Sequence[float], board: str | None
) -> "Calibration":
    """Return the calibration from logs of a plate. `directions` are degrees: none, one, or one a log."""
    from sonarhw_compare import one_call

    scans, turns = [open_scan(log, board) for log in logs], list(map(math.radians, directions))
    return one_call.calibrate(scans, board, distances=distances, directions=turns, warn=options.warn)


def _in_room(
    logs: Sequence[Path],
    room_name: str,
    places: Sequence[str],
    poses: Sequence[str],
    board: str | None,
    *,
    reflectances: bool,
) -> "Calibration":
    """Return the calibration from logs of a known room, also of its reflectances if chosen."""
    from sonarhw_compare import one_call

    room, scans = open_room(room_name), [open_scan(log, board) for log in logs]
    check_one_of_each(places, poses, len(scans))
    for place in places:
        note_assumed_heading(place)
    with progress_of_share() as show:
        calibration = one_call.calibrate(
            scans,
            board,
            room=room,
            places=[_place_of_pose(room, pose) for pose in poses] if poses else places,
            reflectances=reflectances,
            progress=show,
            warn=options.warn,
        )
    named = f"room {room.name!r}: ", f"--room {room_name}: "
    calibration.doubts = [options.with_options(doubt).replace(*named) for doubt in calibration.doubts]
    return calibration


def _place_of_pose(room: "Room", text: str) -> "Place":
    pose = place_of_pose(text)
    return replace(room.place(pose.position), heading=pose.heading)


def _write_room_and_picture(
    calibration: "Calibration", name: str, room_out: Path | None, plot: Path | None, force: bool
) -> None:
    """Write what a calibration in a room adds to the profile of this name."""
    from sonarhw_compare.calibration.room import RoomCalibration

    assert isinstance(calibration, RoomCalibration)
    if room_out is not None:
        write_text(room_out, calibration.room_with_header(name).text, force)
    if plot is not None:
        from sonarhw_compare.drawings import draw_calibration

        write_figure(plot, draw_calibration(calibration), force)


def _print(calibration: "Calibration", out: Path, as_json: bool) -> None:
    """Print each value, and what stays and why. Raises NoPlate if there is no value."""
    if as_json:
        options.print_json(calibration.figures())
    else:
        for line in calibration.lines():
            options.print_line(line)
    for doubt in calibration.doubts:
        options.warn(doubt)
    if not calibration.findings:
        raise NoPlate(
            f"{out}: not written: the logs determine no value of the profile, for the reasons above; "
            "scan as they say, or calibrate with --room and scans of a known room"
        )
