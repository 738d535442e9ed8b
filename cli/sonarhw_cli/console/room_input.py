"""Reading of room files, with a warning about round objects that consist of flat walls."""

from typing import TYPE_CHECKING

from sonarhw_cli.console.lines import print_detail
from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw_sim.room.model import Room


def open_room(name: str) -> "Room":
    """Return a shipped room by name or the room in a file, with warnings on standard error. Raises InputError."""
    from sonarhw_sim.room.doubts import room_doubts
    from sonarhw_sim.room.model import load_room

    room = load_room(name)
    print_detail(f"{name}: room {room.name!r}")
    for doubt in room_doubts(room):
        warn(f"{name}: {doubt}")
    return room
