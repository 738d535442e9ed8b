"""Errors of the library get the names of options on the command line, and errors of usage say what to write."""

from pathlib import Path

import pytest
from sonarhw_cli.app import run

FLAT = """
name = "Flat"
[materials.board]
reflectance = 0.95
[[walls]]
name = "room"
points = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [0.0, 1.5]]
closed = true
material = "board"
[places.desk]
position = [0.5, 0.5]
[places.corner]
position = [1.5, 1.0]
"""
PLACES = "give --place NAME or --place X,Y in metres; its places: desk, corner"
FIND = "`sonarhw locate` finds an unknown place"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    """A working directory with a room of two places and a log of unknown room and place."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "flat.toml").write_text(FLAT)
    (tmp_path / "scan.csv").write_text("deg,m\n" + "".join(f"{deg},0.5\n" for deg in range(0, 360, 20)))
    command = ["import", "scan.csv", "--heading", "deg", "--range", "m", "--board", "paper", "--out", "scan.mcap"]
    assert run(command) == 0
    capsys.readouterr()
    return tmp_path


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("simulate flat.toml", f"room 'Flat': {PLACES}"),
        (
            "scan fake:flat.toml?place=desk --out u.mcap --room flat.toml",
            f"--room flat.toml: {PLACES}; from an unknown place, scan without --room, "
            "then run `sonarhw locate u.mcap --room flat.toml`",
        ),
        ("compare scan.mcap --room flat.toml", f"scan.mcap: contains no place in room 'Flat'; {PLACES}; {FIND}"),
        (
            "report scan.mcap --room flat.toml --out r.html",
            f"scan.mcap: contains no place in room 'Flat'; {PLACES}; {FIND}",
        ),
        ("compare scan.mcap", "scan.mcap: contains no room; give one with --room"),
        ("locate scan.mcap", "scan.mcap: contains no room; give one with --room"),
        ("map scan.mcap", "scan.mcap: contains no room; give --pose X,Y,DEG, or --room and --place"),
        (
            "fit scan.mcap --room flat.toml --free heading",
            "scan.mcap: its place is unknown, and x and y are fixed; give --place, or add position to --free",
        ),
        (
            "fit scan.mcap --free postion",
            "--free postion: unknown quantity; did you mean 'position'? expected some of x",
        ),
        (
            "fit scan.mcap --prior offset=3..4",
            "--prior offset=3..4: offset is not free; add it to --free, or use one of x, y, heading",
        ),
        (
            "compare scan.mcap --room flat.toml --place desk --fit colour",
            "--fit colour: unknown parameter; expected some of heading, offset, position",
        ),
        (
            "simulate flat.toml --place 0.5, 0.5",
            "Got unexpected extra argument(s) (0.5); see `sonarhw simulate --help`; write X,Y without a space",
        ),
        (
            "compare scan.mcap other.mcap",
            "Got unexpected extra argument(s) (other.mcap); see `sonarhw compare --help`; to compare two logs, use "
            "`sonarhw compare A.mcap --with B.mcap`",
        ),
        (
            "fit scan.mcap --room flat.toml --place 0.5, 0.5",
            "--place: expected one for each of 2 logs, got 1; write X,Y without a space",
        ),
        ("simulate flat.toml --place 0.5,", "room 'Flat': no place '0.5,'; its places: desk, corner, or X,Y in metres"),
        (
            "compare scan.mcap --place 1 2",
            "Got unexpected extra argument(s) (2); see `sonarhw compare --help`; write X,Y without a space",
        ),
        ("export scan.mcap", "No such command 'export'; did you mean `sonarhw log export`?"),
        ("record /dev/ttyUSB0", "No such command 'record'; did you mean `sonarhw scan`?"),
        ("help scan", "No such command 'help'; did you mean `sonarhw --help`?"),
        ("flsh", "No such command 'flsh'. Did you mean 'flash'?"),
        ("xyzzy", "No such command 'xyzzy'; see `sonarhw --help`"),
        ("log scan.mcap", "No such command 'scan.mcap'; did you mean `sonarhw log info scan.mcap`?"),
        ("room flat.toml", "No such command 'flat.toml'; did you mean `sonarhw room check flat.toml`?"),
        ("compare scan.mcap -room flat.toml", "No such option: -r; did you mean `--room`?"),
        ("turn 90", "Missing argument 'DEG'; expected `sonarhw turn URL DEG`; see `sonarhw turn --help`"),
        (
            "scan fake:laboratory",
            "Missing option '--out'; expected `sonarhw scan URL --out LOG.mcap`; see `sonarhw scan --help`",
        ),
        ("info fake", "fake: room missing; expected 'fake:NAME?place=NAME' or 'fake:FILE.toml?place=NAME'"),
        ("simulate lab", "unknown room 'lab'; did you mean 'laboratory'? known: arena,"),
        ("simulate scan.mcap", "scan.mcap: is a log; expected a room file, whose name ends in .toml"),
    ],
)
def test_an_error_states_what_to_write(
    folder: Path, command: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command.split()) == 2
    assert capsys.readouterr().err.startswith(f"sonarhw: {message}")


def test_a_map_needs_no_room_with_a_pose(folder: Path) -> None:
    assert run(["map", "scan.mcap", "--pose", "0.5,0.5,0"]) == 0


@pytest.mark.parametrize(
    "command",
    [
        "simulate flat.toml --place desk --out FILE.csv",
        "simulate flat.toml --place desk --out FILE.npz",
        "simulate flat.toml --place desk --out FILE.png",
        "simulate flat.toml --place desk --out FILE.mcap",
        "report scan.mcap --room flat.toml --place desk --out FILE.html",
        "fit scan.mcap --room flat.toml --place desk --free heading --samples 0 --out FILE.toml",
        "log export scan.mcap --out FILE.csv",
    ],
)
def test_a_written_file_is_named_on_standard_error_unless_quiet(
    folder: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = command.replace("FILE", "new").split()
    assert run(words) == 0
    printed = capsys.readouterr()
    assert f"{words[-1]}: written" in printed.err.splitlines()
    assert "written" not in printed.out
    assert run(["--quiet", *words, "--force"]) == 0
    assert capsys.readouterr().err == ""
