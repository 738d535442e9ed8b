"""The table of regions of constant depth in a report, measured beside predicted."""

import math
from collections.abc import Iterator
from html import escape

from sonarhw_compare.explain.region_words import path_suffix, region_counts
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.matching.match import Comparison
from sonarhw_compare.matching.region_match import RegionMatch, compare_regions
from sonarhw_compare.matching.regions import LEAST_WIDTH, Region

_HEAD = ("scan at (°)", "scan (m)", "predicted at (°)", "predicted (m)", "difference (mm)", "found")


def regions_table(comparison: Comparison) -> Iterator[str]:
    """Yield lines of HTML: an explanation, the number of regions, and a row for each, counter-clockwise."""
    found = compare_regions(comparison)
    width = f"{math.degrees(LEAST_WIDTH):.0f}°"
    yield f"<p>Neighbouring headings with the same range over {width} or more: one echo, over the whole beam.</p>"
    yield f"<p>{region_counts(found)}.</p>"
    rows = list(_rows(comparison, found))
    if rows:
        yield '<table class="regions"><thead><tr>' + "".join(f"<th>{name}</th>" for name in _HEAD)
        yield "</tr></thead><tbody>"
        for cells in rows:
            yield "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
        yield "</tbody></table>"


def _rows(comparison: Comparison, found: RegionMatch) -> Iterator[tuple[str, ...]]:
    for measured, predicted in found.by_bearing():
        difference = "" if measured is None or predicted is None else millimetres(measured.range - predicted.range)
        if predicted is None:
            where = "only in the scan"
        else:
            where = f"{'only predicted' if measured is None else 'in both'}{path_suffix(comparison, predicted)}"
        yield *_depth(measured), *_depth(predicted), difference, where


def _depth(region: Region | None) -> tuple[str, str]:
    """Return the interval of headings and the range of a region, as text."""
    if region is None:
        return "", ""
    first, last = (in_degrees(region.bearing + side * region.width / 2, 1) for side in (-1, 1))
    return f"{first:.1f} to {last:.1f}", f"{region.range:.3f}"


def millimetres(length: float) -> str:
    """Return a difference (m) as text in millimetres: `+12`, `0`, `-3`."""
    whole = round(length * 1000)
    return f"{whole:+d}" if whole else "0"
