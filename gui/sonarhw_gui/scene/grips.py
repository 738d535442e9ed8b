"""The parts of the plan that the mouse can drag, and which of them is under the pointer.

Small parts have priority: sensor and beam handle, then corners and rims of posts, then walls and posts.
"""

import math
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from sonarhw_compare.edits import Point, corners
from sonarhw_sim.room.room import Room, wall_distances

from sonarhw_gui.scene.scene import Scene

REACH = 9.0  # pixels
_SENSOR_REACH = 11.0  # it is drawn larger


class GripPart(Enum):
    """The part of the plan that a grip moves."""

    SENSOR = auto()
    BEAM = auto()  # the handle on the beam, which turns the sensor
    CORNER = auto()
    RIM = auto()  # of a post
    WALL = auto()
    POST = auto()


@dataclass(frozen=True)
class Grip:
    """One part that can be dragged."""

    part: GripPart
    at: Point  # m; of a corner: the corner itself, else the point where the drag began
    surface: int | None = None  # number of the wall or post


def sensor_grip(scene: Scene, handle: Point | None, at: Point, pixel: float) -> Grip | None:
    """Return the sensor or its beam handle if one is within reach of a point; `pixel` is the size of a pixel, m."""
    if scene.place is None:
        return None
    if math.dist(scene.pose.position, at) <= _SENSOR_REACH * pixel:
        return Grip(GripPart.SENSOR, at)
    if handle is not None and math.dist(handle, at) <= _SENSOR_REACH * pixel:
        return Grip(GripPart.BEAM, at)
    return None


def room_grip(room: Room, at: Point, pixel: float) -> Grip | None:
    """Return the corner, rim, wall or post within reach of a point."""
    reach = REACH * pixel
    ends = corners(room)
    away = np.hypot(*(np.array(ends) - at).T)
    nearest = int(np.argmin(away))
    if away[nearest] <= reach:
        return Grip(GripPart.CORNER, ends[nearest])
    surface = surface_at(room, at, pixel)
    if surface is None:
        return None
    if surface < len(room.walls):
        return Grip(GripPart.WALL, at, surface)
    x, y, radius = room.posts[surface - len(room.walls)]
    on_rim = math.dist((x, y), at) >= max(radius - reach, radius / 2)
    return Grip(GripPart.RIM if on_rim else GripPart.POST, at, surface)


def surface_at(room: Room, at: Point, pixel: float) -> int | None:
    """Return the number of the nearest wall or post within reach of a point; inside a post, of this post."""
    walls = wall_distances(np.array([at]), room.walls)[0]
    posts = np.maximum(np.hypot(*(room.posts[:, :2] - at).T) - room.posts[:, 2], 0.0)
    distances = np.concatenate((posts, walls))
    nearest = int(np.argmin(distances))
    if distances[nearest] > REACH * pixel:
        return None
    return nearest - len(posts) if nearest >= len(posts) else len(walls) + nearest
