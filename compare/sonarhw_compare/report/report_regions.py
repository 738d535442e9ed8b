"""The regions of constant depth in a report: a table, measured beside predicted.

Takes a comparison; hands on lines of HTML.
"""

import math
from collections.abc import Iterator
from html import escape

from sonarhw_compare.explain.region_words import heard_from, how_many
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.matching.match import Comparison
from sonarhw_compare.matching.region_match import RegionMatch, compare_regions
from sonarhw_compare.matching.regions import LEAST_WIDTH, Region

_HEAD = ("measured at (°)", "measured (m)", "predicted at (°)", "predicted (m)", "difference (mm)", "found")


def regions_table(comparison: Comparison) -> Iterator[str]:
    """What a region is, how many there are in both scans, and a row for each, counter-clockwise."""
    found = compare_regions(comparison)
    width = f"{math.degrees(LEAST_WIDTH):.0f}°"
    yield f"<p>Neighbouring headings that read one range over {width} or more: one echo, heard all over the beam.</p>"
    yield f"<p>{how_many(found)}.</p>"
    rows = list(_rows(comparison, found))
    if rows:
        yield '<table class="regions"><thead><tr>' + "".join(f"<th>{name}</th>" for name in _HEAD)
        yield "</tr></thead><tbody>"
        for cells in rows:
            yield "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
        yield "</tbody></table>"


def _rows(comparison: Comparison, found: RegionMatch) -> Iterator[tuple[str, ...]]:
    for measured, predicted in found.in_turn():
        difference = "" if measured is None or predicted is None else millimetres(measured.range - predicted.range)
        if predicted is None:
            where = "only measured"
        else:
            where = f"{'only predicted' if measured is None else 'in both'}{heard_from(comparison, predicted)}"
        yield *_depth(measured), *_depth(predicted), difference, where


def _depth(region: Region | None) -> tuple[str, str]:
    """From which heading to which, and at what range."""
    if region is None:
        return "", ""
    first, last = (in_degrees(region.bearing + side * region.width / 2, 1) for side in (-1, 1))
    return f"{first:.1f} to {last:.1f}", f"{region.range:.3f}"


def millimetres(length: float) -> str:
    """A difference (m) as a table has it: `+12`, `0`, `-3`."""
    whole = round(length * 1000)
    return f"{whole:+d}" if whole else "0"
