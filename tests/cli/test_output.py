"""Files that commands write: under the right name, and never over what they read."""

import shutil
from pathlib import Path

import pytest

from cli.app import run
from tests.sonarhw.example_logs import write_example

ROOM = Path(__file__).parents[2] / "rooms" / "simple.toml"
IMPORT = ["--heading", "deg", "--range", "m"]


@pytest.mark.parametrize("by", ["its name", "a link", "a hard link"])
@pytest.mark.parametrize("command", ["import", "simulate", "paths", "compare", "export", "recover"])
def test_no_command_overwrites_what_it_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, by: str
) -> None:
    # formats are told by the ending, so that most commands only meet their own input under a second name
    ending = {"import": ".mcap", "recover": ".mcap", "export": ".mcap", "compare": ".png"}.get(command, ".csv")
    read, out = tmp_path / f"own{ending}", tmp_path / f"out{ending}"
    log = command in ("compare", "export", "recover")
    if log:
        write_example(read, 4)
    elif command == "import":
        read.write_text("deg,m\n0,1\n")
    else:
        shutil.copy(ROOM, read)
    match by:
        case "a link":
            out.symlink_to(read)
        case "a hard link":
            out.hardlink_to(read)
        case _:
            out = tmp_path / ".." / tmp_path.name / read.name
    before = read.read_bytes()
    arguments = {
        "import": ["import", read, *IMPORT, "--out", out],
        "simulate": ["simulate", read, "--place", "figure9", "--out", out],
        "paths": ["paths", read, "--place", "figure9", "--out", out],
        "compare": ["compare", read, "--room", ROOM, "--plot", out],
    }.get(command, ["log", command, read, "--out", out])
    assert run([*map(str, arguments), "--force"]) == 2
    error = capsys.readouterr().err
    assert "which this command reads" in error
    assert error.count("\n") == 1
    assert read.read_bytes() == before


@pytest.mark.parametrize(
    ("command", "out", "wanted"),
    [
        ("import", "-", ".mcap"),
        ("import", "x.csv", ".mcap"),
        ("import", "x", ".mcap"),
        ("recover", "-", ".mcap"),
        ("recover", "x.csv", ".mcap"),
        ("paths", "x.npz", ".csv, or - for standard output"),
        ("paths", "x.mcap", ".csv, or - for standard output"),
        ("simulate", "x.docx", ".csv, .npz, .png or .mcap, or - for standard output"),
        ("simulate", ".csv", ".csv, .npz, .png or .mcap, or - for standard output"),
        ("export", "x.png", ".csv, .npz or .mcap, or - for standard output"),
        ("compare", "-", ".png"),
        ("compare", "x.csv", ".png"),
    ],
)
def test_a_name_must_end_as_what_is_written(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: str,
    out: str,
    wanted: str,
) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    write_example(tmp_path / "scan.mcap", 4)
    (tmp_path / "own.csv").write_text("deg,m\n0,1\n")
    monkeypatch.chdir(folder)
    arguments = {
        "import": ["import", "../own.csv", *IMPORT],
        "compare": ["compare", "../scan.mcap", "--room", str(ROOM)],
        "simulate": ["simulate", str(ROOM), "--place", "figure9"],
        "paths": ["paths", str(ROOM), "--place", "figure9"],
    }.get(command, ["log", command, "../scan.mcap"])
    option = "--plot" if command == "compare" else "--out"
    assert run([*arguments, option, out]) == 2
    assert capsys.readouterr() == ("", f"sonarhw: {option} {out}: expected a name ending in {wanted}\n")
    assert [*folder.iterdir()] == []


def test_an_ending_may_be_in_capitals(tmp_path: Path) -> None:
    assert run(["simulate", str(ROOM), "--place", "figure9", "--out", str(tmp_path / "SCAN.NPZ")]) == 0
    assert (tmp_path / "SCAN.NPZ").read_bytes().startswith(b"PK")


@pytest.mark.parametrize("ending", [".csv", ".npz", ".mcap"])
def test_a_folder_is_no_file(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str) -> None:
    out = tmp_path / f"d{ending}"
    out.mkdir()
    assert run(["simulate", str(ROOM), "--place", "figure9", "--out", str(out), "--force"]) == 2
    assert capsys.readouterr().err == f"sonarhw: --out {out}: is a folder; give the name of a file in it\n"
