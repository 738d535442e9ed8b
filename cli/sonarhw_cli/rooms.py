"""`sonarhw room` and `sonarhw profile`: list, write, import and check room files and board profiles."""

import re
from dataclasses import asdict
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.picture_file import PICTURES
from sonarhw_compare.room_import import REFLECTANCE
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.errors import InputError, counted, smaller_unit
from sonarhw_cli.options import BoardName, CommandList, Force, Profile, RoomName, print_json, print_line, print_note
from sonarhw_cli.outputs import NewFile, checked_out, write_figure, write_template, write_text

if TYPE_CHECKING:
    from sonarhw_sim.check import Finding
    from sonarhw_sim.room.room import Room

# `sonarhw room`: list the shipped rooms, write a new one, import, check a room file, print its JSON Schema.


REFUSED = 2  # exit status
_LARGEST, _USUAL = 100.0, 20.0  # m, the longest side of a new room, and of a usual one
NewRoomFile = Annotated[Path, typer.Argument(help="File to create.", metavar="NAME.toml")]

room_app = CommandList(help="List, write, import and check room files.", no_args_is_help=True)


@room_app.command("list")
def list_rooms() -> None:
    """List the shipped rooms with their places."""
    from sonarhw_sim.room.room import load_room, room_names

    for name in room_names():
        print_line(f"{name:15} places: {', '.join(load_room(name).places) or 'none'}")


Size = Annotated[str | None, typer.Option(help="Only four walls: width and depth of the room, metres.", metavar="WxD")]
NewPlace = Annotated[
    str | None,
    typer.Option("--place", help="With --size: place of the scanner, metres and degrees.", metavar="X,Y[,DEG]"),
]


@room_app.command("new")
def new_room(file: NewRoomFile = Path("room.toml"), size: Size = None, place: NewPlace = None) -> None:
    """Write a room file to start from. An existing file is never overwritten.

    Without --size, the file is annotated and has examples of all kinds of objects. With --size, the room is empty.
    """
    if size is None and place is not None:
        raise InputError("--place needs --size: the annotated file has a place already")
    if size is None:
        write_template("sonarhw_sim.room", file)
    else:
        _write_empty_room(file, size, place)
    print_note(f"{file}: edit it, then run: sonarhw room check {quote(str(file))}")


def _write_empty_room(file: Path, size: str, place: str | None) -> None:
    from sonarhw_sim.room.room import read_pose
    from sonarhw_sim.room.room_arrays import rectangular_room

    checked_out(file, (".toml",), True, option="FILE")  # `write_text` refuses an existing file
    try:
        width, depth = map(float, re.split("[x×,]", size))
    except ValueError:
        raise InputError(f"--size {size}: expected width and depth in metres, such as 3.2x2.4") from None
    try:
        pose = None if place is None else read_pose(place)
    except ValueError:
        raise InputError(f"--place {place}: expected X,Y in metres, such as 1.6,0.12, or X,Y,DEG") from None
    if max(width, depth) > _LARGEST:
        unit, count = smaller_unit(max(width, depth), _USUAL)
        meant = f"if these are {unit}, write --size {width / count:g}x{depth / count:g}"
        raise InputError(f"--size {size}: expected metres, at most {_LARGEST:g}; {meant}")
    write_text(file, rectangular_room(width, depth, pose, name=file.stem).text, False)
    if pose is None:
        print_note("place 'scanner': in the middle, heading 0, along x; --place X,Y,DEG states another one")
    elif len(pose) == 2:
        print_note(f"place 'scanner': heading 0 assumed, along x; --place {place},DEG states another one")


ForeignRoom = Annotated[
    Path,
    typer.Argument(
        help="Map of ROS (YAML), world of Gazebo (SDF) or Stage, drawing as DXF or SVG, or GeoJSON.", metavar="FILE"
    ),
]
RoomOut = Annotated[
    Path | None, typer.Option("--out", help="Room file; default: the name of FILE with .toml.", metavar="ROOM.toml")
]
DrawingUnit = Annotated[
    str, typer.Option("--unit", help="Drawings: unit of the coordinates: m, cm, mm, in, ft, or metres of one.")
]
Layers = Annotated[list[str] | None, typer.Option("--layer", help="Drawings: layer to read; default: all. Repeatable.")]
Level = Annotated[
    float | None, typer.Option("--height", help="Only what exists at this height, metres, such as that of the scanner.")
]
AssumedReflectance = Annotated[
    float, typer.Option("--reflectance", help="Reflectance of all surfaces, which these files do not state.")
]


