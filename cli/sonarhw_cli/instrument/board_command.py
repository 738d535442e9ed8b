"""`sonarhw board`, behind `make board`: the real firmware on an emulated board in the demo room.

The command is not listed by --help, because it needs a checkout and compilers.
"""

from typing import Annotated

import typer
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw_cli.console.demo_room import PLACE, ROOM
from sonarhw_cli.console.interruption import sigterm_exits
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.options import PtyLink

Combination = Annotated[
    str, typer.Option(help="Controller, ranging and turning, as the firmware is built.", metavar="NAME")
]


def board(
    pty: PtyLink = None,
    pace: Annotated[str, typer.Option(help="Real time, or N times faster.", metavar="real|N")] = "real",
    seed: Annotated[int, typer.Option(help="Seed of all random values in the room.", min=0)] = 0,
    combination: Combination = "mega-polaroid-step-dir",
) -> None:
    """Run the firmware on an emulated board. The first line of standard output is its URL."""
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.predict.room_echoes import RoomEchoes
    from sonarhw_sim.room.room import load_room

    from sonarhw.device.emulated_board import emulated_board
    from sonarhw.device.served import read_pace

    room = load_room(ROOM)
    echoes = RoomEchoes(
        room, room.place(PLACE), load_board("hc-sr04" if "-hc-sr04-" in combination else DEFAULT_BOARD), seed
    )
    # now, before a client can connect: the emulated board stops while it waits for the echoes of a ping
    echoes.prepare()
    with sigterm_exits(), emulated_board(echoes, pty, read_pace(pace), combination=combination) as running:
        print_line(running.url)
        running.wait()
