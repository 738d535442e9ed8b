"""Changes to the text of a room file that keep its comments, order and layout.

Each function returns the room of the changed text, and raises InputError if the change makes the file invalid. A room
is always parsed from its text, so a saved room is the same when it is read again.
"""

import math
import pickle
import re
from collections.abc import Callable, Collection, Iterator, Mapping, MutableMapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Array, Comment, Table, Trivia, Whitespace

from sonarhw import arguments
from sonarhw.errors import InputError
from sonarhw.files import atomic_file
from sonarhw_sim.air import Air
from sonarhw_sim.files import parse_toml
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.room.room_file import MEETING, Material, RoomFile

# Comments of a TOML text during edits: each stays with the table or the list element that it describes.
#
# tomlkit counts the comment above a table as the end of the table before. So a deleted table would take the comment
# of the next one along, and a new key would stand below it.


_TOKENS = re.compile(r""""(?:\\.|[^"\\])*"|'[^']*'|#[^\n]*|[\[\]{},\n]|[^\s\[\]{},#"']+""")
_SPACE = "\0"  # in comments above a table; tomlkit would indent new keys of the table like the first spaces
_OPENING, _CLOSING = "[{", "]}"


def bind_comments(document: tomlkit.TOMLDocument) -> str:
    """Move the comments above each table to its header, for `text_of`; return those after the last table."""
    tables = list(_tables(document))
    tails = [_without_tail(table) for table in tables]
    for table, leading in zip(tables[1:], tails, strict=False):
        table.trivia.indent = leading.replace(" ", _SPACE) + table.trivia.indent
    return tails[-1] if tails else ""


def text_of(document: tomlkit.TOMLDocument, end: str) -> str:
    """Return the text of a changed document; `end`: from `bind_comments`."""
    return tomlkit.dumps(document).replace(_SPACE, " ") + end


def remove_table(document: MutableMapping[str, Any], kind: str, index: int) -> None:
    """Remove an element of a list of tables, with its comment; titles above, after a blank line, go to the next table.

    A list without elements is removed. `document`: after `bind_comments`.
    """
    elements = document[kind]
    if isinstance(elements, AoT) and isinstance(document, Container):
        tables = list(_tables(document))
        position = next(k for k, table in enumerate(tables) if table is elements.body[index])
        title = tables[position].trivia.indent.rpartition("\n\n")[0]
        if "#" in title and position + 1 < len(tables):
            tables[position + 1].trivia.indent = f"{title}\n{tables[position + 1].trivia.indent}"
        elif "#" in title:
            tables[position - 1].value.body.append((None, Comment(Trivia(comment=title, trail="\n"))))
    del elements[index]
    if not elements:
        del document[kind]


def like_array(old: Any, values: Sequence[Any]) -> Any:
    """Return these values as a list that keeps the comments of equal elements of an old one."""
    above, beside = _element_comments(old) if isinstance(old, Array) else ({}, {})
    if not above and not beside:
        return values
    places = {_key(element): k for k, element in enumerate(old)}
    lines = tomlkit.array()
    for value in values:
        place = places.get(_key(value), -1)
        for comment in above.get(place, ()):
            lines.add_line(comment=comment)
        lines.add_line(value, comment=beside.get(place, ""))
    for comment in above.get(len(old), ()):
        lines.add_line(comment=comment)
    lines.add_line(indent="")
    return lines


def _tables(container: Container) -> Iterator[Table]:
    """Yield each table with a header, in order."""
    for _, item in container.body:
        for table in item.body if isinstance(item, AoT) else (item,):
            if isinstance(table, Table):
                if not table.is_super_table():
                    yield table
                yield from _tables(table.value)


def _without_tail(table: Table) -> str:
    """Cut off and return the comments after the last key: from the first blank line on, or all without one."""
    body, start = table.value.body, len(table.value.body)
    while start and body[start - 1][0] is None and isinstance(body[start - 1][1], Comment | Whitespace):
        start -= 1
    blank = next((k for k in range(start, len(body)) if isinstance(body[k][1], Whitespace)), start)
    tail = "".join(item.as_string() for _, item in body[blank:])
    del body[blank:]
    return tail


def _element_comments(array: Array) -> tuple[dict[int, list[str]], dict[int, str]]:
    """Return the comments on lines above elements, and on the lines of elements, by their numbers."""
    above: dict[int, list[str]] = {}
    beside: dict[int, str] = {}
    depth, element, begun = 0, -1, False  # begun: whether the line contains a part of an element
    for token in _TOKENS.findall(array.as_string()):
        if token == "\n":
            begun = False
        elif token.startswith("#"):
            text = token[1:].strip()
            if begun:
                beside[element] = " ".join(filter(None, (beside.get(element), text)))
            else:
                above.setdefault(element + 1, []).append(text)
        elif token != ",":
            element += depth == 1 and token not in _CLOSING
            begun = depth > 0
            depth += (token in _OPENING) - (token in _CLOSING)
    return above, beside


def _key(value: Any) -> Any:
    return value if isinstance(value, str) else tuple(map(float, value))


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


@arguments.checked(room=arguments.instance(Room, "a room"), path=arguments.file_name, overwrite=arguments.flag)
def save_room(room: Room, path: Path | str, overwrite: bool = False) -> None:
    """Write the room's text, completely or not at all.

    Raises InputError if the file exists already (unless `overwrite`), OutputError if it cannot be written.
    """
    path = Path(path)
    if path.exists() and not overwrite:
        raise InputError(f"{path}: exists already; choose another name, or allow overwriting")
    with atomic_file(path, "folder", overwrite=overwrite) as file:
        file.write(room.text.encode())
