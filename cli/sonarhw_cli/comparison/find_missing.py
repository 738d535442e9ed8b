"""`sonarhw compare LOG --find-missing`: the changes of the room that explain misfits."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sonarhw_compare.scans import in_degrees

from sonarhw_cli.console.lines import print_json, print_line, warn
from sonarhw_cli.console.output import write_text
from sonarhw_cli.console.progress import progress_of_share

if TYPE_CHECKING:
    from sonarhw_compare.match import Comparison
    from sonarhw_compare.rooms.causes import FoundCauses
    from sonarhw_sim.air import Receiver
    from sonarhw_sim.room.room import Room


def find_missing(
    comparison: "Comparison", receiver: "Receiver | None", *, as_json: bool, out: Path | None, force: bool
) -> "Room":
    """Print the causes of the misfits of a comparison, and write the changed room to the file `out`; return it."""
    found = _found(comparison, receiver)
    if out is not None and found.causes:
        write_text(out, found.room.text, force)
    if as_json:
        print_json(asdict(comparison.summary()) | _figures(found))
    else:
        _print(found)
    if out is not None and not found.causes:
        warn(f"{out}: not written, because the room is unchanged")
    return found.room


def _found(comparison: "Comparison", receiver: "Receiver | None") -> "FoundCauses":
    from sonarhw_compare.rooms.causes import find_causes

    prediction = comparison.prediction
    board = prediction.board
    # the comparison adds its offset to measured ranges; the place of a room file does not contain the board's zero
    board = replace(board, range_offset=board.range_offset - comparison.offset, receiver=receiver or board.receiver)
    place = replace(prediction.place, heading=comparison.heading - board.heading_at(0.0, 0.0))
    readings = [row.reading for row in comparison.rows]
    with progress_of_share() as show:
        return find_causes(readings, prediction.room, place, board, lambda share: show(share, "searching"))


def _print(found: "FoundCauses") -> None:
    from sonarhw_compare.rooms.causes import cause_text, explained_text, left_text

    if not found.causes:
        print_line("no change of the room explains misfits")
    for number, cause in enumerate(found.causes, 1):
        print_line(f"{number}. {cause_text(cause)} (log-likelihood +{cause.gain:.0f})")
    print_line(explained_text(found))
    print_line(left_text(found))


def _figures(found: "FoundCauses") -> dict[str, Any]:
    from sonarhw_compare.rooms.causes import cause_text

    after = found.after.summary()
    return {
        "causes": [
            {
                "text": cause_text(cause),
                "kind": type(cause.change).__name__,
                "change": vars(cause.change),
                "log_likelihood": cause.gain,
                "readings": list(cause.readings),
                "classes": {kind.value: count for kind, count in cause.kinds},
                "sectors_deg": [[in_degrees(first), in_degrees(last)] for first, last in cause.sectors],
            }
            for cause in found.causes
        ],
        "after": {"within_5cm": after.within_5cm, "explained": after.explained, "misfits": len(found.left)},
    }
