"""`sonarhw map`: estimate a room from one or several scans, as a map or as a room file."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.picture_file import PICTURES

from sonarhw.errors import InputError, counted
from sonarhw_cli.inputs import LogFiles, check_one_of_each, open_room, open_scan, place_of_pose, print_place
from sonarhw_cli.options import PICTURE_FILE, ROOM_NAME, BoardOfLog, Force, print_json, print_line, warn
from sonarhw_cli.outputs import checked_out, progress_of_share, write_figure, write_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from sonarhw_compare.fit import PlacedScan
    from sonarhw_compare.locate import Pose, PoseSpread
    from sonarhw_compare.map import RoomMap
    from sonarhw_compare.rooms.outcome import NextPlace
    from sonarhw_compare.rooms.search import FoundRoom, PlacedRoom
    from sonarhw_compare.scans import GivenScan
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

# The room that `sonarhw map` finds from scans, and where to scan next, for the outputs of the command.


@dataclass(frozen=True)
class RoomOfScans:
    """A found room, the poses of the scans in it, and where to scan next."""

    placed: "PlacedRoom"
    room: "Room"  # of its file
    board: "Board"  # with range offset and threshold as found
    given_board: "Board"
    next_places: "tuple[NextPlace, ...] | None"  # best first; None: not wanted

    @property
    def found(self) -> "FoundRoom":
        """The walls and posts, with their uncertainties."""
        return self.placed.found

    @property
    def scans(self) -> "tuple[PlacedScan, ...]":
        """The scans at their refined places, without those that could not be located."""
        return self.placed.scans

    @property
    def lines(self) -> list[str]:
        """What was found, as lines to print."""
        from sonarhw_compare.rooms.outcome import assumptions, open_ends, pose_text

        found = self.found
        return [
            *(f"{title}: {'; '.join(map(pose_text, poses))}" for title, poses in self.placed.poses.items()),
            f"found room: {counted(len(found.draft.walls), 'wall')}, {counted(len(found.draft.posts), 'post')}, "
            f"{counted(len(open_ends(found)), 'open end')}; "
            f"{found.explained} of {found.echoes} echoes are within 5 cm of one that it predicts",
            *assumptions(found, self.given_board),
            *map(_next_text, self.next_places or ()),
        ]

    @property
    def figures(self) -> dict[str, Any]:
        """What was found, as figures for JSON."""
        from sonarhw_compare.rooms.outcome import found_room_figures

        poses = {title: list(map(_pose_figures, several)) for title, several in self.placed.poses.items()}
        figures = found_room_figures(self.found) | {"poses": poses, "left_out": list(self.placed.left_out)}
        if self.next_places is not None:
            figures["next"] = list(map(_next_figures, self.next_places))
        return figures


def room_of_scans(
    scans: "Sequence[PlacedScan]",
    board: "Board",
    given: "Sequence[GivenScan]",
    spreads: "Sequence[PoseSpread]",
    plan_next: bool,
    show: Callable[[float, str], None],
) -> RoomOfScans:
    """Return the room that scans show, with the places to scan next if wanted. `show` receives share and step."""
    from sonarhw_compare.rooms.evidence import as_found
    from sonarhw_compare.rooms.outcome import found_room, next_places
    from sonarhw_compare.rooms.search import find_room_and_poses
    from sonarhw_sim.air import Air

    recorded = given[0].recorded_room
    air = Air() if recorded is None else recorded.air
    placed = find_room_and_poses(scans, board, air, spreads, lambda share: show(share, "finding the room"))
    room, board_as_found = found_room(placed, board), as_found(board, placed.found.draft)
    nexts = None
    if plan_next:
        nexts = next_places(
            placed.found, room, board_as_found, tick=lambda share: show(share, "planning the next scan")
        )
    return RoomOfScans(placed, room, board_as_found, board, nexts)


def rounded_point(point: tuple[float, float]) -> list[float]:
    """Return x and y rounded to µm."""
    return [round(at, 6) + 0.0 for at in point]


def _next_text(one: "NextPlace") -> str:
    x, y = one.position
    sectors = ", ".join(f"{in_degrees(first, 0):.0f}° to {in_degrees(last, 0):.0f}°" for first, last in one.sectors)
    return f"scan next at {x:.2f}, {y:.2f} m: {one.gain:.1f} nats; most from headings {sectors or 'none'}"


def _next_figures(one: "NextPlace") -> dict[str, object]:
    return {
        "position_m": rounded_point(one.position),
        "gain_nats": round(one.gain, 3),
        "headings_deg": [[in_degrees(end, 3) for end in ends] for ends in one.sectors],
    }


def _pose_figures(pose: "Pose") -> dict[str, float]:
    x, y = rounded_point(pose.position)
    return {"x_m": x, "y_m": y, "heading_deg": in_degrees(pose.heading, 3), "probability": round(pose.probability, 6)}


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
    from sonarhw_compare.map import map_scans
    from sonarhw_compare.scans import common_board

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
    found = None
    with progress_of_share() as show:
        if found_for:
            found = room_of_scans(scans, moved, given, spreads, plan_next, show)
            room, scans = found.room, found.scans
        mapped = map_scans(scans, found.board if found else moved, room, lambda share: show(share, "mapping"))
    doubts = [*_doubts(mapped, room_name is not None, found), *_own_body_doubts(scans, chosen)]
    for doubt in doubts:
        warn(doubt)
    known = None if poses or poses_file else _room_of_logs(given)
    _write(files, mapped, room, found, known, doubts, force)
    if as_json:
        print_json(_figures(mapped) | ({} if found is None else {"found": found.figures}))
        return
    for line in found.lines if found else ():
        print_line(line)
    if found:
        print_line("baseline, from regions of constant depth:")
    _print(mapped, "the found room" if found else "this room" if room else "a room of the walls found")


def _doubts(mapped: "RoomMap", is_given: bool, found: RoomOfScans | None) -> Iterator[str]:
    """Yield one line for each reason to doubt a map."""
    from sonarhw_compare.map import CONFIRMING

    if mapped.places < CONFIRMING:
        yield (
            f"scans from {counted(mapped.places, 'place')} only: walls, corners and edges are confirmed by "
            f"{CONFIRMING} places; until then they are possible, or missing"
        )
    if mapped.followed_room is not None and mapped.undetermined > mapped.echoes / 2:
        count = f"{mapped.undetermined} of {mapped.echoes} echoes have no path in"
        check = "check the board and the places of the scans"
        if is_given:
            yield f"{count} this room; {check}, and the room"
        elif found:
            yield f"{count} the found room: walls may be false or missing; {check}, or give more scans"
        else:
            yield (
                f"{count} the room in which sound is followed: walls may be false or missing; give the room with "
                "--room, or more scans"
            )
    for title in found.placed.left_out if found else ():
        yield (
            f"{title}: its pose was not found, so the room is found without it; give more of it in --poses, or "
            "add a scan between it and the others"
        )


def _own_body_doubts(scans: "Sequence[PlacedScan]", board: "Board") -> Iterator[str]:
    """Yield one line for each part of the carrier's body that scans from enough places show, and the profile lacks."""
    from sonarhw_compare.calibration.room import ScanAtPlace, find_own_body, place_numbers
    from sonarhw_compare.map import CONFIRMING
    from sonarhw_sim.board.profile import without_own_body

    if board.ring is not None or len(set(place_numbers([scan.place.position for scan in scans]).tolist())) < CONFIRMING:
        return
    of_room = [ScanAtPlace(without_own_body(board.own_body, scan.readings), scan.place.position) for scan in scans]
    for part in find_own_body(of_room):
        yield (
            f"echoes from {part.nearest:.2f} to {part.farthest:.2f} m at turntable angles {part.from_deg:.0f}° to "
            f"{part.to_deg:.0f}° are the same at most places: if they are of the carrier of the sensor, state this in "
            "the board profile ([[own_body]]; `sonarhw calibrate` finds it), else they become walls and posts"
        )


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
    return given[0].recorded_room if len({scan.room_text for scan in given}) == 1 else None


