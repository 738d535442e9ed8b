"""Rooms written: the text of a room's file with something in it changed, the rest left as its author wrote it.

Takes a room and what is to be different; hands on the room that the changed text describes, or refuses as a room file
is refused. Comments, order and layout of the text stay. The text of a room is the room: what is saved reads back the
same.
"""

import math
import pickle
from collections.abc import Callable, Mapping, MutableMapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from sonarhw.errors import InputError, OutputError
from sonarhw_sim.air import Air
from sonarhw_sim.room.model import Place, Room, parse_room
from sonarhw_sim.room.room_file import MEETING, Material, RoomFile
from sonarhw_sim.toml_file import parse_toml

Document = MutableMapping[str, Any]  # the text of a room file as tables and lists
Point = tuple[float, float]  # m
_DIGITS = 9  # of a heading in degrees


def changed_room(room: Room, change: Callable[[Document], None]) -> Room:
    """The room after `change` has been at its text. Raises InputError where that is no room."""
    where = f"room {room.name!r}"
    try:
        document = pickle.loads(_parsed(room.text))
        change(document)
        text = tomlkit.dumps(document)
    except TOMLKitError as error:
        raise InputError(f"{where}: its file cannot be changed as it is written: {error}") from error
    return parse_room(text, where)


@lru_cache(maxsize=8)
def _parsed(text: str) -> bytes:
    # while a wall is dragged one text is changed again and again: unpickling takes a fifth of the time of parsing
    return pickle.dumps(tomlkit.parse(text))


def with_air(room: Room, air: Air) -> Room:
    """The room in other air. Raises InputError where no room has such air."""

    def change(document: Document) -> None:
        table = section(document, "air")
        for key, value in vars(air).items():
            table[key] = value

    return changed_room(room, change)


def with_place(room: Room, place: Place) -> Room:
    """The room with a place of that name where and as `place` is. Raises InputError where it lies inside a post."""

    def change(document: Document) -> None:
        table = section(document, "places", place.name)
        table["position"] = list(place.position)
        table["heading_deg"] = round(math.degrees(place.heading), _DIGITS)
        if place.height is not None:
            table["height"] = place.height

    return changed_room(room, change)


def with_material(room: Room, name: str, reflectance: float, scatter: float) -> Room:
    """The room with a material of that name that leaves so much (amplitude ratio) and scatters so much (share).

    Raises InputError where one is not within 0..1.
    """

    def change(document: Document) -> None:
        table = section(document, "materials", name)
        table["reflectance"] = reflectance
        if scatter or "scatter" in table:
            table["scatter"] = scatter

    return changed_room(room, change)


def with_corners(room: Room, moved: Mapping[Point, Point]) -> Room:
    """The room with every wall end that lies at one of those points (m) moved to another: walls that meet still meet.

    Raises InputError where that leaves a wall no length.
    """

    def change(document: Document) -> None:
        for chain in document["walls"]:
            for k, point in enumerate(chain["points"]):
                to = next((to for corner, to in moved.items() if math.dist(point, corner) <= MEETING), None)
                if to is not None:
                    chain["points"][k] = list(to)

    return changed_room(room, change)


def materials(room: Room) -> dict[str, Material]:
    """The materials that the room's text defines, those that nothing is made of as well."""
    return parse_toml(room.text, f"room {room.name!r}", RoomFile).materials


def section(document: Document, *names: str) -> Document:
    """The table of that name within the table of the name before; made where it is missing."""
    for name in names:
        if name not in document:
            document[name] = tomlkit.table()
        document = document[name]
    return document


def save_room(room: Room, path: Path, overwrite: bool = False) -> None:
    """Write the room's text. Raises InputError where there is such a file already, OutputError where it cannot be."""
    try:
        with path.open("w" if overwrite else "x", encoding="utf-8", newline="") as file:
            file.write(room.text)
    except FileExistsError as error:
        raise InputError(f"{path}: exists already; choose another name, or say that it may be overwritten") from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}; choose another folder") from error
