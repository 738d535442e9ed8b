"""`make board`: the real firmware on an emulated board in the demo room, until it is interrupted.

    python -m cli.board --pty LINK --pace 2

Its first line of standard output is the URL; nothing that opens it can tell it from a board on the table.
"""

import sys
from pathlib import Path
from typing import Annotated

import typer

from cli.connect import read_pace
from cli.demo_room import PLACE, demo_room
from cli.interruption import sigterm_raises
from cli.options import DEFAULT_BOARD


def board(
    pty: Annotated[Path | None, typer.Option(help="Name of a link to its pseudo-terminal.", metavar="LINK")] = None,
    pace: Annotated[str, typer.Option(help="Real time, or N times faster.", metavar="real|N")] = "real",
    seed: Annotated[int, typer.Option(help="Seed of everything random in the room.", min=0)] = 0,
) -> None:
    """Run the firmware on a board that is not there; the first line of standard output is its URL."""
    from sim.board import load_board
    from sim.room import load_room
    from sim.truth import RoomEchoes
    from sonarhw.emulated import emulated_board

    with demo_room() as room_file:
        room = load_room(room_file)
    echoes = RoomEchoes(room, room.place(PLACE), load_board(DEFAULT_BOARD), seed)
    # before anyone connects: a ping waits for its echoes, and with it the whole board
    echoes.prepare()
    with sigterm_raises(SystemExit), emulated_board(echoes, pty, read_pace(pace)) as running:
        typer.echo(running.url)
        running.wait()


if __name__ == "__main__":
    from cli.app import app, run

    app.command("board")(board)
    sys.exit(run(["board", *sys.argv[1:]]))
