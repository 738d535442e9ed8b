"""The board that a log was recorded with, so that the log can be redrawn where nobody has its profile.

Takes what a log says of itself; hands on a `Board`.
"""

from sonarhw_sim.board.profile import Board, load_board, parse_board

from sonarhw.log import LogMetadata

DEFAULT_BOARD = "polaroid-6500"


def board_of_log(metadata: LogMetadata) -> Board:
    """The profile inside the log, else the one it names, else the default.

    Raises InputError where the profile inside cannot be understood, or the one named does not ship with the product.
    """
    if metadata.board_text:
        return parse_board(metadata.board_text, f"the board profile in the log ({metadata.board or 'no name'})")
    return load_board(metadata.board or DEFAULT_BOARD)