def _write(
    files: _Outputs,
    mapped: "RoomMap",
    room: "Room | None",
    found: RoomOfScans | None,
    known: "Room | None",
    doubts: Sequence[str],
    force: bool,
) -> None:
    """Write room file, report and picture. `known` is the room that the logs contain."""
    if found and files.room:
        write_text(files.room, found.room.text, force)
    if found and files.report:
        from sonarhw_compare.report import MapReport, map_report_html

        report = MapReport(
            found.found, found.room, found.scans, found.board, mapped, known, tuple(found.lines), tuple(doubts)
        )
        write_text(files.report, map_report_html(report), force)
    if files.picture:
        write_figure(files.picture, _figure(mapped, room, found, known), force)


def _figure(mapped: "RoomMap", room: "Room | None", found: RoomOfScans | None, known: "Room | None") -> "Figure":
    if found is None:
        from sonarhw_compare.drawings import draw_map

        return draw_map(mapped, room)
    from sonarhw_compare.drawings import draw_found_room
    from sonarhw_compare.rooms.outcome import open_ends

    return draw_found_room(found.scans, found.room, found.board, open_ends(found.found), known)


def _with_poses(
    given: "Sequence[GivenScan]",
    room: "Room | None",
    places: Sequence[str],
    poses: Sequence[str],
    poses_file: Path | None,
) -> "tuple[Sequence[PlacedScan], list[PoseSpread]]":
    """Return the scans at their places, and how uncertain these are."""
    from sonarhw_compare.fit.fitting import placed_scans
    from sonarhw_compare.locate import read_poses

    if poses_file is None:
        return placed_scans(given, _places(given, room, places, poses)), []
    if places or poses:
        raise InputError(f"--poses {poses_file}: contains the poses of all logs; leave out --place and --pose")
    read = read_poses(poses_file, [Path(scan.where) for scan in given])
    return placed_scans(given, [place for place, _ in read]), [spread for _, spread in read]


