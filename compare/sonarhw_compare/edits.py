"""Edits of the text of a room file and of a board profile, which keep comments and layout."""

from collections.abc import Sequence
from itertools import count
from typing import Any

import numpy as np
import tomlkit
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_writing import Document, changed_room, like_array, remove_table, with_corners
from tomlkit.items import Array

from sonarhw.errors import InputError

# Edits of a room: move, add and remove corners, walls and posts, and set their material.
#
# A surface is given by its number in `Room.names`. The text of the room file is edited, so names, places and other
# keys are preserved. An invalid result raises InputError.


WALL, POST = "wall", "post"  # names of new surfaces, followed by a number
Point = tuple[float, float]  # m
Segments = tuple[list[list[float]], list[str]]  # of an open chain: its points, and the names of the walls between them


def move_corner(room: Room, corner: Point, to: Point) -> Room:
    """Return the room with every wall end at `corner` moved to `to`; walls that meet there still meet."""
    return with_corners(room, {corner: to})


def move_wall(room: Room, wall: int, by: Point) -> Room:
    """Return the room with both ends of a wall moved, together with the ends of other walls that meet there."""
    x0, y0, x1, y1 = map(float, room.walls[wall])
    moved = {(x0, y0): (x0 + by[0], y0 + by[1]), (x1, y1): (x1 + by[0], y1 + by[1])}
    return with_corners(room, moved)


def add_wall(room: Room, start: Point, end: Point, material: str) -> Room:
    """Return the room with an additional straight wall; it meets walls that end at the same points."""
    name = free_name(room, WALL)
    wall = {"name": name, "points": [list(start), list(end)], "material": material, "edges": [name]}
    return changed_room(room, lambda document: _append(document, "walls", wall))


def split_wall(room: Room, wall: int, point: Point) -> Room:
    """Return the room with a wall split in two at its point nearest to `point`; the second part gets a new name."""
    second, corner = free_name(room, room.names[wall], 2), _on_wall(room, wall, point)

    def change(document: Document) -> None:
        chain, k = _chain_of(document, wall)
        names = _segment_names(chain)
        points = _points(chain)
        chain["points"] = like_array(chain["points"], [*points[: k + 1], corner, *points[k + 1 :]])
        chain["edges"] = _named(chain, [*names[: k + 1], second, *names[k + 1 :]])

    return changed_room(room, change)


def add_post(room: Room, center: Point, radius: float, material: str) -> Room:
    """Return the room with an additional post."""
    post = {"name": free_name(room, POST), "center": list(center), "radius": radius, "material": material}
    return changed_room(room, lambda document: _append(document, "posts", post))


def move_post(room: Room, post: int, to: Point) -> Room:
    """Return the room with the centre of a post at `to`."""
    return changed_room(room, lambda document: _post(document, room, post).update(center=list(to)))


def resize_post(room: Room, post: int, radius: float) -> Room:
    """Return the room with another radius (m) of a post."""
    return changed_room(room, lambda document: _post(document, room, post).update(radius=radius))


def remove_surface(room: Room, surface: int) -> Room:
    """Return the room without a wall or a post. Raises InputError for the last wall, and for floor and ceiling."""
    if surface in room.levels:
        raise InputError(f"the {room.names[surface]} cannot be removed here; remove it from the room file")
    if surface < len(room.walls) == 1:
        raise InputError(f"{room.names[surface]!r} is the last wall; a room needs at least one")

    def change(document: Document) -> None:
        if surface < len(room.walls):
            chain, k = _chain_of(document, surface)
            _put(document, chain, _without(chain, k))
        else:
            remove_table(document, "posts", surface - len(room.walls))

    return changed_room(room, change)


def set_material(room: Room, surface: int, material: str) -> Room:
    """Return the room with another material of one surface; a wall inside a chain becomes a chain of its own."""

    def change(document: Document) -> None:
        if surface in room.levels:
            document[room.names[surface]]["material"] = material
        elif surface >= len(room.walls):
            _post(document, room, surface)["material"] = material
        else:
            chain, k = _chain_of(document, surface)
            if _count(chain) > 1:
                alone = _like(chain, _ends(chain, k), [_segment_names(chain)[k]])
                _put(document, chain, _without(chain, k))
                _append(document, "walls", {**alone, "material": material})
            else:
                chain["material"] = material

    return changed_room(room, change)


def free_name(room: Room, stem: str, first: int = 1) -> str:
    """Return `stem` with the first number, from `first` on, that no surface uses."""
    return next(name for name in (f"{stem} {k}" for k in count(first)) if name not in room.names)


