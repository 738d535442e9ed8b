"""`sonarhw paths`: list every path of sound from a place back to it, for all headings."""

from typing import Annotated

import typer
from sonarhw_compare.scans import in_degrees
from sonarhw_sim.air import DEFAULT_BOARD, EdgeStrength

from sonarhw_cli.console.number_format import write_rows
from sonarhw_cli.console.options import STDOUT, EdgeStrengthChoice, Force, PlaceName, RoomName
from sonarhw_cli.console.output import checked_out, text_output
from sonarhw_cli.console.room_input import chosen_place, open_room

HEADER = "length_m,departure_deg,arrival_deg,gain,bounces,via"


HalfLength = Annotated[
    float | None,
    typer.Option(min=0, max=1000, help="List paths up to twice this length, metres; default: the board's range."),
]
FaintestEdge = Annotated[
    float,
    typer.Option(
        max=0,
        help="Omit paths that are fainter than this after an edge, dB; each 10 dB less takes several times longer.",
    ),
]


def paths(
    room_name: RoomName,
    place: PlaceName = None,
    max_bounces: Annotated[int, typer.Option(min=0, max=1000, help="Largest number of reflections.")] = 64,
    max_range: HalfLength = None,
    no_diffraction: Annotated[bool, typer.Option("--no-diffraction", help="Omit paths around edges.")] = False,
    edge_strength: EdgeStrengthChoice = None,
    faintest: FaintestEdge = -60.0,
    out: Annotated[str, typer.Option(help="File to write; - is standard output.", metavar="FILE.csv")] = "-",
    force: Force = False,
) -> None:
    """List every path of sound from a place back to it. The shortest is first."""
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.rays.paths import PathSearch
    from sonarhw_sim.space.sections import paths_from

    checked_out(out, (".csv", STDOUT), force, room_name)
    room = open_room(room_name)
    here, board = chosen_place(room, place), load_board(DEFAULT_BOARD)
    reach = board.max_range if max_range is None else max_range
    search = PathSearch(
        2 * reach,
        board.wavelength(room.air),
        max_bounces,
        not no_diffraction,
        edge_strength=edge_strength or EdgeStrength.UNIFORM,
        faintest_diffraction=10 ** (faintest / 20),
    )
    with text_output(out, force) as file:
        found = paths_from(room, here, search)
        rows = (
            (
                float(found.lengths[k]),
                in_degrees(float(found.departures[k])),
                in_degrees(float(found.arrivals[k])),
                float(found.gains[k]),
                int(found.bounces[k]),
                ">".join(found.via(k, room)),
            )
            for k in range(len(found))
        )
        write_rows(file, HEADER, rows)
