"""CSV files: one line per reading; a spreadsheet must not take a name for a formula."""

import csv
import math
from io import BytesIO, StringIO
from types import SimpleNamespace
from typing import Any, cast

import pytest

from sonarhw.errors import text_cell
from sonarhw.export import write_csv
from sonarhw.readings import Reading


@pytest.mark.parametrize("formula", ["=1+1", "+1+1", "-2+3", "@SUM(A1)", '=HYPERLINK("http://x")', "＝1", "-"])
def test_a_name_that_is_a_formula_is_quoted(formula: str) -> None:
    assert text_cell(formula) == f"'{formula}"


@pytest.mark.parametrize("name", ["wall 1>post 2", "-1.5", "+3", "-1e-3", "", "a=b", "3-4"])
def test_numbers_and_other_names_are_unchanged(name: str) -> None:
    assert text_cell(name) == name


@pytest.mark.parametrize(("name", "cell"), [("\t=1", r"\t=1"), ("\r=1", r"\r=1"), ("a\x1b[2J", r"a\x1b[2J")])
def test_control_characters_are_escaped(name: str, cell: str) -> None:
    assert text_cell(name) == cell


def exported(notes: dict[int, str]) -> str:
    heard = Reading(0, 0, 0, math.radians(30), 5.5, (0.01, 0.02), 340.0)
    silent = Reading(1, 0, 0, math.radians(-0.0), 5.75, (), 340.0)
    scans = [SimpleNamespace(began=5.0, readings=[heard, silent]), SimpleNamespace(began=5.5, readings=[heard])]
    file = BytesIO()
    write_csv(cast(Any, SimpleNamespace(scans=scans)), file, notes)
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
