"""Warnings about a valid room that is probably not what its author means."""

from sonarhw_sim.room.facets import facets_of
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.room.objects import object_around, object_name


def room_doubts(room: Room) -> tuple[str, ...]:
    """Return a warning for each round object that consists of flat walls."""
    found = []
    for circle in facets_of(room):
        first, last = room.names[circle.walls[0]], room.names[circle.walls[-1]]
        x, y = (round(at, 4) + 0.0 for at in circle.middle)
        found.append(
            f"walls {first!r} to {last!r} approximate a circle, but flat walls return almost no sound; "
            f"use [[posts]] with center = [{x:g}, {y:g}] and radius = {circle.radius:.4g}"
        )
    return tuple(found)


def place_doubts(room: Room, place: Place) -> tuple[str, ...]:
    """Return a warning if a place is outside the room, or inside an object such as a box."""
    x, y = place.position
    where = f"place {place.name!r} at {x:g}, {y:g} m is"
    if room.is_outside(place.position) or room.is_far_from(place.position):
        return (f"{where} outside room {room.name!r}",)
    walls = object_around(room, place)
    return () if walls is None else (f"{where} inside {object_name(room, walls)} of room {room.name!r}",)
