"""Maps from scans alone, with and without the readings that the ray-following model explains by multipath.

`certainty` is the grid of Moravec and Elfes. `arcs` and `features` find walls, corners and edges in regions of constant
depth, as Leonard and Durrant-Whyte do. `rejection` finds readings from several reflections, `room_map` combines all,
and `map_picture` draws the result.
"""

from sonarhw_compare.map.room_map import RoomMap, map_scans

__all__ = ["RoomMap", "map_scans"]
