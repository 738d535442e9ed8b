"""Changes to the text of a room file that keep its comments, order and layout.

Each function returns the room of the changed text, and raises InputError if the change makes the file invalid. A room
is always parsed from its text, so a saved room is the same when it is read again.
"""

import math
import pickle
from collections.abc import Callable, Collection, Mapping, MutableMapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from sonarhw.errors import InputError
from sonarhw.files import atomic_file
from sonarhw_sim.air import Air
from sonarhw_sim.room.model import Place, Room, parse_room
from sonarhw_sim.room.room_file import MEETING, Material, RoomFile
from sonarhw_sim.toml_comments import bind_comments, text_of
from sonarhw_sim.toml_file import parse_toml

Document = MutableMapping[str, Any]  # the text of a room file as tables and lists
Point = tuple[float, float]  # m
_DIGITS = 9  # of a heading in degrees


def changed_room(room: Room, change: Callable[[Document], None]) -> Room:
    """Return the room after `change` of its text. Raises InputError if the result is not a valid room."""
    where = f"room {room.name!r}"
    try:
        document, end = pickle.loads(_parsed(room.text))
        change(document)
        text = text_of(document, end)
    except TOMLKitError as error:
        raise InputError(f"{where}: its text cannot be changed: {error}") from error
    return parse_room(text, where)


@lru_cache(maxsize=8)
def _parsed(text: str) -> bytes:
    # while a wall is dragged, one text is changed many times; unpickling takes a fifth of the time of parsing
    document = tomlkit.parse(text if text.endswith("\n") else f"{text}\n")
    return pickle.dumps((document, bind_comments(document)))


def with_air(room: Room, air: Air) -> Room:
    """Return the room with other air. Raises InputError if a value is out of range."""

    def change(document: Document) -> None:
        table = section(document, "air")
        for key, value in vars(air).items():
            table[key] = value

    return changed_room(room, change)


def with_place(room: Room, place: Place, without: Collection[str] = ()) -> Room:
    """Return the room with `place` added or replaced by its name, and the places named in `without` removed.

    Raises InputError if it is inside a post.
    """

    def change(document: Document) -> None:
        for name in without:
            del document["places"][name]
        table = section(document, "places", place.name)
        table["position"] = list(place.position)
        table["heading_deg"] = round(math.degrees(place.heading), _DIGITS)
        if place.height is not None:
            table["height"] = place.height

    return changed_room(room, change)


def with_material(room: Room, name: str, reflectance: float | None, scatter: float) -> Room:
    """Return the room with the reflectance (amplitude ratio) and scatter (share of the power) of a material.

    The reflectance replaces a table; None keeps the table. Raises InputError if one is not within 0..1.
    """

    def change(document: Document) -> None:
        table = section(document, "materials", name)
        if reflectance is not None:
            table.pop("table", None)
            table["reflectance"] = reflectance
        if scatter or "scatter" in table:
            table["scatter"] = scatter

    return changed_room(room, change)


def with_corners(room: Room, moved: Mapping[Point, Point]) -> Room:
    """Return the room with all wall ends at these points (m) moved, so that meeting walls still meet.

    Raises InputError if a wall then has no length.
    """

    def change(document: Document) -> None:
        for chain in document["walls"]:
            for k, point in enumerate(chain["points"]):
                to = next((to for corner, to in moved.items() if math.dist(point, corner) <= MEETING), None)
                if to is not None:
                    chain["points"][k] = list(to)

    return changed_room(room, change)


def materials(room: Room) -> dict[str, Material]:
    """Return all materials that the room's text defines, also unused ones."""
    return parse_toml(room.text, f"room {room.name!r}", RoomFile).materials


def section(document: Document, *names: str) -> Document:
    """Return the nested table with these names; missing tables are created."""
    for name in names:
        if name not in document:
            document[name] = tomlkit.table()
        document = document[name]
    return document


def save_room(room: Room, path: Path, overwrite: bool = False) -> None:
    """Write the room's text, completely or not at all.

    Raises InputError if the file exists already (unless `overwrite`), OutputError if it cannot be written.
    """
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; choose another name, or allow overwriting")
    with atomic_file(path, "folder", overwrite=overwrite) as file:
        file.write(room.text.encode())
