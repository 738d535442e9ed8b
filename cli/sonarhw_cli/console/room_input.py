"""Rooms, places and poses that options name, with warnings about walls and places that are probably wrong."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sonarhw.errors import InputError, counted
from sonarhw_cli.console.lines import print_detail, warn

if TYPE_CHECKING:
    from sonarhw_sim.room.room import Place, Room


def open_room(name: str) -> "Room":
    """Return a shipped room by name or the room in a file, with warnings on standard error. Raises InputError."""
    from sonarhw_sim.room.room import load_room, room_doubts

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
    from sonarhw_sim.room.room import place_doubts

    print_detail(f"place {place.name!r} at {place.position[0]:g}, {place.position[1]:g} m in room {room.name!r}")
    for doubt in place_doubts(room, place):
        warn(doubt)


def check_one_of_each(places: Sequence[str], poses: Sequence[str], logs: int) -> None:
    """Raise InputError unless there is no place or pose, or one for each log."""
    if places and poses:
        raise InputError("--place and --pose: expected one of them, once for each log")
    for option, given in (("--place", places), ("--pose", poses)):
        if given and len(given) != logs:
            raise InputError(f"{option}: expected one for each of {counted(logs, 'log')}, got {len(given)}")


def place_of_pose(text: str) -> "Place":
    """Return the place of `X,Y,DEG`, metres and the heading of turntable step 0. Raises InputError for another form."""
    from sonarhw_sim.room.room import Place

    try:
        x, y, degrees = map(float, text.split(","))
    except ValueError as error:
        raise InputError(f"--pose {text}: expected X,Y,DEG: metres, metres, degrees") from error
    if not all(map(math.isfinite, (x, y, degrees))):
        raise InputError(f"--pose {text}: expected three finite numbers")
    return Place(text, (x, y), math.radians(degrees))
