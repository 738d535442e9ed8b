"""SVG with line widths that every program draws correctly.

Qt's generator scales shapes by a transform and keeps line widths by `vector-effect`, which only browsers support.
This module applies the transform to the coordinates instead.
"""

import re
from xml.etree import ElementTree

_SVG, _LINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
_PAIR = re.compile(r"(-?\d[\d.e+-]*|-?\.\d+),(-?\d[\d.e+-]*|-?\.\d+)")
_EFFECT = "vector-effect"
_SHAPES = tuple(f"{{{_SVG}}}{name}" for name in ("path", "polyline", "polygon", "rect"))
_RECT, _PATH = f"{{{_SVG}}}rect", f"{{{_SVG}}}path"

Matrix = tuple[float, ...]  # a, b, c, d, e, f of SVG


def with_own_coordinates(svg: str) -> str:
    """Return the same drawing with transformed coordinates, and text in a font that every system has."""
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _LINK)
    root = ElementTree.fromstring(svg)
    for group in root.iter(f"{{{_SVG}}}g"):
        shapes = [*group]
        scaled = any(shape.get(_EFFECT) for shape in shapes) and all(shape.tag in _SHAPES for shape in shapes)
        matrix = _matrix(group.get("transform", "")) if scaled else None
        if matrix is not None:
            for shape in shapes:
                _place(shape, matrix)
            del group.attrib["transform"]
    for element in root.iter():
        if element.get("font-family") == "Sans Serif":
            element.set("font-family", "sans-serif")
    return ElementTree.tostring(root, encoding="unicode")


def _matrix(transform: str) -> Matrix | None:
    found = re.fullmatch(r"matrix\(([^)]*)\)", transform)
    return tuple(float(number) for number in found[1].split(",")) if found else None


def _place(shape: ElementTree.Element, matrix: Matrix) -> None:
    shape.attrib.pop(_EFFECT, None)
    if shape.tag == _RECT:
        x, y, width, height = (float(shape.attrib.pop(key, "0")) for key in ("x", "y", "width", "height"))
        shape.tag = _PATH
        shape.set("d", f"M{x},{y} L{x + width},{y} L{x + width},{y + height} L{x},{y + height} Z")
    for key in ("d", "points"):
        if key in shape.attrib:
            shape.set(key, _PAIR.sub(lambda pair: _moved(float(pair[1]), float(pair[2]), matrix), shape.attrib[key]))


def _moved(x: float, y: float, matrix: Matrix) -> str:
    a, b, c, d, e, f = matrix
    return f"{a * x + c * y + e:.7g},{b * x + d * y + f:.7g}"