@room_app.command("import")
def import_room_file(
    file: ForeignRoom,
    out: RoomOut = None,
    unit: DrawingUnit = "",
    layers: Layers = None,
    height: Level = None,
    reflectance: AssumedReflectance = REFLECTANCE,
    force: Force = False,
) -> None:
    """Convert a file of another program to a room file.

    Prints how it was read: unit, errors of the walls, what was left out. Robots and sensors in worlds become places.
    """
    from sonarhw_compare.room_import.imported import import_room
    from sonarhw_sim.check import plan_findings

    path = Path(f"{file.stem}.toml") if out is None else out
    checked_out(path, (".toml",), force, file)
    imported = import_room(file, unit=unit, layers=layers or (), height=height, reflectance=reflectance)
    write_text(path, imported.room.text, force)
    for note in imported.notes:
        print_line(note)
    findings = counted(len([*plan_findings(imported.room)]), "finding")
    places = ", ".join(map(repr, imported.room.places)) or "none: commands take --place X,Y,DEG"
    print_line(f"{path}: {_content_of(imported.room)}; places: {places}; {findings}")
    print_note(f"look at it: sonarhw room check {quote(str(path))} --plot {quote(f'{path.stem}.png')}")


@room_app.command("schema")
def room_schema() -> None:
    """Print the JSON Schema of room files, for editors."""
    from sonarhw_sim.files import json_schema
    from sonarhw_sim.room.room_file import RoomFile

    print_json(json_schema(RoomFile))


RoomPicture = Annotated[
    Path | None,
    typer.Option(help="Draw the room, with the findings marked.", metavar="FILE.png|.pdf|.svg"),
]


@room_app.command("check")
def check_room_file(
    room_name: RoomName,
    board: BoardName = DEFAULT_BOARD,
    plot: RoomPicture = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
    force: Force = False,
) -> int:
    """Check a room for probable mistakes.

    Examples are a wrong unit and walls that nearly meet. Prints one line for each finding. Exit status: 0 without
    findings, 1 with findings, 2 if the other commands would refuse the file.
    """
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.check import check_room, refusals_of
    from sonarhw_sim.files import SHIPPED_ROOMS
    from sonarhw_sim.room.room import parse_room

    if plot is not None:
        checked_out(plot, PICTURES, force, room_name, board, option="--plot")
    profile = load_board(board)
    text, where = SHIPPED_ROOMS.read(room_name)
    if refusals := refusals_of(text, where):
        _print_refusals(where, refusals, as_json)
        return REFUSED
    room = parse_room(text, where)
    findings = check_room(room, profile)
    if plot is not None:
        from sonarhw_compare.drawings import draw_checked_room

        write_figure(plot, draw_checked_room(room, findings), force)
    if as_json:
        print_json({"file": where, "refused": [], "findings": [asdict(finding) for finding in findings]})
    else:
        _print(where, room, findings)
    return 1 if findings else 0


def _print_refusals(where: str, refusals: list[str], as_json: bool) -> None:
    if as_json:
        print_json({"file": where, "refused": refusals, "findings": []})
        return
    for line in refusals:
        print_line(f"{where}: {line}")
    print_line(f"{where}: {counted(len(refusals), 'error')}; no command accepts this file")


def _print(where: str, room: "Room", findings: "list[Finding]") -> None:
    for number, finding in enumerate(findings, 1):
        print_line(f"{number}: {finding.line}")
    places = counted(len(room.places), "place")
    found = counted(len(findings), "finding") if findings else "no findings"
    print_line(f"{where}: {found}; {_content_of(room)}, {places}")


def _content_of(room: "Room") -> str:
    return f"{counted(len(room.walls), 'wall')}, {counted(len(room.posts), 'post')}"


# `sonarhw profile`: list the shipped board profiles, write a template, check a profile, print its JSON Schema.


profile_app = CommandList(help="List, write and check board profiles.", no_args_is_help=True)


@profile_app.command("list")
def list_profiles() -> None:
    """List the shipped board profiles."""
    from sonarhw_sim.board.profile import board_names, load_board

    for name in board_names():
        board = load_board(name)
        print_line(f"{name:15} {board.frequency / 1000:g} kHz, to {board.max_range:g} m")


@profile_app.command("new")
def new_profile(file: NewFile) -> None:
    """Write an annotated board profile to start from. An existing file is never overwritten."""
    write_template("sonarhw_sim.board", file)
    print_note(f"{file}: edit it, then run: sonarhw profile check {quote(str(file))}")


@profile_app.command("schema")
def profile_schema() -> None:
    """Print the JSON Schema of board profiles, for editors."""
    from sonarhw_sim.board.profile import BoardFile
    from sonarhw_sim.files import json_schema

    print_json(json_schema(BoardFile))


@profile_app.command("check")
def check_profile(profile: Profile) -> int:
    """Check a board profile. Prints one line for each error. Exit status: 0 without errors, else 2."""
    from sonarhw_sim.board.profile import BoardFile
    from sonarhw_sim.files import SHIPPED_BOARDS, parse_table, problems_of

    text, where = SHIPPED_BOARDS.read(profile)
    problems = problems_of(parse_table(text, where), BoardFile)
    for line in problems or ["no findings"]:
        print_line(f"{where}: {line}")
    return 2 if problems else 0
