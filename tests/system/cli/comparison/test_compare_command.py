"""`sonarhw compare`: JSON with every reading, warnings, and scans from coordinates."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run

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
    warning = f"sonarhw: warning: {log}: names no board, polaroid-6500 is assumed; give the right one with --board\n"
    capsys.readouterr()
    assert run([name, log, "--room", ROOM, *options]) == 0
    assert capsys.readouterr().err == warning
    assert run([name, log, "--room", ROOM, *options, "--board", "paper"]) == 0
    assert capsys.readouterr().err == ""


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
