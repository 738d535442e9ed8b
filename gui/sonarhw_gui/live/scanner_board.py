"""The board profile that a scanner names: used from its connection on, except over a profile of the user."""

from sonarhw_sim.board.profile import Board, board_names, load_board

from sonarhw_gui.live.scanner_state import LinkState


class ScannerBoard:
    """Whether to use the profile that the scanner names; decided once for each scanner that the user chooses."""

    def __init__(self) -> None:
        self.wanted = False

    def instead_of(self, shown: Board, link: LinkState | None) -> Board | None:
        """Return the profile to use for a scanner that was just connected; None: keep the one shown."""
        if link is None or not self.wanted:
            return None
        self.wanted = False
        board = suited_board(link.device.board, shown)
        return None if board is shown else board


def suited_board(named: str, shown: Board) -> Board:
    """Return the included profile that a scanner names, if the profile shown is another included one; else that shown.

    A profile with a name of its own is kept: it may be that of this very scanner.
    """
    both_included = {named, shown.name} <= set(board_names())
    return load_board(named) if both_included and named != shown.name else shown
