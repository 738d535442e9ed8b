"""A proposed change of the room, with the readings that it explains, drawn but not made yet."""

from dataclasses import dataclass

import numpy as np
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray


@dataclass(frozen=True, eq=False)
class Proposal:
    """What is drawn of a proposal."""

    readings: tuple[int, ...]  # numbers of the readings
    walls: FloatArray  # (n, 4), m
    posts: FloatArray  # (m, 3), m


def proposal_of(room: Room, changed: Room, readings: tuple[int, ...], surface: str | None) -> Proposal:
    """Return the surfaces that `changed` has and `room` does not; `surface` is included if it only changes material."""
    walls = [wall for wall in changed.walls if not (room.walls == wall).all(axis=1).any()]
    posts = [post for post in changed.posts if not (room.posts == post).all(axis=1).any()]
    if surface is not None and surface in room.names and not walls and not posts:
        number = room.names.index(surface)
        walls = [room.walls[number]] if number < len(room.walls) else []
        posts = [] if walls or number in room.levels else [room.posts[number - len(room.walls)]]
    return Proposal(readings, np.array(walls).reshape(-1, 4), np.array(posts).reshape(-1, 3))
