"""`sonarhw map`: estimate a room from one or several scans, as a map or as a room file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.picture_file import PICTURES

from sonarhw.errors import InputError
from sonarhw_cli.inputs import LogFiles, check_one_of_each, open_room, open_scan, place_of_pose
from sonarhw_cli.options import PICTURE_FILE, ROOM_NAME, BoardOfLog, Force, print_result, warn, with_options
from sonarhw_cli.outputs import checked_out, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from sonarhw_compare.rooms.outcome import MappedScans


# `sonarhw map`: estimate a room from one or several scans.


PlacesOfLogs = Annotated[
    list[str] | None,
    typer.Option("--place", help="Place of the room, or X,Y in metres; once for each log.", metavar="P"),
]
PosesOfLogs = Annotated[
    list[str] | None,
    typer.Option("--pose", help="Position, and heading of turntable step 0; once for each log.", metavar="X,Y,DEG"),
]
RoomToFollow = Annotated[
    str | None,
    typer.Option("--room", help="Follow sound in this room; default: the walls found.", metavar=ROOM_NAME),
]
PosesFile = Annotated[
    Path | None,
    typer.Option(
        "--poses",
        help="Poses of all logs, some uncertain or unknown; columns: "
        "log, x_m, y_m, heading_deg, sd_xy_m, sd_heading_deg.",
        metavar="FILE.csv",
    ),
]
MapFiles = Annotated[
    list[Path] | None,
    typer.Option(
        help="Picture of the maps. ROOM.toml, or a report .html with the maps beside the room: find the room. "
        "Once for each file.",
        metavar=f"ROOM.toml|FILE.html|{PICTURE_FILE}",
    ),
]
PlanNext = Annotated[bool, typer.Option("--next", help="Find the room, and where to scan next to learn most about it.")]


def map_logs(
    log_files: LogFiles,
    places: PlacesOfLogs = None,
    poses: PosesOfLogs = None,
    room_name: RoomToFollow = None,
    board: BoardOfLog = None,
    offset: Annotated[float, typer.Option(help="Added to every measured range, metres.", min=-1, max=1)] = 0.0,
    poses_file: PosesFile = None,
    out: MapFiles = None,
    plan_next: PlanNext = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print walls, corners and edges as JSON.")] = False,
    force: Force = False,
) -> None:
    """Estimate a room from scans.

    A map has a certainty grid, and walls, corners and edges from regions of constant depth. Two maps are made: one
    from all readings, and one without the readings that came by several reflections. Those readings are found by
    following sound in the room.

    With --out ROOM.toml or --out FILE.html, the room is found: walls and posts that explain all echoes and silences, by
    the model of a fit, with their uncertainties. Sound is then followed in this room, and a picture shows it.
    """
    files = _outputs(out or [], force, room_name, board, poses_file, *log_files)
    found_for = _option_that_finds(files, plan_next)
    if found_for and room_name:
        raise InputError(f"{found_for}, --room {room_name}: a room is found, or given; give only one of them")
    room = None if room_name is None else open_room(room_name)
    scans = [open_scan(file, board) for file in log_files]
    check_one_of_each(places or [], poses or [], len(scans))
    from sonarhw_compare.one_call import map_room

    with progress_of_share() as show:
        mapped = map_room(
            scans,
            [place_of_pose(pose) for pose in poses] if poses else places,
            room,
            board,
            poses=poses_file,
            offset=offset,
            find=bool(found_for),
            plan_next=plan_next,
            progress=show,
            warn=warn,
        )
    mapped = replace(mapped, doubts=tuple(map(with_options, mapped.doubts)))
    for doubt in mapped.doubts:
        warn(doubt)
    _write(files, mapped, force)
    print_result(as_json, mapped.figures, mapped.lines)


@dataclass(frozen=True)
class _Outputs:
    """The names of the files to write; None for one that is not wanted."""

    room: Path | None = None
    report: Path | None = None
    picture: Path | None = None


def _outputs(out: Sequence[Path], force: bool, *inputs: str | Path | None) -> _Outputs:
    kinds, files = {".toml": "room", ".html": "report"}, _Outputs()
    for path in out:
        kind = kinds.get(checked_out(path, [*PICTURES, *kinds], force, *inputs), "picture")
        if (other := getattr(files, kind)) is not None:
            raise InputError(f"--out {other}, --out {path}: give one room file, one report and one picture at most")
        files = replace(files, **{kind: path})
    return files


def _option_that_finds(files: _Outputs, plan_next: bool) -> str:
    """Return the option that needs a found room, such as `--out FILE`; empty if none does."""
    if file := files.room or files.report:
        return f"--out {file}"
    return "--next" if plan_next else ""


def _write(files: _Outputs, mapped: "MappedScans", force: bool) -> None:
    """Write room file, report and picture."""
    if mapped.found and files.room:
        write_text(files.room, mapped.found.room.text, force)
    if mapped.found and files.report:
        from sonarhw_compare.report import map_report_html

        write_text(files.report, map_report_html(mapped), force)
    if files.picture:
        write_figure(files.picture, mapped.draw(), force)