def corners(room: Room) -> tuple[Point, ...]:
    """Return each point where walls end."""
    return tuple(dict.fromkeys((float(x), float(y)) for x, y in room.walls.reshape(-1, 2)))


def _on_wall(room: Room, wall: int, point: Point) -> list[float]:
    """Return the point of a wall nearest to a point, at a whole number of millimetres along the wall."""
    start, end = room.walls[wall].reshape(2, 2)
    length = np.hypot(*(end - start))
    along = round(float(np.dot(np.subtract(point, start), end - start) / length), 3)
    x, y = start + (end - start) * (np.clip(along, 0.0, length) / length)
    return [round(float(x), 6), round(float(y), 6)]


def _chain_of(document: Document, wall: int) -> tuple[Document, int]:
    """Return the chain that contains a wall, and the number of its segment."""
    places = ((chain, k) for chain in document["walls"] for k in range(_count(chain)))
    return next(place for number, place in enumerate(places) if number == wall)


def _post(document: Document, room: Room, surface: int) -> Any:
    return document["posts"][surface - len(room.walls)]


def _points(chain: Document) -> list[list[float]]:
    return [list(map(float, point)) for point in chain["points"]]


def _count(chain: Document) -> int:
    return len(chain["points"]) - (0 if chain.get("closed", False) else 1)


def _segment_names(chain: Document) -> list[str]:
    return [str(name) for name in chain.get("edges", [f"{chain['name']}[{k}]" for k in range(_count(chain))])]


def _ends(chain: Document, k: int) -> list[list[float]]:
    points = _points(chain)
    return [points[k], points[(k + 1) % len(points)]]


def _without(chain: Document, k: int) -> list[Segments]:
    """Return the rest of a chain without segment k: one or two open chains, or none."""
    points, names = _points(chain), _segment_names(chain)
    if chain.get("closed", False):
        return [(points[k + 1 :] + points[: k + 1], names[k + 1 :] + names[:k])]
    return [left for left in ((points[: k + 1], names[:k]), (points[k + 1 :], names[k + 1 :])) if left[1]]


def _put(document: Document, chain: Document, pieces: Sequence[Segments]) -> None:
    """Replace a chain by open chains: the first takes its position, the others are appended after all walls."""
    if not pieces:
        remove_table(document, "walls", next(k for k, table in enumerate(document["walls"]) if table is chain))
        return
    for points, names in pieces[1:]:
        _append(document, "walls", _like(chain, points, names))
    points, names = pieces[0]
    chain["points"], chain["edges"] = like_array(chain["points"], points), _named(chain, names)
    if "closed" in chain:
        chain["closed"] = False


def _like(chain: Document, points: list[list[float]], names: list[str]) -> dict[str, Any]:
    """Return an open chain of the same material and height."""
    common: dict[str, Any] = {"material": str(chain["material"])}
    if "height" in chain:
        common["height"] = list(map(float, chain["height"]))
    return {"name": names[0], "points": like_array(chain["points"], points), "edges": _named(chain, names), **common}


def _named(chain: Document, names: list[str]) -> Any:
    return like_array(chain.get("edges"), names)


def _append(document: Document, kind: str, values: dict[str, Any]) -> None:
    present = document.get(kind, [])
    if isinstance(present, Array):  # written as [{...}, {...}]
        present.append(values)
        return
    table = tomlkit.table()
    table.update(values)
    table.trivia.indent = "\n"
    if not present:
        document[kind] = tomlkit.aot()
    document[kind].append(table)


# Changes of board profiles as text: a changed value keeps its former value and comment in a comment.


Z95 = 1.96  # standard deviations to each side of a 95 % interval


def set_marked(table: Any, key: str, value: float, before: float, mark: str) -> None:
    """Set a value with a comment: the mark, and the former value with its own comment."""
    said = table[key].trivia.comment.lstrip("# ") if key in table else ""
    table[key] = value
    table[key].comment(f"{mark}; before: {before:g}" + (f" ({said})" if said else ""))
    table[key].trivia.comment_ws = "  "


def below_header(header: Sequence[str], text: str, before: str) -> str:
    """Return the text of a profile below a new header; its old one is quoted as that of profile `before`."""
    lines = text.splitlines()
    behind = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    quoted = [f"#   {line.removeprefix('#').removeprefix(' ')}".rstrip() for line in lines[:behind]]
    if quoted:
        quoted.insert(0, f"# Header of profile {before!r}, for its own values only:")
    return "\n".join([*header, *quoted, *lines[behind:]]) + "\n"
