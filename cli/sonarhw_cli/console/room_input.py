"""Reading of room files, with a warning about round objects that consist of flat walls."""

from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw_sim.room.model import Room


def open_room(path: Path) -> "Room":
    """Return the room in a file, with warnings on standard error. Raises InputError if the file is not a room."""
    from sonarhw_sim.room.facets import facets_of
    from sonarhw_sim.room.model import load_room

    room = load_room(path)
    for found in facets_of(room):
        first, last = room.names[found.walls[0]], room.names[found.walls[-1]]
        x, y = (round(at, 4) + 0.0 for at in found.middle)
        warn(
            f"{path}: walls {first!r} to {last!r} approximate a circle, but flat walls return almost no sound; "
            f"use [[posts]] with center = [{x:g}, {y:g}] and radius = {found.radius:.4g}"
        )
    return room
