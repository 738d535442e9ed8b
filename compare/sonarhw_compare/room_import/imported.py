"""A room from a file of another program: its format is recognised by the content."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sonarhw_sim.room.room import Room, parse_room

from sonarhw import arguments
from sonarhw.errors import InputError
from sonarhw_compare.room_import import REFLECTANCE
from sonarhw_compare.room_import.drawings import read_dxf, read_geojson, read_svg
from sonarhw_compare.room_import.gazebo import read_sdf
from sonarhw_compare.room_import.inputs import read_bytes
from sonarhw_compare.room_import.plan import ForeignPlan, room_text
from sonarhw_compare.room_import.ros_map import read_ros_map
from sonarhw_compare.room_import.stage import read_stage

FORMATS = "a map of ROS (YAML), a world of Gazebo (SDF) or Stage, a drawing as DXF or SVG, or GeoJSON"
_START = 65_536  # bytes that decide
_DRAWINGS = {"dxf": read_dxf, "svg": read_svg, "geojson": read_geojson}
_IN_METRES = {"sdf": read_sdf, "ros": read_ros_map, "stage": read_stage}
_PROLOGUE = re.compile(r"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^\[>]*(\[.*?\])?\s*>", re.DOTALL)
_STAGE = re.compile(r'^\s*(include\s+"|define\s+\w+\s+\w+|\w+\s*\($|\w+\s*\()', re.MULTILINE)
_PICTURE = "is a picture; give the YAML file of the map, which states the size of a cell"
_OTHERS = (
    (b"AC10", "is a DWG drawing; save it as DXF"),
    (b"\x89PNG", _PICTURE),
    (b"P5", _PICTURE),
    (b"P2", _PICTURE),
    (b"\x1f\x8b", "is compressed; unpack it"),
)


@dataclass(frozen=True)
class ImportedRoom:
    """A room of a file of another program, and how it was read."""

    room: Room
    notes: tuple[str, ...]  # units, errors of walls, what was left out; comments at the start of the room's text


@arguments.checked(
    file=arguments.file_name,
    unit=arguments.text,
    layers=arguments.words,
    height=arguments.number(-1000, 1000, "m"),
    reflectance=arguments.number(0, 1),
)
def import_room(
    file: Path | str | os.PathLike[str],
    *,
    unit: str = "",
    layers: Sequence[str] | str = (),
    height: float | None = None,
    reflectance: float = REFLECTANCE,
) -> ImportedRoom:
    """Return the room in a file of another program: a map of ROS, a world of Gazebo or Stage, DXF, SVG or GeoJSON.

    `unit` is that of a drawing: m, cm, mm, in, ft or a number of metres; needed if the drawing states none. `layers` of
    a drawing are used, else all. With a `height` (m), only what exists there. All surfaces have one `reflectance`.
    Raises InputError, and MissingExtra if a drawing needs the extra `rooms`.
    """
    path = Path(file)
    plan = _read(path, unit, layers.split(",") if isinstance(layers, str) else layers)
    if height is not None:
        plan = plan.at_height(height)
    elif _differ_in_height(plan):
        plan.notes.append(
            "objects are at different heights: from a place without a height, all of them are obstacles; the height of "
            "the scanner selects those at its level"
        )
    text, notes = room_text(plan, path.stem, reflectance, path.name)
    return ImportedRoom(parse_room(text, str(path)), tuple(notes))


def _read(file: Path, unit: str, layers: Sequence[str]) -> ForeignPlan:
    """Return the plan of a file. Raises InputError, also for an option that its format does not have."""
    kind = room_format(file)
    if kind in _DRAWINGS:
        return _DRAWINGS[kind](file, unit, layers)
    if unit or layers:
        option = "unit" if unit else "layers"
        raise InputError(f"{option}: {file.name} is in metres and has no layers; leave out {option}")
    return _IN_METRES[kind](file)


def _differ_in_height(plan: ForeignPlan) -> bool:
    spans = [shape.span for shape in plan.outlines if shape.span is not None]
    spans += [shape.span for shape in plan.rounds if shape.span is not None]
    return bool(spans) and max(low for low, _ in spans) > min(high for _, high in spans)


def room_format(file: Path) -> str:
    """Return the format of a file: dxf, svg, geojson, sdf, ros or stage. Raises InputError."""
    start = read_bytes(file, FORMATS)[:_START]
    for magic, problem in _OTHERS:
        if start.startswith(magic):
            raise InputError(f"{file}: {problem}")
    text = start.decode("utf-16" if start[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig", "replace").lstrip()
    if start.startswith(b"AutoCAD Binary DXF") or re.match(r"(999\s*\n[^\n]*\n\s*)*0\s*\n\s*SECTION", text):
        return "dxf"
    if text.startswith("<"):
        return _of_xml(file, text)
    if text.startswith("{"):
        return "geojson"
    if re.search(r"^image\s*:", text, re.MULTILINE) and re.search(r"^resolution\s*:", text, re.MULTILINE):
        return "ros"
    if _STAGE.search(text) and "\0" not in text:
        return "stage"
    raise InputError(f"{file}: is not recognised; expected {FORMATS}; `sonarhw import` converts a scan")


def _of_xml(file: Path, text: str) -> str:
    root = re.search(r"<([A-Za-z_][\w.:-]*)", _PROLOGUE.sub("", text))
    name = root[1].rpartition(":")[2] if root else ""
    if name in ("sdf", "gazebo"):
        return "sdf"
    if name == "svg":
        return "svg"
    raise InputError(f"{file}: is XML with the element <{name[:40]}>; expected {FORMATS}")
