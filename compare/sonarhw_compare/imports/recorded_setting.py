"""The room, place and board that a log was recorded with, even if their files no longer exist."""

from sonarhw_sim.air import DEFAULT_BOARD
from sonarhw_sim.board.profile import Board, load_board, parse_board
from sonarhw_sim.room.room import Room, parse_room

from sonarhw.log import LogMetadata


def room_of_log(metadata: LogMetadata, where: str) -> Room | None:
    """Return the room inside the log `where`; None if it contains none. Raises InputError if it is invalid."""
    return parse_room(metadata.room_text, f"room inside {where}") if metadata.room_text else None


def place_of_log(metadata: LogMetadata, room: Room) -> str | None:
    """Return the place of a log: X,Y, or the name of a place in this room. None if it contains neither."""
    return metadata.place if metadata.place in room.places or "," in metadata.place else None


def board_of_log(metadata: LogMetadata) -> Board:
    """Return the profile inside the log, else the one it names, else the default.

    Raises InputError if the profile inside is invalid, or the named one is not installed.
    """
    if metadata.board_text:
        return parse_board(metadata.board_text, f"the board profile in the log ({metadata.board or 'no name'})")
    return load_board(metadata.board or DEFAULT_BOARD)
