"""Draw the wiring of each combination of parts: `python -m docs.building.draw_wiring` writes wiring-*.svg.

Every terminal has its own row, so wires are horizontal and cannot cross.
"""

import re
from collections.abc import Iterator
from html import escape
from pathlib import Path

from docs.building.wiring_table import (
    COMBINATIONS,
    CONTROLLERS,
    TO_GROUND,
    Combination,
    Part,
    Supply,
    Wire,
    left_parts,
    right_parts,
)

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware"
_PIN = re.compile(r"^#define (\w+) (?:[A-L], )?\d+ //\s+(\d+)", re.MULTILINE)

_WIDTH, _MARGIN, _PART, _GAP, _CONTROLLER = 860, 10, 220, 145, 110
_ROW, _HEAD, _BETWEEN, _FOOT = 42, 50, 14, 26
_NOTE = "All grounds meet at the 5 V supply."
_LEFT_EDGE = _MARGIN + _PART  # inner edge of the parts on the left
_CONTROLLER_LEFT, _CONTROLLER_RIGHT = _LEFT_EDGE + _GAP, _LEFT_EDGE + _GAP + _CONTROLLER
_RIGHT_EDGE = _CONTROLLER_RIGHT + _GAP
_INK, _GREY, _WIRE, _RED = "#1b1b1b", "#555555", "#0072b2", "#b03a00"


def pins(chip: str) -> dict[str, str]:
    """Return the pin of each signal on the Arduino or on the header, from the firmware's pins.h."""
    [header] = FIRMWARE.rglob(f"{chip}/pins.h")
    return dict(_PIN.findall(header.read_text(encoding="utf-8")))


def drawing(combination: Combination) -> str:
    """Return the SVG of a combination."""
    controller = CONTROLLERS[combination.controller]
    pin_of = pins(controller.chip)
    left, right = left_parts(combination), right_parts(combination)
    bottom = _MARGIN + max(_height(left), _height(right))
    height = bottom + _FOOT + _MARGIN
    title = f"Wiring of {' '.join(controller.title)}: {', '.join(part.title for part in [*left, *right])}"
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" '
        'font-family="DejaVu Sans, Verdana, Helvetica, Arial, sans-serif">',
        f"<title>{escape(title)}</title>",
        f'<rect width="{_WIDTH}" height="{height}" rx="8" fill="#ffffff"/>',
        _box(_CONTROLLER_LEFT, _MARGIN, _CONTROLLER, bottom - _MARGIN),
        *(
            _text(_CONTROLLER_LEFT + _CONTROLLER / 2, _MARGIN + 21 + 19 * line, words, "middle", bold=True)
            for line, words in enumerate(controller.title)
        ),
        *_side(left, pin_of, _MARGIN, _LEFT_EDGE, _CONTROLLER_LEFT),
        *_side(right, pin_of, _RIGHT_EDGE, _RIGHT_EDGE, _CONTROLLER_RIGHT),
        _text(_WIDTH / 2, bottom + _FOOT - 6, f"{_NOTE} {controller.note}", "middle", size=13, colour=_GREY),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _height(parts: list[Part]) -> int:
    return sum(_HEAD + _ROW * len(part.terminals) for part in parts) + _BETWEEN * (len(parts) - 1)


def _side(parts: list[Part], pin_of: dict[str, str], box: float, edge: float, controller: float) -> Iterator[str]:
    """Yield the parts on one side: boxes at x `box`, terminals at x `edge`, pins at x `controller`."""
    y = float(_MARGIN)
    for part in parts:
        yield _box(box, y, _PART, _HEAD + _ROW * len(part.terminals))
        yield _text(box + _PART / 2, y + 21, part.title, "middle", bold=True)
        yield _text(box + _PART / 2, y + 40, part.subtitle, "middle", size=12, colour=_GREY)
        y += _HEAD
        for terminal in part.terminals:
            yield from _row(terminal, pin_of, y + _ROW / 2, edge, controller)
            y += _ROW
        y += _BETWEEN


def _row(terminal: Wire | Supply, pin_of: dict[str, str], y: float, edge: float, controller: float) -> Iterator[str]:
    away = 1 if controller > edge else -1  # direction from the part to the controller
    inside, outside = ("end", "start") if away > 0 else ("start", "end")
    yield _text(edge - 10 * away, y + 5, terminal.terminal, inside)
    if isinstance(terminal, Supply):
        yield _line(edge, y, edge + 14 * away, y, _RED)
        yield _text(edge + 18 * away, y + 5, terminal.tag, outside, size=12, colour=_RED)
        return
    yield _line(edge, y, controller, y, _WIRE)
    start, tip = (edge, controller) if terminal.from_part else (controller, edge)
    back = 9 if tip < start else -9
    yield f'<path d="M{tip:g} {y:g} l{back} -5 v10 z" fill="{_WIRE}"/>'
    yield _text(controller + 10 * away, y + 5, pin_of.get(terminal.signal, terminal.signal), outside, bold=True)
    if terminal.resistor:
        yield from _resistor(terminal, (edge + controller) / 2 - 44, y)


def _resistor(wire: Wire, x: float, y: float) -> Iterator[str]:
    down = 1 if wire.to == TO_GROUND else -1
    top = min(y + 4 * down, y + 17 * down)
    yield f'<circle cx="{x:g}" cy="{y:g}" r="3" fill="{_WIRE}"/>'
    yield _line(x, y, x, y + 4 * down, _RED)
    yield f'<rect x="{x - 4:g}" y="{top:g}" width="8" height="13" fill="#ffffff" stroke="{_RED}" stroke-width="1.5"/>'
    yield _text(x + 9, top + 11, f"{wire.resistor} {wire.to}", "start", size=12, colour=_RED)


def _box(x: float, y: float, width: float, height: float) -> str:
    return (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" fill="#f2f5f8" '
        f'stroke="{_INK}" stroke-width="1.5"/>'
    )


def _line(x: float, y: float, to_x: float, to_y: float, colour: str) -> str:
    return f'<path d="M{x:g} {y:g} L{to_x:g} {to_y:g}" stroke="{colour}" stroke-width="2"/>'


def _text(
    x: float, y: float, words: str, anchor: str, *, size: int = 14, bold: bool = False, colour: str = _INK
) -> str:
    weight = ' font-weight="bold"' if bold else ""
    return (
        f'<text x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{anchor}"{weight} fill="{colour}">'
        f"{escape(words)}</text>"
    )


def drawing_path(combination: Combination) -> Path:
    """Return the file of a drawing."""
    return HERE / f"wiring-{combination.name}.svg"


if __name__ == "__main__":
    for each in COMBINATIONS:
        drawing_path(each).write_text(drawing(each), encoding="utf-8")
