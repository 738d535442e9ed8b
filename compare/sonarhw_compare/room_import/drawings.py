"""Drawings: DXF, SVG and GeoJSON become a plan. Their unit is stated by the file or by the user."""

import json
import logging
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from sonarhw.errors import InputError, MissingExtra
from sonarhw.readings import FloatArray
from sonarhw_compare.processes import parse_apart
from sonarhw_compare.room_import.inputs import METRES, metres_of, read_bytes, unit_question
from sonarhw_compare.room_import.plan import ForeignPlan, RoundObject, WallChain

_MOST_SHAPES = 200_000
_CURVES = 0.0005  # of the extent of a drawing: how far a flat piece of a curve may be from it


@dataclass
class _Drawing:
    """The lines and circles of a drawing in its own unit, x to the right and y up."""

    lines: list[tuple[str, FloatArray, bool]] = field(default_factory=list)  # layer, points (n, 2), closed
    circles: list[tuple[str, float, float, float]] = field(default_factory=list)  # layer, x, y, radius
    left_out: Counter[str] = field(default_factory=Counter)
    stated: float | None = None  # m of a unit
    evidence: str = ""  # of the stated unit, or why there is none
    curved: float = 0.0  # how far flat pieces are from their curves at most


def read_dxf(file: Path, unit: str, layers: Sequence[str]) -> ForeignPlan:
    """Return the plan of a DXF drawing. Raises InputError, and MissingExtra without ezdxf."""
    _need("ezdxf", "DXF files need ezdxf")
    return _plan(file, parse_apart(_parse_dxf, file, "a DXF drawing"), unit, layers)


def read_svg(file: Path, unit: str, layers: Sequence[str]) -> ForeignPlan:
    """Return the plan of an SVG drawing. Raises InputError, and MissingExtra without svgelements."""
    _need("svgelements", "SVG files need svgelements")
    _check_uses(file)
    return _plan(file, parse_apart(_parse_svg, file, "an SVG drawing"), unit, layers)


def read_geojson(file: Path, unit: str, layers: Sequence[str]) -> ForeignPlan:
    """Return the plan of a GeoJSON file. Raises InputError."""
    return _plan(file, _parse_geojson(file), unit, layers)


def _need(module: str, what: str) -> None:
    if find_spec(module) is None:
        raise MissingExtra(what, "rooms")


def _plan(file: Path, drawing: _Drawing, unit: str, layers: Sequence[str]) -> ForeignPlan:
    """Return the drawing in metres. Raises InputError if its unit is not known, or a layer is missing."""
    drawing = _of_layers(file, drawing, layers)
    if not drawing.lines and not drawing.circles:
        raise InputError(f"{file}: contains no line; {_left_out(drawing) or 'expected lines, polygons or circles'}")
    metres = metres_of(unit) if unit else drawing.stated
    if metres is None:
        raise unit_question(file, np.ptp(np.vstack(_ends(drawing)), axis=0), drawing.evidence)
    plan = ForeignPlan(notes=[f"unit: {unit}" if unit else f"unit: {drawing.evidence}"])
    kinds = Counter(layer for layer, *_ in (*drawing.lines, *drawing.circles))
    plan.notes.append(f"layers: {', '.join(f'{layer} ({count})' for layer, count in kinds.most_common(20))}")
    for number, (layer, points, closed) in enumerate(drawing.lines):
        plan.outlines.append(WallChain(f"{layer} {number}", points * metres, closed))
    for number, (layer, x, y, radius) in enumerate(drawing.circles):
        plan.rounds.append(RoundObject(f"{layer} circle {number}", (x * metres, y * metres), radius * metres))
    if drawing.curved:
        plan.notes.append(
            f"curves are chains of flat walls, at most {drawing.curved * metres * 1000:.2g} mm beside them"
        )
    plan.notes += [note for note in [_left_out(drawing)] if note]
    return plan


def _of_layers(file: Path, drawing: _Drawing, layers: Sequence[str]) -> _Drawing:
    """Return what is in some layers; without any named, everything. Raises InputError for an unknown layer."""
    with_lines = {line[0] for line in drawing.lines} | {circle[0] for circle in drawing.circles}
    for layer in layers:
        if layer not in with_lines:
            raise InputError(f"{file}: no layer {layer!r} with lines; layers: {', '.join(sorted(with_lines)[:30])}")
    if not layers:
        return drawing
    lines = [line for line in drawing.lines if line[0] in layers]
    circles = [circle for circle in drawing.circles if circle[0] in layers]
    count = len(drawing.lines) + len(drawing.circles) - len(lines) - len(circles)
    left_out = drawing.left_out + Counter({"lines of other layers": count})
    return replace(drawing, lines=lines, circles=circles, left_out=left_out)


