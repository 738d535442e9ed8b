"""The report is one complete file with the sentences and figures of the comparison."""

import json
import math
import os
import re
import subprocess
import sys
from base64 import b64decode
from collections.abc import Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import pytest
from sonarhw_cli.app import run
from sonarhw_compare.explain import explain_reading, region_details
from sonarhw_compare.report import Report, regions_table, report_html, report_of
from sonarhw_compare.scans import GivenScan
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import load_room, parse_room

from sonarhw.log import read_log
from sonarhw.readings import Reading

PICTURE = re.compile(r'src="data:image/([a-z]+)[^;]*;base64,([^"]+)"')


class Page(HTMLParser):
    """Cells of tables by row, external URLs, and tags that are not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.external: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag not in ("img", "meta"):
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        external = [value or "" for name, value in attributes if name in ("src", "href")]
        self.external += [value for value in external if not value.startswith("data:")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a predicted scan with traces of the simple room at figure 9."""
    out = tmp_path_factory.mktemp("report") / "scan.mcap"
    order = ["--place", "figure9", "--board", "paper", "--step", "10", "--traces", "envelope"]
    assert run(["simulate", "rooms/simple.toml", *order, "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def report(log: Path) -> Report:
    """Return a report on a place that is off by 2 cm: only some readings match."""
    room = load_room("rooms/simple.toml")
    place = replace(room.place("figure9"), position=(0.754, 0.085))
    options = PredictionOptions()
    scan = GivenScan(log.name, read_log(log).readings, read_log(log))
    return report_of(scan, room, place, load_board("paper"), options)


def test_the_report_on_a_log_is_the_same_file_each_time(log: Path, tmp_path: Path) -> None:
    here, there = tmp_path / "here.html", tmp_path / "there.html"
    assert run(["report", str(log), "--out", str(here)]) == 0
    command = [sys.executable, "-c", "from sonarhw_cli.entry import main; main()", "report", log, "--out", there]
    # another order of sets than in this process
    subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": "1"})
    assert here.read_bytes() == there.read_bytes()


def test_a_page_is_complete_and_every_reading_has_its_row_class_and_sentence(report: Report) -> None:
    page = Page(report_html(report))
    assert (page.open, page.external, "url(" in report_html(report)) == ([], [], False)
    rows = [row for row in page.rows if len(row) == 7][1:]
    comparison = report.comparison
    assert len(rows) == 36
    assert len({row[5] for row in rows}) > 1
    for cells, row in zip(rows, comparison.rows, strict=True):
        assert cells[1] == f"{math.degrees(row.heading) % 360:.1f}"
        assert cells[5] == row.kind.value.replace("_", " ")
        assert cells[6] == explain_reading(comparison, row.index)


def region_rows(report: Report) -> list[list[str]]:
    return Page("".join(regions_table(report.comparison))).rows[1:]


def of_readings(report: Report, readings: Sequence[Reading], name: str = "x", **changes: object) -> Report:
    """Return a report of other readings at the same place, or with another room, place or board."""
    scene = report.comparison.prediction
    parts = {"room": scene.room, "place": scene.place, "board": scene.board} | changes
    return report_of(GivenScan(name, tuple(readings)), **parts, options=PredictionOptions())  # type: ignore[arg-type]


def test_measured_regions_are_listed_beside_predicted_ones(report: Report, log: Path) -> None:
    assert [row for row in Page(report_html(report)).rows if len(row) == 6][1:] == region_rows(report)
    readings = [
        replace(one, echo_times=(0.002,)) if 95 < math.degrees(one.angle) < 145 else one
        for one in read_log(log).readings  # an object that the room lacks, at 0.34 m
    ]
    with_object = of_readings(report, readings)
    listed = region_rows(with_object)
    found = region_details(with_object.comparison)
    assert found["pairs"]
    assert found["only_measured"]
    for pair in found["pairs"]:
        row = next(row for row in listed if row[0] == span(pair["measured"]) and row[1] == metres(pair["measured"]))
        assert row[2:4] == [span(pair["predicted"]), metres(pair["predicted"])]
        assert float(row[4]) == round(pair["farther_m"] * 1000)
        assert row[5].startswith("in both: ")
    alone = [row for row in listed if row[5] == "only in the scan"]
    assert [row[:2] for row in alone] == [[span(one), metres(one)] for one in found["only_measured"]]
    assert all(row[2:5] == ["", "", ""] for row in alone)
    assert len(listed) == sum(map(len, found.values()))
    none = "".join(regions_table(of_readings(report, read_log(log).readings[:1]).comparison))
    assert ("0 in both, 0 only in the scan, 0 only predicted" in none, "<table" in none) == (True, False)


def span(region: dict[str, float]) -> str:
    first, last = (region["bearing_deg"] + side * region["width_deg"] / 2 for side in (-1, 1))
    return f"{round(first, 1) % 360:.1f} to {round(last, 1) % 360:.1f}"


def metres(region: dict[str, float]) -> str:
    return f"{region['range_m']:.3f}"


def test_pictures_have_valid_formats_and_a_scan_without_traces_has_no_bscan(report: Report, log: Path) -> None:
    text = report_html(report)
    kinds = [kind for kind, _ in PICTURE.findall(text)]
    assert kinds == ["svg", "svg", "png"]
    for kind, content in PICTURE.findall(text):
        if kind == "svg":
            assert ElementTree.fromstring(b64decode(content)).tag.endswith("svg")
        else:
            assert b64decode(content).startswith(b"\x89PNG")
    without = of_readings(report, [replace(reading, trace=None) for reading in read_log(log).readings])
    assert [kind for kind, _ in PICTURE.findall(report_html(without))] == ["svg", "svg"]


def test_names_from_files_are_escaped(report: Report, log: Path) -> None:
    text = report.comparison.prediction.room.text.replace('name = "Simple room"', 'name = "<script>alert(1)</script>"')
    page = report_html(of_readings(report, read_log(log).readings, "<b>.mcap", room=parse_room(text, "room")))
    assert "<script>" not in page
    assert "<b>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;, at 0.754, 0.085 m, step 0 at " in page


def test_the_report_has_the_figures_of_compare(log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scan.html"
    assert run(["report", str(log), "--place", "0.754,0.085", "--out", str(out)]) == 0
    assert run(["compare", str(log), "--place", "0.754,0.085", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    listed = {row[0]: row[1] for row in Page(out.read_text()).rows if len(row) == 2}
    assert listed["match"] == str(figures["matched"])
    assert listed["within 5 cm of the prediction"] == f"{figures['within_5cm']:.1%}"
    assert listed["median error"] == f"{figures['median_abs_error_m'] * 1000:.1f} mm"
    assert listed["device"].startswith("sonarhw simulate")
    before = out.read_bytes()
    assert run(["report", str(log), "--place", "figure9", "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert out.read_bytes() == before
    assert run(["report", str(log), "--place", "figure9", "--out", str(out), "--force"]) == 0
    assert "0.827 m at 270.0°: three reflections, bottom, top, bottom" in out.read_text()
    assert run(["report", str(log), "--out", str(tmp_path / "scan.pdf")]) == 2
