"""Completion of the names of rooms, places and boards in shells. Names of files are completed by the shell."""

import typer


def complete_room(incomplete: str) -> list[str]:
    """Return the shipped rooms that begin with a text."""
    from sonarhw_sim.room.room import SHIPPED_ROOMS

    return [name for name in SHIPPED_ROOMS.names() if name.startswith(incomplete)]


def complete_board(incomplete: str) -> list[str]:
    """Return the shipped board profiles that begin with a text."""
    from sonarhw_sim.board.profile import board_names

    return [name for name in board_names() if name.startswith(incomplete)]


def complete_place(context: typer.Context, incomplete: str) -> list[str]:
    """Return the places of the room on the command line that begin with a text; none without a valid room."""
    from sonarhw.errors import SonarError

    # after an option without its value, the arguments before it are still in `args`
    given = [context.params.get("room_name"), *context.args]
    room = next((name for name in given if name), None)
    if room is None:
        return []
    from sonarhw_sim.room.room import load_room

    try:
        return [name for name in load_room(room).places if name.startswith(incomplete)]
    except SonarError:
        return []