def _left_out(drawing: _Drawing) -> str:
    listed = ", ".join(f"{what} ({count})" for what, count in drawing.left_out.items() if count)
    return f"left out: {listed}" if listed else ""


def _ends(drawing: _Drawing) -> list[FloatArray]:
    """Return the points of each line, and opposite corners of the square around each circle."""
    points = [points for _, points, _ in drawing.lines]
    return points + [np.array([[x - r, y - r], [x + r, y + r]]) for _, x, y, r in drawing.circles]


def _add_line(drawing: _Drawing, layer: str, points: Iterable[Sequence[float]], closed: bool = False) -> None:
    """Add a line, if it has a length. Raises InputError for too many."""
    array = np.array([[*point[:2]] for point in points], np.float64).reshape(-1, 2)
    if len(array) < 2 or not np.isfinite(array).all() or not np.ptp(array, axis=0).any():
        drawing.left_out["lines without a length"] += 1
        return
    if len(drawing.lines) >= _MOST_SHAPES:
        raise InputError(f"more than {_MOST_SHAPES} lines; choose layers, or simplify the drawing")
    drawing.lines.append((layer, array, closed))


# DXF, with ezdxf.


_BULGED = ("ARC", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE")
_DXF_UNITS = {1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 10: "yd", 14: "dm"}
_DRAWN = ("LINE", "CIRCLE", *_BULGED, "SOLID", "TRACE", "3DFACE")


def _parse_dxf(file: Path) -> _Drawing:
    """Read a drawing, in a process of its own."""
    from ezdxf import filemanagement, recover
    from ezdxf.disassemble import recursive_decompose
    from ezdxf.lldxf.const import DXFStructureError

    read_bytes(file, "a DXF drawing")
    logging.getLogger("ezdxf").setLevel(logging.CRITICAL)  # what it recovers
    try:
        document = filemanagement.readfile(str(file))
    except (DXFStructureError, UnicodeDecodeError):
        document, _ = recover.readfile(str(file))
    drawing = _Drawing()
    code = int(document.header.get("$INSUNITS", 0))
    unit = _DXF_UNITS.get(code)
    drawing.stated = METRES[unit] if unit else None
    drawing.evidence = f"{unit} ($INSUNITS {code})" if unit else f"the drawing states no length unit ($INSUNITS {code})"
    hidden = {layer.dxf.name for layer in document.layers if layer.is_off() or layer.is_frozen()}
    modelspace = [*_limited(document.modelspace())]
    shown = [entity for entity in modelspace if entity.dxftype() in (*_DRAWN, "INSERT")]
    drawing.left_out.update(kind for entity in modelspace if (kind := entity.dxftype()) not in (*_DRAWN, "INSERT"))
    entities = [*_limited(recursive_decompose(shown))]
    flatness = _flatness([entity for entity in entities if entity.dxf.get("layer", "0") not in hidden])
    for entity in entities:
        layer = entity.dxf.get("layer", "0")
        if layer in hidden:
            drawing.left_out["entities of layers that are off"] += 1
        elif entity.dxftype() not in _DRAWN:
            drawing.left_out[entity.dxftype()] += 1
        else:
            _add_entity(drawing, layer, entity, flatness)
    return drawing


def _limited(entities: Iterable[Any]) -> Iterator[Any]:
    for number, entity in enumerate(entities):
        if number >= _MOST_SHAPES:
            raise InputError(f"more than {_MOST_SHAPES} entities; simplify the drawing")
        yield entity


def _flatness(entities: Sequence[Any]) -> float:
    from ezdxf import bbox

    box = bbox.extents((entity for entity in entities if entity.dxftype() in _DRAWN), fast=True)
    return max(float(max(box.size.x, box.size.y)) * _CURVES, 1e-9) if box.has_data else 1.0


def _add_entity(drawing: _Drawing, layer: str, entity: Any, flatness: float) -> None:
    from ezdxf import path

    kind = entity.dxftype()
    if kind == "CIRCLE":
        center, radius = entity.ocs().to_wcs(entity.dxf.center), float(entity.dxf.radius)
        if math.isfinite(center.x + center.y + radius) and radius > 0 and abs(entity.dxf.extrusion.z) > 0.999:
            drawing.circles.append((layer, center.x, center.y, radius))
        else:
            drawing.left_out["tilted circles"] += 1
        return
    if kind in ("SOLID", "TRACE", "3DFACE"):
        _add_line(drawing, layer, [(point.x, point.y) for point in entity.wcs_vertices()], True)
        return
    traced = path.make_path(entity)
    if traced.has_curves:
        drawing.curved = max(drawing.curved, flatness)
    points = [(point.x, point.y) for point in traced.flattening(flatness, segments=4)]
    _add_line(drawing, layer, points, bool(getattr(entity, "closed", False) or getattr(entity, "is_closed", False)))


# SVG, with svgelements.


_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_SVG_USE = ("use", "{http://www.w3.org/2000/svg}use")
_MOST_ELEMENTS = 200_000  # with those that <use> repeats
_PIECES = 16  # flat pieces of a curve
_ABSOLUTE = {"mm": 0.001, "cm": 0.01, "in": 0.0254, "m": 1.0, "ft": 0.3048}


def _check_uses(file: Path) -> None:
    """Raise InputError if elements that repeat others would become too many."""
    try:
        root = ElementTree.fromstring(read_bytes(file, "an SVG drawing"))
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{file}: is not an SVG drawing: {error}") from error
    by_name = {f"#{element.get('id')}": element for element in root.iter() if element.get("id")}
    counts: dict[ElementTree.Element, int] = {}
    order: list[tuple[ElementTree.Element, bool]] = [(root, False)]
    active: set[ElementTree.Element] = set()
    while order:
        element, done = order.pop()
        used = next((value for key, value in element.attrib.items() if key.endswith("href")), "")
        parts = [*element] + ([by_name[used]] if element.tag in _SVG_USE and used in by_name else [])
        if done:
            active.discard(element)
            counts[element] = 1 + sum(counts.get(part, 0) for part in parts)
            if counts[element] > _MOST_ELEMENTS:
                raise InputError(f"{file}: <use> repeats more than {_MOST_ELEMENTS} elements; simplify the drawing")
        elif element in active:
            raise InputError(f"{file}: an element repeats itself by <use>")
        elif element not in counts:
            active.add(element)
            order += [(element, True), *((part, False) for part in parts)]


def _parse_svg(file: Path) -> _Drawing:
    """Read a drawing, in a process of its own. Its unit is one of the coordinates in the viewBox."""
    import svgelements as svg

    drawing = _Drawing()
    root = svg.SVG.parse(BytesIO(read_bytes(file, "an SVG drawing")), reify=True, ppi=96.0)
    pixel = _pixels(root)
    _state_unit(drawing, root)
    shapes = [element for element in root.elements() if isinstance(element, svg.Shape)]
    for element in root.elements():
        if isinstance(element, svg.Text | svg.Image):
            drawing.left_out[type(element).__name__.lower()] += 1
    for element in shapes:
        layer = str(element.values.get(f"{_INKSCAPE}label") or element.values.get("id") or "drawing")
        if element.values.get("visibility") == "hidden" or element.values.get("display") == "none":
            drawing.left_out["hidden shapes"] += 1
        elif isinstance(element, svg.Circle | svg.Ellipse) and math.isclose(
            element.implicit_rx, element.implicit_ry, rel_tol=1e-6
        ):
            center, radius = element.implicit_center, element.implicit_rx / pixel
            drawing.circles.append((layer, center.x / pixel, -center.y / pixel, radius))
        else:
            _add_path(drawing, layer, abs(svg.Path(element)), pixel)  # abs: transformed
    return _from_corner(drawing)


def _from_corner(drawing: _Drawing) -> _Drawing:
    """Return the drawing with the origin at its lower left corner: y of SVG points downwards."""
    if not drawing.lines and not drawing.circles:
        return drawing
    x0, y0 = np.vstack(_ends(drawing)).min(axis=0).tolist()
    lines = [(layer, points - (x0, y0), closed) for layer, points, closed in drawing.lines]
    circles = [(layer, x - x0, y - y0, radius) for layer, x, y, radius in drawing.circles]
    return replace(drawing, lines=lines, circles=circles)


def _pixels(root: Any) -> float:
    """Return the pixels of a unit of the viewBox."""
    box = root.viewbox
    if box is None or not root.width or not box.width:
        return 1.0
    return float(root.width) / float(box.width)


def _state_unit(drawing: _Drawing, root: Any) -> None:
    width = str(root.values.get("width", ""))
    number = width.rstrip("abcdefghijklmnopqrstuvwxyz%")
    metres = _ABSOLUTE.get(width[len(number) :].strip())
    if metres is None or root.viewbox is None:
        drawing.evidence = "the drawing states no unit: width and viewBox have none"
        return
    box = float(root.viewbox.width)
    drawing.stated = float(number) * metres / box
    drawing.evidence = f"{drawing.stated:g} m (width {width} of {box:g} units of the viewBox)"


def _add_path(drawing: _Drawing, layer: str, path: Any, pixel: float) -> None:
    import svgelements as svg

    for part in path.as_subpaths():
        points: list[tuple[float, float]] = []
        closed = False
        for segment in svg.Path(part):
            if isinstance(segment, svg.Close):
                closed = True
            elif isinstance(segment, svg.Move | svg.Line):
                points.append((segment.end.x / pixel, -segment.end.y / pixel))
            else:
                along = [segment.point(share) for share in np.linspace(0.0, 1.0, 2 * _PIECES + 1).tolist()]
                curve = np.array([(point.x, -point.y) for point in along])
                points += [(x, y) for x, y in (curve[2::2] / pixel).tolist()]
                chords = (curve[:-2:2] + curve[2::2]) / 2
                drawing.curved = max(drawing.curved, float(np.hypot(*((curve[1::2] - chords) / pixel).T).max()))
        _add_line(drawing, layer, points, closed)


# GeoJSON: longitude and latitude by its standard, but often metres of a plan.


_EARTH = 6_371_008.8  # m, mean radius
_WIDEST = 2000.0  # m, of a room in degrees
_DEPTHS = {"LineString": 0, "LinearRing": 0, "MultiLineString": 1, "Polygon": 1, "MultiPolygon": 2}
_NAMES = ("layer", "name", "indoor", "type", "class")


def _parse_geojson(file: Path) -> _Drawing:
    try:
        content = json.loads(read_bytes(file, "a GeoJSON file").decode("utf-8-sig"))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{file}: is not a GeoJSON file: {error}") from error
    if not isinstance(content, dict) or "type" not in content:
        raise InputError(f"{file}: is not a GeoJSON file: expected an object with the key type")
    drawing = _Drawing()
    try:
        _add_shape(drawing, content, "walls", 0)
    except (TypeError, ValueError, LookupError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{file}: is not a GeoJSON file: coordinates are not numbers in lists") from error
    if drawing.lines:
        _state_degrees(drawing, content)
    return drawing


def _add_shape(drawing: _Drawing, shape: dict[str, Any], layer: str, depth: int) -> None:
    if depth > 50:
        raise InputError("shapes are nested more than 50 deep")
    kind = str(shape.get("type"))
    if kind == "FeatureCollection":
        for feature in shape["features"]:
            _add_shape(drawing, feature, layer, depth + 1)
    elif kind == "Feature":
        properties = shape.get("properties") or {}
        named = next((str(properties[key]) for key in _NAMES if properties.get(key)), layer)
        _add_shape(drawing, shape.get("geometry") or {"type": "empty features"}, named, depth + 1)
    elif kind == "GeometryCollection":
        for part in shape["geometries"]:
            _add_shape(drawing, part, layer, depth + 1)
    elif kind in _DEPTHS:
        for line in _lines(shape["coordinates"], _DEPTHS[kind]):
            _add_line(drawing, layer, line, kind.endswith("Polygon"))
    else:
        drawing.left_out[kind] += 1


def _lines(coordinates: Any, depth: int) -> Iterator[Any]:
    if not depth:
        yield coordinates
        return
    for part in coordinates:
        yield from _lines(part, depth - 1)


def _state_degrees(drawing: _Drawing, content: dict[str, Any]) -> None:
    """Convert longitude and latitude to metres, if these make a room."""
    crs = json.dumps(content.get("crs") or "")
    points = np.vstack([points for _, points, _ in drawing.lines])
    middle, extent = (points.min(axis=0) + points.max(axis=0)) / 2, np.ptp(points, axis=0)
    scale = math.radians(1.0) * _EARTH * np.array([math.cos(math.radians(middle[1])), 1.0])
    is_projected = "EPSG" in crs and "4326" not in crs
    on_earth = bool((np.abs(points) <= (180.0, 90.0)).all())
    if (
        not is_projected
        and on_earth
        and float((extent * scale).max()) <= _WIDEST
        and float((extent * scale).max()) > 0.5
    ):
        drawing.lines = [(layer, (line - middle) * scale, closed) for layer, line, closed in drawing.lines]
        drawing.stated = 1.0
        drawing.evidence = f"degrees of longitude and latitude; the origin is at {middle[0]:.7f}, {middle[1]:.7f}"
        return
    drawing.lines = [(layer, line - _corner(points), closed) for layer, line, closed in drawing.lines]
    drawing.evidence = "the file states no unit, and as longitude and latitude its coordinates are no room"


def _corner(points: FloatArray) -> FloatArray:
    """Return the origin to subtract: far from it, coordinates of a survey would lose digits."""
    return np.floor(points.min(axis=0)) if np.abs(points).max() > 1e4 else np.zeros(2)
