"""`sonarhw compare`: JSON with every reading, warnings, and scans from coordinates."""

import json
import math
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log

ROOM = "rooms/simple.toml"


@pytest.fixture
def log(tmp_path: Path) -> str:
    rows = ["deg,m", *(f"{deg},{0.827 if deg == 270 else 0.657}" for deg in (90, 180, 270)), "300,"]
    (tmp_path / "scan.csv").write_text("\n".join(rows) + "\n")
    out = str(tmp_path / "scan.mcap")
    assert run(["import", str(tmp_path / "scan.csv"), "--out", out, "--heading", "deg", "--range", "m"]) == 0
    return out


def compared(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict[str, object]:
    capsys.readouterr()
    assert run(["compare", *arguments, "--room", ROOM, "--place", "figure9", "--board", "paper", "--json"]) == 0
    answer: dict[str, object] = json.loads(capsys.readouterr().out)
    return answer


def test_json_with_explain_adds_every_reading_to_the_summary(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    figures, explained = compared(capsys, log), compared(capsys, log, "--explain")
    assert explained == figures | {key: explained[key] for key in ("echoes", "readings", "regions")}
    readings = explained["readings"]
    assert isinstance(readings, list)
    assert [reading["class"] for reading in readings][::2] == ["match", "match"]
    false_wall = readings[2]
    assert false_wall["echoes"][0]["via"] == ["bottom", "top", "bottom"]
    assert false_wall["margin_db"] > 0
    assert false_wall["threshold_change_db"] == 0
    assert false_wall["explanation"].startswith("0.827 m at 270.0°: three reflections, bottom, top, bottom")
    assert readings[3]["echoes"] == []
    assert [reading["note"] for reading in readings] == [None] * 4


def test_notes_beside_the_log_are_printed_and_those_of_another_log_are_a_warning(
    log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = ("sweep,reading,heading_deg,range_m,note", "1,2,270,0.827,false wall", "1,9,5,1.5,gone")
    (tmp_path / "scan.notes.csv").write_text("\n".join(lines))
    assert compared(capsys, log, "--explain")["readings"][2]["note"] == "false wall"  # type: ignore[index]
    assert run(["compare", log, "--room", ROOM, "--place", "figure9", "--board", "paper"]) == 0
    printed = capsys.readouterr()
    at = next(k for k, line in enumerate(printed.out.splitlines()) if "0.827 m at 270.0°" in line)
    assert printed.out.splitlines()[at + 1].split() == ["note:", "false", "wall"]
    assert "scan.notes.csv: 1 note belongs to a reading that scan.mcap does not contain" in printed.err
    page = tmp_path / "report.html"
    assert run(["report", log, "--room", ROOM, "--place", "figure9", "--board", "paper", "--out", str(page)]) == 0
    text = page.read_text()
    assert "<td>2</td><td>270.0</td><td>0.827</td><td>false wall</td>" in text
    assert "; note: false wall</td>" in text


def test_explain_without_json_is_refused(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(["compare", log, "--room", ROOM, "--place", "figure9", "--explain"]) == 2
    assert capsys.readouterr().err.startswith("sonarhw: --explain: needs --json")


HERE = ("--place", "figure9")


@pytest.mark.parametrize(
    "command", [("compare", *HERE), ("map", *HERE), ("fit", *HERE, "--free", "heading", "--samples", "0")]
)
def test_a_log_without_a_board_gives_a_warning(
    log: str, command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    name, *options = command
    warning = f"sonarhw: warning: {log}: names no board, polaroid-6500 is assumed; give the right board\n"
    capsys.readouterr()
    assert run([name, log, "--room", ROOM, *options]) == 0
    assert capsys.readouterr().err.startswith(warning)


@pytest.mark.parametrize("command", [("compare",), ("map",), ("fit", "--free", "heading", "--samples", "0")])
def test_a_place_outside_the_room_gives_a_warning_and_a_given_board_none(
    log: str, command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    name, *options = command
    capsys.readouterr()
    assert run([name, log, "--room", ROOM, "--board", "paper", "--place", "4,4", *options]) == 0
    warning = "sonarhw: warning: place '4,4' at 4, 4 m is outside room 'Simple room'\n"
    printed = capsys.readouterr().err
    assert printed.count(warning) == 1
    assert "names no board" not in printed


def test_a_scan_from_coordinates_is_compared_with_the_prediction_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan, page = str(tmp_path / "scan.mcap"), tmp_path / "scan.html"
    assert run(["simulate", ROOM, "--place", "0.5,0.4", "--step", "30", "--out", scan]) == 0
    capsys.readouterr()
    assert run(["compare", scan, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["classes"]["match"] == 12
    assert (figures["x_m"], figures["y_m"]) == (0.5, 0.4)
    assert run(["report", scan, "--out", str(page)]) == 0
    assert "0.5,0.4" in page.read_text()


def test_fit_states_its_grid_what_fit_adds_and_a_value_at_the_edge(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = str(tmp_path / "scan.mcap")
    assert run(["simulate", ROOM, "--place", "0.5,0.4", "--board", "hc-sr04", "--step", "30", "--out", scan]) == 0
    near, far = ["compare", scan, "--place", "0.51,0.4"], ["compare", scan, "--place", "0.56,0.4"]
    assert run([*near, "--fit", "position"]) == 0
    printed = capsys.readouterr().out
    assert "most readings within 5 cm: position within 3 cm in steps of 1 cm\n" in printed
    assert "`sonarhw fit` searches between these steps and farther, and adds credible intervals" in printed
    assert "edge of the grid" not in printed
    assert run([*far, "--fit", "position,heading"]) == 0
    printed = capsys.readouterr()
    assert "sonarhw: warning: position at the edge of the grid; a better fit may lie beyond\n" in printed.err
    assert "warning" not in printed.out
    assert run([*far, "--fit", "position", "--json"]) == 0
    fitted = json.loads(capsys.readouterr().out)["fit"]
    assert fitted == {"free": ["position"], "search": "position within 3 cm in steps of 1 cm", "at_edge": ["position"]}
    assert run([*far, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["fit"] is None


def test_report_fits_like_compare_and_shows_the_temperature_of_the_ranges(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan, page = str(tmp_path / "scan.mcap"), tmp_path / "scan.html"
    url = f"fake:{ROOM}?place=figure9&pace=max"
    order = ["--step", "10", "--temperature", "31", "--room", ROOM, "--place", "figure9"]
    assert run(["scan", url, *order, "--out", scan]) == 0
    fit = ["--fit", "heading,offset"]
    capsys.readouterr()
    assert run(["compare", scan, *fit, "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert run(["report", scan, *fit, "--out", str(page)]) == 0
    text = page.read_text()
    assert f"{figures['within_5cm']:.0%} of {figures['n_echo']} echoes" in text
    assert f"<td>{figures['offset_m'] * 1000:+.1f} mm</td>" in text
    assert "heading in steps of 0.5°; offset within 60 mm in steps of 5 mm" in text
    assert "<td>temperature for this speed</td><td>31.0 °C</td>" in text
    # the thermometer of the fake scanner, about the 20 °C of the room
    (measured,) = {round(one.temperature_c or math.nan, 1) for one in read_log(scan).readings}
    assert f"<td>thermometer</td><td>{measured:.1f} °C</td>" in text
    assert run(["report", scan, "--fit", "colour", "--out", str(page), "--force"]) == 2
    assert "fit colour: unknown" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", [["--place", "1.6,1.2"], ["--room", "rooms/laboratory.toml", "--place", "bench"]])
def test_a_wrong_room_or_place_gives_a_warning(
    wrong: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan, page = str(tmp_path / "scan.mcap"), tmp_path / "scan.html"
    assert run(["simulate", "rooms/arena.toml", "--place", "p3", "--out", scan]) == 0
    capsys.readouterr()
    assert run(["compare", scan]) == 0
    assert capsys.readouterr().err == ""
    warning = f"sonarhw: warning: {scan}: only "
    assert run(["compare", scan, *wrong]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith(warning)
    assert "check the room, the place and the board; `sonarhw locate` finds an unknown place" in printed.err
    assert "warning" not in printed.out
    assert run(["report", scan, *wrong, "--out", str(page)]) == 0
    assert capsys.readouterr().err.startswith(warning)
    assert "<strong>Warning:</strong> scan.mcap: only " in page.read_text()


def test_probabilities_are_scored_in_text_and_json(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    figures = compared(capsys, log)
    assert figures["pings"] == 1
    assert figures["room_tolerance_m"] == 0.005
    log_score = figures["log_score"]
    assert isinstance(log_score, float)
    bins = figures["calibration"]
    assert isinstance(bins, list)
    assert sum(one["n"] for one in bins) == figures["n"]
    capsys.readouterr()
    assert run(["compare", log, "--room", ROOM, "--place", "figure9", "--board", "paper", "--pings", "5"]) == 0
    out = capsys.readouterr().out
    assert "\nlog score -" in out
    assert "the median of 5 pings" in out
    assert run(["compare", log, "--room", ROOM, "--place", "figure9", "--pings", "4"]) == 2
    assert "--pings 4: expected an odd number" in capsys.readouterr().err


def test_the_picture_is_shaded_if_the_profile_has_a_spread(
    log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    paper = Path("sim/sonarhw_sim/board/shipped/paper.toml").read_text()
    mine = tmp_path / "mine.toml"
    pictures = {}
    for spread in ("", "threshold_sd_db = 3.0\n"):
        mine.write_text(paper + spread)
        plot = tmp_path / "plot.svg"
        command = ["compare", log, "--room", ROOM, "--place", "figure9", "--board", str(mine), "--json"]
        assert run([*command, "--plot", str(plot), "--force"]) == 0
        pictures[spread] = plot.read_text()
        assert run([*command, "--model", "cone", "--plot", str(plot), "--force"]) == 0
        assert "<!-- probability of a range -->" not in plot.read_text()
    assert [picture.count("<!-- probability of a range -->") for picture in pictures.values()] == [0, 1]
