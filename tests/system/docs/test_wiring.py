"""The drawings of the building guide show the pins of the firmware, and can be read."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cache
from itertools import combinations

import pytest
from matplotlib import font_manager
from PIL import ImageFont

from docs.building.draw_wiring import FIRMWARE, drawing, drawing_path
from docs.building.wiring_table import COMBINATIONS, CONTROLLERS, Combination, Wire, left_parts, right_parts
from tests.checkout import CHECKOUT

PAGES = [CHECKOUT / "docs" / name for name in ("building/building.md", "devices/raspberry_pi.md")]
GUIDE = "".join(page.read_text(encoding="utf-8") for page in PAGES)
SVG = "{http://www.w3.org/2000/svg}"
each_combination = pytest.mark.parametrize("combination", COMBINATIONS, ids=lambda one: one.name)


def mega_pin(port: str, bit: int) -> int:
    """Return the number of a pin on an Arduino Mega 2560, as in pins_arduino.h of the Arduino core."""
    first, direction = {"A": (22, 1), "C": (37, -1), "L": (49, -1), "B": (53, -1)}[port]
    return first + direction * bit


def uno_pin(port: str, bit: int) -> int:
    """Return the same for an Arduino Uno or Nano."""
    return {"D": 0, "B": 8}[port] + bit


# GPIO of each pin of the 40-pin header, as in the documentation of the Raspberry Pi
HEADER = {11: 17, 13: 27, 15: 22, 16: 23, 18: 24, 22: 25, 31: 6, 32: 12, 33: 13, 36: 16, 37: 26, 38: 20, 40: 21}
NUMBER_OF = {"atmega2560": mega_pin, "atmega328p": uno_pin}


def header_pins() -> dict[str, str]:
    """Return the pin of each signal on the header of a Raspberry Pi, from the GPIO that the Linux program uses."""
    defined = re.findall(r"^#define (\w+) (\d+) //", (FIRMWARE / "linux" / "pins.h").read_text("utf-8"), re.MULTILINE)
    pin_of = {gpio: pin for pin, gpio in HEADER.items()}
    return {signal: str(pin_of[int(gpio)]) for signal, gpio in defined}


def pins_of(chip: str) -> dict[str, str]:
    """Return the pin of each signal on the Arduino or on the header, from what the firmware uses."""
    if chip == "linux":
        return header_pins()
    [header] = FIRMWARE.rglob(f"{chip}/pins.h")
    defined = re.findall(r"^#define (\w+) ([A-L]), (\d) ", header.read_text(encoding="utf-8"), re.MULTILINE)
    return {signal: str(NUMBER_OF[chip](port, int(bit))) for signal, port, bit in defined}


def rows(svg: str) -> dict[float, list[str]]:
    """Return the texts of a drawing by their height, those of one row from left to right."""
    found: dict[float, list[tuple[float, str]]] = {}
    for text in ET.fromstring(svg).iter(f"{SVG}text"):
        found.setdefault(float(text.attrib["y"]), []).append((float(text.attrib["x"]), text.text or ""))
    return {y: [words for _, words in sorted(texts)] for y, texts in found.items()}


def test_each_combination_that_the_firmware_builds_has_a_drawing() -> None:
    makefile = (FIRMWARE / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    built = " ".join(re.findall(r"^(?:COMBINATIONS|PROGRAMS) := (.*)$", makefile, re.MULTILINE))
    assert sorted(one.name for one in COMBINATIONS) == sorted(built.replace(":", "-").split())


@each_combination
def test_the_drawing_is_the_one_that_the_script_makes(combination: Combination) -> None:
    assert drawing_path(combination).read_text(encoding="utf-8") == drawing(combination), (
        "run python -m docs.building.draw_wiring"
    )
    assert f"{drawing_path(combination).name})" in GUIDE


@each_combination
def test_every_drawn_pin_is_that_of_the_firmware(combination: Combination) -> None:
    pins = pins_of(CONTROLLERS[combination.controller].chip)
    drawn = [*rows(drawing_path(combination).read_text(encoding="utf-8")).values()]
    wires = [
        terminal
        for part in [*left_parts(combination), *right_parts(combination)]
        for terminal in part.terminals
        if isinstance(terminal, Wire)
    ]
    for wire in wires:
        pin = pins.get(wire.signal, wire.signal)
        [row] = (row for row in drawn if wire.terminal in row)
        assert pin in row, wire
        assert abs(row.index(wire.terminal) - row.index(pin)) == 1, wire
    used = [pins.get(wire.signal, wire.signal) for wire in wires]
    assert len(set(used)) == len(used)
    assert all(re.fullmatch(r"\d+|A[01]", pin) for pin in used)


@pytest.mark.parametrize(("column", "chip"), [(0, "atmega2560"), (1, "atmega328p"), (2, "linux")])
def test_the_table_of_the_guide_has_the_pins_of_the_firmware(column: int, chip: str) -> None:
    rows = re.findall(r"^\| `([A-Z_0-9]+)` \| (\d+|-) \| (\d+|-) \| (\d+|-) \|", GUIDE, re.MULTILINE)
    assert {signal: row[column] for signal, *row in rows if row[column] != "-"} == pins_of(chip)


def test_the_header_pins_in_the_sources_are_those_of_the_gpio() -> None:
    written = re.findall(r"^#define (\w+) \d+ //\s+(\d+)", (FIRMWARE / "linux" / "pins.h").read_text(), re.M)
    assert dict(written) == header_pins()


@cache
def font(size: float) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(font_manager.findfont("DejaVu Sans"), size)


Box = tuple[float, float, float, float]  # left, top, right, bottom


def text_boxes(svg: str) -> Iterator[tuple[str, Box]]:
    for text in ET.fromstring(svg).iter(f"{SVG}text"):
        size, x, y = (float(text.attrib[name]) for name in ("font-size", "x", "y"))
        width = font(size).getlength(text.text or "") * (1.1 if "font-weight" in text.attrib else 1.0)
        left = x - width * {"start": 0.0, "middle": 0.5, "end": 1.0}[text.attrib["text-anchor"]]
        yield text.text or "", (left, y - 0.75 * size, left + width, y + 0.2 * size)


def lines(svg: str) -> list[Box]:
    found = re.findall(r'd="M([\d.]+) ([\d.]+) L([\d.]+) ([\d.]+)"', svg)
    return [(min(x, u), min(y, v), max(x, u), max(y, v)) for x, y, u, v in (map(float, line) for line in found)]


def overlap(one: Box, other: Box) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


@each_combination
def test_no_text_or_wire_of_a_drawing_covers_another(combination: Combination) -> None:
    svg = drawing(combination)
    _, _, width, height = map(float, ET.fromstring(svg).attrib["viewBox"].split())
    texts, wires = [*text_boxes(svg)], lines(svg)
    for words, box in texts:
        assert 0 < box[0] < box[2] < width and 0 < box[1] < box[3] < height, words  # noqa: PT018
        assert not any(overlap(box, wire) for wire in wires), words
    assert [(one, other) for (one, a), (other, b) in combinations(texts, 2) if overlap(a, b)] == []
    assert [(one, other) for one, other in combinations(wires, 2) if overlap(one, other)] == []
    # at a width of 800 pixels, the smallest text has 11 pixels
    assert 800 / width * min(float(size) for size in re.findall(r'font-size="(\d+)"', svg)) > 11