def _places(
    given: "Sequence[GivenScan]", room: "Room | None", places: Sequence[str], poses: Sequence[str]
) -> "list[Place]":
    """Return the place of each scan: of --pose, --place or the log."""
    check_one_of_each(places, poses, len(given))
    found = []
    for k, scan in enumerate(given):
        place = place_of_pose(poses[k]) if poses else _place(scan, room, places[k] if places else None)
        if room is not None or not poses:
            print_place(scan.room(room), place)
        found.append(place)
    return found


def _place(scan: "GivenScan", room: "Room | None", wanted: str | None) -> "Place":
    """Return the place of --place, else the recorded place. Raises InputError if there is neither."""
    if room is None and not scan.room_text:
        raise InputError(f"{scan.where}: contains no room; give --pose X,Y,DEG, or --room and --place")
    known = scan.room(room)
    own = scan.room_text == known.text
    recorded = scan.recorded_place(known)
    # X,Y of another room may be anywhere in this one
    if wanted is None and recorded is not None and (own or recorded in known.places):
        wanted = recorded
    if wanted is None:
        raise InputError(f"{scan.where}: contains no place in room {known.name!r}; give --place or --pose")
    return known.place(wanted)


def _figures(mapped: "RoomMap") -> dict[str, Any]:
    layers = {"all": mapped.plain, "direct": mapped.direct}
    return {
        "readings": sum(len(scan.readings) for scan in mapped.scans),
        "places": mapped.places,
        "confirmed": mapped.plain.features.confirmed,
        "rejected": mapped.rejected,
        "undetermined": mapped.undetermined,
        **{
            name: {
                "regions": len(layer.features.arcs),
                "unexplained": len(layer.features.alone),
                "walls": [
                    {
                        "start_m": rounded_point(wall.start),
                        "end_m": rounded_point(wall.end),
                        "normal_deg": in_degrees(wall.normal, 3),
                        "regions": len(wall.arcs),
                        "confirmed": layer.features.confirmed and not wall.possible,
                    }
                    for wall in layer.features.walls
                ],
                "points": [
                    {
                        "position_m": rounded_point(point.position),
                        "kind": "corner" if point.is_corner else "edge",
                        "regions": len(point.arcs),
                    }
                    for point in layer.features.points
                ],
            }
            for name, layer in layers.items()
        },
    }


def _print(mapped: "RoomMap", where: str) -> None:
    layers = [("all readings", mapped.plain)]
    if mapped.followed_room is not None:
        layers.append(("direct readings", mapped.direct))
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
    for line in _multipath_lines(mapped, where):
        print_line(line)


def _multipath_lines(mapped: "RoomMap", where: str) -> Iterator[str]:
    """Yield what is known about readings by several reflections, and what is not; `where`: the followed room."""
    from sonarhw_compare.map import CONFIRMING

    if mapped.followed_room is None:
        yield (
            f"not determined which of {counted(mapped.echoes, 'reading')} came by several reflections: there are "
            f"no confirmed walls to follow sound in; give the room with --room, or scans from {CONFIRMING} places"
        )
        return
    yield f"{counted(mapped.rejected, 'reading')} removed: in {where}, they came by several reflections"
    if mapped.undetermined:
        yield f"{counted(mapped.undetermined, 'reading')} kept but not determined: no path in {where} explains the echo"
