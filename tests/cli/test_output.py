"""Files that commands write: never over what they read."""

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
