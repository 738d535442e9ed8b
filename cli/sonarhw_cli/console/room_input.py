"""Rooms and places that options name, with warnings about walls and places that are probably wrong."""

from typing import TYPE_CHECKING

from sonarhw_cli.console.lines import print_detail, warn

if TYPE_CHECKING:
    from sonarhw_sim.room.model import Place, Room


def open_room(name: str) -> "Room":
    """Return a shipped room by name or the room in a file, with warnings on standard error. Raises InputError."""
    from sonarhw_sim.room.doubts import room_doubts
    from sonarhw_sim.room.model import load_room

    room = load_room(name)
    print_detail(f"{name}: room {room.name!r}")
    for doubt in room_doubts(room):
        warn(f"{name}: {doubt}")
    return room


def chosen_place(room: "Room", wanted: str | None) -> "Place":
    """Return the place of a room that --place names, with a warning if no scanner can be there. Raises InputError."""
    place = room.place(wanted)
    print_place(room, place)
    return place


def print_place(room: "Room", place: "Place") -> None:
    """Print the place with --verbose, and a warning if it is outside the room or inside an object."""
    from sonarhw_sim.room.doubts import place_doubts

    print_detail(f"place {place.name!r} at {place.position[0]:g}, {place.position[1]:g} m in room {room.name!r}")
    for doubt in place_doubts(room, place):
        warn(doubt)
