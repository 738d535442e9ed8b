"""Details of a comparison for JSON: each reading with its echoes, margins and explanation, and the regions.

Lengths are in metres, angles in degrees and levels in dB; missing values are None.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from sonarhw_sim.predict.predicted_scan import Echo, PredictedScan

from sonarhw_compare.explain.contest import Step, change_for, contest, wall_change
from sonarhw_compare.explain.sentences import explain_reading
from sonarhw_compare.headings import in_degrees
from sonarhw_compare.matching.assign import assigned_echoes, echo_statistics
from sonarhw_compare.matching.match import Comparison, Kind
from sonarhw_compare.matching.region_match import RegionPair, compare_regions
from sonarhw_compare.matching.regions import Region

Details = dict[str, Any]


def details(comparison: Comparison, notes: Mapping[int, str] | None = None) -> Details:
    """Return what `compare --json --explain` adds to the summary. `notes`: by the place of their reading, from 0."""
    texts = notes or {}
    return {
        "echoes": asdict(echo_statistics(comparison)),
        "readings": [
            reading_details(comparison, index) | {"note": texts.get(index)} for index in range(len(comparison.rows))
        ],
        "regions": region_details(comparison),
    }


def reading_details(comparison: Comparison, index: int) -> Details:
    """Return one reading: measured and predicted echoes, path, margins and the echoes that might win instead."""
    row, prediction = comparison.rows[index], comparison.prediction
    margins, moved = contest(prediction, row.index), wall_change(prediction, row.index)
    own_body = row.kind is Kind.OWN_BODY
    return {
        "turntable_deg": _degrees(row.reading.angle),
        "heading_deg": in_degrees(row.heading),
        "measured_m": row.measured,
        "predicted_m": row.predicted,
        "class": row.kind.value,
        "explanation": explain_reading(comparison, index),
        "echoes": [
            {
                "measured_m": echo.measured,
                "predicted_m": echo.predicted,
                "level_db": echo.level_db,
                "via": _via(prediction, echo.path),
            }
            for echo in (() if own_body else assigned_echoes(comparison, index))
        ],
        "margin_db": margins.margin_db,
        "next": _echo(prediction, margins.next),
        "next_behind_m": margins.behind,
        "wall_change": None
        if moved is None
        else {"wall": moved.wall, "nearer_m": moved.nearer, "to": _echo(prediction, moved.echo)},
        "with_higher_threshold": _echo(prediction, margins.louder),
        "with_lower_threshold": _echo(prediction, margins.fainter),
        "lacking_db": margins.lacking_db,
        "threshold_change_db": None if own_body else change_for(prediction, row.index, row.measured),
    }


def region_details(comparison: Comparison) -> Details:
    """Return the regions of constant depth of both scans, pairs first."""
    found = compare_regions(comparison)
    return {
        "pairs": [_pair(pair) for pair in found.pairs],
        "parts": [_pair(pair) for pair in found.parts],
        "only_measured": [_region(region) for region in found.only_measured],
        "only_predicted": [_region(region) for region in found.only_predicted],
    }


def _pair(pair: RegionPair) -> Details:
    return {
        "measured": _region(pair.measured),
        "predicted": _region(pair.predicted),
        "farther_m": pair.farther,
        "turned_deg": _degrees(pair.turned),
        "wider_deg": _degrees(pair.wider),
    }


def _region(region: Region) -> Details:
    return {
        "range_m": region.range,
        "bearing_deg": in_degrees(region.bearing),
        "width_deg": _degrees(region.width),
        "readings": len(region),
    }


def _echo(prediction: PredictedScan, echo: Step | Echo | None) -> Details | None:
    if echo is None:
        return None
    return {"range_m": echo.range, "level_db": echo.level_db, "via": _via(prediction, echo.path)}


def _via(prediction: PredictedScan, path: int | None) -> list[str] | None:
    return None if path is None else list(prediction.paths.via(path, prediction.room))


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 9)
