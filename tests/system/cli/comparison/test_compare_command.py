"""`sonarhw compare` and `report`: JSON with every reading, two scans, a missing plate, pictures, origins."""

import csv
import math
import re
from base64 import b64decode
from pathlib import Path
from statistics import median

import pytest
from sonarhw_sim.room.room import load_room

from sonarhw.log import read_log
from sonarhw.readings import Origin
from tests.fixtures.commands import SIMPLE_ROOM, printed, printed_json
from tests.fixtures.rooms_for_tests import write_yard

IN_ROOM = ("--room", SIMPLE_ROOM, "--place", "figure9")
FAKE = "fake:kuc_siegel?place=figure6&pace=max"  # quick, because its room has few paths
PICTURE = re.compile(r'src="data:image/svg[^;]*;base64,([^"]+)"')
POST = '[[posts]]\nname = "chair"\ncenter = [0.3, 0.4]\nradius = 0.03\nmaterial = "shelving"\n'


def imported(folder: Path, rows: list[str]) -> Path:
    table, log = folder / "scan.csv", folder / "scan.mcap"
    table.write_text("\n".join(["deg,m", *rows]) + "\n")
    printed("import", table, "--out", log, "--heading", "deg", "--range", "m")
    return log


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return imported(tmp_path, ["90,0.657", "180,0.657", "270,0.827", "300,"])


def test_json_with_explain_adds_every_reading_to_the_summary(log: Path) -> None:
    command = ("compare", log, *IN_ROOM, "--board", "paper")
    figures, explained = printed_json(*command), printed_json(*command, "--explain")
    assert explained == figures | {key: explained[key] for key in ("echoes", "readings", "regions")}
    assert sum(one["n"] for one in figures["calibration"]) == figures["n"]
    readings = explained["readings"]
    assert [reading["class"] for reading in readings][::2] == ["match", "match"]
    false_wall = readings[2]
    assert false_wall["echoes"][0]["via"] == ["bottom", "top", "bottom"]
    assert false_wall["margin_db"] > 0
    assert false_wall["threshold_change_db"] == 0
    assert false_wall["explanation"].startswith("0.827 m at 270.0°: three reflections, bottom, top, bottom")
    assert readings[3]["echoes"] == []
    assert [reading["note"] for reading in readings] == [None] * 4


def test_report_fits_like_compare_and_shows_the_temperature_of_the_ranges(tmp_path: Path) -> None:
    scan, page = tmp_path / "scan.mcap", tmp_path / "scan.html"
    printed("scan", FAKE, "--step", "10", "--temperature", "31", *IN_ROOM, "--out", scan)
    fit = ("--fit", "heading,offset")
    figures = printed_json("compare", scan, *fit)
    printed("report", scan, *fit, "--out", page)
    text = page.read_text()
    assert f"{figures['within_5cm']:.0%} of {figures['n_echo']} echoes" in text
    assert f"<td>{figures['offset_m'] * 1000:+.1f} mm</td>" in text
    assert "heading in steps of 0.5°; offset within 60 mm in steps of 5 mm" in text
    assert "<td>temperature for this speed</td><td>31.0 °C</td>" in text
    # the thermometer of the fake scanner, about the 20 °C of the room
    (measured,) = {round(one.temperature_c or math.nan, 1) for one in read_log(scan).readings}
    assert f"<td>thermometer</td><td>{measured:.1f} °C</td>" in text


def test_a_post_is_nearer_than_what_was_behind_it(tmp_path: Path) -> None:
    (tmp_path / "with_post.toml").write_text(SIMPLE_ROOM.read_text() + POST)
    before, after, table = (tmp_path / name for name in ("before.mcap", "after.mcap", "differences.csv"))
    for room, out in ((SIMPLE_ROOM, before), (tmp_path / "with_post.toml", after)):
        printed("simulate", room, "--place", "figure9", "--step", "5", "--out", out)
    text = printed("compare", before, "--with", after, "--csv", table, "--plot", tmp_path / "differences.png")
    # the nearest point of the post is at 0.54 m and 146°
    rows = list(csv.DictReader(table.read_text().splitlines()))
    changed = [row for row in rows if 140 <= float(row["heading_deg"]) <= 165]
    first, second = (sorted(float(row[which]) for row in changed) for which in ("first_m", "second_m"))
    by = median(abs(float(row["difference_m"])) for row in changed)
    assert (
        f"140.0° to 165.0°: 6 headings nearer by {100 * by:.1f} cm (median): "
        f"first {first[0]:.3f} to {first[-1]:.3f} m, second {second[0]:.3f} to {second[-1]:.3f} m\n"
    ) in text
    (at_post,) = [row for row in rows if row["heading_deg"] == "145"]
    assert (at_post["change"], float(at_post["second_m"])) == ("nearer", pytest.approx(0.54, abs=0.02))
    assert float(at_post["difference_m"]) == pytest.approx(float(at_post["second_m"]) - float(at_post["first_m"]))
    assert (tmp_path / "differences.png").read_bytes().startswith(b"\x89PNG")


def test_the_changed_room_contains_the_plate(tmp_path: Path) -> None:
    log, out, plot = write_yard(tmp_path), tmp_path / "found.toml", tmp_path / "found.svg"
    files = ("--out", out, "--plot", plot)
    figures = printed_json("compare", log, "--room", tmp_path / "yard.toml", "--find-missing", *files)
    found = load_room(out)
    # the point straight ahead is on the first wall; one place shows little of the length, so another one can follow
    assert found.names[4] == "wall 1"
    assert found.walls[4:, [0, 2]] == pytest.approx(0.8, abs=0.02)
    low, high = sorted(found.walls[4, [1, 3]])
    assert low < 1.1 < high
    assert 0.75 < found.walls[4:, [1, 3]].min() < found.walls[4:, [1, 3]].max() < 1.45
    assert figures["causes"][0]["kind"] == "NewWall"
    assert "<!-- found wall or post -->" in plot.read_text()
    assert figures["after"]["within_5cm"] > figures["within_5cm"]


@pytest.mark.parametrize("origin", [Origin.SIMULATED, Origin.FAKE, Origin.IMPORTED])
def test_readings_that_no_scanner_measured_are_not_called_measured(origin: Origin, tmp_path: Path) -> None:
    log, plot, page = tmp_path / "scan.mcap", tmp_path / "plot.svg", tmp_path / "scan.html"
    if origin is Origin.SIMULATED:
        printed("simulate", SIMPLE_ROOM, "--place", "figure9", "--step", "20", "--out", log)
    elif origin is Origin.FAKE:
        printed("scan", FAKE, *IN_ROOM, "--step", "20", "--out", log)
    else:
        imported(tmp_path, [f"{deg},0.7" for deg in range(0, 360, 20)])
    text = printed("compare", log, *IN_ROOM, "--plot", plot)
    assert f"18 {origin} readings" in text
    assert "only in the scan, " in text
    assert text.count(origin) == 1  # in the summary
    assert printed_json("compare", log, *IN_ROOM)["origin"] == origin
    printed("report", log, *IN_ROOM, "--out", page)
    assert "<th>scan (m)</th>" in page.read_text()
    # matplotlib writes each text of a picture as a comment
    pictures = [b64decode(picture).decode() for picture in PICTURE.findall(page.read_text())]
    assert [f"<!-- {origin} readings -->" in picture for picture in pictures] == [True, True]
    assert f"<!-- {origin} -->" in plot.read_text()
    assert not any("measured" in shown for shown in (text, plot.read_text(), page.read_text(), *pictures))
