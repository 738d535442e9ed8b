"""The presets: formats of lines that many sketches and sensors print."""

import re
from collections.abc import Callable
from dataclasses import dataclass

from sonarhw.text.line_format import UNITS, LineFormat, RangeUnit, csv_format, json_format, pattern_format

_RADAR = re.compile(r"(?P<heading_deg>-?\d{1,3})[,*](?P<range>-?\d{1,5})", re.ASCII)
_RADAR_ENDS = re.compile(rb"[.#\0]")
_ANGLE_DISTANCE = re.compile(
    r"angle\W*?(?P<heading_deg>-?\d+(?:\.\d+)?)\s*(?:°|deg(?:rees?|s)?\b)?\W*?"
    r"(?:distance|dist|range)\W*?(?P<range>-?\d+(?:\.\d+)?|out of range|no echo|nan|inf|timeout)"
    r"\s*(?P<unit>mm|cm|m|in|inch|inches)?\W*",
    re.ASCII | re.IGNORECASE,
)
_MAXBOTIX = re.compile(r"R(?P<range>\d{3,4})", re.ASCII)


@dataclass(frozen=True)
class Preset:
    """A format, and what the devices that print it have in common."""

    example: str
    make: Callable[[RangeUnit], LineFormat]
    unit: str | None = None  # of the range; None: as printed, else centimetres
    no_echo: tuple[float, ...] = ()  # in that unit; 0 and negative numbers always mean no echo
    board: str = ""  # name of the board profile of the usual sensor
    prints_angle: bool = True


PRESETS = {
    "arduino-radar": Preset("90,23.", lambda unit: pattern_format(_RADAR, unit, _RADAR_ENDS), "cm", board="hc-sr04"),
    "angle-distance": Preset(
        "Angle: 90 Distance: 23 cm", lambda unit: pattern_format(_ANGLE_DISTANCE, unit), board="hc-sr04"
    ),
    "maxbotix": Preset(
        "R0123", lambda unit: pattern_format(_MAXBOTIX, unit), "mm", (5000.0, 9999.0), prints_angle=False
    ),
    "jsonl": Preset('{"heading_deg": 90, "range_cm": 23}', json_format),
    "csv": Preset("heading_deg,range_cm, then 90,23", csv_format),
}


def preset_format(preset: Preset, unit: str | None = None, no_echo: tuple[float, ...] | None = None) -> LineFormat:
    """Return the format of a preset, with another unit or other numbers for no echo if given."""
    scale = UNITS.get(unit or preset.unit or "")
    return preset.make(RangeUnit(scale, preset.no_echo if no_echo is None else no_echo))
