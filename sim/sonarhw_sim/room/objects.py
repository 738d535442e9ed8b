"""Objects made of walls: closed chains inside another chain, such as a box in a room."""

import numpy as np

from sonarhw_sim.room.model import Place, Room

_NARROW = 1.2  # m; a closed chain of walls this narrow inside another is an object, not a room


def object_around(room: Room, place: Place) -> list[int] | None:
    """Return the walls of the object that contains a place, if any.

    An object is a closed chain of walls inside another one, with lids, or too narrow to be a room.
    """
    around = room.enclosures.chains_around(np.array(place.position))
    if not around or len(around) % 2:
        return None
    smallest = min(around, key=lambda chain: float(np.ptp(chain.reshape(-1, 2), axis=0).min()))
    walls = [k for k, wall in enumerate(room.walls) if (smallest == wall).all(axis=1).any()]
    lowest, highest = room.heights[walls].min(), room.heights[walls].max()
    beside = place.height is not None and not lowest < place.height < highest
    narrow = float(np.ptp(smallest.reshape(-1, 2), axis=0).min()) < _NARROW
    lidded = any(walls[0] in lid.sides for lid in room.lids)
    return walls if (narrow or lidded) and not beside else None


def object_name(room: Room, walls: list[int]) -> str:
    """Return the words for the object of these walls."""
    return f"the object of walls {room.names[walls[0]]!r} to {room.names[walls[-1]]!r}"
