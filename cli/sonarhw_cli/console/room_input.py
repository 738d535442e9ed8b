"""The room that a command reads: opened, with a line of warning for a round thing that is drawn of flat walls."""

from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw_sim.room.model import Room


def open_room(path: Path) -> "Room":
    """The room in a file, with warnings on standard error. Raises InputError where there is none."""
    from sonarhw_sim.room.facets import facets_of
    from sonarhw_sim.room.model import load_room

    room = load_room(path)
    for found in facets_of(room):
        first, last = room.names[found.walls[0]], room.names[found.walls[-1]]
        x, y = (round(at, 4) + 0.0 for at in found.middle)
        warn(
            f"{path}: walls {first!r} to {last!r} draw a circle, and flat walls hardly send sound "
            f"back; a pillar is [[posts]] with center = [{x:g}, {y:g}] and radius = {found.radius:.4g}"
        )
    return room
