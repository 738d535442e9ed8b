"""`sonarhw map`: estimate a room from one or several scans."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.headings import in_degrees

from sonarhw.errors import InputError
from sonarhw_cli.console.log_input import LogFiles, open_log, recorded_board, recorded_room
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import BoardOfLog, Force, checked_out
from sonarhw_cli.console.output import atomic_file
from sonarhw_cli.console.progress import progress_of_share
from sonarhw_cli.console.room_input import open_room

if TYPE_CHECKING:
    from sonarhw_compare.fit import PlacedScan
    from sonarhw_compare.map import RoomMap
    from sonarhw_sim.room.model import Place, Room

    from sonarhw.log import Log


def map_logs(
    log_files: LogFiles,
    places: Annotated[
        list[str] | None,
        typer.Option("--place", help="Place of the room, or X,Y in metres; once for each log.", metavar="P"),
    ] = None,
    poses: Annotated[
        list[str] | None,
        typer.Option("--pose", help="Position, and heading of turntable step 0; once for each log.", metavar="X,Y,DEG"),
    ] = None,
    room_file: Annotated[
        Path | None,
        typer.Option("--room", help="Follow sound in this room; default: the walls found.", metavar="ROOM"),
    ] = None,
    board: BoardOfLog = None,
    offset: Annotated[float, typer.Option(help="Added to every measured range, metres.", min=-1, max=1)] = 0.0,
    out: Annotated[Path | None, typer.Option(help="Draw the maps.", metavar="FILE.png")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print walls, corners and edges as JSON.")] = False,
    force: Force = False,
) -> None:
    """Estimate a room from scans.

    A map has a certainty grid, and walls, corners and edges from regions of constant depth. Two maps are made: one
    from all readings, and one without the readings that came by several reflections. Those readings are found by
    following sound in the room.
    """
    from sonarhw_compare.map import map_scans
    from sonarhw_sim.board.profile import load_board

    if out is not None:
        checked_out(out, (".png",), force, room_file, board, *log_files)
    room = None if room_file is None else open_room(room_file)
    logs = [open_log(file) for file in log_files]
    chosen = load_board(board) if board else recorded_board(log_files[0], logs[0].metadata)
    scans = _placed(log_files, logs, room, places or [], poses or [])
    moved = replace(chosen, range_offset=chosen.range_offset - offset)
    with progress_of_share() as show:
        found = map_scans(scans, moved, room, lambda share: show(share, "mapping"))
    if out is not None:
        from sonarhw_compare.map.map_picture import draw_map

        with atomic_file(out) as file:
            draw_map(found, room).savefig(file, format="png")
    if as_json:
        typer.echo(json.dumps(_figures(found), indent=2))
    else:
        _print(found)


def _placed(
    files: Sequence[Path], logs: "Sequence[Log]", room: "Room | None", places: Sequence[str], poses: Sequence[str]
) -> "list[PlacedScan]":
    from sonarhw_compare.fit import PlacedScan

    if places and poses:
        raise InputError("--place, --pose: give only one of them, once for each log")
    for option, given in (("--place", places), ("--pose", poses)):
        if given and len(given) != len(files):
            raise InputError(f"{option}: expected one for each of {counted(len(files), 'log')}, got {len(given)}")
    scans = []
    for k, (file, log) in enumerate(zip(files, logs, strict=True)):
        if not log.readings:
            raise InputError(f"{file}: contains no readings; nothing to map")
        place = _pose(poses[k]) if poses else _place(file, log, room, places[k] if places else None)
        scans.append(PlacedScan(log.readings, place, file.stem))
    return scans


def _pose(text: str) -> "Place":
    from sonarhw_sim.room.model import Place

    try:
        x, y, degrees = map(float, text.split(","))
    except ValueError as error:
        raise InputError(f"--pose {text}: expected X,Y,DEG: metres, metres, degrees") from error
    if not all(map(math.isfinite, (x, y, degrees))):
        raise InputError(f"--pose {text}: expected three finite numbers")
    return Place(text, (x, y), math.radians(degrees))


def _place(file: Path, log: "Log", room: "Room | None", wanted: str | None) -> "Place":
    """Return the place of --place, else the recorded place. Raises InputError if there is neither."""
    known = room or recorded_room(file, log.metadata)
    recorded = log.metadata.place
    if wanted is None and (recorded in known.places or ("," in recorded and log.metadata.room_text == known.text)):
        wanted = recorded
    if wanted is None:
        raise InputError(f"{file}: contains no place in room {known.name!r}; give --place or --pose")
    return known.place(wanted)


def _figures(found: "RoomMap") -> dict[str, Any]:
    layers = {"all": found.plain, "direct": found.direct}
    return {
        "readings": sum(len(scan.readings) for scan in found.scans),
        "rejected": found.rejected,
        **{
            name: {
                "regions": len(layer.features.arcs),
                "unexplained": len(layer.features.alone),
                "walls": [
                    {
                        "start_m": _rounded(wall.start),
                        "end_m": _rounded(wall.end),
                        "normal_deg": in_degrees(wall.normal, 3),
                        "regions": len(wall.arcs),
                    }
                    for wall in layer.features.walls
                ],
                "points": [
                    {
                        "position_m": _rounded(point.position),
                        "kind": "corner" if point.is_corner else "edge",
                        "regions": len(point.arcs),
                    }
                    for point in layer.features.points
                ],
            }
            for name, layer in layers.items()
        },
    }


def _rounded(point: tuple[float, float]) -> list[float]:
    return [round(point[0], 6), round(point[1], 6)]


def _print(found: "RoomMap") -> None:
    for title, layer in (("all readings", found.plain), ("direct readings", found.direct)):
        features = layer.features
        corners = sum(point.is_corner for point in features.points)
        counts = (
            counted(len(features.walls), "wall"),
            counted(corners, "corner"),
            counted(len(features.points) - corners, "edge"),
        )
        typer.echo(
            f"{title}: {counted(len(features.arcs), 'region')} of constant depth, {', '.join(counts)}; "
            f"{counted(len(features.alone), 'region')} unexplained"
        )
    typer.echo(f"{counted(found.rejected, 'reading')} removed: they came by several reflections")
