"""Readings as text and as arrays, as a spreadsheet and NumPy read them."""

import csv
import math
from dataclasses import dataclass, replace
from io import BytesIO, StringIO
from typing import Any, cast

import numpy as np

from sonarhw.export import write_csv
from sonarhw.npz import write_npz
from sonarhw.readings import Reading, Trace


@dataclass(frozen=True)
class Scan:
    began: float
    readings: tuple[Reading, ...]


@dataclass(frozen=True)
class TwoScans:
    scans: tuple[Scan, ...]


def reading(number: int, echoes: tuple[float, ...], warm: float | None, trace: Trace | None = None) -> Reading:
    """Return a reading at 10° a number, 0.1 s after the one before it, in the second sweep."""
    return Reading(number, 1, 2, math.radians(10 * number), 5.0 + 0.1 * number, echoes, 340.0, warm, trace=trace)


def arrays(*scans: Scan, notes: dict[int, str] | None = None) -> dict[str, Any]:
    file = BytesIO()
    write_npz(cast(Any, TwoScans(scans)), file, notes or {})
    file.seek(0)
    return dict(np.load(file))


def test_poses_are_columns_in_metres_and_degrees() -> None:
    placed = replace(reading(1, (0.01,), None), pose=(0.5, -2.0, math.radians(30)))
    scans = Scan(5.0, (reading(0, (), None), placed))
    found = arrays(scans)
    np.testing.assert_allclose([found[k][1] for k in ("x_m", "y_m", "yaw_deg")], [0.5, -2.0, 30.0])
    assert np.isnan(found["x_m"][0])
    file = BytesIO()
    write_csv(cast(Any, TwoScans((scans,))), file, {0: "far"})
    rows = [*csv.DictReader(StringIO(file.getvalue().decode()))]
    assert [row["x_m"] for row in rows] == ["", "0.5"]
    assert float(rows[1]["yaw_deg"]) == 30.0
    assert [row["note"] for row in rows] == ["far", ""]


def test_traces_of_different_lengths_are_padded() -> None:
    short = Trace(np.array([0.25, 0.5]), 50_000.0, 0.001)
    long = Trace(np.array([0.0, 0.5, 1.0]), 40_000.0, 0.002)
    found = arrays(Scan(5.0, (reading(0, (), None, short), reading(1, (), None), reading(2, (), None, long))))
    nan = math.nan
    np.testing.assert_array_equal(found["traces"], np.array([[0.25, 0.5, nan], [nan, nan, nan], [0, 0.5, 1]], "<f4"))
    assert found["traces"].dtype == np.float32
    np.testing.assert_array_equal(found["trace_rate_hz"], [50_000, nan, 40_000])
    np.testing.assert_array_equal(found["trace_start_s"], [0.001, nan, 0.002])


def test_a_log_without_readings_has_empty_columns() -> None:
    found = arrays()
    assert found["number"].shape == (0,)
    assert found["echoes_s"].shape == (0, 0)
    assert found["range_m"].dtype == np.float64


def test_notes_are_text_in_the_row_of_their_reading() -> None:
    first, second = Scan(4.0, (reading(0, (0.01,), None),)), Scan(5.0, (reading(3, (), None), reading(4, (), None)))
    assert arrays(first, second, notes={1: "a chair, Füße"})["notes"].tolist() == ["", "a chair, Füße", ""]
    assert "notes" not in arrays(first, second)


def exported(notes: dict[int, str]) -> str:
    heard = Reading(0, 0, 0, math.radians(30), 5.5, (0.01, 0.02), 340.0)
    silent = Reading(1, 0, 0, math.radians(-0.0), 5.75, (), 340.0)
    file = BytesIO()
    write_csv(cast(Any, TwoScans((Scan(5.0, (heard, silent)), Scan(5.5, (heard,))))), file, notes)
    return file.getvalue().decode()


def test_each_reading_is_a_line_with_its_time_in_the_scan() -> None:
    assert exported({}).splitlines() == [
        "time_s,heading_deg,range_m,echoes_s",
        "0.5,30,1.7,0.01;0.02",
        "0.75,0,,",
        "0,30,1.7,0.01;0.02",
    ]


def test_notes_are_a_last_column_as_a_spreadsheet_reads_it() -> None:
    notes = {1: 'silent, with "quotes"', 2: "=1+1"}
    rows = list(csv.DictReader(StringIO(exported(notes))))
    assert [row["note"] for row in rows] == ["", notes[1], "'=1+1"]
    assert [row["heading_deg"] for row in rows] == ["30", "0", "30"]
