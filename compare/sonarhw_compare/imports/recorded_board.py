"""The board that a log was recorded with, even if its profile is not installed."""

from sonarhw_sim.board.profile import Board, load_board, parse_board
from sonarhw_sim.choices import DEFAULT_BOARD

from sonarhw.log import LogMetadata


def board_of_log(metadata: LogMetadata) -> Board:
    """Return the profile inside the log, else the one it names, else the default.

    Raises InputError if the profile inside is invalid, or the named one is not installed.
    """
    if metadata.board_text:
        return parse_board(metadata.board_text, f"the board profile in the log ({metadata.board or 'no name'})")
    return load_board(metadata.board or DEFAULT_BOARD)
