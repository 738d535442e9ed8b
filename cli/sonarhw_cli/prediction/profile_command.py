"""`sonarhw profile`: list the shipped board profiles, write a template, check a profile, print its JSON Schema."""

from sonarhw_cli.console.lines import print_json, print_line, print_note
from sonarhw_cli.console.options import Profile
from sonarhw_cli.console.plain_help import CommandList
from sonarhw_cli.prediction.new_file import NewFile, write_template

app = CommandList(help="List, write and check board profiles.", no_args_is_help=True)


@app.command("list")
def list_profiles() -> None:
    """List the shipped board profiles."""
    from sonarhw_sim.board.profile import board_names, load_board

    for name in board_names():
        board = load_board(name)
        print_line(f"{name:15} {board.frequency / 1000:g} kHz, to {board.max_range:g} m")


@app.command("new")
def new(file: NewFile) -> None:
    """Write an annotated board profile to start from. An existing file is never overwritten."""
    write_template("sonarhw_sim.board", file)
    print_note(f"{file}: edit it, then run: sonarhw profile check {file}")


@app.command("schema")
def schema() -> None:
    """Print the JSON Schema of board profiles, for editors."""
    from sonarhw_sim.board.profile import BoardFile
    from sonarhw_sim.files import json_schema

    print_json(json_schema(BoardFile))


@app.command("check")
def check(profile: Profile) -> int:
    """Check a board profile. Prints one line for each error. Exit status: 0 without errors, else 2."""
    from sonarhw_sim.board.profile import SHIPPED_BOARDS, BoardFile
    from sonarhw_sim.files import parse_table, problems_of

    text, where = SHIPPED_BOARDS.read(profile)
    problems = problems_of(parse_table(text, where), BoardFile)
    for line in problems or ["no findings"]:
        print_line(f"{where}: {line}")
    return 2 if problems else 0
