"""The option --fit of `compare` and `report`, and the text about its search."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw_cli.console.progress import progress_of_share

if TYPE_CHECKING:
    from sonarhw_compare.fit.plain_fit import Fit
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.predict.prediction import PredictionOptions
    from sonarhw_sim.room.model import Place, Room

    from sonarhw.readings import Reading

FitOption = Annotated[
    str,
    typer.Option(
        "--fit",
        help="Quantities to fit before the comparison, on a grid: heading in steps of 0.5°, offset within 6 cm in "
        "steps of 5 mm, position within 3 cm in steps of 1 cm. `sonarhw fit` is finer and adds credible intervals.",
        metavar="heading,offset,position",
    ),
]


def plain_fit(
    readings: "Sequence[Reading]",
    room: "Room",
    place: "Place",
    board: "Board",
    wanted: str,
    options: "PredictionOptions",
) -> "Fit | None":
    """Return the fit of the quantities in `wanted`; None if it is empty. Raises InputError for an unknown name."""
    from sonarhw_compare.fit.plain_fit import fit_scan

    if not wanted:
        return None
    free = frozenset(name.strip() for name in wanted.split(","))
    with progress_of_share() as show:
        return fit_scan(
            readings,
            room,
            place,
            board,
            free,
            options=options,
            tick=lambda share: show(share, "fitting"),
        )
