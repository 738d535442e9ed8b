"""What is the room: maps made of scans alone, and what the ray-following model takes out of them.

Files: `certainty` is the grid of Moravec and Elfes, `arcs` and `features` make walls, corners and edges of regions of
constant depth as Leonard and Durrant-Whyte do, `rejection` finds the readings that came by several reflections, `made`
puts them together and `picture` draws them.
"""

from sonarhw_compare.map.room_map import RoomMap, map_scans

__all__ = ["RoomMap", "map_scans"]
