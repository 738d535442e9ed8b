"""Names in files, logs, devices and arguments may contain anything. A terminal or spreadsheet never gets it raw."""

import csv
import io
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.board.profile import load_board

from sonarhw import link as ports
from sonarhw.host import scanner
from sonarhw.log.writer import write_scan
from tests.fixtures.example_logs import METADATA, example_reading

EVIL = "\x1b]0;owned\x07\x9b2J\nsonarhw: done \u202e$\\frac$ <b>x</b>"
IN_TOML = json.dumps(EVIL)  # also a valid TOML string
NOT_UTF8 = os.fsdecode(b"no\xffsuch")


def room(folder: Path) -> Path:
    """Write a room with hostile names."""
    path = folder / "room.toml"
    path.write_text(
        f"name = {IN_TOML}\n[materials.m]\nreflectance = 0.9\n"
        '[[walls]]\nname = "=cmd()\\u001b"\nmaterial = "m"\nclosed = true\n'
        "points = [[0, 0], [1, 0], [1, 0.8], [0, 0.8]]\n"
        f"[places.{IN_TOML}]\nposition = [0.3, 0.4]\n[places.there]\nposition = [5.1, 0.4]\n"
    )
    return path


def log(folder: Path) -> Path:
    """Write a log with hostile names."""
    path = folder / "scan.mcap"
    metadata = replace(METADATA, room_file=EVIL, room_text="", place=EVIL, board=EVIL, made_by=EVIL)
    write_scan(path, metadata, [example_reading(number) for number in range(4)])
    return path


def board(folder: Path) -> Path:
    """Write a board profile with a hostile name."""
    path = folder / "board.toml"
    profile = load_board("paper")
    path.write_text(profile.text.replace(f'name = "{profile.name}"', f"name = {IN_TOML}"))
    return path


def printed(capsys: pytest.CaptureFixture[str], *arguments: object, status: int = 0) -> str:
    """Run a command, and return what it printed, which must be harmless."""
    capsys.readouterr()
    assert run([*map(str, arguments)]) == status
    output, error = capsys.readouterr()
    assert_harmless(output + error)
    if status:
        assert error.count("\n") == 1
        assert len(error) <= 1001
    return output + error


def assert_harmless(text: str) -> None:
    assert {character for character in text if not character.isprintable()} <= {"\n"}
    assert not [line for line in text.splitlines() if line.startswith("sonarhw: done")]


@pytest.mark.parametrize(
    "arguments",
    [
        (EVIL,),
        ("profile", NOT_UTF8, "list"),
        ("log", "info", EVIL),
        ("log", "info", NOT_UTF8),
        ("simulate", NOT_UTF8),
        ("simulate", "room.toml", "--step", EVIL),
        ("simulate", "room.toml", "--model", EVIL),
        ("simulate", "room.toml", f"--{EVIL}"),
        ("scan", EVIL, "--out", "x.csv"),
        ("info", f"fake:{EVIL}?{EVIL}"),
        ("simulate", "room.toml", "--place", EVIL + 5000 * "x"),
        ("simulate", "room.toml", "--receiver", 5000 * "x\x1b"),
    ],
    ids=lambda arguments: repr(arguments)[:50],
)
def test_arguments(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]) -> None:
    assert "sonarhw: " in printed(capsys, *arguments, status=2)


def test_a_room(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = printed(capsys, "simulate", room(tmp_path), "--place", EVIL, "--step", 90)
    assert r"'=cmd()\x1b[" in shown  # a cell of CSV
    assert printed(capsys, "simulate", room(tmp_path), "--place", "there", "--step", 90)
    assert r"\x1b]0;owned" in printed(capsys, "simulate", room(tmp_path), "--place", "nowhere", status=2)
    printed(capsys, "paths", room(tmp_path), "--place", EVIL)
    printed(capsys, "simulate", room(tmp_path), "--place", EVIL, "--step", 90, "--out", tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 1000


def test_cells_of_a_written_csv(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    assert run(["simulate", str(room(tmp_path)), "--place", EVIL, "--step", "90", "--out", str(out)]) == 0
    cells = [row["via"] for row in csv.DictReader(io.StringIO(out.read_text()))]
    assert cells[0].startswith(r"'=cmd()\x1b[")


def test_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert r"\x1b]0;owned" in printed(capsys, "log", "info", log(tmp_path))
    printed(capsys, "compare", tmp_path / "scan.mcap", status=2)
    printed(capsys, "compare", tmp_path / "scan.mcap", "--room", room(tmp_path), "--board", "paper", "--place", EVIL)


def test_a_report_shows_names_as_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "report.html"
    rest = ("--room", room(tmp_path), "--board", "paper", "--place", EVIL, "--out", out)
    printed(capsys, "report", log(tmp_path), *rest)
    page = out.read_text(encoding="utf-8")
    assert "&lt;b&gt;x&lt;/b&gt;" in page
    assert "<b>x</b>" not in page


def test_files_whose_names_are_not_utf_8(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, scan, again = (tmp_path / os.fsdecode(b"\xff" + suffix) for suffix in (b".toml", b".mcap", b"2.mcap"))
    room(tmp_path).rename(file)
    printed(capsys, "simulate", file, "--place", EVIL, "--step", 90, "--out", scan)
    assert r"room      \udcff.toml" in printed(capsys, "log", "info", scan)
    printed(capsys, "log", "recover", scan, "--out", again)
    printed(capsys, "report", scan, "--out", tmp_path / "report.html")
    assert r"\udcff.mcap" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_a_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    url = f"fake:{room(tmp_path)}?place=there&board={board(tmp_path)}&pace=max"
    assert r"\x1b]0;owned" in printed(capsys, "info", url)


def test_a_port(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports, "serial_ports", lambda: [ports.Port("/dev/ttyUSB0", EVIL)])
    monkeypatch.setattr(scanner, "probe_port", lambda _: (False, EVIL))
    assert r"\x1b]0;owned" in printed(capsys, "ports", "--ask")


def test_an_import(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scan\x1b[2J.csv"
    path.write_text('deg,"\x1b[2Jm"\n0,"\x1b[2J"\n')
    columns = ("--heading", "deg", "--range", "\x1b[2Jm")
    assert r"\x1b[2J" in printed(capsys, "import", path, *columns, "--out", tmp_path / "out.mcap", status=2)


def test_a_terminal_with_few_characters_gets_escapes(tmp_path: Path) -> None:
    command = [sys.executable, "-c", "from sonarhw_cli.entry import main; main()", "log", "info", str(log(tmp_path))]
    environment = os.environ | {"PYTHONIOENCODING": "iso8859-5"}
    done = subprocess.run(command, env=environment, capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")
    assert rb"0\xb0 to 15\xb0" in done.stdout
