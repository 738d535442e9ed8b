"""`sonarhw room` and `sonarhw profile`: list, write and check room files and board profiles."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_compare.picture_file import PICTURES
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw.errors import counted
from sonarhw_cli.options import BoardName, CommandList, Force, Profile, RoomName, print_json, print_line, print_note
from sonarhw_cli.outputs import NewFile, checked_out, write_figure, write_template

if TYPE_CHECKING:
    from sonarhw_sim.check import Finding
    from sonarhw_sim.room.room import Room

# `sonarhw room`: list the shipped rooms, write a template, check a room file, print its JSON Schema.


REFUSED = 2  # exit status

room_app = CommandList(help="List, write and check room files.", no_args_is_help=True)


@room_app.command("list")
def list_rooms() -> None:
    """List the shipped rooms with their places."""
    from sonarhw_sim.room.room import load_room, room_names

    for name in room_names():
        print_line(f"{name:15} places: {', '.join(load_room(name).places) or 'none'}")


@room_app.command("new")
def new_room(file: NewFile) -> None:
    """Write an annotated room file to start from. An existing file is never overwritten."""
    write_template("sonarhw_sim.room", file)
    print_note(f"{file}: edit it, then run: sonarhw room check {file}")


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
    from sonarhw_sim.room.room import SHIPPED_ROOMS, parse_room

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
    content = ", ".join(
        (
            counted(len(room.walls), "wall"),
            counted(len(room.posts), "post"),
            counted(len(room.places), "place"),
        )
    )
    print_line(f"{where}: {counted(len(findings), 'finding') if findings else 'no findings'}; {content}")


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
    print_note(f"{file}: edit it, then run: sonarhw profile check {file}")


@profile_app.command("schema")
def profile_schema() -> None:
    """Print the JSON Schema of board profiles, for editors."""
    from sonarhw_sim.board.profile import BoardFile
    from sonarhw_sim.files import json_schema

    print_json(json_schema(BoardFile))


@profile_app.command("check")
def check_profile(profile: Profile) -> int:
    """Check a board profile. Prints one line for each error. Exit status: 0 without errors, else 2."""
    from sonarhw_sim.board.profile import SHIPPED_BOARDS, BoardFile
    from sonarhw_sim.files import parse_table, problems_of

    text, where = SHIPPED_BOARDS.read(profile)
    problems = problems_of(parse_table(text, where), BoardFile)
    for line in problems or ["no findings"]:
        print_line(f"{where}: {line}")
    return 2 if problems else 0
