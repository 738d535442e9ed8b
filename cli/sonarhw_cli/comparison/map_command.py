"""`sonarhw map`: estimate a room from one or several scans."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.pictures.picture_file import PICTURES

from sonarhw.errors import InputError
from sonarhw.harmless_text import counted
from sonarhw_cli.console.lines import print_json, print_line, warn
from sonarhw_cli.console.log_input import LogFiles, open_scan
from sonarhw_cli.console.options import PICTURE_FILE, ROOM_NAME, BoardOfLog, Force
from sonarhw_cli.console.output import checked_out, write_figure, write_text
from sonarhw_cli.console.progress import progress_of_share
from sonarhw_cli.console.room_input import check_one_of_each, open_room, place_of_pose, print_place

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from sonarhw_compare.fit import PlacedScan
    from sonarhw_compare.imports.given_scan import GivenScan
    from sonarhw_compare.locate.pose_spread import PoseSpread
    from sonarhw_compare.locate.poses import Pose
    from sonarhw_compare.map import RoomMap
    from sonarhw_compare.room_finding.next_place import NextPlace
    from sonarhw_compare.room_finding.room_search import FoundRoom
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.model import Place, Room


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
    typer.Option("--poses", help="Poses of all logs, some uncertain or unknown.", metavar="FILE.csv"),
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
    from sonarhw_compare.imports.given_scan import common_board
    from sonarhw_compare.map import map_scans

    files = _outputs(out or [], force, room_name, board, poses_file, *log_files)
    found_for = _option_that_finds(files, plan_next)
    if found_for and room_name:
        raise InputError(f"{found_for}, --room {room_name}: a room is found, or given; give only one of them")
    room = None if room_name is None else open_room(room_name)
    given = [open_scan(file, board) for file in log_files]
    chosen = common_board(given, board)
    scans, spreads = _with_poses(given, room, places or [], poses or [], poses_file)
    incomplete = [log for log, spread in zip(log_files, spreads, strict=False) if not spread.is_whole]
    if incomplete and not found_for:
        raise InputError(
            f"--poses {poses_file}: gives no position or no heading of {incomplete[0]}; expected both of each log; "
            "write them there, or add --out ROOM.toml or --next, which find them with the room"
        )
    moved = replace(chosen, range_offset=chosen.range_offset - offset)
    shown = None
    with progress_of_share() as show:
        if found_for:
            shown = _room_of_scans(scans, moved, given, spreads, plan_next, show)
            room, scans = shown.room, shown.scans
        found = map_scans(scans, shown.board if shown else moved, room, lambda share: show(share, "mapping"))
    doubts = list(_doubts(found, room_name is not None, shown))
    for doubt in doubts:
        warn(doubt)
    known = None if poses or poses_file else _room_of_logs(given)
    _write(files, found, room, shown, known, doubts, force)
    if as_json:
        print_json(_figures(found) | ({} if shown is None else {"found": shown.figures}))
        return
    _print(found, room is not None)
    for line in shown.lines if shown else ():
        print_line(line)


@dataclass(frozen=True)
class _RoomOfScans:
    """A found room for the outputs of the command."""

    found: "FoundRoom"
    board: "Board"
    room: "Room"  # of its file
    scans: "list[PlacedScan]"  # from the refined places
    figures: dict[str, Any]
    lines: list[str]
    left_out: tuple[str, ...]  # titles of scans that could not be located


def _doubts(found: "RoomMap", is_given: bool, shown: _RoomOfScans | None) -> Iterator[str]:
    """Yield one line for each reason to doubt a map."""
    from sonarhw_compare.map.features import CONFIRMING

    if found.places < CONFIRMING:
        yield (
            f"scans from {counted(found.places, 'place')} only: walls, corners and edges are confirmed by "
            f"{CONFIRMING} places; until then they are possible, or missing"
        )
    if found.followed_room is not None and found.undetermined > found.echoes / 2:
        count = f"{found.undetermined} of {found.echoes} echoes have no path in"
        yield (
            f"{count} this room; check the room, the board and the places of the scans"
            if is_given
            else f"{count} the room in which sound is followed: walls may be false or missing; give the room with "
            "--room, or more scans"
        )
    for title in shown.left_out if shown else ():
        yield f"{title}: its pose was not found, so the room is found without it"


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


def _room_of_logs(given: "Sequence[GivenScan]") -> "Room | None":
    """Return the room that all logs contain; None if there is none, or not the same in all."""
    texts = {scan.log.metadata.room_text if scan.log is not None else "" for scan in given}
    return given[0].room() if len(texts) == 1 and texts != {""} else None


def _write(
    files: _Outputs,
    found: "RoomMap",
    room: "Room | None",
    shown: _RoomOfScans | None,
    known: "Room | None",
    doubts: Sequence[str],
    force: bool,
) -> None:
    """Write room file, report and picture. `known` is the room that the logs contain."""
    if shown and files.room:
        write_text(files.room, shown.room.text, force)
    if shown and files.report:
        from sonarhw_compare.report.map_report import MapReport, map_report_html

        report = MapReport(
            shown.found, shown.room, tuple(shown.scans), shown.board, found, known, tuple(shown.lines), tuple(doubts)
        )
        write_text(files.report, map_report_html(report), force)
    if files.picture:
        write_figure(files.picture, _figure(found, room, shown, known), force)


def _figure(found: "RoomMap", room: "Room | None", shown: _RoomOfScans | None, known: "Room | None") -> "Figure":
    if shown is None:
        from sonarhw_compare.map.map_picture import draw_map

        return draw_map(found, room)
    from sonarhw_compare.report.found_room_picture import draw_found_room
    from sonarhw_compare.room_finding.found_room_file import open_ends

    return draw_found_room(shown.scans, shown.room, shown.board, open_ends(shown.found), known)


def _room_of_scans(
    scans: "list[PlacedScan]",
    board: "Board",
    given: "Sequence[GivenScan]",
    spreads: "Sequence[PoseSpread]",
    plan_next: bool,
    show: Callable[[float, str], None],
) -> _RoomOfScans:
    from sonarhw_compare.room_finding.evidence import with_offset
    from sonarhw_compare.room_finding.found_room_file import (
        assumptions,
        found_room,
        found_room_figures,
        open_ends,
    )
    from sonarhw_compare.room_finding.unknown_poses import find_room_and_poses
    from sonarhw_sim.air import Air

    air = given[0].room().air if given[0].log is not None and given[0].log.metadata.room_text else Air()
    placed = find_room_and_poses(scans, board, air, spreads, lambda share: show(share, "finding the room"))
    found = placed.found
    lines = [f"{title}: {'; '.join(map(_pose_text, poses))}" for title, poses in placed.poses.items()]
    lines.append(
        f"found room: {counted(len(found.draft.walls), 'wall')}, {counted(len(found.draft.posts), 'post')}, "
        f"{counted(len(open_ends(found)), 'open end')}; "
        f"{found.explained} of {found.echoes} echoes are within 5 cm of one that it predicts"
    )
    lines += assumptions(found, board)
    figures = found_room_figures(found) | {
        "poses": {title: [_pose_figures(pose) for pose in poses] for title, poses in placed.poses.items()},
        "left_out": list(placed.left_out),
    }
    room = found_room(found, placed.scans, board)
    board = with_offset(board, found.draft)
    if plan_next:
        from sonarhw_compare.room_finding.next_place import next_places

        nexts = next_places(found, room, board, tick=lambda share: show(share, "planning the next scan"))
        lines += map(_next_text, nexts)
        figures["next"] = [
            {
                "position_m": _rounded(one.position),
                "gain_nats": round(one.gain, 3),
                "headings_deg": [[in_degrees(end, 3) for end in ends] for ends in one.sectors],
            }
            for one in nexts
        ]
    return _RoomOfScans(found, board, room, list(placed.scans), figures, lines, placed.left_out)


def _next_text(one: "NextPlace") -> str:
    x, y = one.position
    sectors = ", ".join(f"{in_degrees(first, 0):.0f}° to {in_degrees(last, 0):.0f}°" for first, last in one.sectors)
    return f"scan next at {x:.2f}, {y:.2f} m: {one.gain:.1f} nats; most from headings {sectors or 'none'}"


def _pose_figures(pose: "Pose") -> dict[str, float]:
    x, y = _rounded(pose.position)
    return {"x_m": x, "y_m": y, "heading_deg": in_degrees(pose.heading, 3), "probability": round(pose.probability, 6)}


def _pose_text(pose: "Pose") -> str:
    x, y = pose.position
    return f"{pose.probability:.1%} at {x:.3f}, {y:.3f} m, turntable step 0 at {in_degrees(pose.heading, 1):.1f}°"


def _with_poses(
    given: "Sequence[GivenScan]",
    room: "Room | None",
    places: Sequence[str],
    poses: Sequence[str],
    poses_file: Path | None,
) -> "tuple[list[PlacedScan], list[PoseSpread]]":
    """Return the scans at their places, and how uncertain these are."""
    from sonarhw_compare.fit import PlacedScan
    from sonarhw_compare.room_finding.pose_file import read_poses

    if poses_file is None:
        return _placed(given, room, places, poses), []
    if places or poses:
        raise InputError(f"--poses {poses_file}: contains the poses of all logs; leave out --place and --pose")
    read = read_poses(poses_file, [Path(scan.where) for scan in given])
    scans = [
        PlacedScan(scan.readings, place, Path(scan.where).stem, scan.where)
        for scan, (place, _) in zip(given, read, strict=True)
    ]
    return scans, [spread for _, spread in read]


def _placed(
    given: "Sequence[GivenScan]", room: "Room | None", places: Sequence[str], poses: Sequence[str]
) -> "list[PlacedScan]":
    from sonarhw_compare.fit import PlacedScan

    check_one_of_each(places, poses, len(given))
    scans = []
    for k, scan in enumerate(given):
        place = place_of_pose(poses[k]) if poses else _place(scan, room, places[k] if places else None)
        if room is not None or not poses:
            print_place(scan.room(room), place)
        scans.append(PlacedScan(scan.readings, place, Path(scan.where).stem, scan.where))
    return scans


def _place(scan: "GivenScan", room: "Room | None", wanted: str | None) -> "Place":
    """Return the place of --place, else the recorded place. Raises InputError if there is neither."""
    if room is None and (scan.log is None or not scan.log.metadata.room_text):
        raise InputError(f"{scan.where}: contains no room; give --pose X,Y,DEG, or --room and --place")
    known = scan.room(room)
    own = scan.log is not None and scan.log.metadata.room_text == known.text
    recorded = scan.recorded_place(known)
    # X,Y of another room may be anywhere in this one
    if wanted is None and recorded is not None and (own or recorded in known.places):
        wanted = recorded
    if wanted is None:
        raise InputError(f"{scan.where}: contains no place in room {known.name!r}; give --place or --pose")
    return known.place(wanted)


def _figures(found: "RoomMap") -> dict[str, Any]:
    layers = {"all": found.plain, "direct": found.direct}
    return {
        "readings": sum(len(scan.readings) for scan in found.scans),
        "places": found.places,
        "confirmed": found.plain.features.confirmed,
        "rejected": found.rejected,
        "undetermined": found.undetermined,
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
                        "confirmed": layer.features.confirmed and not wall.possible,
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
    return [round(at, 6) + 0.0 for at in point]


def _print(found: "RoomMap", given: bool) -> None:
    layers = [("all readings", found.plain)]
    if found.followed_room is not None:
        layers.append(("direct readings", found.direct))
    for title, layer in layers:
        features = layer.features
        corners = sum(point.is_corner for point in features.points)
        maybe = "" if features.confirmed else "possible "
        possible = sum(wall.possible for wall in features.walls) if features.confirmed else 0
        counts = (
            counted(len(features.walls) - possible, f"{maybe}wall"),
            *([counted(possible, "possible wall")] if possible else []),
            counted(corners, f"{maybe}corner"),
            counted(len(features.points) - corners, f"{maybe}edge"),
        )
        print_line(
            f"{title}: {counted(len(features.arcs), 'region')} of constant depth, {', '.join(counts)}; "
            f"{counted(len(features.alone), 'region')} unexplained"
        )
    for line in _multipath_lines(found, given):
        print_line(line)


def _multipath_lines(found: "RoomMap", given: bool) -> Iterator[str]:
    """Yield what is known about readings by several reflections, and what is not."""
    from sonarhw_compare.map.features import CONFIRMING

    if found.followed_room is None:
        yield (
            f"not determined which of {counted(found.echoes, 'reading')} came by several reflections: there are "
            f"no confirmed walls to follow sound in; give the room with --room, or scans from {CONFIRMING} places"
        )
        return
    where = "this room" if given else "a room of the walls found"
    yield f"{counted(found.rejected, 'reading')} removed: in {where}, they came by several reflections"
    if found.undetermined:
        yield f"{counted(found.undetermined, 'reading')} kept but not determined: no path in {where} explains the echo"
